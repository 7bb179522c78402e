"""Find steady straight flights, and the linear dynamics about them.

A steady flight has controls and an attitude without acceleration.

A trim has eight quantities, `QUANTITIES`. Two of them are fixed, and Newton's method finds the other six such that the
six body accelerations vanish. Speeds and angles are relative to the air mass.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

import numpy as np

from flight.dynamics.jsbsim_properties import RATES
from flight.dynamics.state import Commands
from world.arrays import Floats
from world.errors import FlightError
from world.least_squares import least_squares

# ----------------------------------------------------------------------
# The running engine of a JSBSim model: its speed is a state of the model, which must settle before a measurement.

# First time step while the engine speed settles, s.
_SETTLE_STEP_S = 0.2
# Number of steps of this length, before the step length follows the engine's time constant.
_FIRST_SETTLE_STEPS = 25
# Maximum number of steps.
_MAX_SETTLE_STEPS = 300
# Range of the step length after that, s.
_SETTLE_STEP_RANGE_S = (1e-4, 60.0)
# Maximum ratio between successive steps.
_MAX_STEP_CHANGE = 4.0
# Change below which the rates are steady, ft/s^2 and rad/s^2.
_STEADY_RATE_CHANGE = 1e-10
# Maximum number of steps while derivatives settle at constant engine speed.
_MAX_RATE_STEPS = 6


class Engine:
    """Engine whose speed can settle while the aircraft is held in the air flow.

    fdm: the JSBSim instance.
    dt: time step of the flight, s.
    getter, setter: functions that return the getter and the setter of a JSBSim property, by name.
    """

    def __init__(self, fdm: Any, dt: float, getter: Callable[[str], Any], setter: Callable[[str], Any]) -> None:
        """Look up the JSBSim properties that hold the aircraft still and run its engine."""
        self._exec, self._dt = fdm, dt
        kinds = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
        names = [f"simulation/integrator/{kind}" for kind in kinds]
        self._integrators = [setter(name) for name in names]
        self._saved_integrators = [getter(name)() for name in names]
        self._rates = [getter(name) for name in RATES[:6]]
        self._freeze = setter("propulsion/fuel_freeze")
        self._start = setter("propulsion/set-running")
        self._running = False

    def hold(self) -> None:
        """Stop the aircraft's motion and its fuel flow, and start the engine if it is not running."""
        for integrator in self._integrators:
            integrator(0.0)
        self._freeze(1.0)
        if not self._running:
            self._exec.run_ic()
            self._start(-1.0)
            self._running = True

    def settle(self, *, spin: bool) -> None:
        """Let the engine speed settle at the present airspeed and throttle.

        spin: True to let the engine speed change, False to keep it. With False, only quantities that depend on their
            own derivative settle, such as the lift of a changing angle of attack.

        A light propeller settles within milliseconds, and would oscillate with longer steps. A heavy propeller takes a
        minute. A step of the engine's time constant leads directly to the steady speed, as in Newton's method.
        """
        steps = [_SETTLE_STEP_S, _SETTLE_STEP_S] if spin else [0.0, 0.0]
        self._exec.set_dt(steps[1])
        previous_rates, previous_change = [0.0] * 6, [0.0] * 6
        for number in range(_MAX_SETTLE_STEPS if spin else _MAX_RATE_STEPS):
            self._exec.run()
            rates = [rate() for rate in self._rates]
            # Without NumPy, which takes as long for six numbers as JSBSim does for its step.
            change = [a - b for a, b in zip(rates, previous_rates, strict=True)]
            if all(abs(difference) < _STEADY_RATE_CHANGE for difference in change):
                break
            if spin and number >= _FIRST_SETTLE_STEPS:
                steps = [steps[1], next_settling_step(steps, previous_change, change)]
                self._exec.set_dt(steps[1])
            previous_rates, previous_change = rates, change
        self._exec.set_dt(self._dt)

    def release(self) -> None:
        """Allow the aircraft's motion and the fuel flow again."""
        for integrator, saved_value in zip(self._integrators, self._saved_integrators, strict=True):
            integrator(saved_value)
        self._freeze(0.0)


