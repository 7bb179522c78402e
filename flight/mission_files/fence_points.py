"""The fence files of ArduPilot's older tools: a latitude and a longitude a line.

MAVProxy's ``fence save`` and Mission Planner wrote them so before fences became mission items (pymavlink's
`MAVFenceLoader`): first the point to return to, then the corners of one inclusion polygon, the first of them again
last.
"""

import math

from flight.mission.fences import numbered
from flight.mission.items import Command, Frame, MissionItem, on_grid, position_problem
from world.errors import MissionError
from world.text_files import TextLine

# Corners of such a fence at most: ArduPilot numbered them in a byte.
MOST_POINTS = 255


def is_point_list(text: str) -> bool:
    r"""Whether a fence's text begins with a number, as no other form of a fence does.

    >>> is_point_list("# saved\n36.5 -84.2\n"), is_point_list("QGC WPL 110\n")
    (True, False)
    """
    lines = _lines(text)
    try:
        return bool(lines) and math.isfinite(float(lines[0][1].split()[0]))
    except ValueError:
        return False


def parse_fence_points(text: str, source: str) -> tuple[MissionItem, ...]:
    r"""Items of the polygon in such a file; ``source`` names it in messages.

    The return point is no zone and is left out; a file without one, whose first point is its last, is taken as found.
    Raises MissionError with file, line, value and what is allowed.

    >>> square = ["36.505 -84.195", "36.5 -84.2", "36.5 -84.19", "36.51 -84.19", "36.51 -84.2", "36.5 -84.2"]
    >>> [(item.command, item.params[0], item.lat_deg) for item in parse_fence_points("\n".join(square), "fence.txt")]
    [(5001, 4.0, 36.5), (5001, 4.0, 36.5), (5001, 4.0, 36.51), (5001, 4.0, 36.51)]
    """
    points = [_point(TextLine(source, number), line) for number, line in _lines(text)]
    if len(points) > MOST_POINTS:
        raise MissionError(f"{source}: {len(points)} points: at most {MOST_POINTS} are read", file=source)
    ring = points if points[0] == points[-1] else points[1:]
    if len(ring) < 4 or ring[0] != ring[-1]:
        raise MissionError(
            f"{source}: {len(points)} points: a return point and a ring of three corners or more is expected, the first"
            " again last",
            file=source,
        )
    none = (float(len(ring) - 1), 0.0, 0.0, 0.0)
    command = int(Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION)
    return numbered([MissionItem(0, command, int(Frame.GLOBAL), none, lat, lon, 0.0) for lat, lon in ring[:-1]])


def _lines(text: str) -> list[tuple[int, str]]:
    """Lines that say something, with their numbers."""
    lines = enumerate(text.removeprefix("\ufeff").splitlines(), 1)
    return [(number, line.strip()) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]


def _point(where: TextLine, line: str) -> tuple[float, float]:
    try:
        lat, lon = (float(part) for part in line.split())
    except ValueError:
        lat = lon = math.nan
    if not (math.isfinite(lat) and math.isfinite(lon)):
        allowed = "a latitude and a longitude are expected"
        raise MissionError(f"{where}: {line[:40]!r}: {allowed}", file=where.file, value=line, allowed=allowed)
    problem = position_problem(lat, lon)
    if problem is not None:
        raise MissionError(**problem.at(where.file, where))
    return on_grid(lat), on_grid(lon)
