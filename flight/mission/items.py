"""A MAVLink mission as data: items, home, fences and rally points."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, NamedTuple

from flight.mission.commands import Command as Command

# ----------------------------------------------------------------------
# What is not flown as a mission has it, a note a reason, with the items that it is about.


@dataclass(slots=True)
class Notes:
    """Notes by text, each with the items it is about, in the order they came up.

    >>> notes = Notes()
    >>> for seq in (9, 3, 4, 5):
    ...     notes.add("DO_SET_SERVO: not flown", seq)
    >>> notes.lines()
    ('items 3-5, 9: DO_SET_SERVO: not flown',)
    """

    _items: dict[str, list[int]] = field(default_factory=dict)

    def add(self, text: str, seq: int | None = None) -> None:
        """Note something, about an item or the whole mission; the same note twice counts once."""
        items = self._items.setdefault(text, [])
        if seq is not None and seq not in items[-1:]:
            items.append(seq)

    def lines(self) -> tuple[str, ...]:
        """One line a note: "items 3-5, 9: DO_SET_SERVO: not flown"."""
        found = []
        for text, items in self._items.items():
            numbers = sorted(set(items))
            label = f"item{'s' if len(numbers) > 1 else ''} {_ranges(numbers)}: " if numbers else ""
            found.append(label + text)
        return tuple(found)


def _ranges(numbers: list[int]) -> str:
    """Sorted numbers as "3-5, 9"."""
    parts: list[list[int]] = []
    for number in numbers:
        if not parts or number > parts[-1][1] + 1:
            parts.append([number, number])
        parts[-1][1] = number
    return ", ".join(str(low) if low == high else f"{low}-{high}" for low, high in parts)


# Most items that a mission file may hold, and the largest file (bytes): far beyond what any autopilot stores.
MAX_ITEMS = 20_000
MAX_BYTES = 16 * 2**20

# The largest number that MAVLink can carry in a parameter, a float32.
_FLOAT32 = 3.4028234663852886e38
_INT32 = 2**31 - 1
# Above any aircraft of ours, below any dry land.
_LOWEST, _HIGHEST = -1000.0, 20_000.0


C = Command
# Commands that send the aircraft to a position.
PLACES = frozenset(
    {C.NAV_WAYPOINT, C.NAV_LOITER_UNLIM, C.NAV_LOITER_TURNS, C.NAV_LOITER_TIME, C.NAV_LOITER_TO_ALT}
    | {C.NAV_SPLINE_WAYPOINT, C.NAV_PAYLOAD_PLACE}
)
TAKEOFFS = frozenset({C.NAV_TAKEOFF, C.NAV_VTOL_TAKEOFF})
LANDINGS = frozenset({C.NAV_LAND, C.NAV_VTOL_LAND})
JUMPS = frozenset({C.DO_JUMP, C.DO_JUMP_TAG})
# Steps of a flight that no fixed wing takes, and whose they are.  ArduPlane goes on to the next command
# (`Plane::start_command`), so that of the way a piece is missing; but for QuadPlanes, which land to place a payload.
OTHER_VEHICLES = {
    C.NAV_SPLINE_WAYPOINT: "a multicopter",
    C.NAV_GUIDED_ENABLE: "a multicopter or a rover",
    C.NAV_PAYLOAD_PLACE: "a multicopter or a VTOL aircraft",
    C.NAV_ATTITUDE_TIME: "a multicopter",
    C.NAV_SET_YAW_SPEED: "a rover",
    C.NAV_VTOL_TAKEOFF: "a VTOL aircraft",
    C.NAV_VTOL_LAND: "a VTOL aircraft",
    C.DO_VTOL_TRANSITION: "a VTOL aircraft",
}
FENCES = frozenset(range(5001, 5005))
# Other commands whose fifth to seventh numbers are latitude, longitude and height.
_LOCATED_DO = frozenset(
    {C.DO_SET_HOME, C.DO_LAND_START, C.DO_SET_ROI_LOCATION, C.DO_SET_ROI, C.CONDITION_GATE, C.NAV_RALLY_POINT}
)
_LAST_NAV = 95
# Steps of the flight beyond `_LAST_NAV` (`AP_Mission::is_nav_cmd`).
_NAV_BEYOND = frozenset({C.NAV_SET_YAW_SPEED, C.NAV_SCRIPT_TIME, C.NAV_ATTITUDE_TIME})


class Frame(IntEnum):
    """MAV_FRAME numbers; heights are AMSL, relative to home, or above terrain."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


_FRAMES = tuple(int(frame) for frame in Frame)
AMSL = frozenset({Frame.GLOBAL, Frame.GLOBAL_INT})
OVER_HOME = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})
OVER_TERRAIN = frozenset({Frame.GLOBAL_TERRAIN_ALT, Frame.GLOBAL_TERRAIN_ALT_INT})


def is_located(command: int, frame: int) -> bool:
    """Whether the fifth to seventh numbers of such an item are a latitude, a longitude and a height."""
    return frame != Frame.MISSION and (command <= _LAST_NAV or command in FENCES or command in _LOCATED_DO)


