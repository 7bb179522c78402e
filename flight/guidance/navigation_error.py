"""Compute the estimated state for guidance: true position and velocity plus a time-correlated error.

Each axis has a second-order Gauss-Markov error, typical of an estimator that blends satellite and inertial navigation.
The error varies smoothly, and the velocity error is its rate. The autocorrelation is (1 + t / T) exp(-t / T).
"""

import math

import numpy as np
from numba import literal_unroll

from world.arrays import Floats
from world.kernels import Record, field_names, inner, record_dtype

# Standard deviation on each axis (m) and correlation time T (s), by `[flight] nav`.
ERRORS = {"perfect": (0.0, 1.0), "rtk": (0.05, 5.0), "gnss": (1.5, 20.0)}
# Position (m) and velocity over the ground (m/s) in map axes, true or estimated.
MOTION = record_dtype("east", "north", "up", "velocity_east", "velocity_north", "velocity_up")
# Names of the fields of `MOTION`.
_MOTION_FIELDS = field_names(MOTION)
# Two lags in series of unit variance for each of the three axes.
NAVIGATION_LAGS = record_dtype(("first", np.float64, (3,)), ("second", np.float64, (3,)))


def start_navigation_error(noise: Floats, lags: Record) -> None:
    """Draw the initial navigation error, with the same statistics as later in the flight.

    noise: random numbers from the standard normal distribution, (6,).
    lags: a record of `NAVIGATION_LAGS`, which is set.
    """
    lags.first = noise[:3]
    # See `flight.simulation.turbulence.start_gusts`.
    lags.second = 0.5 * noise[:3] + 0.5 * noise[3:]


@inner
def estimate_motion(
    true_motion: Record,
    estimated_motion: Record,
    lags: Record,
    noise: Floats,
    sigma: float,
    time_constant: float,
    dt: float,
) -> None:
    """Set the estimated motion to the true motion plus the navigation error; advance the error by a tick.

    true_motion, estimated_motion: records of `MOTION`.
    lags: a record of `NAVIGATION_LAGS`.
    noise: random numbers from the standard normal distribution, (3,).
    sigma: standard deviation of the position error on each axis, m; 0 for no error.
    time_constant: correlation time of the error, s.
    """
    if sigma == 0.0:
        for name in literal_unroll(_MOTION_FIELDS):
            estimated_motion[name] = true_motion[name]
        return
    east, velocity_east = _step_error(lags, 0, noise, sigma, time_constant, dt)
    north, velocity_north = _step_error(lags, 1, noise, sigma, time_constant, dt)
    up, velocity_up = _step_error(lags, 2, noise, sigma, time_constant, dt)
    estimated_motion.east = true_motion.east + east
    estimated_motion.north = true_motion.north + north
    estimated_motion.up = true_motion.up + up
    estimated_motion.velocity_east = true_motion.velocity_east + velocity_east
    estimated_motion.velocity_north = true_motion.velocity_north + velocity_north
    estimated_motion.velocity_up = true_motion.velocity_up + velocity_up


@inner
def _step_error(
    lags: Record, axis: int, noise: Floats, sigma: float, time_constant: float, dt: float
) -> tuple[float, float]:
    """Advance the error of one axis by a tick; return the errors of position (m) and velocity (m/s).

    noise: random numbers from the standard normal distribution, (3,).
    sigma: standard deviation of the position error, m.
    time_constant: correlation time of the error, s.
    """
    decay = math.exp(-dt / time_constant)
    # The second lag's variance is half of the first lag's variance.
    scale = sigma * math.sqrt(2.0)
    first, second = lags.first, lags.second
    previous = first[axis]
    first[axis] = decay * previous + math.sqrt(1.0 - decay * decay) * noise[axis]
    second[axis] = decay * second[axis] + (1.0 - decay) * 0.5 * (previous + first[axis])
    return scale * second[axis], scale * (first[axis] - second[axis]) / time_constant
