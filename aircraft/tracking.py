"""Tracking error of an autopilot: its deviation from its legs, for which plans reserve margins.

The behavior of an autopilot at a corner, and the lag with which its altitude follows a slope, come from its own control
law and parameters; an autopilot's module fills these tables from them. Compiled functions take them as one record.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from world.arrays import Floats
from world.kernels import Record, compiled, inlined, record_dtype

# Turn angles of the tables, from 0 in equal steps, rad.
TURNS = np.radians(np.linspace(0.0, 150.0, 11))
# Ground speeds of the tables, as ratios to the airspeed: from a headwind of 40 % to a tailwind of 80 % of it.
SPEED_SHARES = np.linspace(0.6, 1.8, 4)
# Shape of the tables.
_TABLE_SHAPE = (TURNS.size, SPEED_SHARES.size)
# `TrackingError` for compiled code; `has_error` is False for an autopilot without tracking error.
TRACKING = record_dtype(
    ("has_error", np.bool_),
    "airspeed",
    ("excursion", np.float64, _TABLE_SHAPE),
    ("before", np.float64, _TABLE_SHAPE),
    ("after", np.float64, _TABLE_SHAPE),
    "across",
    "up",
    "lag",
    "step",
)


@dataclass(frozen=True, slots=True)
class TrackingError:
    """Deviation of an autopilot from its legs.

    airspeed: equivalent airspeed command, m/s; the true airspeed increases with altitude.
    acceptance: (t, s) m, at turns `TURNS` and ground speeds `SPEED_SHARES` x airspeed: distance before a corner at
        which turning to the next leg gives the smallest deviation.
    excursion: (t, s) m, largest distance from the legs near the corner with that acceptance.
    before, after: (t, s) m, lengths of the legs before and after the corner on which the deviation exceeds the
        deviation on a straight leg.
    across, up: lateral and vertical deviation from a straight leg, m, including navigation error.
    lag: time by which the altitude lags behind a slope, s.
    step: smallest altitude change of a leg that is not flown level at its final altitude, m.
    climb_rate, sink_rate: fastest change of the altitude demand, m/s; inf for no limit.
    own_climb_share, own_sink_share: fractions (0..1) of the aircraft's steepest climb and descent at which it stays
        near its altitude in gusts.
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
    own_climb_share: float = 1.0
    own_sink_share: float = 1.0
    record: Record = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Create the record of the tables."""
        record = np.zeros(1, TRACKING)
        record["has_error"] = True
        for name in ("excursion", "before", "after"):
            record[name] = getattr(self, name)
        for name in ("airspeed", "across", "up", "lag", "step"):
            record[name] = getattr(self, name)
        record.setflags(write=False)
        object.__setattr__(self, "record", record[0])

    def corner_acceptance(self, turn: float, ground_speed: float) -> float:
        """Return the acceptance distance before a corner for a turn (rad) and a ground speed (m/s), m."""
        return float(_interpolate(np.ascontiguousarray(self.acceptance), self.airspeed, turn, ground_speed))

    def corner_excursion(self, turn: float, ground_speed: float) -> float:
        """Return the largest distance from the legs at a corner of this turn (rad) at a ground speed (m/s), m."""
        return float(_interpolate(np.ascontiguousarray(self.excursion), self.airspeed, turn, ground_speed))


def zero_tracking_error() -> Record:
    """Return the record of an autopilot that follows its path exactly.

    >>> bool(zero_tracking_error().has_error)
    False
    """
    record = np.zeros(1, TRACKING)
    record.setflags(write=False)
    return record[0]


def air_density_factor(amsl: float) -> float:
    """Return the ratio of true to equivalent airspeed in the standard atmosphere at an altitude, m AMSL.

    >>> round(air_density_factor(0.0), 3), round(air_density_factor(1000.0), 3)
    (1.0, 1.05)
    """
    return float(density_factor(amsl))


@compiled
def density_factor(amsl: float) -> float:
    """Return the same ratio as `air_density_factor`, for compiled functions."""
    # Two terms of (1 - 2.2558e-5 h)^-2.128, accurate to 0.5 % up to 4,000 m; a library's power rounds differently on
    # different machines.
    return 1.0 + amsl * (4.8e-5 + 1.8e-9 * amsl)


@compiled
def _interpolate(table: Floats, airspeed: float, turn: float, ground_speed: float) -> float:
    """Interpolate bilinearly in a table (turns, speeds); use its nearest edge outside it."""
    turns, speeds = table.shape
    turn_position = min(max(turn / _TURN_STEP_RAD, 0.0), turns - 1.0)
    speed_position = min(max((ground_speed / airspeed - _FIRST_SPEED_RATIO) / _SPEED_RATIO_STEP, 0.0), speeds - 1.0)
    i, j = min(int(turn_position), turns - 2), min(int(speed_position), speeds - 2)
    v, u = turn_position - i, speed_position - j
    lower_value = table[i, j] + u * (table[i, j + 1] - table[i, j])
    upper_value = table[i + 1, j] + u * (table[i + 1, j + 1] - table[i + 1, j])
    return lower_value + v * (upper_value - lower_value)


@inlined
def corner_deviation(tracking: Record, turn: float, ground_speed: float) -> tuple[float, float, float]:
    """Return the largest distance from the legs at a corner, and the affected lengths around it, m.

    The first affected length is on the leg before the corner, the second on the leg after it.

    turn: rad, positive.
    ground_speed: m/s.
    """
    return (
        _interpolate(tracking.excursion, tracking.airspeed, turn, ground_speed),
        _interpolate(tracking.before, tracking.airspeed, turn, ground_speed),
        _interpolate(tracking.after, tracking.airspeed, turn, ground_speed),
    )


# Step of `TURNS`, rad.
_TURN_STEP_RAD = float(TURNS[1])
# First of `SPEED_SHARES`.
_FIRST_SPEED_RATIO = float(SPEED_SHARES[0])
# Step of `SPEED_SHARES`.
_SPEED_RATIO_STEP = float(SPEED_SHARES[1] - SPEED_SHARES[0])


# --- Corridor ---

# Half-width if a scenario states none, m: three times the overshoot of an autopilot at ordinary corners. ArduPlane in
# SITL overshot corners of up to 25 degrees in 5 m/s of wind by at most 10 m.
MIN_CORRIDOR = 30.0
# Half-width in acceptance radii. An autopilot that turns one radius before its waypoint cuts a right-angled corner by
# up to 0.7 radii, and overshoots the next leg by as much if it turns late; the rest is for wind.
CORRIDOR_RADII = 2.0


def corridor_half_width(stated_half_width: float | None, acceptance_radius: float | None) -> float:
    """Return the half-width of the corridor around the legs of a path, m.

    It is stated by the scenario, or follows from the autopilot's acceptance radius.
    stated_half_width: `[limits] corridor_m`, None if not stated.
    acceptance_radius: radius at which the autopilot accepts a waypoint unless the mission states another, m; None for
        guidance that flies corners as planned.

    >>> corridor_half_width(None, None), corridor_half_width(None, 90.0), corridor_half_width(12.0, 90.0)
    (30.0, 180.0, 12.0)
    """
    if stated_half_width is not None:
        return stated_half_width
    return max(MIN_CORRIDOR, CORRIDOR_RADII * (acceptance_radius or 0.0))
