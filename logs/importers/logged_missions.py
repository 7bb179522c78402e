"""Interpret mission items and numbers of flight modes, which several log formats contain."""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from flight.mission.items import Command, Home, Mission, MissionItem, item_problem, with_shifted_numbers
from flight.simulation.setup import MissingItems
from logs.importers.raw_log import LoggedMission

# ----------------------------------------------------------------------
# Missions from logged items, which may be logged one by one, as whole missions repeatedly, or when they are flown.


class LoggedItem(NamedTuple):
    """A mission item as logged.

    time: time at which the item was logged, s.
    total: number of items that the mission has according to the log; 0 if not logged.
    begins_mission: True if the log shows that a new mission begins with this item.
    """

    time: float
    total: int
    item: MissionItem
    begins_mission: bool = False


class LoggedItemGroup(NamedTuple):
    """The logged items of one mission.

    time: time from which the mission applies, s.
    total: number of items that the mission has according to the log; 0 if not logged.
    items: the items, by increasing number.
    """

    time: float
    total: int
    items: tuple[MissionItem, ...]


def combine_items(rows: Iterable[LoggedItem]) -> list[LoggedItemGroup]:
    """Combine logged items, in the order of the log, into missions.

    An item 0 begins a new mission if the item after it shows that the items are logged from the start again.  Any other
    item is compared with the item of the same number in the current mission.  If both are equal, it was logged because
    it was flown.  If they differ, it was edited, and a changed mission begins.  Successive incomplete logs of the same
    mission are merged.

    >>> waypoints = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 75.0) for k in range(3)]
    >>> logged = [*(LoggedItem(1.0, 3, item) for item in waypoints), LoggedItem(9.0, 3, waypoints[1])]
    >>> [(start, total, len(items)) for start, total, items in combine_items(logged)]
    [(1.0, 3, 3)]
    """
    missions: list[tuple[float, dict[int, MissionItem]]] = []
    # The last announced number of items, for each mission.
    totals: list[int] = []
    ordered = list(rows)
    for k, (time, total, item, begins_mission) in enumerate(ordered):
        items = missions[-1][1] if missions else {}
        following = ordered[k + 1].item if k + 1 < len(ordered) else item
        # An item 0 begins a new mission if item 1 follows, or an item that is not in the mission, or differs from it.
        is_other = following.seq not in items or not _is_same_item(items[following.seq], following)
        begins_again = item.seq == 0 < following.seq and (following.seq == 1 or is_other)
        if not missions or begins_mission or (begins_again and len(items) > 1):
            missions.append((time, {}))
        elif item.seq in items and not _is_same_item(items[item.seq], item):
            missions.append((time, dict(items)))
        missions[-1][1][item.seq] = item
        if len(totals) < len(missions):
            totals.append(0)
        totals[-1] = total or totals[-1]
    combined: list[LoggedItemGroup] = []
    for (start, items), total in zip(missions, totals, strict=True):
        logged = LoggedItemGroup(start, total, tuple(items[seq] for seq in sorted(items)))
        previous = combined[-1] if combined else LoggedItemGroup(start, 0, ())
        previous_items = {item.seq: item for item in previous.items}
        common = [item for item in logged.items if item.seq in previous_items]
        # It is the same mission if all items are equal, or if the announced numbers of items and all common items are
        # equal.  Item 0, which is home, is ignored, because it is the same in all missions flown from a place.
        is_whole = len(common) == len(previous.items) == len(logged.items)
        is_announced = previous.total == total > 0 and any(item.seq > 0 for item in common)
        is_equal = all(_is_same_item(previous_items[item.seq], item) for item in common)
        if combined and is_equal and (is_whole or is_announced):
            merged = previous_items | {item.seq: item for item in logged.items}
            merged_items = tuple(merged[seq] for seq in sorted(merged))
            combined[-1] = LoggedItemGroup(previous.time, total or previous.total, merged_items)
        else:
            combined.append(logged)
    return combined


def _is_same_item(first: MissionItem, second: MissionItem) -> bool:
    """Return True if two items have the same number, command, parameters and position; frames are ignored."""
    return _make_comparison_key(first) == _make_comparison_key(second)


