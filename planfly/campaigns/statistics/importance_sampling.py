"""A sample of a distribution of which only the density's logarithm, up to a constant, can be had.

Importance sampling (Robert and Casella, Monte Carlo Statistical Methods, 2nd edition, 2004, chapters 3.3 and 14.3): the
points are those of a multivariate t distribution about the mode, whose tails are longer than a posterior's, evenly
spread by Sobol's sequence; each weighs by how much likelier it is than t has it.  They are then drawn again by their
weights, so that all that are left weigh the same: systematically in the order of the first coordinate (Kitagawa, "Monte
Carlo filter and smoother for non-Gaussian nonlinear state space models", Journal of Computational and Graphical
Statistics 5, 1996), for in the order of the sequence, which repeats itself, every second point may be on one side.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Degrees of freedom of the t distribution, and how many of its points are weighed for each that is left.
_FREEDOM, _WEIGHED = 6.0, 2
_SEED = 1


def importance_sample(
    log_density: Callable[[Floats], Floats], middle: Floats, covariance: Floats, count: int
) -> Floats:
    """(count, k) points of a distribution, each as likely as the other, in no order; most even in the first coordinate.

    log_density: of (n, k) points (n,), up to a constant; -inf where there is none.
    middle, covariance: (k,) and (k, k), about those of the distribution.  count: a power of two.
    Raises LinAlgError where the covariance is not positive definite.

    >>> sample = importance_sample(lambda x: -0.5 * x[:, 0] ** 2, np.ones(1), np.eye(1), 256)
    >>> round(float(sample.std()), 1)
    1.0
    """
    standard, log_proposal = _t_points(middle.size, _WEIGHED * count)
    points = middle + standard @ np.linalg.cholesky(covariance).T
    logs = log_density(points) - log_proposal
    order = np.argsort(points[:, 0], kind="stable")
    summed = np.cumsum(np.exp(logs - logs.max())[order])
    steps = (np.arange(count) + 0.5) / count
    kept = order[np.searchsorted(summed / summed[-1], steps).clip(0, order.size - 1)]
    out: Floats = np.random.default_rng(_SEED).permutation(points[kept])
    return out


@lru_cache
def _t_points(size: int, count: int) -> tuple[Floats, Floats]:
    """(count, size) points of the standard t distribution, and (count,) the logarithm of its density there."""
    from scipy.stats import chi2, norm, qmc

    # A power of two: the points of Sobol's sequence are balanced then.
    shares = qmc.Sobol(size + 1, seed=_SEED).random(count).clip(1e-12, 1.0 - 1e-12)
    points = norm.ppf(shares[:, :size]) / np.sqrt(chi2.ppf(shares[:, size:], _FREEDOM) / _FREEDOM)
    return points, -0.5 * (_FREEDOM + size) * np.log1p((points * points).sum(axis=1) / _FREEDOM)
