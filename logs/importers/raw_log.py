"""Define the data of an imported log in one form, in SI units, for the logs of all programs."""

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
# Longest time for which a current is assumed to have flowed, s.
_MAX_SAMPLE_TIME_S = 10.0


@dataclass(frozen=True, slots=True)
class LogSeries:
    """The rows of one quantity, such as position or attitude, in the order of the file.

    source: name of the logged message, such as "POS" or "vehicle_global_position".
    time: times on the log's clock, as in the file, s, (n,).
    values: one column for each name in `COLUMNS`, (n, k): degrees for latitude and longitude, rad for attitude, m, m/s,
        A, Wh, and a fraction from 0 to 1 for the throttle.
    """

    source: str
    time: Floats
    values: Floats


def with_used_energy(battery: LogSeries) -> LogSeries:
    """Compute the energy that a battery delivered since the first row, from its voltage and current.

    Return the current (A) and the energy used (Wh), (n, 2).  A charging current becomes 0.  After a pause in the log,
    the current is assumed to have flowed for at most `_MAX_SAMPLE_TIME_S`.

    battery: voltage (V) and current (A), (n, 2).

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
    """Altitudes from another source in a log than its positions.

    name: name of the source, such as "GPS.Alt".
    datum: vertical datum of the altitudes.
    series: altitudes, m, (n, 1).
    """

    name: str
    datum: VerticalDatum
    series: LogSeries


@dataclass(frozen=True, slots=True)
class ModeChange:
    """A change to another flight mode.

    time: time of the change on the log's clock, s.
    name: name of the new mode.
    automatic: True if the vehicle follows its mission in this mode.
    """

    time: float
    name: str
    automatic: bool


@dataclass(frozen=True, slots=True)
class LoggedMission:
    """A mission of the vehicle, as logged.

    time: time from which the vehicle had the mission, s.
    mission: the mission.
    origin: name of the log messages with the mission, such as "CMD", "mission items" or "declared task".
    with_heights: True if the items state altitudes.
    missing: items that the log lacks; None for a complete mission.  An incomplete mission is the longest run of items
        with consecutive numbers, and may have fewer than two items.
    """

    time: float
    mission: Mission
    origin: str
    with_heights: bool = True
    missing: MissingItems | None = None


@dataclass(frozen=True, slots=True)
class RawLog:
    """A log as its reader returns it; nothing is sorted or cleaned yet.

    source: path of the log.
    format: name of the format, such as "ArduPilot dataflash log".
    program: name of the program that flew; "" if not logged.
    vehicle: kind of vehicle.
    series: series of each quantity, keyed by its name in `COLUMNS` except "height"; quantities that are not logged are
        absent.
    heights: altitudes from other sources than the position, for comparison.
    datum: vertical datum of the position's altitude.
    modes: mode changes in the order of the file; empty if not logged.
    missions: missions in the order of the file.
    parameters: last value of each parameter of the autopilot, keyed by name.
    events: time (s) and text of the vehicle's messages.
    clock: "boot" if time 0 is when the vehicle was switched on, "start" if it is the first row.
    utc_start: UTC time at time 0 of the log's clock, s since 1970; NaN if unknown.
    clock_jumps: times at which the log's clock went back permanently, s; the reader has removed these jumps.
    damage: parts of the file that could not be read.
    sha256: SHA-256 of all files of a log in several files; "" for a log in one file.
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
# Synthetic log of a short flight in AUTO along two legs at a right angle, for examples and tests.

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
    """Make an example log of a flight along two legs, 1 km north and then 1 km east, with a sharp corner.

    lat, lon, up: first waypoint, degrees and m AMSL.

    >>> log = example_raw_log()
    >>> log.program, log.modes[0].name, len(log.missions[0].mission.items)
    ('ArduPlane V4.5.0', 'AUTO', 3)
    """
    time = np.arange(0.0, EXAMPLE_LEAD_S + 2.0 * EXAMPLE_LEG_M / EXAMPLE_SPEED_MPS + EXAMPLE_TAIL_S, EXAMPLE_STEP_S)
    distance_run = EXAMPLE_SPEED_MPS * (time - EXAMPLE_LEAD_S)
    north = np.minimum(distance_run, EXAMPLE_LEG_M)
    east = np.maximum(distance_run - EXAMPLE_LEG_M, 0.0)
    lats, lons = to_geo(GeoOrigin(lat, lon), east, north)
    course = np.where(distance_run < EXAMPLE_LEG_M, 0.0, 0.5 * math.pi)
    zeros, boot_time = np.zeros(time.size), time + 20.0

    def make_series(name: str, *columns: np.ndarray) -> LogSeries:
        """Make a series of one value for each time of the flight in each column; name: source of the series."""
        return LogSeries(name, boot_time, np.column_stack(columns))

    waypoints = ((0.0, 0.0), (0.0, EXAMPLE_LEG_M), (EXAMPLE_LEG_M, EXAMPLE_LEG_M))
    geo_waypoints = [to_geo(GeoOrigin(lat, lon), *waypoint) for waypoint in waypoints]
    command, frame = int(Command.NAV_WAYPOINT), int(Frame.GLOBAL)
    items = tuple(
        MissionItem(number, command, frame, (0.0,) * 4, round_to_grid(float(y)), round_to_grid(float(x)), up)
        for number, (y, x) in enumerate(geo_waypoints, 1)
    )
    home = Home(items[0].lat_deg, items[0].lon_deg, up - 100.0)
    height = np.full(time.size, up)
    return RawLog(
        source="example.BIN",
        format="ArduPilot dataflash log",
        program="ArduPlane V4.5.0",
        vehicle="plane",
        series={
            "position": make_series("POS", lats, lons, height),
            "velocity": make_series(
                "XKF1", EXAMPLE_SPEED_MPS * np.sin(course), EXAMPLE_SPEED_MPS * np.cos(course), zeros
            ),
            "attitude": make_series("ATT", zeros, zeros + 0.05, course),
            "airspeed": make_series("ARSP", zeros + EXAMPLE_SPEED_MPS),
            "wind": make_series("XKF2", zeros, zeros - 3.0),
            "throttle": make_series("CTUN", zeros + 0.6),
        },
        heights=(HeightSource("GPS.Alt", "amsl", make_series("GPS", height + 0.5)),),
        datum="amsl",
        modes=(ModeChange(20.0, "AUTO", automatic=True),),
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
