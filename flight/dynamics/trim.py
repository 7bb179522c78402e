"""Steady straight flight: the controls and attitude at which nothing accelerates, and the dynamics about it.

A trim has eight quantities, `QUANTITIES`.  Two are held and Newton's method finds the other six, so that the six body
accelerations vanish.  Speeds and angles are relative to the air mass.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from flight.dynamics.jsbsim_properties import RATES
from flight.dynamics.state import Commands
from world.errors import FlightError
from world.least_squares import least_squares

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# A running engine in a JSBSim model: its speed is a state of its own, which settles before anything is measured.

# An engine's speed settles in steps of this, s; at most so many; rates within this, ft/s^2 and rad/s^2, are steady.
_SETTLE_STEP, _SETTLE_STEPS, _SETTLED = 0.2, 300, 1e-10
_RATE_STEPS = 6


class Engine:
    """A running engine that can be let turn until it is steady, while the aircraft stands still in its flow of air.

    fdm: the JSBSim instance.  dt: s, of its flight.  getter, setter: of its properties.
    """

    def __init__(self, fdm: Any, dt: float, getter: Callable[[str], Any], setter: Callable[[str], Any]) -> None:
        self._exec, self._dt = fdm, dt
        kinds = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
        names = [f"simulation/integrator/{kind}" for kind in kinds]
        self._integrators = [setter(name) for name in names]
        self._usual = [getter(name)() for name in names]
        self._rates = [getter(name) for name in RATES[:6]]
        self._freeze = setter("propulsion/fuel_freeze")
        self._start = setter("propulsion/set-running")
        self._running = False

    def hold(self) -> None:
        """Stop the motion of the aircraft and the use of fuel; start the engine if it does not run."""
        for integrator in self._integrators:
            integrator(0.0)
        self._freeze(1.0)
        if not self._running:
            self._exec.run_ic()
            self._start(-1.0)
            self._running = True

    def settle(self, *, spin: bool) -> None:
        """Let the engine take up its speed for the air and the throttle that are set; it keeps its speed without spin.

        Without spin, only what follows its own derivative (the lift of a changing angle of attack) settles.
        """
        self._exec.set_dt(_SETTLE_STEP if spin else 0.0)
        before = [0.0] * 6
        for _ in range(_SETTLE_STEPS if spin else _RATE_STEPS):
            self._exec.run()
            now = [rate() for rate in self._rates]
            # Not by NumPy, which takes as long for six numbers as JSBSim for its step.
            if all(abs(a - b) < _SETTLED for a, b in zip(now, before, strict=True)):
                break
            before = now
        self._exec.set_dt(self._dt)

    def release(self) -> None:
        """Let everything move again."""
        for integrator, usual in zip(self._integrators, self._usual, strict=True):
            integrator(usual)
        self._freeze(0.0)


# Of a trim vector (8,), in this order, SI and radians: climb is the flight-path angle to the air mass, bank turns about
# the velocity; sideslip is zero.
TrimQuantity = Literal["airspeed", "climb", "alpha", "bank", "elevator", "aileron", "rudder", "throttle"]
QUANTITIES: tuple[TrimQuantity, ...] = get_args(TrimQuantity)
# Of the order of one step of Newton's method; also the scale of the finite differences.
_STEP = np.array([4.0, 0.1, 0.1, 0.05, 0.15, 0.05, 0.05, 0.2])
_DIFFERENCE = 1e-5
_CONVERGED = 1e-8  # m/s^2 and rad/s^2
_ITERATIONS = 40
# There is no such flight where steps get nowhere: halved in vain so often, or the accelerations not halved in so many.
# Flights of the catalogue's aircraft are found without a step in vain, and halve them at every fourth step at least.
_IN_VAIN, _WITHOUT_GAIN = 3, 10


def first_guess(airspeed: float) -> Floats:
    """(8,) a trim vector near level flight at an airspeed (m/s)."""
    return np.array([airspeed, 0.0, 0.06, 0.0, -0.15, 0.0, 0.0, 0.8])


@dataclass(frozen=True, slots=True)
class Trim:
    """A steady straight flight.

    airspeed: m/s.  amsl: m.  climb: rad, flight-path angle to the air mass.  alpha, bank: rad.
    elevator, aileron, rudder: rad.  throttle: 0..1.
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
        """The commands that hold it."""
        return Commands(self.elevator, self.aileron, self.rudder, self.throttle)

    def vector(self) -> Floats:
        """(8,) its trim vector, in the order of `QUANTITIES`."""
        return np.array([getattr(self, quantity) for quantity in QUANTITIES])


