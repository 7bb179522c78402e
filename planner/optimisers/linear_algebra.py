"""Matrix products and factorisations with a fixed order of summation.

BLAS and LAPACK sum and round differently on different machines; a search must draw the same samples on all of them.
"""

import numpy as np

from world.arrays import Floats
from world.kernels import compiled, inner


@compiled
def covariance(rows: Floats, first_column: int, second_column: int, size: int) -> Floats:
    """Return the covariance matrix (size, size) between two groups of columns.

    rows: (n, d) samples minus their mean.
    first_column, second_column: index of the first column of each group.
    size: number of columns of a group.
    """
    out = np.zeros((size, size))
    for n in range(rows.shape[0]):
        for i in range(size):
            for j in range(size):
                out[i, j] += rows[n, first_column + i] * rows[n, second_column + j]
    out /= rows.shape[0]
    return out


@compiled
def cholesky(matrix: Floats, ridge: float) -> Floats:
    """Return the lower Cholesky factor (d, d) of a covariance matrix (d, d) after enlarging its diagonal.

    ridge: value added to each variance, as a fraction of the mean variance.
    """
    size = matrix.shape[0]
    trace = 0.0
    for i in range(size):
        trace += matrix[i, i]
    diagonal_term = ridge * trace / size + 1e-300
    out = np.zeros((size, size))
    for j in range(size):
        pivot = matrix[j, j] + diagonal_term
        for k in range(j):
            pivot -= out[j, k] * out[j, k]
        out[j, j] = np.sqrt(max(pivot, diagonal_term))
        for i in range(j + 1, size):
            total = matrix[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            out[i, j] = total / out[j, j]
    return out


@compiled
def multiply_by_lower(rows: Floats, factor: Floats) -> Floats:
    """Return the product (n, d) of rows (n, d) and the transpose of a triangular matrix.

    factor: (d, d) lower triangular matrix.
    """
    out = np.zeros(rows.shape)
    for n in range(rows.shape[0]):
        for i in range(factor.shape[0]):
            for k in range(i + 1):
                out[n, i] += factor[i, k] * rows[n, k]
    return out


@compiled
def multiply_by_sparse(rows: Floats, basis: Floats) -> Floats:
    """Return the product (n, k) of rows (n, d) and a matrix `basis` (d, k) that consists mostly of zeros."""
    columns = rows.T.copy()
    out = np.zeros((basis.shape[1], rows.shape[0]))
    for k in range(basis.shape[1]):
        for d in range(basis.shape[0]):
            if basis[d, k] != 0.0:
                _add_multiple(columns[d], basis[d, k], out[k])
    return out.T.copy()


@inner
def _add_multiple(values: Floats, factor: float, out: Floats) -> None:
    """Add `factor` times `values` to `out`, (n,) each."""
    for n in range(out.size):
        out[n] += values[n] * factor


@inner
def band_cholesky(matrix: Floats, out: Floats) -> None:
    """Fill `out` with the lower Cholesky factor of a positive definite band matrix.

    Both are stored as (d, b): column 0 is the main diagonal, column 1 the diagonal below it, and so on. Entry [i, k]
    belongs to row i and column i - k of the matrix. Against rounding, a pivot is at least 1e-12 times the diagonal
    entry.
    """
    size, width = matrix.shape
    for i in range(size):
        for j in range(max(0, i - width + 1), i + 1):
            total = matrix[i, i - j]
            for k in range(max(0, i - width + 1), j):
                total -= out[i, i - k] * out[j, j - k]
            out[i, i - j] = total / out[j, 0] if j < i else np.sqrt(max(total, 1e-12 * matrix[i, 0] + 1e-300))


@inner
def solve_band(factor: Floats, right_side: Floats, out: Floats) -> None:
    """Solve a linear system with a positive definite band matrix; write the solution to `out` (d,).

    factor: (d, b) Cholesky factor of the band matrix, as `band_cholesky` computes it.
    right_side: (d,).
    """
    size, width = factor.shape
    for i in range(size):
        total = right_side[i]
        for k in range(max(0, i - width + 1), i):
            total -= factor[i, i - k] * out[k]
        out[i] = total / factor[i, 0]
    for i in range(size - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, min(size, i + width)):
            total -= factor[k, k - i] * out[k]
        out[i] = total / factor[i, 0]
