"""The best path through each of many waypoints, against all combinations tried one by one."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.leg_constraints import precompute_limits
from planner.evaluation.problem import Problem, ProblemArrays, make_problem
from planner.seeding.waypoint_chains import free_points, waypoint_chains
from planner.seeding.waypoint_fitting import penalised_leg_cost
from world.arrays import Floats
from world.scenario import Scenario

FLAT = {"kind": "flat", "amsl_m": 0}
INNER, EACH = 4, 4
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def open_air(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> ProblemArrays:
    scenario = small(terrain=FLAT, threats=[])
    return make_problem(scenario, make_limits(scenario)).search


def near_the_line(data: ProblemArrays, spread: float, seed: int) -> Floats:
    """Candidates (w, k, 3) about even places of the straight line."""
    places = np.linspace(data.start, data.destination, INNER + 2)
    out = np.repeat(places[:, None, :], EACH, axis=1)
    moves = np.random.default_rng(seed).normal(size=(INNER, EACH, 3)) * [spread, spread, 0.05 * spread]
    out[1:-1] += moves
    return out


def leg_cost_of(data: ProblemArrays, a: Floats, b: Floats, enough: float) -> float:
    return float(penalised_leg_cost(data, precompute_limits(data), np.array(a), np.array(b), enough))


def length(path: Floats) -> float:
    return sum(math.dist(a, b) for a, b in itertools.pairwise(path))


@pytest.mark.parametrize("seed", range(5))
def test_each_waypoint_has_the_shortest_path_through_it(open_air: ProblemArrays, seed: int) -> None:
    candidates = near_the_line(open_air, 60.0, seed)
    chains = waypoint_chains(open_air, candidates, math.inf)
    every = list(itertools.product(range(EACH), repeat=INNER))
    lengths = {
        numbers: length(
            np.array([candidates[0, 0], *(candidates[i + 1, k] for i, k in enumerate(numbers)), candidates[-1, 0]])
        )
        for numbers in every
    }
    for i in range(INNER):
        for k in range(EACH):
            best = min((lengths[numbers], numbers) for numbers in every if numbers[i] == k)
            assert chains.cost[i + 1, k] == pytest.approx(best[0], abs=1e-6)
            assert tuple(chains.path_through(i + 1, k)[1:-1]) == best[1]
    # Every pair of neighbours once, at most, however often it is asked for.
    assert 0 < chains.legs <= (INNER - 1) * EACH**2 + 2 * EACH


def test_what_costs_more_than_the_bound_is_left_out(open_air: ProblemArrays) -> None:
    candidates = near_the_line(open_air, 60.0, 1)
    whole = waypoint_chains(open_air, candidates, math.inf)
    bound = float(np.median(whole.cost[1:-1]))
    some = waypoint_chains(open_air, candidates, bound)
    inside = whole.cost < bound
    np.testing.assert_allclose(some.cost[inside], whole.cost[inside], rtol=0.0, atol=1e-9)
    assert np.isinf(some.cost[1:-1][~inside[1:-1]]).all()
    assert some.legs < whole.legs


def test_a_turn_beyond_the_limit_costs_and_one_within_does_not(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    scenario = small(terrain=FLAT, threats=[], limits={"max_turn_deg": 45})
    data = make_problem(scenario, make_limits(scenario)).search
    run = math.dist(data.start[:2], data.destination[:2])
    for turn_deg, costs in ((44.0, False), (45.5, True)):
        # One corner half way: the legs on both sides make half the turn with the line.
        aside = 0.5 * run * math.tan(math.radians(turn_deg / 2.0))
        path = np.linspace(data.start, data.destination, 3)
        left = np.array([data.start[1] - data.destination[1], data.destination[0] - data.start[0]]) / run
        path[1, :2] += aside * left
        chains = waypoint_chains(data, path[:, None, :].copy(), math.inf)
        assert (chains.cost[1, 0] > length(path) + 1.0) == costs


def test_a_path_goes_round_a_missile(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = small(terrain=FLAT)
    data = make_problem(scenario, make_limits(scenario)).search
    middle, radius = scenario.threats.position[0], float(scenario.threats.kill_radius[0])
    up = float(scenario.start[2])
    at, beside = [*middle[:2], up], [middle[0], middle[1] + 1.5 * radius, up]
    candidates = np.array([[scenario.start] * 2, [at, beside], [scenario.destination] * 2])
    chains = waypoint_chains(data, candidates, math.inf)
    assert chains.cost[1, 0] > 2.0 * chains.cost[1, 1]
    assert chains.path_through(0, 0).tolist() == [0, 1, 0]


def test_free_points_are_on_the_map_above_the_ground_and_outside_spheres(problem: Problem) -> None:
    data, scenario = problem.search, problem.scenario
    unit, radius = scenario.threats.position[0], float(scenario.threats.kill_radius[0])
    keep = radius + data.kill_margin
    places = np.array([unit + (keep - 0.5) * UP, unit + (keep + 0.5) * UP, scenario.start])
    assert free_points(data, places).tolist() == [False, True, True]
    terrain = scenario.terrain
    assert terrain is not None
    east, north = float(scenario.start[0]) + 700.0, float(scenario.start[1])
    need = float(terrain.height(east, north)) + data.clearance + data.buffer
    places = np.array([[east, north, need - 0.1], [east, north, need + 0.1], [data.west - 1.0, north, need + 50.0]])
    assert free_points(data, places).tolist() == [False, True, False]


def test_more_legs_than_are_allowed_give_no_path(open_air: ProblemArrays) -> None:
    candidates = near_the_line(open_air, 60.0, 1)
    whole = waypoint_chains(open_air, candidates, math.inf)
    same = waypoint_chains(open_air, candidates, math.inf, max_legs=whole.legs + 1)
    np.testing.assert_array_equal(same.cost, whole.cost)
    few = waypoint_chains(open_air, candidates, math.inf, max_legs=whole.legs // 2)
    assert np.isinf(few.cost).all()
    # The legs to one candidate are evaluated together.
    assert whole.legs // 2 <= few.legs < whole.legs // 2 + EACH


def test_a_leg_is_evaluated_as_far_as_its_cost_matters(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    """Through the hill and the missile, too steep, and above the greatest height: each alone, and exactly up to it."""
    scenario = small(limits={"max_height_m": 200.0, "min_clearance_m": 50.0, "max_climb_deg": 10, "max_dive_deg": 10})
    data = make_problem(scenario, make_limits(scenario)).search
    legs = {
        "hill": (np.array([1000.0, 200.0, 150.0]), np.array([3000.0, 200.0, 150.0])),
        "missile": (np.array([4200.0, -1500.0, 150.0]), np.array([4200.0, 1500.0, 150.0])),
        "slope": (np.array([0.0, 0.0, 150.0]), np.array([100.0, 0.0, 210.0])),
        "height": (np.array([5500.0, -2500.0, 400.0]), np.array([6000.0, 2500.0, 400.0])),
    }
    for name, (a, b) in legs.items():
        cost = leg_cost_of(data, a, b, math.inf)
        length = math.dist(a, b)
        assert cost > length + 100.0, name
        assert leg_cost_of(data, a, b, cost + 1.0) == cost, name
        for share in (0.1, 0.9):
            enough = length + share * (cost - length)
            assert enough < leg_cost_of(data, a, b, enough) <= cost, name
        # Most of what is not needed is left out.
        assert leg_cost_of(data, a, b, length + 1.0) < cost or name in ("slope", "missile"), name
