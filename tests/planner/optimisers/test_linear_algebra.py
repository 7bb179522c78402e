"""Factors and solutions against NumPy."""

import numpy as np

from planner.optimisers.linear_algebra import band_cholesky, cholesky, covariance, solve_band


def test_factor_is_that_of_the_covariance() -> None:
    rows = np.random.default_rng(2).normal(size=(400, 5)) @ np.random.default_rng(3).normal(size=(5, 5))
    rows -= rows.mean(axis=0)
    factor = cholesky(covariance(rows, 0, 0, 5), 0.0)
    np.testing.assert_allclose(factor @ factor.T, np.cov(rows.T, bias=True), rtol=1e-9)


def test_a_band_of_equations_is_solved_as_the_whole_matrix_is() -> None:
    size, wide = 17, 5
    rng = np.random.default_rng(4)
    lower = np.tril(np.triu(rng.normal(size=(size, size)), 1 - wide)) + 3.0 * np.eye(size)
    matrix = lower @ lower.T
    band = np.array([[matrix[i, i - k] if k <= i else 0.0 for k in range(wide)] for i in range(size)])
    factor, solution, right = np.zeros((size, wide)), np.zeros(size), rng.normal(size=size)
    band_cholesky(band, factor)
    solve_band(factor, right, solution)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-9)
    expected = np.linalg.cholesky(matrix)
    np.testing.assert_allclose(
        [factor[i, k] for i in range(size) for k in range(min(i + 1, wide))],
        [expected[i, i - k] for i in range(size) for k in range(min(i + 1, wide))],
        rtol=1e-9,
    )
