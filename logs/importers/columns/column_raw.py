"""Read a log with a table of columns into a `RawLog`, for `planfly import`."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flight.mission_files.formats import read_mission
from flight.simulation.setup import VerticalDatum
from logs.importers.columns.column_checks import check_signs_and_units
from logs.importers.columns.column_log import ColumnLog, decode_cell
from logs.importers.columns.column_motion import join_series, read_air, read_velocity
from logs.importers.raw_log import LoggedMission, LogSeries, ModeChange, RawLog
from world.arrays import Floats
from world.errors import LogError

FORMAT = "table of columns"
_POSITIONS_NEEDED = "expected a column, because a flight is judged by its positions"
_DATUMS: dict[str, VerticalDatum] = {"amsl": "amsl", "ellipsoid": "ellipsoid", "start": "unstated"}


def read_columns(path: Path) -> RawLog:
    """Read a log with a table of columns into a `RawLog`.

    Raises LogError for a file that cannot be read, a table without latitude or longitude, and quantities that
    contradict each other.

    path: path of the table, or of a data file with a table next to it.
    """
    log = ColumnLog(path)
    for quantity in ("latitude", "longitude"):
        if not log.has(quantity):
            raise LogError.at(log.table_path, f"columns.{quantity}", "missing", _POSITIONS_NEEDED)
    check_signs_and_units(log)
    # Latitude and longitude (deg) and altitude (m); the altitude is NaN if it is not logged.
    latitude, longitude = log.series("latitude"), log.series("longitude")
    parts = join_series([latitude, longitude])
    up = np.full(len(parts.time), math.nan)
    if log.has("altitude"):
        altitude = join_series([log.series("altitude")])
        up = np.interp(parts.time, altitude.time, altitude.values[:, 0])
    values = np.column_stack([np.degrees(parts.values), up])
    position = LogSeries(log.column("altitude" if log.has("altitude") else "latitude"), parts.time, values)
    missions = []
    if log.table.mission is not None:
        mission_path = log.table_path.parent / log.table.mission
        missions.append(LoggedMission(0.0, read_mission(mission_path), mission_path.name))
    # Each change of the quantity `mode`, with the mode's name from the table's [modes].
    modes = []
    if log.has("mode"):
        time, mode_values = log.raw_values("mode")
        names, automatic = log.table.modes.names, log.table.modes.automatic
        previous = None
        for start, value in zip(time.tolist(), mode_values.tolist(), strict=True):
            if value != previous:
                key = f"{value:g}" if isinstance(value, float) else decode_cell(value)
                modes.append(ModeChange(start, names.get(key, key), value in automatic or key in automatic))
                previous = value
    return RawLog(
        source=str(path),
        format=FORMAT,
        program=log.table.program,
        vehicle="plane",
        series={"position": position} | dict(_read_series(log)),
        heights=(),
        datum=_DATUMS[log.frame("altitude")] if log.has("altitude") else "unstated",
        modes=tuple(modes),
        missions=tuple(missions),
        parameters=log.parameters(),
        clock="start",
        utc_start=log.utc_start,
        sha256=log.sha256,
    )


def _read_series(log: ColumnLog) -> Iterator[tuple[str, LogSeries]]:
    """Yield the name and the data of each series of a `RawLog` that the log has, except the positions."""
    velocity = read_velocity(log)
    if len(velocity.time):
        yield "velocity", LogSeries("ground velocity", velocity.time, velocity.values[:, [1, 0, 2]] * [1.0, 1.0, -1.0])
    if log.has("roll", "pitch", "yaw"):
        attitude = join_series([log.series(name) for name in ("roll", "pitch", "yaw")])
        yield "attitude", LogSeries("attitude", attitude.time, attitude.values)
    air = read_air(log)
    if len(air.true_airspeed.time):
        yield "airspeed", LogSeries(log.column("airspeed"), air.true_airspeed.time, air.true_airspeed.values)
    if len(air.wind.time):
        yield "wind", LogSeries(air.wind_source, air.wind.time, air.wind.values[:, ::-1])
    if log.has("current"):
        # The energy is NaN if the voltage is not logged.
        if not log.has("voltage"):
            current = join_series([log.series("current")])
            battery_series = LogSeries(
                "battery", current.time, np.column_stack([current.values, np.full(len(current.time), math.nan)])
            )
        else:
            battery = join_series([log.series("current"), log.series("voltage")])
            power = battery.values.prod(axis=1)
            steps = np.diff(battery.time, prepend=battery.time[:1])
            energy: Floats = np.cumsum(power * steps) / 3600.0
            battery_series = LogSeries("battery", battery.time, np.column_stack([battery.values[:, 0], energy]))
        yield "battery", battery_series
    if log.has("throttle"):
        throttle = join_series([log.series("throttle")])
        yield "throttle", LogSeries(log.column("throttle"), throttle.time, throttle.values)
