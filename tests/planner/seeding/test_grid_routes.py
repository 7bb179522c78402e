"""Grid routes against exhaustive search, moves of all waypoints at once, and what a search tells as it goes."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS, rotated_frame, rotated_vectors
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Objective
from planner.search.plan_path import plan_path
from planner.seeding.grid_kernels import COARSE, COARSE_GROWTH, KILL_COST, SIDEWAYS
from planner.seeding.grid_routes import Grid, grid_route, make_grid
from planner.seeding.waypoint_fitting import tighten
from world.scenario import Scenario

Floats = NDArray[np.float64]
FLAT = {"kind": "flat", "amsl_m": 0}


@pytest.fixture(scope="module")
def problem(scenario: Scenario, limits: Limits) -> Problem:
    return make_problem(scenario, limits)


@pytest.fixture
def plain(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Problem:
    """Level ground, one missile on the line, slopes of 20 degrees."""
    scenario = small(terrain=FLAT, limits={"max_climb_deg": 20, "max_dive_deg": 20})
    return make_problem(scenario, make_limits(scenario))


def way_cost(problem: Problem, points: Floats, floor: float) -> float:
    """Cost of a way (s, 3) along, across, up: lengths times what each cell entered costs per m; inf if it is closed."""
    rules = problem.search
    frame = rotated_frame(rules.start, rules.destination)
    places = frame.rotate(rules.threats[:, :3])
    step = points[1, 0] - points[0, 0]
    most = math.tan(math.radians(20.0) - rules.spare)
    total = 0.0
    for before, after in itertools.pairwise(points):
        run = math.hypot(*(after - before)[:2])
        if abs(after[1] - before[1]) > (SIDEWAYS + 1e-9) * step or abs(after[2] - before[2]) > most * run:
            return math.inf
        if after[2] < floor and after is not points[-1]:
            return math.inf
        dear = 1.0
        for place, radius in zip(places, rules.threats[:, 3], strict=True):
            grown = radius + rules.kill_margin + (COARSE_GROWTH * step if step > COARSE else 0.0)
            away = float(np.linalg.norm(after - place))
            if radius > 0.0 and away < grown:
                dear += KILL_COST * (3.0 - 2.0 * away / grown)
        total += dear * float(np.linalg.norm(after - before))
    return total


@pytest.mark.parametrize(("stages", "aside"), [(4, 2), (5, 1)])
def test_route_is_the_cheapest_of_all(plain: Problem, stages: int, aside: int) -> None:
    rules = plain.search
    frame = rotated_frame(rules.start, rules.destination)
    step = frame.length / stages
    grid = Grid(stages, np.arange(-aside, aside + 1) * step, rules.start[2] + np.array([-200.0, 0.0, 200.0]))
    route = grid_route(rules, frame, grid)
    assert route is not None
    floor = rules.clearance + rules.reserve
    along = np.linspace(0.0, frame.length, stages + 1)
    costs = []
    cells = list(itertools.product(grid.across, grid.layers))
    for inner in itertools.product(cells, repeat=stages - 1):
        ends = [(0.0, rules.start[2])], [(0.0, rules.destination[2])]
        points = np.column_stack([along, np.array([*ends[0], *inner, *ends[1]])])
        if np.abs(np.diff(points[:, 1])).max() <= 1.01 * SIDEWAYS * step:
            costs.append(way_cost(plain, points, floor))
    assert way_cost(plain, route.points, floor) == pytest.approx(route.cost, rel=1e-9)
    assert route.cost == pytest.approx(min(costs), rel=1e-9)


@pytest.mark.parametrize("stages", [12, 24, 36])
def test_expected_cost_changes_nothing_but_the_time(problem: Problem, stages: int) -> None:
    """Within the bound the same way is found; one that is too low is seen to be, and all is looked at."""
    rules = problem.search
    frame = rotated_frame(rules.start, rules.destination)
    grid = make_grid(rules, frame, (-3000.0, 3000.0), stages)
    whole = grid_route(rules, frame, grid)
    assert whole is not None
    for share in (0.9, 1.0 + 1e-9, 1.1, 2.0):
        route = grid_route(rules, frame, grid, (), share * whole.cost)
        assert route is not None
        assert route.cost == whole.cost
        np.testing.assert_array_equal(route.points, whole.points)


def test_later_routes_take_another_side(problem: Problem) -> None:
    rules = problem.search
    frame = rotated_frame(rules.start, rules.destination)
    grid = make_grid(rules, frame, (-3000.0, 3000.0), 36)
    first = grid_route(rules, frame, grid)
    assert first is not None
    second = grid_route(rules, frame, grid, (first,))
    assert second is not None
    assert np.abs(first.points[:, 1] - second.points[:, 1]).max() > 400.0


def test_moves_straighten_a_zigzag(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = small(terrain=FLAT, threats=[])
    problem = make_problem(scenario, make_limits(scenario))
    encoding = ENCODINGS["rotated"](problem.space, 8)
    path = np.linspace(scenario.start, scenario.destination, 8)
    path[1:-1, 1] += 300.0 * (-1.0) ** np.arange(6)
    vector = rotated_vectors(problem.space, encoding, path[None])[0]

    def length(numbers: Floats) -> float:
        return float(np.linalg.norm(np.diff(encoding.decode(numbers[None])[0], axis=0), axis=1).sum())

    moved, made = tighten(problem.search, encoding, vector, 8, 1.0)
    assert made > 0
    assert (moved >= encoding.lower).all()
    assert (moved <= encoding.upper).all()
    straight = math.dist(scenario.start, scenario.destination)
    assert length(moved) - straight < 0.05 * (length(vector) - straight)


def test_better_paths_are_told_as_they_are_found(scenario: Scenario, limits: Limits) -> None:
    seen: list[Floats] = []
    plan = plan_path(scenario, limits, seed=4, improved=seen.append)
    lengths = [float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) for path in seen]
    assert len(seen) > 1
    # All are out of reach here, so that the shortest is the best.
    assert lengths == sorted(lengths, reverse=True)
    np.testing.assert_array_equal(seen[-1], plan.waypoints)
    np.testing.assert_array_equal(plan_path(scenario, limits, seed=4).waypoints, plan.waypoints)


def test_straight_line_is_taken_where_it_is_safe(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    clear = small(terrain=FLAT, threats=[])
    plan = plan_path(clear, make_limits(clear), seed=1)
    assert plan.safe
    assert plan.evaluations == 1
    assert plan.objectives[Objective.LENGTH_RATIO] == pytest.approx(1.0, abs=1e-12)
    guarded = small(terrain=FLAT)
    other = plan_path(guarded, make_limits(guarded), seed=1)
    assert other.safe
    assert other.objectives[Objective.LENGTH_RATIO] > 1.0
