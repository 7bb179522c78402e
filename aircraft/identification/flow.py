"""Compute angle of attack and sideslip without vanes.

They follow from the accelerometers, or from attitude and velocity.

The lift divided by the slope of the lift curve is the angle of attack, gusts included; the side force gives the
sideslip in the same way.  Attitude and velocity give the angle of attack in air without vertical motion, which is valid
only at low frequencies.
"""

from typing import NamedTuple

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.motor import Motor
from aircraft.identification.parameters import INDEX
from world.arrays import Floats

# Cutoff of the low-pass of the flow angles from the accelerometers, which serve as a vane, Hz.
VANE_CUTOFF_HZ = 8.0


class Flow(NamedTuple):
    """Flow angles, and the lift coefficient due to the angle of attack alone, three arrays (n,).

    alpha, beta: angle of attack and sideslip, rad.
    """

    alpha: Floats
    beta: Floats
    lift: Floats


def lift_curve(base: BaseModel, values: Floats) -> tuple[float, float]:
    """Return the slope of the lift coefficient, per rad, and its value at zero angle of attack.

    values: (n,) of `aircraft.identification.parameters.PARAMETERS`.
    """
    c = base.coefficients
    return c.lift_alpha * float(values[INDEX["lift-slope"]]), c.lift_zero + float(values[INDEX["lift-offset"]])


def make_motor(base: BaseModel, values: Floats) -> Motor:
    """Return the base model's motor, scaled by the motor's factors among the parameter values (n,)."""
    thrust, speed, torque = (float(values[INDEX[name]]) for name in ("thrust", "motor-speed", "propeller-torque"))
    return base.motor.with_factors(thrust, speed, torque)


def battery_voltage(signals: Signals, base: BaseModel) -> Floats | float:
    """Return the battery voltage, V: as logged (n,), or as in the base model if a row lacks it."""
    return signals.voltage if np.isfinite(signals.voltage).all() else base.motor.voltage


def dynamic_force(signals: Signals, base: BaseModel) -> Floats:
    """Return dynamic pressure times wing area, N, (n,)."""
    return np.asarray(0.5 * signals.density * np.square(signals.airspeed) * base.area)


def rate_and_elevator_lift(signals: Signals, base: BaseModel) -> Floats:
    """Return the lift coefficient due to pitch rate and elevator, by the base model's derivatives, (n,)."""
    c = base.coefficients
    pitching = signals.rates[:, 1] * base.chord / (2.0 * signals.airspeed)
    return np.asarray(c.lift_rate * pitching + c.lift_elevator * signals.surfaces[:, 0])


def flow_from_forces(signals: Signals, base: BaseModel, values: Floats, *, smooth: bool = True) -> Flow:
    """Estimate the flow angles from the accelerometers, which measure lift and side force.

    values: (n,) of `aircraft.identification.parameters.PARAMETERS`, of which the parameters of lift and motor are used.
    smooth: True to low-pass the angles forwards and backwards; False for angles that do not depend on later samples.
    """
    coefficients, (slope, zero) = base.coefficients, lift_curve(base, values)
    pressure, other_coefficient = dynamic_force(signals, base), rate_and_elevator_lift(signals, base)
    thrust, _ = make_motor(base, values).thrust_and_current(
        signals.airspeed, signals.throttle, signals.density, battery_voltage(signals, base)
    )
    x = base.mass * signals.acceleration[:, 0] - thrust
    z = base.mass * signals.acceleration[:, 2]
    alpha = (-z / pressure - zero - other_coefficient) / slope
    for _ in range(2):
        lift = (x * np.sin(alpha) - z * np.cos(alpha)) / pressure - other_coefficient
        alpha = (lift - zero) / slope
    _, aileron, rudder = signals.surfaces.T
    span_factor = base.span / (2.0 * signals.airspeed)
    rate_force = (
        coefficients.side_roll * signals.rates[:, 0] * span_factor
        + coefficients.side_yaw * signals.rates[:, 2] * span_factor
    )
    side = base.mass * signals.acceleration[:, 1] / pressure - rate_force
    beta = (side - coefficients.side_aileron * aileron - coefficients.side_rudder * rudder) / coefficients.side_beta
    flow = Flow(alpha, beta, lift)
    return Flow(*(signals.smooth(angle, VANE_CUTOFF_HZ) for angle in flow)) if smooth else flow


def alpha_from_attitude(signals: Signals, level: float = 0.0) -> Floats:
    """Return the angle of attack from attitude, ground velocity and estimated horizontal wind, rad, (n,).

    level: angle of the autopilot's level above the model's level, rad.
    """
    roll, pitch, yaw = signals.attitude.T
    pitch = pitch + level
    north = signals.velocity[:, 0] - signals.wind[:, 0]
    east = signals.velocity[:, 1] - signals.wind[:, 1]
    down = signals.velocity[:, 2]
    forward = north * np.cos(yaw) + east * np.sin(yaw)
    right = east * np.cos(yaw) - north * np.sin(yaw)
    u = forward * np.cos(pitch) - down * np.sin(pitch)
    down_component = forward * np.sin(pitch) + down * np.cos(pitch)
    w = down_component * np.cos(roll) - right * np.sin(roll)
    return np.asarray(np.arctan2(w, u))
