"""Represent a MAVLink mission by its items, home, fences and rally points."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, NamedTuple

from flight.mission.commands import Command as Command

# ----------------------------------------------------------------------
# Notes on items that are not flown as written, grouped by reason.


@dataclass(slots=True)
class Notes:
    """Notes by text, each with its items, in the order in which they were added.

    >>> notes = Notes()
    >>> for seq in (9, 3, 4, 5):
    ...     notes.add("DO_SET_SERVO is not flown", seq)
    >>> notes.lines()
    ('items 3-5, 9: DO_SET_SERVO is not flown',)
    >>> for seq in (12, 14, 16, 17):
    ...     notes.add("DO_SET_SERVO is not flown", seq)
    >>> notes.lines()
    ('items 3-5, 9, 12 and 3 more: DO_SET_SERVO is not flown',)
    """

    _items: dict[str, list[int]] = field(default_factory=dict)

    def add(self, text: str, seq: int | None = None) -> None:
        """Add a note on an item, by its number, or on the whole mission; ignore a note that exists already."""
        items = self._items.setdefault(text, [])
        if seq is not None and seq not in items[-1:]:
            items.append(seq)

    def lines(self) -> tuple[str, ...]:
        """Return one line per note: "items 3-5, 9: DO_SET_SERVO is not flown".

        Beyond `_MAX_LISTED_RANGES` ranges, the remaining items are counted: "items 3-5, 9, 12 and 3 more".
        """
        lines = []
        for text, items in self._items.items():
            numbers = sorted(set(items))
            if not numbers:
                lines.append(text)
                continue
            ranges: list[list[int]] = []
            for number in numbers:
                if not ranges or number > ranges[-1][1] + 1:
                    ranges.append([number, number])
                ranges[-1][1] = number
            listed = ranges[:_MAX_LISTED_RANGES]
            range_text = ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in listed)
            unlisted_count = len(numbers) - sum(last - first + 1 for first, last in listed)
            if unlisted_count:
                range_text += f" and {unlisted_count} more"
            lines.append(f"item{'s' if len(numbers) > 1 else ''} {range_text}: {text}")
        return tuple(lines)


# Largest number of ranges of items that a note lists; the other items are counted.
_MAX_LISTED_RANGES = 3
# Largest number of items in a mission file, far beyond what any autopilot stores.
MAX_ITEMS = 20_000
# Largest mission file, bytes.
MAX_BYTES = 16 * 2**20
# Smallest distance between photos, m: a line of 100 km has 1,000,000 of them.
MIN_PHOTO_DISTANCE_M = 0.1

# Largest number that MAVLink can carry in a parameter, a float32.
_MAX_FLOAT32 = 3.4028234663852886e38
# Largest number that MISSION_ITEM_INT can carry in its coordinates, an int32.
_MAX_INT32 = 2**31 - 1
# Lowest altitude of an item, m: below any dry land.
_MIN_ALTITUDE_M = -1000.0
# Highest altitude of an item, m: above the ceiling of any aircraft here.
_MAX_ALTITUDE_M = 20_000.0


C = Command
# Commands that send the aircraft to a position.
PLACES = frozenset(
    {C.NAV_WAYPOINT, C.NAV_LOITER_UNLIM, C.NAV_LOITER_TURNS, C.NAV_LOITER_TIME, C.NAV_LOITER_TO_ALT}
    | {C.NAV_SPLINE_WAYPOINT, C.NAV_PAYLOAD_PLACE}
)
# Commands that take off.
TAKEOFFS = frozenset({C.NAV_TAKEOFF, C.NAV_VTOL_TAKEOFF})
# Commands that land.
LANDINGS = frozenset({C.NAV_LAND, C.NAV_VTOL_LAND})
# Commands that switch the camera on or off along a leg.
CAMERA_SWITCHES = frozenset(
    {C.DO_SET_CAM_TRIGG_DIST, C.IMAGE_START_CAPTURE, C.VIDEO_START_CAPTURE}
    | {C.IMAGE_STOP_CAPTURE, C.VIDEO_STOP_CAPTURE}
)
# Commands that jump to another item.
JUMPS = frozenset({C.DO_JUMP, C.DO_JUMP_TAG})
# Navigation commands for other vehicles, with the kind of vehicle. ArduPlane continues with the next command
# (`Plane::start_command`), so that a piece of the path is missing; only QuadPlanes land to place a payload.
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
# Commands of fence items.
FENCES = frozenset(range(5001, 5005))
# Other commands whose fifth to seventh parameters are latitude, longitude and altitude.
_LOCATED_COMMANDS = frozenset(
    {C.DO_SET_HOME, C.DO_LAND_START, C.DO_SET_ROI_LOCATION, C.DO_SET_ROI, C.CONDITION_GATE, C.NAV_RALLY_POINT}
)
# Last of the contiguous navigation commands.
_LAST_NAV_COMMAND = 95
# Navigation commands beyond `_LAST_NAV_COMMAND` (`AP_Mission::is_nav_cmd`).
_OTHER_NAV_COMMANDS = frozenset({C.NAV_SET_YAW_SPEED, C.NAV_SCRIPT_TIME, C.NAV_ATTITUDE_TIME})


class Frame(IntEnum):
    """MAV_FRAME numbers; altitudes are AMSL, relative to home, or above terrain."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


