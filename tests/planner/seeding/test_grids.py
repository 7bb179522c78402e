"""What a m of way costs in a cell: 1 in the open, more inside kill spheres, inf near the ground and off the map."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import RotatedFrame, rotated_frame
from planner.evaluation.problem import Problem, ProblemArrays, make_problem, required_clearance
from planner.seeding.grids import (
    COARSE_GROWTH_STEPS,
    COARSE_STEP_M,
    KILL_COST,
    MAX_SIDE,
    OBSTACLE,
    ROUTE_CELL,
    Grid,
    Records,
    cheapest_route,
    fill_goal_distances,
    find_obstacles,
    grid_route,
    make_grid,
    positions_across,
    relax_cells,
    set_cell_costs,
    to_world_position,
    trace_back,
)
from world.arrays import Floats
from world.kernels import read_only
from world.scenario import Scenario


@pytest.fixture
def data(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> ProblemArrays:
    """Level ground at 0 m; one missile of 700 m at east 4200, north -200, on the ground, and a radar."""
    radar = {"east_m": 1000, "north_m": 0, "detection_radius_m": 900, "detection_scale_m": 90}
    missile = {"east_m": 4200, "north_m": -200, "kill_radius_m": 700, "kill_scale_m": 70}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[radar, missile])
    return make_problem(scenario, make_limits(scenario)).search


def prices(data: ProblemArrays, grid: Grid, stage: int, *, without_threats: bool = False, extra: float = 0.0) -> Floats:
    """Cost per m of a stage's cells (layers, across)."""
    frame = rotated_frame(data.start, data.destination)
    obstacles = find_obstacles(data, frame, frame.length / grid.stages)
    if without_threats:
        obstacles = np.zeros(0, dtype=OBSTACLE)
    out = np.full((grid.layers.size, grid.across.size), -1.0)
    more = np.full((grid.stages + 1, grid.across.size), extra)
    set_cell_costs(data, required_clearance(data), frame, stage, obstacles, grid, more, 0, grid.across.size - 1, out)
    return out


def test_places_in_the_rotated_frame_come_back_to_the_map() -> None:
    # Towards north-west: along is (-1, 1) / sqrt(2), across, to the left of it, (-1, -1) / sqrt(2).
    h = math.sqrt(0.5)
    frame = rotated_frame(np.array([100.0, 200.0, 0.0]), np.array([-900.0, 1200.0, 0.0]))
    assert to_world_position(frame, 0.0, 0.0) == (100.0, 200.0)
    assert to_world_position(frame, 10.0, 0.0) == pytest.approx((100.0 - 10.0 * h, 200.0 + 10.0 * h))
    assert to_world_position(frame, 0.0, 10.0) == pytest.approx((100.0 - 10.0 * h, 200.0 - 10.0 * h))
    east, north = to_world_position(frame, 300.0, -70.0)
    assert frame.to_frame(np.array([[east, north, 5.0]]))[0] == pytest.approx([300.0, -70.0, 5.0])


@pytest.mark.parametrize("step", [COARSE_STEP_M, COARSE_STEP_M + 1.0])
def test_obstacles_are_the_missiles_with_their_margin(data: ProblemArrays, step: float) -> None:
    frame = RotatedFrame(4000.0, 0.0, 0.0, 1.0, 6000.0)  # along to the north, across to the west
    obstacles = find_obstacles(data, frame, step)
    assert len(obstacles) == 1
    growth = 0.0 if step <= COARSE_STEP_M else COARSE_GROWTH_STEPS * step
    assert obstacles[0].tolist() == pytest.approx((-200.0, -200.0, 0.0, 700.0 + data.kill_margin + growth))


def test_cells_in_the_open_cost_their_length_and_what_is_added(data: ProblemArrays) -> None:
    grid = Grid(30, np.array([-2500.0, 0.0, 2500.0]), np.array([200.0, 300.0]))
    assert (prices(data, grid, 5, without_threats=True) == 1.0).all()
    assert (prices(data, grid, 5, without_threats=True, extra=0.75) == 1.75).all()


def test_cells_near_the_ground_are_closed(data: ProblemArrays) -> None:
    lowest = data.clearance + data.buffer
    grid = Grid(30, np.array([0.0]), np.array([lowest - 0.01, lowest + 0.01]))
    assert prices(data, grid, 5, without_threats=True).ravel().tolist() == [math.inf, 1.0]


def test_cells_off_the_map_are_closed(data: ProblemArrays) -> None:
    # Across is to the left of the way to the east: north.
    across = np.array([data.south - 1.0, data.south + 1.0, data.north - 1.0, data.north + 1.0])
    grid = Grid(30, across, np.array([300.0]))
    assert prices(data, grid, 5, without_threats=True).ravel().tolist() == [math.inf, 1.0, 1.0, math.inf]