def is_navigation(command: int) -> bool:
    """Return True if a command is a step of the flight, so that what stands behind it waits until it is done.

    >>> is_navigation(Command.NAV_WAYPOINT), is_navigation(Command.DO_SET_CAM_TRIGG_DIST)
    (True, False)
    """
    return command <= _LAST_NAV or command in _NAV_BEYOND


def command_name(command: int) -> str:
    """Return the MAVLink name of a command without "MAV_CMD_", or its number where MAVLink has none.

    >>> command_name(16), command_name(50_000)
    ('NAV_WAYPOINT', 'command 50000')
    """
    try:
        return Command(command).name
    except ValueError:
        return f"command {command}"


def on_grid(degrees: float) -> float:
    """Double nearest to whole 1e-7 degrees, rounded, never truncated; NaN stays NaN.

    >>> on_grid(36.50000006), on_grid(-84.19999994)
    (36.5000001, -84.1999999)
    """
    return round(degrees * 1e7) / 1e7 if math.isfinite(degrees) else degrees


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One mission item.

    seq: its number in the file it came from (home is not an item).
    command: MAV_CMD.
    frame: MAV_FRAME.
    params: p1..p4, NaN where unset.
    lat_deg, lon_deg: degrees on the 1e-7 grid of MISSION_ITEM_INT, NaN where unset; for a command without a position,
        its fifth and sixth parameters as written.
    alt: m in the item's frame, NaN where unset.
    autocontinue: whether the mission goes on by itself after the item.
    """

    seq: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    alt: float
    autocontinue: bool = True

    @property
    def x(self) -> int:
        """Latitude as MISSION_ITEM_INT carries it: 1e-7 degrees, rounded; INT32_MAX where unset (MAVLink).

        A command without a position has its fifth parameter there, unscaled.
        """
        return self._scaled(self.lat_deg)

    @property
    def y(self) -> int:
        """Longitude (or the sixth parameter) as MISSION_ITEM_INT carries it."""
        return self._scaled(self.lon_deg)

    def _scaled(self, value: float) -> int:
        if not math.isfinite(value):
            return _INT32
        return round(value * 1e7) if is_located(self.command, self.frame) else round(value)

    @property
    def has_position(self) -> bool:
        """Whether its latitude and longitude are a position (0, 0 and NaN mean that they do not)."""
        if not (math.isfinite(self.lat_deg) and math.isfinite(self.lon_deg)):
            return False
        return is_located(self.command, self.frame) and (self.x, self.y) != (0, 0)


@dataclass(frozen=True, slots=True)
class Home:
    """The planned home position; alt in m AMSL."""

    lat_deg: float
    lon_deg: float
    alt: float


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera that looks straight down, and what is asked of its photos.

    across, along: what a photo shows beside and along the way, m per m above ground.
    front, side: share of it that a photo is to share with the next, and with those of the next line; None for nothing.
    interval: least time between photos, s; 0 where it is not known.
    """

    across: float
    along: float
    front: float | None = None
    side: float | None = None
    interval: float = 0.0


@dataclass(frozen=True, slots=True)
class SurveyPlan:
    """What a ground station keeps of a survey beside its items.

    photo: the way between photos that its items state, m, by which it is known; 0 for none, None for any survey.
    turn_around: how far its lines go on beyond their photos, m.
    camera: None where only distances are known.
    """

    photo: float | None
    turn_around: float = 0.0
    camera: Camera | None = None


@dataclass(frozen=True, slots=True)
class Mission:
    """A mission: what a .waypoints file, a .plan file or an upload holds.

    home: None where the file has none, or 0,0.
    items: seq strictly increasing.
    fences: items 5001..5004, one per vertex or circle.
    rally: items 5100.  Those four decide whether two missions are equal.
    cruise_speed: m/s, what a .plan file's author had the ground station assume; it is never sent to an aircraft.
    warnings: what was odd about the file but could be read.
    source: names it in messages.
    survey_plans: of its surveys, where the file keeps more of them than their items.
    autopilot: that a .plan file was written for, by the name that scenarios state; "" where nothing says so.
    """

    home: Home | None
    items: tuple[MissionItem, ...]
    fences: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    cruise_speed: float | None = field(default=None, compare=False)
    warnings: tuple[str, ...] = field(default=(), compare=False)
    source: str = field(default="mission", compare=False)
    survey_plans: tuple[SurveyPlan, ...] = field(default=(), compare=False)
    autopilot: str = field(default="", compare=False)


