"""Preference between scored candidates: goals, priorities and Pareto dominance (Fonseca and Fleming 1998).

Levels come in order of priority.  With U the components of a level in which u misses its goal, u is preferred to
v if u dominates v on U; or if they are equal on U and either v misses a goal outside U, or u is preferred to v at
the next level (at the lowest: u dominates v on the components it satisfies).  A component without a goal counts
as missed (goal -inf), so a level without goals has U = all its components.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_GOAL = -np.inf


@dataclass(frozen=True, slots=True)
class Level:
    """One priority: columns of the scores, all minimised, and a goal for each (`NO_GOAL` for none)."""

    columns: tuple[int, ...]
    goals: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse a level whose goals do not match its columns."""
        if len(self.columns) != len(self.goals) or not self.columns:
            raise ValueError(f"{len(self.columns)} columns and {len(self.goals)} goals: give one goal a column")


def preferred(u: Floats, v: Floats, levels: Sequence[Level]) -> bool:
    """Whether u is preferred to v: the relation as it is defined, for one pair of score rows (c,)."""
    for number, level in enumerate(levels):
        columns, goals = list(level.columns), np.array(level.goals)
        a, b = u[columns], v[columns]
        missed = a > goals
        if _dominates(a[missed], b[missed]):
            return True
        if not np.array_equal(a[missed], b[missed]):
            return False
        if (b[~missed] > goals[~missed]).any():
            return True
        if number == len(levels) - 1:
            return _dominates(a[~missed], b[~missed])
    return False


def _dominates(a: Floats, b: Floats) -> bool:
    return bool((a <= b).all() and (a < b).any())


def generic_ranks(scores: Floats, levels: Sequence[Level]) -> Ints:
    """Count the rows preferred to each row (n, c) -> (n,): by the definition, O(n^2).  For tests."""
    return np.array([sum(preferred(v, u, levels) for v in scores) for u in scores], dtype=np.int64)


def ranks(scores: Floats, levels: Sequence[Level]) -> Ints:
    """Count the rows preferred to each row (n, c) -> (n,), split by level.

    With every component raised to its goal, "u dominates v on U, or is equal there and v misses outside U" is
    Pareto dominance on the level, and only rows equal on it go on to the next: a component outside U is at its
    goal, which no other row is below.  So each level is one dominance count inside groups of ties.
    """
    group = np.zeros(len(scores), dtype=np.int64)
    total = np.zeros(len(scores), dtype=np.int64)
    for level in levels:
        raised = np.ascontiguousarray(np.maximum(scores[:, list(level.columns)], np.array(level.goals)))
        group = _count_level(raised, group, total)
        if group.size and int(group.max()) == group.size - 1:
            # No two rows are equal: lower levels have nothing to decide.
            return total
    lowest = np.ascontiguousarray(scores[:, list(levels[-1].columns)])
    _count_level(lowest, group, total)
    return total


@njit(cache=True)
def _count_level(values: Floats, group: Ints, total: Ints) -> Ints:  # pragma: no cover - compiled
    """Add to total the dominators of each row within its group; return groups split by equal rows."""
    count, width = values.shape
    if count == 0:
        return group
    order = np.arange(count)
    for column in range(width - 1, -1, -1):
        order = order[np.argsort(values[order, column], kind="mergesort")]
    if group.max() > 0:
        order = order[np.argsort(group[order], kind="mergesort")]
    split = np.empty(count, dtype=np.int64)
    # Distinct rows in sorted order: the position of their first member, closed by count.
    firsts = np.empty(count + 1, dtype=np.int64)
    distinct = 0
    for k in range(count):
        fresh = k == 0 or group[order[k]] != group[order[k - 1]]
        for column in range(width):
            if not fresh and values[order[k], column] != values[order[k - 1], column]:
                fresh = True
        if fresh:
            firsts[distinct] = k
            distinct += 1
        split[order[k]] = distinct - 1
    firsts[distinct] = count
    begin = 0
    while begin < distinct:
        end = begin + 1
        while end < distinct and group[order[firsts[end]]] == group[order[firsts[begin]]]:
            end += 1
        if width == 2:
            _count_pairs(values, order, firsts, begin, end, total)
        else:
            _count_any(values, order, firsts, begin, end, total)
        begin = end
    return split


@njit(cache=True)
def _count_any(
    values: Floats, order: Ints, firsts: Ints, begin: int, end: int, total: Ints
) -> None:  # pragma: no cover - compiled
    """Dominators among distinct rows begin..end, in lexicographic order: only an earlier row can dominate."""
    width = values.shape[1]
    for k in range(begin + 1, end):
        dominators = 0
        for j in range(begin, k):
            below = True
            for column in range(width):
                if values[order[firsts[j]], column] > values[order[firsts[k]], column]:
                    below = False
                    break
            if below:
                dominators += firsts[j + 1] - firsts[j]
        for member in range(firsts[k], firsts[k + 1]):
            total[order[member]] += dominators


@njit(cache=True)
def _count_pairs(
    values: Floats, order: Ints, firsts: Ints, begin: int, end: int, total: Ints
) -> None:  # pragma: no cover - compiled
    """Do the same for two columns with a Fenwick tree over the second, O(n log n)."""
    size = end - begin
    second = np.empty(size)
    for k in range(size):
        second[k] = values[order[firsts[begin + k]], 1]
    steps = np.unique(second)
    tree = np.zeros(steps.size + 1, dtype=np.int64)
    for k in range(size):
        place = np.searchsorted(steps, second[k]) + 1
        dominators = 0
        at = place
        while at > 0:
            dominators += tree[at]
            at -= at & -at
        members = firsts[begin + k + 1] - firsts[begin + k]
        for member in range(firsts[begin + k], firsts[begin + k + 1]):
            total[order[member]] += dominators
        at = place
        while at <= steps.size:
            tree[at] += members
            at += at & -at
