"""KML tracks: `gx:Track` with times (Google's extension of OGC 12-007); a line without times is no flight."""

from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from flight.simulation.field_source import Damage, VerticalDatum
from logs.field_logs.raw_log import LogSeries, RawLog
from logs.field_logs.readers.track_text import track_text
from world.errors import LogError

FORMAT = "KML track"


def read_kml(path: Path) -> RawLog:
    """Read the tracks of a file as one.  Raises LogError for one without places that have times."""
    try:
        root = ElementTree.fromstring(track_text(path, xml=True))
    except (ElementTree.ParseError, ValueError) as error:
        raise LogError(
            f"{path}: not a KML file that can be read: {' '.join(str(error).split())[:120]}", file=path
        ) from error
    rows, unreadable, mode = [], 0, "clampToGround"
    for track in root.iter():
        if _name(track) != "Track":
            continue
        mode = next((str(child.text).strip() for child in track if _name(child) == "altitudeMode"), mode)
        pairs, alone = _pairs(track, path)
        unreadable += alone
        for when, coord in pairs:
            row = _row(when, coord)
            if row is None:
                unreadable += 1
            else:
                rows.append(row)
    if len(rows) < 2:
        lines = sum(_name(one) == "LineString" for one in root.iter())
        why = f"; its {lines} lines have no times" if lines else ""
        raise LogError(f"{path}: {len(rows)} places with a time (gx:Track): at least 2 are expected{why}", file=path)
    table = np.array(rows)
    datum: VerticalDatum = "amsl" if mode == "absolute" else "unstated"
    return RawLog(
        source=str(path),
        format=FORMAT,
        program="",
        vehicle="unknown",
        series={"position": LogSeries(f"gx:coord, {mode}", table[:, 0] - table[0, 0], table[:, 1:])},
        heights=(),
        datum=datum,
        clock="start",
        utc_start=float(table[0, 0]),
        damage=Damage(unreadable=unreadable),
    )


def _name(element: ElementTree.Element) -> str:
    """An element's name without its namespace: files have Google's, OGC's or none."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _pairs(track: ElementTree.Element, path: Path) -> tuple[list[tuple[str, str]], int]:
    """Times and places that belong together, and how many of either are alone.

    All times stand before all places, or each before its own.  Raises LogError where it cannot be told which is whose.
    """
    marks = [(_name(child), child.text or "") for child in track if _name(child) in ("when", "coord")]
    whens = [text for name, text in marks if name == "when"]
    coords = [text for name, text in marks if name == "coord"]
    last_when = max((k for k, (name, _) in enumerate(marks) if name == "when"), default=-1)
    if all(name == "when" for name, _ in marks[: last_when + 1]):
        if len(whens) != len(coords):
            raise LogError(
                f"{path}: a track of {len(whens)} times (when) and {len(coords)} places (gx:coord): as many of both"
                " are expected",
                file=path,
            )
        return list(zip(whens, coords, strict=True)), 0
    pairs = [(one, other) for (name, one), (kind, other) in pairwise(marks) if (name, kind) == ("when", "coord")]
    return pairs, len(marks) - 2 * len(pairs)


def _row(when: str, coord: str) -> tuple[float, float, float, float] | None:
    """Time since 1970 (s), latitude, longitude, height; None for what is none."""
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
