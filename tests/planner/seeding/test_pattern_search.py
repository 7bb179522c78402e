"""A pattern search shortens a path within its box and its evaluations, and gives what it found by its own scores."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS, Encoding, rotated_vectors
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Objective
from planner.search.search_state import are_violated, score_table
from planner.seeding import pattern_search
from planner.seeding.pattern_search import merits, search_patterns
from world.arrays import Floats
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


@pytest.fixture
def zigzag(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> tuple[Problem, Encoding, Floats]:
    """A zigzag through a missile and a zone, over a hill and partly above the greatest height: all parts of a merit."""
    scenario = small(
        terrain={"kind": "peaks", "peak": [{"east_m": 4000, "north_m": 300, "height_m": 80, "sigma_m": 700}]},
        threats=[{"east_m": 2000, "north_m": 150, "kill_radius_m": 400, "kill_scale_m": 150}],
        zones=[{"name": "it", "kind": "exclusion", "east_m": 3500, "north_m": -250, "radius_m": 300}],
        limits={"min_clearance_m": 50, "max_height_m": 200},
    )
    problem = make_problem(scenario, make_limits(scenario))
    encoding = ENCODINGS["rotated"](problem.space, 8)
    path = np.linspace(scenario.start, scenario.destination, 8)
    path[1:-1, 1] += 60.0 * (-1.0) ** np.arange(6)
    path[3, 2] += 120.0
    return problem, encoding, rotated_vectors(problem.space, encoding, path[None])[0]


@pytest.fixture
def grazing(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> tuple[Problem, Encoding, Floats]:
    """A straight line that grazes a sphere: what leaves it is longer by more than so small an exposure counts."""
    missile = {"east_m": 3000, "north_m": -420, "amsl_m": 150, "kill_radius_m": 400, "kill_scale_m": 20}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[missile])
    problem = make_problem(scenario, make_limits(scenario))
    problem = replace(problem, search=problem.search._replace(kill_margin=22.0))
    encoding = ENCODINGS["rotated"](problem.space, 8)
    path = np.linspace(scenario.start, scenario.destination, 8)
    return problem, encoding, rotated_vectors(problem.space, encoding, path[None])[0]


@pytest.mark.parametrize("task", ["zigzag", "grazing"])
@pytest.mark.parametrize("most", [2, 30, 90, 700])
def test_evaluations_that_end_early_change_no_result(task: str, most: int, request: pytest.FixtureRequest) -> None:
    """The same search, each path evaluated as a whole."""
    problem, encoding, vector = request.getfixturevalue(task)

    def measure(vectors: Floats) -> tuple[float, bool]:
        scores = score_table(*graded_scores(problem.search, encoding.decode(vectors[None])))
        exposed = scores[0, 4 + Objective.KILL_EXPOSURE] > 0.0
        return float(merits(scores)[0]), not (are_violated(scores)[0] or exposed)

    moves, axes = pattern_search._triangular_basis(6)
    span = float(np.linalg.norm(problem.space.destination[:2] - problem.space.start[:2])) / 6
    steps = np.array([0.2 * span, 0.15 * span, 25.0])[axes]
    first, here, feasible = steps.copy(), vector, None
    best, fit = measure(here)
    shortest, made, alive = np.inf, 1, True
    assert not fit
    while made < most and alive:
        alive, before = False, here
        for k in range(len(moves) + 1):
            if made >= most or (k < len(moves) and abs(steps[k]) < 0.002 * first[k]):
                continue
            better = False
            for _ in range(2 if k < len(moves) else 1):
                trial = np.clip(
                    here + (steps[k] * moves[k] if k < len(moves) else here - before), encoding.lower, encoding.upper
                )
                merit, fit = measure(trial)
                made += 1
                if fit and merit < shortest:
                    shortest, feasible = merit, trial
                if merit < best:
                    best, better, here = merit, True, trial
                    break
                if k < len(moves):
                    steps[k] = -steps[k]
            if k < len(moves):
                steps[k] *= 1.5 if better else 0.5
                alive = True
    assert (feasible is not None) or most < 90
    found, evaluations = search_patterns(problem.search, encoding, vector, most)
    assert evaluations == made
    wanted = [here] if feasible is None else [feasible] if shortest <= best else [feasible, here]
    np.testing.assert_array_equal(found, wanted)


def test_it_asks_after_some_evaluations_and_ends_with_what_it_has(
    zigzag: tuple[Problem, Encoding, Floats], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, encoding, vector = zigzag
    asked: list[int] = []

    def ask(end: bool) -> bool:
        asked.append(0)
        return end

    whole, made = search_patterns(problem.search, encoding, vector, 400)
    monkeypatch.setattr(pattern_search, "EVALUATIONS_PER_CHECK", 1)
    sliced, same = search_patterns(problem.search, encoding, vector, 400, lambda: ask(False))
    np.testing.assert_array_equal(whole, sliced)
    assert made == same
    # A move is tried on one side or on both.
    assert 200 <= len(asked) <= 400
    monkeypatch.setattr(pattern_search, "EVALUATIONS_PER_CHECK", 60)
    few, made = search_patterns(problem.search, encoding, vector, 60)
    stopped, same = search_patterns(problem.search, encoding, vector, 400, lambda: ask(True))
    np.testing.assert_array_equal(few, stopped)
    assert abs(same - made) <= 2
