"""Sampling with niches: many groups of variables.

Each group has a mixture of Gaussians around its best samples.

`planner.optimisers.umda` fits one Gaussian to each variable. Here the density of a group is a sum of Gaussians around
its selected samples (Bosman and Thierens, "IDEAs based on the normal kernels probability density function", Utrecht
University UU-CS-2000-11). Selection keeps niches apart by clearing (Petrowski, "A clearing procedure as a niching
method for genetic algorithms", ICEC 1996), so that several routes around an obstacle coexist.
"""

from collections.abc import Callable

import numpy as np

from world.arrays import Flags, Floats, Ints
from world.kernels import compiled, copy_into, inner

# Maximum number of redraws of an infeasible first sample before it is accepted.
MAX_FIRST_REDRAWS = 8
# Maximum number of redraws of an infeasible later sample before it is accepted.
MAX_REDRAWS = 4
# Clearing radius of niches, as a fraction of the sampling deviation.
CLEARING_RADIUS_RATIO = 0.5
# Largest fraction of a group's samples that is selected.
MAX_SELECTED_FRACTION = 0.5
# Number of samples of each group that are selected regardless of their cost.
MIN_SELECTED_COUNT = 4


class NicheSampling:
    """Sampling of groups of variables (g, n, d), from the whole box to the niches of the best samples.

    lower, upper: (g, d) boxes.
    allowed: function of samples (n, d) and their groups (n,) that returns a mask (n,): True where a sample is feasible.
    rng: random generator of all samples.

    >>> lower, upper = np.full((3, 2), -2.0), np.full((3, 2), 6.0)
    >>> search = NicheSampling(lower, upper, lambda rows, groups: rows[:, 0] > -1.0, np.random.default_rng(1))
    >>> rows = search.draw_first(40)
    >>> for generation in range(12):
    ...     costs = (rows**2).sum(axis=2)
    ...     elite = rows[range(3), costs.argmin(axis=1)]
    ...     rows = search.draw_next(rows, costs, 40, 0.6**generation * np.ones(2), 1e9, elite)
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
        """Store the boxes, the test for feasible samples, and the random generator."""
        self._lower, self._upper = lower, upper
        self._allowed = allowed
        self._rng = rng

    def draw_first(self, count: int, extension: Floats | float = 0.0) -> Floats:
        """Draw samples (g, count, d), uniform in the boxes.

        extension: (d,) fraction of the box by which samples may exceed its upper bound before they are clipped. It is
            for variables whose best value is at the upper bound, which uniform samples would hardly ever reach.
        """
        size = (len(self._lower), count, self._lower.shape[1])
        extended_upper = self._upper + extension * (self._upper - self._lower)
        lower, upper = self._lower[:, None, :], extended_upper[:, None, :]

        def draw(groups: Ints) -> Floats:
            """Return one uniform sample for each group number, (n, d)."""
            fractions = self._rng.random((groups.size, size[2]))
            return np.asarray(
                np.minimum(lower[groups, 0] + fractions * (upper - lower)[groups, 0], self._upper[groups])
            )

        return self._draw_feasible(size, draw, MAX_FIRST_REDRAWS)

    def draw_next(
        self, rows: Floats, costs: Floats, count: int, deviation: Floats, max_cost: float, elite: Floats
    ) -> Floats:
        """Return the next samples (g, count, d): elite, best sample of each niche, and new ones around them.

        rows: (g, n, d) samples.
        costs: (g, n) costs of the samples.
        count: number of samples of each group to return.
        deviation: (d,) standard deviations of new samples.
        max_cost: maximum cost of a selected sample.
        elite: (g, d) one sample of each group, such as its best so far. It is always selected and comes first.
        """
        selected, counts = _select(
            rows, costs, elite, CLEARING_RADIUS_RATIO * deviation, max_cost, max(1, int(MAX_SELECTED_FRACTION * count))
        )
        group_count, parent_count = len(rows), selected.shape[1]

        def draw(group_numbers: Ints) -> Floats:
            """Return one sample near a random selected sample for each group number, (n, d)."""
            parent_rows = np.floor(self._rng.random(group_numbers.size) * counts[group_numbers]).astype(np.int64)
            samples = selected[group_numbers, parent_rows] + deviation * self._rng.standard_normal(
                (group_numbers.size, rows.shape[2])
            )
            return np.clip(samples, self._lower[group_numbers], self._upper[group_numbers])

        out = self._draw_feasible((group_count, count, rows.shape[2]), draw, MAX_REDRAWS)
        is_selected = np.arange(parent_count) < counts[:, None]
        out[:, :parent_count][is_selected] = selected[is_selected]
        return out

    def _draw_feasible(self, size: tuple[int, int, int], draw: Callable[[Ints], Floats], max_redraws: int) -> Floats:
        """Draw `size` samples (groups, samples per group, variables), and draw infeasible samples again.

        draw: function that returns one sample for each of the given group numbers (n,), (n, d).
        max_redraws: maximum number of further draws; after them, infeasible samples remain.
        """
        groups = np.repeat(np.arange(size[0]), size[1])
        samples = draw(groups)
        infeasible_rows = np.flatnonzero(~self._allowed(samples, groups))
        for _ in range(max_redraws):
            if not infeasible_rows.size:
                break
            redrawn_samples = draw(groups[infeasible_rows])
            samples[infeasible_rows] = redrawn_samples
            infeasible_rows = infeasible_rows[~self._allowed(redrawn_samples, groups[infeasible_rows])]
        return samples.reshape(size)


@compiled
def _select(
    rows: Floats, costs: Floats, elite: Floats, clearing_radius: Floats, max_cost: float, max_count: int
) -> tuple[Floats, Ints]:
    """Select each group's elite, then its best samples that are distinct from all samples selected before.

    Returns the selected samples, (g, max_count, d), padded with zeros, and the number of samples of each group, (g,).

    rows: (g, n, d) samples.
    costs: (g, n) costs of the samples; inf for a sample that is never selected.
    elite: (g, d) one sample per group.
    clearing_radius: (d,) two samples are distinct if they differ by at least this in one variable.
    max_cost: maximum cost of a selected sample. It applies only after the first `MIN_SELECTED_COUNT` selections.
    max_count: maximum number of selected samples of a group. Both counts include the elite.
    """
    group_count, _, size = rows.shape
    selected, counts = np.zeros((group_count, max_count, size)), np.ones(group_count, dtype=np.int64)
    for g in range(group_count):
        copy_into(selected[g, 0], elite[g])
        for k in np.argsort(costs[g], kind="mergesort"):
            selected_count = counts[g]
            if (
                selected_count == max_count
                or costs[g, k] == np.inf
                or (costs[g, k] > max_cost and selected_count >= MIN_SELECTED_COUNT)
            ):
                break
            if _is_distinct(rows[g, k], selected[g, :selected_count], clearing_radius):
                copy_into(selected[g, selected_count], rows[g, k])
                counts[g] += 1
    return selected, counts


@inner
def _is_distinct(row: Floats, other_rows: Floats, clearing_radius: Floats) -> bool:
    """Return True if a sample differs from each other sample by the clearing radius or more.

    A difference in one variable suffices.

    row: (d,) the sample.
    other_rows: (n, d) the other samples.
    clearing_radius: (d,) radius in each variable.
    """
    for n in range(other_rows.shape[0]):
        is_near = True
        for d in range(row.size):
            is_near = is_near and abs(row[d] - other_rows[n, d]) < clearing_radius[d]
        if is_near:
            return False
    return True
