"""Estimate biases of the inertial sensors and the level error of the autopilot.

They are estimated from attitude and ground velocity.

The rates of the gyros must agree with the change of attitude, and the accelerometers with the change of ground velocity
minus gravity. Mean differences are biases; in the forward direction a level error has the same effect as a bias.
"""

from dataclasses import replace

import numpy as np

from aircraft.identification.alignment import Signals
from world.arrays import Floats

# Standard gravity, m/s^2.
GRAVITY = 9.80665

# Standard deviation of the autopilot's level, rad. An excess of the forward accelerometer in steady flight is divided
# between a level error and the accelerometer's bias by their standard deviations.
LEVEL_SD = float(np.radians(0.2))
# Standard deviation of the forward accelerometer's bias, m/s^2.
FORWARD_SD = 0.03
# Largest part of an excess that is attributed to a level error, in standard deviations; the rest is attributed to the
# accelerometer's bias, which reaches 0.4 m/s^2 for uncalibrated sensors.
_MAX_LEVEL_SIGMAS = 2.0
# Largest bank of straight flight, rad.
_MAX_STRAIGHT_BANK_RAD = 0.1


def forward_excess(signals: Signals) -> list[float]:
    """Return the mean forward acceleration minus the rate of the ground speed for each record, m/s^2.

    The mean is over straight flight; without straight flight it is 0. The excess is a level error or a bias of the
    accelerometer. Both would be mistaken for drag.
    """
    excesses = []
    for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True):
        rows = slice(start_row, end_row)
        roll, pitch, yaw = signals.attitude[rows].T
        x, y, z = signals.acceleration[rows].T
        # Horizontal acceleration along the nose's heading.
        forward = x * np.cos(pitch) + (y * np.sin(roll) + z * np.cos(roll)) * np.sin(pitch)
        change = np.gradient(signals.velocity[rows], 1.0 / signals.hertz, axis=0)
        speed_gain = change[:, 0] * np.cos(yaw) + change[:, 1] * np.sin(yaw)
        is_straight = np.abs(roll) < _MAX_STRAIGHT_BANK_RAD
        excesses.append(float((forward - speed_gain)[is_straight].mean()) if is_straight.any() else 0.0)
    return excesses


def gyro_and_lateral_biases(signals: Signals) -> Floats:
    """Return the biases of the gyros and of the right accelerometer for each of s records, (s, 4).

    The columns are p, q and r (rad/s) and the acceleration to the right (m/s^2).
    """
    biases = []
    for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True):
        rows = slice(start_row, end_row)
        roll, pitch, yaw = signals.attitude[rows].T
        roll_change, pitch_change, yaw_change = np.gradient(signals.attitude[rows], 1.0 / signals.hertz, axis=0).T
        turn_rates = np.column_stack(
            [
                roll_change - yaw_change * np.sin(pitch),
                pitch_change * np.cos(roll) + yaw_change * np.sin(roll) * np.cos(pitch),
                yaw_change * np.cos(roll) * np.cos(pitch) - pitch_change * np.sin(roll),
            ]
        )
        north, east, down = np.gradient(signals.velocity[rows], 1.0 / signals.hertz, axis=0).T
        forward, level_right = north * np.cos(yaw) + east * np.sin(yaw), east * np.cos(yaw) - north * np.sin(yaw)
        pitched_down = forward * np.sin(pitch) + (down - GRAVITY) * np.cos(pitch)
        right = level_right * np.cos(roll) + pitched_down * np.sin(roll)
        gyro_bias = (signals.rates[rows] - turn_rates).mean(axis=0)
        biases.append(np.append(gyro_bias, (signals.acceleration[rows, 1] - right).mean()))
    return np.array(biases)


def remove_sensor_biases(signals: Signals, reference: Signals | None = None) -> Signals:
    """Return the signals without sensor biases.

    The forward excess is divided between level error and accelerometer bias.

    reference: signals of the same sensors, whose mean biases are used; None to use the biases of each record.
    """
    level_fraction = LEVEL_SD**2 / (LEVEL_SD**2 + (FORWARD_SD / GRAVITY) ** 2)
    attitude, acceleration, rates = signals.attitude.copy(), signals.acceleration.copy(), signals.rates.copy()
    if reference is None:
        biases = list(zip(forward_excess(signals), gyro_and_lateral_biases(signals), strict=True))
    else:
        means = float(np.mean(forward_excess(reference))), gyro_and_lateral_biases(reference).mean(axis=0)
        biases = [means] * (len(signals.edges) - 1)
    for (excess, lateral), start_row, end_row in zip(biases, signals.edges[:-1], signals.edges[1:], strict=True):
        limit = _MAX_LEVEL_SIGMAS * LEVEL_SD
        level = float(np.clip(level_fraction * excess / GRAVITY, -limit, limit))
        attitude[start_row:end_row, 1] += level
        acceleration[start_row:end_row, 0] -= excess - GRAVITY * level
        acceleration[start_row:end_row, 1] -= lateral[3]
        rates[start_row:end_row] -= lateral[:3]
    return replace(signals, attitude=attitude, acceleration=acceleration, rates=rates)
