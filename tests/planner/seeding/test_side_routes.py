"""Routes of different sides: each passes some obstacle elsewhere, cheapest first, none twice."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, make_problem
from planner.seeding.grid_prices import find_obstacles
from planner.seeding.grid_routes import grid_route, make_grid
from planner.seeding.side_kernels import LEFT, OVER, RIGHT
from planner.seeding.side_routes import optimistic_grid, side_routes, sides_passed
from world.scenario import Scenario

Floats = NDArray[np.float64]
SPAN = (-2500.0, 2500.0)


@pytest.fixture
def two_missiles(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Problem:
    """Missiles of 700 m on the line at 2 and 4 km of 6, too high to pass over: each is passed left or right."""
    missiles = [
        {"east_m": east, "north_m": 60, "amsl_m": 400, "kill_radius_m": 700, "kill_scale_m": 70}
        for east in (2000, 4000)
    ]
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=missiles)
    return make_problem(scenario, make_limits(scenario))


def test_every_choice_of_sides_of_one_obstacle_is_proposed(two_missiles: Problem) -> None:
    data = two_missiles.search
    frame = rotated_frame(data.start, data.destination)
    grid = make_grid(data, frame, SPAN, 36)
    routes = side_routes(data, frame, grid, 1.6 * frame.length, 12)
    obstacles = find_obstacles(data, frame, frame.length / 36)
    sides = [tuple(sides_passed(route.points, obstacles).tolist()) for route in routes]
    assert len(set(sides)) == len(sides)
    assert {pair[0] for pair in sides} >= {LEFT, RIGHT}
    assert {pair[1] for pair in sides} >= {LEFT, RIGHT}
    costs = [route.cost for route in routes]
    assert costs == sorted(costs)
    cheapest = grid_route(data, frame, grid)
    assert cheapest is not None
    assert costs[0] == pytest.approx(cheapest.cost)
    assert max(costs) <= 1.6 * frame.length


def test_sides_are_read_where_the_obstacle_is_passed() -> None:
    obstacles = np.zeros(4, dtype=[("along", float), ("across", float), ("up", float), ("radius", float)])
    obstacles["along"] = [100.0, 200.0, 300.0, 900.0]
    obstacles["across"] = [20.0, -20.0, 0.0, 0.0]
    points = np.column_stack([np.linspace(0.0, 500.0, 6), np.zeros(6), np.full(6, 10.0)])
    assert sides_passed(points, obstacles).tolist() == [RIGHT, LEFT, OVER, -1]


def test_an_optimistic_grid_sees_spheres_smaller(two_missiles: Problem) -> None:
    data = two_missiles.search
    frame = rotated_frame(data.start, data.destination)
    plain, free = (
        make_grid(data, frame, SPAN, 36),
        optimistic_grid(data, frame, SPAN, 36, shrink=0.5, spread=0.2, ratio=0.5),
    )
    assert (free.shrink, free.spread, free.stages) == (0.5, 0.2, plain.stages)
    step = frame.length / 36
    radius = find_obstacles(data, frame, step, free.shrink)["radius"]
    assert radius == pytest.approx([700.0 + data.kill_margin - 0.5 * step] * 2)
    costs = [side_routes(data, frame, grid, 2.0 * frame.length, 1)[0].cost for grid in (plain, free)]
    assert costs[1] < costs[0]
