"""Differential evolution, DE/rand/1/bin, with the ask-and-tell interface of `BoxSearch`.

Storn and Price, "Differential Evolution", Journal of Global Optimization 11, 1997.
"""

import numpy as np

from planner.optimisers.box_search import BoxSearch
from world.arrays import Floats, Ints

# Differential weight F, within the range that Storn and Price recommend.
DIFFERENTIAL_WEIGHT = 0.5
# Crossover rate CR, within the range that Storn and Price recommend.
CROSSOVER_RATE = 0.9


class DifferentialEvolution(BoxSearch):
    """Differential evolution: a trial vector replaces its target vector if it ranks no worse.

    The arguments are the same as for `BoxSearch`. Trial vectors are made for half of the population at a time, so that
    a generation costs as much as with the estimation of distribution algorithms. samples and scores are the population,
    (n, d) and (n, c); empty before the first `tell`.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = DifferentialEvolution(np.full(3, -2.0), np.full(3, 6.0), rank, 20, np.random.default_rng(1))
    >>> for generation in range(120):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-3)
    True
    """

    _generation = 0

    def tell(self, scores: Floats) -> None:
        """Replace target vectors that do not rank better than their trial vectors, and make new trial vectors.

        scores: (n, c) scores of the last trial vectors. The first scores belong to the first population, which replaces
            nothing.
        """
        if not len(self.scores):
            self.samples, self.scores = self._pending_samples.copy(), np.array(scores)
        else:
            rows = self._target_rows()
            ranks = self._rank(np.concatenate([self.scores, scores]))
            is_better = ranks[len(self.samples) :] <= ranks[rows]
            self.samples[rows[is_better]] = self._pending_samples[is_better]
            self.scores[rows[is_better]] = scores[is_better]
            self._generation += 1
        # A trial vector is a + F (b - c) in most variables, the row's own value in the others.
        rows = self._target_rows()
        count, size = self.samples.shape
        parent_rows = self._rng.integers(0, count, (3, rows.size))
        a, b, c = (self.samples[index] for index in parent_rows)
        mutants = a + DIFFERENTIAL_WEIGHT * (b - c)
        is_crossed = self._rng.random((rows.size, size)) < CROSSOVER_RATE
        is_crossed[np.arange(rows.size), self._rng.integers(0, size, rows.size)] = True
        trials = np.where(is_crossed, mutants, self.samples[rows])
        # A variable outside the box is set halfway between the target and the bound: clipping would accumulate samples
        # on it.
        targets = self.samples[rows]
        trials = np.where(trials < self.lower, 0.5 * (targets + self.lower), trials)
        self._pending_samples = np.where(trials > self.upper, 0.5 * (targets + self.upper), trials)

    def _target_rows(self) -> Ints:
        """Return the rows of the samples that the next trial vectors may replace.

        The first half and the second half of the population take turns.
        """
        count = len(self.samples)
        return np.arange(self._half) if self._generation % 2 == 0 else np.arange(count - self._half, count)
