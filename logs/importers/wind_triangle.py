"""Estimate the wind of a log without wind from ground velocity, heading and airspeed."""

import numpy as np

from logs.importers.motion import Samples
from world.arrays import Floats

# Window over which the wind is averaged, s; gusts and sideslip of single turns average out.
_WINDOW_S = 60.0
# Interval of the estimates, s.
_STEP_S = 1.0
# Airspeed below which the aircraft does not fly, m/s.
_MIN_AIRSPEED_MPS = 5.0
# Minimum fraction of a window during which the aircraft flies.
_MIN_FRACTION = 0.5


def estimate_wind(velocity: Samples, attitude: Samples, airspeed: Samples) -> Samples:
    """Estimate the wind velocity to north and east, m/s, (k, 2): ground velocity minus air velocity.

    There is a row for each second in which the aircraft flew for more than half of the window `_WINDOW_S` around it;
    its wind is the mean over this window.  There are no rows if any input has fewer than two rows.

    The nose is assumed to point into the air flow.  A sideslip or a heading error of 3 degrees at 17 m/s therefore
    appears as 0.9 m/s of wind in straight flight, and averages out on circles.

    velocity: ground velocity to north, east and down, m/s, (n, 3).
    attitude: roll, pitch and yaw, rad, (n, 3).
    airspeed: true airspeed, m/s, (n, 1).

    >>> time, yaw = np.arange(0.0, 120.0, 0.1), 0.1 * np.arange(0.0, 120.0, 0.1)
    >>> ground = np.column_stack([17.0 * np.cos(yaw) + 3.0, 17.0 * np.sin(yaw) - 2.0, 0.0 * yaw])
    >>> angles, speed = np.column_stack([0.0 * yaw, 0.0 * yaw, yaw]), np.full((1200, 1), 17.0)
    >>> wind = estimate_wind(*(Samples(time, values) for values in (ground, angles, speed)))
    >>> wind.values[0].round(3).tolist()
    [3.0, -2.0]
    """
    if min(len(velocity.time), len(attitude.time), len(airspeed.time)) < 2:
        return Samples(np.zeros(0), np.zeros((0, 2)))
    time = velocity.time
    yaw = np.interp(time, attitude.time, np.unwrap(attitude.values[:, 2]))
    speed = np.interp(time, airspeed.time, airspeed.values[:, 0], left=0.0, right=0.0)
    # Horizontal part of the airspeed.  The vertical part equals the vertical ground velocity, because air moves
    # horizontally.
    horizontal_speed = np.sqrt(np.maximum(0.0, np.square(speed) - np.square(velocity.values[:, 2])))
    is_flying = speed > _MIN_AIRSPEED_MPS
    winds = velocity.values[:, :2] - horizontal_speed[:, np.newaxis] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    sums = np.vstack(
        [np.zeros(3), np.cumsum(np.column_stack([winds, np.ones(len(time))]) * is_flying[:, np.newaxis], axis=0)]
    )
    centers = np.arange(time[0], time[-1], _STEP_S)
    start_rows, end_rows = (np.searchsorted(time, centers + side * 0.5 * _WINDOW_S) for side in (-1.0, 1.0))
    totals = sums[end_rows] - sums[start_rows]
    is_sufficient = totals[:, 2] > _MIN_FRACTION * _WINDOW_S * len(time) / max(1e-9, float(time[-1] - time[0]))
    values: Floats = totals[is_sufficient, :2] / totals[is_sufficient, 2:]
    return Samples(centers[is_sufficient], values)
