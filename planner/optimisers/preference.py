"""Preference between scored candidates: goals, priorities and Pareto dominance.

Fonseca and Fleming, "Multiobjective optimization and multiple constraint handling with evolutionary algorithms", IEEE
Transactions on Systems, Man, and Cybernetics A 28, 1998. Levels are in order of priority. Let U be the components of a
level in which u violates its goal. Then u is preferred to v in two cases: u dominates v on U; or they are equal on U,
and v violates a goal outside U or u is preferred to v at the next level. At the lowest level the last condition is that
u dominates v on the components that satisfy their goals. A component without a goal is treated as violated (goal -inf),
so that for a level without goals U is all its components.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from world.arrays import Floats, Ints
from world.kernels import compiled, inner

NO_GOAL = -np.inf

# Run length of insertion sort.
INSERTION_RUN = 8
# Number of rows with two columns above which a tree is faster than a scan.
TREE_THRESHOLD = 4000


@dataclass(frozen=True, slots=True)
class Level:
    """Priority level: the columns of the scores that it compares, and a goal for each.

    All scores are minimised. Scores at or below the goal are equally good; the goal `NO_GOAL` is never reached.
    """

    columns: tuple[int, ...]
    goals: tuple[float, ...]

    def __post_init__(self) -> None:
        """Raise ValueError if the goals do not match the columns."""
        if len(self.columns) != len(self.goals) or not self.columns:
            raise ValueError(f"{len(self.columns)} columns but {len(self.goals)} goals: give one goal per column")


def ranks(scores: Floats, levels: Sequence[Level]) -> Ints:
    """Rank each row of scores (n, c) by the number of rows that are preferred to it, (n,); 0 is best.

    levels: priority levels, highest priority first.

    Every component is first raised to its goal, so that no row is below a goal. The rule "u dominates v on U, or is
    equal there and v violates a goal outside U" then becomes Pareto dominance on the level, because a component outside
    U is at its goal. Only rows that are equal on a level are compared on the next level, so that each level only counts
    the dominators of each row within its group of ties.

    >>> levels = Level((0,), (0.0,)), Level((1,), (NO_GOAL,))
    >>> ranks(np.array([[0.0, 9.0], [1.0, 2.0], [0.0, 3.0]]), levels).tolist()  # those that meet the goal come first
    [1, 2, 0]
    """
    columns = [column for level in levels for column in level.columns]
    goals = [goal for level in levels for goal in level.goals]
    lowest_level_columns = list(levels[-1].columns)
    # The lowest level is appended without goals, to compare rows that are equal on all levels.
    table = np.concatenate([np.maximum(scores[:, columns], goals), scores[:, lowest_level_columns]], axis=1)
    widths = np.array([*(len(level.columns) for level in levels), len(lowest_level_columns)])
    return np.asarray(_rank_candidates(np.ascontiguousarray(table.T), widths))


@compiled
def _rank_candidates(table: Floats, widths: Ints) -> Ints:
    """Return for each candidate the number of candidates that are preferred to it, (n,).

    table: (c, n) scores, one column per candidate. The rows of the level with the highest priority come first.
    widths: number of rows of the table in each priority level, highest priority first.

    A lower level only decides between candidates that are equal on all higher levels. The candidates are therefore
    sorted by the first level, split into groups of equal ones, and each group is sorted by the next level. Within a
    group, those that dominate a candidate are counted.
    """
    count = table.shape[1]
    candidate_ranks = np.zeros(count, dtype=np.int64)
    order, scratch = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):
        order[k] = k
    sorted_rows = np.empty((table.shape[0], count))
    marks = np.empty(count, dtype=np.int64)
    # Groups of tied candidates: the start of each group in the order, followed by the count.
    group_starts, next_group_starts = np.empty(count + 1, dtype=np.int64), np.empty(count + 1, dtype=np.int64)
    group_starts[0], group_starts[1], group_count = 0, count, 1
    first_row = 0
    for width in widths:
        next_group_count = 0
        for g in range(group_count):
            start, end = group_starts[g], group_starts[g + 1]
            next_group_starts[next_group_count] = start
            next_group_count += 1
            if end - start == 1:
                continue
            _merge_sort(table, first_row, width, order, scratch, start, end)
            for c in range(width):
                for k in range(start, end):
                    sorted_rows[c, k] = table[first_row + c, order[k]]
            if width == 2 and end - start > TREE_THRESHOLD:
                _add_dominator_counts_by_tree(sorted_rows, start, end, order, candidate_ranks)
            else:
                _add_dominator_counts(sorted_rows, width, start, end, order, marks, candidate_ranks)
            for k in range(start + 1, end):
                for c in range(width):
                    if sorted_rows[c, k] != sorted_rows[c, k - 1]:
                        next_group_starts[next_group_count] = k
                        next_group_count += 1
                        break
        next_group_starts[next_group_count] = count
        group_count = next_group_count
        group_starts, next_group_starts = next_group_starts, group_starts
        first_row += width
        if group_count == count:
            # No ties left for lower levels to decide.
            break
    return candidate_ranks


@inner
def _merge_sort(table: Floats, first_row: int, width: int, order: Ints, scratch: Ints, begin: int, end: int) -> None:
    """Sort order[begin:end] lexicographically by `width` rows of the table, from row `first_row` on.

    table: (c, n) scores, one column per candidate.
    order: numbers of candidates, sorted in place.
    scratch: working memory as long as `order`.

    The merge sort is stable.
    """
    for k in range(begin + 1, end):
        # Insertion sort of short runs.
        run_begin = begin + (k - begin) // INSERTION_RUN * INSERTION_RUN
        candidate, position = order[k], k
        while position > run_begin and _precedes(table, first_row, width, candidate, order[position - 1]):
            order[position] = order[position - 1]
            position -= 1
        order[position] = candidate
    run_length = INSERTION_RUN
    while run_length < end - begin:
        for run_begin in range(begin, end - run_length, 2 * run_length):
            middle, run_end = run_begin + run_length, min(run_begin + 2 * run_length, end)
            if not _precedes(table, first_row, width, order[middle], order[middle - 1]):
                continue
            left, right = run_begin, middle
            for k in range(run_begin, run_end):
                if right >= run_end or (
                    left < middle and not _precedes(table, first_row, width, order[right], order[left])
                ):
                    scratch[k] = order[left]
                    left += 1
                else:
                    scratch[k] = order[right]
                    right += 1
            for k in range(run_begin, run_end):
                order[k] = scratch[k]
        run_length *= 2


@inner
def _precedes(table: Floats, first_row: int, width: int, candidate: int, other: int) -> bool:
    """Return True if a candidate is lower than the other one in the first row in which they differ.

    table: (c, n) scores, one column per candidate. Its rows from first_row to first_row + width - 1 are compared.
    """
    for c in range(first_row, first_row + width):
        if table[c, candidate] != table[c, other]:
            return bool(table[c, candidate] < table[c, other])
    return False


@inner
def _add_dominator_counts(
    rows: Floats, width: int, begin: int, end: int, order: Ints, scratch: Ints, candidate_ranks: Ints
) -> None:
    """Add to each candidate of a tied group the number of candidates in the group that dominate it.

    rows: (c, n) scores, one column per candidate; only the first `width` rows are compared.
    width: number of scores of the priority level.
    begin, end: the group is the columns from begin to end - 1. They are sorted lexicographically, so that only earlier
        candidates can dominate.
    order: number of the candidate in each column, (n,).
    scratch: working memory, (n,); its values do not matter, and are overwritten.
    candidate_ranks: rank of each candidate by its number, (n,); updated.

    An earlier candidate dominates if it is nowhere higher. Equal candidates do not dominate each other, and get the
    same count.
    """
    dominators = 0
    for k in range(begin + 1, end):
        is_equal = True
        for c in range(width):
            is_equal = is_equal and rows[c, k] == rows[c, k - 1]
        if not is_equal:
            dominators = k - begin
            # No earlier candidate has a larger first score.
            if width == 2:
                dominators = _count_at_most(rows[1, begin:k], rows[1, k])
            elif width > 2:
                marks = scratch[: k - begin]
                for j in range(marks.size):
                    marks[j] = 1
                for c in range(1, width):
                    _clear_marks_above(rows[c, begin:k], rows[c, k], marks)
                dominators = _count_marks(marks)
        candidate_ranks[order[k]] += dominators


@inner
def _count_at_most(values: Floats, limit: float) -> int:
    """Return the number of values not above a limit.

    The loop has no branches, so that it is vectorised.
    """
    count = 0
    for k in range(values.size):
        count += 1 if values[k] <= limit else 0
    return count


@inner
def _clear_marks_above(values: Floats, limit: float, marks: Ints) -> None:
    """Set the marks of values above a limit to 0, and leave the other marks as they are."""
    for k in range(values.size):
        marks[k] &= 1 if values[k] <= limit else 0


@inner
def _count_marks(marks: Ints) -> int:
    """Return the number of marks that are 1; the others are 0."""
    count = 0
    for k in range(marks.size):
        count += marks[k]
    return count


@inner
def _dense_ranks(rows: Floats, begin: int, end: int) -> tuple[Ints, int]:
    """Rank the candidates begin to end - 1 by the second row of scores.

    Ranks start at 1 and have no gaps; equal values have the same rank: the values 7, 3, 7 have the ranks 2, 1, 2.

    Returns the ranks (end - begin,) and the highest rank.
    """
    count = end - begin
    order, dense_ranks = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):
        order[k] = begin + k
    _merge_sort(rows, 1, 1, order, dense_ranks, 0, count)
    rank = 0
    for k in range(count):
        if k == 0 or rows[1, order[k]] != rows[1, order[k - 1]]:
            rank += 1
        dense_ranks[order[k] - begin] = rank
    return dense_ranks, rank


@inner
def _add_dominator_counts_by_tree(rows: Floats, begin: int, end: int, order: Ints, candidate_ranks: Ints) -> None:
    """Count dominators as `_add_dominator_counts` does, for two scores only, but in O(n log n).

    rows: (2, n) scores, one column per candidate.
    begin, end: the group is the columns from begin to end - 1, which are sorted by the first score, then by the second.
    order: (n,) number of the candidate in each column.
    candidate_ranks: (n,) rank of each candidate by its number; updated.

    Candidates are visited in the order of the first score. A Fenwick tree counts the candidates visited so far by the
    rank of their second score; those of the same or a lower rank dominate the next candidate.
    """
    dense_ranks, rank_count = _dense_ranks(rows, begin, end)
    tree = np.zeros(rank_count + 1, dtype=np.int64)
    k = begin
    while k < end:
        group_begin = k
        rank = dense_ranks[k - begin]
        dominators = 0
        node = rank
        while node > 0:
            dominators += tree[node]
            node -= node & -node
        while k < end and rows[0, k] == rows[0, group_begin] and rows[1, k] == rows[1, group_begin]:
            candidate_ranks[order[k]] += dominators
            k += 1
        node = rank
        while node <= rank_count:
            tree[node] += k - group_begin
            node += node & -node
