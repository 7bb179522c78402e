"""A log of a short flight that nobody flew, for examples and tests: along two legs at a right angle, in AUTO."""

import math

import numpy as np

from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from logs.field_logs.raw_log import HeightSource, LoggedMission, LogSeries, ModeChange, RawLog
from world.frames import GeoOrigin, to_geo

# m/s, m.
SPEED, LEG, UP = 25.0, 1000.0, 500.0
# s, between rows; until the first waypoint is passed, and after the last.
STEP, BEFORE, AFTER = 0.2, 10.0, 2.0


def example_raw_log(lat: float = 46.0, lon: float = 8.0, up: float = UP) -> RawLog:
    """North for 1 km and east for as much from a place (degrees) at a height (m AMSL), the corner as sharp as none is.

    >>> log = example_raw_log()
    >>> log.program, log.modes[0].name, len(log.missions[0].mission.items)
    ('ArduPlane V4.5.0', 'AUTO', 3)
    """
    time = np.arange(0.0, BEFORE + 2.0 * LEG / SPEED + AFTER, STEP)
    run = SPEED * (time - BEFORE)
    north, east = np.minimum(run, LEG), np.maximum(run - LEG, 0.0)
    lats, lons = to_geo(GeoOrigin(lat, lon), east, north)
    on_first = run < LEG
    course = np.where(on_first, 0.0, 0.5 * math.pi)
    level = np.zeros(time.size)
    boot = time + 20.0

    def series(name: str, *columns: np.ndarray) -> LogSeries:
        return LogSeries(name, boot, np.column_stack(columns))

    ends = [to_geo(GeoOrigin(lat, lon), *place) for place in ((0.0, 0.0), (0.0, LEG), (LEG, LEG))]
    items = tuple(
        MissionItem(
            number, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, on_grid(float(y)), on_grid(float(x)), up
        )
        for number, (y, x) in enumerate(ends, 1)
    )
    home = Home(items[0].lat_deg, items[0].lon_deg, up - 100.0)
    height = np.full(time.size, up)
    return RawLog(
        source="example.BIN",
        format="ArduPilot dataflash log",
        program="ArduPlane V4.5.0",
        vehicle="plane",
        series={
            "position": series("POS", lats, lons, height),
            "velocity": series("XKF1", SPEED * np.sin(course), SPEED * np.cos(course), level),
            "attitude": series("ATT", level, level + 0.05, course),
            "airspeed": series("ARSP", level + SPEED),
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
