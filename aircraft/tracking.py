"""How an autopilot strays from the legs that it is given, in the numbers that a plan leaves it room by.

What an autopilot makes of a corner, and how late it follows a slope, comes from its own law and parameters; whoever
knows those fills these tables.  Compiled functions take them as one record.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from world.kernels import Record, compiled, inlined, record_dtype

Floats = NDArray[np.float64]


# Turning angles (rad) of the tables: from 0 by equal steps.
TURNS = np.radians(np.linspace(0.0, 150.0, 11))
# Ground speeds of the tables, as shares of the airspeed: from a head wind to a tail wind of 80 % of it.
SPEED_SHARES = np.linspace(0.6, 1.8, 4)
_KNOTS = (TURNS.size, SPEED_SHARES.size)
# For compiled code: what `TrackingError` says, and whether there is anything to leave room for.
TRACKING = record_dtype(
    ("strays", np.bool_),
    "airspeed",
    ("excursion", np.float64, _KNOTS),
    ("before", np.float64, _KNOTS),
    ("after", np.float64, _KNOTS),
    "across",
    "up",
    "lag",
    "step",
)


@dataclass(frozen=True, slots=True)
class TrackingError:
    """How far an autopilot strays from its legs.

    airspeed: equivalent airspeed that it is given, m/s; the true one grows with height.
    acceptance: (t, s) m, at turns `TURNS` and ground speeds `SPEED_SHARES` x airspeed: how far before a corner it is to
    turn to the next leg, so that it strays least.
    excursion: (t, s) m, how far from the legs it then is at most about the corner.
    before, after: (t, s) m of the legs before and after the corner on which it is further from them than it would be on
    a straight leg.
    across, up: m beside a straight leg, and above and below its height, navigation's error included.
    lag: s by which height follows a slope.
    step: m; a leg that changes height by less is flown level, at the height of its end.
    climb_rate, sink_rate: m/s, fastest that the height demand changes; inf for no limit.
    """

    airspeed: float
    acceptance: Floats
    excursion: Floats
    before: Floats
    after: Floats
    across: float
    up: float
    lag: float
    step: float
    climb_rate: float = math.inf
    sink_rate: float = math.inf
    record: Record = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Lock the tables and make the record of them."""
        record = np.zeros(1, TRACKING)
        record["strays"] = True
        for name in ("excursion", "before", "after"):
            record[name] = getattr(self, name)
        for name in ("airspeed", "across", "up", "lag", "step"):
            record[name] = getattr(self, name)
        record.setflags(write=False)
        object.__setattr__(self, "record", record[0])

    def corner_acceptance(self, turn: float, ground_speed: float) -> float:
        """How far before a corner of this turn (rad) to turn at a ground speed (m/s), m."""
        return float(_between(np.ascontiguousarray(self.acceptance), self.airspeed, turn, ground_speed))


def no_tracking() -> Record:
    """The record of an autopilot that holds its path exactly.

    >>> bool(no_tracking().strays)
    False
    """
    record = np.zeros(1, TRACKING)
    record.setflags(write=False)
    return record[0]


def air_density_factor(amsl: float) -> float:
    """True by equivalent airspeed in the standard atmosphere at a height, m above mean sea level.

    >>> round(air_density_factor(0.0), 3), round(air_density_factor(1000.0), 3)
    (1.0, 1.05)
    """
    return float(_density_factor(amsl))


@compiled
def _density_factor(amsl: float) -> float:  # pragma: no cover - compiled
    # Two terms of (1 - 2.2558e-5 h)^-2.128, right to 0.5 % up to 4,000 m, and never a library's power.
    factor: float = 1.0 + amsl * (4.8e-5 + 1.8e-9 * amsl)
    return factor


@inlined
def faster_by(tracking: Record, amsl: float) -> float:  # pragma: no cover - compiled
    """How much faster than its airspeed in numbers it flies at a height, m/s."""
    faster: float = tracking.airspeed * (_density_factor(amsl) - 1.0)
    return faster


@compiled
def _between(table: Floats, airspeed: float, turn: float, ground_speed: float) -> float:  # pragma: no cover - compiled
    """Bilinear in a table (turns, speeds); its nearest edge outside it."""
    turns, speeds = table.shape
    place = min(max(turn / _TURN_STEP, 0.0), turns - 1.0)
    other = min(max((ground_speed / airspeed - _FIRST_SHARE) / _SHARE_STEP, 0.0), speeds - 1.0)
    i, j = min(int(place), turns - 2), min(int(other), speeds - 2)
    v, u = place - i, other - j
    low = table[i, j] + u * (table[i, j + 1] - table[i, j])
    high = table[i + 1, j] + u * (table[i + 1, j + 1] - table[i + 1, j])
    value: float = low + v * (high - low)
    return value


@inlined
def corner_room(
    tracking: Record, turn: float, ground_speed: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Furthest from the legs, and lengths of the legs before and after a corner on which it strays, m.

    turn: rad, positive.  ground_speed: m/s.
    """
    return (
        _between(tracking.excursion, tracking.airspeed, turn, ground_speed),
        _between(tracking.before, tracking.airspeed, turn, ground_speed),
        _between(tracking.after, tracking.airspeed, turn, ground_speed),
    )


_TURN_STEP = float(TURNS[1])
_FIRST_SHARE, _SHARE_STEP = float(SPEED_SHARES[0]), float(SPEED_SHARES[1] - SPEED_SHARES[0])


# ----------------------------------------------------------------------
# The corridor about the legs of a path that a flight has to stay in.

# m.  Half width where a scenario states none: the overshoot of an autopilot that follows the legs at ordinary corners,
# three times over.  The real ArduPlane overshot corners of up to 25 degrees in 5 m/s of wind by at most 10 m.
MIN_CORRIDOR = 30.0
# Radii.  An autopilot that turns as soon as it is a radius from its waypoint cuts a right-angled corner by up to 0.7 of
# that, and swings out beyond the next leg by as much when it turns too late; the rest is for the wind.
CORRIDOR_RADII = 2.0


def corridor_half_width(stated: float | None, acceptance_radius: float | None) -> float:
    """Half width of the corridor, m: the scenario's, or what whoever flies needs.

    stated: of `[limits] corridor_m`, None where there is none.  acceptance_radius: at which the autopilot takes a
    waypoint as reached where the mission states nothing, m; None for a guidance that flies corners as it plans them.

    >>> corridor_half_width(None, None), corridor_half_width(None, 90.0), corridor_half_width(12.0, 90.0)
    (30.0, 180.0, 12.0)
    """
    if stated is not None:
        return stated
    return max(MIN_CORRIDOR, CORRIDOR_RADII * (acceptance_radius or 0.0))
