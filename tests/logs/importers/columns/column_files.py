"""A circle flown at 18 m/s in a wind of 4 m/s to the east, as arrays and as files of columns with their table."""

import math
from pathlib import Path

import numpy as np
import pandas as pd

# m/s.
AIRSPEED = 18.0
WIND_EAST = 4.0
# Of the turn, rad/s.
RATE = 0.2
SECONDS = 240.0
HERTZ = 20.0
# Degrees, where the made flights begin.
LAT = 46.0
LON = 8.0

TABLE = """
file = "flight.csv"

[clocks.main]
column = "t"
unit = "s"

[columns]
latitude = { column = "lat", unit = "deg" }
longitude = { column = "lon", unit = "deg" }
altitude = { column = "alt", unit = "m", frame = "amsl" }
velocity_north = { column = "vn", unit = "m/s" }
velocity_east = { column = "ve", unit = "m/s" }
velocity_down = { column = "vd", unit = "m/s", frame = "NED" }
roll = { column = "roll", unit = "deg" }
pitch = { column = "pitch", unit = "deg" }
yaw = { column = "yaw", unit = "deg" }
roll_rate = { column = "p", unit = "deg/s" }
pitch_rate = { column = "q", unit = "deg/s" }
yaw_rate = { column = "r", unit = "deg/s" }
acceleration_forward = { column = "ax", unit = "m/s2" }
acceleration_right = { column = "ay", unit = "m/s2" }
acceleration_down = { column = "az", unit = "m/s2" }
airspeed = { column = "tas", unit = "m/s", frame = "true" }
elevator = { column = "ele", unit = "deg" }
aileron = { column = "ail", unit = "deg" }
throttle = { column = "thr", unit = "%" }
voltage = { column = "volt", unit = "V" }
current = { column = "amp", unit = "A" }
"""


def circle() -> dict[str, np.ndarray]:
    """Return the columns of the flight; a level turn to the right: tan(bank) = V * rate / g.

    No sensor repeats a value: each has noise of a ten-millionth.
    """
    draw = np.random.default_rng(1)
    time = np.arange(0.0, SECONDS, 1.0 / HERTZ)
    yaw = RATE * time
    bank = math.atan(AIRSPEED * RATE / 9.80665)

    def steady(value: float) -> np.ndarray:
        return value + 1e-7 * draw.standard_normal(len(time))

    north = AIRSPEED / RATE * np.sin(yaw)
    east = AIRSPEED / RATE * (1.0 - np.cos(yaw)) + WIND_EAST * time
    degree = math.radians(1.0) * 6_371_000.0
    return {
        "t": time,
        "lat": LAT + north / degree,
        "lon": LON + east / degree / math.cos(math.radians(LAT)),
        "alt": steady(500.0),
        "vn": AIRSPEED * np.cos(yaw),
        "ve": AIRSPEED * np.sin(yaw) + WIND_EAST,
        "vd": steady(0.0),
        "roll": steady(math.degrees(bank)),
        "pitch": steady(3.0),
        "yaw": (np.degrees(yaw) + 180.0) % 360.0 - 180.0,
        "p": steady(0.0),
        "q": steady(math.degrees(RATE * math.sin(bank))),
        "r": steady(math.degrees(RATE * math.cos(bank))),
        "ax": steady(0.0),
        "ay": steady(0.0),
        "az": steady(-9.80665 / math.cos(bank)),
        "tas": steady(AIRSPEED),
        "ele": -5.0 + np.sin(0.7 * time),
        "ail": 2.0 * np.sin(0.9 * time),
        "thr": 60.0 + 30.0 * np.sign(np.sin(0.05 * time + 0.3 * np.sin(0.011 * time))),
        "volt": steady(11.1),
        "amp": steady(12.0),
    }


def write_log(folder: Path, table: str = TABLE, **columns: np.ndarray) -> Path:
    """Write flight.csv, with some columns replaced, and its table; return the table."""
    pd.DataFrame(circle() | columns).to_csv(folder / "flight.csv", index=False)
    path = folder / "flight.columns.toml"
    path.write_text(table, encoding="utf-8")
    return path
