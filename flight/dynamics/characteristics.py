"""Compute the flight characteristics of an aircraft's JSBSim model: trims, modes and step responses."""

import math
from dataclasses import dataclass

import numpy as np

from aircraft.catalog import Aircraft
from flight.dynamics.fdm import Fdm
from flight.dynamics.state import STATE
from flight.dynamics.trim import Trim, linearise, steady_flight
from world.arrays import Floats

# Altitude of all measurements, m AMSL.
TRIM_AMSL = 500.0
# Latitude and longitude of all measurements, degrees; step responses are flown due north from there.
_POSITION_DEG = (45.0, 0.0)
# Simulation steps per second.
_RATE_HZ = 120.0
# Time at which a control moves, s.
_STEP_TIME_S = 1.0
# Largest response (rad, m) of a control without effect.
_MIN_RESPONSE = 1e-4
# Mask of the longitudinal states in (u, v, w, p, q, r, roll, pitch); the other states are lateral.
_IS_LONGITUDINAL = np.array([True, False, True, False, True, False, False, True])


@dataclass(frozen=True, slots=True)
class TrimRow:
    """Level flight at one airspeed.

    trim: controls and attitude.
    power: power from the battery, or heat of the fuel, W.
    endurance: time that 80 % of the battery or of the fuel lasts, s; NaN if no power is used.
    """

    trim: Trim
    power: float
    endurance: float


