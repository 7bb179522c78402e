"""Cheapest routes over grids in the rotated frame, stage by stage: the compiled part of `planner.seeding.grid_routes`.

A dynamic programme over forward steps.  It leaves out every cell through which no route is cheaper than a bound; where
a route within the bound is found it is the cheapest of all.
"""

import math

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.clearance_buffer import required_clearance
from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.grid_prices import Grid, find_obstacles, position_of, set_prices
from world.kernels import Records, compiled

Floats = NDArray[np.float64]
Codes = NDArray[np.int32]

# Steps across a grid's cell that one stage forward may make.
SIDEWAYS = 3
# A cell of a route: its places among those across and among the layers.
ROUTE_CELL = np.dtype([("across", np.int64), ("layer", np.int64)], align=True)
# Layers that one step may climb and sink.
STEP_LAYERS = np.dtype([("climb", np.int64), ("sink", np.int64)], align=True)
# First and last place across, of a layer, that has a cost; first > last for none.
SPAN = np.dtype([("first", np.int64), ("last", np.int64)], align=True)


@compiled
def layers_a_step(
    data: ProblemArrays, frame: RotatedFrame, step: float, layers: Floats, ratio: float
) -> Records:  # pragma: no cover - compiled
    """`STEP_LAYERS` records (sideways, layers) of one step on its course and at its height."""
    pitch = layers[1] - layers[0] if layers.size > 1 else 1.0
    out = np.zeros((2 * SIDEWAYS + 1, layers.size), dtype=STEP_LAYERS)
    a, b = np.zeros(3), np.zeros(3)
    for side in range(-SIDEWAYS, SIDEWAYS + 1):
        run = step * math.sqrt(1.0 + (side * ratio) ** 2)
        b[0], b[1] = position_of(frame, step, side * ratio * step)
        a[0], a[1] = frame.east, frame.north
        for z in range(layers.size):
            a[2] = layers[z]
            b[2] = layers[z]
            climb, dive = slope_limits(data, a, b)
            out[side + SIDEWAYS, z].climb = max(0, math.floor(math.tan(climb) * run / pitch))
            out[side + SIDEWAYS, z].sink = max(0, math.floor(math.tan(dive) * run / pitch))
    return out


@compiled
def relax(
    cost: Floats,
    price: Floats,
    after: Floats,
    came: Codes,
    start: int,
    end: int,
    priced: int,
    count: int,
    length: float,
) -> None:  # pragma: no cover - compiled
    """One move from `count` cells beside each other to as many, at the prices of cells from `priced`; all flat."""
    for k in range(count):
        # Unsigned, or numba would look whether each index counts from the end; and without a branch.  So this, the
        # innermost loop, takes several cells at once.
        i, j = np.uintp(start) + np.uintp(k), np.uintp(end) + np.uintp(k)
        total = cost[i] + length * price[np.uintp(priced) + np.uintp(k)]
        better = total < after[j]
        after[j] = total if better else after[j]
        came[j] = start + k if better else came[j]


@compiled
def step_on(
    cost: Floats,
    after: Floats,
    came: Codes,
    spans: Records,
    step_layers: Records,
    price: Floats,
    step: float,
    pitch: float,
    ratio: float,
) -> None:  # pragma: no cover - compiled
    """Relax one stage: costs (layers, across) before and after, the cell each came from, and the cost per m of cells.

    spans: `SPAN` records (layers,) of the cells with a cost before.  pitch: between layers, m.
    """
    high, wide = cost.shape
    flat, flat_after, flat_came, flat_price = cost.ravel(), after.ravel(), came.ravel(), price.ravel()
    for z in range(high):
        first, last = spans[z].first, spans[z].last
        if first > last:
            continue
        for side in range(-SIDEWAYS, SIDEWAYS + 1):
            a, b = max(first, -side), min(last, wide - 1 - side) + 1
            if a >= b:
                continue
            most = step_layers[side + SIDEWAYS, z]
            bottom, top = max(0, z - most.sink), min(high - 1, z + most.climb)
            for z2 in range(bottom, top + 1):
                length = math.sqrt(step * step * (1.0 + (side * ratio) ** 2) + ((z2 - z) * pitch) ** 2)
                here, there = z * wide + a, z2 * wide + a + side
                relax(flat, flat_price, flat_after, flat_came, here, there, there, b - a, length)


