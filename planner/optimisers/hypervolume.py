"""Hypervolume of a front, and selection of the few points that cover most of it.

The hypervolume is the volume of objective space that some point dominates, up to a reference point (Zitzler and Thiele,
"Multiobjective optimization using evolutionary algorithms - a comparative case study", PPSN V, 1998). All objectives
are minimised. A greedy choice covers at least 1 - 1/e of the volume of the best choice of the same number of points
(Nemhauser, Wolsey and Fisher, Mathematical Programming 14, 1978).
"""

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats, Ints
from world.kernels import compiled

Marks = NDArray[np.uint8]

# Number of random points at which coverage is counted.
PROBE_COUNT = 4096
# Seed of these points if no generator is given, so that the same points give the same choice.
SEED = 20


def hypervolume(points: Floats, reference: Floats) -> float:
    """Return the exact volume that points (n, m) dominate below a reference point (m,).

    The volume is cut into slabs at the points' last objectives. In each slab the other objectives bound a volume of one
    dimension less, which is computed in the same way.

    >>> hypervolume(np.array([[1.0, 3.0], [2.0, 1.0]]), np.array([4.0, 4.0]))  # areas 1 x 3 + 2 x 2
    7.0
    """
    points_below = points[(points < reference).all(axis=1)]
    if not len(points_below):
        return 0.0
    if points_below.shape[1] == 1:
        return float(reference[0] - points_below.min())
    order = np.argsort(points_below[:, -1], kind="stable")
    heights = np.append(points_below[order, -1], reference[-1])
    total = 0.0
    for k in range(len(order)):
        if heights[k + 1] > heights[k]:
            slab = np.unique(points_below[order[: k + 1], :-1], axis=0)
            # A distinct point is non-dominated if no point but itself is at or below it in all objectives.
            is_below = np.asarray((slab[:, None, :] <= slab[None, :, :]).all(axis=2))
            slab = slab[is_below.sum(axis=0) == 1]
            total += float(heights[k + 1] - heights[k]) * hypervolume(slab, reference[:-1])
    return total


def covering_order(points: Floats, reference: Floats, count: int, rng: np.random.Generator | None = None) -> Ints:
    """Choose up to `count` of the points (n, m), so that they cover as much hypervolume as possible.

    Returns their row numbers in order of choice.

    reference: (m,) upper limit; a point that is not below it in every objective is left out.
    rng: random generator of the probes; None for the same probes in every call.

    The best point of each objective comes first. Each further point is the one that adds most to the covered volume.
    The volume is counted at random probes between the best values of the points and the reference. Points that add
    nothing come last, in their original order.

    >>> front = np.array([[0.0, 9.0], [9.0, 0.0], [4.0, 4.0], [4.1, 4.1]])
    >>> covering_order(front, np.array([10.0, 10.0]), 3).tolist()
    [0, 1, 2]
    """
    rows_below = np.flatnonzero((points < reference).all(axis=1))
    if not rows_below.size:
        return np.zeros(0, dtype=np.int64)
    points_below = np.ascontiguousarray(points[rows_below])
    best_values, probe_rng = points_below.min(axis=0), np.random.default_rng(SEED) if rng is None else rng
    probes = best_values + probe_rng.random((PROBE_COUNT, len(best_values))) * (reference - best_values)
    single_best_rows = dict.fromkeys(
        int(np.lexsort((points_below.sum(axis=1), column))[0]) for column in points_below.T
    )
    chosen_rows = _choose_rows_greedily(
        _mark_covered_probes(points_below, np.ascontiguousarray(probes.T)),
        np.array(list(single_best_rows)),
        min(count, len(points_below)),
    )
    return np.asarray(rows_below[chosen_rows], dtype=np.int64)


@compiled
def _mark_covered_probes(points: Floats, probes: Floats) -> Marks:
    """Mark the probes that each point dominates, (n, p): [i, j] is 1 if point i dominates probe j, else 0.

    points: (n, m) objectives of each point.
    probes: (m, p) objectives of each probe. A point at or below a probe in every objective dominates it.
    """
    marks = np.ones((points.shape[0], probes.shape[1]), dtype=np.uint8)
    for n in range(points.shape[0]):
        for k in range(points.shape[1]):
            for p in range(probes.shape[1]):
                marks[n, p] &= np.uint8(points[n, k] <= probes[k, p])
    return marks


@compiled
def _choose_rows_greedily(marks: Marks, first_rows: Ints, count: int) -> Ints:
    """Choose `count` points that together cover many probes; return the numbers of their rows.

    marks: (n, p); [i, j] is 1 if point i covers probe j.
    first_rows: points that are chosen first.

    Each further point is the one that covers most probes not yet covered, the first of equal ones. This number of
    probes, the gain of a point, can only decrease when other points are chosen. A gain computed earlier is therefore an
    upper bound, and only few gains have to be computed again (Minoux, Optimization Techniques, Lecture Notes in Control
    and Information Sciences 7, 1978).
    """
    size, width = marks.shape
    uncovered, count_positions, gains = np.ones(width, dtype=np.uint8), np.full(size, -1), np.full(size, width)
    chosen_rows = np.empty(count, dtype=np.int64)
    for position in range(count):
        row = first_rows[position] if position < first_rows.size else np.argmax(gains)
        while position >= first_rows.size and count_positions[row] < position:
            common_count = 0
            for p in range(width):
                common_count += marks[row, p] & uncovered[p]
            gains[row], count_positions[row] = common_count, position
            row = np.argmax(gains)
        chosen_rows[position] = row
        gains[row] = -1
        for p in range(width):
            uncovered[p] &= 1 - marks[row, p]
    return chosen_rows