def _make_comparison_key(item: MissionItem) -> tuple[object, ...]:
    """Return the values of an item that must be equal in equal items.

    Numbers are texts, so that NaN equals NaN.
    """
    return item.seq, item.command, repr((item.params, item.lat_deg, item.lon_deg, item.alt))


def make_logged_mission(logged: LoggedItemGroup, source: str, origin: str) -> LoggedMission | None:
    """Make a mission from its logged items, with a waypoint of number 0 as home.

    An invalid item is left out with a warning.  If items are missing, the mission is the longest run of consecutive
    items, see `without_gaps`.  Return None for a complete mission with fewer than two items in addition to home.

    source: path of the log.
    origin: name of the log messages with the items.

    >>> waypoints = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 75.0) for k in range(3)]
    >>> made = make_logged_mission(LoggedItemGroup(1.0, 5, tuple(waypoints)), "a.BIN", "CMD").mission
    >>> made.home.lat_deg, [item.seq for item in made.items]
    (46.0, [1, 2])
    >>> make_logged_mission(LoggedItemGroup(1.0, 5, tuple(waypoints)), "a.BIN", "CMD").missing.numbers
    (3, 4)
    """
    home: Home | None = None
    items, warnings = [], []
    for item in logged.items:
        problem = item_problem(item)
        if problem is not None:
            warnings.append(f"item {item.seq}: left out: {problem}")
        # Item 0, a waypoint (command 16), is home.
        elif item.seq == 0 and item.command == 16:
            if item.has_position:
                home = Home(item.lat_deg, item.lon_deg, item.alt)
            else:
                warnings.append("item 0: left out: home is at 0, 0, which is not a position; the mission has no home")
        else:
            items.append(item)
    if logged.total and not any(item.seq == 0 for item in logged.items):
        warnings.append(f"the log lacks item 0 (home) of the mission's {logged.total} items")
    # Number 0 is reserved for home in mission files.
    shift = 1 if items and items[0].seq == 0 else 0
    end = max(logged.total - 1, logged.items[-1].seq) + shift
    mission = Mission(home, with_shifted_numbers(items, shift), warnings=tuple(warnings), source=f"{source}: {origin}")
    return without_gaps(LoggedMission(logged.time, mission, origin), logged.total, end)


def renumber_px4_items(items: Iterable[MissionItem]) -> tuple[MissionItem, ...]:
    """Renumber PX4's mission items, which start with number 0, so that they start with 1.

    A vertical take-off becomes a take-off, because PX4 flies to the position of both in the same way (docs.px4.io,
    "Mission Mode (VTOL)").

    >>> [(item.seq, item.command) for item in renumber_px4_items([MissionItem(0, 84, 0, (0.0,) * 4, 46.0, 8.0, 75.0)])]
    [(1, 22)]
    """
    vertical = Command.NAV_VTOL_TAKEOFF
    changed = (replace(item, command=int(Command.NAV_TAKEOFF)) if item.command == vertical else item for item in items)
    return with_shifted_numbers(changed, 1)


def without_gaps(logged: LoggedMission, total: int, last_number: int) -> LoggedMission | None:
    """Reduce an incomplete mission to its longest run of items with consecutive numbers.

    The run ends before its first DO_JUMP to an item outside the run, so an incomplete mission may have no items left.
    Return a complete mission unchanged, or None if it has fewer than two items.

    total: number of items that the mission has according to the log; 0 if not logged.
    last_number: highest item number that the mission has or should have; items are numbered from 1.
    """
    numbers = {item.seq for item in logged.mission.items}
    missing = tuple(sorted(set(range(1, last_number + 1)) - numbers))
    if not missing:
        return logged if len(numbers) > 1 else None
    # Longest run of consecutively numbered items, the first of equally long ones.  Each run is cut before its first
    # DO_JUMP to an item outside the run.
    runs: list[list[MissionItem]] = [[]]
    for item in logged.mission.items:
        if runs[-1] and item.seq != runs[-1][-1].seq + 1:
            runs.append([])
        runs[-1].append(item)
    for run in runs:
        indices = {float(item.seq): k for k, item in enumerate(run)}
        end = len(run)
        jumps = [(indices.get(item.params[0], end), k) for k, item in enumerate(run) if item.command == Command.DO_JUMP]
        # The farthest targets come first, because items that one jump cuts off may be the targets of another jump.
        for target, k in sorted(jumps, reverse=True):
            if target >= end:
                end = min(end, k)
        del run[end:]
    run = max(runs, key=len)
    first, last = (run[0].seq, run[-1].seq) if run else (0, 0)
    missing_items = MissingItems(missing, total, first, last, last_number)
    return replace(logged, mission=replace(logged.mission, items=tuple(run)), missing=missing_items)


