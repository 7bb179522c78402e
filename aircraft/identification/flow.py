"""Angle of attack and sideslip without vanes: from the accelerometers, and from attitude and velocity.

Lift over the lift curve's slope is the angle of attack, gusts included; side force gives the sideslip likewise.
Attitude and velocity give the angle of attack in air without vertical motion, which is valid only at low frequencies.
"""

from typing import NamedTuple

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.motor import Motor
from aircraft.identification.parameters import INDEX
from world.arrays import Floats

# Cutoff of the vane, Hz.
VANE_BAND = 8.0


class Flow(NamedTuple):
    """Angle of attack and sideslip, rad, and lift coefficient from the angle of attack alone, (n,) each."""

    alpha: Floats
    beta: Floats
    lift: Floats


def lift_curve(base: BaseModel, values: Floats) -> tuple[float, float]:
    """Return slope (per rad) and value at zero of the lift coefficient.

    values: (n,) of `aircraft.identification.parameters.PARAMETERS`.
    """
    c = base.coefficients
    return c.lift_alpha * float(values[INDEX["lift-slope"]]), c.lift_zero + float(values[INDEX["lift-offset"]])


def motor_of(base: BaseModel, values: Floats) -> Motor:
    """Return the motor with one set of values (n,)."""
    thrust, speed, torque = (float(values[INDEX[name]]) for name in ("thrust", "motor-speed", "propeller-torque"))
    return base.motor.changed(thrust, speed, torque)


def voltage_of(signals: Signals, base: BaseModel) -> Floats | float:
    """Return the battery's voltage, V: the logged voltage, or the base model's voltage."""
    return signals.voltage if np.isfinite(signals.voltage).all() else base.motor.voltage


def pressure_of(signals: Signals, base: BaseModel) -> Floats:
    """Return dynamic pressure times wing area (n,), N."""
    return np.asarray(0.5 * signals.density * np.square(signals.airspeed) * base.area)


def other_lift(signals: Signals, base: BaseModel) -> Floats:
    """Return the lift coefficient due to pitch rate and elevator, with the base's derivatives, (n,)."""
    c = base.coefficients
    pitching = signals.rates[:, 1] * base.chord / (2.0 * signals.airspeed)
    return np.asarray(c.lift_rate * pitching + c.lift_elevator * signals.surfaces[:, 0])


def vane(signals: Signals, base: BaseModel, values: Floats) -> Flow:
    """Return the flow angles derived from the accelerometers.

    values: (n,) of `aircraft.identification.parameters.PARAMETERS`, of which the parameters of lift and motor are used.
    """
    c, (slope, zero) = base.coefficients, lift_curve(base, values)
    pressure, other = pressure_of(signals, base), other_lift(signals, base)
    thrust, _ = motor_of(base, values).thrust_and_current(
        signals.airspeed, signals.throttle, signals.density, voltage_of(signals, base)
    )
    x = base.mass * signals.acceleration[:, 0] - thrust
    z = base.mass * signals.acceleration[:, 2]
    alpha = (-z / pressure - zero - other) / slope
    for _ in range(2):
        lift = (x * np.sin(alpha) - z * np.cos(alpha)) / pressure - other
        alpha = (lift - zero) / slope
    _, aileron, rudder = signals.surfaces.T
    across = base.span / (2.0 * signals.airspeed)
    turning = c.side_roll * signals.rates[:, 0] * across + c.side_yaw * signals.rates[:, 2] * across
    side = base.mass * signals.acceleration[:, 1] / pressure - turning
    beta = (side - c.side_aileron * aileron - c.side_rudder * rudder) / c.side_beta
    return Flow(*(signals.smooth(values, VANE_BAND) for values in (alpha, beta, lift)))


def attitude_alpha(signals: Signals, level: float = 0.0) -> Floats:
    """Return the angle of attack (n,), rad, from attitude, ground velocity and estimated horizontal wind.

    level: angle of the autopilot's level above the model's level, rad.
    """
    roll, pitch, yaw = signals.attitude.T
    pitch = pitch + level
    north = signals.velocity[:, 0] - signals.wind[:, 0]
    east = signals.velocity[:, 1] - signals.wind[:, 1]
    down = signals.velocity[:, 2]
    ahead = north * np.cos(yaw) + east * np.sin(yaw)
    right = east * np.cos(yaw) - north * np.sin(yaw)
    u = ahead * np.cos(pitch) - down * np.sin(pitch)
    below = ahead * np.sin(pitch) + down * np.cos(pitch)
    w = below * np.cos(roll) - right * np.sin(roll)
    return np.asarray(np.arctan2(w, u))
