"""GPX tracks, by gpxpy: points with times; a route in the same file is what was planned."""

import math
from datetime import UTC
from pathlib import Path

import gpxpy
import gpxpy.gpx
import numpy as np

from flight.mission.items import Command, Frame, Mission, MissionItem, on_grid
from flight.simulation.field_source import Damage
from logs.field_logs.raw_log import LoggedMission, LogSeries, RawLog
from logs.field_logs.readers.track_text import track_text
from world.errors import LogError

FORMAT = "GPX track"


def read_gpx(path: Path) -> RawLog:
    """Read a track.  Raises LogError for one without points that have times."""
    text = track_text(path, xml=True)
    try:
        found = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError) as error:
        raise LogError(
            f"{path}: not a GPX file that can be read: {' '.join(str(error).split())[:120]}", file=path
        ) from error
    points = [point for track in found.tracks for segment in track.segments for point in segment.points]
    timed = [point for point in points if point.time is not None]
    if len(timed) < 2:
        raise LogError(
            f"{path}: {len(timed)} track points with a time of {len(points)}: at least 2 are expected", file=path
        )
    # Times without a zone are UTC, as the format has all of them.
    times = [point.time if point.time.tzinfo else point.time.replace(tzinfo=UTC) for point in timed if point.time]
    stamps = np.array([time.timestamp() for time in times])
    up = [math.nan if point.elevation is None else point.elevation for point in timed]
    values = np.array([[point.latitude, point.longitude, height] for point, height in zip(timed, up, strict=True)])
    return RawLog(
        source=str(path),
        format=FORMAT,
        program=str(found.creator or ""),
        vehicle="unknown",
        series={"position": LogSeries("trkpt", stamps - stamps[0], values)},
        heights=(),
        datum="unstated",
        missions=tuple(_routes(found, str(path))),
        clock="start",
        utc_start=float(stamps[0]),
        damage=Damage(unreadable=len(points) - len(timed)),
    )


def _routes(found: gpxpy.gpx.GPX, source: str) -> list[LoggedMission]:
    made = []
    for route in found.routes:
        heights = all(point.elevation is not None for point in route.points)
        items = tuple(
            MissionItem(
                number, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4,
                on_grid(point.latitude), on_grid(point.longitude), float(point.elevation or 0.0),
            )
            for number, point in enumerate(route.points, 1)
        )  # fmt: skip
        if len(items) > 1:
            mission = Mission(None, items, source=f"{source}: route {route.name or ''}".rstrip())
            made.append(LoggedMission(0.0, mission, "route", heights))
    return made
