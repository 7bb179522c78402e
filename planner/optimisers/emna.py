"""EMNA: the estimation of multivariate normal algorithm, an EDA that learns how all variables depend on each other.

Larrañaga and Lozano 2002, chapter 3 (EMNA-global): where `planner.optimisers.umda` fits one Gaussian to each variable,
this fits one to all of them, covariances included.  It knows a box, samples and a ranking, and nothing of what they
stand for.
"""

import numpy as np
from numba import njit

from planner.optimisers.umda import Floats, Umda

# Added to each variance, as a share of their mean: fewer rows than variables make a covariance singular.
RIDGE = 1e-9


class Emna(Umda):
    """One run: as `Umda`, with a full covariance in place of independent marginals; `basis` and `floor` are unused."""

    def _sample(self, count: int) -> Floats:
        """Rows from the Gaussian of most likelihood (1/N), redrawn and then clipped to the box."""
        mean = self.samples.mean(axis=0)
        # Scaled to the box, so that metres of one variable do not drown those of another.
        width = self.upper - self.lower
        factor = _factor(np.ascontiguousarray((self.samples - mean) / width), RIDGE)
        return self._redraw(
            lambda rows: mean + width * _lower_product(self._rng.normal(size=(rows, mean.size)), factor), count
        )


@njit(cache=True)
def _factor(rows: Floats, ridge: float) -> Floats:  # pragma: no cover - compiled
    """Cholesky factor (d, d) of the covariance of centred rows (n, d), ridge x mean variance on its diagonal."""
    # By hand: LAPACK rounds as the machine has it, and the result must not depend on the machine.
    count, size = rows.shape
    out = np.zeros((size, size))
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for n in range(count):
                total += rows[n, i] * rows[n, j]
            out[i, j] = total / count
    trace = 0.0
    for i in range(size):
        trace += out[i, i]
    extra = ridge * trace / size + 1e-300
    for j in range(size):
        pivot = out[j, j] + extra
        for k in range(j):
            pivot -= out[j, k] * out[j, k]
        out[j, j] = np.sqrt(max(pivot, extra))
        for i in range(j + 1, size):
            total = out[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            out[i, j] = total / out[j, j]
    return out


@njit(cache=True)
def _lower_product(rows: Floats, factor: Floats) -> Floats:  # pragma: no cover - compiled
    """Rows (n, d) of independent numbers times the transpose of a lower triangle (d, d)."""
    out = np.zeros(rows.shape)
    for n in range(rows.shape[0]):
        for i in range(factor.shape[0]):
            for k in range(i + 1):
                out[n, i] += factor[i, k] * rows[n, k]
    return out
