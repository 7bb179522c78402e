"""Read track files (GPX, IGC flight recorder files and KML) as logs with only positions.

GPX is read by gpxpy.  IGC and KML are read in this module.  aerofiles 1.5 reads IGC in 3.7 times the time, and raises
KeyError for a file without a date.  fastkml 1.4 reads KML in 8 times the time, raises TypeError for a track with one
damaged coordinate, and after one damaged time pairs all later times with the wrong positions.
"""

import calendar
import lzma
import math
import re
import zipfile
import zlib
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import gpxpy
import gpxpy.gpx
import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Frame, Mission, MissionItem, round_to_grid
from flight.simulation.setup import Damage, VerticalDatum
from flight.simulation.track import MAX_TIME_S
from logs.importers.raw_log import HeightSource, LoggedMission, LogSeries, RawLog
from world.errors import LogError
from world.wording import count_text

# ----------------------------------------------------------------------
# Text of a track file, with checks of its size and of dangerous XML.

# Largest size of a track file, bytes; a track of a day at ten points a second takes less.
MAX_BYTES = 256 * 2**20
# Start of an XML document type, which can define entities that grow without bound or that name other files.
_DOCUMENT_TYPE = re.compile(r"<!(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_track_text(path: Path, *, xml: bool) -> str:
    """Read the text of a track file; bytes that are not UTF-8 are replaced.

    Of a zipped file (`.kmz`), the first `.kml` is read.  Raises LogError for a file of more than `MAX_BYTES`, a zipped
    file that cannot be read, and XML with a document type.

    xml: True for a file in XML.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise LogError(f"{path}: too large: {size:,} bytes; the limit for a track is {MAX_BYTES:,} bytes", file=path)
    text = _read_bytes(path).decode("utf-8-sig", errors="replace")
    if xml and _DOCUMENT_TYPE.search(text):
        raise LogError(
            f"{path}: the file declares a document type (DOCTYPE or ENTITY), which a track must not have", file=path
        )
    return text


def _read_bytes(path: Path) -> bytes:
    """Return the bytes of a file, or of the first `.kml` in a zipped file.

    Raises LogError for a zipped file that cannot be read, that contains no `.kml`, or whose `.kml` has more than
    `MAX_BYTES`.
    """
    if not zipfile.is_zipfile(path):
        return path.read_bytes()
    try:
        with zipfile.ZipFile(path) as archive:
            # Google Earth has one, doc.kml, and reads the first of several (OGC 12-007, "KMZ").
            entry = next((info for info in archive.infolist() if info.filename.lower().endswith(".kml")), None)
            if entry is None:
                raise LogError(f"{path}: the zipped file contains no .kml", file=path)
            with archive.open(entry) as file:
                # The archive may state a wrong size.
                data = file.read(MAX_BYTES + 1)
    # bzip2 raises OSError for bytes that it cannot unpack.
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, RuntimeError, EOFError, OSError) as error:
        cause = " ".join(str(error).split())[:120]
        raise LogError(f"{path}: the zipped file cannot be unpacked: {cause}", file=path) from error
    if len(data) > MAX_BYTES:
        message = f"{path}: too large: more than {MAX_BYTES:,} bytes when unpacked, the limit for a track"
        raise LogError(message, file=path)
    return data


def _find_earliest_time(stamps: NDArray[np.float64]) -> float:
    """Return the earliest of a track's times, s.

    Times that are `MAX_TIME_S` or more from the median are ignored.

    stamps: times, s, (n,).
    """
    # Take a time of the track as the median: the mean of two times may be near neither.
    middle = np.sort(stamps)[stamps.size // 2]
    return float(stamps[np.abs(stamps - middle) < MAX_TIME_S].min())


# ----------------------------------------------------------------------
# GPX tracks, by gpxpy: points with times; a route in the same file is what was planned.

GPX = "GPX track"


def read_gpx(path: Path) -> RawLog:
    """Read all tracks of a GPX file as one log, and its routes as missions.

    Raises LogError for a file that is not GPX, and for a file with fewer than two track points with a time.
    """
    text = read_track_text(path, xml=True)
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError) as error:
        raise LogError(f"{path}: not a readable GPX file: {' '.join(str(error).split())[:120]}", file=path) from error
    points = [point for track in gpx.tracks for segment in track.segments for point in segment.points]
    timed = [point for point in points if point.time is not None]
    if len(timed) < 2:
        raise LogError(
            f"{path}: {len(timed)} of {len(points)} track points have a time; expected at least 2", file=path
        )
    # Times without a zone are UTC, the zone of all times in the format.
    times = [point.time if point.time.tzinfo else point.time.replace(tzinfo=UTC) for point in timed if point.time]
    stamps = np.array([time.timestamp() for time in times])
    start = _find_earliest_time(stamps)
    # Routes of at least two points are missions.
    missions = []
    for route in gpx.routes:
        has_altitudes = all(point.elevation is not None for point in route.points)
        items = _make_waypoint_items(
            [(point.latitude, point.longitude, float(point.elevation or 0.0)) for point in route.points]
        )
        if len(items) > 1:
            mission = Mission(home=None, items=items, source=f"{path}: route {route.name or ''}".rstrip())
            missions.append(LoggedMission(0.0, mission, "route", has_altitudes))
    up = [math.nan if point.elevation is None else point.elevation for point in timed]
    values = np.array([[point.latitude, point.longitude, height] for point, height in zip(timed, up, strict=True)])
    return RawLog(
        source=str(path),
        format=GPX,
        program=str(gpx.creator or ""),
        vehicle="unknown",
        series={"position": LogSeries("trkpt", stamps - start, values)},
        heights=(),
        datum="unstated",
        missions=tuple(missions),
        clock="start",
        utc_start=start,
        damage=Damage(unreadable=len(points) - len(timed)),
    )


def _make_waypoint_items(points: list[tuple[float, float, float]]) -> tuple[MissionItem, ...]:
    """Make a waypoint item at each point, numbered from 1.

    points: latitude and longitude, degrees, and altitude, m AMSL, of each point.
    """
    return tuple(
        MissionItem(
            number,
            int(Command.NAV_WAYPOINT),
            int(Frame.GLOBAL),
            (0.0,) * 4,
            round_to_grid(lat),
            round_to_grid(lon),
            up,
        )
        for number, (lat, lon, up) in enumerate(points, 1)
    )


# ----------------------------------------------------------------------
# IGC flight recorder files: B records are fixes, C records the declared task.
# The record layouts are specified in the FAI's "Technical Specification for GNSS Flight Recorders", appendix A: `B`
# HHMMSS
# DDMMmmmN DDDMMmmmE V PPPPP GGGGG with the pressure altitude (of 1013.25 hPa) and the GNSS altitude in metres; a `V` in
# place of `A` states that there is no GNSS altitude.

IGC = "IGC flight recorder file"
_PLACE = r"(\d\d)([0-5]\d)(\d{3})([NS])(\d{3})([0-5]\d)(\d{3})([EW])"
_HEIGHT = r"(-\d{4}|\d{5})"
_FIX = re.compile(rf"B([01]\d|2[0-3])([0-5]\d)([0-5]\d){_PLACE}([AV]){_HEIGHT}{_HEIGHT}")
_TASK_POINT = re.compile(rf"C{_PLACE}")
_DATE = re.compile(r"HFDTE(?:DATE:?\s*)?(\d{2})(\d{2})(\d{2})")
_DAY_S = 86_400.0
_HALF_DAY_S = 43_200.0
# Datum of the GNSS altitude by the text of HFALG.
_DATUMS: dict[str, VerticalDatum] = {"ELL": "ellipsoid", "GEO": "amsl"}


def read_igc(path: Path) -> RawLog:
    """Read the track of an IGC flight recorder file, and the declared task as a mission.

    The altitude is the GNSS altitude if most fixes have one, otherwise the pressure altitude.  Raises LogError for a
    file with fewer than two fixes.
    """
    lines = re.split(r"\r\n|\n|\r", read_track_text(path, xml=False))
    # A row is the second of the day, latitude and longitude (deg), and pressure and GNSS altitude (m; NaN if missing).
    rows, unreadable = [], 0
    for line in lines:
        match = _FIX.match(line)
        if match is not None:
            # The fields are four for the latitude, four for the longitude, the validity ("A" for a 3-D fix), and
            # pressure and GNSS altitude.
            hour, minute, second, *fields = match.groups()
            lat, lon = _parse_degrees(*fields[:4]), _parse_degrees(*fields[4:8])
            gnss_altitude = float(fields[10]) if fields[8] == "A" else math.nan
            seconds = int(hour) * 3600.0 + int(minute) * 60.0 + int(second)
            rows.append((seconds, lat, lon, float(fields[9]), gnss_altitude))
        elif line.startswith("B"):
            unreadable += 1
    if len(rows) < 2:
        raise LogError(f"{path}: {len(rows)} fixes (B records); expected at least 2", file=path)
    table = np.array(rows)
    # A day is added after each midnight, so that the seconds keep increasing.
    second_of_day = table[:, 0]
    steps = np.diff(second_of_day)
    days = np.cumsum(np.where(steps < -_HALF_DAY_S, 1.0, np.where(steps > _HALF_DAY_S, -1.0, 0.0)))
    time = second_of_day + np.concatenate([[0.0], days]) * _DAY_S
    gnss, pressure = table[:, 4], table[:, 3]
    has_gnss = bool((np.isfinite(gnss) & (gnss != 0.0)).mean() > 0.5)
    up, source = (gnss, "B record, GNSS altitude") if has_gnss else (pressure, "B record, pressure altitude")
    # UTC midnight before the flight, s since 1970.  The file's years have two digits: 80 to 99 are 1980 to 1999.
    dates = [[int(part) for part in match.groups()] for match in map(_DATE.match, lines) if match]
    midnights = (
        float(calendar.timegm((1900 + year if year >= 80 else 2000 + year, month, day, 0, 0, 0)))
        for day, month, year in dates
        if 1 <= month <= 12 and 1 <= day <= 31
    )
    midnight = next(midnights, math.nan)
    start = float(time.min())
    pressure_heights = HeightSource("pressure altitude", "pressure", LogSeries("B", time - start, pressure[:, None]))
    recorder_line = next((line for line in lines if line.startswith("HFFTY")), "")
    datum_line = next((line for line in lines if line.startswith(("HFALG", "HOALG"))), "")
    # The specification assumes the ellipsoid for the GNSS altitude if nothing is stated.
    datum: VerticalDatum = "ellipsoid" if has_gnss else "pressure"
    if has_gnss and datum_line:
        datum = next((datum for word, datum in _DATUMS.items() if word in datum_line[5:]), "unstated")
    return RawLog(
        source=str(path),
        format=IGC,
        program=recorder_line.partition(":")[2].strip(),
        vehicle="unknown",
        series={"position": LogSeries(source, time - start, np.column_stack([table[:, 1:3], up]))},
        heights=(pressure_heights,) if has_gnss else (),
        datum=datum,
        missions=_make_task(lines, str(path)),
        clock="start",
        utc_start=midnight + start,
        damage=Damage(unreadable=unreadable),
    )


def _parse_degrees(degrees: str, minutes: str, thousandths: str, side: str) -> float:
    """Convert texts of degrees, minutes and thousandths of a minute to degrees.

    They are negative for the sides S and W.
    """
    value = int(degrees) + (int(minutes) + int(thousandths) / 1000.0) / 60.0
    return -value if side in "SW" else value


def _make_task(lines: list[str], source: str) -> tuple[LoggedMission, ...]:
    """Return the declared task of an IGC file as a mission; () if it has fewer than two turn points.

    Of more than three points, the first and the last are left out: they are the take-off and the landing.

    lines: lines of the file.
    source: path of the file.
    """
    points = []
    for line in lines:
        match = _TASK_POINT.match(line)
        if match:
            lat, lon = _parse_degrees(*match.groups()[:4]), _parse_degrees(*match.groups()[4:])
            if (lat, lon) != (0.0, 0.0):
                points.append((lat, lon, 0.0))
    # The first and the last point are the take-off and the landing on the ground, not turn points of the task.
    turn_points = points[1:-1] if len(points) > 3 else points
    items = _make_waypoint_items(turn_points)
    if len(items) < 2:
        return ()
    return (
        LoggedMission(
            0.0, Mission(home=None, items=items, source=f"{source}: declared task"), "declared task", with_heights=False
        ),
    )


# ----------------------------------------------------------------------
# KML tracks: `gx:Track` with times (Google's extension of OGC 12-007); a line without times is not a flight.

KML = "KML track"


def read_kml(path: Path) -> RawLog:
    """Read all tracks of a KML file as one log.

    Raises LogError for a file that is not KML, a track whose numbers of times and positions differ, and a file with
    fewer than two positions with a time.
    """
    try:
        root = ElementTree.fromstring(read_track_text(path, xml=True))
    except (ElementTree.ParseError, ValueError) as error:
        raise LogError(f"{path}: not a readable KML file: {' '.join(str(error).split())[:120]}", file=path) from error
    rows, unreadable, mode = [], 0, "clampToGround"
    for track in root.iter():
        if _get_local_name(track) != "Track":
            continue
        mode = next((str(child.text).strip() for child in track if _get_local_name(child) == "altitudeMode"), mode)
        pairs, unpaired_count = _pair_times_with_positions(track, path)
        unreadable += unpaired_count
        for when, coord in pairs:
            row = _parse_position(when, coord)
            if row is None:
                unreadable += 1
            else:
                rows.append(row)
    if len(rows) < 2:
        lines = sum(_get_local_name(element) == "LineString" for element in root.iter())
        reason = f"; the file also has {count_text(lines, 'line')} without times" if lines else ""
        raise LogError(
            f"{path}: only {count_text(len(rows), 'position')} with a time (gx:Track); at least 2 are needed{reason}",
            file=path,
        )
    table = np.array(rows)
    start = _find_earliest_time(table[:, 0])
    datum: VerticalDatum = "amsl" if mode == "absolute" else "unstated"
    return RawLog(
        source=str(path),
        format=KML,
        program="",
        vehicle="unknown",
        series={"position": LogSeries(f"gx:coord, {mode}", table[:, 0] - start, table[:, 1:])},
        heights=(),
        datum=datum,
        clock="start",
        utc_start=start,
        damage=Damage(unreadable=unreadable),
    )


def _get_local_name(element: ElementTree.Element) -> str:
    """Return the name of an element without its namespace, which may be Google's, OGC's or none."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _pair_times_with_positions(track: ElementTree.Element, path: Path) -> tuple[list[tuple[str, str]], int]:
    """Return the pairs of time and position of a KML track, and the number of unpaired elements.

    A track has either all times before all positions, or each time before its position.  In the first case, LogError is
    raised if the numbers of times and positions differ.
    """
    elements = [
        (_get_local_name(child), child.text or "") for child in track if _get_local_name(child) in ("when", "coord")
    ]
    times = [text for name, text in elements if name == "when"]
    positions = [text for name, text in elements if name == "coord"]
    last_time = max((k for k, (name, _) in enumerate(elements) if name == "when"), default=-1)
    if all(name == "when" for name, _ in elements[: last_time + 1]):
        if len(times) != len(positions):
            raise LogError(
                f"{path}: a track has {count_text(len(times), 'time')} (when) and"
                f" {count_text(len(positions), 'position')} (gx:coord): expected equal numbers",
                file=path,
            )
        return list(zip(times, positions, strict=True)), 0
    pairs = [
        (text, next_text)
        for (name, text), (next_name, next_text) in pairwise(elements)
        if (name, next_name) == ("when", "coord")
    ]
    return pairs, len(elements) - 2 * len(pairs)


def _parse_position(when: str, coord: str) -> tuple[float, float, float, float] | None:
    """Convert a time and a position of a KML track from texts to numbers; None if they are invalid.

    Return time (s since 1970), latitude (degrees), longitude (degrees) and altitude (m; NaN if missing).

    when, coord: texts of the time and of the position.
    """
    parts = coord.replace(",", " ").split()
    try:
        time = datetime.fromisoformat(when.strip().replace("Z", "+00:00"))
        stamp = (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
        numbers = [float(part) for part in parts]
    except ValueError:
        return None
    if len(numbers) not in (2, 3):
        return None
    lon, lat, up = (*numbers, float("nan"))[:3]
    return stamp, lat, lon, up