def next_settling_step(steps: Sequence[float], previous_change: Sequence[float], change: Sequence[float]) -> float:
    """Return the next time step for settling rates, s: their estimated time constant, within limits.

    steps: the last two time steps, s.
    previous_change, change: changes of the rates in the step before the last one, and in the last step.

    If the change falls to 0.9 of the previous change in equal steps of 0.2 s, the time constant is 2 s, which is
    limited to 4 times 0.2 s. In an oscillation with -3 times the previous change, the time constant is 0.05 s.

    >>> next_settling_step((0.2, 0.2), (1.0,), (0.9,)), round(next_settling_step((0.2, 0.2), (1.0,), (-3.0,)), 9)
    (0.8, 0.05)
    """
    fastest_index = max(range(len(previous_change)), key=lambda k: abs(previous_change[k]))
    step = steps[1]
    if previous_change[fastest_index] == 0.0 or not math.isfinite(change[fastest_index]):
        return step
    settled_fraction = 1.0 - change[fastest_index] / previous_change[fastest_index] * steps[0] / step
    time_constant = steps[0] / settled_fraction if settled_fraction > 0.0 else math.inf
    min_step, max_step = _SETTLE_STEP_RANGE_S
    return min(max(time_constant, step / _MAX_STEP_CHANGE, min_step), step * _MAX_STEP_CHANGE, max_step)


# Elements of a trim vector (8,), in this order, SI and radians. Climb is the flight-path angle to the air mass, and
# bank a rotation about the velocity; sideslip is zero.
TrimQuantity = Literal["airspeed", "climb", "alpha", "bank", "elevator", "aileron", "rudder", "throttle"]
# The same names as a tuple.
QUANTITIES: tuple[TrimQuantity, ...] = get_args(TrimQuantity)
# Maximum step of Newton's method for each quantity; also the scale of the finite differences.
_MAX_NEWTON_STEP = np.array([4.0, 0.1, 0.1, 0.05, 0.15, 0.05, 0.05, 0.2])
# Finite difference as a ratio to `_MAX_NEWTON_STEP`.
_DIFFERENCE_RATIO = 1e-5
# Maximum acceleration of a converged trim, m/s^2 and rad/s^2.
_MAX_TRIM_ACCELERATION = 1e-8
# Maximum number of Newton steps.
_MAX_ITERATIONS = 40
# Declare no trim after this many failed step halvings. Trims of the catalog's aircraft are found without one.
_MAX_FAILED_HALVINGS = 3
# Declare no trim after this many iterations without halving the residual. For the catalog's aircraft at least every
# fourth step halves it.
_MAX_STALLED_STEPS = 10


def first_guess(airspeed: float) -> Floats:
    """Return a trim vector near level flight at an airspeed (m/s), (8,).

    The angle of attack is 0.06 rad, the elevator -0.15 rad (up), the throttle 0.8, and all other elements are 0.
    """
    return np.array([airspeed, 0.0, 0.06, 0.0, -0.15, 0.0, 0.0, 0.8])


@dataclass(frozen=True, slots=True)
class Trim:
    """A steady straight flight.

    airspeed: m/s.
    amsl: m.
    climb: rad, flight-path angle to the air mass.
    alpha, bank: rad.
    elevator, aileron, rudder: rad.
    throttle: 0..1.
    """

    airspeed: float
    amsl: float
    climb: float
    alpha: float
    bank: float
    elevator: float
    aileron: float
    rudder: float
    throttle: float

    def commands(self) -> Commands:
        """Return elevator, aileron, rudder and throttle of the trim."""
        return Commands(self.elevator, self.aileron, self.rudder, self.throttle)

    def vector(self) -> Floats:
        """Return the trim vector (8,), in the order of `QUANTITIES`."""
        return np.array([getattr(self, quantity) for quantity in QUANTITIES])


