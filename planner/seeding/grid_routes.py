"""Seeds from coarse grids: a shortest way through terrain and threats in the rotated frame, stage by stage.

The grid picks the side of each obstacle; `planner.seeding.waypoint_fitting` then puts the path's waypoints, one an
interval, where whole legs are judged.  Both are dynamic programmes over forward steps: a path that the rotated encoding
can hold never turns back.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import Frame, rotated_frame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem_arrays import Rules
from planner.seeding.grid_kernels import cheapest_way
from planner.seeding.waypoint_fitting import fit_waypoints

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
class Grid:
    """One resolution: stages along, places across (m from the line) and layers of height (m)."""

    stages: int
    across: Floats
    layers: Floats


@dataclass(frozen=True, slots=True)
class Route:
    """A way over a grid: points (stages + 1, 3) along, across, up, and its cost in m of path."""

    points: Floats
    cost: float


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


def grid_route(
    rules: Rules, frame: Frame, grid: Grid, used: tuple[Route, ...] = (), expected: float = math.inf
) -> Route | None:
    """Cheapest way over a grid; None where terrain and ceiling close it.

    used: earlier routes; keeping near them costs extra, so that the next one takes another side.  expected: a cost
    that is probably enough, as that on a coarser grid: it is found faster, and without it all is looked at.
    """
    if grid.layers.size == 0:
        return None
    packed = np.array([*frame.origin, *frame.direction, frame.length])
    along = np.linspace(0.0, frame.length, grid.stages + 1)
    extra = np.zeros((grid.stages + 1, grid.across.size))
    width = max(APART, APART_STEPS * frame.length / grid.stages)
    for route in used:
        stage_across = np.interp(along, route.points[:, 0], route.points[:, 1])
        extra += np.maximum(0.0, 1.0 - np.abs(grid.across[None, :] - stage_across[:, None]) / width)
    for bound in (expected, math.inf):
        cells, cost = cheapest_way(rules, packed, grid.across, grid.layers, extra, bound)
        if cells.size:
            return Route(np.column_stack([along, grid.across[cells[:, 0]], grid.layers[cells[:, 1]]]), float(cost))
        if bound == math.inf:
            break
    return None


def grid_routes(
    rules: Rules, frame: Frame, span: tuple[float, float], grids: tuple[tuple[int, int], ...]
) -> Iterator[Route]:
    """Routes as found: of each grid's number of stages, up to so many different ones."""
    expected = EXPECTED * math.dist(rules.start, rules.destination)
    for stages, each in grids:
        grid = make_grid(rules, frame, span, stages)
        used: tuple[Route, ...] = ()
        for _ in range(each):
            # A second route costs more than the first.
            route = grid_route(rules, frame, grid, used, math.inf if used else expected)
            if route is None:
                break
            if not used:
                expected = route.cost
            used = (*used, route)
            yield route


def seeds(rules: Rules, span: tuple[float, float], waypoints: int, stages: tuple[int, ...], each: int) -> list[Floats]:
    """Seed paths (w, 3) world m: waypoints fitted to up to `each` routes from a grid of each number of stages."""
    frame = rotated_frame(rules.start, rules.destination)
    found = grid_routes(rules, frame, span, tuple((number, each) for number in stages))
    return [fit_waypoints(rules, frame, route.points, waypoints) for route in found]
