"""UMDA with a Markov chain: each group of variables depends on the group before it, linearly and with Gaussian rest.

A path's waypoint goes the same way round an obstacle as the waypoint before it.  Independent marginals forget that; a
chain keeps it with far fewer numbers than a full covariance, so that a small population can tell them.  It knows a
box, groups of columns, samples and a ranking, and nothing of what they stand for.
"""

import numpy as np
from numba import njit

from planner.optimisers.umda import Floats, Umda

# Added to each variance of a group, as a share of their mean.
RIDGE = 1e-6


class Chain(Umda):
    """One run: as `Umda`, its model a first-order chain over consecutive groups of `GROUP` variables.

    `basis` and `floor` are unused.  The number of variables is a multiple of `GROUP`.
    """

    GROUP = 3

    def _sample(self, count: int) -> Floats:
        """Rows drawn group by group, each given the one before; redrawn and then clipped to the box."""
        mean = self.samples.mean(axis=0)
        width = self.upper - self.lower
        slope, spread = _fit(np.ascontiguousarray((self.samples - mean) / width), self.GROUP, RIDGE)
        return self._redraw(
            lambda rows: mean + width * _draw(self._rng.normal(size=(rows, mean.size)), slope, spread), count
        )


@njit(cache=True)
def _cross(rows: Floats, first: int, second: int, size: int) -> Floats:  # pragma: no cover - compiled
    """Covariance (size, size) of two groups of centred rows, by the columns at which they begin."""
    out = np.zeros((size, size))
    for n in range(rows.shape[0]):
        for i in range(size):
            for j in range(size):
                out[i, j] += rows[n, first + i] * rows[n, second + j]
    out /= rows.shape[0]
    return out


@njit(cache=True)
def _cholesky(matrix: Floats, ridge: float) -> Floats:  # pragma: no cover - compiled
    """Lower factor of a small covariance, ridge x mean variance on its diagonal."""
    size = matrix.shape[0]
    trace = 0.0
    for i in range(size):
        trace += matrix[i, i]
    extra = ridge * trace / size + 1e-300
    out = np.zeros((size, size))
    for j in range(size):
        pivot = matrix[j, j] + extra
        for k in range(j):
            pivot -= out[j, k] * out[j, k]
        out[j, j] = np.sqrt(max(pivot, extra))
        for i in range(j + 1, size):
            total = matrix[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            out[i, j] = total / out[j, j]
    return out


@njit(cache=True)
def _fit(rows: Floats, size: int, ridge: float) -> tuple[Floats, Floats]:  # pragma: no cover - compiled
    """Of each group (g, size, size): its regression on the group before, and the lower factor of what is left."""
    groups = rows.shape[1] // size
    slope, spread = np.zeros((groups, size, size)), np.zeros((groups, size, size))
    spread[0] = _cholesky(_cross(rows, 0, 0, size), ridge)
    for g in range(1, groups):
        before, here = (g - 1) * size, g * size
        factor = _cholesky(_cross(rows, before, before, size), ridge)
        cross = _cross(rows, here, before, size)
        # slope = cross (L L^T)^-1, by two substitutions a row.
        for i in range(size):
            for j in range(size):
                for k in range(j):
                    cross[i, j] -= factor[j, k] * cross[i, k]
                cross[i, j] /= factor[j, j]
            for j in range(size - 1, -1, -1):
                for k in range(j + 1, size):
                    cross[i, j] -= factor[k, j] * cross[i, k]
                cross[i, j] /= factor[j, j]
        slope[g] = cross
        rest = rows[:, here : here + size].copy()
        for n in range(rows.shape[0]):
            for i in range(size):
                for k in range(size):
                    rest[n, i] -= cross[i, k] * rows[n, before + k]
        spread[g] = _cholesky(_cross(rest, 0, 0, size), ridge)
    return slope, spread


@njit(cache=True)
def _draw(free: Floats, slope: Floats, spread: Floats) -> Floats:  # pragma: no cover - compiled
    """Rows (n, g size) of the chain from independent standard numbers."""
    groups, size, _ = slope.shape
    out = np.zeros(free.shape)
    for n in range(free.shape[0]):
        for g in range(groups):
            for i in range(size):
                for k in range(size):
                    out[n, g * size + i] += spread[g, i, k] * free[n, g * size + k]
                    if g > 0:
                        out[n, g * size + i] += slope[g, i, k] * out[n, (g - 1) * size + k]
    return out