class Simulator(Protocol):
    """Interface of a flight-dynamics model for trims; `flight.dynamics.fdm.Fdm` implements it."""

    def move_to(self, amsl: float) -> None:
        """Move the point of evaluation to an altitude, m."""

    def apply_trim(self, values: Floats) -> Floats:
        """Set the state that a trim vector (8,) describes.

        Return its body accelerations (6,), m/s^2 and rad/s^2.
        """

    def surface_limits(self) -> tuple[float, float, float]:
        """Return the elevator, aileron and rudder limits in either direction, rad."""

    def first_guess(self) -> Floats:
        """Return a trim vector (8,) as the initial guess."""

    def derivatives(self, states: Floats, commands: Floats) -> Floats:
        """Return the state derivatives (8,) of (u, v, w, p, q, r, roll, pitch) with these commands (4,)."""


def solve_trim(
    apply_trim: Callable[[Floats], Floats],
    fixed_values: Mapping[TrimQuantity, float],
    limits: tuple[float, float, float],
    start: Floats | None = None,
) -> Floats | None:
    """Find a trim vector (8,) in which two quantities have fixed values; None if the iteration fails.

    apply_trim: function that returns the body accelerations (6,) for a trim vector (8,).
    fixed_values: values of the two fixed quantities.
    limits: elevator, aileron and rudder limits, rad.
    start: first guess, (8,); None for level flight at 25 m/s.

    The method is Newton's method with one-sided differences. Each step is limited to `_MAX_NEWTON_STEP`, and halved
    while it does not reduce the residual. If the iteration ends without convergence, a residual of up to 10 times that
    of a converged trim is accepted.
    """
    values = (first_guess(25.0) if start is None else start).copy()
    for quantity, value in fixed_values.items():
        values[QUANTITIES.index(quantity)] = value
    free_indices = np.array([k for k, quantity in enumerate(QUANTITIES) if quantity not in fixed_values])
    # Airspeed (m/s), climb, angle of attack, bank, elevator, aileron, rudder (rad) and throttle.
    elevator, aileron, rudder = limits
    lower_bounds = np.array([5.0, -1.2, -0.4, -0.5, -elevator, -aileron, -rudder, 0.0])
    upper_bounds = np.array([80.0, 1.2, 0.4, 0.5, elevator, aileron, rudder, 1.0])
    residual = apply_trim(values)
    min_residual, stalled_steps, failed_steps = math.inf, 0, 0
    for _ in range(_MAX_ITERATIONS):
        residual_size = float(np.abs(residual).max())
        if residual_size < _MAX_TRIM_ACCELERATION or not np.isfinite(residual_size):
            break
        min_residual, stalled_steps = (
            (residual_size, 0) if residual_size < 0.5 * min_residual else (min_residual, stalled_steps + 1)
        )
        if residual_size > 10.0 * _MAX_TRIM_ACCELERATION and (
            failed_steps >= _MAX_FAILED_HALVINGS or stalled_steps >= _MAX_STALLED_STEPS
        ):
            break
        columns = []
        for k in free_indices:
            shifted = values.copy()
            # Difference away from the stops: a surface beyond its stop does not move, and its column would be zero.
            difference = _DIFFERENCE_RATIO * _MAX_NEWTON_STEP[k] * (-1.0 if values[k] >= 0.0 else 1.0)
            shifted[k] += difference
            columns.append((apply_trim(shifted) - residual) / difference)
        step = least_squares(np.stack(columns, axis=1), -residual)
        step /= max(1.0, float(np.abs(step / _MAX_NEWTON_STEP[free_indices]).max()))
        for _ in range(6):
            trial = values.copy()
            trial[free_indices] += step
            trial = np.clip(trial, lower_bounds, upper_bounds)
            trial_residual = apply_trim(trial)
            if np.abs(trial_residual).max() < residual_size:
                break
            step = 0.5 * step
        else:
            failed_steps += 1
        values, residual = trial, trial_residual
    return values if np.abs(residual).max() < 10.0 * _MAX_TRIM_ACCELERATION else None


def trim(
    simulator: Simulator, amsl: float, fixed_values: Mapping[TrimQuantity, float], initial_trim: Trim | None = None
) -> Trim | None:
    """Return the steady flight at an altitude with two fixed quantities, or None if no trim is found.

    simulator: JSBSim instance with the aircraft.
    amsl: altitude, m.
    fixed_values: the fixed quantities, by name.
    initial_trim: trim from which the iteration starts; None to start from the simulator's initial guess.
    """
    simulator.move_to(amsl)
    start = initial_trim.vector() if initial_trim else simulator.first_guess()
    values = solve_trim(simulator.apply_trim, fixed_values, simulator.surface_limits(), start)
    return None if values is None else trim_from_vector(values, amsl)


