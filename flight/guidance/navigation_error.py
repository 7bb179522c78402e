"""The estimated state, which guidance steers by: the true position and velocity, and an error that wanders with time.

Each axis has a second-order Gauss-Markov error, as an estimator that blends satellites with inertial sensors leaves: it
wanders smoothly, and the velocity's error is its rate.  The autocorrelation is (1 + t / T) exp(-t / T).
"""

import math

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from world.kernels import Record, field_names, inner, record_dtype

Floats = NDArray[np.float64]

# Standard deviation on each axis (m) and correlation time T (s), by `[flight] nav`.
ERRORS = {"perfect": (0.0, 1.0), "rtk": (0.05, 5.0), "gnss": (1.5, 20.0)}
# Position (m) and velocity over the ground (m/s) in map axes, true or estimated.
MOTION = record_dtype("east", "north", "up", "velocity_east", "velocity_north", "velocity_up")
_MOTION = field_names(MOTION)
# Two lags in a row for each of the three axes, of unit variance.
NAVIGATION_LAGS = record_dtype(("first", np.float64, (3,)), ("second", np.float64, (3,)))


def start_navigation(noise: Floats, lags: Record) -> None:
    """Draw the stationary state of the lags, a record of `NAVIGATION_LAGS`, from (6,) unit normals."""
    lags.first = noise[:3]
    # As in `flight.simulation.turbulence.start_gusts`.
    lags.second = 0.5 * noise[:3] + 0.5 * noise[3:]


@inner
def navigate(
    true: Record,
    estimated: Record,
    lags: Record,
    noise: Floats,
    sigma: float,
    time_constant: float,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Fill the estimated state with the true one and its error, and advance the error.

    true, estimated: records of `MOTION`.  lags: of `NAVIGATION_LAGS`.  noise: (3,) unit normals.
    """
    if sigma == 0.0:
        for name in literal_unroll(_MOTION):
            estimated[name] = true[name]
        return
    east, velocity_east = _error(lags, 0, noise, sigma, time_constant, dt)
    north, velocity_north = _error(lags, 1, noise, sigma, time_constant, dt)
    up, velocity_up = _error(lags, 2, noise, sigma, time_constant, dt)
    estimated.east = true.east + east
    estimated.north = true.north + north
    estimated.up = true.up + up
    estimated.velocity_east = true.velocity_east + velocity_east
    estimated.velocity_north = true.velocity_north + velocity_north
    estimated.velocity_up = true.velocity_up + velocity_up


@inner
def _error(
    lags: Record, axis: int, noise: Floats, sigma: float, time_constant: float, dt: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Error of the position (m) and of the velocity (m/s) on one axis, a tick on."""
    decay = math.exp(-dt / time_constant)
    # The second lag's variance is a half of the first's.
    scale = sigma * math.sqrt(2.0)
    first, second = lags.first, lags.second
    before = first[axis]
    first[axis] = decay * before + math.sqrt(1.0 - decay * decay) * noise[axis]
    second[axis] = decay * second[axis] + (1.0 - decay) * 0.5 * (before + first[axis])
    return scale * second[axis], scale * (first[axis] - second[axis]) / time_constant