# ----------------------------------------------------------------------
# Flight modes by their numbers, and which of them follow a mission.

_PLANE_AUTO = 10
# ArduPilot, ArduPlane/mode.h, "enum Number"; names as ground stations show them.
_PLANE_MODES = {
    0: "MANUAL",
    1: "CIRCLE",
    2: "STABILIZE",
    3: "TRAINING",
    4: "ACRO",
    5: "FBWA",
    6: "FBWB",
    7: "CRUISE",
    8: "AUTOTUNE",
    10: "AUTO",
    11: "RTL",
    12: "LOITER",
    13: "TAKEOFF",
    14: "AVOID_ADSB",
    15: "GUIDED",
    16: "INITIALISING",
    17: "QSTABILIZE",
    18: "QHOVER",
    19: "QLOITER",
    20: "QLAND",
    21: "QRTL",
    22: "QAUTOTUNE",
    23: "QACRO",
    24: "THERMAL",
    25: "LOITERALTQLAND",
    26: "AUTOLAND",
}
# PX4's vehicle_status.nav_state (PX4, msg/VehicleStatus.msg).
_PX4_MISSION = 3
_PX4_STATES = {
    0: "MANUAL",
    1: "ALTCTL",
    2: "POSCTL",
    3: "MISSION",
    4: "LOITER",
    5: "RTL",
    8: "FREE",
    10: "ACRO",
    12: "DESCEND",
    13: "TERMINATION",
    14: "OFFBOARD",
    15: "STAB",
    17: "TAKEOFF",
    18: "LAND",
    21: "ORBIT",
}
# Main modes of PX4's custom_mode, and the sub-modes of AUTO (PX4, src/modules/commander/px4_custom_mode.h).
_PX4_AUTO = 4
_PX4_AUTO_MISSION = 4
_PX4_MAIN = {1: "MANUAL", 2: "ALTCTL", 3: "POSCTL", 5: "ACRO", 6: "OFFBOARD", 7: "STABILIZED", 8: "RATTITUDE"}
_PX4_SUB = {2: "TAKEOFF", 3: "LOITER", 4: "MISSION", 5: "RTL", 6: "LAND", 7: "RTGS", 8: "FOLLOWME"}


def describe_plane_mode(number: int) -> tuple[str, bool]:
    """Return ArduPlane's name of a flight mode, and True if the mode follows the mission.

    >>> describe_plane_mode(10), describe_plane_mode(5)
    (('AUTO', True), ('FBWA', False))
    """
    return _PLANE_MODES.get(number, f"mode {number}"), number == _PLANE_AUTO


def describe_px4_state(number: int) -> tuple[str, bool]:
    """Return PX4's name of a navigation state, and True if the state follows the mission.

    >>> describe_px4_state(3), describe_px4_state(5)
    (('MISSION', True), ('RTL', False))
    """
    return _PX4_STATES.get(number, f"state {number}"), number == _PX4_MISSION


def describe_px4_mode(custom_mode: int) -> tuple[str, bool]:
    """Return PX4's name of the mode in a heartbeat, and True if the mode follows the mission.

    >>> describe_px4_mode(4 << 24 | 4 << 16)
    ('MISSION', True)
    """
    # PX4 has the main mode in the third byte, and the sub-mode in the fourth.
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = _PX4_SUB.get(sub) if main == _PX4_AUTO else _PX4_MAIN.get(main)
    return name or "UNKNOWN", (main, sub) == (_PX4_AUTO, _PX4_AUTO_MISSION)
