"""Draw first samples, and make the smooth basis of the rotated encoding.

Neighbouring waypoints pass an obstacle on the same side. Independent marginal distributions of each coordinate lose
this dependence; independent marginals along the eigenvectors of the Brownian-bridge kernel, which is fixed at both
ends, retain it.
"""

import numpy as np

from planner.evaluation.encoding import Encoding, Space
from world.arrays import Floats

# Fraction of a seeded first population that is sampled around the seeds.
SEEDED_SAMPLE_FRACTION = 1.0
# Smallest spread around a seed, as a fraction of the unseeded spread; sampled log-uniformly.
MIN_SPREAD_FRACTION = 0.003
# Largest spread around a seed, as a fraction of the unseeded spread.
MAX_SPREAD_FRACTION = 0.3


def bridge_modes(inner: int) -> tuple[Floats, Floats]:
    """Return smooth shapes for displacements of a path's inner waypoints, and how strongly each varies.

    inner: number n of inner waypoints.

    The shapes are the eigenvectors of the kernel min(s, t) - s t of a Brownian bridge, which is fixed at both ends. The
    inverse of the kernel is the second difference, so the eigenvectors are sines: half a wave, a whole wave, and so on.

    Returns the eigenvectors as columns, (n, n), and their standard deviations relative to the first, (n,).
    """
    k = np.arange(1, inner + 1)
    modes = np.sqrt(2.0 / (inner + 1)) * np.sin(np.pi * np.outer(k, k) / (inner + 1))
    deviations = np.sin(np.pi / (2 * (inner + 1))) / np.sin(np.pi * k / (2 * (inner + 1)))
    return modes, deviations


def bridge_basis(inner: int) -> Floats:
    """Return an orthogonal basis (3 n, 3 n) for vectors of n inner waypoints in the rotated encoding.

    The directions, its columns, are the smooth shapes of `bridge_modes` across and up, and single waypoints along.
    """
    modes, _ = bridge_modes(inner)
    basis = np.zeros((3 * inner, 3 * inner))
    basis[0::3, 0::3] = np.eye(inner)
    basis[1::3, 1::3] = modes
    basis[2::3, 2::3] = modes
    return basis


def first_samples(space: Space, encoding: Encoding, count: int, starts: Floats, rng: np.random.Generator) -> Floats:
    """Draw the first samples (count, d) of a search: the start vectors, and smooth paths around them.

    starts: vectors (s, d) to start from; without starts, the smooth paths are drawn around the straight line, raised by
        a random part of the space below the ceiling.

    A sample consists of three values for each inner waypoint: its positions along and across the direct line, and its
    altitude. Smooth random displacements move the waypoints across and up.
    """
    inner_count = encoding.waypoints - 2
    modes, deviations = bridge_modes(inner_count)
    lower, upper = encoding.lower.reshape(inner_count, 3), encoding.upper.reshape(inner_count, 3)
    # Standard deviation at mid-path of the first mode, across and up: a quarter of the allowed range.
    spread = np.array([0.25 * np.median(upper[:, 1] - lower[:, 1]), 0.25 * (space.up[1] - space.up[0])])
    # The modes are those of a Brownian bridge, which is zero at both ends of the path. The middle entry of the first
    # mode is sqrt(2 / (n + 1)): this factor makes it 1.
    spread *= np.sqrt((inner_count + 1) / 2.0)

    def draw_displacements(path_count: int) -> Floats:
        """Draw smooth displacements (path_count, inner, 2) of the inner waypoints, across and up."""
        weights = rng.normal(size=(path_count, inner_count, 2)) * deviations[:, None] * spread
        return np.asarray(np.einsum("nka,ik->nia", weights, modes, optimize=False))

    out = np.empty((count, inner_count, 3))
    fraction = np.linspace(0.0, 1.0, inner_count + 2)[1:-1, None]
    out[..., 0] = rng.uniform(lower[:, 0], upper[:, 0], (count, inner_count))
    out[..., 1] = 0.0
    heights = space.start[2] * (1.0 - fraction) + space.destination[2] * fraction
    out[..., 2] = heights[:, 0] + rng.uniform(0.0, 1.0, (count, 1)) * np.maximum(0.0, space.up[1] - heights[:, 0])
    out[..., 1:] += draw_displacements(count)
    if len(starts):
        around_count = min(count, max(len(starts), int(SEEDED_SAMPLE_FRACTION * count)))
        seeds = starts[np.arange(around_count) % len(starts)].reshape(around_count, inner_count, 3)
        scale = np.exp(rng.uniform(np.log(MIN_SPREAD_FRACTION), np.log(MAX_SPREAD_FRACTION), (around_count, 1, 1)))
        scale[: len(starts)] = 0.0
        out[:around_count] = seeds
        out[:around_count, :, 1:] += scale * draw_displacements(around_count)
        out[:around_count, :, :1] += (
            scale * rng.normal(size=(around_count, inner_count, 1)) * (upper[:, :1] - lower[:, :1])
        )
    return np.clip(out.reshape(count, -1), encoding.lower, encoding.upper)
