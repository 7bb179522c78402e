"""The cheapest route over a grid, its bound of the way that is left, and its moves, against all ways there are."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.grid_kernels import ROUTE_CELL, SIDEWAYS, cheapest_route, relax, trace_back, way_ahead
from planner.seeding.grid_prices import Grid, Records
from world.scenario import Scenario

ACROSS = np.arange(-600.0, 601.0, 200.0)


@pytest.fixture
def data(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> ProblemArrays:
    """Level ground, no threats, slopes of 20 degrees; 6 km from 150 m to 150 m."""
    limits = {"max_climb_deg": 20, "max_dive_deg": 20}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[], limits=limits)
    return make_problem(scenario, make_limits(scenario)).search


def route_over(
    data: ProblemArrays, layers: list[float], closed: tuple[tuple[int, int], ...] = (), bound: float = math.inf
) -> tuple[Records, float]:
    """Cheapest route of 30 stages; closed: cells by their stage and place across."""
    extra = np.zeros((31, ACROSS.size))
    for stage, across in closed:
        extra[stage, across] = math.inf
    frame = rotated_frame(data.start, data.destination)
    return cheapest_route(data, frame, Grid(30, ACROSS, np.array(layers)), extra, bound)


def test_in_the_open_the_straight_line_is_the_cheapest(data: ProblemArrays) -> None:
    cells, cost = route_over(data, [150.0, 350.0])
    assert cost == pytest.approx(6000.0)
    assert cells["across"].tolist() == [3] * 31
    assert cells["layer"].tolist() == [0] * 31


def test_a_wall_with_one_gap_is_passed_through_the_gap(data: ProblemArrays) -> None:
    # Three places aside and three back are shortest as six steps of one place each.
    wall = tuple((15, y) for y in range(ACROSS.size) if y != 6)
    cells, cost = route_over(data, [150.0], wall)
    assert cells["across"][[0, 15, 30]].tolist() == [3, 6, 3]
    assert cost == pytest.approx(200.0 * (24 + 6 * math.sqrt(2.0)))


def test_a_closed_wall_has_no_route(data: ProblemArrays) -> None:
    cells, cost = route_over(data, [150.0], tuple((15, y) for y in range(ACROSS.size)))
    assert (len(cells), cost) == (0, math.inf)


@pytest.mark.parametrize(("bound", "found"), [(6000.1, True), (5999.9, False)])
def test_a_route_dearer_than_the_bound_is_not_found(data: ProblemArrays, bound: float, found: bool) -> None:
    cells, cost = route_over(data, [150.0], bound=bound)
    assert (len(cells) == 31, math.isfinite(cost)) == (found, found)


@pytest.mark.parametrize(("top", "found"), [(220.0, True), (221.5, False)])
def test_a_step_climbs_and_sinks_no_more_than_the_limits_allow(data: ProblemArrays, top: float, found: bool) -> None:
    # 200 m at 20 degrees less half a degree of margin are 70.8 m; there is no place aside for a longer step.
    def between(first: float, last: float) -> Records:
        ends = {"start": np.array([0.0, 0.0, first]), "destination": np.array([6000.0, 0.0, last])}
        grid = Grid(30, np.zeros(1), np.array([150.0, top]))
        frame = rotated_frame(ends["start"], ends["destination"])
        return cheapest_route(data._replace(**ends), frame, grid, np.zeros((31, 1)), math.inf)[0]

    up, down = between(150.0, top), between(top, 150.0)
    assert (len(up), len(down)) == (31 * found, 31 * found)
    if found:
        assert (up["layer"][[0, -1]].tolist(), down["layer"][[0, -1]].tolist()) == ([0, 1], [1, 0])


@pytest.mark.parametrize("left", [0, 1, 2, 3])
def test_the_way_ahead_is_the_shortest_of_all_ways(left: int) -> None:
    columns, home, step = 9, 3, 50.0
    out = np.empty(columns)
    way_ahead(columns, home, left, step, 1.0, out)
    for y in range(columns):
        ways = itertools.product(range(-SIDEWAYS, SIDEWAYS + 1), repeat=left)
        lengths = [sum(step * math.hypot(1.0, side) for side in way) for way in ways if y + sum(way) == home]
        assert out[y] == pytest.approx(min(lengths, default=math.inf)), y


def test_a_move_is_taken_only_where_it_is_cheaper() -> None:
    cost, price = np.array([10.0, 10.0, math.inf, 10.0]), np.array([1.0, 2.0, 1.0, math.inf])
    after, came = np.array([15.1, 19.9, 30.0, math.inf]), np.full(4, -1, dtype=np.int32)
    relax(cost, price, after, came, 0, 0, 0, 4, 5.0)
    assert after.tolist() == [15.0, 19.9, 30.0, math.inf]
    assert came.tolist() == [0, -1, -1, -1]
    # From cells one place to the left.
    relax(cost, price, after, came, 0, 1, 1, 1, 4.0)
    assert after[1] == 18.0
    assert came[1] == 0
    # Back from the second cell to the third, at the second's price.
    relax(cost, price, after, came, 1, 2, 1, 1, 4.0)
    assert after[2] == 18.0
    assert came[2] == 1


def test_a_route_is_traced_back_from_its_end() -> None:
    # Two layers of three cells: (layer 1, across 2) is cell 5.
    came = np.full((3, 2, 3), -9, dtype=np.int32)
    came[2, 0, 1] = 5
    came[1, 1, 2] = 0
    cells = trace_back(came, 0, 1)
    assert cells.dtype == ROUTE_CELL
    assert cells["layer"].tolist() == [0, 1, 0]
    assert cells["across"].tolist() == [0, 2, 1]
