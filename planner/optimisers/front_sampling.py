"""An estimation of distribution for several objectives: a mixture of Gaussians, one about each solution of the front.

Thierens and Bosman ("Multi-objective mixture-based iterated density estimation evolutionary algorithms", GECCO 2001)
spread the mixture along the front by clusters. Here every solution of the archive is the mean of a component. Its
covariance is that of the solutions nearest to it among the variables, so that solutions that are not alike (routes past
different sides of an obstacle) are not mixed, plus noise along given directions, whose scale follows how often it
succeeds. The archive holds solutions that no other dominates, those first that cover most hypervolume.
"""

import numpy as np
from numpy.typing import NDArray

from planner.optimisers.hypervolume import covering_order
from planner.optimisers.preference import NO_GOAL, Level, ranks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Solutions nearest to the mean that its covariance is taken of, and the share of their differences that it has.
NEIGHBOURS, REACH = 6, 0.7
# Share of samples that move by noise alone; scale of noise at first, as a share of each direction's length, its bounds,
# and its factors for a generation in which more or less than a tenth of the samples succeed.
NOISE_ONLY, FIRST_SCALE, MIN_SCALE, MAX_SCALE, GROW, SHRINK, SUCCESS = 0.5, 0.1, 1e-4, 0.5, 1.15, 0.9, 0.1
# Directions that a sample's noise uses, at most.
USED_DIRECTIONS = 4


class FrontSampling:
    """Ask-and-tell search for a front in a box.

    lower, upper: (d,) box.
    directions: (k, d) of the noise, each as long as its largest deviation.
    reference: (m,) objectives beyond which a solution does not count.
    size: of the archive. population: samples of a generation.

    >>> unit = np.eye(2)
    >>> search = FrontSampling(np.zeros(2), np.ones(2), unit, np.full(2, 2.0), 20, 40, np.random.default_rng(1))
    >>> search.tell(np.full((1, 2), 0.5), np.full((1, 2), 0.5), np.zeros((1, 1)))
    >>> for generation in range(30):
    ...     x = search.ask()
    ...     search.tell(x, np.column_stack([x[:, 0], 1.0 - x[:, 0] + x[:, 1]]), np.zeros((len(x), 1)))
    >>> bool(np.abs(search.vectors[:, 1]).max() < 0.02), len(search.vectors)
    (True, 20)
    """

    def __init__(
        self,
        lower: Floats,
        upper: Floats,
        directions: Floats,
        reference: Floats,
        size: int,
        population: int,
        rng: np.random.Generator,
    ) -> None:
        self._lower, self._upper, self._directions = lower, upper, directions
        self._reference, self._size, self._population, self._rng = reference, size, population, rng
        self._scale = FIRST_SCALE
        self.vectors: Floats = np.empty((0, lower.size))
        self.objectives: Floats = np.empty((0, reference.size))

    def ask(self) -> Floats:
        """Samples (population, d) of the mixture."""
        count, rng = self._population, self._rng
        means = rng.integers(len(self.vectors), size=count)
        samples = self.vectors[means].copy()
        joined = np.flatnonzero(rng.random(count) >= NOISE_ONLY)
        spread = (self._upper - self._lower).clip(1e-12)
        scaled = self.vectors / spread
        number = min(NEIGHBOURS, len(self.vectors) - 1)
        if number > 0:
            away = ((scaled[means[joined], None, :] - scaled[None, :, :]) ** 2).sum(axis=2)
            near = np.argsort(away, axis=1, kind="stable")[:, 1 : number + 1]
            weights = REACH * rng.standard_normal((len(joined), number)) / np.sqrt(number)
            samples[joined] += np.einsum(
                "nk,nkd->nd", weights, self.vectors[near] - self.vectors[means[joined], None, :]
            )
        samples += self._noise(count)
        return np.clip(samples, self._lower, self._upper)

    def _noise(self, count: int) -> Floats:
        """Noise (count, d) along a few directions each, at a scale that varies from sample to sample."""
        rng, k = self._rng, len(self._directions)
        used = min(USED_DIRECTIONS, k)
        picked = rng.integers(k, size=(count, used))
        sizes = self._scale * 10.0 ** rng.uniform(-1.0, 0.5, (count, 1)) * rng.standard_normal((count, used))
        sizes[:, 1:] *= rng.random((count, used - 1)) < 0.5
        return np.asarray(np.einsum("nk,nkd->nd", sizes, self._directions[picked]))

    def tell(self, vectors: Floats, objectives: Floats, violations: Floats) -> None:
        """Take samples (n, d) with objectives (n, m) and violations (n, c), all 0 where the constraints are met."""
        met = (violations <= 0.0).all(axis=1) & (objectives < self._reference).all(axis=1)
        new = int(met.sum())
        if new:
            every = np.concatenate([self.vectors, vectors[met]])
            values = np.concatenate([self.objectives, objectives[met]])
            level = Level(tuple(range(values.shape[1])), (NO_GOAL,) * values.shape[1])
            front = np.flatnonzero(ranks(values, (level,)) == 0)
            _, first = np.unique(values[front], axis=0, return_index=True)
            front = front[np.sort(first)]
            kept = front[covering_order(values[front], self._reference, self._size)]
            joined = int((kept >= len(self.vectors)).sum())
            self.vectors, self.objectives = every[kept], values[kept]
        else:
            joined = 0
        grows = joined > SUCCESS * len(vectors)
        self._scale = float(np.clip(self._scale * (GROW if grows else SHRINK), MIN_SCALE, MAX_SCALE))
