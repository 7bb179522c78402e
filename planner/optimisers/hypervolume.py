"""Hypervolume of a front, and the few of its points that cover most of it.

The hypervolume is the volume of objective space that some point dominates, up to a reference point (Zitzler and Thiele,
"Multiobjective optimization using evolutionary algorithms - a comparative case study", PPSN V, 1998). All objectives
are minimised. A greedy choice covers at least 1 - 1/e of what the best choice of as many points does (Nemhauser, Wolsey
and Fisher, Mathematical Programming 14, 1978).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Random points at which coverage is counted, and their seed: the same points give the same choice.
PROBES, SEED = 2048, 20


def hypervolume(points: Floats, reference: Floats) -> float:
    """Volume that points (n, m) dominate below a reference point (m,), exactly, by slices along the last objective.

    >>> hypervolume(np.array([[1.0, 3.0], [2.0, 1.0]]), np.array([4.0, 4.0]))  # 3 x 1 and 2 x 2 of it below
    7.0
    """
    inside = points[(points < reference).all(axis=1)]
    if not len(inside):
        return 0.0
    if inside.shape[1] == 1:
        return float(reference[0] - inside.min())
    order = np.argsort(inside[:, -1], kind="stable")
    heights = np.append(inside[order, -1], reference[-1])
    total = 0.0
    for k in range(len(order)):
        if heights[k + 1] > heights[k]:
            slab = inside[order[: k + 1], :-1]
            total += float(heights[k + 1] - heights[k]) * hypervolume(_lowest(slab), reference[:-1])
    return total


def _lowest(points: Floats) -> Floats:
    """Points (n, m) that no other dominates, each once."""
    points = np.unique(points, axis=0)
    below = np.asarray((points[:, None, :] <= points[None, :, :]).all(axis=2))
    # Each lies at or below itself.
    return np.asarray(points[below.sum(axis=0) == 1])


def covering_order(points: Floats, reference: Floats, count: int) -> Ints:
    """Up to `count` rows of points (n, m) below a reference (m,): first the best of each objective, then greedily.

    Each further point is the one that adds most to the volume that is covered, counted at random probes between the
    points' best values and the reference. Points that add nothing come last, in their order.

    >>> front = np.array([[0.0, 9.0], [9.0, 0.0], [4.0, 4.0], [4.1, 4.1]])
    >>> covering_order(front, np.array([10.0, 10.0]), 3).tolist()
    [0, 1, 2]
    """
    inside = np.flatnonzero((points < reference).all(axis=1))
    if not inside.size:
        return np.zeros(0, dtype=np.int64)
    kept = points[inside]
    best = kept.min(axis=0)
    probes = best + np.random.default_rng(SEED).random((PROBES, len(best))) * (reference - best)
    covered_by = np.ones((PROBES, len(kept)), dtype=bool)
    for k in range(kept.shape[1]):
        covered_by &= kept[:, k] <= probes[:, k, None]
    chosen: list[int] = []
    open_probes = np.ones(PROBES, dtype=bool)
    gains = covered_by.sum(axis=0)
    firsts = list(dict.fromkeys(np.lexsort((kept.sum(axis=1), kept[:, k]))[0] for k in range(kept.shape[1])))
    left = np.ones(len(kept), dtype=bool)
    for number in range(min(count, len(kept))):
        row = int(firsts[number]) if number < len(firsts) else int(np.argmax(np.where(left, gains, -1)))
        chosen.append(row)
        left[row] = False
        newly = open_probes & covered_by[:, row]
        gains -= covered_by[newly].sum(axis=0)
        open_probes &= ~newly
    return np.asarray(inside[chosen], dtype=np.int64)
