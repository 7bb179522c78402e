"""Estimation of distribution for several objectives.

The distribution is a mixture with one component around each solution of the front.

Thierens and Bosman ("Multi-objective mixture-based iterated density estimation evolutionary algorithms", GECCO 2001)
spread a mixture along the front by clusters. Here every solution of the archive is the mean of a component, and a
sample departs from its mean in one of three ways:

- in all variables, with the covariance of the solutions nearest to the mean in the space of the variables, so that
  unlike solutions (routes past different sides of an obstacle) are not mixed;
- in a block of variables: the variables belong to points in a row; a few neighbouring points move towards their
  positions in another solution, and the points before and after them stay at the mean. This is a factorised
  distribution (Muehlenbein and Mahnig, Evolutionary Computation 7, 1999), with the blocks of the exponential crossover
  of differential evolution (Storn and Price, Journal of Global Optimization 11, 1997);
- along given directions, as noise whose scale adapts to its rate of success.

The archive contains non-dominated solutions, ordered by the hypervolume that they cover. The hypervolume is estimated
at new random points in each generation (Bader and Zitzler, "HypE", Evolutionary Computation 19, 2011), so that no
solution is kept only because it covers one particular set of points well.
"""

from enum import IntEnum

import numpy as np

from planner.optimisers.hypervolume import covering_order
from planner.optimisers.preference import NO_GOAL, Level, ranks
from world.arrays import Floats, Ints

# Number of solutions nearest to a mean that give its covariance.
NEIGHBOUR_COUNT = 6
# Factor on their differences from the mean.
DIFFERENCE_FACTOR = 0.7
# Largest step of a block, as a fraction of the difference to the other solution.
MAX_BLOCK_STEP = 1.2
# Fraction of the samples that take the whole step, and of the coordinates of a block's points that move.
EVEN_CHANCE = 0.5
# Initial scale of the noise, as a fraction of each direction's length.
FIRST_SCALE = 0.1
# Smallest scale of the noise.
MIN_SCALE = 1e-4
# Largest scale of the noise.
MAX_SCALE = 0.5
# Factor on the scale after a generation with more successes than `TARGET_SUCCESS`.
GROWTH_FACTOR = 1.15
# Factor on the scale after a generation with fewer successes.
SHRINK_FACTOR = 0.9
# Fraction of successful samples above which the scale grows.
TARGET_SUCCESS = 0.02
# Maximum number of directions in the noise of a sample.
MAX_DIRECTIONS = 4
# Exponent of 2 in the smallest factor of a sample on the common scale.
MIN_EXPONENT = -3
# Exponent of 2 in the largest factor of a sample on the common scale.
MAX_EXPONENT = 2


class Displacement(IntEnum):
    """Kinds of displacement of a new sample from its mean, a solution of the archive.

    Each kind is equally frequent.

    NEAR: along the differences to the solutions nearest to the mean, with noise. NOISE: only noise. BLOCK: a block of
    neighbouring points moves towards its place in another solution. NOISY_BLOCK: such a block, with noise.
    """

    NEAR = 0
    NOISE = 1
    BLOCK = 2
    NOISY_BLOCK = 3


