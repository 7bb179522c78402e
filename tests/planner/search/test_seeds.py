"""What a seeded search starts from: the straight line, routes that are fitted, an older path."""

from collections.abc import Callable

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS
from planner.evaluation.problem import make_problem
from planner.search.algorithms import ALGORITHMS
from planner.search.search_state import Search
from planner.search.seeds import starting_vectors, straight_line
from world.random_streams import PLANNER, stream
from world.scenario import Scenario

FLAT = {"kind": "flat", "amsl_m": 0}
GRIDS = ((24, 2),)


def search_of(scenario: Scenario, limits: Limits, algorithm: str = "umda-seeded") -> Search:
    problem = make_problem(scenario, limits)
    encoding = ENCODINGS["rotated"](problem.space, scenario.planner.waypoints)
    return Search(problem, ALGORITHMS[algorithm], encoding, stream(1, PLANNER), None, None, False, 10.0)


def test_the_straight_line_is_an_answer_only_where_nothing_stands_in_it(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    for threats, clear in (([], True), (None, False)):
        scenario = small(terrain=FLAT) if threats is None else small(terrain=FLAT, threats=threats)
        search = search_of(scenario, make_limits(scenario))
        assert straight_line(search) == clear
        assert len(search.archive.vectors) == int(clear)


def test_one_seed_leads_and_the_archive_holds_what_it_was_improved_to(scenario: Scenario, limits: Limits) -> None:
    search = search_of(scenario, limits)
    starts = starting_vectors(search, GRIDS, None)
    assert starts.shape == (1, search.encoding.lower.size)
    assert search.best_is_safe()
    assert search.archive.scores[0, 4] <= search.score(starts)[0, 4]


def test_an_older_path_is_started_from_too(scenario: Scenario, limits: Limits) -> None:
    search = search_of(scenario, limits)
    older = np.linspace(scenario.start, scenario.destination, scenario.planner.waypoints)
    starts = starting_vectors(search, GRIDS, older)
    assert len(starts) == 2
    np.testing.assert_allclose(search.encoding.decode(starts[1:])[0], older, rtol=0.0, atol=1e-6)


def test_without_seeds_there_are_none(scenario: Scenario, limits: Limits) -> None:
    assert starting_vectors(search_of(scenario, limits, "umda-smooth"), GRIDS, None).size == 0