def trim_from_vector(values: Floats, amsl: float) -> Trim:
    """Convert a trim vector, in the order of `QUANTITIES`, and an altitude (m) to a trim."""
    airspeed, climb, alpha, bank, elevator, aileron, rudder, throttle = (float(value) for value in values)
    return Trim(airspeed, amsl, climb, alpha, bank, elevator, aileron, rudder, throttle)


def steady_flight(
    simulator: Simulator, airspeed: float, amsl: float, climb: float = 0.0, initial_trim: Trim | None = None
) -> Trim | None:
    """Return the steady flight at an airspeed, altitude and climb angle, or None if no trim is found.

    simulator: JSBSim instance with the aircraft.
    airspeed: m/s.
    amsl: altitude, m.
    climb: climb angle relative to the air, rad.
    initial_trim: trim from which the iteration starts, or None.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.fdm import Fdm
    >>> model = Fdm(load_aircraft("aerosonde"))
    >>> level = steady_flight(model, 25.0, 500.0)
    >>> 0.3 < level.throttle < 0.9, steady_flight(model, 90.0, 500.0) is None
    (True, True)
    """
    found_trim = trim(simulator, amsl, {"airspeed": airspeed, "climb": climb}, initial_trim)
    if found_trim is None and initial_trim is None:
        # With little excess power the search fails from a distant start, and succeeds from the climb at the same
        # airspeed.
        steepest_climb = full_throttle_climb(simulator, airspeed, amsl)
        if steepest_climb is not None and steepest_climb.climb >= climb:
            found_trim = trim(simulator, amsl, {"airspeed": airspeed, "climb": climb}, steepest_climb)
    return found_trim


def full_throttle_climb(
    simulator: Simulator, airspeed: float, amsl: float, initial_trim: Trim | None = None
) -> Trim | None:
    """Return the steady climb at full throttle, or None if no trim is found.

    simulator: JSBSim instance with the aircraft.
    airspeed: m/s.
    amsl: altitude, m.
    initial_trim: trim from which the iteration starts, or None.
    """
    return trim(simulator, amsl, {"airspeed": airspeed, "throttle": 1.0}, initial_trim)


def idle_descent(simulator: Simulator, airspeed: float, amsl: float, initial_trim: Trim | None = None) -> Trim | None:
    """Return the steady descent with closed throttle, or None if no trim is found.

    simulator: JSBSim instance with the aircraft.
    airspeed: m/s.
    amsl: altitude, m.
    initial_trim: trim from which the iteration starts, or None.
    """
    return trim(simulator, amsl, {"airspeed": airspeed, "throttle": 0.0}, initial_trim)


def fastest_level_flight(simulator: Simulator, amsl: float, initial_trim: Trim | None = None) -> Trim | None:
    """Return level flight at full throttle, or None if no trim is found.

    simulator: JSBSim instance with the aircraft.
    amsl: altitude, m.
    initial_trim: trim from which the iteration starts, or None.
    """
    return trim(simulator, amsl, {"climb": 0.0, "throttle": 1.0}, initial_trim)


def slowest_level_flight(simulator: Simulator, amsl: float, initial_trim: Trim | None = None) -> Trim | None:
    """Return level flight with the elevator at its upper stop, or None if no trim is found.

    simulator: JSBSim instance with the aircraft.
    amsl: altitude, m.
    initial_trim: trim from which the iteration starts, or None.
    """
    return trim(simulator, amsl, {"climb": 0.0, "elevator": -simulator.surface_limits()[0]}, initial_trim)


