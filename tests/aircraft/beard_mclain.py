"""The Aerosonde's equations of motion in plain Python, independent of JSBSim, to validate the model with.

Beard and McLain, Small Unmanned Aircraft, second edition: chapter 3 (rigid body), chapter 4 (aerodynamics, motor and
propeller), appendix E.2 (coefficients).  Flat earth that does not turn; SI and radians throughout.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root

from world.arrays import Floats

MASS = 11.0
JX, JY, JZ, JXZ = 0.8244, 1.135, 1.759, 0.1204
AREA_M2 = 0.55
SPAN_M = 2.8956
CHORD_M = 0.18994
OSWALD_FACTOR = 0.9
CL_0, CL_ALPHA, CL_Q, CL_ELEVATOR = 0.23, 5.61, 7.95, 0.13
CD_Q, CD_ELEVATOR = 0.0, 0.0135
CM_0, CM_ALPHA, CM_Q, CM_ELEVATOR = 0.0135, -2.74, -38.21, -0.99
CY_BETA, CY_AILERON, CY_RUDDER = -0.98, 0.075, 0.19
ROLL_BETA, ROLL_P, ROLL_R, ROLL_AILERON, ROLL_RUDDER = -0.13, -0.51, 0.25, 0.17, 0.0024
YAW_BETA, YAW_P, YAW_R, YAW_AILERON, YAW_RUDDER = 0.073, 0.069, -0.095, -0.011, -0.069
STALL_RATE, STALL_ALPHA = 50.0, 0.47
DIAMETER = 20.0 * 0.0254
KV = KQ = 60.0 / (2.0 * math.pi * 145.0)
RESISTANCE, NO_LOAD_CURRENT, BATTERY = 0.042, 1.5, 44.4
CQ_0, CQ_1, CQ_2 = 0.00523, 0.00497, -0.01664
CT_0, CT_1, CT_2 = 0.09357, -0.06044, -0.1079


@dataclass(frozen=True, slots=True)
class BookAtmosphere:
    """What the book takes as given about the aircraft's surroundings, and two of its choices.

    density: of the air, kg/m^3.  gravity: m/s^2.  parasite_drag: coefficient.  motor_braking: whether the motor may
    brake the propeller.
    """

    density: float = 1.2682
    gravity: float = 9.81
    parasite_drag: float = 0.043
    motor_braking: bool = False


def propulsion(airspeed: float, throttle: float, air: BookAtmosphere) -> tuple[float, float, float]:
    """Return thrust, N, torque on the propeller, N m, and motor current, A (section 4.3).

    Without braking the current is held at or above zero: where the motor would brake, the propeller turns it
    against its no-load torque instead.
    """
    volts = BATTERY * throttle
    speed = _propeller_speed(airspeed, KQ * KV / RESISTANCE, KQ * (NO_LOAD_CURRENT - volts / RESISTANCE), air)
    current = (volts - KV * speed) / RESISTANCE
    if current < 0.0 and not air.motor_braking:
        speed = _propeller_speed(airspeed, 0.0, KQ * NO_LOAD_CURRENT, air)
        current = 0.0
    turns = speed / (2.0 * math.pi)
    advance = airspeed / (turns * DIAMETER)
    thrust = air.density * turns**2 * DIAMETER**4 * (CT_2 * advance**2 + CT_1 * advance + CT_0)
    torque = air.density * turns**2 * DIAMETER**5 * (CQ_2 * advance**2 + CQ_1 * advance + CQ_0)
    return thrust, torque, current


def _propeller_speed(airspeed: float, slope: float, constant: float, air: BookAtmosphere) -> float:
    # Propeller torque + slope * speed + constant = 0: the larger root of a quadratic.
    a = CQ_0 * air.density * DIAMETER**5 / (2.0 * math.pi) ** 2
    b = CQ_1 * air.density * DIAMETER**4 * airspeed / (2.0 * math.pi) + slope
    c = CQ_2 * air.density * DIAMETER**3 * airspeed**2 + constant
    return (-b + math.sqrt(b**2 - 4.0 * a * c)) / (2.0 * a)


def lift(alpha: float) -> float:
    """Lift coefficient with the book's blend into a flat plate past the stall (eq. 4.9, 4.10)."""
    low = math.exp(-STALL_RATE * (alpha - STALL_ALPHA))
    high = math.exp(STALL_RATE * (alpha + STALL_ALPHA))
    blend = (1.0 + low + high) / ((1.0 + low) * (1.0 + high))
    plate = 2.0 * math.copysign(math.sin(alpha) ** 2 * math.cos(alpha), alpha)
    return (1.0 - blend) * (CL_0 + CL_ALPHA * alpha) + blend * plate


