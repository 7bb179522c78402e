"""Read and write mission files, by suffix and content.

ArduPilot's text formats are read and written here: QGC WPL 110 missions, and fence files of its older tools.
"""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

from flight.mission.fences import fence_shapes, number_items
from flight.mission.items import (
    FENCES,
    LANDINGS,
    MAX_BYTES,
    MAX_ITEMS,
    PLACES,
    Command,
    Frame,
    Home,
    Mission,
    MissionItem,
    command_name,
    is_located,
    item_problem,
    position_problem,
    renumber_items,
    round_to_grid,
)
from flight.mission_files.qgc_plan import parse_plan_file, plan_file_text
from world.errors import MissionError
from world.files import TextLine, missing_text, read_small_file, utf8_text
from world.wording import count_text

# Forms of a mission file.
FileKind = Literal["waypoints", "plan", "fence", "rally"]

# Form that each suffix names.
KINDS: dict[str, FileKind] = {
    ".waypoints": "waypoints",
    ".plan": "plan",
    ".txt": "waypoints",
    ".fence": "fence",
    ".rally": "rally",
}

# Byte order marks of UTF-16.
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")


def mission_kind(path: Path) -> FileKind:
    """Return the format of a mission file by its suffix. Raises MissionError for an unknown suffix.

    >>> mission_kind(Path("survey.plan")), mission_kind(Path("survey.txt"))
    ('plan', 'waypoints')
    """
    try:
        return KINDS[path.suffix.lower()]
    except KeyError:
        allowed = ", ".join(KINDS)
        if path.is_dir():
            raise MissionError(f"{path}: {missing_text(path)}; expected one of {allowed}", file=path) from None
        raise MissionError(
            f"{path}: suffix {path.suffix!r}: expected one of {allowed}",
            file=path,
            field="suffix",
            value=path.suffix,
            allowed=allowed,
        ) from None


def read_mission(path: Path) -> Mission:
    r"""Read a mission file: WPL 110 text (.waypoints, .txt, .fence, .rally) or a `.plan`.

    The suffix must be known. If text and suffix disagree, the format of the text applies. Raises MissionError with one
    line: file, line or field, value, allowed values.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "short.waypoints"
    ...     home, first = "0 1 0 16 0 0 0 0 36.5 -84.2 300 1", "1 0 3 16 0 0 0 0 36.51 -84.2 100 1"
    ...     _ = path.write_text(f"QGC WPL 110\n{home}\n{first}\n", encoding="ascii")
    ...     mission = read_mission(path)
    >>> mission.home
    Home(lat_deg=36.5, lon_deg=-84.2, alt=300.0)
    >>> [(item.seq, item.lat_deg, item.alt) for item in mission.items]
    [(1, 36.51, 100.0)]
    """
    mission_kind(path)
    return parse_mission(_read_text(path), str(path))


def _read_text(path: Path) -> str:
    """Return the text of a mission file. Raises MissionError if the file is empty or not UTF-8 text."""
    data = read_small_file(path, MAX_BYTES, "mission", MissionError)
    if not data.strip():
        raise MissionError(f"{path}: empty; expected a mission", file=path)
    if data.startswith(_UTF16_MARKS):
        raise MissionError(f"{path}: text in UTF-16: a mission file is UTF-8 or ASCII", file=path)
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1
        raise MissionError(f"{path}:{line}: contains a NUL byte; expected a text file", file=path)
    return utf8_text(data, path, MissionError)


# ----------------------------------------------------------------------
# The QGC WPL 110 text form of a mission (`.waypoints`): read leniently, written for the strictest reader.
#
# A header line, then one item per line, in the columns `_COLUMNS` (MAVLink file formats, "Plain-Text File Format").
# Line 0 is home whatever its command, and is not flown. A file whose first line has another number has no home: Mission
# Planner inserts an empty one, and so does planfly; QGroundControl and MAVProxy take even that line for home.

# First line of the file.
HEADER = "QGC WPL 110"
# Clause in the warning about a home in a frame of items.
HOME_LINE_MISSING_TEXT = "the file has no home line"
# Maximum number of lines in a file, comments and empty lines included: ten per item.
MAX_LINES = 10 * MAX_ITEMS

