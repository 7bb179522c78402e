"""Grid routes are the cheapest of all, against exhaustive search."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, make_problem
from planner.seeding.grid_kernels import SIDEWAYS
from planner.seeding.grid_prices import COARSE, COARSE_GROWTH, KILL_COST, Grid
from planner.seeding.grid_routes import grid_route, make_grid
from world.scenario import Scenario

Floats = NDArray[np.float64]
FLAT = {"kind": "flat", "amsl_m": 0}


@pytest.fixture
def plain(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Problem:
    """Level ground, one missile on the line, slopes of 20 degrees."""
    scenario = small(terrain=FLAT, limits={"max_climb_deg": 20, "max_dive_deg": 20})
    return make_problem(scenario, make_limits(scenario))


def way_cost(problem: Problem, points: Floats, floor: float) -> float:
    """Cost of a way (s, 3) along, across, up: lengths times what each cell entered costs per m; inf if it is closed."""
    data = problem.search
    frame = rotated_frame(data.start, data.destination)
    places = frame.rotate(problem.scenario.threats.position)
    step = points[1, 0] - points[0, 0]
    most = math.tan(math.radians(20.0) - data.angle_margin)
    total = 0.0
    for before, after in itertools.pairwise(points):
        run = math.hypot(*(after - before)[:2])
        if abs(after[1] - before[1]) > (SIDEWAYS + 1e-9) * step or abs(after[2] - before[2]) > most * run:
            return math.inf
        if after[2] < floor and after is not points[-1]:
            return math.inf
        dear = 1.0
        for place, radius in zip(places, problem.scenario.threats.kill_radius, strict=True):
            grown = radius + data.kill_margin + (COARSE_GROWTH * step if step > COARSE else 0.0)
            away = float(np.linalg.norm(after - place))
            if radius > 0.0 and away < grown:
                dear += KILL_COST * (3.0 - 2.0 * away / grown)
        total += dear * float(np.linalg.norm(after - before))
    return total


@pytest.mark.parametrize(("stages", "aside"), [(4, 2), (5, 1)])
def test_route_is_the_cheapest_of_all(plain: Problem, stages: int, aside: int) -> None:
    data = plain.search
    frame = rotated_frame(data.start, data.destination)
    step = frame.length / stages
    grid = Grid(stages, np.arange(-aside, aside + 1) * step, data.start[2] + np.array([-200.0, 0.0, 200.0]))
    route = grid_route(data, frame, grid)
    assert route is not None
    floor = data.clearance + data.buffer
    along = np.linspace(0.0, frame.length, stages + 1)
    costs = []
    cells = list(itertools.product(grid.across, grid.layers))
    for inner in itertools.product(cells, repeat=stages - 1):
        ends = [(0.0, data.start[2])], [(0.0, data.destination[2])]
        points = np.column_stack([along, np.array([*ends[0], *inner, *ends[1]])])
        if np.abs(np.diff(points[:, 1])).max() <= 1.01 * SIDEWAYS * step:
            costs.append(way_cost(plain, points, floor))
    assert way_cost(plain, route.points, floor) == pytest.approx(route.cost, rel=1e-9)
    assert route.cost == pytest.approx(min(costs), rel=1e-9)


@pytest.mark.parametrize("stages", [12, 24, 36])
def test_expected_cost_changes_nothing_but_the_time(problem: Problem, stages: int) -> None:
    """Within the bound the same way is found; one that is too low is seen to be, and all is looked at."""
    data = problem.search
    frame = rotated_frame(data.start, data.destination)
    grid = make_grid(data, frame, (-3000.0, 3000.0), stages)
    whole = grid_route(data, frame, grid)
    assert whole is not None
    for share in (0.9, 1.0 + 1e-9, 1.1, 2.0):
        route = grid_route(data, frame, grid, (), share * whole.cost)
        assert route is not None
        assert route.cost == whole.cost
        np.testing.assert_array_equal(route.points, whole.points)


def test_later_routes_take_another_side(problem: Problem) -> None:
    data = problem.search
    frame = rotated_frame(data.start, data.destination)
    grid = make_grid(data, frame, (-3000.0, 3000.0), 36)
    first = grid_route(data, frame, grid)
    assert first is not None
    second = grid_route(data, frame, grid, (first,))
    assert second is not None
    assert np.abs(first.points[:, 1] - second.points[:, 1]).max() > 400.0
