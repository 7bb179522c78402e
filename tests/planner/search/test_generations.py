"""Generations of whole paths: their number, their history, and that they better the first population."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS
from planner.evaluation.problem import ProblemArrays, make_problem
from planner.plan import Objective, Plan
from planner.search import generations
from planner.search.algorithms import ALGORITHMS
from planner.search.explain_failure import explain_failure
from planner.search.generations import MAX_GENERATIONS, run_path_generations, run_waypoint_generations
from planner.search.infeasibility_proof import is_closed
from planner.search.plan_path import plan_path
from planner.search.search_state import Search, best_first
from planner.seeding.waypoint_chains import WaypointChains, waypoint_chains
from tests.soak import some
from world.arrays import Floats
from world.random_streams import PLANNER, stream
from world.scenario import Scenario, load_scenario, with_planner


def search_of(scenario: Scenario, limits: Limits, algorithm: str) -> Search:
    problem, chosen = make_problem(scenario, limits), ALGORITHMS[algorithm]
    encoding = ENCODINGS[chosen.encoding](problem.space, scenario.planner.waypoints)
    return Search(problem, chosen, encoding, stream(1, PLANNER), None, None, False, 10.0)


@pytest.mark.parametrize("name", ["umda", "umda-smooth", "emna", "chain", "de", "umda-cartesian"])
def test_generations_better_the_first_population(scenario: Scenario, limits: Limits, name: str) -> None:
    search = search_of(scenario, limits, name)
    none = np.empty((0, search.encoding.lower.size))
    last = run_path_generations(search, 60, 12, none)
    assert search.evaluations == 60 + 12 * 30
    assert len(search.history) == 13
    assert search.done == 12
    first = search_of(scenario, limits, name)
    run_path_generations(first, 60, 0, none)
    pair = np.stack([first.archive.scores[0], search.archive.scores[0]])
    assert best_first(pair)[0] == 1
    assert last.shape == search.encoding.lower.shape


def test_a_seeded_search_spends_a_share_once_it_is_safe(scenario: Scenario, limits: Limits) -> None:
    seeded = replace(ALGORITHMS["umda-smooth"], seeded=True)
    search = search_of(scenario, limits, "umda-smooth")
    search.algorithm = seeded
    run_path_generations(search, 60, 400, np.empty((0, search.encoding.lower.size)))
    assert search.best_is_safe()
    assert search.evaluations < 0.35 * (60 + 400 * 30)


# ----------------------------------------------------------------------
# Generations of waypoints: they find the way without seeds, from the same seed the same, and keep to what is asked.


def waypoint_search(scenario: Scenario, limits: Limits, seed: int = 1) -> Search:
    problem, algorithm = make_problem(scenario, limits), ALGORITHMS["fda"]
    encoding = ENCODINGS["rotated"](problem.space, scenario.planner.waypoints)
    return Search(problem, algorithm, encoding, stream(seed, PLANNER), None, None, False, 10.0)


def ratio(plan: Plan) -> float:
    return float(plan.objectives[Objective.LENGTH_RATIO])


@pytest.mark.parametrize(("threats", "most"), [("07", 1.015), ("30", 1.02), ("60", 1.15)])
def test_the_way_is_found_without_seeds(threats: str, most: float, make_limits: Callable[[Scenario], Limits]) -> None:
    """The best known ratios are 1.010, 1.012 and 1.129; UMDA without seeds is safe in half of its runs on the last."""
    scenario = load_scenario(f"hard-{threats}")
    for seed in some((1, 2), 2):
        plan = plan_path(scenario, make_limits(scenario), seed=seed, algorithm="fda")
        assert plan.safe, plan.certificate.problems
        assert ratio(plan) < most


def test_generations_shorten_the_best_path(make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("hard-15")
    search = waypoint_search(scenario, make_limits(scenario))
    run_waypoint_generations(search, 200, 100)
    lengths = [row[0] for row in search.history if row[2] == 0.0]
    assert len(search.history) == MAX_GENERATIONS == search.done
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] < lengths[0] - 0.005


def test_waypoints_stay_in_their_intervals(scenario: Scenario, limits: Limits) -> None:
    search = waypoint_search(scenario, limits)
    run_waypoint_generations(search, 40, 5)
    assert search.done == 5
    assert (search.archive.vectors >= search.encoding.lower).all()
    assert (search.archive.vectors <= search.encoding.upper).all()
    np.testing.assert_array_equal(search.archive.scores, search.score(search.archive.vectors))


def test_a_stop_ends_after_the_generation_under_way(scenario: Scenario, limits: Limits) -> None:
    search = waypoint_search(scenario, limits)
    search.stop_condition = lambda: "interrupted" if search.done >= 2 else ""
    run_waypoint_generations(search, 40, 8)
    assert (search.done, search.end_reason) == (2, "interrupted")


def counted_legs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Candidates and legs of each join from here on."""
    joins: list[tuple[int, int]] = []

    def counted(data: ProblemArrays, candidates: Floats, *more: object) -> WaypointChains:
        chains = waypoint_chains(data, candidates, *more)
        joins.append((candidates.shape[1], chains.legs))
        return chains

    monkeypatch.setattr(generations, "waypoint_chains", counted)
    return joins


@pytest.mark.parametrize("population", some([60, 120], 2))
def test_a_search_that_finds_no_way_evaluates_so_many_legs(
    population: int,
    small: Callable[..., Scenario],
    make_limits: Callable[[Scenario], Limits],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two rows of missiles, whose gaps of a few metres no proof closes and no path passes."""
    units = [
        {"east_m": east, "north_m": north, "kill_radius_m": 600, "kill_scale_m": 200}
        for north in range(-3000, 3001, 799)
        for east in (3000, 4400)
    ]
    planner = {"waypoints": 8, "population": population, "generations": 25}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=units, planner=planner)
    assert not is_closed(make_problem(scenario, make_limits(scenario)).certified)
    joins = counted_legs(monkeypatch)
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    assert not plan.safe
    assert plan.ended == "completed"
    # 0.4 of the population in the first generation, 24 in five more, and seven legs from end to end; twice as many legs
    # as there are between all of them, and no more to the last candidate than there are candidates.
    first = int(0.4 * population)
    most = 2 * 7 * (first**2 + 5 * 24**2)
    assert 0.5 * most < sum(legs for _, legs in joins) <= most + 2 * first
    # The second attempt has twice the candidates, which are too many to be joined without a bound; there is no third.
    assert max(candidates for candidates, _ in joins) == 2 * first
    advice = explain_failure(plan, make_limits(scenario))[-1]
    assert "[planner] waypoints = 16 allows more turns, and --budget 1000000 searches for longer" in advice
    # A budget asks for more.
    joins.clear()
    plan_path(with_planner(scenario, "--budget", budget=10**9), make_limits(scenario), seed=1)
    assert sum(legs for _, legs in joins) > 1.5 * most
    assert max(candidates for candidates, _ in joins) == 3 * first


def test_no_generation_finds_nothing_but_still_a_plan(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    scenario = small(planner={"waypoints": 6, "population": 4, "generations": 1})
    plan = plan_path(scenario, make_limits(scenario), seed=1, algorithm="fda")
    assert plan.waypoints.shape == (6, 3)
