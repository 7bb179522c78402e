"""Estimation of distribution that redraws only a part of the variables of each sample.

A sample whose variables are all redrawn loses the good values of its parent, also in variables that do not influence
the others. Here every sample keeps a part of its variables. The others are drawn around one of the best samples, at a
distance that has the covariance of the population; a sample replaces its parent only if it is better. In half of the
samples the redrawn variables are neighbours, because the variables of neighbouring waypoints often have to change
together.

The fraction of redrawn variables and the width of the distribution follow those of successful samples, as the
parameters of adaptive differential evolution do (Zhang and Sanderson, "JADE: adaptive differential evolution with
optional external archive", IEEE Transactions on Evolutionary Computation 13, 2009). The difference of two samples takes
the place of a Gaussian draw, as in differential evolution (Storn and Price, Journal of Global Optimization 11, 1997).

When a population no longer improves, a Gaussian with full covariance (`planner.optimisers.multistart.Gaussian`) refines
its best sample, also along a curved valley. Then the search starts again with twice the population (after Auger and
Hansen, "A restart CMA evolution strategy with increasing population size", CEC 2005). Only ranks are used.
"""

import math
from collections.abc import Callable

import numpy as np

from planner.optimisers.box_search import BoxSearch
from planner.optimisers.multistart import Gaussian, reflect_into_box
from world.arrays import Floats, Ints

# Number of samples of the first population, per variable.
FIRST_POPULATION_PER_VARIABLE = 2
# Minimum number of samples of the first population.
MIN_POPULATION = 60
# Fraction of the population around which samples are drawn.
CENTRE_FRACTION = 0.2
# Fraction of redrawn variables at the start.
FIRST_REDRAWN_FRACTION = 0.5
# Standard deviation of the redrawn fraction among samples.
REDRAWN_FRACTION_DEVIATION = 0.1
# Minimum redrawn fraction.
MIN_REDRAWN_FRACTION = 0.02
# Fraction of samples whose redrawn variables are neighbours; those of the others are drawn one by one.
NEIGHBOURS_FRACTION = 0.5
# Width of the distribution at the start, as a factor on the population's deviations.
FIRST_WIDTH = 0.3
# Standard deviation of the logarithm of the width among samples.
LOG_WIDTH_DEVIATION = 0.3
# Fraction of samples whose width differs by up to a factor of e to the power of `WILD_LOG_WIDTH`.
WILD_FRACTION = 0.3
# Largest additional logarithm of the width of such a sample.
WILD_LOG_WIDTH = 1.5
# Rate at which both parameters follow those of successful samples.
LEARNING_RATE = 0.2
# Number of generations without a better sample after which the best sample is refined.
MAX_STALLED_GENERATIONS = 10
# Standard deviation of the refining Gaussian at its start, as a fraction of the box.
REFINING_DEVIATION = 0.02
# Factor on the population at a new start.
POPULATION_GROWTH = 2


