"""Routes over coarse grids: cheapest ways through terrain and threats in the rotated frame, stage by stage.

The grid picks the side of each obstacle; `planner.seeding.waypoint_fitting` then puts the path's waypoints, one an
interval, where whole legs are evaluated.  Both are dynamic programmes over forward steps: a path that the rotated
encoding can hold never turns back.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.grid_kernels import cheapest_route
from planner.seeding.grid_prices import Grid

Floats = NDArray[np.float64]

# Pitch of the layers, as a share of the pitch along: what the gentler slope limit climbs or sinks in a step, over this,
# and between these.
LAYERS_A_STEP = 2.5
LOW_LAYER, HIGH_LAYER = 0.05, 0.12
# Cells of one grid, at most: stages x across x layers.
MOST_CELLS = 1_200_000
# What the first route is expected to cost, over the straight line; grids know eight courses and are too long by that.
EXPECTED = 1.12
# Routes beside one another: within this of an earlier one (m, or steps if that is more) a route costs up to twice.
APART, APART_STEPS = 800.0, 3.0


@dataclass(frozen=True, slots=True)
class GridRoute:
    """A way over a grid: points (stages + 1, 3) along, across, up, and its cost in m of path."""

    points: Floats
    cost: float


def make_grid(data: ProblemArrays, frame: RotatedFrame, span: tuple[float, float], stages: int) -> Grid:
    """A grid of this many stages, square in the plane, its layers passing through the start's height.

    span: lowest and highest place across, m.  The pitch grows where the grid would get too large.
    """
    low, high = max(data.floor, float(np.nanmin(data.heights))), data.ceiling
    level = np.array([*data.destination[:2], data.start[2]])
    share = math.tan(max(0.0, min(slope_limits(data, np.array(data.start), level))))
    share = min(HIGH_LAYER, max(LOW_LAYER, share / LAYERS_A_STEP))
    while True:
        step = frame.length / stages
        layer = share * step
        below, above = math.floor(-span[0] / step), math.floor(span[1] / step)
        across = np.arange(-below, above + 1) * step
        up = np.arange(math.ceil((low - data.start[2]) / layer), math.floor((high - data.start[2]) / layer) + 1)
        if stages <= 4 or (stages + 1) * across.size * max(1, up.size) <= MOST_CELLS:
            return Grid(stages, np.asarray(across, np.float64), np.asarray(data.start[2] + up * layer, np.float64))
        stages = max(4, int(stages / 1.2))


def grid_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: Grid,
    used: tuple[GridRoute, ...] = (),
    expected: float = math.inf,
) -> GridRoute | None:
    """Cheapest way over a grid; None where terrain and ceiling close it.

    used: earlier routes; keeping near them costs extra, so that the next one takes another side.  expected: a cost
    that is probably enough, as that on a coarser grid: it is found faster, and without it all is looked at.
    """
    if grid.layers.size == 0:
        return None
    along = np.linspace(0.0, frame.length, grid.stages + 1)
    extra = beside_used(along, grid.across, used)
    for bound in (expected, math.inf):
        cells, cost = cheapest_route(data, frame, grid, extra, bound)
        if cells.size:
            points = np.column_stack([along, grid.across[cells["across"]], grid.layers[cells["layer"]]])
            return GridRoute(points, float(cost))
        if bound == math.inf:
            break
    return None


def beside_used(along: Floats, across: Floats, used: tuple[GridRoute, ...]) -> Floats:
    """What keeping near routes costs more, per m, at places along (s,) and across (y,), m: (s, y)."""
    extra = np.zeros((along.size, across.size))
    width = max(APART, APART_STEPS * along[-1] / (along.size - 1))
    for route in used:
        stage_across = np.interp(along, route.points[:, 0], route.points[:, 1])
        extra += np.maximum(0.0, 1.0 - np.abs(across[None, :] - stage_across[:, None]) / width)
    return extra


def grid_routes(
    data: ProblemArrays, frame: RotatedFrame, span: tuple[float, float], grids: tuple[tuple[int, int], ...]
) -> Iterator[GridRoute]:
    """Routes as found: of each grid's number of stages, up to so many different ones."""
    expected = EXPECTED * math.dist(data.start, data.destination)
    for stages, each in grids:
        grid = make_grid(data, frame, span, stages)
        used: tuple[GridRoute, ...] = ()
        for _ in range(each):
            # A second route costs more than the first.
            route = grid_route(data, frame, grid, used, math.inf if used else expected)
            if route is None:
                break
            if not used:
                expected = route.cost
            used = (*used, route)
            yield route