@compiled
def way_ahead(
    columns: int, home: int, left: int, step: float, ratio: float, out: Floats
) -> None:  # pragma: no cover - compiled
    """Length on the map of the shortest way from each place across to the destination, `left` stages away, m."""
    for y in range(columns):
        aside = abs(y - home)
        if aside > SIDEWAYS * left:
            out[y] = math.inf
            continue
        k = aside // left if left > 0 else 0
        straight, more = (k + 1) * left - aside, aside - k * left
        far, further = math.sqrt(1.0 + (k * ratio) ** 2), math.sqrt(1.0 + ((k + 1) * ratio) ** 2)
        out[y] = step * (straight * far + more * further)


@compiled
def prune(
    after: Floats, spans: Records, ahead: Floats, rises: Floats, bound: float, low: int, high: int
) -> None:  # pragma: no cover - compiled
    """Drop cells low..high from which no route ends within the bound; note which are left.

    spans: `SPAN` records (layers,) to fill.  ahead: (across,) m on the map to the destination.  rises: (layers,) m of
    height to it.
    """
    for z in range(after.shape[0]):
        spans[z].first, spans[z].last = after.shape[1], -1
        rise2 = rises[z] * rises[z]
        for y in range(low, high + 1):
            left = bound - after[z, y]
            if left >= 0.0 and left * left >= ahead[y] * ahead[y] + rise2 and after[z, y] < math.inf:
                spans[z].first = min(spans[z].first, y)
                spans[z].last = y
            else:
                after[z, y] = math.inf


@compiled
def cheapest_route(
    data: ProblemArrays, frame: RotatedFrame, grid: Grid, extra: Floats, bound: float
) -> tuple[Records, float]:  # pragma: no cover - compiled
    """`ROUTE_CELL` records (stages + 1,) of the cheapest route over a grid, and its cost; empty where none is.

    extra: (stages + 1, across) added to the cost per m.  bound: the most that it may cost; a route that costs more is
    not looked for.
    """
    stages, wide, high = grid.stages, grid.across.size, grid.layers.size
    step = frame.length / stages
    pitch = grid.layers[1] - grid.layers[0] if high > 1 else 1.0
    step_layers, required = layers_a_step(data, frame, step, grid.layers, grid.ratio), required_clearance(data)
    obstacles = find_obstacles(data, frame, step, grid.shrink)
    came = np.empty((stages + 1, high, wide), dtype=np.int32)
    price, cost, after = np.full((high, wide), np.inf), np.full((high, wide), np.inf), np.full((high, wide), np.inf)
    home, start = int(np.argmin(np.abs(grid.across))), int(np.argmin(np.abs(grid.layers - data.start[2])))
    goal = int(np.argmin(np.abs(grid.layers - data.destination[2])))
    rises, ahead = grid.layers - grid.layers[goal], np.empty(wide)
    cost[start, home] = 0.0
    spans = np.zeros(high, dtype=SPAN)
    for z in range(high):
        spans[z].first, spans[z].last = (home, home) if z == start else (wide, -1)
    for stage in range(1, stages + 1):
        low, last = wide, -1
        for z in range(high):
            low, last = min(low, spans[z].first), max(last, spans[z].last)
        low, last = max(0, low - SIDEWAYS), min(wide - 1, last + SIDEWAYS)
        if low > last:
            break
        set_prices(data, required, frame, stage, obstacles, grid, extra, low, last, price)
        after[:, low : last + 1] = np.inf
        step_on(cost, after, came[stage], spans, step_layers, price, step, pitch, grid.ratio)
        way_ahead(wide, home, stages - stage, step, grid.ratio, ahead)
        prune(after, spans, ahead, rises, bound, low, last)
        cost, after = after, cost
    if spans[goal].first > home or spans[goal].last < home or cost[goal, home] == np.inf:
        return np.zeros(0, dtype=ROUTE_CELL), np.inf
    return trace_back(came, goal, home), cost[goal, home]


@compiled
def trace_back(came: Codes, layer: int, across: int) -> Records:  # pragma: no cover - compiled
    """`ROUTE_CELL` records from the start to this cell of the last stage; came: (stages + 1, layers, across)."""
    wide = came.shape[2]
    cells = np.zeros(came.shape[0], dtype=ROUTE_CELL)
    for stage in range(came.shape[0] - 1, -1, -1):
        cells[stage].across = across
        cells[stage].layer = layer
        if stage > 0:
            parent = came[stage, layer, across]
            layer, across = parent // wide, parent % wide
    return cells