def rates(states: Floats, commands: Floats, air: BookAtmosphere) -> Floats:
    """(8,) rates of the states (u, v, w, p, q, r, roll, pitch) at elevator, aileron, rudder, throttle (4,)."""
    u, v, w, p, q, r, roll, pitch = (float(x) for x in states)
    elevator, aileron, rudder, throttle = (float(x) for x in commands)
    airspeed = math.sqrt(u * u + v * v + w * w)
    alpha, beta = math.atan2(w, u), math.asin(v / airspeed)
    pressure = 0.5 * air.density * airspeed**2 * AREA_M2
    half_span, half_chord = SPAN_M / (2.0 * airspeed), CHORD_M / (2.0 * airspeed)

    aspect = SPAN_M**2 / AREA_M2
    drag_alpha = air.parasite_drag + (CL_0 + CL_ALPHA * alpha) ** 2 / (math.pi * OSWALD_FACTOR * aspect)
    lift_force = pressure * (lift(alpha) + CL_Q * half_chord * q + CL_ELEVATOR * elevator)
    drag_force = pressure * (drag_alpha + CD_Q * half_chord * q + CD_ELEVATOR * elevator)
    side_force = pressure * (CY_BETA * beta + CY_AILERON * aileron + CY_RUDDER * rudder)
    thrust, torque, _ = propulsion(airspeed, throttle, air)
    sa, ca = math.sin(alpha), math.cos(alpha)
    force_x = -drag_force * ca + lift_force * sa + thrust - MASS * air.gravity * math.sin(pitch)
    force_y = side_force + MASS * air.gravity * math.cos(pitch) * math.sin(roll)
    force_z = -drag_force * sa - lift_force * ca + MASS * air.gravity * math.cos(pitch) * math.cos(roll)

    moment_x = (
        pressure
        * SPAN_M
        * (ROLL_BETA * beta + half_span * (ROLL_P * p + ROLL_R * r) + ROLL_AILERON * aileron + ROLL_RUDDER * rudder)
        - torque
    )
    moment_y = pressure * CHORD_M * (CM_0 + CM_ALPHA * alpha + CM_Q * half_chord * q + CM_ELEVATOR * elevator)
    moment_z = (
        pressure
        * SPAN_M
        * (YAW_BETA * beta + half_span * (YAW_P * p + YAW_R * r) + YAW_AILERON * aileron + YAW_RUDDER * rudder)
    )

    inertia = np.array([[JX, 0.0, -JXZ], [0.0, JY, 0.0], [-JXZ, 0.0, JZ]])
    spin = np.array([p, q, r])
    spin_rate = np.linalg.solve(inertia, np.array([moment_x, moment_y, moment_z]) - np.cross(spin, inertia @ spin))
    return np.array(
        [
            r * v - q * w + force_x / MASS,
            p * w - r * u + force_y / MASS,
            q * u - p * v + force_z / MASS,
            *spin_rate,
            p + math.tan(pitch) * (q * math.sin(roll) + r * math.cos(roll)),
            q * math.cos(roll) - r * math.sin(roll),
        ]
    )


def book_trim(airspeed: float, climb: float, air: BookAtmosphere) -> tuple[Floats, Floats]:
    """Return states (8,) and commands (4,) of steady straight flight without sideslip.

    airspeed: m/s.  climb: rad, flight-path angle.  Raises ValueError where none is found.
    """

    def unpack(x: Floats) -> tuple[Floats, Floats]:
        alpha, roll, pitch = x[:3]
        states = np.array([airspeed * math.cos(alpha), 0.0, airspeed * math.sin(alpha), 0.0, 0.0, 0.0, roll, pitch])
        return states, x[3:]

    def residual(x: Floats) -> Floats:
        states, commands = unpack(x)
        # Upward speed over the ground, without sideslip (the book's altitude equation).
        rise = math.cos(x[0]) * math.sin(x[2]) - math.sin(x[0]) * math.cos(x[1]) * math.cos(x[2])
        return np.append(rates(states, commands, air)[:6], rise - math.sin(climb))

    found = root(residual, np.array([0.05, 0.0, 0.05 + climb, -0.1, 0.0, 0.0, 0.75]), tol=1e-13)
    if not found.success and np.abs(found.fun).max() > 1e-9:
        raise ValueError(
            f"no trim at {airspeed} m/s and a climb of {climb} rad: residual {np.abs(found.fun).max():.1e}"
        )
    return unpack(found.x)


def book_linearise(states: Floats, commands: Floats, air: BookAtmosphere) -> tuple[Floats, Floats]:
    """Return A (8, 8) and B (8, 4) of `rates` by central differences."""
    step = 1e-5

    def column(index: int, of_states: bool) -> Floats:
        low, high = (states.copy(), commands.copy()), (states.copy(), commands.copy())
        low[not of_states][index] -= step
        high[not of_states][index] += step
        difference: Floats = (rates(*high, air) - rates(*low, air)) / (2.0 * step)
        return difference

    a = np.array([column(i, True) for i in range(8)]).T
    b = np.array([column(i, False) for i in range(4)]).T
    return a, b
