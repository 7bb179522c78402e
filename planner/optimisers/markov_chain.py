"""Estimation of distribution algorithm with a Markov chain.

Each group of variables depends on the previous group.

The dependence is linear with Gaussian residuals. A waypoint passes an obstacle on the same side as the waypoint before
it. Independent marginals lose this dependence; a chain keeps it with far fewer parameters than a full covariance, so
that a small population suffices to estimate it.
"""

import numpy as np

from planner.optimisers.linear_algebra import cholesky, covariance
from planner.optimisers.umda import Umda
from world.arrays import Floats
from world.kernels import compiled, copy_into

# Regularisation added to each variance of a group, as a fraction of their mean.
VARIANCE_RIDGE = 1e-6


class MarkovChain(Umda):
    """UMDA with a Markov chain over groups of variables instead of independent Gaussians.

    The arguments are the same as for `planner.optimisers.umda.Umda`; `basis` and `floor` are unused. The number of
    variables is a multiple of `GROUP`; each group of consecutive variables depends on the previous group only.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = MarkovChain(np.full(6, -2.0), np.full(6, 6.0), rank, 400, np.random.default_rng(1))
    >>> for generation in range(30):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-4)
    True
    """

    GROUP = 3

    def _sample(self, count: int) -> Floats:
        """Draw samples group by group, each group conditional on the previous group.

        Samples outside the box are drawn again.
        """
        mean = self.samples.mean(axis=0)
        width = self.upper - self.lower
        regressions, residual_factors = fit_chain(
            np.ascontiguousarray((self.samples - mean) / width), self.GROUP, VARIANCE_RIDGE
        )
        return self._redraw(
            lambda sample_count: (
                mean
                + width * draw_chain(self._rng.normal(size=(sample_count, mean.size)), regressions, residual_factors)
            ),
            count,
        )


@compiled
def fit_chain(rows: Floats, size: int, ridge: float) -> tuple[Floats, Floats]:
    """Fit a linear regression of each group of variables on the previous group.

    rows: (n, d) samples minus their mean.
    size: number of variables of a group.
    ridge: value added to each variance, as a fraction of the mean variance of the group.

    Returns two arrays (g, size, size), with a matrix for each of the g groups: the coefficients of the regression
    (zeros for the first group), and the Cholesky factor of the residuals' covariance.
    """
    group_count = rows.shape[1] // size
    regressions, residual_factors = np.zeros((group_count, size, size)), np.zeros((group_count, size, size))
    copy_into(residual_factors[0].ravel(), cholesky(covariance(rows, 0, 0, size), ridge).ravel())
    for g in range(1, group_count):
        previous_column, column = (g - 1) * size, g * size
        factor = cholesky(covariance(rows, previous_column, previous_column, size), ridge)
        cross = covariance(rows, column, previous_column, size)
        # regressions = cross (L L^T)^-1, by forward and back substitution for each row.
        for i in range(size):
            for j in range(size):
                for k in range(j):
                    cross[i, j] -= factor[j, k] * cross[i, k]
                cross[i, j] /= factor[j, j]
            for j in range(size - 1, -1, -1):
                for k in range(j + 1, size):
                    cross[i, j] -= factor[k, j] * cross[i, k]
                cross[i, j] /= factor[j, j]
        copy_into(regressions[g].ravel(), cross.ravel())
        residuals = rows[:, column : column + size].copy()
        for n in range(rows.shape[0]):
            for i in range(size):
                for k in range(size):
                    residuals[n, i] -= cross[i, k] * rows[n, previous_column + k]
        copy_into(residual_factors[g].ravel(), cholesky(covariance(residuals, 0, 0, size), ridge).ravel())
    return regressions, residual_factors


@compiled
def draw_chain(normals: Floats, regressions: Floats, residual_factors: Floats) -> Floats:
    """Convert independent standard normal numbers (n, d) to samples (n, d) of the chain, minus their mean.

    regressions, residual_factors: results of `fit_chain`.
    """
    group_count, size, _ = regressions.shape
    out = np.zeros(normals.shape)
    for n in range(normals.shape[0]):
        for g in range(group_count):
            for i in range(size):
                for k in range(size):
                    out[n, g * size + i] += residual_factors[g, i, k] * normals[n, g * size + k]
                    if g > 0:
                        out[n, g * size + i] += regressions[g, i, k] * out[n, (g - 1) * size + k]
    return out
