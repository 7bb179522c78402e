"""Steady flight of a model with any values of its parameters: climb at full throttle, sink at idle, power in cruise.

Closed formulas about a point mass with a trimmed elevator, for many draws at once; JSBSim's own trims stay the
authority (`flight.dynamics.trim`), and tests hold the two against each other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.identification.base_model import BaseModel
from aircraft.identification.parameters import INDEX

Floats = NDArray[np.float64]
GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class Performance:
    """Of each of m draws, (m,): climb and sink are path angles to the air, rad, sink positive downwards.

    drag: N, level.  throttle: 0..1, level.  power: W from the battery, level.
    """

    climb: Floats
    sink: Floats
    drag: Floats
    throttle: Floats
    power: Floats


def performance(base: BaseModel, values: Floats, airspeed: float, density: float, idle: float = 0.0) -> Performance:
    """Of parameter values (m, n) at an airspeed (m/s, true) and a density (kg/m^3); idle: throttle when gliding."""
    values = np.atleast_2d(values)
    count = len(values)
    level = np.zeros(count)
    throttle, low, high = np.full(count, 0.5), np.zeros(count), np.ones(count)
    for _ in range(40):
        thrust, _ = _thrust(base, values, airspeed, throttle, density)
        alpha, drag = _flow(base, values, airspeed, density, thrust, level)
        short = thrust * np.cos(alpha) < drag
        low, high = np.where(short, throttle, low), np.where(short, high, throttle)
        throttle = 0.5 * (low + high)
    _, amps = _thrust(base, values, airspeed, throttle, density)
    return Performance(
        climb=_steady(base, values, airspeed, density, np.ones(count)),
        sink=-_steady(base, values, airspeed, density, np.full(count, idle)),
        drag=drag,
        throttle=throttle,
        power=amps * base.motor.voltage,
    )


# Between which the fastest level flight is looked for, m/s.
_SPEEDS = (3.0, 150.0)


def fastest_level(base: BaseModel, values: Floats, density: float) -> Floats:
    """(m,) fastest level flight, at full throttle, m/s, of parameter values (m, n); density: kg/m^3."""
    values = np.atleast_2d(values)
    count = len(values)
    full, level = np.ones(count), np.zeros(count)

    def spare(speed: Floats) -> Floats:
        thrust, _ = _thrust(base, values, speed, full, density)
        alpha, drag = _flow(base, values, speed, density, thrust, level)
        return np.asarray(thrust * np.cos(alpha) - drag)

    # From above: there is a slower speed at which thrust is drag again, on the back side of the power curve.
    high = np.full(count, _SPEEDS[1])
    low = high.copy()
    for _ in range(200):
        short = (spare(low) < 0.0) & (low > _SPEEDS[0])
        if not short.any():
            break
        high = np.where(short, low, high)
        low = np.where(short, 0.97 * low, low)
    for _ in range(40):
        middle = 0.5 * (low + high)
        short = spare(middle) < 0.0
        low, high = np.where(short, low, middle), np.where(short, middle, high)
    return np.asarray(0.5 * (low + high))


def _steady(base: BaseModel, values: Floats, airspeed: float, density: float, throttle: Floats) -> Floats:
    """Path angle (m,), rad, at a throttle."""
    thrust, _ = _thrust(base, values, airspeed, throttle, density)
    angle = np.zeros(len(values))
    for _ in range(12):
        alpha, drag = _flow(base, values, airspeed, density, thrust, angle)
        angle = np.arcsin(np.clip((thrust * np.cos(alpha) - drag) / (base.mass * GRAVITY), -0.9, 0.9))
    return angle


def _flow(
    base: BaseModel, values: Floats, airspeed: Floats | float, density: float, thrust: Floats, angle: Floats
) -> tuple[Floats, Floats]:
    """Angle of attack and drag (m,) of flight at a path angle, with the elevator that balances it."""
    c = base.coefficients
    pressure = 0.5 * density * airspeed * airspeed * base.area
    column = {name: values[:, k] for name, k in INDEX.items()}
    slope = c.lift_alpha * column["lift-slope"]
    zero = c.lift_zero + column["lift-offset"]
    # A constant, an angle of attack and an elevator that cancel.
    power = c.pitch_elevator * column["elevator-power"]
    per_alpha = -c.pitch_alpha * column["pitch-stiffness"] / power
    at_zero = -(c.pitch_zero + column["pitch-offset"]) / power
    alpha = np.zeros(len(values))
    weight = base.mass * GRAVITY
    for _ in range(6):
        lift = weight * np.cos(angle) - thrust * np.sin(alpha)
        alpha = (lift / pressure - zero - c.lift_elevator * at_zero) / (slope + c.lift_elevator * per_alpha)
    elevator = at_zero + per_alpha * alpha
    lifting = zero + slope * alpha
    induced = c.drag_induced * column["induced-drag"] * np.square(lifting - c.lift_least_drag)
    drag = c.drag_zero * column["zero-lift-drag"] + induced
    return alpha, pressure * (drag + c.drag_elevator * elevator)


def _thrust(
    base: BaseModel, values: Floats, airspeed: Floats | float, throttle: Floats, density: float
) -> tuple[Floats, Floats]:
    """Thrust, N, and the battery's current, A, (m,)."""
    # Arrays over the draws in place of the motor's constants: its formulas take them as they are.
    thrust, speed, torque = (values[:, INDEX[name]] for name in ("thrust", "motor-speed", "propeller-torque"))
    many = base.motor.changed(thrust, speed, torque)  # type: ignore[arg-type]
    return many.thrust_and_current(np.zeros(len(values)) + airspeed, throttle, np.full(len(values), density))
