"""Seeds from coarse grids: a shortest way through terrain and threats in the rotated frame, stage by stage.

The grid picks the side of each obstacle; `planner.fitting` then puts the path's waypoints, one an interval, where
whole legs are judged.  Both are dynamic programmes over forward steps: a path that the rotated encoding can
hold never turns back.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.encoding import Frame, rotated_frame
from planner.fitting import KILL_COST, fit_waypoints
from planner.legs import slope_limits
from planner.reserve import pack_clearance, required_clearance
from planner.rules import Rules
from world.terrain import ground_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Steps between stages longer than this (m) are coarse: kill spheres grow there by this share of a step, for what lies
# between the cells.  Finer grids keep them as they are, and find the narrow gaps.
COARSE, COARSE_GROWTH = 250.0, 0.15
# Steps across a grid's cell that one stage forward may make.
SIDEWAYS = 3
# Pitch of the layers, as a share of the pitch along: what the gentler slope limit climbs or sinks in a step, over this,
# and between these.
LAYERS_A_STEP = 2.5
LOW_LAYER, HIGH_LAYER = 0.05, 0.12
# Cells of one grid, at most: stages x across x layers.
MOST_CELLS = 1_200_000


@dataclass(frozen=True, slots=True)
class Grid:
    """One resolution: stages along, places across (m from the line) and layers of height (m)."""

    stages: int
    across: Floats
    layers: Floats


def make_grid(rules: Rules, frame: Frame, span: tuple[float, float], stages: int) -> Grid:
    """Make a grid of this many stages, square in the plane, its layers passing through the start's height.

    The pitch grows where the grid would get too large.
    """
    low, high = max(rules.floor, float(np.nanmin(rules.heights))), rules.ceiling
    ends = np.stack([rules.start, rules.destination])
    share = math.tan(max(0.0, min(slope_limits(rules, ends[0], np.array([*ends[1, :2], ends[0, 2]])))))
    share = min(HIGH_LAYER, max(LOW_LAYER, share / LAYERS_A_STEP))
    while True:
        step = frame.length / stages
        layer = share * step
        below, above = math.floor(-span[0] / step), math.floor(span[1] / step)
        across = np.arange(-below, above + 1) * step
        up = np.arange(math.ceil((low - rules.start[2]) / layer), math.floor((high - rules.start[2]) / layer) + 1)
        if stages <= 4 or (stages + 1) * across.size * max(1, up.size) <= MOST_CELLS:
            return Grid(stages, np.asarray(across, np.float64), np.asarray(rules.start[2] + up * layer, np.float64))
        stages = max(4, int(stages / 1.2))


def grid_route(rules: Rules, frame: Frame, grid: Grid, used: list[Floats]) -> Floats | None:
    """Cheapest way over a grid as (stages + 1, 3) along, across, up; None where terrain and ceiling close it.

    used: earlier routes; keeping near them costs extra, so that the next one takes another side.
    """
    if grid.layers.size == 0:
        return None
    packed = np.array([*frame.origin, *frame.direction, frame.length])
    extra = np.zeros((grid.stages + 1, grid.across.size))
    width = max(800.0, 3.0 * frame.length / grid.stages)
    for route in used:
        stage_across = np.interp(np.linspace(0.0, frame.length, grid.stages + 1), route[:, 0], route[:, 1])
        extra += 1.0 * np.maximum(0.0, 1.0 - np.abs(grid.across[None, :] - stage_across[:, None]) / width)
    floors = _floors(rules, packed, grid.stages, grid.across)
    cells = _dynamic(rules, packed, grid.across, grid.layers, floors, extra)
    if cells.size == 0:
        return None
    along = np.linspace(0.0, frame.length, grid.stages + 1)
    return np.column_stack([along, grid.across[cells[:, 0]], grid.layers[cells[:, 1]]])


@compiled
def _place(packed: Floats, along: float, across: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """World position of a rotated one; packed: origin, direction, length."""
    return (
        packed[0] + packed[2] * along - packed[3] * across,
        packed[1] + packed[3] * along + packed[2] * across,
    )


@compiled
def _floors(rules: Rules, packed: Floats, stages: int, across: Floats) -> Floats:  # pragma: no cover - compiled
    """Lowest height allowed in each cell (stages + 1, across): highest ground on 3 x 3 samples, plus clearance."""
    step = packed[4] / stages
    clear = pack_clearance(rules)
    out = np.empty((stages + 1, across.size))
    for s in range(stages + 1):
        for y in range(across.size):
            worst = -math.inf
            for i in range(-1, 2):
                for j in range(-1, 2):
                    if (s == 0 or s == stages) and not (i == 0 and j == 0):
                        continue
                    east, north = _place(packed, s * step + 0.4 * i * step, across[y] + 0.4 * j * step)
                    ground = ground_height(rules.heights, rules.to_pixel, east, north)
                    if math.isnan(ground):
                        ground = math.inf
                    worst = max(worst, ground + required_clearance(clear, east, north))
            east, north = _place(packed, s * step, across[y])
            west, south = rules.bounds[0, 0], rules.bounds[1, 0]
            if not (west <= east <= rules.bounds[0, 1] and south <= north <= rules.bounds[1, 1]):
                worst = math.inf
            out[s, y] = worst
    return out


@compiled
def _danger(
    rules: Rules, packed: Floats, stage: int, step: float, across: Floats, layers: Floats, out: Floats
) -> None:  # pragma: no cover - compiled
    """Cost per m of a stage's cells (across, layers) inside kill spheres, growing inwards."""
    out[:] = 0.0
    for k in range(rules.threats.shape[0]):
        radius = rules.threats[k, 3]
        if radius <= 0.0:
            continue
        radius += rules.kill_margin + (COARSE_GROWTH * step if step > COARSE else 0.0)
        for y in range(across.size):
            east, north = _place(packed, stage * step, across[y])
            flat2 = (east - rules.threats[k, 0]) ** 2 + (north - rules.threats[k, 1]) ** 2
            if flat2 >= radius * radius:
                continue
            for z in range(layers.size):
                d2 = flat2 + (layers[z] - rules.threats[k, 2]) ** 2
                if d2 < radius * radius:
                    out[y, z] += KILL_COST * (1.0 + 2.0 * (1.0 - math.sqrt(d2) / radius))


