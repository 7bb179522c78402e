"""Content of an imported log in SI units, common to all programs."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from flight.simulation.setup import Damage, MissingItems, VerticalDatum
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo

# Kind of the vehicle; "unknown" if not logged.
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
# Longest time for which a sample of the current counts, s.
_MAX_SAMPLE_TIME_S = 10.0


@dataclass(frozen=True, slots=True)
class LogSeries:
    """Rows of one kind in the order of the file.

    source: name of the logged message, for people: "POS", "vehicle_global_position".
    time: (n,) s on the log's clock, as written.
    values: (n, k), a column for each name of `COLUMNS`: degrees for latitude and longitude, rad for attitude, m, m/s,
    A and Wh for the rest.
    """

    source: str
    time: Floats
    values: Floats


def with_used_energy(battery: LogSeries) -> LogSeries:
    """Return current, A, and used energy, Wh, (n, 2) from voltage, V, and current (n, 2).

    >>> battery = LogSeries("BAT", np.array([0.0, 1.0, 2.0]), np.array([[36.0, 0.0], [36.0, 100.0], [36.0, 100.0]]))
    >>> with_used_energy(battery).values.tolist()
    [[0.0, 0.0], [100.0, 1.0], [100.0, 2.0]]
    """
    step = np.clip(np.diff(battery.time, prepend=battery.time[0]), 0.0, _MAX_SAMPLE_TIME_S)
    current = np.maximum(battery.values[:, 1], 0.0)
    energy = np.cumsum(current * battery.values[:, 0] * step) / 3600.0
    return LogSeries(battery.source, battery.time, np.stack([current, energy], axis=1))


@dataclass(frozen=True, slots=True)
class HeightSource:
    """One of several altitudes in a log.

    datum: vertical datum of the altitudes.  series: one column, m.
    """

    name: str
    datum: VerticalDatum
    series: LogSeries


@dataclass(frozen=True, slots=True)
class ModeChange:
    """Start of a flight mode.  time: s.  automatic: True if the vehicle follows its mission in this mode."""

    time: float
    name: str
    automatic: bool


@dataclass(frozen=True, slots=True)
class LoggedMission:
    """Mission as the vehicle had it from a time (s) on.

    origin: messages that hold it, for people: "CMD", "MISSION_ITEM_INT", "declared task".
    with_heights: True if its items state altitudes.
    missing: items that the log does not hold; None for a complete mission.  The mission is then the longest run of
    items without a gap, and may have fewer than two.
    """

    time: float
    mission: Mission
    origin: str
    with_heights: bool = True
    missing: MissingItems | None = None


@dataclass(frozen=True, slots=True)
class RawLog:
    """Log as given by its reader; nothing is sorted or cleaned yet.

    format: name of the format, for people: "ArduPilot dataflash log".
    program: name of the program in the log, "" if not logged.
    vehicle: kind of vehicle.
    series: by the names of `COLUMNS` except "height"; a missing name is not in the log.
    heights: altitudes other than the altitude of the position, for comparison.
    datum: vertical datum of the position's altitude.
    modes: in order of the file; empty if not logged.
    missions: in order of the file.
    parameters: by name, the last value of each.
    events: time (s) and text of the vehicle's messages.
    clock: "boot" for seconds since the vehicle was switched on, "start" since the first row.
    utc_start: s since 1970 at time 0 of the log's clock; NaN if not known.
    clock_jumps: times at which the log's clock went back permanently, s.
    damage: parts that could not be read.
    sha256: of the bytes of all files of a log that has several; "" for a log of one file.
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
    sha256: str = ""


# ----------------------------------------------------------------------
# Synthetic log of a short flight, for examples and tests: along two legs at a right angle, in AUTO.

# Airspeed of the example, m/s.
EXAMPLE_SPEED_MPS = 25.0
# Length of a leg, m.
EXAMPLE_LEG_M = 1000.0
# Altitude, m AMSL.
EXAMPLE_ALTITUDE_M = 500.0
# Time between rows, s.
EXAMPLE_STEP_S = 0.2
# Time until the first waypoint is passed, s.
EXAMPLE_LEAD_S = 10.0
# Time after the last waypoint, s.
EXAMPLE_TAIL_S = 2.0


def example_raw_log(lat: float = 46.0, lon: float = 8.0, up: float = EXAMPLE_ALTITUDE_M) -> RawLog:
    """Make a log of a flight 1 km north and 1 km east of a place (degrees, m AMSL), with a sharp corner.

    >>> log = example_raw_log()
    >>> log.program, log.modes[0].name, len(log.missions[0].mission.items)
    ('ArduPlane V4.5.0', 'AUTO', 3)
    """
    time = np.arange(0.0, EXAMPLE_LEAD_S + 2.0 * EXAMPLE_LEG_M / EXAMPLE_SPEED_MPS + EXAMPLE_TAIL_S, EXAMPLE_STEP_S)
    run = EXAMPLE_SPEED_MPS * (time - EXAMPLE_LEAD_S)
    north, east = np.minimum(run, EXAMPLE_LEG_M), np.maximum(run - EXAMPLE_LEG_M, 0.0)
    lats, lons = to_geo(GeoOrigin(lat, lon), east, north)
    course = np.where(run < EXAMPLE_LEG_M, 0.0, 0.5 * math.pi)
    level, boot = np.zeros(time.size), time + 20.0

    def series(name: str, *columns: np.ndarray) -> LogSeries:
        return LogSeries(name, boot, np.column_stack(columns))

    ends = [
        to_geo(GeoOrigin(lat, lon), *place)
        for place in ((0.0, 0.0), (0.0, EXAMPLE_LEG_M), (EXAMPLE_LEG_M, EXAMPLE_LEG_M))
    ]
    items = tuple(
        MissionItem(
            number,
            int(Command.NAV_WAYPOINT),
            int(Frame.GLOBAL),
            (0.0,) * 4,
            round_to_grid(float(y)),
            round_to_grid(float(x)),
            up,
        )
        for number, (y, x) in enumerate(ends, 1)
    )
    home, height = Home(items[0].lat_deg, items[0].lon_deg, up - 100.0), np.full(time.size, up)
    return RawLog(
        source="example.BIN",
        format="ArduPilot dataflash log",
        program="ArduPlane V4.5.0",
        vehicle="plane",
        series={
            "position": series("POS", lats, lons, height),
            "velocity": series("XKF1", EXAMPLE_SPEED_MPS * np.sin(course), EXAMPLE_SPEED_MPS * np.cos(course), level),
            "attitude": series("ATT", level, level + 0.05, course),
            "airspeed": series("ARSP", level + EXAMPLE_SPEED_MPS),
            "wind": series("XKF2", level, level - 3.0),
            "throttle": series("CTUN", level + 0.6),
        },
        heights=(HeightSource("GPS.Alt", "amsl", series("GPS", height + 0.5)),),
        datum="amsl",
        modes=(ModeChange(20.0, "AUTO", True),),
        missions=(LoggedMission(20.0, Mission(home, items, source="example.BIN"), "CMD"),),
        parameters={
            "WP_RADIUS": 60.0,
            "AIRSPEED_CRUISE": 25.0,
            "AIRSPEED_MIN": 18.0,
            "AIRSPEED_MAX": 32.0,
            "ROLL_LIMIT_DEG": 45.0,
        },
        utc_start=1_700_000_000.0,
    )
