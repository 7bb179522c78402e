"""Least squares with the same rounding on every machine.

LAPACK and its BLAS choose their arithmetic by the processor, so that the last digits of a solution differ, and with
them every track computed from it. Least-squares problems behind a plan or a flight are solved here instead.
"""

import numpy as np

from world.arrays import Floats
from world.kernels import compiled, inner

# A column is dependent if its squared orthogonal remainder is below this fraction of the longest squared column.  The
# finite differences of a trim leave up to 1e-8 of its length in the column of a surface that an aircraft does not have.
_DEPENDENT_NORM_RATIO = 1e-12


def least_squares(basis: Floats, values: Floats) -> Floats:
    """Return the coefficients c, (k,), that minimise the norm of basis @ c - values.

    basis: (n, k), one column for each coefficient.
    values: (n,).

    The method is modified Gram-Schmidt (Golub and Van Loan, Matrix Computations, 4th edition, algorithm 5.2.6). A
    column that depends linearly on earlier columns, to within 1e-6 of the longest column, gets the coefficient 0.

    >>> least_squares(np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]]), np.array([1.0, 3.0, 5.0])).round(9).tolist()
    [1.0, 2.0]
    """
    return _solve_gram_schmidt(np.ascontiguousarray(basis), np.ascontiguousarray(values))


@compiled
def _solve_gram_schmidt(basis: Floats, values: Floats) -> Floats:
    """Solve `least_squares` by modified Gram-Schmidt orthogonalisation, for contiguous arrays."""
    row_count, column_count = basis.shape
    # Orthogonalise the columns and the values together.
    q, r = np.empty((row_count, column_count + 1)), np.zeros((column_count, column_count + 1))
    for n in range(row_count):
        for k in range(column_count):
            q[n, k] = basis[n, k]
        q[n, column_count] = values[n]
    is_dependent = np.zeros(column_count, dtype=np.bool_)
    max_norm = 0.0
    for k in range(column_count):
        max_norm = max(max_norm, _dot_product(basis, k, k))
    for k in range(column_count):
        norm = _dot_product(q, k, k)
        is_dependent[k] = norm <= _DEPENDENT_NORM_RATIO * max_norm
        if is_dependent[k]:
            continue
        for j in range(k + 1, column_count + 1):
            r[k, j] = _dot_product(q, k, j) / norm
            for n in range(row_count):
                q[n, j] -= r[k, j] * q[n, k]
    coefficients = np.zeros(column_count)
    for k in range(column_count - 1, -1, -1):
        if is_dependent[k]:
            continue
        coefficients[k] = r[k, column_count]
        for j in range(k + 1, column_count):
            coefficients[k] -= r[k, j] * coefficients[j]
    return coefficients


@inner
def _dot_product(columns: Floats, first: int, second: int) -> float:
    """Return the dot product of two columns of a matrix."""
    total = 0.0
    for n in range(columns.shape[0]):
        total += columns[n, first] * columns[n, second]
    return total