@dataclass(frozen=True, slots=True)
class Mode:
    """A natural mode of the aircraft.

    root: eigenvalue, 1/s; for a complex pair, the eigenvalue with positive imaginary part.
    """

    name: str
    root: complex

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, rad/s; for a real root its magnitude."""
        return abs(self.root)

    @property
    def damping(self) -> float:
        """Damping ratio; 1 or -1 for a real root."""
        return -self.root.real / abs(self.root)

    @property
    def time(self) -> float:
        """Time in which the amplitude halves (unstable root: doubles), s; infinite for a zero real part."""
        return math.log(2.0) / abs(self.root.real) if self.root.real != 0.0 else math.inf


@dataclass(frozen=True, slots=True, eq=False)
class StepResponse:
    """Response to one control, from level flight at cruise.

    control: a field of `flight.dynamics.state.Commands`.
    size: deflection, rad, or fraction of full throttle.
    hold_time: duration of the deflection, s; infinite for a step.
    time: (t,) s.
    quantities: the k fields of `flight.dynamics.state.STATE` that are shown.
    change: (t, k) deviation of these quantities from the trim, SI and radians.
    """

    control: str
    size: float
    hold_time: float
    time: Floats
    quantities: tuple[str, ...]
    change: Floats


def trim_table(aircraft: Aircraft, count: int = 7) -> tuple[TrimRow, ...]:
    """Return level trims and their power at airspeeds from the aircraft's minimum to its maximum.

    An airspeed at which the aircraft cannot hold level flight is left out.

    count: number of evenly spaced airspeeds.

    >>> from aircraft.catalog import load_aircraft
    >>> slow, fast = trim_table(load_aircraft("aerosonde"), 2)
    >>> slow.trim.airspeed, fast.trim.airspeed
    (18.0, 31.0)
    >>> print(f"{slow.power:.0f} W for {slow.endurance / 3600:.1f} hours, or {fast.power:.0f} W")
    190 W for 3.7 hours, or 622 W
    """
    fdm = Fdm(aircraft)
    rows = []
    for airspeed in np.linspace(aircraft.airspeed_min, aircraft.airspeed_max, count):
        trim = steady_flight(fdm, float(airspeed), TRIM_AMSL)
        if trim is None:
            continue
        fdm.apply_trim(trim.vector())
        power = float(fdm.read().power)
        # s, with 80 % of the battery's energy.
        rows.append(TrimRow(trim, power, 0.8 * aircraft.battery_energy / power if power > 0.0 else math.nan))
    return tuple(rows)


def level_flight_modes(aircraft: Aircraft, airspeed: float, amsl: float = TRIM_AMSL) -> tuple[Mode, ...]:
    """Return the named natural modes of level flight at an airspeed (m/s) and an altitude (m AMSL).

    The tuple is empty if the aircraft cannot hold level flight there.

    >>> from aircraft.catalog import load_aircraft
    >>> for mode in level_flight_modes(load_aircraft("aerosonde"), 25.0):
    ...     print(f"{mode.name}: {mode.root:.3g}")
    short period: -4.51+9.48j
    phugoid: -0.132+0.484j
    Dutch roll: -1.07+4.48j
    roll: -20.6+0j
    spiral: 0.0917+0j
    """
    fdm = Fdm(aircraft)
    trim = steady_flight(fdm, airspeed, amsl)
    return () if trim is None else name_modes(linearise(fdm, trim)[0], airspeed)


def name_modes(a: Floats, airspeed: float) -> tuple[Mode, ...]:
    """Return the named modes of an aircraft's linear dynamics.

    a: matrix A (8, 8) of `flight.dynamics.trim.linearise`.
    airspeed: airspeed of the trim, m/s.

    The faster longitudinal mode is the short period, the slower is the phugoid. The faster lateral oscillation is the
    Dutch roll, and a second, slower one is the roll-spiral. Of the lateral real roots, the faster is roll and the
    slower is spiral.
    """
    roots, vectors = np.linalg.eig(a)
    # Convert speeds to angles, so that the components of an eigenvector can be compared.
    magnitudes = np.abs(vectors) / np.array([airspeed] * 3 + [1.0] * 5)[:, None]
    longitudinal_fraction = (magnitudes[_IS_LONGITUDINAL] ** 2).sum(axis=0) / (magnitudes**2).sum(axis=0)
    longitudinal_roots: list[complex] = []
    lateral_roots: list[complex] = []
    for k in np.argsort(-np.abs(roots), kind="stable"):
        # One root of each complex pair.
        if roots[k].imag >= 0.0:
            (longitudinal_roots if longitudinal_fraction[k] > 0.5 else lateral_roots).append(complex(roots[k]))
    modes = [Mode("short period" if k == 0 else "phugoid", root) for k, root in enumerate(longitudinal_roots)]
    oscillations = [root for root in lateral_roots if root.imag > 0.0]
    modes += [Mode("Dutch roll" if k == 0 else "roll-spiral", root) for k, root in enumerate(oscillations)]
    real_roots = [root for root in lateral_roots if root.imag == 0.0]
    modes += [Mode("roll" if k == 0 else "spiral", root) for k, root in enumerate(real_roots)]
    return tuple(modes)


def step_responses(aircraft: Aircraft) -> tuple[StepResponse, ...]:
    """Return the response to each control moved on its own, from level cruise and without guidance.

    Each control moves by a tenth of its travel, because some models have actuators with play, in which a smaller
    movement would be lost. The elevator (up) and the throttle (down if it cannot be opened that much further) stay
    deflected. Aileron and rudder return after a second, because no aircraft stays upright while they are deflected. A
    control without effect, such as the rudder of a flying wing, is left out.

    >>> from aircraft.catalog import load_aircraft
    >>> for step in step_responses(load_aircraft("aerosonde")):
    ...     maximum = abs(step.change[:, 0]).max()
    ...     print(f"{step.control} {step.size:+.3f}: {step.quantities[0]} by up to {maximum:.2f} rad")
    elevator -0.052: pitch by up to 0.15 rad
    throttle +0.100: pitch by up to 0.13 rad
    aileron +0.052: roll by up to 0.87 rad
    rudder +0.052: roll by up to 0.49 rad
    """
    elevator, aileron, rudder = (
        0.1 * max_deflection for max_deflection in (aircraft.max_elevator, aircraft.max_aileron, aircraft.max_rudder)
    )
    level = steady_flight(Fdm(aircraft), aircraft.airspeed, TRIM_AMSL)
    throttle = 0.1 if level is None or level.throttle < 0.9 else -0.1
    longitudinal_quantities = ("pitch", "alpha", "airspeed", "amsl")
    lateral_quantities = ("roll", "roll_rate", "beta", "yaw")
    responses = (
        _step_response(aircraft, "elevator", -elevator, math.inf, 20.0, longitudinal_quantities),
        _step_response(aircraft, "throttle", throttle, math.inf, 20.0, longitudinal_quantities),
        _step_response(aircraft, "aileron", aileron, 1.0, 15.0, lateral_quantities),
        _step_response(aircraft, "rudder", rudder, 1.0, 15.0, ("roll", "yaw_rate", "beta", "yaw")),
    )
    return tuple(response for response in responses if float(np.abs(response.change).max()) > _MIN_RESPONSE)


def _step_response(
    aircraft: Aircraft, control: str, size: float, hold_time: float, duration: float, quantities: tuple[str, ...]
) -> StepResponse:
    """Simulate the response to a pulse of one control that begins after 1 s of level cruise flight.

    control: name of the field of `flight.dynamics.state.Commands` that moves.
    size: deflection, rad, or fraction of full throttle.
    hold_time: time for which the control stays deflected, s.
    duration: duration of the simulation, s.
    quantities: fields of `flight.dynamics.state.STATE` whose changes are returned.
    """
    fdm = Fdm(aircraft, rate_hz=_RATE_HZ)
    commands = fdm.start(*_POSITION_DEG, TRIM_AMSL, 0.0, aircraft.airspeed, terrain_amsl=-1000.0).commands()
    moved_commands = commands._replace(**{control: getattr(commands, control) + size})
    count = round(duration * _RATE_HZ)
    states = np.zeros(count + 1, STATE)
    states[0] = fdm.read()
    for k in range(count):
        fdm.write(moved_commands if _STEP_TIME_S <= k / _RATE_HZ < _STEP_TIME_S + hold_time else commands)
        fdm.step()
        states[k + 1] = fdm.read()
    change = np.column_stack(
        [(np.unwrap(states[name]) if name == "yaw" else states[name]) - states[name][0] for name in quantities]
    )
    return StepResponse(control, size, hold_time, states["time"].copy(), quantities, change)
