"""Grids of airspace problems, and several routes over one."""

from collections.abc import Callable
from typing import Any

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.airspace_routes import FEWEST_LAYERS, FINER, MOST_CELLS, airspace_grid, airspace_routes
from world.scenario import Scenario

SPAN = (-3000.0, 3000.0)
FLAT = {"kind": "flat", "amsl_m": 0}


def arrays(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits], **tables: Any) -> ProblemArrays:
    scenario = small(**({"terrain": FLAT, "threats": []} | tables))
    return make_problem(scenario, make_limits(scenario)).search


def test_layers_follow_the_ground_where_there_is_a_greatest_height(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    data = arrays(small, make_limits, limits={"min_clearance_m": 60, "max_height_m": 200})
    grid = airspace_grid(data, rotated_frame(data.start, data.destination), SPAN, 60)
    assert grid.follows
    assert grid.layers >= FEWEST_LAYERS
    # The layers reach from what is cleared to what is not exceeded, and further where an end leaves more.
    assert (grid.layers - 1) * grid.pitch >= 200.0 - data.airspace.buffer - 60.0 - data.buffer
    assert 0.0 in grid.across


def test_layers_lie_level_without_one_and_the_grid_is_not_too_large(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    zone = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 0, "radius_m": 300}
    data = arrays(small, make_limits, zones=[zone])
    frame = rotated_frame(data.start, data.destination)
    grid = airspace_grid(data, frame, SPAN, 60)
    assert not grid.follows
    assert grid.floor + (grid.layers - 1) * grid.pitch <= data.ceiling
    large = airspace_grid(data, frame, SPAN, 5000)
    assert large.stages < 5000
    assert (large.stages + 1) * large.across.size * large.layers <= MOST_CELLS


def test_routes_of_one_grid_take_both_sides(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    zone = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 100, "radius_m": 900}
    data = arrays(small, make_limits, zones=[zone])
    routes = list(airspace_routes(data, rotated_frame(data.start, data.destination), SPAN, ((20, 2),)))
    assert [len(route.points) for route in routes] == [20 * FINER + 1] * 2
    middles = [float(np.interp(3000.0, route.points[:, 0], route.points[:, 1])) for route in routes]
    assert middles[0] < -800.0
    assert middles[1] > 1000.0
    assert routes[0].cost < routes[1].cost
