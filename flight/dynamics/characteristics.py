"""What an aircraft is like: its trims, its modes and how it answers each control, measured on its JSBSim model."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from flight.dynamics.fdm import Fdm
from flight.dynamics.state import STATE_SIZE, C, S
from flight.dynamics.trim import Trim, linearise, straight

Floats = NDArray[np.float64]

# Height of the portrait, m above sea level.
AMSL = 500.0
# Course of the steps and place of all measurements: due north at 45 degrees latitude.
_PLACE = (45.0, 0.0)
_RATE_HZ = 120.0
_STEP_AT = 1.0
# Columns of the longitudinal states in (u, v, w, p, q, r, roll, pitch); the other half is lateral.
_LONGITUDINAL = np.array([True, False, True, False, True, False, False, True])


@dataclass(frozen=True, slots=True)
class TrimRow:
    """Level flight: its trim, the power it takes (W, from the battery or as heat of fuel) and how long that lasts (s).

    endurance counts 80 % of the battery or the fuel; NaN where no power is used.
    """

    trim: Trim
    power: float
    endurance: float


@dataclass(frozen=True, slots=True)
class Mode:
    """A way in which the aircraft answers a disturbance.  root: 1/s, that of a pair with a positive imaginary part."""

    name: str
    root: complex

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, rad/s; for a real root its size."""
        return abs(self.root)

    @property
    def damping(self) -> float:
        """Damping ratio; 1 or -1 for a real root."""
        return -self.root.real / abs(self.root)

    @property
    def time(self) -> float:
        """Seconds to half the amplitude, or to double it if the root is unstable."""
        return math.log(2.0) / abs(self.root.real) if self.root.real != 0.0 else math.inf


@dataclass(frozen=True, slots=True)
class StepResponse:
    """The answer to one control, from level flight at cruise.

    control: which.  size: by how much it moved (rad, or of full throttle).  held: s; infinite for a step that stays.
    time: (t,) s.  change: (t, k) of the state rows `rows` from the trim, SI and radians.
    """

    control: C
    size: float
    held: float
    time: Floats
    rows: tuple[S, ...]
    change: Floats


def trim_table(aircraft: Aircraft, count: int = 7) -> tuple[TrimRow, ...]:
    """Level flight over the speeds that guidance may use, where there is a trim."""
    fdm = Fdm(aircraft)
    rows = []
    state = np.zeros(STATE_SIZE)
    for airspeed in np.linspace(aircraft.airspeed_min, aircraft.airspeed_max, count):
        found = straight(fdm, float(airspeed), AMSL)
        if found is None:
            continue
        fdm.balance(found.vector())
        fdm.read(state)
        power = float(state[S.POWER])
        rows.append(TrimRow(found, power, 0.8 * aircraft.battery_energy / power if power > 0.0 else math.nan))
    return tuple(rows)


def modes_at(aircraft: Aircraft, airspeed: float, amsl: float = AMSL) -> tuple[Mode, ...]:
    """The named modes of level flight at this airspeed (m/s) and height (m), empty where there is no such flight."""
    fdm = Fdm(aircraft)
    found = straight(fdm, airspeed, amsl)
    return () if found is None else name_modes(linearise(fdm, found)[0], airspeed)


def name_modes(a: Floats, airspeed: float) -> tuple[Mode, ...]:
    """Name the modes of A (8, 8), states as in `flight.dynamics.trim.linearise`, by where their eigenvectors live.

    Longitudinal, from fast to slow: short period, phugoid.  Lateral: an oscillation is the Dutch roll, a slower one
    beside it roll-spiral; of the real roots the faster is roll, the slower spiral.
    """
    roots, vectors = np.linalg.eig(a)
    # Speeds as angles, so that the parts of an eigenvector can be compared.
    sizes = np.abs(vectors) / np.array([airspeed] * 3 + [1.0] * 5)[:, None]
    share = (sizes[_LONGITUDINAL] ** 2).sum(axis=0) / (sizes**2).sum(axis=0)
    along: list[complex] = []
    aside: list[complex] = []
    for k in np.argsort(-np.abs(roots), kind="stable"):
        # One of each pair.
        if roots[k].imag >= 0.0:
            (along if share[k] > 0.5 else aside).append(complex(roots[k]))
    modes = [Mode("short period" if k == 0 else "phugoid", root) for k, root in enumerate(along)]
    pairs = [root for root in aside if root.imag > 0.0]
    modes += [Mode("Dutch roll" if k == 0 else "roll-spiral", root) for k, root in enumerate(pairs)]
    real = [root for root in aside if root.imag == 0.0]
    modes += [Mode("roll" if k == 0 else "spiral", root) for k, root in enumerate(real)]
    return tuple(modes)


def step_responses(aircraft: Aircraft) -> tuple[StepResponse, ...]:
    """Move each control alone, with no guidance, from level flight at cruise.

    Each moves by a tenth of its travel: less would be lost in the play of some models' actuators.  Elevator (up) and
    throttle (down where there is not that much left) stay; aileron and rudder come back after a second, because no
    aircraft stays upright with them held.
    """
    elevator, aileron, rudder = (
        0.1 * most for most in (aircraft.max_elevator, aircraft.max_aileron, aircraft.max_rudder)
    )
    level = straight(Fdm(aircraft), aircraft.airspeed, AMSL)
    throttle = 0.1 if level is None or level.throttle < 0.9 else -0.1
    return (
        _respond(aircraft, C.ELEVATOR, -elevator, math.inf, 20.0, (S.PITCH, S.ALPHA, S.AIRSPEED, S.AMSL)),
        _respond(aircraft, C.THROTTLE, throttle, math.inf, 20.0, (S.PITCH, S.ALPHA, S.AIRSPEED, S.AMSL)),
        _respond(aircraft, C.AILERON, aileron, 1.0, 15.0, (S.ROLL, S.P, S.BETA, S.YAW)),
        _respond(aircraft, C.RUDDER, rudder, 1.0, 15.0, (S.ROLL, S.R, S.BETA, S.YAW)),
    )


def _respond(
    aircraft: Aircraft, control: C, size: float, held: float, seconds: float, rows: tuple[S, ...]
) -> StepResponse:
    fdm = Fdm(aircraft, rate_hz=_RATE_HZ)
    commands = fdm.start(*_PLACE, AMSL, 0.0, aircraft.airspeed, terrain_amsl=-1000.0).commands()
    count = round(seconds * _RATE_HZ)
    states = np.zeros((count + 1, STATE_SIZE))
    fdm.read(states[0])
    for k in range(count):
        time = k / _RATE_HZ
        moved = commands.copy()
        moved[control] += size if _STEP_AT <= time < _STEP_AT + held else 0.0
        fdm.write(moved)
        fdm.step()
        fdm.read(states[k + 1])
    columns = np.array(rows)
    change = states[:, columns] - states[0, columns]
    if S.YAW in rows:
        yaw = rows.index(S.YAW)
        change[:, yaw] = np.unwrap(states[:, S.YAW]) - states[0, S.YAW]
    return StepResponse(control, size, held, states[:, S.TIME].copy(), rows, change)