class Simulator(Protocol):
    """What a trim needs of a flight-dynamics model; `flight.dynamics.fdm.Fdm` has it."""

    def move_to(self, amsl: float) -> None:
        """Move the point of evaluation to this height."""

    def balance(self, values: Floats) -> Floats:
        """(6,) body accelerations, m/s^2 and rad/s^2, of the steady flight with this trim vector (8,)."""

    def surface_limits(self) -> tuple[float, float, float]:
        """Elevator, aileron and rudder limits, rad, either way."""

    def first_guess(self) -> Floats:
        """(8,) a trim vector to start from."""

    def derivatives(self, states: Floats, commands: Floats) -> Floats:
        """(8,) rates of the states (u, v, w, p, q, r, roll, pitch) with surfaces and motor at their commands."""


def solve(
    balance: Callable[[Floats], Floats],
    held: Mapping[TrimQuantity, float],
    limits: tuple[float, float, float],
    start: Floats | None = None,
) -> Floats | None:
    """Return the trim vector (8,) with two quantities held, or None where there is no such flight.

    balance: trim vector -> (6,) accelerations.  limits: of elevator, aileron, rudder.  start: (8,) first guess.
    Newton's method with one-sided differences; a step is cut to `_STEP` and halved while it makes things worse.
    """
    values = (first_guess(25.0) if start is None else start).copy()
    for quantity, value in held.items():
        values[QUANTITIES.index(quantity)] = value
    free = np.array([k for k, quantity in enumerate(QUANTITIES) if quantity not in held])
    lowest, highest = _bounds(limits)
    residual = balance(values)
    least, without_gain, in_vain = math.inf, 0, 0
    for _ in range(_ITERATIONS):
        size = float(np.abs(residual).max())
        if size < _CONVERGED or not np.isfinite(size):
            break
        least, without_gain = (size, 0) if size < 0.5 * least else (least, without_gain + 1)
        if size > 10.0 * _CONVERGED and (in_vain >= _IN_VAIN or without_gain >= _WITHOUT_GAIN):
            break
        columns = []
        for k in free:
            moved = values.copy()
            # Away from the stops: a surface past its stop no longer moves, and its column would be zero.
            difference = _DIFFERENCE * _STEP[k] * (-1.0 if values[k] >= 0.0 else 1.0)
            moved[k] += difference
            columns.append((balance(moved) - residual) / difference)
        step = least_squares(np.stack(columns, axis=1), -residual)
        step /= max(1.0, float(np.abs(step / _STEP[free]).max()))
        for _ in range(6):
            trial = values.copy()
            trial[free] += step
            trial = np.clip(trial, lowest, highest)
            changed = balance(trial)
            if np.abs(changed).max() < size:
                break
            step = 0.5 * step
        else:
            in_vain += 1
        values, residual = trial, changed
    return values if np.abs(residual).max() < 10.0 * _CONVERGED else None


def _bounds(limits: tuple[float, float, float]) -> tuple[Floats, Floats]:
    elevator, aileron, rudder = limits
    lowest = np.array([5.0, -1.2, -0.4, -0.5, -elevator, -aileron, -rudder, 0.0])
    highest = np.array([80.0, 1.2, 0.4, 0.5, elevator, aileron, rudder, 1.0])
    return lowest, highest


def trim(
    simulator: Simulator, amsl: float, held: Mapping[TrimQuantity, float], near: Trim | None = None
) -> Trim | None:
    """Return the steady flight at this height with two of its quantities held, or None if there is none.

    near: a trim to start from.
    """
    simulator.move_to(amsl)
    start = near.vector() if near else simulator.first_guess()
    values = solve(simulator.balance, held, simulator.surface_limits(), start)
    return None if values is None else from_vector(values, amsl)


def from_vector(values: Floats, amsl: float) -> Trim:
    """Return the trim with this vector (8,), in the order of `QUANTITIES`."""
    airspeed, climb, alpha, bank, elevator, aileron, rudder, throttle = (float(value) for value in values)
    return Trim(airspeed, amsl, climb, alpha, bank, elevator, aileron, rudder, throttle)


def straight(
    simulator: Simulator, airspeed: float, amsl: float, climb: float = 0.0, near: Trim | None = None
) -> Trim | None:
    """Steady flight at this airspeed (m/s), height (m) and air-mass path angle (rad); None where there is none.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.fdm import Fdm
    >>> model = Fdm(load_aircraft("aerosonde"))
    >>> level = straight(model, 25.0, 500.0)
    >>> 0.3 < level.throttle < 0.9, straight(model, 90.0, 500.0) is None
    (True, True)
    """
    found = trim(simulator, amsl, {"airspeed": airspeed, "climb": climb}, near)
    if found is None and near is None:
        # With little power to spare the search fails from afar, and succeeds from the climb at the same airspeed.
        steepest = full_throttle(simulator, airspeed, amsl)
        if steepest is not None and steepest.climb >= climb:
            found = trim(simulator, amsl, {"airspeed": airspeed, "climb": climb}, steepest)
    return found