# All frames, as numbers.
_FRAMES = tuple(int(frame) for frame in Frame)
# Frames with altitudes above mean sea level.
AMSL = frozenset({Frame.GLOBAL, Frame.GLOBAL_INT})
# Frames with heights above home.
OVER_HOME = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})
# Frames with heights above terrain.
OVER_TERRAIN = frozenset({Frame.GLOBAL_TERRAIN_ALT, Frame.GLOBAL_TERRAIN_ALT_INT})


def is_located(command: int, frame: int) -> bool:
    """Return True if items with this MAV_CMD and MAV_FRAME carry a latitude, longitude and altitude."""
    return frame != Frame.MISSION and (
        command <= _LAST_NAV_COMMAND or command in FENCES or command in _LOCATED_COMMANDS
    )


def is_navigation(command: int) -> bool:
    """Return True for a navigation command; commands after it wait until it is complete.

    >>> is_navigation(Command.NAV_WAYPOINT), is_navigation(Command.DO_SET_CAM_TRIGG_DIST)
    (True, False)
    """
    return command <= _LAST_NAV_COMMAND or command in _OTHER_NAV_COMMANDS


def command_name(command: int) -> str:
    """Return the MAVLink name of a command without "MAV_CMD_", or its number if MAVLink has none.

    >>> command_name(16), command_name(50_000)
    ('NAV_WAYPOINT', 'command 50000')
    """
    try:
        return Command(command).name
    except ValueError:
        return f"command {command}"


def round_to_grid(degrees: float) -> float:
    """Round degrees to the nearest multiple of 1e-7, the resolution of MISSION_ITEM_INT; NaN stays NaN.

    >>> round_to_grid(36.50000006), round_to_grid(-84.19999994)
    (36.5000001, -84.1999999)
    """
    return round(degrees * 1e7) / 1e7 if math.isfinite(degrees) else degrees


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One mission item.

    seq: its number in its file (home is not an item).
    command: MAV_CMD.
    frame: MAV_FRAME.
    params: p1..p4, NaN where unset.
    lat_deg, lon_deg: degrees on the 1e-7 grid of MISSION_ITEM_INT, NaN where unset; for a command without a position,
        its fifth and sixth parameters as written.
    alt: m in the item's frame, NaN where unset.
    autocontinue: True if the mission continues by itself after the item.
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
        """Latitude as in MISSION_ITEM_INT: 1e-7 degrees, rounded; INT32_MAX if unset (MAVLink).

        For a command without a position the value is the fifth parameter, unscaled.
        """
        return self._encode_coordinate(self.lat_deg)

    @property
    def y(self) -> int:
        """Longitude as in MISSION_ITEM_INT, or the unscaled sixth parameter of a command without a position."""
        return self._encode_coordinate(self.lon_deg)

    def _encode_coordinate(self, value: float) -> int:
        """Convert a latitude or longitude (degrees) to the int32 of MISSION_ITEM_INT; INT32_MAX for NaN.

        A command without a position carries an unscaled parameter in this field.
        """
        if not math.isfinite(value):
            return _MAX_INT32
        return round(value * 1e7) if is_located(self.command, self.frame) else round(value)

    @property
    def has_position(self) -> bool:
        """True if the item has a position; a latitude and longitude of 0, 0 or NaN is not a position."""
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
    """A camera that looks straight down, and the required photo overlap.

    across, along: footprint of a photo across and along the track, m per m above ground.
    front, side: required overlap with the next photo and with the photos of the next line, as a fraction of the
        footprint; None for no requirement.
    interval: minimum time between photos, s; 0 if unknown.
    pixels_across: pixels of a photo across the track; 0 if unknown.
    focal_length_mm: focal length, from which messages derive the size of the sensor; 10 mm if unknown.
    """

    across: float
    along: float
    front: float | None = None
    side: float | None = None
    interval: float = 0.0
    pixels_across: float = 0.0
    focal_length_mm: float = field(default=10.0, compare=False)