# Columns of a line, each with the allowed range of a whole number; None for a decimal number.
_COLUMNS: dict[str, tuple[int, int] | None] = {
    "seq": (0, 65535),
    "current": (0, 1),
    "frame": (0, 255),
    "command": (0, 65535),
    "p1": None,
    "p2": None,
    "p3": None,
    "p4": None,
    "latitude": None,
    "longitude": None,
    "altitude": None,
    "autocontinue": (0, 1),
}
# A whole number.
_WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,10}")
# A decimal number.
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
# Commands that also have files of their own.
_COMMANDS_WITH_OWN_FILES = FENCES | {Command.NAV_RALLY_POINT}


def parse_mission(text: str, source: str) -> Mission:
    """Parse the text of a mission: a `.plan` if it starts with a brace or bracket, otherwise WPL 110.

    source: name of the mission in messages; a name that ends with ``.plan`` also selects a `.plan`.

    The reader of WPL 110 accepts CRLF, spaces for TABs, '#' comments and empty lines, gaps in seq, no current item, and
    more than seven decimals (rounded to the 1e-7 degrees of MISSION_ITEM_INT). Items and the targets of jumps are
    numbered by lines, as in Mission Planner, QGroundControl and MAVProxy. The column seq only shows whether the first
    line is home.

    Raises MissionError with file, line, field, value and allowed values.
    """
    first_text = text.removeprefix("\ufeff").lstrip()
    if first_text[:1] in ("{", "[") or (source.lower().endswith(".plan") and not first_text.startswith("QGC")):
        return parse_plan_file(text, source)
    locations, items, has_current = list[TextLine](), list[MissionItem](), False
    for number, line in _item_lines(text, source):
        location, texts = TextLine(source, number), line.split()
        if len(texts) != len(_COLUMNS):
            expected = f"expected {len(_COLUMNS)} ({', '.join(_COLUMNS)})"
            raise MissionError(f"{location}: {count_text(len(texts), 'column')}: {expected}", file=source)
        numbers = [_read_number(location, name, text) for name, text in zip(_COLUMNS, texts, strict=True)]
        seq, current, frame, command, p1, p2, p3, p4, lat, lon, alt, autocontinue = numbers
        # A home line of Mission Planner may carry command 0.
        command = command or (Command.NAV_WAYPOINT if seq == 0 else 0)
        if is_located(int(command), int(frame)) and position_problem(lat, lon) is None:
            lat, lon = round_to_grid(lat), round_to_grid(lon)
        params = (p1, p2, p3, p4)
        item = MissionItem(int(seq), int(command), int(frame), params, lat, lon, alt, bool(autocontinue))
        if (problem := item_problem(item)) is not None:
            raise MissionError(**problem.error_arguments(source, location))
        locations.append(location)
        items.append(item)
        has_current |= bool(current)
    if not items:
        raise MissionError(f"{source}: no items after the header", file=source)
    warnings = _collect_warnings(locations, items, has_current=has_current)
    # Fence and rally items without a home line are numbered from 0, too.
    first_number = 0 if _begins_with_home(items) or items[0].command in _COMMANDS_WITH_OWN_FILES else 1
    home, body = _split_home([replace(item, seq=seq) for seq, item in enumerate(items, first_number)])
    # Messages on a fence item state its number in the file, as ground stations show it.
    fences = tuple(item for item in body if item.command in FENCES)
    fence_shapes(fences, source)
    return Mission(
        home=home,
        items=tuple(item for item in body if item.command not in _COMMANDS_WITH_OWN_FILES),
        fences=fences,
        rally=number_items([item for item in body if item.command == Command.NAV_RALLY_POINT]),
        warnings=tuple(warnings),
        source=source,
    )


