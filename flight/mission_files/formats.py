"""Read and write mission files, by suffix and content."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

from flight.mission.items import MAX_BYTES, Mission, MissionItem
from flight.mission_files.qgc_plan import parse_plan_file, plan_file_text
from flight.mission_files.wpl import (
    fence_text,
    is_point_list,
    parse_fence_points,
    parse_waypoints,
    rally_text,
    waypoints_text,
)
from world.errors import MissionError
from world.files import missing_text, read_small_file, utf8_text

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

# Function that writes each form.
_WRITERS: dict[FileKind, Callable[[Mission], str]] = {
    "waypoints": waypoints_text,
    "plan": plan_file_text,
    "fence": fence_text,
    "rally": rally_text,
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


def parse_mission(text: str, source: str) -> Mission:
    """Parse the text of a mission: a `.plan` if it starts with a brace or bracket, otherwise WPL 110.

    source: name of the mission in messages; a name that ends with ``.plan`` also selects a `.plan`.

    >>> parse_mission('{"fileType": "Plan"}', "a mission")
    Traceback (most recent call last):
        ...
    world.errors.MissionError: a mission: ...
    """
    if text.removeprefix("\ufeff").lstrip()[:1] in ("{", "["):
        return parse_plan_file(text, source)
    if source.lower().endswith(".plan") and not text.removeprefix("\ufeff").lstrip().startswith("QGC"):
        return parse_plan_file(text, source)
    return parse_waypoints(text, source)


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


def mission_text(mission: Mission, kind: FileKind) -> str:
    r"""Return a mission as the text of a file; equal missions give equal bytes.

    kind: "waypoints" (QGC WPL 110), "plan" (QGroundControl's JSON), or only its "fence" or "rally" points, as WPL.

    >>> mission = parse_mission("QGC WPL 110\n1 0 3 16 0 0 0 0 36.51 -84.2 100 1\n", "short.waypoints")
    >>> mission_text(mission, "waypoints").splitlines()[2].split()
    ['1', '0', '3', '16', '0', '0', '0', '0', '36.51000000', '-84.20000000', '100.000', '1']
    """
    return _WRITERS[kind](mission)


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
