"""What several formats hold alike: missions, ArduPlane's parameters and flight modes, by the names of any release."""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from pymavlink import mavutil

from flight.mission.items import Home, Mission, MissionItem, item_problem, renumbered

# ----------------------------------------------------------------------
# Missions out of items as logs hold them: one by one, whole missions again and again, and items as they are flown.


class Item(NamedTuple):
    """An item as logged: when (s), of how many items its mission is (0 where that is not logged), and the item."""

    time: float
    total: int
    item: MissionItem


def gather_items(rows: Iterable[Item]) -> list[tuple[float, tuple[MissionItem, ...]]]:
    """Missions that items, in the order of the log, come to, and when each began to hold.

    Items from number 0 on are a mission anew.  An item alone is one that is flown if it is as it was, and else one that
    was changed.

    >>> way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 75.0) for k in range(3)]
    >>> logged = [Item(1.0, 3, way[0]), Item(1.0, 3, way[1]), Item(1.0, 3, way[2]), Item(9.0, 3, way[1])]
    >>> [(start, len(items)) for start, items in gather_items(logged)]
    [(1.0, 3)]
    """
    found: list[tuple[float, dict[int, MissionItem]]] = []
    ordered = list(rows)
    for k, (time, _, item) in enumerate(ordered):
        follows = k + 1 < len(ordered) and ordered[k + 1].item.seq == 1
        if not found or (item.seq == 0 and follows and len(found[-1][1]) > 1):
            found.append((time, {}))
        elif item.seq in found[-1][1] and not _same(found[-1][1][item.seq], item):
            found.append((time, dict(found[-1][1])))
        found[-1][1][item.seq] = item
    out: list[tuple[float, tuple[MissionItem, ...]]] = []
    for start, items in found:
        whole = tuple(items[seq] for seq in sorted(items))
        if not out or not _alike(out[-1][1], whole):
            out.append((start, whole))
    return out


def _alike(one: tuple[MissionItem, ...], other: tuple[MissionItem, ...]) -> bool:
    return len(one) == len(other) and all(map(_same, one, other))


def _same(one: MissionItem, other: MissionItem) -> bool:
    return _content(one) == _content(other)


def _content(item: MissionItem) -> tuple[object, ...]:
    # As text: what is unset is NaN, which equals nothing.
    return item.seq, item.command, repr((item.params, item.lat_deg, item.lon_deg, item.alt))


def logged_mission(items: tuple[MissionItem, ...], source: str) -> Mission | None:
    """The mission of logged items, the first of number 0 being home; None where no two are left.

    An item that no autopilot could make sense of is left out and told.

    >>> way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 75.0) for k in range(3)]
    >>> made = logged_mission(tuple(way), "a.BIN")
    >>> made.home.lat_deg, [item.seq for item in made.items]
    (46.0, [1, 2])
    """
    home: Home | None = None
    kept, warnings = [], []
    for item in items:
        problem = item_problem(item)
        if problem is not None:
            warnings.append(f"item {item.seq}: left out: {problem}")
        elif item.seq == 0 and item.command == 16:
            placed = item.has_position
            home = Home(item.lat_deg, item.lon_deg, item.alt) if placed else None
        else:
            kept.append(item)
    if len(kept) < 2:
        return None
    mission = Mission(home, tuple(kept), warnings=tuple(warnings), source=source)
    numbers = {item.seq for item in kept}
    missing = sorted(set(range(min(numbers), max(numbers))) - numbers)
    if missing:
        listed = ", ".join(map(str, missing[:8]))
        mission = replace(mission, warnings=(*mission.warnings, f"the log holds no item {listed} of the mission"))
    return renumbered(mission)


# ----------------------------------------------------------------------
# Flight modes by their numbers, and which of them follow a mission.

_PLANE_AUTO = 10
# PX4's vehicle_status.nav_state (PX4, msg/VehicleStatus.msg).
_PX4_MISSION = 3
_PX4_STATES = {
    0: "MANUAL", 1: "ALTCTL", 2: "POSCTL", 3: "MISSION", 4: "LOITER", 5: "RTL", 8: "FREE", 10: "ACRO",
    12: "DESCEND", 13: "TERMINATION", 14: "OFFBOARD", 15: "STAB", 17: "TAKEOFF", 18: "LAND", 21: "ORBIT",
}  # fmt: skip
# Main mode and sub-mode of PX4's custom_mode: AUTO, MISSION.
_PX4_AUTO, _PX4_AUTO_MISSION = 4, 4


def plane_mode(number: int) -> tuple[str, bool]:
    """ArduPlane's name of a mode, and whether it follows the mission.

    >>> plane_mode(10), plane_mode(5)
    (('AUTO', True), ('FBWA', False))
    """
    return mavutil.mode_mapping_apm.get(number, f"mode {number}"), number == _PLANE_AUTO


def px4_state(number: int) -> tuple[str, bool]:
    """PX4's name of a navigation state, and whether it follows the mission.

    >>> px4_state(3), px4_state(5)
    (('MISSION', True), ('RTL', False))
    """
    return _PX4_STATES.get(number, f"state {number}"), number == _PX4_MISSION


def px4_mode(custom_mode: int) -> tuple[str, bool]:
    """PX4's name of a mode as a heartbeat carries it, and whether it follows the mission.

    >>> px4_mode(4 << 24 | 4 << 16)
    ('MISSION', True)
    """
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    mission = (main, sub) == (_PX4_AUTO, _PX4_AUTO_MISSION)
    return ("MISSION" if mission else str(mavutil.interpret_px4_mode(0, custom_mode)), mission)
