"""Compute the steady flight of many draws at once.

It covers climb at full throttle, sink at idle, and power in cruise.

The formulas are for a point mass with a trimmed elevator. JSBSim's trims (`flight.dynamics.trim`) are the reference,
and tests compare the two.
"""

from dataclasses import dataclass

import numpy as np

from aircraft.identification.base_model import BaseModel
from aircraft.identification.parameters import INDEX
from world.arrays import Floats

# Standard gravity, m/s^2.
GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class Performance:
    """Performance of each of m draws, (m,).

    climb: climb angle at full throttle relative to the air, rad.
    sink: descent angle at idle relative to the air, rad, positive downwards.
    drag: drag in level flight, N.
    throttle: throttle in level flight, 0..1.
    power: power from the battery in level flight, W.
    """

    climb: Floats
    sink: Floats
    drag: Floats
    throttle: Floats
    power: Floats


def performance(base: BaseModel, values: Floats, airspeed: float, density: float, idle: float = 0.0) -> Performance:
    """Compute climb, sink, drag, throttle and power of each of m draws of an aircraft.

    values: values of the n parameters in each draw, (m, n).
    airspeed: m/s, true.
    density: kg/m^3.
    idle: throttle in a glide.
    """
    values = np.atleast_2d(values)
    count = len(values)
    level = np.zeros(count)
    throttle, min_throttle, max_throttle = np.full(count, 0.5), np.zeros(count), np.ones(count)
    for _ in range(40):
        thrust, _ = _thrusts_and_currents(base, values, airspeed, throttle, density)
        alpha, drag = _alpha_and_drag(base, values, airspeed, density, thrust, level)
        is_short = thrust * np.cos(alpha) < drag
        min_throttle, max_throttle = (
            np.where(is_short, throttle, min_throttle),
            np.where(is_short, max_throttle, throttle),
        )
        throttle = 0.5 * (min_throttle + max_throttle)
    _, current = _thrusts_and_currents(base, values, airspeed, throttle, density)
    return Performance(
        climb=_path_angle(base, values, airspeed, density, np.ones(count)),
        sink=-_path_angle(base, values, airspeed, density, np.full(count, idle)),
        drag=drag,
        throttle=throttle,
        power=current * base.motor.voltage,
    )


# Range of the search for the fastest level flight, m/s.
_SPEED_RANGE_MPS = (3.0, 150.0)


def max_level_speeds(base: BaseModel, values: Floats, density: float) -> Floats:
    """Return the maximum airspeed of level flight of each of m draws, m/s, (m,).

    values: values of the n parameters in each draw, (m, n).
    density: kg/m^3.
    """
    values = np.atleast_2d(values)
    count = len(values)
    full_throttle, level = np.ones(count), np.zeros(count)

    def excess_thrust(speed: Floats) -> Floats:
        """Return thrust minus drag at full throttle and at a speed (m,), N, (m,)."""
        thrust, _ = _thrusts_and_currents(base, values, speed, full_throttle, density)
        alpha, drag = _alpha_and_drag(base, values, speed, density, thrust, level)
        return np.asarray(thrust * np.cos(alpha) - drag)

    # Search downwards: at a lower speed, on the back side of the power curve, thrust equals drag again.
    high_speed = np.full(count, _SPEED_RANGE_MPS[1])
    low_speed = high_speed.copy()
    for _ in range(200):
        is_short = (excess_thrust(low_speed) < 0.0) & (low_speed > _SPEED_RANGE_MPS[0])
        if not is_short.any():
            break
        high_speed = np.where(is_short, low_speed, high_speed)
        low_speed = np.where(is_short, 0.97 * low_speed, low_speed)
    for _ in range(40):
        middle_speed = 0.5 * (low_speed + high_speed)
        is_short = excess_thrust(middle_speed) < 0.0
        low_speed = np.where(is_short, low_speed, middle_speed)
        high_speed = np.where(is_short, middle_speed, high_speed)
    return np.asarray(0.5 * (low_speed + high_speed))


