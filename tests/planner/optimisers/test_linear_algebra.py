"""The Cholesky factor is that of the covariance, against NumPy."""

import numpy as np

from planner.optimisers.linear_algebra import cholesky, covariance


def test_factor_is_that_of_the_covariance() -> None:
    rows = np.random.default_rng(2).normal(size=(400, 5)) @ np.random.default_rng(3).normal(size=(5, 5))
    rows -= rows.mean(axis=0)
    factor = cholesky(covariance(rows, 0, 0, 5), 0.0)
    np.testing.assert_allclose(factor @ factor.T, np.cov(rows.T, bias=True), rtol=1e-9)