class FrontSampling:
    """Ask-and-tell search for a Pareto front in a box.

    lower, upper: (d,) box.
    directions: (k, d) directions of the noise; the length of each is a step of scale 1.
    reference: (m,) upper limits of the objectives; a solution that reaches one of them is ignored.
    axes: number of variables per point; the variables of neighbouring points are adjacent.
    size: largest number of solutions in the archive, which holds the front.
    population: number of samples per generation.

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
        """Start with an empty archive.

        lower, upper: (d,) box.
        directions: (k, d) directions of the noise; the length of each is a step of scale 1.
        reference: (m,) upper limits of the objectives; a solution that reaches one of them is ignored.
        axes: number of variables per point.
        size: largest number of solutions in the archive.
        population: number of samples per generation.
        rng: generator of random numbers.
        """
        self._lower, self._upper, self._directions = lower, upper, directions
        self.reference, self._axes = reference, axes
        self._size, self._population, self._rng = size, population, rng
        self._scales = np.full(len(Displacement), FIRST_SCALE)
        self._kinds: Ints = np.empty(0, dtype=np.int64)
        self.vectors: Floats = np.empty((0, lower.size))
        self.objectives: Floats = np.empty((0, reference.size))

    def ask(self) -> Floats:
        """Draw samples (population, d): random solutions of the archive, displaced at random (`Displacement`).

        The samples are clipped to the box.
        """
        mean_rows = self._rng.integers(len(self.vectors), size=self._population)
        self._kinds = kinds = self._rng.integers(len(Displacement), size=self._population)
        samples = self.vectors[mean_rows]
        is_near, is_in_block, is_noisy = (
            kinds == Displacement.NEAR,
            kinds >= Displacement.BLOCK,
            kinds != Displacement.BLOCK,
        )
        rng = self._rng
        # Displacements from a Gaussian fitted to the solutions nearest to each mean; distances are relative to the size
        # of the box.
        near_mean_rows, neighbour_count = mean_rows[is_near], min(NEIGHBOUR_COUNT, len(self.vectors) - 1)
        scaled_vectors = (self.vectors / (self._upper - self._lower).clip(1e-12)).T
        # Summed over the first axis: in sequence, with the same rounding on every machine.
        distances2 = ((scaled_vectors[:, near_mean_rows, None] - scaled_vectors[:, None, :]) ** 2).sum(axis=0)
        nearest_rows = np.argsort(distances2, axis=1, kind="stable")[:, 1 : neighbour_count + 1]
        weights = rng.standard_normal((len(near_mean_rows), neighbour_count))
        weights = DIFFERENCE_FACTOR * weights / np.sqrt(max(1, neighbour_count))
        displacements = np.zeros((len(near_mean_rows), self._lower.size))
        for k in range(neighbour_count):
            displacements += weights[:, k, None] * (self.vectors[nearest_rows[:, k]] - self.vectors[near_mean_rows])
        samples[is_near] += displacements
        # Each block of neighbouring points moves towards another solution. Blocks may begin before the first point and
        # end after the last, so that each point is equally often in one.
        rows, point_count = mean_rows[is_in_block], self._lower.size // self._axes
        count, point_indices = len(rows), np.arange(point_count)
        other_rows = rng.integers(len(self.vectors), size=count)
        block_lengths = rng.integers(1, point_count + 1, size=count)
        block_starts = rng.integers(1 - block_lengths, point_count)[:, None]
        is_moving_point = (point_indices >= block_starts) & (point_indices < block_starts + block_lengths[:, None])
        is_moving_coordinate = rng.random((count, 1, self._axes)) < EVEN_CHANCE
        is_moving_coordinate |= ~is_moving_coordinate.any(axis=2, keepdims=True)
        fractions = np.where(rng.random((count, 1)) < EVEN_CHANCE, 1.0, rng.uniform(0.0, MAX_BLOCK_STEP, (count, 1)))
        is_moving_variable = (is_moving_point[:, :, None] & is_moving_coordinate).reshape(count, -1)
        samples[is_in_block] += fractions * is_moving_variable * (self.vectors[other_rows] - self.vectors[rows])
        # Noise along a few of the given directions for each sample, with the scale of its kind times a random factor.
        count, direction_count = int(np.count_nonzero(is_noisy)), len(self._directions)
        directions_per_sample = min(MAX_DIRECTIONS, direction_count)
        picked_directions = rng.integers(direction_count, size=(count, directions_per_sample))
        factors = np.ldexp(rng.uniform(1.0, 2.0, (count, 1)), rng.integers(MIN_EXPONENT, MAX_EXPONENT, (count, 1)))
        scales = self._scales[kinds[is_noisy], None]
        step_lengths = scales * factors * rng.standard_normal((count, directions_per_sample))
        step_lengths[:, 1:] *= rng.random((count, directions_per_sample - 1)) < EVEN_CHANCE
        noise = np.zeros((count, self._lower.size))
        for k in range(directions_per_sample):
            noise += step_lengths[:, k, None] * self._directions[picked_directions[:, k]]
        samples[is_noisy] += noise
        return np.clip(samples, self._lower, self._upper)

    def tell(self, vectors: Floats, objectives: Floats, violations: Floats) -> None:
        """Insert the best samples into the archive, and adapt the scale of the noise.

        vectors: (n, d) samples.
        objectives: (n, m) their objectives, all minimised.
        violations: (n, c), all 0 for a sample that meets the constraints. Other samples never enter the archive.

        Each kind of displacement has its own scale, which grows if enough of the samples of this kind enter the
        archive, and shrinks otherwise.
        """
        feasible_rows = np.flatnonzero((violations <= 0.0).all(axis=1) & (objectives < self.reference).all(axis=1))
        is_in_archive = np.zeros(len(vectors), dtype=bool)
        if feasible_rows.size:
            values = np.concatenate([self.objectives, objectives[feasible_rows]])
            # Keep the distinct, non-dominated rows; of more than the archive can hold, those that cover most of the
            # hypervolume.
            level = Level(tuple(range(values.shape[1])), (NO_GOAL,) * values.shape[1])
            front = np.flatnonzero(ranks(values, (level,)) == 0)
            _, first_rows = np.unique(values[front], axis=0, return_index=True)
            front = front[np.sort(first_rows)]
            if len(front) <= self._size:
                archive_rows = front
            else:
                archive_rows = np.asarray(front[covering_order(values[front], self.reference, self._size, self._rng)])
            is_in_archive[feasible_rows[archive_rows[archive_rows >= len(self.vectors)] - len(self.vectors)]] = True
            self.vectors = np.concatenate([self.vectors, vectors[feasible_rows]])[archive_rows]
            self.objectives = values[archive_rows]
        kinds, self._kinds = self._kinds, np.empty(0, dtype=np.int64)
        for kind in np.unique(kinds):
            should_grow = is_in_archive[kinds == kind].mean() > TARGET_SUCCESS
            self._scales[kind] = np.clip(
                self._scales[kind] * (GROWTH_FACTOR if should_grow else SHRINK_FACTOR), MIN_SCALE, MAX_SCALE
            )
