"""What a log of the field holds, in SI units, whatever program wrote it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Mission
from flight.simulation.field_source import Damage, VerticalDatum

Floats = NDArray[np.float64]

# What kind of vehicle wrote it: "unknown" where the log does not say.
VehicleKind = Literal["plane", "copter", "rover", "boat", "submarine", "tracker", "blimp", "unknown"]

# Columns of each series.
COLUMNS = {
    "position": ("lat", "lon", "up"),
    "velocity": ("east", "north", "up"),
    "attitude": ("roll", "pitch", "yaw"),
    "airspeed": ("true",),
    "wind": ("east", "north"),
    "battery": ("current", "energy"),
    "throttle": ("share",),
    "height": ("up",),
}


@dataclass(frozen=True, slots=True)
class LogSeries:
    """Rows of one kind in the order of the file.

    source: the message they are of, for people: "POS", "vehicle_global_position".
    time: (n,) s on the log's clock, as written.
    values: (n, k), a column for each name of `COLUMNS`: degrees for latitude and longitude, rad for attitude, m, m/s,
    A and Wh for the rest.
    """

    source: str
    time: Floats
    values: Floats


@dataclass(frozen=True, slots=True)
class HeightSource:
    """One of several heights that a log holds.

    datum: of the heights.  series: one column, m.
    """

    name: str
    datum: VerticalDatum
    series: LogSeries


@dataclass(frozen=True, slots=True)
class ModeChange:
    """From when (s) a flight mode held; automatic: the vehicle followed its mission."""

    time: float
    name: str
    automatic: bool


@dataclass(frozen=True, slots=True)
class LoggedMission:
    """A mission as the vehicle had it, from a time (s) on.

    origin: what of the log holds it, for people: "CMD", "MISSION_ITEM_INT", "declared task".
    with_heights: whether its items state heights.
    """

    time: float
    mission: Mission
    origin: str
    with_heights: bool = True


@dataclass(frozen=True, slots=True)
class RawLog:
    """A log as its reader gives it; nothing is put in order yet.

    format: for people: "ArduPilot dataflash log".
    program: what flew, as the log names it; "" where it does not.
    vehicle: what it is.
    series: by the names of `COLUMNS` but "height"; a name that is not there the log does not hold.
    heights: the heights beside that of the position, for comparison.
    datum: of the position's height.
    modes: in order of the file; none of a log without modes.
    missions: in order of the file.
    parameters: by name, the last value of each.
    events: time (s) and text of what the vehicle said.
    clock: "boot" for seconds since the vehicle was switched on, "start" since the first row.
    utc_start: s since 1970 at time 0 of the log's clock; NaN where it is not known.
    clock_jumps: where the log's clock went back for good, s.
    damage: what could not be read.
    """

    source: str
    format: str
    program: str
    vehicle: VehicleKind
    series: Mapping[str, LogSeries]
    heights: tuple[HeightSource, ...]
    datum: VerticalDatum
    modes: tuple[ModeChange, ...] = ()
    missions: tuple[LoggedMission, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    events: tuple[tuple[float, str], ...] = ()
    clock: Literal["boot", "start"] = "boot"
    utc_start: float = math.nan
    clock_jumps: tuple[float, ...] = ()
    damage: Damage = field(default_factory=Damage)
