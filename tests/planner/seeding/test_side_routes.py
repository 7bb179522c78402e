"""Ways past obstacles on each side, against the programme of one cheapest route and all ways of a small grid."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, ProblemArrays, make_problem
from planner.seeding import side_routes as side_routes_module
from planner.seeding.grids import (
    KILL_COST,
    MAX_SIDE,
    Grid,
    cheapest_route,
    find_obstacles,
    grid_route,
    make_grid,
)
from planner.seeding.side_routes import (
    LEFT,
    OVER,
    RIGHT,
    UNDER,
    cheapest_passings,
    close_places,
    closest_places,
    grid_costs,
    optimistic_grid,
    passing_side,
    route_through,
    side_routes,
    sides_passed,
)
from world.scenario import Scenario

# Six stages of 1 km over level ground; places 1 km apart.
GRID = Grid(6, np.arange(-2.0, 3.0) * 1000.0, np.array([150.0, 450.0]))


@pytest.fixture
def data(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> ProblemArrays:
    """A missile of 900 m a little to the right of the line's middle; 6 km from 150 m to 150 m."""
    missile = {"east_m": 3000, "north_m": -100, "kill_radius_m": 900, "kill_scale_m": 70}
    limits = {"max_climb_deg": 20, "max_dive_deg": 20}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[missile], limits=limits)
    return make_problem(scenario, make_limits(scenario)).search


@pytest.mark.parametrize(
    ("aside", "above", "side"),
    [(5.0, 4.9, LEFT), (-5.0, 4.9, RIGHT), (5.0, 5.1, OVER), (-5.0, 5.1, OVER), (4.0, -5.0, UNDER), (0.0, 0.0, LEFT)],
)
def test_a_side_is_a_quarter_about_the_middle(aside: float, above: float, side: int) -> None:
    assert passing_side(aside, above) == side


def all_ways(data: ProblemArrays) -> list[tuple[float, tuple[tuple[int, int], ...]]]:
    """Cost and cells (across, layer) of all ways over the grid, by plain sums."""
    frame = rotated_frame(data.start, data.destination)
    step, places, end = frame.length / GRID.stages, list(itertools.product(range(5), range(2))), (2, 0)
    obstacle = find_obstacles(data, frame, step)[0]
    ways: list[tuple[float, tuple[tuple[int, int], ...]]] = [(0.0, (end,))]
    for stage in range(1, GRID.stages + 1):
        dear = {}
        for place in places:
            at = stage * step, GRID.across[place[0]], GRID.layers[place[1]]
            away = math.dist(at, (obstacle["along"], obstacle["across"], obstacle["up"]))
            inside = away < obstacle["radius"]
            dear[place] = 1.0 + (KILL_COST * (3.0 - 2.0 * away / obstacle["radius"]) if inside else 0.0)
        ways = [
            (total + dear[to] * math.hypot(step, step * (to[0] - way[-1][0]), 300.0 * (to[1] - way[-1][1])), (*way, to))
            for total, way in ways
            for to in (places if stage < GRID.stages else [end])
            if abs(to[0] - way[-1][0]) <= MAX_SIDE
        ]
    return ways


def test_each_side_is_passed_as_cheaply_as_by_the_best_of_all_ways(data: ProblemArrays) -> None:
    frame = rotated_frame(data.start, data.destination)
    costs = grid_costs(data, frame, GRID, math.inf)
    obstacles = find_obstacles(data, frame, 1000.0)
    passings = cheapest_passings(costs, GRID, obstacles, 1000.0)[0]
    ways = all_ways(data)
    for side in (LEFT, RIGHT, OVER, UNDER):
        least = math.inf
        for total, way in ways:
            across, layer = way[3]
            if (
                passing_side(GRID.across[across] - obstacles[0]["across"], GRID.layers[layer] - obstacles[0]["up"])
                == side
            ):
                least = min(least, total)
        assert passings[side]["cost"] == pytest.approx(least)
    assert passings[UNDER]["cost"] == math.inf
    assert passings[LEFT]["cost"] < passings[RIGHT]["cost"]


