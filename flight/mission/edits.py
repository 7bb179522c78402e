"""Move, raise, insert and delete items of a mission, and change speeds; each function returns a new mission.

An item keeps its frame and all values that were not edited, so that an unedited mission equals the opened one.
Items are identified by their index in the list; item numbers and jump targets are adapted to insertions.
"""

import math
from collections.abc import Iterable
from dataclasses import replace

from flight.mission.items import (
    LANDINGS,
    PLACES,
    TAKEOFFS,
    Command,
    Frame,
    Mission,
    MissionItem,
    is_navigation,
    item_problem,
    on_grid,
)
from world.errors import MissionError

# Maximum number of items, so that a drag is judged while the pointer moves, and the page draws all items.
MAX_EDITED = 2_000
# Commands that belong to the next waypoint instead of the previous one.
_COMMANDS_OF_NEXT_PLACE = (Command.DO_LAND_START, Command.DO_RETURN_PATH_START, Command.JUMP_TAG)


def is_place(item: MissionItem) -> bool:
    """Return True if an item has a position on the map and can be moved."""
    return item.command in PLACES | TAKEOFFS | LANDINGS and item.has_position


def places(mission: Mission) -> tuple[int, ...]:
    """Return the indices of the items that can be moved.

    >>> way = [MissionItem(k, c, 0, (0.0,) * 4, 46.0, 8.0, 75.0) for k, c in ((1, 16), (2, 178), (3, 16))]
    >>> places(Mission(None, tuple(way)))
    (0, 2)
    """
    return tuple(k for k, item in enumerate(mission.items) if is_place(item))


def checked_place(mission: Mission, index: int) -> MissionItem:
    """Return the item to edit.  Raises MissionError if there is no such item, or if it cannot be moved."""
    if not 0 <= index < len(mission.items):
        raise MissionError.at(mission.source, "item", index, f"expected 0..{len(mission.items) - 1}")
    item = mission.items[index]
    if not is_place(item):
        raise MissionError.at(
            mission.source, f"item {item.seq}", item.command, "expected a command with a place on the map"
        )
    return item


def moved(mission: Mission, index: int, lat_deg: float, lon_deg: float) -> Mission:
    """Return the mission with an item moved, at the same altitude in the item's frame.

    >>> way = tuple(MissionItem(k, 16, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (1, 2))
    >>> moved(Mission(None, way), 1, 46.01, 8.00000004).items[1].lon_deg
    8.0
    """
    item = checked_place(mission, index)
    return _with_item(mission, index, replace(item, lat_deg=on_grid(lat_deg), lon_deg=on_grid(lon_deg)))


def raised(mission: Mission, indices: Iterable[int], by: float) -> Mission:
    """Return the mission with items raised by a height in m, each in its frame.

    An item without altitude is unchanged.

    >>> way = tuple(MissionItem(k, 16, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (1, 2))
    >>> [item.alt for item in raised(Mission(None, way), [1], 12.5).items]
    [75.0, 87.5]
    """
    for index in indices:
        item = checked_place(mission, index)
        if math.isfinite(item.alt):
            mission = _with_item(mission, index, replace(item, alt=_round_to_milli(item.alt + by)))
    return mission


def at_height(mission: Mission, index: int, amsl: float, now: float) -> Mission:
    """Return the mission with the altitude AMSL of an item changed from ``now`` to ``amsl``, m.

    An item without altitude gets an altitude in the AMSL frame.
    """
    item = checked_place(mission, index)
    if math.isfinite(item.alt):
        return raised(mission, (index,), amsl - now)
    return _with_item(mission, index, replace(item, frame=int(Frame.GLOBAL), alt=_round_to_milli(amsl)))


def next_index(mission: Mission, after: int) -> int:
    """Return the index for a waypoint inserted after an item, behind all actions at that item.

    >>> way = [MissionItem(k, c, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k, c in ((1, 16), (2, 206), (3, 16))]
    >>> next_index(Mission(None, tuple(way)), 0)
    2
    """
    index = after + 1
    for item in mission.items[index:]:
        if is_navigation(item.command) or item.command in _COMMANDS_OF_NEXT_PLACE:
            break
        index += 1
    return index


