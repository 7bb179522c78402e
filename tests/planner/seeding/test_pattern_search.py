"""A pattern search shortens a path within its box and its evaluations, and gives what it found by its own scores."""

from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS, rotated_vectors
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import make_problem
from planner.plan import Objective
from planner.seeding.pattern_search import search_patterns
from world.scenario import Scenario


@pytest.mark.parametrize("most", [60, 400])
def test_a_zigzag_is_shortened_and_stays_feasible(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits], most: int
) -> None:
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[])
    problem = make_problem(scenario, make_limits(scenario))
    encoding = ENCODINGS["rotated"](problem.space, 8)
    path = np.linspace(scenario.start, scenario.destination, 8)
    path[1:-1, 1] += 30.0 * (-1.0) ** np.arange(6)
    vector = rotated_vectors(problem.space, encoding, path[None])[0]
    found, evaluations = search_patterns(problem.search, encoding, vector, most)
    assert evaluations <= most + 1
    assert (found >= encoding.lower).all()
    assert (found <= encoding.upper).all()
    vectors = np.concatenate([vector[None], found])
    violations, objectives = graded_scores(problem.search, encoding.decode(vectors))
    assert not violations[1].any()
    before, after = objectives[[0, -1], Objective.LENGTH_RATIO] - 1.0
    assert after < (1.0 if most == 60 else 0.1) * before
