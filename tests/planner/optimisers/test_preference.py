"""The preference relation: the definition, case by case, and the fast ranking against it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.reference import preferred, ranks_by_definition
from planner.optimisers.preference import NO_GOAL, Level, ranks

PAPER = (
    Level((0, 1, 2, 3), (0.0, 0.0, 0.0, 0.0)),
    Level((4, 5), (NO_GOAL, NO_GOAL)),
    Level((6, 7), (NO_GOAL, NO_GOAL)),
)
GOALS = (
    Level((0, 1, 2, 3), (0.0, 0.0, 0.0, 0.0)),
    Level((4, 5), (1.0, NO_GOAL)),
    Level((6, 7), (1.0, 1.0)),
)
SINGLE = (
    Level((0, 1, 2, 3), (0.0, 0.0, 1.0, 1.0)),
    Level((5,), (NO_GOAL,)),
    Level((4,), (1.0,)),
    Level((6, 7), (2.0, 0.0)),
)


def row(*values: float) -> np.ndarray:
    return np.array(values, dtype=np.float64)


@pytest.mark.parametrize(
    ("u", "v", "expected"),
    [
        # Meeting all constraints beats violating one, whatever the length.
        (row(0, 0, 0, 0, 9, 9, 9, 9), row(1, 0, 0, 0, 1, 0, 0, 0), True),
        (row(1, 0, 0, 0, 1, 0, 0, 0), row(0, 0, 0, 0, 9, 9, 9, 9), False),
        # Violations are compared one by one, not by their sum: 1 turn is not preferred to 5 slopes.
        (row(1, 0, 0, 0, 1, 0, 0, 0), row(0, 5, 0, 0, 1, 0, 0, 0), False),
        (row(0, 5, 0, 0, 1, 0, 0, 0), row(1, 0, 0, 0, 1, 0, 0, 0), False),
        # Equal where u violates a goal, and v violates another as well.
        (row(2, 0, 0, 0, 9, 9, 9, 9), row(2, 1, 0, 0, 1, 0, 0, 0), True),
        # Equal violations: the next level decides, by dominance on both.
        (row(2, 0, 0, 0, 1, 1, 9, 9), row(2, 0, 0, 0, 1, 2, 0, 0), True),
        (row(0, 0, 0, 0, 1.2, 0.0, 0, 0), row(0, 0, 0, 0, 1.1, 0.5, 0, 0), False),
        # Exact ties on both levels: the third.
        (row(0, 0, 0, 0, 1, 1, 3, 4), row(0, 0, 0, 0, 1, 1, 3, 5), True),
        (row(0, 0, 0, 0, 1, 1, 3, 5), row(0, 0, 0, 0, 1, 1, 3, 5), False),
    ],
)
def test_paper_preference(u: np.ndarray, v: np.ndarray, expected: bool) -> None:
    assert preferred(u, v, PAPER) is expected


def test_below_a_goal_at_the_lowest_level_dominance_decides() -> None:
    levels = (Level((0, 1), (5.0, 5.0)),)
    assert preferred(row(1, 2), row(2, 2), levels)
    assert not preferred(row(1, 3), row(2, 2), levels)
    # With a lower level, what is within the goals is equal.
    assert not preferred(row(1, 2, 3), row(2, 2, 3), (*levels, Level((2,), (NO_GOAL,))))


tables = st.integers(1, 40).flatmap(
    lambda n: st.lists(st.lists(st.integers(0, 3), min_size=8, max_size=8), min_size=n, max_size=n)
)


@settings(max_examples=60)
@given(tables, st.sampled_from([PAPER, GOALS, SINGLE]))
def test_fast_ranks_are_those_of_the_definition(table: list[list[int]], levels: tuple[Level, ...]) -> None:
    scores = np.array(table, dtype=np.float64)
    np.testing.assert_array_equal(ranks(scores, levels), ranks_by_definition(scores, levels))


@pytest.mark.parametrize("levels", [PAPER, GOALS, SINGLE])
@pytest.mark.parametrize("few", [1, 2, 50])
def test_fast_ranks_on_many_rows(levels: tuple[Level, ...], few: int) -> None:
    rng = np.random.default_rng(few)
    scores = rng.integers(0, few + 1, (120, 8)).astype(np.float64)
    scores[:, :4] *= rng.random((120, 4)) < 0.4
    np.testing.assert_array_equal(ranks(scores, levels), ranks_by_definition(scores, levels))


@settings(max_examples=40)
@given(
    st.lists(st.lists(st.integers(0, 2), min_size=8, max_size=8), min_size=3, max_size=3),
    st.sampled_from([PAPER, GOALS]),
)
def test_preference_is_a_strict_order(table: list[list[int]], levels: tuple[Level, ...]) -> None:
    a, b, c = np.array(table, dtype=np.float64)
    assert not preferred(a, a, levels)
    if preferred(a, b, levels):
        assert not preferred(b, a, levels)
        if preferred(b, c, levels):
            assert preferred(a, c, levels)


def test_level_refuses_goals_that_do_not_match() -> None:
    with pytest.raises(ValueError, match="goals"):
        Level((0, 1), (0.0,))
