"""The modes of the smooth basis are the eigenvectors of the Brownian bridge's kernel."""

import numpy as np

from planner.seeding.first_samples import bridge_modes


def test_bridge_modes_are_the_kernels_eigenvectors() -> None:
    """Against the eigenvalues of min(s, t) - s t by a general solver."""
    t = np.arange(1, 9) / 9.0
    kernel = np.minimum.outer(t, t) - np.outer(t, t)
    modes, deviations = bridge_modes(8)
    np.testing.assert_allclose(modes.T @ modes, np.eye(8), atol=1e-12)
    values = np.linalg.eigvalsh(kernel)[::-1]
    np.testing.assert_allclose(kernel @ modes, modes * values, atol=1e-12)
    np.testing.assert_allclose(deviations**2, values / values[0], rtol=1e-9)