class PartialResampling(BoxSearch):
    """Search that redraws part of the variables of each sample, and keeps the new sample if it is better.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = PartialResampling(np.full(3, -2.0), np.full(3, 6.0), rank, 40, np.random.default_rng(1))
    >>> for generation in range(60):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-4)
    True

    The arguments are the same as for `BoxSearch`; population is the largest population, reached after some starts.
    First samples, if given, are the first population.

    samples and scores are the best sample of all and the current population, (n, d) and (n, c), best first; empty
    before the first `tell`.
    """

    def __init__(
        self,
        lower: Floats,
        upper: Floats,
        rank: Callable[[Floats], Ints],
        population: int,
        rng: np.random.Generator,
        *,
        initial: Floats | None = None,
    ) -> None:
        """Start with a small population of samples.

        lower, upper: (d,) box.
        rank: function of scores (n, c) that returns their ranks (n,); smaller is better.
        population: size of the largest population.
        rng: generator of random numbers.
        initial: (n, d) first population; None for uniform samples.
        """
        super().__init__(lower, upper, rank, population, rng, initial=initial)
        self._max_count = population
        self._count = min(population, max(MIN_POPULATION, FIRST_POPULATION_PER_VARIABLE * lower.size))
        self._best: tuple[Floats, Floats] | None = None
        self._gaussian: Gaussian | None = None
        self._start()
        if initial is None:
            self._pending_samples = self._pending_samples[: self._count]

    def _start(self) -> None:
        """Discard the population, and reset the adapted parameters to their first values."""
        self._points: Floats = np.empty((0, self.lower.size))
        self._point_scores: Floats = np.empty((0, 0))
        self._redrawn_fraction, self._width = FIRST_REDRAWN_FRACTION, FIRST_WIDTH
        self._stalled_generations = 0

    def tell(self, scores: Floats) -> None:
        """Process the scores (n, c) of the last samples of `ask`, and draw the next samples.

        A sample of a population replaces its parent if it is better. Once the population no longer improves, a Gaussian
        around its best sample draws the samples, until it has converged and a larger population begins.
        """
        if self._gaussian is not None:
            points = (self._pending_samples - self.lower) / (self.upper - self.lower)
            self._gaussian.update(points, scores, self._rank, self._rng.random(len(scores)))
            self._store(*self._sort(self._pending_samples, scores))
            if not self._gaussian.is_done:
                self._draw_from_gaussian(self._gaussian)
                return
            # The Gaussian has converged: start again.
            self._gaussian = None
            self._start()
            self._count = min(self._max_count, POPULATION_GROWTH * self._count)
            self._pending_samples = self._rng.uniform(self.lower, self.upper, (self._count, self.lower.size))
            return
        if not len(self._points):
            self._points, self._point_scores = self._pending_samples.copy(), scores.copy()
        else:
            # Replace each parent whose sample ranks higher; move the redrawn fraction and the width towards the values
            # with which the better samples were drawn. Generations in which no sample ranks higher than the best parent
            # are counted.
            count = len(self._points)
            ranks = self._rank(np.concatenate([self._point_scores, scores]))
            gains = ranks[:count] - ranks[count:]
            is_better = gains > 0
            # The population is sorted, so that the best parent is the first.
            self._stalled_generations = 0 if ranks[count:].min() < ranks[0] else self._stalled_generations + 1
            if is_better.any():
                weights = gains[is_better] / gains[is_better].sum()
                fractions = self._fractions[is_better]
                weighted_fraction = float((weights * fractions**2).sum() / (weights * fractions).sum())
                self._redrawn_fraction += LEARNING_RATE * (weighted_fraction - self._redrawn_fraction)
                log_ratio = float((weights * np.log(self._widths[is_better] / self._width)).sum())
                self._width *= math.exp(LEARNING_RATE * log_ratio)
            self._points[is_better], self._point_scores[is_better] = self._pending_samples[is_better], scores[is_better]
        self._points, self._point_scores = self._sort(self._points, self._point_scores)
        self._store(self._points, self._point_scores)
        if self._stalled_generations > MAX_STALLED_GENERATIONS:
            best_point = (self._points[0] - self.lower) / (self.upper - self.lower)
            generation_size = 4 + int(3.0 * math.log(self.lower.size))
            self._gaussian = Gaussian(best_point, REFINING_DEVIATION, generation_size)
            self._draw_from_gaussian(self._gaussian)
        else:
            self._draw()

    def _sort(self, points: Floats, scores: Floats) -> tuple[Floats, Floats]:
        """Return points (n, d) and their scores (n, c), best first; ties are in random order."""
        order = np.lexsort((self._rng.random(len(points)), self._rank(scores)))
        return points[order], scores[order]

    def _draw_from_gaussian(self, gaussian: Gaussian) -> None:
        """Draw the next samples from the refining Gaussian, scaled and clipped to the box."""
        samples = self.lower + gaussian.draw(self._rng) * (self.upper - self.lower)
        self._pending_samples = np.clip(samples, self.lower, self.upper)

    def _store(self, points: Floats, scores: Floats) -> None:
        """Set `samples` and `scores` to the best sample of all starts, followed by a generation.

        points, scores: (n, d) and (n, c), the generation, best first.
        """
        if self._best is None or self._rank(np.stack([self._best[1], scores[0]]))[1] == 0:
            self._best = points[0].copy(), scores[0].copy()
        self.samples = np.concatenate([self._best[0][None], points])
        self.scores = np.concatenate([self._best[1][None], scores])

    def _draw(self) -> None:
        """Draw a new sample for each member of the sorted population.

        The sample keeps a part of the variables of its member. The others are redrawn around one of the best members,
        displaced by the difference of two random members times a width.
        """
        count = len(self._points)
        points = (self._points - self.lower) / (self.upper - self.lower)
        self._fractions = np.clip(
            self._redrawn_fraction + REDRAWN_FRACTION_DEVIATION * self._rng.standard_normal(count),
            MIN_REDRAWN_FRACTION,
            1.0,
        )
        is_wild = self._rng.random(count) < WILD_FRACTION
        self._widths = self._width * np.exp(
            LOG_WIDTH_DEVIATION * self._rng.standard_normal(count)
            + is_wild * self._rng.uniform(-WILD_LOG_WIDTH, WILD_LOG_WIDTH, count)
        )
        centres = points[self._rng.integers(0, max(2, round(CENTRE_FRACTION * count)), count)]
        # The difference of two members has twice the covariance of the population.
        first_members, second_members = self._rng.integers(0, count, (2, count))
        steps = (points[first_members] - points[second_members]) / math.sqrt(2.0)
        drawn = reflect_into_box(centres + self._widths[:, None] * steps)
        # Some variables of each sample are redrawn, at least one: single ones, or neighbours on the ring of all
        # variables.
        size = self.lower.size
        is_redrawn = self._rng.random((count, size)) < self._fractions[:, None]
        first_variables = self._rng.integers(0, size, count)
        is_redrawn[np.arange(count), first_variables] = True
        neighbour_counts = np.maximum(1, np.round(self._fractions * size))
        is_neighbour = (np.arange(size) - first_variables[:, None]) % size < neighbour_counts[:, None]
        redraws_neighbours = self._rng.random(count) < NEIGHBOURS_FRACTION
        samples = self.lower + np.where(
            np.where(redraws_neighbours[:, None], is_neighbour, is_redrawn), drawn, points
        ) * (self.upper - self.lower)
        self._pending_samples = np.clip(samples, self.lower, self.upper)
