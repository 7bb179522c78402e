"""The graded scores see what six points a leg do not, and nothing where there is nothing."""

import math

import numpy as np

from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem
from planner.plan import Objective


def test_a_path_beside_everything_has_no_violation(problem: Problem) -> None:
    path = np.array([[0, 0, 150], [2000, -1500, 200], [4200, -1500, 200], [6000, 0, 150]], dtype=np.float64)
    counts, objectives = paper_scores(problem.search, path[None])
    graded, smooth = graded_scores(problem.search, path[None])
    assert not counts.any()
    assert not graded.any()
    assert objectives[0, Objective.KILL_EXPOSURE] == 0.0
    assert smooth[0, Objective.KILL_EXPOSURE] == 0.0
    assert smooth[0, Objective.LENGTH_RATIO] == objectives[0, Objective.LENGTH_RATIO]


def test_a_sphere_cut_between_points_is_seen_only_by_the_graded_scores(problem: Problem) -> None:
    """Leg points stand 1 km apart; the leg dips 30 m into the sphere between two of them."""
    path = np.array([[0, 0, 150], [0, -870, 150], [6000, -870, 150], [6000, 0, 150]], dtype=np.float64)
    _, paper = paper_scores(problem.search, path[None])
    _, graded = graded_scores(problem.search, path[None])
    distance = math.hypot(670, 150 - problem.search.threats["up"][0])
    assert 600 < distance < 700
    inside = [e for e in range(0, 6001, 1000) if math.dist((e, -870, 150), problem.scenario.threats.position[0]) <= 700]
    assert (paper[0, Objective.KILL_EXPOSURE] > 0) == bool(inside)
    assert graded[0, Objective.KILL_EXPOSURE] > 0
