"""Missions out of items as logs hold them: one by one, whole missions again and again, and items as they are flown."""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from flight.mission.items import Home, Mission, MissionItem, item_problem, renumbered


class Item(NamedTuple):
    """An item as logged: when (s), of how many items its mission is (0 where that is not logged), and the item."""

    time: float
    total: int
    item: MissionItem


def gather_items(rows: Iterable[Item]) -> list[tuple[float, tuple[MissionItem, ...]]]:
    """Missions that items, in the order of the log, come to, and when each began to hold.

    A mission begins where its first item comes and others follow, or where an item differs from the one of its number
    before it; an item that comes again as it was is one that is flown.

    >>> way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 75.0) for k in range(3)]
    >>> logged = [Item(1.0, 3, way[0]), Item(1.0, 3, way[1]), Item(1.0, 3, way[2]), Item(9.0, 3, way[1])]
    >>> [(start, len(items)) for start, items in gather_items(logged)]
    [(1.0, 3)]
    """
    missions: list[tuple[float, dict[int, MissionItem], int]] = []
    for time, total, item in rows:
        if not missions or _begins_another(missions[-1], total, item):
            missions.append((time, {}, total))
        missions[-1][1][item.seq] = item
    # An item of a mission yet to come, alone, is none.
    found = [(start, tuple(items[seq] for seq in sorted(items))) for start, items, _ in missions]
    kept = [one for k, one in enumerate(found) if len(one[1]) > 1 or k + 1 == len(found)]
    out: list[tuple[float, tuple[MissionItem, ...]]] = []
    for start, items in kept:
        if not out or out[-1][1] != items:
            out.append((start, items))
    return out


def _begins_another(last: tuple[float, dict[int, MissionItem], int], total: int, item: MissionItem) -> bool:
    _, items, before = last
    known = items.get(item.seq)
    if known is not None:
        return not _same(known, item)
    return bool(total and before and total != before)


def _same(one: MissionItem, other: MissionItem) -> bool:
    return (one.command, one.params, one.x, one.y, one.alt) == (
        other.command,
        other.params,
        other.x,
        other.y,
        other.alt,
    )


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
