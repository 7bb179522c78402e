"""Level of the autopilot: forward acceleration in steady flight beyond the gain in speed and altitude."""

from dataclasses import replace

import numpy as np

from aircraft.identification.alignment import Signals

# Standard gravity, m/s^2.
GRAVITY = 9.80665

# Standard deviation of the autopilot's level, rad. An excess of the forward accelerometer in steady flight is divided
# between a level error and the accelerometer's bias by their standard deviations.
LEVEL_SD = float(np.radians(0.2))
# Standard deviation of the forward accelerometer's bias, m/s^2.
FORWARD_SD = 0.03
# Largest bank of straight flight, rad.
_MAX_STRAIGHT_BANK_RAD = 0.1


def forward_excess(signals: Signals) -> list[float]:
    """Return the forward accelerometer's excess over the gain in speed and altitude per stretch, m/s^2.

    It is the mean over straight flight, from attitude and ground velocity. The excess is a level error or an
    accelerometer's bias; either would be taken for drag.
    """
    excesses = []
    for first, last in zip(signals.edges[:-1], signals.edges[1:], strict=True):
        rows = slice(first, last)
        roll, pitch, yaw = signals.attitude[rows].T
        x, y, z = signals.acceleration[rows].T
        # Horizontal acceleration along the nose's heading.
        forward = x * np.cos(pitch) + (y * np.sin(roll) + z * np.cos(roll)) * np.sin(pitch)
        change = np.gradient(signals.velocity[rows], 1.0 / signals.hertz, axis=0)
        speed_gain = change[:, 0] * np.cos(yaw) + change[:, 1] * np.sin(yaw)
        is_straight = np.abs(roll) < _MAX_STRAIGHT_BANK_RAD
        excesses.append(float((forward - speed_gain)[is_straight].mean()) if is_straight.any() else 0.0)
    return excesses


def level_signals(signals: Signals) -> Signals:
    """Return signals with the forward excess divided between the level and the accelerometer."""
    level_fraction = LEVEL_SD**2 / (LEVEL_SD**2 + (FORWARD_SD / GRAVITY) ** 2)
    attitude, acceleration = signals.attitude.copy(), signals.acceleration.copy()
    for excess, first, last in zip(forward_excess(signals), signals.edges[:-1], signals.edges[1:], strict=True):
        attitude[first:last, 1] += level_fraction * excess / GRAVITY
        acceleration[first:last, 0] -= (1.0 - level_fraction) * excess
    return replace(signals, attitude=attitude, acceleration=acceleration)
