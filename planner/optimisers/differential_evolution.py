"""Differential evolution, DE/rand/1/bin: a classical evolutionary algorithm in the same ask and tell.

Storn and Price, "Differential Evolution", Journal of Global Optimization 11, 1997.  It knows a box, samples and a
ranking, and nothing of what they stand for.
"""

import numpy as np

from planner.optimisers.box_search import BoxSearch, Floats, Ints

# Weight of a difference and rate of crossover: the middle of what Storn and Price advise.
WEIGHT, CROSSOVER = 0.5, 0.9


class DifferentialEvolution(BoxSearch):
    """Each row is challenged by a mix of others and gives way to one that ranks no worse, in ask and tell.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = DifferentialEvolution(np.full(3, -2.0), np.full(3, 6.0), rank, 20, np.random.default_rng(1))
    >>> for generation in range(120):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-3)
    True

    The arguments are those of `BoxSearch`.  Half the rows are challenged at a time, so that a generation costs what it
    costs the estimation of distribution algorithms.  samples and scores are the population, (n, d) and (n, c); without
    rows before the first `tell`.
    """

    _turn = 0

    def tell(self, scores: Floats) -> None:
        """Take the scores (n, c) of what was asked, let the better of each pair live, and mix the next challengers."""
        if not len(self.scores):
            self.samples, self.scores = self._asked.copy(), np.array(scores)
        else:
            rows = self._challenged()
            order = self._rank(np.concatenate([self.scores, scores]))
            better = order[len(self.samples) :] <= order[rows]
            self.samples[rows[better]] = self._asked[better]
            self.scores[rows[better]] = scores[better]
            self._turn += 1
        self._asked = self._mix(self._challenged())

    def _challenged(self) -> Ints:
        """Rows whose turn it is: each half of the population by turns."""
        count = len(self.samples)
        return np.arange(self._half) if self._turn % 2 == 0 else np.arange(count - self._half, count)

    def _mix(self, rows: Ints) -> Floats:
        """Challengers of some rows: a + F (b - c) in most variables, the row's own in the others."""
        count, size = self.samples.shape
        picked = self._rng.integers(0, count, (3, rows.size))
        a, b, c = (self.samples[index] for index in picked)
        mixed = a + WEIGHT * (b - c)
        crossed = self._rng.random((rows.size, size)) < CROSSOVER
        crossed[np.arange(rows.size), self._rng.integers(0, size, rows.size)] = True
        out = np.where(crossed, mixed, self.samples[rows])
        # Half way back to the wall, as is usual: what is cut at it gathers there.
        parent = self.samples[rows]
        out = np.where(out < self.lower, 0.5 * (parent + self.lower), out)
        return np.where(out > self.upper, 0.5 * (parent + self.upper), out)
