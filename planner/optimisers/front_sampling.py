"""An estimation of distribution for several objectives: a mixture, one component about each solution of the front.

Thierens and Bosman ("Multi-objective mixture-based iterated density estimation evolutionary algorithms", GECCO 2001)
spread a mixture along the front by clusters. Here every solution of the archive is the mean of a component, and a
variable depends on others in one of three ways:

- on all of them, as in the covariance of the solutions nearest to the mean among the variables, so that solutions that
  are not alike (routes past different sides of an obstacle) are not mixed;
- on those of a block: the variables are those of points in a row, a few neighbouring points lie between where the mean
  and any other solution have them, and what lies before and after them stays the mean's. A factorised distribution
  (Muehlenbein and Mahnig, Evolutionary Computation 7, 1999), whose blocks are those of differential evolution's
  exponential crossover (Storn and Price, Journal of Global Optimization 11, 1997);
- along given directions, as noise whose scale follows how often it succeeds.

The archive holds solutions that no other dominates, those first that cover most hypervolume, which is counted at new
random points in each generation (Bader and Zitzler, "HypE", Evolutionary Computation 19, 2011), so that none is kept
only for lying well to some of them.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from planner.optimisers.hypervolume import covering_order
from planner.optimisers.preference import NO_GOAL, Level, ranks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Solutions nearest to the mean that its covariance is taken of, and the share of their differences that it has.
NEIGHBOURS, REACH = 6, 0.7
# How far a block goes to the other solution's: all the way in half of the samples, and up to this share of it in the
# others; it takes half of its points' coordinates.
FURTHEST, HALF = 1.2, 0.5
# Scale of noise at first, as a share of each direction's length, its bounds, and its factors for a generation in which
# more or less than this share of the samples succeed.
FIRST_SCALE, MIN_SCALE, MAX_SCALE, GROW, SHRINK, SUCCESS = 0.1, 1e-4, 0.5, 1.15, 0.9, 0.02
# Directions that a sample's noise uses, at most; its scale is the common one times 2^low to 2^high.
USED_DIRECTIONS, LOW, HIGH = 4, -3, 2


class Kind(IntEnum):
    """How a sample departs from its mean; equally many do in each way."""

    NEAR = 0
    NOISE = 1
    BLOCK = 2
    NOISY_BLOCK = 3


class FrontSampling:
    """Ask-and-tell search for a front in a box.

    lower, upper: (d,) box.
    directions: (k, d) of the noise, each as long as its largest deviation.
    reference: (m,) objectives beyond which a solution does not count.
    axes: variables of a point; those of neighbouring points are neighbours.
    size: of the archive. population: samples of a generation.

    >>> unit = np.eye(2)
    >>> search = FrontSampling(np.zeros(2), np.ones(2), unit, np.full(2, 2.0), 1, 20, 40, np.random.default_rng(1))
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
        axes: int,
        size: int,
        population: int,
        rng: np.random.Generator,
    ) -> None:
        self._lower, self._upper, self._directions = lower, upper, directions
        self.reference, self._axes = reference, axes
        self._size, self._population, self._rng = size, population, rng
        self._scales = np.full(len(Kind), FIRST_SCALE)
        self._kinds: Ints = np.empty(0, dtype=np.int64)
        self.vectors: Floats = np.empty((0, lower.size))
        self.objectives: Floats = np.empty((0, reference.size))

    def ask(self) -> Floats:
        """Samples (population, d) of the mixture."""
        means = self._rng.integers(len(self.vectors), size=self._population)
        self._kinds = kinds = self._rng.integers(len(Kind), size=self._population)
        samples = self.vectors[means]
        near, in_block, noisy = kinds == Kind.NEAR, kinds >= Kind.BLOCK, kinds != Kind.BLOCK
        samples[near] += self._near(means[near])
        samples[in_block] += self._block(means[in_block])
        samples[noisy] += self._noise(self._scales[kinds[noisy], None])
        return np.clip(samples, self._lower, self._upper)

    def _near(self, means: Ints) -> Floats:
        """Departures (n, d) from means, with the covariance of those that are nearest to each in shares of the box."""
        number = min(NEIGHBOURS, len(self.vectors) - 1)
        out = np.zeros((len(means), self._lower.size))
        scaled = (self.vectors / (self._upper - self._lower).clip(1e-12)).T
        # Summed over the first axis: one after another, on every machine.
        away = ((scaled[:, means, None] - scaled[:, None, :]) ** 2).sum(axis=0)
        near = np.argsort(away, axis=1, kind="stable")[:, 1 : number + 1]
        weights = REACH * self._rng.standard_normal((len(means), number)) / np.sqrt(max(1, number))
        for k in range(number):
            out += weights[:, k, None] * (self.vectors[near[:, k]] - self.vectors[means])
        return out

    def _block(self, means: Ints) -> Floats:
        """Departures (n, d) from the means of a block of points, towards where another solution has them."""
        rng, count, points = self._rng, len(means), self._lower.size // self._axes
        others = rng.integers(len(self.vectors), size=count)
        lengths = rng.integers(1, points + 1, size=count)
        # Blocks may begin before the first point and end behind the last, so that all points are equally often in one.
        begins, places = rng.integers(1 - lengths, points), np.arange(points)
        within = (places >= begins[:, None]) & (places < (begins + lengths)[:, None])
        taken = rng.random((count, 1, self._axes)) < HALF
        taken |= ~taken.any(axis=2, keepdims=True)
        shares = np.where(rng.random((count, 1)) < HALF, 1.0, rng.uniform(0.0, FURTHEST, (count, 1)))
        moved = (within[:, :, None] & taken).reshape(count, -1)
        return np.asarray(shares * moved * (self.vectors[others] - self.vectors[means]))

    def _noise(self, scales: Floats) -> Floats:
        """Noise (n, d) along a few directions each, at scales (n, 1) times a factor of each sample's own."""
        rng, count, total = self._rng, len(scales), len(self._directions)
        used = min(USED_DIRECTIONS, total)
        picked = rng.integers(total, size=(count, used))
        factors = np.ldexp(rng.uniform(1.0, 2.0, (count, 1)), rng.integers(LOW, HIGH, (count, 1)))
        sizes = scales * factors * rng.standard_normal((count, used))
        sizes[:, 1:] *= rng.random((count, used - 1)) < HALF
        out = np.zeros((count, self._lower.size))
        for k in range(used):
            out += sizes[:, k, None] * self._directions[picked[:, k]]
        return out

    def tell(self, vectors: Floats, objectives: Floats, violations: Floats) -> None:
        """Take samples (n, d) with objectives (n, m) and violations (n, c), all 0 where the constraints are met."""
        met = np.flatnonzero((violations <= 0.0).all(axis=1) & (objectives < self.reference).all(axis=1))
        joined = np.zeros(len(vectors), dtype=bool)
        if met.size:
            values = np.concatenate([self.objectives, objectives[met]])
            kept = self._chosen(values)
            joined[met[kept[kept >= len(self.vectors)] - len(self.vectors)]] = True
            self.vectors, self.objectives = np.concatenate([self.vectors, vectors[met]])[kept], values[kept]
        kinds, self._kinds = self._kinds, np.empty(0, dtype=np.int64)
        for kind in np.unique(kinds):
            grows = joined[kinds == kind].mean() > SUCCESS
            self._scales[kind] = np.clip(self._scales[kind] * (GROW if grows else SHRINK), MIN_SCALE, MAX_SCALE)

    def _chosen(self, values: Floats) -> Ints:
        """Rows of objectives (n, m) for the archive: what none dominates, each once, those that cover most."""
        level = Level(tuple(range(values.shape[1])), (NO_GOAL,) * values.shape[1])
        front = np.flatnonzero(ranks(values, (level,)) == 0)
        _, first = np.unique(values[front], axis=0, return_index=True)
        front = front[np.sort(first)]
        if len(front) <= self._size:
            return front
        return np.asarray(front[covering_order(values[front], self.reference, self._size, self._rng)])