def test_a_route_through_a_cell_costs_what_was_said_and_leads_from_end_to_end(data: ProblemArrays) -> None:
    frame = rotated_frame(data.start, data.destination)
    costs = grid_costs(data, frame, GRID, math.inf)
    cells, best = cheapest_route(data, frame, GRID, np.zeros((7, 5)), math.inf)
    assert costs.goal_costs[0, 0, 2] == pytest.approx(best)
    assert costs.start_costs[6, 0, 2] == pytest.approx(best)
    through = route_through(costs, 3, int(cells["layer"][3]), int(cells["across"][3]))
    # Of ways that cost the same either may be taken.
    assert through[[0, 3, 6]].tolist() == cells[[0, 3, 6]].tolist()
    way = tuple(zip(through["across"].tolist(), through["layer"].tolist(), strict=True))
    assert {way: total for total, way in all_ways(data)}[way] == pytest.approx(best)
    other = route_through(costs, 2, 1, 4)
    assert (other["across"][[0, 2, 6]].tolist(), other["layer"][[0, 2, 6]].tolist()) == ([2, 4, 2], [0, 1, 0])


def test_beyond_the_bound_there_is_no_way(data: ProblemArrays) -> None:
    frame = rotated_frame(data.start, data.destination)
    whole = grid_costs(data, frame, GRID, math.inf)
    bound = 1.2 * whole.goal_costs[0, 0, 2]
    bounded = grid_costs(data, frame, GRID, bound)
    total, kept = whole.start_costs + whole.goal_costs, bounded.start_costs + bounded.goal_costs
    assert (kept[total <= bound] == total[total <= bound]).all()
    assert np.isinf(kept[total > bound + 1e-6]).all()
    assert np.isinf(kept).sum() > np.isinf(total).sum()


def test_costs_in_slices_are_the_same_and_it_asks_after_each(
    data: ProblemArrays, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame, asked = rotated_frame(data.start, data.destination), list[int]()
    whole = grid_costs(data, frame, GRID, 9000.0, lambda: asked.append(0))
    assert len(asked) == 1
    # One stage of ten cells at once: there and back over six.
    monkeypatch.setattr(side_routes_module, "CELLS_PER_CHECK", 10)
    sliced = grid_costs(data, frame, GRID, 9000.0, lambda: asked.append(0))
    assert len(asked) == 1 + 12
    for one, other in zip(whole, sliced, strict=True):
        np.testing.assert_array_equal(one, other)

    def end() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        side_routes(data, frame, GRID, 9000.0, 4, end)


# ----------------------------------------------------------------------
# Routes of different sides: each passes some obstacle elsewhere, cheapest first, none twice.

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


def test_the_closest_places_of_a_path_are_its_feet_on_spheres_that_are_too_near(two_missiles: Problem) -> None:
    # Centres at (2000, 60, 400) and (4000, 60, 400), radii of 700 m: level at 400 m and 60 m off both centres for the
    # first leg, 690 m off the second centre at its foot on the second leg.
    path = np.array([[0.0, 0.0, 400.0], [3000.0, 0.0, 400.0], [3000.0, -630.0, 400.0], [6000.0, -630.0, 400.0]])
    places = closest_places(two_missiles.search, path, 10.0)
    assert places[0] == pytest.approx([2000.0, 0.0, 400.0])
    assert places[-1] == pytest.approx([4000.0, -630.0, 400.0])
    assert len(closest_places(two_missiles.search, path, -700.0)) == 0
    # Deepest first.
    centres = np.array([[2000.0, 60.0, 400.0], [4000.0, 60.0, 400.0]])
    depths = np.sqrt(((places[:, None] - centres) ** 2).sum(axis=2)).min(axis=1)
    assert (np.diff(depths) >= 0.0).all()


def test_the_routes_of_a_grid_keep_off_a_closed_place(two_missiles: Problem) -> None:
    data = two_missiles.search
    frame = rotated_frame(data.start, data.destination)
    grid = make_grid(data, frame, SPAN, 36)
    cheapest = side_routes(data, frame, grid, 2.0 * frame.length, 1)[0].points
    stage = int(np.argmin(np.abs(cheapest[:, 0] - 2000.0)))
    place = frame.to_world(cheapest[stage : stage + 1])
    step = frame.length / 36
    closed = close_places(data, place, step)
    assert len(closed.threats) == len(data.threats) + 1
    other = side_routes(closed, frame, grid, 2.0 * frame.length, 1)[0].points
    assert math.dist(cheapest[stage], other[stage]) >= step
