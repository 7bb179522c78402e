"""Cheapest ways over grids in the rotated frame, stage by stage: the compiled part of `planner.seeding.grid_routes`.

A dynamic programme over forward steps.  It leaves out every cell through which no way is cheaper than a bound; where
a way within the bound is found it is the cheapest of all.
"""

import math

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.clearance_reserve import pack_clearance, required_clearance
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem_arrays import Rules
from world.frames import polymap
from world.kernels import compiled
from world.terrain import pixel_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Codes = NDArray[np.int32]

# Cost of a m inside a kill sphere, in m of path.
KILL_COST = 40.0
# Steps between stages longer than this (m) are coarse: kill spheres grow there by this share of a step, for what lies
# between the cells.  Finer grids keep them as they are, and find the narrow gaps.
COARSE, COARSE_GROWTH = 250.0, 0.15
# Steps across a grid's cell that one stage forward may make.
SIDEWAYS = 3


@compiled
def _place(packed: Floats, along: float, across: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """World position of a rotated one; packed: origin, direction, length."""
    return (
        packed[0] + packed[2] * along - packed[3] * across,
        packed[1] + packed[3] * along + packed[2] * across,
    )


@compiled
def _floor(
    rules: Rules, clear: Floats, packed: Floats, along: float, across: float, pixel_steps: Floats
) -> float:  # pragma: no cover - compiled
    """Lowest height allowed in a cell: highest ground on 3 x 3 samples, plus clearance; inf outside the map.

    pixel_steps: (2, 2) columns and rows from sample to sample, along and across; 0 for the middle one alone.
    """
    east, north = _place(packed, along, across)
    west, south = rules.bounds[0, 0], rules.bounds[1, 0]
    if not (west <= east <= rules.bounds[0, 1] and south <= north <= rules.bounds[1, 1]):
        return math.inf
    col, row = polymap(rules.to_pixel, east, north)
    spread = 0 if pixel_steps[0, 0] == 0.0 and pixel_steps[0, 1] == 0.0 else 1
    worst = -math.inf
    for i in range(-spread, spread + 1):
        for j in range(-spread, spread + 1):
            ground = pixel_height(
                rules.heights,
                col + i * pixel_steps[0, 0] + j * pixel_steps[1, 0],
                row + i * pixel_steps[0, 1] + j * pixel_steps[1, 1],
            )
            if math.isnan(ground):
                return math.inf
            worst = max(worst, ground)
    return worst + required_clearance(clear, east, north)


@compiled
def _pixel_steps(rules: Rules, packed: Floats, along: float, reach: float, out: Floats) -> None:  # pragma: no cover
    """Columns and rows (2, 2) that `reach` m along and across the line are, at this distance along."""
    east, north = _place(packed, along, 0.0)
    col, row = polymap(rules.to_pixel, east, north)
    for k in range(2):
        east, north = _place(packed, along + (1 - k) * reach, k * reach)
        out[k, 0], out[k, 1] = polymap(rules.to_pixel, east, north)
        out[k, 0] -= col
        out[k, 1] -= row


@compiled
def _add_danger(
    rules: Rules,
    places: Floats,
    along: float,
    step: float,
    grid: tuple[Floats, Floats],
    low: int,
    high: int,
    dear: Floats,
) -> None:  # pragma: no cover - compiled
    """Add the cost per m inside kill spheres, growing inwards, to a stage's cells dear (layers, across) low..high.

    places: along and across of the threats.  grid: across and layers.
    """
    across, layers = grid
    pitch = across[1] - across[0] if across.size > 1 else 1.0
    for k in range(rules.threats.shape[0]):
        radius = rules.threats[k, 3]
        if radius <= 0.0:
            continue
        radius += rules.kill_margin + (COARSE_GROWTH * step if step > COARSE else 0.0)
        ahead2 = (along - places[k, 0]) ** 2
        if ahead2 >= radius * radius:
            continue
        half = math.sqrt(radius * radius - ahead2)
        first = max(low, math.ceil((places[k, 1] - half - across[0]) / pitch))
        last = min(high, math.floor((places[k, 1] + half - across[0]) / pitch))
        for z in range(layers.size):
            flat2 = ahead2 + (layers[z] - rules.threats[k, 2]) ** 2
            if flat2 >= radius * radius:
                continue
            for y in range(first, last + 1):
                d2 = flat2 + (across[y] - places[k, 1]) ** 2
                if d2 < radius * radius:
                    dear[z, y] += KILL_COST * (3.0 - 2.0 * math.sqrt(d2) / radius)


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
def _relax(
    cost: Floats, dear: Floats, after: Floats, came: Codes, start: int, end: int, count: int, length: float
) -> None:  # pragma: no cover - compiled
    """One move from `count` cells beside each other to as many; all arrays flat."""
    for k in range(count):
        # Unsigned, or numba would look whether each index counts from the end; and without a branch.  So this, the
        # innermost loop, takes several cells at once.
        i, j = np.uintp(start) + np.uintp(k), np.uintp(end) + np.uintp(k)
        total = cost[i] + length * dear[j]
        better = total < after[j]
        after[j] = total if better else after[j]
        came[j] = start + k if better else came[j]


@compiled
def _step_on(
    cost: Floats, after: Floats, came: Codes, alive: Ints, moves: Ints, dear: Floats, step: float, pitch: float
) -> None:  # pragma: no cover - compiled
    """Relax one stage: costs (layers, across) before and after, the cell each came from, and the cost per m of cells.

    alive: (layers, 2) first and last place across of each layer that has a cost.
    """
    high, wide = cost.shape
    flat, flat_after, flat_came, flat_dear = cost.ravel(), after.ravel(), came.ravel(), dear.ravel()
    for z in range(high):
        first, last = alive[z, 0], alive[z, 1]
        if first > last:
            continue
        for side in range(-SIDEWAYS, SIDEWAYS + 1):
            a, b = max(first, -side), min(last, wide - 1 - side) + 1
            if a >= b:
                continue
            bottom, top = max(0, z - moves[side + SIDEWAYS, z, 1]), min(high - 1, z + moves[side + SIDEWAYS, z, 0])
            for z2 in range(bottom, top + 1):
                length = math.sqrt(step * step * (1.0 + side * side) + ((z2 - z) * pitch) ** 2)
                _relax(flat, flat_dear, flat_after, flat_came, z * wide + a, z2 * wide + a + side, b - a, length)


@compiled
def _ahead(wide: int, home: int, left: int, step: float, out: Floats) -> None:  # pragma: no cover - compiled
    """Length on the map of the shortest way from each place across to the destination, `left` stages away, m."""
    for y in range(wide):
        aside = abs(y - home)
        if aside > SIDEWAYS * left:
            out[y] = math.inf
            continue
        k = aside // left if left > 0 else 0
        straight, more = (k + 1) * left - aside, aside - k * left
        out[y] = step * (straight * math.sqrt(1.0 + k * k) + more * math.sqrt(1.0 + (k + 1) * (k + 1)))


@compiled
def _prune(
    after: Floats, alive: Ints, ahead: Floats, rises: Floats, bound: float, low: int, high: int
) -> None:  # pragma: no cover - compiled
    """Drop cells low..high from which no way ends within the bound; see which are left.

    ahead: (across,) m on the map to the destination.  rises: (layers,) m of height to it.
    """
    for z in range(after.shape[0]):
        alive[z, 0], alive[z, 1] = after.shape[1], -1
        rise2 = rises[z] * rises[z]
        for y in range(low, high + 1):
            left = bound - after[z, y]
            if left >= 0.0 and left * left >= ahead[y] * ahead[y] + rise2 and after[z, y] < math.inf:
                alive[z, 0] = min(alive[z, 0], y)
                alive[z, 1] = y
            else:
                after[z, y] = math.inf


@compiled
def _fill(
    rules: Rules,
    clear: Floats,
    packed: Floats,
    stage: int,
    places: Floats,
    grid: tuple[Floats, Floats],
    extra: Floats,
    low: int,
    high: int,
    dear: Floats,
) -> None:  # pragma: no cover - compiled
    """Cost per m of a stage's cells dear (layers, across) low..high; inf where the ground is too near."""
    across, layers = grid
    stages = extra.shape[0] - 1
    step = packed[4] / stages
    pixel_steps = np.empty((2, 2))
    _pixel_steps(rules, packed, stage * step, 0.4 * step if stage < stages else 0.0, pixel_steps)
    for y in range(low, high + 1):
        # The destination is where it is, whatever its clearance.
        if stage == stages and across[y] == 0.0:
            floor = -math.inf
        else:
            floor = _floor(rules, clear, packed, stage * step, across[y], pixel_steps)
        for z in range(layers.size):
            dear[z, y] = 1.0 + extra[stage, y] if layers[z] >= floor else math.inf
    _add_danger(rules, places, stage * step, step, grid, low, high, dear)


@compiled
def cheapest_way(
    rules: Rules, packed: Floats, across: Floats, layers: Floats, extra: Floats, bound: float
) -> tuple[Ints, float]:  # pragma: no cover - compiled
    """Cells (stages + 1, 2), places across and layers, of the cheapest way, and its cost; empty where none is.

    packed: origin, direction, length.  extra: (stages + 1, across) added to the cost per m.  bound: the most that it
    may cost; a way that costs more is not looked for.
    """
    stages, wide, high = extra.shape[0] - 1, across.size, layers.size
    step = packed[4] / stages
    pitch = layers[1] - layers[0] if high > 1 else 1.0
    moves, clear = _moves(rules, packed, step, layers), pack_clearance(rules)
    places = np.empty((rules.threats.shape[0], 2))
    for k in range(places.shape[0]):
        east, north = rules.threats[k, 0] - packed[0], rules.threats[k, 1] - packed[1]
        places[k, 0], places[k, 1] = packed[2] * east + packed[3] * north, packed[2] * north - packed[3] * east
    came = np.empty((stages + 1, high, wide), dtype=np.int32)
    dear, cost, after = np.full((high, wide), np.inf), np.full((high, wide), np.inf), np.full((high, wide), np.inf)
    home, start = int(np.argmin(np.abs(across))), int(np.argmin(np.abs(layers - rules.start[2])))
    goal = int(np.argmin(np.abs(layers - rules.destination[2])))
    rises, ahead = layers - layers[goal], np.empty(wide)
    cost[start, home] = 0.0
    alive = np.empty((high, 2), dtype=np.int64)
    alive[:, 0], alive[:, 1] = wide, -1
    alive[start] = home
    low, last = home, home
    for s in range(1, stages + 1):
        low, last = max(0, alive[:, 0].min() - SIDEWAYS), min(wide - 1, alive[:, 1].max() + SIDEWAYS)
        if low > last:
            break
        _fill(rules, clear, packed, s, places, (across, layers), extra, low, last, dear)
        after[:, low : last + 1] = np.inf
        _step_on(cost, after, came[s], alive, moves, dear, step, pitch)
        _ahead(wide, home, stages - s, step, ahead)
        _prune(after, alive, ahead, rises, bound, low, last)
        cost, after = after, cost
    if alive[goal, 0] > home or alive[goal, 1] < home or cost[goal, home] == np.inf:
        return np.empty((0, 2), dtype=np.int64), np.inf
    cells = np.empty((stages + 1, 2), dtype=np.int64)
    y, z = home, goal
    for s in range(stages, -1, -1):
        cells[s, 0] = y
        cells[s, 1] = z
        if s > 0:
            parent = came[s, z, y]
            z, y = parent // wide, parent % wide
    return cells, cost[goal, home]