def test_the_destination_itself_is_open_whatever_its_clearance(data: ProblemArrays) -> None:
    grid = Grid(30, np.array([-200.0, 0.0, 200.0]), np.array([1.0, 300.0]))
    assert prices(data, grid, 30, without_threats=True).tolist() == [[math.inf, 1.0, math.inf], [1.0, 1.0, 1.0]]


def test_inside_a_kill_sphere_a_metre_costs_more_towards_its_middle(data: ProblemArrays) -> None:
    # 30 stages of 200 m: stage 21 is at the missile's east, and cells are no coarser than they may be.
    radius = 700.0 + data.kill_margin
    grid = Grid(30, np.linspace(-1000.0, 1000.0, 11), np.array([100.0, 400.0]))
    got = prices(data, grid, 21)
    for z, up in enumerate(grid.layers):
        for y, place in enumerate(grid.across):
            away = math.hypot(place + 200.0, up)
            wanted = 1.0 + (KILL_COST * (3.0 - 2.0 * away / radius) if away < radius else 0.0)
            assert got[z, y] == pytest.approx(wanted), (place, up)
    assert got.max() > 100.0
    assert (got == 1.0).any()


def test_a_sphere_ends_where_its_radius_does(data: ProblemArrays) -> None:
    radius, layer = 700.0 + data.kill_margin, 300.0
    half = math.sqrt(radius**2 - layer**2)
    grid = Grid(30, -200.0 + half + np.array([-2.0, 0.0, 2.0]) - 1.0, np.array([layer]))
    inner, outer = prices(data, grid, 21).ravel()[[0, 2]]
    assert inner == pytest.approx(1.0 + KILL_COST, rel=0.01)
    assert outer == 1.0


# ----------------------------------------------------------------------
# The cheapest route over a grid, its bound of the way that is left, and its moves, against all ways there are.

ACROSS = np.arange(-600.0, 601.0, 200.0)


@pytest.fixture
def level_data(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> ProblemArrays:
    """Level ground, no threats, slopes of 20 degrees; 6 km from 150 m to 150 m."""
    limits = {"max_climb_deg": 20, "max_dive_deg": 20}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[], limits=limits)
    return make_problem(scenario, make_limits(scenario)).search


def route_over(
    level_data: ProblemArrays,
    layers: list[float],
    closed: tuple[tuple[int, int], ...] = (),
    bound: float = math.inf,
) -> tuple[Records, float]:
    """Cheapest route of 30 stages; closed: cells by their stage and place across."""
    extra = np.zeros((31, ACROSS.size))
    for stage, across in closed:
        extra[stage, across] = math.inf
    frame = rotated_frame(level_data.start, level_data.destination)
    return cheapest_route(level_data, frame, Grid(30, ACROSS, np.array(layers)), extra, bound)


def test_in_the_open_the_straight_line_is_the_cheapest(level_data: ProblemArrays) -> None:
    cells, cost = route_over(level_data, [150.0, 350.0])
    assert cost == pytest.approx(6000.0)
    assert cells["across"].tolist() == [3] * 31
    assert cells["layer"].tolist() == [0] * 31


def test_a_wall_with_one_gap_is_passed_through_the_gap(level_data: ProblemArrays) -> None:
    # Three places aside and three back are shortest as six steps of one place each.
    wall = tuple((15, y) for y in range(ACROSS.size) if y != 6)
    cells, cost = route_over(level_data, [150.0], wall)
    assert cells["across"][[0, 15, 30]].tolist() == [3, 6, 3]
    assert cost == pytest.approx(200.0 * (24 + 6 * math.sqrt(2.0)))


def test_a_closed_wall_has_no_route(level_data: ProblemArrays) -> None:
    cells, cost = route_over(level_data, [150.0], tuple((15, y) for y in range(ACROSS.size)))
    assert (len(cells), cost) == (0, math.inf)


@pytest.mark.parametrize(("bound", "found"), [(6000.1, True), (5999.9, False)])
def test_a_route_dearer_than_the_bound_is_not_found(level_data: ProblemArrays, bound: float, found: bool) -> None:
    cells, cost = route_over(level_data, [150.0], bound=bound)
    assert (len(cells) == 31, math.isfinite(cost)) == (found, found)


