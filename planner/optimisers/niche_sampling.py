"""Samples of many groups of variables at once: each group keeps its best that lie apart, and samples around them.

Where `planner.optimisers.umda` fits one Gaussian to each variable, here a group's density is a sum of Gaussians, one
about each row that is kept (Bosman and Thierens, "IDEAs based on the normal kernels probability density function",
Utrecht University UU-CS-2000-11), and rows are kept apart by clearing (Petrowski, "A clearing procedure as a niching
method for genetic algorithms", ICEC 1996).  So several ways round an obstacle live beside each other.  It knows boxes,
rows, costs and which rows are allowed, and nothing of what they stand for.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from world.kernels import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Draws of a row that is not allowed before it is taken as it is: of the first rows, and of later ones.
FIRST_REDRAWS, REDRAWS = 8, 4
# Rows of a group that are kept apart by less than this share of the deviation are one.
CLEARING = 0.5
# Of the rows of a group, the share that is kept at most.
KEPT_SHARE = 0.5
# Rows of a group that are kept, however much they cost.
FEWEST_KEPT = 4


class NicheSampling:
    """Rows of groups of variables (g, n, d), from the whole box to the niches of the best.

    lower, upper: (g, d) boxes.
    allowed: rows (n, d) of group numbers (n,) -> flags (n,).
    rng: of all draws.

    >>> lower, upper = np.full((3, 2), -2.0), np.full((3, 2), 6.0)
    >>> search = NicheSampling(lower, upper, lambda rows, groups: rows[:, 0] > -1.0, np.random.default_rng(1))
    >>> rows = search.first(40)
    >>> for generation in range(12):
    ...     costs = (rows**2).sum(axis=2)
    ...     rows = search.next(rows, costs, 40, 0.6**generation * np.ones(2), 1e9, rows[range(3), costs.argmin(axis=1)])
    >>> bool(np.abs(rows[:, 0]).max() < 0.25)  # the best of each group so far comes first
    True
    """

    def __init__(
        self,
        lower: Floats,
        upper: Floats,
        allowed: Callable[[Floats, Ints], Flags],
        rng: np.random.Generator,
    ) -> None:
        self._lower, self._upper = lower, upper
        self._allowed = allowed
        self._rng = rng

    def first(self, count: int, beyond: Floats | float = 0.0) -> Floats:
        """Rows (g, count, d), uniform in the boxes.

        beyond: (d,) share of the box by which draws go on above it, to be clipped to its upper side: where the best
        rows lie on that side, uniform draws hardly ever would.
        """
        size = (len(self._lower), count, self._lower.shape[1])
        top = self._upper + beyond * (self._upper - self._lower)
        low, high = self._lower[:, None, :], top[:, None, :]

        def draw(groups: Ints) -> Floats:
            spread = self._rng.random((groups.size, size[2]))
            return np.asarray(np.minimum(low[groups, 0] + spread * (high - low)[groups, 0], self._upper[groups]))

        return self._drawn(size, draw, FIRST_REDRAWS)

    def next(self, rows: Floats, costs: Floats, count: int, deviation: Floats, most: float, elite: Floats) -> Floats:
        """Rows (g, count, d): the elite, the best that lie apart, and new ones around all of these.

        rows: (g, n, d) with their costs (g, n).  deviation: (d,) of the new rows.  most: what a row that is kept may
        cost.  elite: (g, d), kept in any case.
        """
        kept, numbers = _keep(rows, costs, elite, CLEARING * deviation, most, max(1, int(KEPT_SHARE * count)))
        groups, parents = len(rows), kept.shape[1]

        def draw(of: Ints) -> Floats:
            parent = np.floor(self._rng.random(of.size) * numbers[of]).astype(np.int64)
            drawn = kept[of, parent] + deviation * self._rng.standard_normal((of.size, rows.shape[2]))
            return np.clip(drawn, self._lower[of], self._upper[of])

        out = self._drawn((groups, count, rows.shape[2]), draw, REDRAWS)
        old = np.arange(parents) < numbers[:, None]
        out[:, :parents][old] = kept[old]
        return out

    def _drawn(self, size: tuple[int, int, int], draw: Callable[[Ints], Floats], redraws: int) -> Floats:
        """Rows of this size by a draw for each group number; those that are not allowed are drawn again."""
        groups = np.repeat(np.arange(size[0]), size[1])
        out = draw(groups)
        bad = np.flatnonzero(~self._allowed(out, groups))
        for _ in range(redraws):
            if not bad.size:
                break
            again = draw(groups[bad])
            out[bad] = again
            bad = bad[~self._allowed(again, groups[bad])]
        return out.reshape(size)


@compiled
def _keep(
    rows: Floats, costs: Floats, elite: Floats, apart: Floats, most: float, number: int
) -> tuple[Floats, Ints]:  # pragma: no cover - compiled
    """Rows (g, number, d) that are kept of each group, the elite first, and how many, (g,)."""
    groups, _, size = rows.shape
    kept, numbers = np.zeros((groups, number, size)), np.ones(groups, dtype=np.int64)
    for g in range(groups):
        kept[g, 0] = elite[g]
        for k in np.argsort(costs[g], kind="mergesort"):
            many = numbers[g]
            if many == number or costs[g, k] == np.inf or (costs[g, k] > most and many >= FEWEST_KEPT):
                break
            if _lies_apart(rows[g, k], kept[g, :many], apart):
                kept[g, many] = rows[g, k]
                numbers[g] += 1
    return kept, numbers


@compiled
def _lies_apart(row: Floats, others: Floats, apart: Floats) -> bool:  # pragma: no cover - compiled
    """Whether a row (d,) differs from each other one in some variable by at least so much."""
    for n in range(others.shape[0]):
        near = True
        for d in range(row.size):
            near = near and abs(row[d] - others[n, d]) < apart[d]
        if near:
            return False
    return True
