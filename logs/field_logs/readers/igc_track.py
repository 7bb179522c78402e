r"""IGC flight recorder files: B records are fixes, C records the declared task.

The record layouts are those of the FAI's "Technical Specification for GNSS Flight Recorders", appendix A: `B` HHMMSS
DDMMmmmN DDDMMmmmE V PPPPP GGGGG with the pressure altitude (of 1013.25 hPa) and the GNSS altitude in metres; a `V` in
place of `A` says that there is no height by GNSS.
"""

import calendar
import math
import re
from pathlib import Path

import numpy as np

from flight.mission.items import Command, Frame, Mission, MissionItem, on_grid
from flight.simulation.field_source import Damage, VerticalDatum
from logs.field_logs.raw_log import HeightSource, LoggedMission, LogSeries, RawLog
from logs.field_logs.readers.track_text import track_text
from world.errors import LogError

FORMAT = "IGC flight recorder file"
_PLACE = r"(\d{2})(\d{2})(\d{3})([NS])(\d{3})(\d{2})(\d{3})([EW])"
_FIX = re.compile(rf"B(\d{{2}})(\d{{2}})(\d{{2}}){_PLACE}([AV])(-\d{{4}}|\d{{5}})(-\d{{4}}|\d{{5}})")
_TASK_POINT = re.compile(rf"C{_PLACE}")
_DATE = re.compile(r"HFDTE(?:DATE:?\s*)?(\d{2})(\d{2})(\d{2})")
_DAY = 86_400.0
_HALF_DAY = 43_200.0
# What HFALG says of the GNSS altitude.
_DATUMS: dict[str, VerticalDatum] = {"ELL": "ellipsoid", "GEO": "amsl"}


def read_igc(path: Path) -> RawLog:
    """Read a track.  Raises LogError for one with fewer than two fixes."""
    lines = re.split(r"\r\n|\n|\r", track_text(path, xml=False))
    rows, unreadable = _fixes(lines)
    if len(rows) < 2:
        raise LogError(f"{path}: {len(rows)} fixes (B records): at least 2 are expected", file=path)
    table = np.array(rows)
    time = _over_midnight(table[:, 0])
    gnss, pressure = table[:, 4], table[:, 3]
    use_gnss = bool((np.isfinite(gnss) & (gnss != 0.0)).mean() > 0.5)
    up, source = (gnss, "B record, GNSS altitude") if use_gnss else (pressure, "B record, pressure altitude")
    midnight = _midnight(lines)
    start = float(time[0])
    other = HeightSource("pressure altitude", "pressure", LogSeries("B", time - start, pressure[:, None]))
    return RawLog(
        source=str(path),
        format=FORMAT,
        program=_recorder(lines),
        vehicle="unknown",
        series={"position": LogSeries(source, time - start, np.column_stack([table[:, 1:3], up]))},
        heights=(other,) if use_gnss else (),
        datum=_datum(lines) if use_gnss else "pressure",
        missions=_task(lines, str(path)),
        clock="start",
        utc_start=midnight + start,
        damage=Damage(unreadable=unreadable),
    )


def _degrees(whole: str, minutes: str, thousandths: str, side: str) -> float:
    value = int(whole) + (int(minutes) + int(thousandths) / 1000.0) / 60.0
    return -value if side in "SW" else value


def _fixes(lines: list[str]) -> tuple[list[tuple[float, float, float, float, float]], int]:
    """Second of the day, latitude, longitude, pressure and GNSS altitude of each fix; how many could not be read."""
    rows, unreadable = [], 0
    for line in lines:
        if not line.startswith("B"):
            continue
        found = _FIX.match(line)
        if found is None:
            unreadable += 1
            continue
        hour, minute, second, *rest = found.groups()
        lat, lon = _degrees(*rest[:4]), _degrees(*rest[4:8])
        gnss = float(rest[10]) if rest[8] == "A" else math.nan
        rows.append((int(hour) * 3600.0 + int(minute) * 60.0 + int(second), lat, lon, float(rest[9]), gnss))
    return rows, unreadable


def _over_midnight(time: np.ndarray) -> np.ndarray:
    """Seconds that go on after midnight."""
    steps = np.diff(time)
    days = np.cumsum(np.where(steps < -_HALF_DAY, 1.0, np.where(steps > _HALF_DAY, -1.0, 0.0)))
    return time + np.concatenate([[0.0], days]) * _DAY


def _midnight(lines: list[str]) -> float:
    """The day's beginning, s since 1970; NaN where the file states none."""
    for line in lines:
        found = _DATE.match(line)
        if found:
            day, month, year = (int(part) for part in found.groups())
            if 1 <= month <= 12 and 1 <= day <= 31:
                return float(calendar.timegm((1900 + year if year >= 80 else 2000 + year, month, day, 0, 0, 0)))
    return math.nan


def _datum(lines: list[str]) -> VerticalDatum:
    for line in lines:
        if line.startswith("HFALG") or line.startswith("HOALG"):
            return next((datum for word, datum in _DATUMS.items() if word in line[5:]), "unstated")
    # The specification has the ellipsoid's where nothing is stated.
    return "ellipsoid"


def _recorder(lines: list[str]) -> str:
    named = next((line for line in lines if line.startswith("HFFTY")), "")
    return named.partition(":")[2].strip()


def _task(lines: list[str], source: str) -> tuple[LoggedMission, ...]:
    """The declared task: take-off and landing places, which it begins and ends with, are left out where they are 0."""
    points = []
    for line in lines:
        found = _TASK_POINT.match(line)
        if found:
            lat, lon = _degrees(*found.groups()[:4]), _degrees(*found.groups()[4:])
            if (lat, lon) != (0.0, 0.0):
                points.append((lat, lon))
    # Take-off and landing are where the glider was, not what it was to fly.
    turn_points = points[1:-1] if len(points) > 3 else points
    items = tuple(
        MissionItem(number, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, on_grid(lat), on_grid(lon), 0.0)
        for number, (lat, lon) in enumerate(turn_points, 1)
    )
    if len(items) < 2:
        return ()
    return (LoggedMission(0.0, Mission(None, items, source=f"{source}: declared task"), "declared task", False),)