@pytest.mark.parametrize(("top", "found"), [(220.0, True), (221.5, False)])
def test_a_step_climbs_and_sinks_no_more_than_the_limits_allow(
    level_data: ProblemArrays, top: float, found: bool
) -> None:
    # 200 m at 20 degrees less half a degree of margin are 70.8 m; there is no place aside for a longer step.
    def between(first: float, last: float) -> Records:
        places = np.array([[0.0, 0.0, first], [6000.0, 0.0, last]])
        ends = {"start": read_only(places[0]), "destination": read_only(places[1])}
        grid = Grid(30, np.zeros(1), np.array([150.0, top]))
        frame = rotated_frame(ends["start"], ends["destination"])
        return cheapest_route(level_data._replace(**ends), frame, grid, np.zeros((31, 1)), math.inf)[0]

    up, down = between(150.0, top), between(top, 150.0)
    assert (len(up), len(down)) == (31 * found, 31 * found)
    if found:
        assert (up["layer"][[0, -1]].tolist(), down["layer"][[0, -1]].tolist()) == ([0, 1], [1, 0])


@pytest.mark.parametrize("left", [0, 1, 2, 3])
def test_the_way_ahead_is_the_shortest_of_all_ways(left: int) -> None:
    columns, home, step = 9, 3, 50.0
    out = np.empty(columns)
    fill_goal_distances(columns, home, left, step, 1.0, out)
    for y in range(columns):
        ways = itertools.product(range(-MAX_SIDE, MAX_SIDE + 1), repeat=left)
        lengths = [sum(step * math.hypot(1.0, side) for side in way) for way in ways if y + sum(way) == home]
        assert out[y] == pytest.approx(min(lengths, default=math.inf)), y


def test_a_move_is_taken_only_where_it_is_cheaper() -> None:
    cost, price = np.array([10.0, 10.0, math.inf, 10.0]), np.array([1.0, 2.0, 1.0, math.inf])
    after, parents = np.array([15.1, 19.9, 30.0, math.inf]), np.full(4, -1, dtype=np.int32)
    relax_cells(cost, price, after, parents, 0, 0, 0, 4, 5.0)
    assert after.tolist() == [15.0, 19.9, 30.0, math.inf]
    assert parents.tolist() == [0, -1, -1, -1]
    # From cells one place to the left.
    relax_cells(cost, price, after, parents, 0, 1, 1, 1, 4.0)
    assert after[1] == 18.0
    assert parents[1] == 0
    # Back from the second cell to the third, at the second's price.
    relax_cells(cost, price, after, parents, 1, 2, 1, 1, 4.0)
    assert after[2] == 18.0
    assert parents[2] == 1


def test_a_route_is_traced_back_from_its_end() -> None:
    # Two layers of three cells: (layer 1, across 2) is cell 5.
    parents = np.full((3, 2, 3), -9, dtype=np.int32)
    parents[2, 0, 1] = 5
    parents[1, 1, 2] = 0
    cells = trace_back(parents, 0, 1)
    assert cells.dtype == ROUTE_CELL
    assert cells["layer"].tolist() == [0, 1, 0]
    assert cells["across"].tolist() == [0, 2, 1]


# ----------------------------------------------------------------------
# Grid routes are the cheapest of all, against exhaustive search.

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
    places = frame.to_frame(problem.scenario.threats.position)
    step = points[1, 0] - points[0, 0]
    most = math.tan(math.radians(20.0) - data.angle_margin)
    total = 0.0
    for before, after in itertools.pairwise(points):
        run = math.hypot(*(after - before)[:2])
        if abs(after[1] - before[1]) > (MAX_SIDE + 1e-9) * step or abs(after[2] - before[2]) > most * run:
            return math.inf
        if after[2] < floor and after is not points[-1]:
            return math.inf
        dear = 1.0
        for place, radius in zip(places, problem.scenario.threats.kill_radius, strict=True):
            grown = radius + data.kill_margin + (COARSE_GROWTH_STEPS * step if step > COARSE_STEP_M else 0.0)
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
        if np.abs(np.diff(points[:, 1])).max() <= 1.01 * MAX_SIDE * step:
            costs.append(way_cost(plain, points, floor))
    assert way_cost(plain, route.points, floor) == pytest.approx(route.cost, rel=1e-9)
    assert route.cost == pytest.approx(min(costs), rel=1e-9)


def test_a_grid_between_close_ends_covers_what_a_route_reaches() -> None:
    """In 4 stages a route leads 2 stages away from the line and 2 back, by up to three cells in each."""
    assert positions_across((-10_000.0, 10_000.0), 15.0, 4).tolist() == [15.0 * k for k in range(-6, 7)]
    assert positions_across((-40.0, 70.0), 15.0, 4).tolist() == [15.0 * k for k in range(-2, 5)]
    assert positions_across((-10_000.0, 10_000.0), 15.0, 5).size == 13


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