def _item_lines(text: str, source: str) -> list[tuple[int, str]]:
    """Return the number and the text of each line with an item in a WPL 110 text, without comments.

    Raises MissionError for a text that is empty or too long, without the header, or with too many items.
    """
    line_break_count = max(text.count("\n"), text.count("\r"))
    if line_break_count > MAX_LINES:
        raise MissionError(f"{source}: too long: {line_break_count:,} lines; the limit is {MAX_LINES:,}", file=source)
    lines = [
        (number, line.strip())
        for number, line in enumerate(re.split(r"\r\n|\n|\r", text.removeprefix("\ufeff")), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise MissionError(
            f"{source}: empty; expected a first line '{HEADER}' and lines of {len(_COLUMNS)} columns",
            file=source,
        )
    number, header = lines[0]
    if header.split() != HEADER.split():
        raise MissionError(
            f"{source}:{number}: header {_short_repr(header)}: expected '{HEADER}'",
            file=source,
            field="header",
            value=header,
            allowed=HEADER,
        )
    if len(lines) - 1 > MAX_ITEMS:
        raise MissionError(f"{source}: too long: {len(lines) - 1:,} items; the limit is {MAX_ITEMS:,}", file=source)
    return lines[1:]


def _read_number(location: TextLine, name: str, text: str) -> float:
    """Return the number in a column of a line; raise MissionError if the column does not allow it."""
    allowed_range = _COLUMNS[name]
    if allowed_range is None:
        is_valid = _NUMBER.fullmatch(text) and math.isfinite(float(text))
        allowed = f"expected a finite number{' (a decimal comma?)' if ',' in text else ''}"
    else:
        min_value, max_value = allowed_range
        is_valid = _WHOLE_NUMBER.fullmatch(text) and min_value <= int(text) <= max_value
        allowed = f"expected a whole number {min_value}..{max_value}"
    if not is_valid:
        message = f"{location}: {name} {_short_repr(text)}: {allowed}"
        raise MissionError(message, file=location.file, field=name, value=text, allowed=allowed)
    # Adding 0.0 turns -0.0 into 0.0, because no other form of a mission keeps the sign.
    return float(text) + 0.0


def _begins_with_home(items: list[MissionItem]) -> bool:
    """Return True if the first item is home.

    Files of fences and rally points may have no home line, as MAVProxy writes them.
    """
    return items[0].seq == 0 and items[0].command not in _COMMANDS_WITH_OWN_FILES


def _split_home(items: list[MissionItem]) -> tuple[Home | None, list[MissionItem]]:
    """Return home and the items without home; home is None if the file states no valid position for it."""
    if not _begins_with_home(items):
        return None, items
    home_item = items[0]
    if not home_item.has_position:
        return None, items[1:]
    return Home(home_item.lat_deg, home_item.lon_deg, home_item.alt), items[1:]


def _collect_warnings(locations: list[TextLine], items: list[MissionItem], *, has_current: bool) -> list[str]:
    """Return warnings about the home, the numbers and the positions in a file's items.

    locations: line of each item.
    has_current: True if a line is marked as current.
    """
    home, body = _split_home(items)
    warnings: list[str] = []
    if all(item.command in _COMMANDS_WITH_OWN_FILES for item in body):
        # A fence or rally file may have a home line, as Mission Planner writes it, or none, as MAVProxy does.
        return warnings
    if not has_current:
        warnings.append("no item is marked as current, so the mission is flown from the first item")
    first = items[0]
    if len(body) == len(items):
        warnings.append(
            f"{locations[0]}: no home line (seq 0): the mission has no home and begins with this "
            "item, as in Mission Planner. QGroundControl and MAVProxy treat this item as home and "
            "do not fly it"
        )
    elif first.command != Command.NAV_WAYPOINT:
        warnings.append(
            f"{locations[0]}: {command_name(first.command)} in the line of home (seq 0): "
            "ignored, because ground stations treat that line as home and do not fly it"
        )
    if len(body) < len(items):
        if home is None:
            warnings.append(f"{locations[0]}: home is at 0, 0, which stands for no position: the mission has no home")
        elif first.frame not in (Frame.GLOBAL, Frame.GLOBAL_INT):
            warnings.append(
                f"{locations[0]}: home in frame {first.frame}: its height is read as an altitude above mean sea level."
                f" Probably {HOME_LINE_MISSING_TEXT}: ground stations then treat the first item as home and do not"
                " fly it"
            )
    numbering_text = "items are numbered by line instead, as ground stations do, and jumps use these numbers"
    seq_steps = list(enumerate((following.seq - item.seq for item, following in pairwise(items)), 1))
    gaps, falling = [k for k, step in seq_steps if step > 1], [k for k, step in seq_steps if step < 1]
    if gaps:
        warnings.append(
            f"{locations[gaps[0]]}: the sequence numbers have a gap before {items[gaps[0]].seq}"
            f" ({count_text(len(gaps), 'gap')} in all): {numbering_text}"
        )
    if falling:
        warnings.append(
            f"{locations[falling[0]]}: sequence number {items[falling[0]].seq} is not above the previous line's number"
            f" ({count_text(len(falling), 'such line')} in all): {numbering_text}"
        )
    unplaced = [
        (location, item)
        for location, item in zip(locations[-len(body) :], body, strict=True)
        if item.command in PLACES | LANDINGS and not item.has_position
    ]
    if unplaced:
        name = command_name(unplaced[0][1].command)
        warnings.append(
            f"{unplaced[0][0]}: {name} at 0, 0, which is not a position"
            f" ({count_text(len(unplaced), 'such item')} in all)"
        )
    return warnings


def waypoints_text(mission: Mission) -> str:
    """Return a mission's items as the text of a WPL 110 file.

    The file has TABs, LF, and coordinates with at least eight decimals. A NaN is written as 0, which means "unset" in
    this format. Fences and rally points have files of their own.
    """
    home = mission.home or Home(0.0, 0.0, 0.0)
    place = (home.lat_deg, home.lon_deg, home.alt)
    home_item = MissionItem(0, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0, 0.0, 0.0, 0.0), *place)
    return _file_text((home_item, *renumber_items(mission).items), current=home_item)


def fence_text(mission: Mission) -> str:
    """Return the fences of a mission as a WPL file, numbered from 0 and without a home line.

    MAVProxy's `fence load` reads this form.
    """
    return _file_text(number_items(mission.fences))


def rally_text(mission: Mission) -> str:
    """Return the rally points of a mission as a WPL file, numbered from 0 and without a home line."""
    return _file_text(mission.rally)


def _file_text(items: tuple[MissionItem, ...], current: MissionItem | None = None) -> str:
    """Return the text of a WPL file of these items; ``current`` is the item at which the mission starts."""
    lines = [HEADER]
    for item in items:
        integers = [str(int(value)) for value in (item.seq, item is current, item.frame, item.command)]
        numbers = [_format_decimal(value, 0) for value in item.params]
        position = [_format_decimal(item.lat_deg, 8), _format_decimal(item.lon_deg, 8), _format_decimal(item.alt, 3)]
        lines.append("\t".join([*integers, *numbers, *position, str(int(item.autocontinue))]))
    return "\n".join(lines) + "\n"


def _format_decimal(value: float, places: int) -> str:
    """Format a number without an exponent, so that the same double is read from the text; NaN becomes 0.

    places: minimum number of decimals.
    """
    if math.isnan(value):
        value = 0.0
    whole, _, decimals = format(Decimal(repr(value + 0.0)), "f").partition(".")
    decimals = decimals.rstrip("0").ljust(places, "0")
    return f"{whole}.{decimals}" if decimals else whole


def _short_repr(text: str) -> str:
    """Return text in quotes, shortened to 40 characters."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


# ----------------------------------------------------------------------
# The fence files of ArduPilot's older tools: a latitude and a longitude per line.
#
# MAVProxy's ``fence save`` and Mission Planner wrote them before fences became mission items (pymavlink's
# `MAVFenceLoader`): first the return point, then the corners of one inclusion polygon, ending with the first of them
# again.

# Largest number of points in such a fence: ArduPilot numbered them in a byte.
MAX_POINTS = 255


def is_point_list(text: str) -> bool:
    r"""Return True if a fence's text begins with a number, which only lists of points from older tools do.

    >>> is_point_list("# saved\n36.5 -84.2\n"), is_point_list("QGC WPL 110\n")
    (True, False)
    """
    lines = _content_lines(text)
    try:
        return bool(lines) and math.isfinite(float(lines[0][1].split()[0]))
    except ValueError:
        return False


def parse_fence_points(text: str, source: str) -> tuple[MissionItem, ...]:
    r"""Return the polygon items of a list of fence points from ArduPilot's older tools.

    source: name of the file in messages.

    Such a list starts with a return point, which is left out. The corners of the polygon follow, with the first corner
    repeated at the end. A list without a return point is accepted. Raises MissionError with file, line, value and
    allowed values.

    >>> square = ["36.505 -84.195", "36.5 -84.2", "36.5 -84.19", "36.51 -84.19", "36.51 -84.2", "36.5 -84.2"]
    >>> [(item.command, item.params[0], item.lat_deg) for item in parse_fence_points("\n".join(square), "fence.txt")]
    [(5001, 4.0, 36.5), (5001, 4.0, 36.5), (5001, 4.0, 36.51), (5001, 4.0, 36.51)]
    """
    points = []
    for number, line in _content_lines(text):
        location = TextLine(source, number)
        try:
            lat, lon = (float(part) for part in line.split())
        except ValueError:
            lat = lon = math.nan
        if not (math.isfinite(lat) and math.isfinite(lon)):
            allowed = "expected a latitude and a longitude"
            raise MissionError(f"{location}: {line[:40]!r}: {allowed}", file=location.file, value=line, allowed=allowed)
        problem = position_problem(lat, lon)
        if problem is not None:
            raise MissionError(**problem.error_arguments(location.file, location))
        points.append((round_to_grid(lat), round_to_grid(lon)))
    if len(points) > MAX_POINTS:
        raise MissionError(
            f"{source}: too long: {count_text(len(points), 'point')}; the limit is {MAX_POINTS}", file=source
        )
    ring = points if points[0] == points[-1] else points[1:]
    if len(ring) < 4 or ring[0] != ring[-1]:
        raise MissionError(
            f"{source}: {count_text(len(points), 'point')}: expected a return point and a closed ring of three or more"
            " corners, with the first corner repeated at the end",
            file=source,
        )
    params = (float(len(ring) - 1), 0.0, 0.0, 0.0)
    command = int(Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION)
    return number_items([MissionItem(0, command, int(Frame.GLOBAL), params, lat, lon, 0.0) for lat, lon in ring[:-1]])


def _content_lines(text: str) -> list[tuple[int, str]]:
    """Return the number and the text of each line that is neither empty nor a comment."""
    lines = enumerate(text.removeprefix("\ufeff").splitlines(), 1)
    return [(number, line.strip()) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]


# ----------------------------------------------------------------------
# The fence of a file of any format, and the text of a mission in any format.


class FenceContents(NamedTuple):
    """Fence of a file, or the rally points of a file without a fence."""

    fences: tuple[MissionItem, ...]
    rally: tuple[MissionItem, ...] = ()


def read_fence(path: Path) -> FenceContents:
    r"""Read the fence of a mission file of any format, or its rally points if it has no fence.

    Lists of fence points from ArduPilot's older tools are read, too. All other contents of the file are ignored. Raises
    MissionError as `read_mission` does, and if the file has neither a fence nor rally points.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "keep-out.fence"
    ...     _ = path.write_text("QGC WPL 110\n0 0 0 5004 200 0 0 0 36.51 -84.2 0 1\n", encoding="ascii")
    ...     [(item.command, item.params[0]) for item in read_fence(path).fences]
    [(5004, 200.0)]
    """
    mission_kind(path)
    text = _read_text(path)
    if is_point_list(text):
        contents = FenceContents(parse_fence_points(text, str(path)))
    else:
        mission = parse_mission(text, str(path))
        contents = FenceContents(mission.fences, () if mission.fences else mission.rally)
    if not any(contents):
        expected = "expected items of commands 5001 to 5004 (a fence) or 5100 (rally points)"
        raise MissionError(f"{path}: contains no fence and no rally points; {expected}", file=path)
    return contents


# Function that writes each form.
_WRITERS: dict[FileKind, Callable[[Mission], str]] = {
    "waypoints": waypoints_text,
    "plan": plan_file_text,
    "fence": fence_text,
    "rally": rally_text,
}


def mission_text(mission: Mission, kind: FileKind) -> str:
    r"""Return a mission as the text of a file; equal missions give equal bytes.

    kind: "waypoints" (QGC WPL 110), "plan" (QGroundControl's JSON), or only its "fence" or "rally" points, as WPL.

    >>> mission = parse_mission("QGC WPL 110\n1 0 3 16 0 0 0 0 36.51 -84.2 100 1\n", "short.waypoints")
    >>> mission_text(mission, "waypoints").splitlines()[2].split()
    ['1', '0', '3', '16', '0', '0', '0', '0', '36.51000000', '-84.20000000', '100.000', '1']
    """
    return _WRITERS[kind](mission)
