"""Preference between scored candidates: goals, priorities and Pareto dominance.

Fonseca and Fleming, "Multiobjective optimization and multiple constraint handling with evolutionary algorithms", IEEE
Transactions on Systems, Man, and Cybernetics A 28, 1998. Levels are in order of priority. Let U be the components of a
level in which u violates its goal. Then u is preferred to v if u dominates v on U; or if they are equal on U and either
v violates a goal outside U, or u is preferred to v at the next level (at the lowest: u dominates v on the components
that satisfy their goals). A component without a goal is treated as violated (goal -inf), so that for a level without
goals U is all its components.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from world.arrays import Floats, Ints
from world.kernels import compiled, inner

NO_GOAL = -np.inf

# Run length of insertion sort.
INSERTION_RUN = 8
# Number of rows of two columns above which a tree is faster than a scan.
TREE_THRESHOLD = 4000


@dataclass(frozen=True, slots=True)
class Level:
    """Priority level: columns of the scores, all minimised, and a goal for each (`NO_GOAL` without a goal)."""

    columns: tuple[int, ...]
    goals: tuple[float, ...]

    def __post_init__(self) -> None:
        """Raise ValueError if the goals do not match the columns."""
        if len(self.columns) != len(self.goals) or not self.columns:
            raise ValueError(f"{len(self.columns)} columns and {len(self.goals)} goals: give one goal a column")


def ranks(scores: Floats, levels: Sequence[Level]) -> Ints:
    """Return the number of rows that are preferred to each row of scores (n, c), counted level by level, (n,).

    With every component raised to its goal, "u dominates v on U, or is equal there and v violates a goal outside U" is
    Pareto dominance on the level, and only rows equal on it proceed to the next: a component outside U is at its goal,
    and no row is below it. Each level is therefore one dominance count within groups of ties.

    >>> levels = Level((0,), (0.0,)), Level((1,), (NO_GOAL,))
    >>> ranks(np.array([[0.0, 9.0], [1.0, 2.0], [0.0, 3.0]]), levels).tolist()  # those that meet the goal come first
    [1, 2, 0]
    """
    columns = [column for level in levels for column in level.columns]
    goals = [goal for level in levels for goal in level.goals]
    lowest = list(levels[-1].columns)
    # The lowest level is appended without goals, for rows that are equal on all levels.
    table = np.concatenate([np.maximum(scores[:, columns], goals), scores[:, lowest]], axis=1)
    widths = np.array([*(len(level.columns) for level in levels), len(lowest)])
    return np.asarray(_rank_rows(np.ascontiguousarray(table.T), widths))


@compiled
def _rank_rows(table: Floats, widths: Ints) -> Ints:
    """Return the ranks (n,) of a table (c, n) whose levels have these widths."""
    count = table.shape[1]
    total = np.zeros(count, dtype=np.int64)
    order, scratch = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):
        order[k] = k
    sorted_ = np.empty((table.shape[0], count))
    below = np.empty(count, dtype=np.int64)
    # Groups of tied rows: the position in the order at which each begins, followed by the count.
    begins, after = np.empty(count + 1, dtype=np.int64), np.empty(count + 1, dtype=np.int64)
    begins[0], begins[1], groups = 0, count, 1
    column = 0
    for width in widths:
        distinct = 0
        for g in range(groups):
            begin, end = begins[g], begins[g + 1]
            after[distinct] = begin
            distinct += 1
            if end - begin == 1:
                continue
            _merge_sort(table, column, width, order, scratch, begin, end)
            for c in range(width):
                for k in range(begin, end):
                    sorted_[c, k] = table[column + c, order[k]]
            if width == 2 and end - begin > TREE_THRESHOLD:
                _count_pairs(sorted_, begin, end, order, total)
            else:
                _count_any(sorted_, width, begin, end, order, below, total)
            for k in range(begin + 1, end):
                for c in range(width):
                    if sorted_[c, k] != sorted_[c, k - 1]:
                        after[distinct] = k
                        distinct += 1
                        break
        after[distinct] = count
        groups = distinct
        begins, after = after, begins
        column += width
        if groups == count:
            # No ties left for lower levels to decide.
            break
    return total


@inner
def _merge_sort(table: Floats, column: int, width: int, order: Ints, scratch: Ints, begin: int, end: int) -> None:
    """Sort order[begin:end] lexicographically by `width` columns of the table: a stable merge sort."""
    for k in range(begin + 1, end):
        # Insertion sort of short runs.
        low = begin + (k - begin) // INSERTION_RUN * INSERTION_RUN
        row, at = order[k], k
        while at > low and _precedes(table, column, width, row, order[at - 1]):
            order[at] = order[at - 1]
            at -= 1
        order[at] = row
    size = INSERTION_RUN
    while size < end - begin:
        for low in range(begin, end - size, 2 * size):
            middle, high = low + size, min(low + 2 * size, end)
            if not _precedes(table, column, width, order[middle], order[middle - 1]):
                continue
            left, right = low, middle
            for k in range(low, high):
                if right >= high or (left < middle and not _precedes(table, column, width, order[right], order[left])):
                    scratch[k] = order[left]
                    left += 1
                else:
                    scratch[k] = order[right]
                    right += 1
            for k in range(low, high):
                order[k] = scratch[k]
        size *= 2


@inner
def _precedes(table: Floats, column: int, width: int, a: int, b: int) -> bool:
    """Return True if row a precedes row b, column by column."""
    for c in range(column, column + width):
        if table[c, a] != table[c, b]:
            return bool(table[c, a] < table[c, b])
    return False


@inner
def _count_any(rows: Floats, width: int, begin: int, end: int, order: Ints, below: Ints, total: Ints) -> None:
    """Add the number of dominators of each row of a group to total.

    rows: (c, n), sorted, so that only earlier rows can dominate.
    """
    dominators = 0
    for k in range(begin + 1, end):
        equal = True
        for c in range(width):
            equal = equal and rows[c, k] == rows[c, k - 1]
        if not equal:
            dominators = k - begin
            # No earlier row is larger in the first column.
            if width == 2:
                dominators = _count_at_most(rows[1, begin:k], rows[1, k])
            elif width > 2:
                less = below[: k - begin]
                for j in range(less.size):
                    less[j] = 1
                for c in range(1, width):
                    _clear_above(rows[c, begin:k], rows[c, k], less)
                dominators = _count_marks(less)
        total[order[k]] += dominators


@inner
def _count_at_most(values: Floats, limit: float) -> int:
    """Count the values not above the limit, without branches, so that the loop is vectorised."""
    count = 0
    for k in range(values.size):
        count += 1 if values[k] <= limit else 0
    return count


@inner
def _clear_above(values: Floats, limit: float, marks: Ints) -> None:
    """Clear the marks of values above the limit."""
    for k in range(values.size):
        marks[k] &= 1 if values[k] <= limit else 0


@inner
def _count_marks(marks: Ints) -> int:
    """Count the marks that are 1; the others are 0."""
    count = 0
    for k in range(marks.size):
        count += marks[k]
    return count


@inner
def _rank_places(rows: Floats, begin: int, end: int) -> tuple[Ints, int]:
    """Return the places of a group's rows in the order of the second column, from 1, and the number of places.

    Equal values have the same place.
    """
    count = end - begin
    order, places = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):
        order[k] = begin + k
    _merge_sort(rows, 1, 1, order, places, 0, count)
    place = 0
    for k in range(count):
        if k == 0 or rows[1, order[k]] != rows[1, order[k - 1]]:
            place += 1
        places[order[k] - begin] = place
    return places, place


@inner
def _count_pairs(rows: Floats, begin: int, end: int, order: Ints, total: Ints) -> None:
    """Add the number of dominators of each row of a group to total, in O(n log n), for many rows.

    Uses a Fenwick tree over the second of two columns.
    """
    places, number = _rank_places(rows, begin, end)
    tree = np.zeros(number + 1, dtype=np.int64)
    k = begin
    while k < end:
        first = k
        place = places[k - begin]
        dominators = 0
        at = place
        while at > 0:
            dominators += tree[at]
            at -= at & -at
        while k < end and rows[0, k] == rows[0, first] and rows[1, k] == rows[1, first]:
            total[order[k]] += dominators
            k += 1
        at = place
        while at <= number:
            tree[at] += k - first
            at += at & -at
