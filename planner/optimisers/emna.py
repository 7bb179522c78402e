"""EMNA: the estimation of multivariate normal algorithm, an EDA that learns how all variables depend on each other.

Larrañaga and Lozano, "Estimation of Distribution Algorithms", Kluwer 2002, chapter 3 (EMNA-global): where
`planner.optimisers.umda` fits one Gaussian to each variable, this fits one to all of them, covariances included.  It
knows a box, samples and a ranking, and nothing of what they stand for.
"""

import numpy as np

from planner.optimisers.box_search import Floats
from planner.optimisers.linear_algebra import cholesky, covariance, times_lower
from planner.optimisers.umda import Umda

# Added to each variance, as a share of their mean: fewer rows than variables make a covariance singular.
COVARIANCE_RIDGE = 1e-9


class Emna(Umda):
    """Ask and tell as `planner.optimisers.umda.Umda`, with a full covariance in place of independent marginals.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = Emna(np.full(3, -2.0), np.full(3, 6.0), rank, 60, np.random.default_rng(1))
    >>> for generation in range(30):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-6)
    True

    The arguments are those of `Umda`; `basis` and `floor` are unused.
    """

    def _sample(self, count: int) -> Floats:
        """Rows from the Gaussian of most likelihood (1/N), redrawn and then clipped to the box."""
        mean = self.samples.mean(axis=0)
        # Scaled to the box, so that metres of one variable do not drown those of another.
        width = self.upper - self.lower
        rows = np.ascontiguousarray((self.samples - mean) / width)
        factor = cholesky(covariance(rows, 0, 0, mean.size), COVARIANCE_RIDGE)
        return self._redraw(
            lambda number: mean + width * times_lower(self._rng.normal(size=(number, mean.size)), factor), count
        )