@dataclass(frozen=True, slots=True)
class SurveyPlan:
    """Settings of a survey that a ground station stores in addition to its items.

    photo: distance between photos that the survey's items state, m, which identifies the survey; 0 for none, None for
        any survey.
    turn_around: extension of its lines beyond their photos, m.
    camera: camera, or None if only distances are known.
    stated_photo: distance between photos by the settings of the camera, m; 0 if they state none.
    height: height of the lines by the settings of the camera, above home or above the ground, m; 0 if they state none,
        or if the lines follow the terrain.
    """

    photo: float | None
    turn_around: float = 0.0
    camera: Camera | None = None
    stated_photo: float = 0.0
    height: float = 0.0


@dataclass(frozen=True, slots=True)
class Mission:
    """A mission: the content of a .waypoints file, a .plan file or an upload.

    home: None if the file states none, or states 0, 0.
    items: seq strictly increasing.
    fences: items 5001..5004, one per vertex or circle.
    rally: items 5100. Two missions are equal if these four fields are equal.
    cruise_speed: m/s, the speed that a .plan file's author entered for the ground station's estimates; it is never sent
        to an aircraft.
    warnings: unusual contents of the file that could still be read.
    source: name of the mission in messages.
    survey_plans: settings of its surveys that a .plan file stores in addition to the items.
    autopilot: autopilot that a .plan file was written for, by its name in scenarios; "" if unknown.
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


def renumber_items(mission: Mission) -> Mission:
    """Return a mission with its items numbered from 1 without gaps, as ground stations number them.

    The targets of jumps are renumbered, too. A jump to a missing item still leads to a missing item.

    >>> items = tuple(MissionItem(k, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (0, 1, 5))
    >>> [item.seq for item in renumber_items(Mission(None, items)).items]
    [1, 2, 3]
    """
    numbers = {item.seq: number for number, item in enumerate(mission.items, 1)}
    if all(seq == number for seq, number in numbers.items()):
        return mission
    items = []
    for item in mission.items:
        params = item.params
        if item.command == Command.DO_JUMP:
            missing_number = max(params[0], len(numbers) + 1.0)
            params = (float(numbers.get(int(params[0]), missing_number)), *params[1:])
        items.append(replace(item, seq=numbers[item.seq], params=params))
    return replace(mission, items=tuple(items))


def with_shifted_numbers(items: Iterable[MissionItem], shift: int) -> tuple[MissionItem, ...]:
    """Return items with ``shift`` added to each item number and to each jump target.

    >>> jump = MissionItem(3, int(Command.DO_JUMP), 2, (1.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    >>> [(item.seq, item.params[0]) for item in with_shifted_numbers([jump], 1)]
    [(4, 2.0)]
    """
    shifted_items = []
    for item in items:
        params = item.params
        if item.command == Command.DO_JUMP:
            params = (params[0] + shift, *params[1:])
        shifted_items.append(replace(item, seq=item.seq + shift, params=params))
    return tuple(shifted_items)


class ItemProblem(NamedTuple):
    """Fault of an item: the field, its value, and the allowed values or a description of the fault.

    Its text is "field value: allowed".
    """

    field: str
    value: float
    allowed: str

    def __str__(self) -> str:
        """Return the problem as text: field, value and allowed values."""
        return f"{self.field} {self.value:.10g}: {self.allowed}"

    def error_arguments(self, file: str, location: object) -> dict[str, Any]:
        """Return the keyword arguments of a `MissionError` that reports this problem.

        file: file that holds the item.
        location: beginning of the message, such as "survey.plan: item 3".
        """
        return {"message": f"{location}: {self}", "file": file, **self._asdict()}


def position_problem(lat_deg: float, lon_deg: float) -> ItemProblem | None:
    """Return the fault of a latitude and longitude (degrees), or None if both are valid."""
    if abs(lat_deg) > 90.0:
        hint = " (latitude and longitude swapped?)" if abs(lon_deg) <= 90.0 else ""
        return ItemProblem("latitude", lat_deg, f"allowed -90..90 degrees{hint}")
    if abs(lon_deg) > 180.0:
        return ItemProblem("longitude", lon_deg, "allowed -180..180 degrees")
    return None


def item_problem(item: MissionItem) -> ItemProblem | None:
    """Return the fault of an item that no autopilot could interpret, or None for a valid item.

    >>> print(item_problem(MissionItem(1, 16, 0, (0.0,) * 4, 91.0, 8.0, 75.0)))
    latitude 91: allowed -90..90 degrees (latitude and longitude swapped?)
    """
    if item.frame not in _FRAMES:
        return ItemProblem("frame", item.frame, f"allowed {', '.join(map(str, _FRAMES))}")
    for number, value in enumerate(item.params, 1):
        if abs(value) > _MAX_FLOAT32:
            return ItemProblem(f"p{number}", value, "beyond what MAVLink carries (3.4e38)")
    if is_located(item.command, item.frame):
        problem = position_problem(item.lat_deg, item.lon_deg)
        if problem is None and not (_MIN_ALTITUDE_M <= item.alt <= _MAX_ALTITUDE_M or math.isnan(item.alt)):
            problem = ItemProblem("altitude", item.alt, f"allowed {_MIN_ALTITUDE_M:.0f}..{_MAX_ALTITUDE_M:.0f} m")
        return problem or _count_problem(item)
    for name, value in (("latitude", item.lat_deg), ("longitude", item.lon_deg)):
        if abs(value) > _MAX_INT32:
            return ItemProblem(name, value, "beyond what MISSION_ITEM_INT carries (2147483647)")
    if abs(item.alt) > _MAX_FLOAT32:
        return ItemProblem("altitude", item.alt, "beyond what MAVLink carries (3.4e38)")
    if item.command in PLACES | TAKEOFFS | LANDINGS and (item.lat_deg or item.lon_deg):
        allowed = f"has no coordinates, but {command_name(item.command)} states a position: expected a global frame"
        return ItemProblem("frame", item.frame, allowed)
    return _count_problem(item)


def _count_problem(item: MissionItem) -> ItemProblem | None:
    """Return the fault of a count, size or jump target in an item's parameters, or None if there is none."""
    p1, p2 = item.params[:2]
    if item.command in JUMPS:
        if not (p1 >= 0 and p1 == int(p1)):
            target = "an item's number" if item.command == Command.DO_JUMP else "the number of a tag"
            return ItemProblem("p1", p1, f"a jump's target is {target}")
        if not (p2 >= -1 and p2 == int(p2)):
            return ItemProblem("p2", p2, "a jump's count is a whole number, or -1 to repeat indefinitely")
    if item.command in (Command.NAV_LOITER_TURNS, Command.NAV_LOITER_TIME) and p1 < 0:
        return ItemProblem("p1", p1, "turns and seconds to loiter cannot be negative")
    if item.command == Command.DO_SET_CAM_TRIGG_DIST and 0.0 < p1 < MIN_PHOTO_DISTANCE_M:
        allowed = f"a distance between photos is 0 for off, or at least {MIN_PHOTO_DISTANCE_M:g} m"
        return ItemProblem("p1", p1, allowed)
    if item.command in (Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION):
        if not (p1 >= 3 and p1 == int(p1)):
            return ItemProblem("p1", p1, "a fence polygon has a whole number of corners, at least 3")
    elif item.command in FENCES and not p1 > 0:
        return ItemProblem("p1", p1, "a fence circle's radius must be above 0 m")
    return None
