"""The level: what the accelerometers read ahead in steady flight beyond what was gained in speed and height."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aircraft.identification.alignment import Signals

Floats = NDArray[np.float64]
GRAVITY = 9.80665

# Standard deviations by which what the accelerometers' forward axis reads too much in steady flight is shared between
# a level that is off, rad, and the accelerometer itself, m/s^2.
LEVEL_SD, FORWARD_SD = float(np.radians(0.2)), 0.03
# Straight flight: banked less than this, rad.
_STRAIGHT = 0.1


def forward_excess(signals: Signals) -> list[float]:
    """By how much the accelerometers read more ahead than the aircraft gained in speed and height, m/s^2, each stretch.

    The mean over straight flight, by attitude and velocity over the ground.  What is left is a level that is off or an
    accelerometer's bias; either would be taken for drag.
    """
    found = []
    for first, last in zip(signals.edges[:-1], signals.edges[1:], strict=True):
        rows = slice(first, last)
        roll, pitch, yaw = signals.attitude[rows].T
        x, y, z = signals.acceleration[rows].T
        # Level ahead, along the nose's heading.
        ahead = x * np.cos(pitch) + (y * np.sin(roll) + z * np.cos(roll)) * np.sin(pitch)
        change = np.gradient(signals.velocity[rows], 1.0 / signals.hertz, axis=0)
        gained = change[:, 0] * np.cos(yaw) + change[:, 1] * np.sin(yaw)
        straight = np.abs(roll) < _STRAIGHT
        found.append(float((ahead - gained)[straight].mean()) if straight.any() else 0.0)
    return found


def levelled(signals: Signals) -> Signals:
    """Signals with the accelerometers' forward excess shared between the level and the accelerometer."""
    share = LEVEL_SD**2 / (LEVEL_SD**2 + (FORWARD_SD / GRAVITY) ** 2)
    attitude, acceleration = signals.attitude.copy(), signals.acceleration.copy()
    for excess, first, last in zip(forward_excess(signals), signals.edges[:-1], signals.edges[1:], strict=True):
        attitude[first:last, 1] += share * excess / GRAVITY
        acceleration[first:last, 0] -= (1.0 - share) * excess
    return replace(signals, attitude=attitude, acceleration=acceleration)
