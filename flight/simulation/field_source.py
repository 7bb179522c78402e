"""Where a flight is from that was not flown by planfly: a log of the field, and what that log can carry."""

import math
from dataclasses import dataclass, field
from typing import Literal

# "amsl": above mean sea level as the vehicle has it.  "ellipsoid": above WGS 84's.  "pressure": above the level of
# 1013.25 hPa.  "unstated": the log does not say.
VerticalDatum = Literal["amsl", "ellipsoid", "pressure", "unstated"]

# What rules ask for beside a time and a place.
Quantity = Literal["attitude", "airspeed", "wind", "battery", "throttle", "heights", "velocity"]

# Why a stretch ended: another mode was set, the log ends, the aircraft had landed.
StretchEnd = Literal["mode", "log", "landed"]


@dataclass(frozen=True, slots=True)
class MissionStretch:
    """A stretch flown along the mission.

    start, end: s of the log's clock.
    mode: the vehicle's name for it, "" of a log that knows no modes.
    ended: why it ended.
    next_mode: the mode that was set, "" where none was.
    """

    start: float
    end: float
    mode: str
    ended: StretchEnd
    next_mode: str = ""


@dataclass(frozen=True, slots=True)
class HeightOffset:
    """How much higher another height of the log was than the one taken, m, at the start of what is judged."""

    name: str
    offset: float


@dataclass(frozen=True, slots=True)
class Heights:
    """Which of a log's heights was taken.

    source: the message and field.  datum: vertical datum.
    offsets: of the log's other heights.
    """

    source: str
    datum: VerticalDatum
    offsets: tuple[HeightOffset, ...] = ()


@dataclass(frozen=True, slots=True)
class Damage:
    """What of a file could not be read.

    places: how many stretches of it.  size: their bytes.  cut: it ends within a message.  unreadable: messages that
    were whole and held no numbers that could be used.
    """

    places: int = 0
    size: int = 0
    cut: bool = False
    unreadable: int = 0

    @property
    def lossy(self) -> bool:
        """Whether anything but the file's end is lost."""
        return self.places > 0 or self.unreadable > 0


@dataclass(frozen=True, slots=True)
class RowFaults:
    """What was wrong with a log's rows, and how often.

    doubled: rows that came twice.  unordered: rows out of the order of their times.  unusable: rows without a place.
    glitches: places that the aircraft cannot have been at.  clock_jumps: times (s) at which the clock jumped.
    """

    doubled: int = 0
    unordered: int = 0
    unusable: int = 0
    glitches: int = 0
    clock_jumps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Gap:
    """A pause (s) between two rows."""

    start: float
    end: float


@dataclass(frozen=True, slots=True)
class FieldSource:
    """A log of the field as the source of a flight.

    file: its name.  sha256: of its bytes.
    format: for people.  program: what flew, "" where the log does not say.
    utc_start: s since 1970 at time 0; NaN where it is not known.
    holds: what the log holds beside times and places, and the plan of heights.
    stretches: what is judged; the rest is shown.
    heights: which was taken.
    wind: where the wind is from: "XKF2", "" for none.
    mission: where the mission is from: "CMD of the log, at 22.4 s", or a file.
    plan_heights: whether the mission states heights.
    aircraft_known: whether the aircraft was named; if not, none of its limits count.
    gaps: pauses between rows, over the whole of what was imported.
    faults: of its rows.  damage: of the file.
    notes: what else a person should know, in sentences.

    >>> FieldSource("a.BIN", "", "ArduPilot dataflash log", "ArduPlane V4.6.0", holds=("attitude",)).holds
    ('attitude',)
    """

    file: str
    sha256: str
    format: str
    program: str = ""
    utc_start: float = math.nan
    holds: tuple[Quantity, ...] = ()
    stretches: tuple[MissionStretch, ...] = ()
    heights: Heights = field(default_factory=lambda: Heights("", "unstated"))
    wind: str = ""
    mission: str = ""
    plan_heights: bool = True
    aircraft_known: bool = False
    gaps: tuple[Gap, ...] = ()
    faults: RowFaults = field(default_factory=RowFaults)
    damage: Damage = field(default_factory=Damage)
    notes: tuple[str, ...] = ()
