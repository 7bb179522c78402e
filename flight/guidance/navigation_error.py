"""What guidance knows of where it is: the true position and velocity, and an error that grows and fades with time.

Each axis has a second-order Gauss-Markov error, as an estimator that blends satellites with inertial sensors leaves: it
wanders smoothly, and the velocity's error is its rate.  The autocorrelation is (1 + t / T) exp(-t / T).
"""

import math

import numpy as np
from numpy.typing import NDArray

from world.kernels import compiled

Floats = NDArray[np.float64]

# Standard deviation on each axis (m) and correlation time T (s), by `[flight] nav`.
ERRORS = {"perfect": (0.0, 1.0), "rtk": (0.05, 5.0), "gnss": (1.5, 20.0)}
# Two lags in a row for each of three axes.
NAV_STATES = 6


def start_navigation(noise: Floats, errors: Floats) -> None:
    """Draw the stationary state of the lags from (6,) unit normals into (6,) ``errors``."""
    first, second = noise[:3], noise[3:]
    errors[:3] = first
    # As in `flight.simulation.dryden.start_gusts`.
    errors[3:] = 0.5 * first + 0.5 * second


@compiled
def navigate(
    place: Floats, seen: Floats, errors: Floats, noise: Floats, sigma: float, time_constant: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Fill ``seen`` (6,) with ``place`` (6,) and its error, and advance ``errors`` (6,) by ``noise`` (3,)."""
    if sigma == 0.0:
        for i in range(6):
            seen[i] = place[i]
        return
    decay = math.exp(-dt / time_constant)
    # The second lag's variance is a half of the first's.
    scale = sigma * math.sqrt(2.0)
    for i in range(3):
        before = errors[i]
        errors[i] = decay * before + math.sqrt(1.0 - decay * decay) * noise[i]
        errors[3 + i] = decay * errors[3 + i] + (1.0 - decay) * 0.5 * (before + errors[i])
        seen[i] = place[i] + scale * errors[3 + i]
        seen[3 + i] = place[3 + i] + scale * (errors[i] - errors[3 + i]) / time_constant
