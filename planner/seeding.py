"""Seeds from coarse grids: a shortest way through terrain and threats in the rotated frame, stage by stage.

The grid picks the side of each obstacle; `fit_waypoints` then puts the path's waypoints, one an interval, where
whole legs are judged.  Both are dynamic programmes over forward steps: a path that the rotated encoding can
hold never turns back.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.criteria import Gauge, make_gauge, pack_clearance, required_clearance, slope_excess, slope_limits
from planner.encoding import Frame, rotated_frame
from planner.graded import kill_density, pixels, terrain_excess
from planner.rules import Rules
from world.terrain import ground_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cost of a m inside a kill sphere, of a m of depth x km, and of a unit of slope excess, in m of path.
KILL_COST = 40.0
DEPTH_COST = 2e4
SLOPE_COST = 1e6
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
        radius += rules.kill_margin + 0.15 * step
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


@compiled
def leg_cost(
    rules: Rules, gauge: Gauge, seen: Ints, stamp: int, a: Floats, b: Floats
) -> float:  # pragma: no cover - compiled
    """Cost of one leg, in m of path: its length and what it violates.  seen, stamp: of `kill_density`."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    run = math.sqrt(dx * dx + dy * dy)
    length = math.sqrt(dx * dx + dy * dy + (b[2] - a[2]) ** 2)
    ux, uy = (dx / run, dy / run) if run > 0.0 else (0.0, 0.0)
    steep = slope_excess(rules, gauge, ux, uy, run, a[2], b[2])
    ends = pixels(rules.to_pixel, a[0], a[1], b[0], b[1])
    depth, _ = terrain_excess(rules.heights, gauge.clear, ends, a[0], a[1], a[2], b[0], b[1], b[2])
    total = length + SLOPE_COST * steep + DEPTH_COST * depth
    kill, _ = kill_density(
        rules.threats, rules.missiles, rules.kill_margin, seen, stamp, a[0], a[1], a[2], b[0], b[1], b[2]
    )
    if kill > 0.0:
        total += KILL_COST * length * min(1.0, 0.1 + kill)
    return total


@compiled
def _choose(rules: Rules, candidates: Floats) -> Ints:  # pragma: no cover - compiled
    """Which of the candidates (w, c, 3) world m to take at each waypoint, so that the legs cost least."""
    count, width, _ = candidates.shape
    came = np.zeros((count, width), dtype=np.int64)
    cost = np.full(width, np.inf)
    cost[0] = 0.0
    gauge = make_gauge(rules)
    seen, stamp = np.zeros(rules.threats.shape[0], dtype=np.int64), 0
    least = np.empty(width)
    for i in range(1, count):
        after = np.full(width, np.inf)
        for k in range(width if i < count - 1 else 1):
            b = candidates[i, k]
            for j in range(width):
                a = candidates[i - 1, j]
                # No leg costs less than its length.
                least[j] = cost[j] + math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            # The most promising first: the first without violations ends it.
            while True:
                j = int(np.argmin(least))
                if least[j] >= after[k]:
                    break
                least[j] = np.inf
                stamp += 1
                total = cost[j] + leg_cost(rules, gauge, seen, stamp, candidates[i - 1, j], b)
                if total < after[k]:
                    after[k] = total
                    came[i, k] = j
        cost = after
    out = np.zeros(count, dtype=np.int64)
    for i in range(count - 1, 0, -1):
        out[i - 1] = came[i, out[i]]
    return out


def fit_waypoints(rules: Rules, frame: Frame, route: Floats, waypoints: int, rounds: int = 2) -> Floats:
    """Waypoints (w, 3) world m along a route (s, 3) in rotated axes, one an interval, tight as whole legs allow."""
    edges = np.linspace(0.0, frame.length, waypoints - 1)
    shares = np.linspace(0.1, 0.9, 9)
    height = 20.0
    candidates = np.empty((waypoints, shares.size * 3, 3))
    for i in range(waypoints - 2):
        along = edges[i] + shares * (edges[i + 1] - edges[i])
        points = np.column_stack([along, *(np.interp(along, route[:, 0], route[:, axis]) for axis in (1, 2))])
        for k, lift in enumerate((0.0, height, 3.0 * height)):
            candidates[i + 1, k * shares.size : (k + 1) * shares.size] = points + np.array([0.0, 0.0, lift])
    chosen = _pick(rules, frame, candidates)
    span = edges[1] - edges[0]
    offsets = np.array([[a, b, c] for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)], dtype=np.float64)
    reach = np.array([0.25 * span, 0.2 * span, 40.0])
    for _ in range(rounds):
        candidates = np.repeat(chosen[:, None, :], len(offsets), axis=1)
        candidates[1:-1] += offsets * reach
        low, high = edges[:-1, None], edges[1:, None]
        candidates[1:-1, :, 0] = np.clip(candidates[1:-1, :, 0], low, high)
        candidates[1:-1, :, 2] = np.clip(candidates[1:-1, :, 2], rules.floor, rules.ceiling)
        chosen = _pick(rules, frame, candidates)
        reach *= 0.7
    return frame.restore(chosen)


def _pick(rules: Rules, frame: Frame, candidates: Floats) -> Floats:
    """Chosen candidates (w, 3), in rotated axes, the ends fixed."""
    candidates[0], candidates[-1] = frame.rotate(rules.start), frame.rotate(rules.destination)
    chosen = _choose(rules, np.ascontiguousarray(frame.restore(candidates)))
    return candidates[np.arange(len(candidates)), chosen]


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