def renumbered(mission: Mission) -> Mission:
    """Mission whose items are numbered from 1 without gaps, as ground stations count them; 0 is home's in both forms.

    The targets of jumps move with them; a jump to an item that is not there stays one.

    >>> way = tuple(MissionItem(k, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (0, 1, 5))
    >>> [item.seq for item in renumbered(Mission(None, way)).items]
    [1, 2, 3]
    """
    numbers = {item.seq: number for number, item in enumerate(mission.items, 1)}
    if all(seq == number for seq, number in numbers.items()):
        return mission
    items = []
    for item in mission.items:
        params = item.params
        if item.command == Command.DO_JUMP:
            nowhere = max(params[0], len(numbers) + 1.0)
            params = (float(numbers.get(int(params[0]), nowhere)), *params[1:])
        items.append(replace(item, seq=numbers[item.seq], params=params))
    return replace(mission, items=tuple(items))


def shifted(items: Iterable[MissionItem], shift: int) -> tuple[MissionItem, ...]:
    """Items with a number added to each seq, and to the targets of jumps.

    >>> jump = MissionItem(3, int(Command.DO_JUMP), 2, (1.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    >>> [(item.seq, item.params[0]) for item in shifted([jump], 1)]
    [(4, 2.0)]
    """
    moved = []
    for item in items:
        params = item.params
        if item.command == Command.DO_JUMP:
            params = (params[0] + shift, *params[1:])
        moved.append(replace(item, seq=item.seq + shift, params=params))
    return tuple(moved)


class ItemProblem(NamedTuple):
    """Fault of an item: the field, the value there, and what is allowed or amiss; as text "field value: allowed"."""

    field: str
    value: float
    allowed: str

    def __str__(self) -> str:
        return f"{self.field} {self.value:.10g}: {self.allowed}"

    def at(self, file: str, where: object) -> dict[str, Any]:
        """What makes a `MissionError` of it: file: that holds the item.  where: what the message begins with."""
        return {"message": f"{where}: {self}", "file": file, **self._asdict()}


def position_problem(lat_deg: float, lon_deg: float) -> ItemProblem | None:
    """Fault of a latitude and longitude in degrees; None if nothing is."""
    if abs(lat_deg) > 90.0:
        swapped = " (latitude and longitude swapped?)" if abs(lon_deg) <= 90.0 else ""
        return ItemProblem("latitude", lat_deg, f"allowed -90..90 degrees{swapped}")
    if abs(lon_deg) > 180.0:
        return ItemProblem("longitude", lon_deg, "allowed -180..180 degrees")
    return None


def item_problem(item: MissionItem) -> ItemProblem | None:
    """Fault of an item that no autopilot could make sense of; None if nothing is.

    >>> print(item_problem(MissionItem(1, 16, 0, (0.0,) * 4, 91.0, 8.0, 75.0)))
    latitude 91: allowed -90..90 degrees (latitude and longitude swapped?)
    """
    if item.frame not in _FRAMES:
        return ItemProblem("frame", item.frame, f"allowed {', '.join(map(str, _FRAMES))}")
    for k, value in enumerate(item.params, 1):
        if abs(value) > _FLOAT32:
            return ItemProblem(f"p{k}", value, "beyond what MAVLink carries (3.4e38)")
    if is_located(item.command, item.frame):
        wrong = position_problem(item.lat_deg, item.lon_deg)
        if wrong is None and not (_LOWEST <= item.alt <= _HIGHEST or math.isnan(item.alt)):
            wrong = ItemProblem("altitude", item.alt, f"allowed {_LOWEST:.0f}..{_HIGHEST:.0f} m")
        return wrong or _count_problem(item)
    for name, value in (("latitude", item.lat_deg), ("longitude", item.lon_deg)):
        if abs(value) > _INT32:
            return ItemProblem(name, value, "beyond what MISSION_ITEM_INT carries (2147483647)")
    if abs(item.alt) > _FLOAT32:
        return ItemProblem("altitude", item.alt, "beyond what MAVLink carries (3.4e38)")
    if item.command in PLACES | TAKEOFFS | LANDINGS and (item.lat_deg or item.lon_deg):
        allowed = f"has no coordinates, and {command_name(item.command)} gives some; 2 is for the rest"
        return ItemProblem("frame", item.frame, allowed)
    return _count_problem(item)


def _count_problem(item: MissionItem) -> ItemProblem | None:
    """Fault of the parameters that count something."""
    p1, p2 = item.params[:2]
    if item.command in JUMPS:
        if not (p1 >= 0 and p1 == int(p1)):
            target = "an item's number" if item.command == Command.DO_JUMP else "the number of a tag"
            return ItemProblem("p1", p1, f"a jump's target is {target}")
        if not (p2 >= -1 and p2 == int(p2)):
            return ItemProblem("p2", p2, "a jump's count is a whole number, or -1 for without end")
    if item.command in (Command.NAV_LOITER_TURNS, Command.NAV_LOITER_TIME) and p1 < 0:
        return ItemProblem("p1", p1, "turns and seconds to loiter cannot be negative")
    if item.command in (Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION):
        if not (p1 >= 3 and p1 == int(p1)):
            return ItemProblem("p1", p1, "a fence polygon has a whole number of corners, at least 3")
    elif item.command in FENCES and not p1 > 0:
        return ItemProblem("p1", p1, "a fence circle's radius is above 0 m")
    return None
