"""Sampling with niches: many groups of variables, each with a mixture of Gaussians around its best samples.

Where `planner.optimisers.umda` fits one Gaussian to each variable, the density of a group here is a sum of Gaussians
around its selected samples (Bosman and Thierens, "IDEAs based on the normal kernels probability density function",
Utrecht University UU-CS-2000-11). Selection keeps niches apart by clearing (Petrowski, "A clearing procedure as a
niching method for genetic algorithms", ICEC 1996), so that several routes around an obstacle coexist.
"""

from collections.abc import Callable

import numpy as np

from world.arrays import Flags, Floats, Ints
from world.kernels import compiled, copy_into, inner

# Redraws of an infeasible first sample before it is accepted.
FIRST_REDRAWS = 8
# Redraws of an infeasible later sample before it is accepted.
REDRAWS = 4
# Clearing radius of niches, as a fraction of the sampling deviation.
CLEARING = 0.5
# Largest fraction of a group's samples that is selected.
MAX_SELECTED_SHARE = 0.5
# Number of samples of each group that are selected regardless of their cost.
MIN_SELECTED = 4


class NicheSampling:
    """Sampling of groups of variables (g, n, d), from the whole box to the niches of the best samples.

    lower, upper: (g, d) boxes.
    allowed: samples (n, d) of groups (n,) -> feasibility (n,).
    rng: random generator of all samples.

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
        """Draw samples (g, count, d), uniform in the boxes.

        beyond: (d,) fraction of the box by which samples extend above it before they are clipped, for variables with
        their best values at the upper bound, which uniform samples would hardly ever reach.
        """
        size = (len(self._lower), count, self._lower.shape[1])
        top = self._upper + beyond * (self._upper - self._lower)
        low, high = self._lower[:, None, :], top[:, None, :]

        def draw(groups: Ints) -> Floats:
            spread = self._rng.random((groups.size, size[2]))
            return np.asarray(np.minimum(low[groups, 0] + spread * (high - low)[groups, 0], self._upper[groups]))

        return self._draw(size, draw, FIRST_REDRAWS)

    def next(
        self, rows: Floats, costs: Floats, count: int, deviation: Floats, max_cost: float, elite: Floats
    ) -> Floats:
        """Return samples (g, count, d): the elite, the best of each niche, and new samples around these.

        rows: (g, n, d) with costs (g, n). deviation: (d,) standard deviations of new samples. max_cost: maximum cost of
        a selected sample. elite: (g, d), always selected.
        """
        selected, numbers = _select(
            rows, costs, elite, CLEARING * deviation, max_cost, max(1, int(MAX_SELECTED_SHARE * count))
        )
        groups, parents = len(rows), selected.shape[1]

        def draw(of: Ints) -> Floats:
            parent = np.floor(self._rng.random(of.size) * numbers[of]).astype(np.int64)
            drawn = selected[of, parent] + deviation * self._rng.standard_normal((of.size, rows.shape[2]))
            return np.clip(drawn, self._lower[of], self._upper[of])

        out = self._draw((groups, count, rows.shape[2]), draw, REDRAWS)
        old = np.arange(parents) < numbers[:, None]
        out[:, :parents][old] = selected[old]
        return out

    def _draw(self, size: tuple[int, int, int], draw: Callable[[Ints], Floats], redraws: int) -> Floats:
        """Draw samples of this shape with a function of the group numbers, and redraw infeasible samples."""
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
def _select(
    rows: Floats, costs: Floats, elite: Floats, clearing_radius: Floats, max_cost: float, number: int
) -> tuple[Floats, Ints]:
    """Select samples (g, number, d) of each group, the elite first, and return them with their numbers (g,)."""
    groups, _, size = rows.shape
    selected, numbers = np.zeros((groups, number, size)), np.ones(groups, dtype=np.int64)
    for g in range(groups):
        copy_into(selected[g, 0], elite[g])
        for k in np.argsort(costs[g], kind="mergesort"):
            many = numbers[g]
            if many == number or costs[g, k] == np.inf or (costs[g, k] > max_cost and many >= MIN_SELECTED):
                break
            if _is_distinct(rows[g, k], selected[g, :many], clearing_radius):
                copy_into(selected[g, many], rows[g, k])
                numbers[g] += 1
    return selected, numbers


@inner
def _is_distinct(row: Floats, others: Floats, clearing_radius: Floats) -> bool:
    """Return True if a sample (d,) differs from each other one by at least `clearing_radius` in some variable."""
    for n in range(others.shape[0]):
        near = True
        for d in range(row.size):
            near = near and abs(row[d] - others[n, d]) < clearing_radius[d]
        if near:
            return False
    return True