def linearise(simulator: Simulator, trim_point: Trim) -> tuple[Floats, Floats]:
    """Return matrices A (8, 8) and B (8, 4) of the linear dynamics about a trim, by central differences.

    simulator: JSBSim instance with the aircraft.
    trim_point: the trim.
    The states are u, v, w, p, q, r, roll, pitch (m/s, rad/s, rad; velocity relative to the air). The commands are in
    the order of `flight.dynamics.state.Commands`. Actuators and motor have no lag. Altitude and course are constant.
    """
    simulator.move_to(trim_point.amsl)
    roll, pitch = attitude(trim_point)
    states = np.array(
        [
            trim_point.airspeed * math.cos(trim_point.alpha),
            0.0,
            trim_point.airspeed * math.sin(trim_point.alpha),
            0.0,
            0.0,
            0.0,
            roll,
            pitch,
        ]
    )
    commands = np.array(trim_point.commands())

    def difference_quotient(index: int, vector: Floats, rate: Callable[[Floats], Floats]) -> Floats:
        """Return the central difference quotient of a rate for one element of a vector.

        The element is varied by +-1e-4 in SI units.
        """
        lower, upper = vector.copy(), vector.copy()
        lower[index] -= 1e-4
        upper[index] += 1e-4
        return (rate(upper) - rate(lower)) / 2e-4

    a = [difference_quotient(i, states, lambda shifted: simulator.derivatives(shifted, commands)) for i in range(8)]
    b = [
        difference_quotient(i, commands, lambda shifted: simulator.derivatives(states, shifted))
        for i in range(len(commands))
    ]
    return np.array(a).T, np.array(b).T


def attitude(trim_point: Trim) -> tuple[float, float]:
    """Return the roll and pitch angles of a trim, rad."""
    roll, pitch, _ = euler(body_axes(0.0, trim_point.climb, trim_point.bank, trim_point.alpha))
    return roll, pitch


def body_axes(heading: float, climb: float, bank: float, alpha: float) -> Floats:
    """Return the rotation matrix from body to north-east-down axes in flight without sideslip, (3, 3).

    heading, climb: direction of the velocity relative to the air, rad.
    bank: rotation about the velocity, rad.
    alpha: angle of attack, rad.
    """
    # Without NumPy, whose sines on processors with AVX-512 differ in the last digit from other machines.
    ch = math.cos(heading)
    sh = math.sin(heading)
    cc = math.cos(climb)
    sc = math.sin(climb)
    cb = math.cos(bank)
    sb = math.sin(bank)
    ca = math.cos(alpha)
    sa = math.sin(alpha)
    forward = (ch * cc, sh * cc, -sc)
    level_right = (-sh, ch, 0.0)
    level_down = (ch * sc, sh * sc, cc)
    rows = []
    for forward_part, right_part, level_down_part in zip(forward, level_right, level_down, strict=True):
        down_part = cb * level_down_part - sb * right_part
        rows.append(
            (
                ca * forward_part - sa * down_part,
                cb * right_part + sb * level_down_part,
                sa * forward_part + ca * down_part,
            )
        )
    return np.array(rows)


def euler(axes: Floats) -> tuple[float, float, float]:
    """Return roll, pitch and yaw (rad) of a rotation (3, 3) from body to north-east-down axes."""
    return (
        math.atan2(axes[2, 1], axes[2, 2]),
        math.asin(min(1.0, max(-1.0, -float(axes[2, 0])))),
        math.atan2(axes[1, 0], axes[0, 0]),
    )


def air_velocity(course: float, climb: float, airspeed: float, wind: Floats) -> Floats:
    """Return the velocity relative to the air on a path over the ground, m/s, (3,): north, east, down.

    course, climb: course and slope angle of the path over the ground, rad.
    airspeed: m/s.
    wind: velocity of the air, north, east and down, m/s, (3,).

    Raises FlightError if the airspeed cannot overcome the wind along the path.
    """
    direction = np.array([math.cos(climb) * math.cos(course), math.cos(climb) * math.sin(course), -math.sin(climb)])
    tailwind = float((direction * wind).sum())
    discriminant = airspeed**2 - float((wind * wind).sum()) + tailwind**2
    speed = tailwind + math.sqrt(discriminant) if airspeed > 0.0 and discriminant > 0.0 else -1.0
    if speed <= 0.0:
        raise FlightError(
            f"no progress along the course of {math.degrees(course):.0f} degrees:"
            f" airspeed {airspeed:.1f} m/s is too low for a wind of {float(np.hypot(wind[0], wind[1])):.1f} m/s",
            field="airspeed",
            value=airspeed,
        )
    return speed * direction - wind
