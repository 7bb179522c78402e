"""Scores are ordered by constraints, then kill exposure, then length; equal ones keep their order."""

import numpy as np

from planner.search.score_table import DETECTION, HEIGHT, KILL, LENGTH, best_first, safe, score_table, violated

SCORES = score_table(
    np.array([[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 2]]),
    np.array([[1.0, 0.0, 0, 0], [1.2, 0.5, 9, 9], [1.5, 0.0, 9, 9], [1.2, 0.5, 0, 0], [9.0, 0.0, 0, 0]]),
)


def test_best_first_by_constraints_then_exposure_then_length() -> None:
    # Rows 1 and 3 differ in what the order does not look at; rows 0 and 4 violate different constraints.
    assert best_first(SCORES).tolist()[:3] == [2, 1, 3]
    assert (LENGTH, KILL, DETECTION, HEIGHT) == (4, 5, 6, 7)


def test_each_row_is_violated_or_safe_or_neither() -> None:
    assert violated(SCORES).tolist() == [True, False, False, False, True]
    assert safe(SCORES).tolist() == [False, False, True, False, False]