def inserted(mission: Mission, after: int, lat_deg: float, lon_deg: float, height: float | None = None) -> Mission:
    """Return the mission with a waypoint inserted after an item, at `next_index`, in the frame of that item.

    height: altitude in that frame, m; None for the altitude of the item.

    Raises MissionError if the mission already has the maximum number of items.

    >>> way = tuple(MissionItem(k, 16, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (1, 2))
    >>> longer = inserted(Mission(None, way), 0, 46.01, 8.0)
    >>> [(item.seq, item.lat_deg) for item in longer.items]
    [(1, 46.0), (2, 46.01), (3, 46.0)]
    """
    place = checked_place(mission, after)
    if len(mission.items) >= MAX_EDITED:
        raise MissionError(f"{mission.source}: {MAX_EDITED} items: no more can be edited here", file=mission.source)
    radius = place.params[1] if place.command == Command.NAV_WAYPOINT else 0.0
    index = next_index(mission, after)
    waypoint = MissionItem(
        mission.items[index - 1].seq + 1,
        int(Command.NAV_WAYPOINT),
        place.frame,
        (0.0, radius, 0.0, 0.0),
        on_grid(lat_deg),
        on_grid(lon_deg),
        place.alt if height is None else _round_to_milli(height),
    )
    return _with_inserted_item(mission, index, waypoint)


def deleted(mission: Mission, index: int) -> Mission:
    """Return the mission without an item; a jump to it then goes to the next item.

    Raises MissionError if fewer than two waypoints would remain.
    """
    checked_place(mission, index)
    if len(places(mission)) <= 2:
        message = f"{mission.source}: a mission needs at least two places"
        raise MissionError(message, file=mission.source, field="items")
    seq = mission.items[index].seq
    items = [item for k, item in enumerate(mission.items) if k != index]
    return replace(mission, items=tuple(_renumber(item, seq, -1) for item in items))


def at_speed(mission: Mission, index: int, airspeed: float, after: float) -> Mission:
    """Return the mission with another airspeed on the leg to an item, and the airspeed ``after`` behind that item.

    A change of speed directly before the item is edited instead of adding an item.

    airspeed, after: m/s.
    """
    checked_place(mission, index)
    has_own_speed = index > 0 and mission.items[index - 1].command == Command.DO_CHANGE_SPEED
    if has_own_speed:
        change = mission.items[index - 1]
        new_change = replace(change, params=(change.params[0], _round_to_milli(airspeed), *change.params[2:]))
        mission, place_index = _with_item(mission, index - 1, new_change), index
    else:
        mission, place_index = (
            _with_inserted_item(mission, index, _speed_item(mission.items[index].seq, airspeed)),
            index + 1,
        )
    later_items = mission.items[place_index + 1 :]
    if not any(is_place(item) for item in later_items) or later_items[0].command == Command.DO_CHANGE_SPEED:
        return mission
    return _with_inserted_item(mission, place_index + 1, _speed_item(mission.items[place_index].seq + 1, after))


def _speed_item(seq: int, airspeed: float) -> MissionItem:
    params = (0.0, _round_to_milli(airspeed), -1.0, 0.0)
    return MissionItem(seq, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), params, 0.0, 0.0, 0.0)


def _with_item(mission: Mission, index: int, item: MissionItem) -> Mission:
    """Return the mission with an item replaced.  Raises MissionError for an invalid item."""
    _check_item(mission, item)
    return replace(mission, items=(*mission.items[:index], item, *mission.items[index + 1 :]))


def _with_inserted_item(mission: Mission, index: int, item: MissionItem) -> Mission:
    """Return the mission with an item inserted and later items renumbered.  Raises MissionError for an invalid item."""
    _check_item(mission, item)
    renumbered_items = [_renumber(other, item.seq - 1, 1) for other in mission.items]
    return replace(mission, items=(*renumbered_items[:index], item, *renumbered_items[index:]))


def _check_item(mission: Mission, item: MissionItem) -> None:
    problem = item_problem(item)
    if problem is not None:
        raise MissionError(**problem.at(mission.source, f"{mission.source}: item {item.seq}"))


def _renumber(item: MissionItem, after_seq: int, shift: int) -> MissionItem:
    """Return the item with its number and its jump target increased by ``shift`` if they are above ``after_seq``."""
    params = item.params
    if item.command == Command.DO_JUMP and params[0] > after_seq:
        params = (params[0] + shift, *params[1:])
    seq = item.seq + shift if item.seq > after_seq else item.seq
    return item if seq == item.seq and params is item.params else replace(item, seq=seq, params=params)


def _round_to_milli(value: float) -> float:
    return round(value * 1e3) / 1e3
