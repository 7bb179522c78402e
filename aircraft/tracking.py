"""Define the tracking error of an autopilot.

It is the deviation from the legs, for which plans reserve margins.

The path of an autopilot at a corner, and the lag with which its altitude follows a slope, depend on its controllers and
parameters; the module of each autopilot fills these tables. Compiled functions take the tables as one record.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from world.arrays import Floats
from world.kernels import Record, compiled, inlined, record_dtype

# Turn angles of the tables, from 0 in equal steps, rad.
TURNS = np.radians(np.linspace(0.0, 150.0, 11))
# Ground speeds of the tables as ratios to the airspeed: from a headwind of 40 % to a tailwind of 80 % of the airspeed.
SPEED_RATIOS = np.linspace(0.6, 1.8, 4)
# Shape of the tables.
_TABLE_SHAPE = (TURNS.size, SPEED_RATIOS.size)
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


@dataclass(frozen=True, slots=True, eq=False)
class TrackingError:
    """Deviation of an autopilot from its legs.

    All tables have the shape (t, s), for the turns `TURNS` and the ground speeds `SPEED_RATIOS` x airspeed.

    airspeed: equivalent airspeed command, m/s; the true airspeed increases with altitude.
    acceptance: acceptance radius at which the autopilot deviates least from the legs at a corner, m.
    excursion: maximum distance from the legs near the corner with that acceptance radius, m.
    before, after: lengths of the legs before and after the corner on which the deviation is larger than on a straight
        leg, m.
    across, up: lateral and vertical deviation from a straight leg, m, including navigation error.
    lag: time by which the altitude lags behind a slope, s.
    step: minimum altitude change of a leg that is flown as a slope, m; a smaller change is flown as a step.
    climb_rate, sink_rate: maximum rates of the altitude demand, m/s; inf for no limit.
    own_climb_share, own_sink_share: fractions (0..1) of the aircraft's steepest climb and descent up to which the
        aircraft stays near its demanded altitude in gusts.
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
        """Copy the tables into the record."""
        record = np.zeros(1, TRACKING)
        record["has_error"] = True
        for name in ("excursion", "before", "after"):
            record[name] = getattr(self, name)
        for name in ("airspeed", "across", "up", "lag", "step"):
            record[name] = getattr(self, name)
        record.setflags(write=False)
        object.__setattr__(self, "record", record[0])

    def corner_acceptance(self, turn: float, ground_speed: float) -> float:
        """Return the acceptance radius at a corner for a turn (rad) and a ground speed (m/s), m."""
        return float(_interpolate(np.ascontiguousarray(self.acceptance), self.airspeed, turn, ground_speed))

    def corner_excursion(self, turn: float, ground_speed: float) -> float:
        """Return the maximum distance from the legs at a corner for a turn (rad) and a ground speed (m/s), m."""
        return float(_interpolate(np.ascontiguousarray(self.excursion), self.airspeed, turn, ground_speed))


def zero_tracking_error() -> Record:
    """Return the tracking-error record of an autopilot that follows its path exactly.

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
    """Return the ratio of true to equivalent airspeed at an altitude, m AMSL, in compiled functions."""
    # Two terms of (1 - 2.2558e-5 h)^-2.128, accurate to 0.5 % up to 4,000 m; a library's power rounds differently on
    # different machines.
    return 1.0 + amsl * (4.8e-5 + 1.8e-9 * amsl)


@compiled
def _interpolate(table: Floats, airspeed: float, turn: float, ground_speed: float) -> float:
    """Interpolate a table of shape (turns, speeds) bilinearly; outside the table use the nearest edge.

    turn: rad.
    ground_speed: m/s; the table is indexed by `ground_speed / airspeed`.
    """
    turns, speeds = table.shape
    turn_position = min(max(turn / _TURN_STEP_RAD, 0.0), turns - 1.0)
    speed_position = min(max((ground_speed / airspeed - _FIRST_SPEED_RATIO) / _SPEED_RATIO_STEP, 0.0), speeds - 1.0)
    turn_index, speed_index = min(int(turn_position), turns - 2), min(int(speed_position), speeds - 2)
    turn_fraction, speed_fraction = turn_position - turn_index, speed_position - speed_index
    lower_value = table[turn_index, speed_index] + speed_fraction * (
        table[turn_index, speed_index + 1] - table[turn_index, speed_index]
    )
    upper_value = table[turn_index + 1, speed_index] + speed_fraction * (
        table[turn_index + 1, speed_index + 1] - table[turn_index + 1, speed_index]
    )
    return lower_value + turn_fraction * (upper_value - lower_value)


@inlined
def corner_deviation(tracking: Record, turn: float, ground_speed: float) -> tuple[float, float, float]:
    """Return the maximum distance from the legs at a corner, and the affected length of each leg, m.

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
# First of `SPEED_RATIOS`.
_FIRST_SPEED_RATIO = float(SPEED_RATIOS[0])
# Step of `SPEED_RATIOS`.
_SPEED_RATIO_STEP = float(SPEED_RATIOS[1] - SPEED_RATIOS[0])


# --- Corridor ---

# Default half-width, m: three times the overshoot of an autopilot at ordinary corners. ArduPlane in SITL overshot
# corners of up to 25 degrees in 5 m/s of wind by at most 10 m.
MIN_CORRIDOR = 30.0
# Minimum half-width in acceptance radii. An autopilot that turns one radius before its waypoint cuts a right-angled
# corner by up to 0.7 radii, and overshoots the next leg by the same distance if it turns late; the rest is for wind.
CORRIDOR_RADII = 2.0


def corridor_half_width(stated_half_width: float | None, acceptance_radius: float | None) -> float:
    """Return the half-width of the corridor around the legs of a path, m.

    stated_half_width: the scenario's `[limits] corridor_m`, which is returned; None if not stated.
    acceptance_radius: default acceptance radius of the autopilot, from which the half-width is computed otherwise, m;
        None for guidance that flies corners as planned.

    >>> corridor_half_width(None, None), corridor_half_width(None, 90.0), corridor_half_width(12.0, 90.0)
    (30.0, 180.0, 12.0)
    """
    if stated_half_width is not None:
        return stated_half_width
    return max(MIN_CORRIDOR, CORRIDOR_RADII * (acceptance_radius or 0.0))
