"""Generations of whole paths: their number, their history, and that they better the first population."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS
from planner.evaluation.problem import make_problem
from planner.search.algorithms import ALGORITHMS
from planner.search.path_generations import path_generations
from planner.search.score_table import best_first
from planner.search.search_state import Search
from world.random_streams import PLANNER, stream
from world.scenario import Scenario


def search_of(scenario: Scenario, limits: Limits, algorithm: str) -> Search:
    problem, chosen = make_problem(scenario, limits), ALGORITHMS[algorithm]
    encoding = ENCODINGS[chosen.encoding](problem.space, scenario.planner.waypoints)
    return Search(problem, chosen, encoding, stream(1, PLANNER), None, None, False, 10.0)


@pytest.mark.parametrize("name", ["umda", "umda-smooth", "emna", "chain", "de", "umda-cartesian"])
def test_generations_better_the_first_population(scenario: Scenario, limits: Limits, name: str) -> None:
    search = search_of(scenario, limits, name)
    none = np.empty((0, search.encoding.lower.size))
    last = path_generations(search, 60, 12, none)
    assert search.evaluations == 60 + 12 * 30
    assert len(search.history) == 13
    assert search.done == 12
    first = search_of(scenario, limits, name)
    path_generations(first, 60, 0, none)
    pair = np.stack([first.archive.scores[0], search.archive.scores[0]])
    assert best_first(pair)[0] == 1
    assert last.shape == search.encoding.lower.shape


def test_a_seeded_search_spends_a_share_once_it_is_safe(scenario: Scenario, limits: Limits) -> None:
    seeded = replace(ALGORITHMS["umda-smooth"], seeded=True)
    search = search_of(scenario, limits, "umda-smooth")
    search.algorithm = seeded
    path_generations(search, 60, 400, np.empty((0, search.encoding.lower.size)))
    assert search.best_is_safe()
    assert search.evaluations < 0.35 * (60 + 400 * 30)