@compiled
def _moves(rules: Rules, packed: Floats, step: float, layers: Floats) -> Ints:  # pragma: no cover - compiled
    """Layers that one step may climb and sink, (sideways, layers, 2), on its course and at its height."""
    pitch = layers[1] - layers[0] if layers.size > 1 else 1.0
    out = np.zeros((2 * SIDEWAYS + 1, layers.size, 2), dtype=np.int64)
    a, b = np.zeros(3), np.zeros(3)
    for side in range(-SIDEWAYS, SIDEWAYS + 1):
        run = step * math.sqrt(1.0 + side * side)
        b[0], b[1] = _place(packed, step, side * step)
        a[0], a[1] = packed[0], packed[1]
        for z in range(layers.size):
            a[2] = layers[z]
            b[2] = layers[z]
            climb, dive = slope_limits(rules, a, b)
            out[side + SIDEWAYS, z, 0] = max(0, math.floor(math.tan(climb) * run / pitch))
            out[side + SIDEWAYS, z, 1] = max(0, math.floor(math.tan(dive) * run / pitch))
    return out


@compiled
def _step_on(
    cost: Floats, after: Floats, came: Ints, moves: Ints, lowest: Ints, dear: Floats, step: float, pitch: float
) -> None:  # pragma: no cover - compiled
    """Relax one stage: costs (across, layers) before and after, parents; lowest layer and cost per m of each cell."""
    wide, high = cost.shape
    for y in range(wide):
        for z in range(high):
            here = cost[y, z]
            if here == np.inf:
                continue
            for side in range(max(-SIDEWAYS, -y), min(SIDEWAYS, wide - 1 - y) + 1):
                y2 = y + side
                run2 = step * step * (1.0 + side * side)
                bottom = max(lowest[y2], z - moves[side + SIDEWAYS, z, 1])
                for z2 in range(bottom, min(high - 1, z + moves[side + SIDEWAYS, z, 0]) + 1):
                    total = here + math.sqrt(run2 + ((z2 - z) * pitch) ** 2) * dear[y2, z2]
                    if total < after[y2, z2]:
                        after[y2, z2] = total
                        came[y2, z2] = y * high + z


@compiled
def _dynamic(
    rules: Rules, packed: Floats, across: Floats, layers: Floats, floors: Floats, extra: Floats
) -> Ints:  # pragma: no cover - compiled
    """Cells (stages + 1, 2) of the cheapest way; empty where there is none."""
    stages = floors.shape[0] - 1
    step = packed[4] / stages
    wide, high = across.size, layers.size
    moves = _moves(rules, packed, step, layers)
    pitch = layers[1] - layers[0] if high > 1 else 1.0
    came = np.full((stages + 1, wide, high), -1, dtype=np.int32)
    dear = np.zeros((wide, high))
    cost = np.full((wide, high), np.inf)
    home = int(np.argmin(np.abs(across)))
    cost[home, np.argmin(np.abs(layers - rules.start[2]))] = 0.0
    lowest = np.empty(wide, dtype=np.int64)
    for s in range(1, stages + 1):
        _danger(rules, packed, s, step, across, layers, dear)
        for y in range(wide):
            dear[y] += 1.0 + extra[s, y]
            # The destination is where it is, whatever its clearance.
            lowest[y] = 0 if s == stages and y == home else np.searchsorted(layers, floors[s, y])
        after = np.full((wide, high), np.inf)
        _step_on(cost, after, came[s], moves, lowest, dear, step, pitch)
        cost = after
    cells = np.empty((stages + 1, 2), dtype=np.int64)
    y, z = home, int(np.argmin(np.abs(layers - rules.destination[2])))
    if cost[y, z] == np.inf:
        return np.empty((0, 2), dtype=np.int64)
    for s in range(stages, -1, -1):
        cells[s, 0] = y
        cells[s, 1] = z
        if s > 0:
            parent = came[s, y, z]
            y, z = parent // high, parent % high
    return cells


def routes(
    rules: Rules, span: tuple[float, float], waypoints: int, stages: tuple[int, ...], each: int
) -> Iterator[Floats]:
    """Seed paths (w, 3) world m: up to `each` different routes from a grid of each number of stages, as found."""
    frame = rotated_frame(rules.start, rules.destination)
    for number in stages:
        grid = make_grid(rules, frame, span, number)
        used: list[Floats] = []
        for _ in range(each):
            route = grid_route(rules, frame, grid, used)
            if route is None:
                break
            used.append(route)
            yield fit_waypoints(rules, frame, route, waypoints)


def seeds(rules: Rules, span: tuple[float, float], waypoints: int, stages: tuple[int, ...], each: int) -> list[Floats]:
    """All of `routes`."""
    return list(routes(rules, span, waypoints, stages, each))
