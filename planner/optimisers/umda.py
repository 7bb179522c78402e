"""UMDAc: univariate marginal distribution algorithm for continuous variables.

It has an ask-and-tell interface.

Larrañaga and Lozano, "Estimation of Distribution Algorithms", Kluwer 2002; section IV of Yang, Tang and Lozano, CEC
2014.
"""

from collections.abc import Callable

import numpy as np

from planner.optimisers.box_search import BoxSearch
from planner.optimisers.linear_algebra import multiply_by_sparse
from world.arrays import Floats, Ints

# Maximum number of redraws of a sample outside the box before it is clipped.
MAX_REDRAWS = 10


class Umda(BoxSearch):
    """UMDA: keep the better half of a population, and replace the other half by samples of its marginals.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = Umda(np.full(3, -2.0), np.full(3, 6.0), rank, 40, np.random.default_rng(1))
    >>> for generation in range(60):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-6)
    True

    The other arguments are the same as for `BoxSearch`.

    basis: (d, d) orthogonal matrix whose columns are the directions along which marginals are independent; None for the
    variables themselves.
    floor: (d,) minimum standard deviation along each direction, or None.

    samples and scores are the selected half, (n, d) and (n, c), best first; empty before the first `tell`.
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
        basis: Floats | None = None,
        floor: Floats | None = None,
    ) -> None:
        """Clip the first samples to the box, or draw them uniformly.

        lower, upper: (d,) box.
        rank: function of scores (n, c) that returns their ranks (n,); smaller is better.
        population: even number of samples.
        rng: generator of random numbers.
        initial: (population, d) first samples; None for uniform ones.
        basis: (d, d) directions along which marginals are independent, as columns; None for the variables themselves.
        floor: (d,) minimum standard deviation along each direction, or None.
        """
        super().__init__(lower, upper, rank, population, rng, initial=initial)
        self._basis = basis
        self._floor = floor

    def tell(self, scores: Floats) -> None:
        """Select the better half of all samples by the scores (n, c) of the last `ask`; draw new samples."""
        samples = np.concatenate([self.samples, self._pending_samples])
        all_scores = np.concatenate([self.scores, scores]) if len(self.scores) else scores
        # Ties are broken by a seeded draw, not by age.
        order = np.lexsort((self._rng.random(len(all_scores)), self._rank(all_scores)))[: self._half]
        self.samples, self.scores = samples[order], all_scores[order]
        self._pending_samples = self._sample(len(samples) - self._half)

    def _sample(self, count: int) -> Floats:
        """Draw samples (count, d) from independent Gaussians that are fitted to the selected samples.

        A Gaussian has the mean and the standard deviation (1/N, not less than the floor) of the selected samples along
        its direction. Values outside the box are redrawn, and finally clipped.
        """
        selected = self.samples if self._basis is None else _project(self.samples, self._basis)
        mean, deviation = selected.mean(axis=0), selected.std(axis=0)
        if self._floor is not None:
            deviation = np.maximum(deviation, self._floor)
        if self._basis is None:
            return self._redraw_each(mean + deviation * self._rng.standard_normal((count, mean.size)), mean, deviation)
        inverse_basis = np.ascontiguousarray(self._basis.T)
        return self._redraw(
            lambda rows: _project(mean + deviation * self._rng.standard_normal((rows, mean.size)), inverse_basis), count
        )

    def _redraw(self, draw: Callable[[int], Floats], count: int) -> Floats:
        """Draw `count` samples, and redraw those outside the box; clip those that stay outside.

        draw: function that draws the given number of samples (n, d).
        """
        samples = draw(count)
        outside_rows = np.flatnonzero(((samples < self.lower) | (samples > self.upper)).any(axis=1))
        for _ in range(MAX_REDRAWS):
            if outside_rows.size == 0:
                return samples
            redrawn_samples = draw(outside_rows.size)
            samples[outside_rows] = redrawn_samples
            outside_rows = outside_rows[((redrawn_samples < self.lower) | (redrawn_samples > self.upper)).any(axis=1)]
        return np.clip(samples, self.lower, self.upper)

    def _redraw_each(self, samples: Floats, mean: Floats, deviation: Floats) -> Floats:
        """Redraw the single values of samples (n, d) outside the box, and clip those that stay outside.

        samples: (n, d), changed in place.

        mean, deviation: (d,) parameters of the Gaussians.
        """
        rows, columns = np.nonzero((samples < self.lower) | (samples > self.upper))
        for _ in range(MAX_REDRAWS):
            if rows.size == 0:
                return samples
            redrawn_values = mean[columns] + deviation[columns] * self._rng.standard_normal(columns.size)
            samples[rows, columns] = redrawn_values
            is_outside = (redrawn_values < self.lower[columns]) | (redrawn_values > self.upper[columns])
            rows, columns = rows[is_outside], columns[is_outside]
        return np.clip(samples, self.lower, self.upper)


def _project(rows: Floats, basis: Floats) -> Floats:
    """Return the coordinates (n, k) of rows (n, d) along the columns of a basis (d, k).

    Both arrays are made contiguous for the compiled product.
    """
    return multiply_by_sparse(np.ascontiguousarray(rows), np.ascontiguousarray(basis))
