"""EMNA: estimation of multivariate normal algorithm, with a full covariance of all variables.

Larrañaga and Lozano, "Estimation of Distribution Algorithms", Kluwer 2002, chapter 3 (EMNA-global).
`planner.optimisers.umda` fits an independent Gaussian to each variable; this algorithm fits one multivariate Gaussian.
"""

import numpy as np

from planner.optimisers.linear_algebra import cholesky, covariance, multiply_by_lower
from planner.optimisers.umda import Umda
from world.arrays import Floats

# Regularisation added to each variance, as a fraction of their mean: with fewer samples than variables the covariance
# is singular.
COVARIANCE_RIDGE = 1e-9


class Emna(Umda):
    """UMDA with one multivariate Gaussian instead of independent Gaussians.

    The arguments are the same as for `planner.optimisers.umda.Umda`; `basis` and `floor` are unused.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = Emna(np.full(3, -2.0), np.full(3, 6.0), rank, 60, np.random.default_rng(1))
    >>> for generation in range(30):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-6)
    True
    """

    def _sample(self, count: int) -> Floats:
        """Draw samples (count, d) from the Gaussian that is fitted to the selected samples.

        The fit is by maximum likelihood (divisor N).
        Samples outside the box are drawn again, and finally clipped to the box.
        """
        mean = self.samples.mean(axis=0)
        # Scaled to the box, so that the regularisation suits variables of different units.
        width = self.upper - self.lower
        rows = np.ascontiguousarray((self.samples - mean) / width)
        factor = cholesky(covariance(rows, 0, 0, mean.size), COVARIANCE_RIDGE)
        return self._redraw(
            lambda sample_count: (
                mean + width * multiply_by_lower(self._rng.normal(size=(sample_count, mean.size)), factor)
            ),
            count,
        )