def full_throttle(simulator: Simulator, airspeed: float, amsl: float, near: Trim | None = None) -> Trim | None:
    """Steepest steady climb at this airspeed (m/s) and height (m)."""
    return trim(simulator, amsl, {"airspeed": airspeed, "throttle": 1.0}, near)


def idle(simulator: Simulator, airspeed: float, amsl: float, near: Trim | None = None) -> Trim | None:
    """Steepest steady descent at this airspeed (m/s) and height (m), throttle closed."""
    return trim(simulator, amsl, {"airspeed": airspeed, "throttle": 0.0}, near)


def fastest(simulator: Simulator, amsl: float, near: Trim | None = None) -> Trim | None:
    """Level flight at full throttle."""
    return trim(simulator, amsl, {"climb": 0.0, "throttle": 1.0}, near)


def slowest(simulator: Simulator, amsl: float, near: Trim | None = None) -> Trim | None:
    """Level flight with the elevator at its upper stop."""
    return trim(simulator, amsl, {"climb": 0.0, "elevator": -simulator.surface_limits()[0]}, near)


def linearise(simulator: Simulator, at: Trim) -> tuple[Floats, Floats]:
    """Return A (8, 8) and B (8, 4) about a trim, by central differences.

    States u, v, w, p, q, r, roll, pitch (m/s, rad/s, rad; velocity relative to the air); commands in the order of
    `flight.dynamics.state.Commands`, with actuator and motor lags left out.  Height and course are held.
    """
    simulator.move_to(at.amsl)
    roll, pitch = attitude(at)
    states = np.array(
        [at.airspeed * math.cos(at.alpha), 0.0, at.airspeed * math.sin(at.alpha), 0.0, 0.0, 0.0, roll, pitch]
    )
    commands = np.array(at.commands())

    def column(index: int, vector: Floats, rate: Callable[[Floats], Floats]) -> Floats:
        low, high = vector.copy(), vector.copy()
        low[index] -= 1e-4
        high[index] += 1e-4
        return (rate(high) - rate(low)) / 2e-4

    a = [column(i, states, lambda moved: simulator.derivatives(moved, commands)) for i in range(8)]
    b = [column(i, commands, lambda moved: simulator.derivatives(states, moved)) for i in range(len(commands))]
    return np.array(a).T, np.array(b).T


def attitude(at: Trim) -> tuple[float, float]:
    """Roll and pitch of a trim, rad."""
    roll, pitch, _ = euler(body_axes(0.0, at.climb, at.bank, at.alpha))
    return roll, pitch


def body_axes(heading: float, climb: float, bank: float, alpha: float) -> Floats:
    """(3, 3) rotation from body to north-east-down axes for a velocity along ``heading`` and ``climb``, no sideslip."""
    # Not by NumPy, whose sines of processors with AVX-512 differ in the last digit from others'.
    ch, sh, cc, sc = math.cos(heading), math.sin(heading), math.cos(climb), math.sin(climb)
    cb, sb, ca, sa = math.cos(bank), math.sin(bank), math.cos(alpha), math.sin(alpha)
    forward = (ch * cc, sh * cc, -sc)
    level_right = (-sh, ch, 0.0)
    level_down = (ch * sc, sh * sc, cc)
    rows = []
    for ahead, aside, below in zip(forward, level_right, level_down, strict=True):
        down = cb * below - sb * aside
        rows.append((ca * ahead - sa * down, cb * aside + sb * below, sa * ahead + ca * down))
    return np.array(rows)


def euler(axes: Floats) -> tuple[float, float, float]:
    """Roll, pitch and yaw, rad, of a rotation (3, 3) from body to north-east-down axes."""
    return (
        math.atan2(axes[2, 1], axes[2, 2]),
        math.asin(min(1.0, max(-1.0, -float(axes[2, 0])))),
        math.atan2(axes[1, 0], axes[0, 0]),
    )


def air_velocity(course: float, climb: float, airspeed: float, wind: Floats) -> Floats:
    """Velocity relative to the air, (3,) north, east, down, of a path over the ground in a wind.

    course, climb: rad, of the path.  airspeed: m/s.  wind: (3,) m/s, the way the air moves.
    Raises FlightError where the airspeed makes no way against the wind.
    """
    along = np.array([math.cos(climb) * math.cos(course), math.cos(climb) * math.sin(course), -math.sin(climb)])
    tailwind = float((along * wind).sum())
    square = airspeed**2 - float((wind * wind).sum()) + tailwind**2
    speed = tailwind + math.sqrt(square) if airspeed > 0.0 and square > 0.0 else -1.0
    if speed <= 0.0:
        raise FlightError(
            f"no way made along the course of {math.degrees(course):.0f} degrees:"
            f" airspeed {airspeed:.1f} m/s in {float(np.hypot(wind[0], wind[1])):.1f} m/s of wind",
            field="airspeed", value=airspeed,
        )  # fmt: skip
    velocity: Floats = speed * along - wind
    return velocity