def level_controls(base: BaseModel, values: Floats, airspeed: float, density: float) -> tuple[float, float]:
    """Return the elevator (rad) and the throttle (0..1) in level flight for parameter values (n,).

    airspeed: m/s.
    density: kg/m^3.
    """
    rows = np.atleast_2d(values)
    throttle = performance(base, rows, airspeed, density).throttle
    thrust, _ = _thrusts_and_currents(base, rows, airspeed, throttle, density)
    alpha, _ = _alpha_and_drag(base, rows, airspeed, density, thrust, np.zeros(1))
    elevator_at_zero, elevator_per_alpha = _trimmed_elevator(base, rows)
    return float(elevator_at_zero[0] + elevator_per_alpha[0] * alpha[0]), float(throttle[0])


def _trimmed_elevator(base: BaseModel, values: Floats) -> tuple[Floats, Floats]:
    """Return the elevator (rad) that trims at zero angle of attack, and its change per angle of attack.

    The result is two arrays (m,).
    """
    c = base.coefficients
    power = c.pitch_elevator * values[:, INDEX["elevator-power"]]
    return (
        -(c.pitch_zero + values[:, INDEX["pitch-offset"]]) / power,
        -c.pitch_alpha * values[:, INDEX["pitch-stiffness"]] / power,
    )


def _path_angle(base: BaseModel, values: Floats, airspeed: float, density: float, throttle: Floats) -> Floats:
    """Return the flight-path angle of each draw at a throttle (m,), rad, (m,).

    values: values of the n parameters in each draw, (m, n).
    airspeed: m/s.
    density: kg/m^3.
    """
    thrust, _ = _thrusts_and_currents(base, values, airspeed, throttle, density)
    angle = np.zeros(len(values))
    for _ in range(12):
        alpha, drag = _alpha_and_drag(base, values, airspeed, density, thrust, angle)
        angle = np.arcsin(np.clip((thrust * np.cos(alpha) - drag) / (base.mass * GRAVITY), -0.9, 0.9))
    return angle


def _alpha_and_drag(
    base: BaseModel, values: Floats, airspeed: Floats | float, density: float, thrust: Floats, angle: Floats
) -> tuple[Floats, Floats]:
    """Return the angle of attack (rad) and the drag (N) with a trimmed elevator, two arrays (m,).

    thrust: N, (m,).
    angle: flight-path angle, rad, (m,).
    airspeed: m/s.
    density: kg/m^3.
    """
    c = base.coefficients
    pressure = 0.5 * density * airspeed * airspeed * base.area
    column = {name: values[:, k] for name, k in INDEX.items()}
    slope = c.lift_alpha * column["lift-slope"]
    lift_at_zero = c.lift_zero + column["lift-offset"]
    elevator_at_zero, elevator_per_alpha = _trimmed_elevator(base, values)
    alpha = np.zeros(len(values))
    weight = base.mass * GRAVITY
    for _ in range(6):
        lift = weight * np.cos(angle) - thrust * np.sin(alpha)
        alpha = (lift / pressure - lift_at_zero - c.lift_elevator * elevator_at_zero) / (
            slope + c.lift_elevator * elevator_per_alpha
        )
    elevator = elevator_at_zero + elevator_per_alpha * alpha
    lift_coefficient = lift_at_zero + slope * alpha
    induced = c.drag_induced * column["induced-drag"] * np.square(lift_coefficient - c.lift_least_drag)
    drag = c.drag_zero * column["zero-lift-drag"] + induced
    return alpha, pressure * (drag + c.drag_elevator * elevator)


def _thrusts_and_currents(
    base: BaseModel, values: Floats, airspeed: Floats | float, throttle: Floats, density: float
) -> tuple[Floats, Floats]:
    """Return the thrust (N) and the battery current (A) of each draw, two arrays (m,).

    values: values of the n parameters in each draw, (m, n).
    airspeed: m/s.
    throttle: 0..1, (m,).
    density: kg/m^3.
    """
    # Arrays over the draws replace the motor's constants: its formulas accept them unchanged.
    thrust, speed, torque = (values[:, INDEX[name]] for name in ("thrust", "motor-speed", "propeller-torque"))
    motors = base.motor.with_factors(thrust, speed, torque)  # type: ignore[arg-type]
    return motors.thrust_and_current(np.zeros(len(values)) + airspeed, throttle, np.full(len(values), density))
