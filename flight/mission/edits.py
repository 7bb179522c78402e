"""Move, raise, insert and delete items of a mission, and change speeds.

Each function returns a new mission.

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
    round_to_grid,
)
from world.errors import MissionError

# Maximum number of items of an edited mission: with more items, the studio cannot judge a drag while the pointer moves.
MAX_EDITED_ITEMS = 2_000
# Commands that belong to the next waypoint instead of the previous waypoint.
_COMMANDS_OF_NEXT_WAYPOINT = (Command.DO_LAND_START, Command.DO_RETURN_PATH_START, Command.JUMP_TAG)


def is_movable(item: MissionItem) -> bool:
    """Return True if an item can be moved, because it has a position on the map."""
    return item.command in PLACES | TAKEOFFS | LANDINGS and item.has_position


def movable_indices(mission: Mission) -> tuple[int, ...]:
    """Return the indices of the items that can be moved.

    >>> items = [MissionItem(k, c, 0, (0.0,) * 4, 46.0, 8.0, 75.0) for k, c in ((1, 16), (2, 178), (3, 16))]
    >>> movable_indices(Mission(None, tuple(items)))
    (0, 2)
    """
    return tuple(k for k, item in enumerate(mission.items) if is_movable(item))


def movable_item(mission: Mission, index: int) -> MissionItem:
    """Return the item at an index, which must be an item that can be moved on the map.

    Raises MissionError if there is no such item, or if it cannot be moved.
    """
    if not 0 <= index < len(mission.items):
        raise MissionError.at(mission.source, "item", index, f"expected 0..{len(mission.items) - 1}")
    item = mission.items[index]
    if not is_movable(item):
        raise MissionError.at(mission.source, f"item {item.seq}", item.command, "expected a command with a position")
    return item


def move_item(mission: Mission, index: int, lat_deg: float, lon_deg: float) -> Mission:
    """Return the mission with an item moved to a latitude and longitude (deg).

    The item keeps its altitude in its frame.

    >>> items = tuple(MissionItem(k, 16, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (1, 2))
    >>> move_item(Mission(None, items), 1, 46.01, 8.00000004).items[1].lon_deg
    8.0
    """
    item = movable_item(mission, index)
    return _with_replaced_item(
        mission, index, replace(item, lat_deg=round_to_grid(lat_deg), lon_deg=round_to_grid(lon_deg))
    )


def raise_items(mission: Mission, indices: Iterable[int], height_change: float) -> Mission:
    """Return the mission with some items raised, each in its altitude frame.

    indices: indices of the items in the mission's list.
    height_change: m, negative to lower the items.

    An item without an altitude is unchanged.

    >>> items = tuple(MissionItem(k, 16, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (1, 2))
    >>> [item.alt for item in raise_items(Mission(None, items), [1], 12.5).items]
    [75.0, 87.5]
    """
    for index in indices:
        item = movable_item(mission, index)
        if math.isfinite(item.alt):
            mission = _with_replaced_item(mission, index, replace(item, alt=_round_to_milli(item.alt + height_change)))
    return mission


def set_altitude(mission: Mission, index: int, amsl: float, current_amsl: float) -> Mission:
    """Return the mission with the altitude of an item changed from ``current_amsl`` to ``amsl``, m AMSL.

    The item keeps its altitude frame. An item without an altitude gets an altitude in the AMSL frame.
    """
    item = movable_item(mission, index)
    if math.isfinite(item.alt):
        return raise_items(mission, (index,), amsl - current_amsl)
    return _with_replaced_item(mission, index, replace(item, frame=int(Frame.GLOBAL), alt=_round_to_milli(amsl)))


def set_loiter_radius(mission: Mission, index: int, radius: float) -> Mission:
    """Return the mission with another radius (m) for a loiter item; the loiter keeps its direction.

    >>> items = tuple(MissionItem(k, c, 3, (2.0, -80.0, -80.0, 0.0), 46.0, 8.0, 75.0) for k, c in ((1, 18), (2, 31)))
    >>> [set_loiter_radius(Mission(None, items), k, 94.0).items[k].params for k in (0, 1)]
    [(2.0, -80.0, -94.0, 0.0), (2.0, -94.0, -80.0, 0.0)]
    """
    item = movable_item(mission, index)
    p1, p2, p3, p4 = item.params
    # A loiter to an altitude states its radius as the second parameter.
    if item.command == Command.NAV_LOITER_TO_ALT:
        p2 = math.copysign(radius, p2)
    else:
        p3 = math.copysign(radius, p3)
    return _with_replaced_item(mission, index, replace(item, params=(p1, p2, p3, p4)))


def insertion_index(mission: Mission, previous_index: int) -> int:
    """Return the index at which to insert a waypoint after an item and the item's own commands.

    >>> items = [MissionItem(k, c, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k, c in ((1, 16), (2, 206), (3, 16))]
    >>> insertion_index(Mission(None, tuple(items)), 0)
    2
    """
    index = previous_index + 1
    for item in mission.items[index:]:
        if is_navigation(item.command) or item.command in _COMMANDS_OF_NEXT_WAYPOINT:
            break
        index += 1
    return index


def insert_waypoint(
    mission: Mission, previous_index: int, lat_deg: float, lon_deg: float, height: float | None = None
) -> Mission:
    """Return the mission with a waypoint inserted after an item and the commands that belong to that item.

    previous_index: index of the item before the new waypoint.
    height: altitude of the waypoint in the altitude frame of that item, m; None for the altitude of that item.

    Raises MissionError if the mission already has the maximum number of items.

    >>> items = tuple(MissionItem(k, 16, 3, (0.0,) * 4, 46.0, 8.0, 75.0) for k in (1, 2))
    >>> longer = insert_waypoint(Mission(None, items), 0, 46.01, 8.0)
    >>> [(item.seq, item.lat_deg) for item in longer.items]
    [(1, 46.0), (2, 46.01), (3, 46.0)]
    """
    previous_item = movable_item(mission, previous_index)
    if len(mission.items) >= MAX_EDITED_ITEMS:
        raise MissionError(
            f"{mission.source}: already has {MAX_EDITED_ITEMS} items, the most that can be edited here",
            file=mission.source,
        )
    radius = previous_item.params[1] if previous_item.command == Command.NAV_WAYPOINT else 0.0
    index = insertion_index(mission, previous_index)
    waypoint = MissionItem(
        mission.items[index - 1].seq + 1,
        int(Command.NAV_WAYPOINT),
        previous_item.frame,
        (0.0, radius, 0.0, 0.0),
        round_to_grid(lat_deg),
        round_to_grid(lon_deg),
        previous_item.alt if height is None else _round_to_milli(height),
    )
    return _with_inserted_item(mission, index, waypoint)


def delete_item(mission: Mission, index: int) -> Mission:
    """Return the mission without an item; a jump to this item then leads to the next item.

    Raises MissionError if fewer than two waypoints would remain.
    """
    movable_item(mission, index)
    if len(movable_indices(mission)) <= 2:
        message = f"{mission.source}: a mission needs at least two positions"
        raise MissionError(message, file=mission.source, field="items")
    seq = mission.items[index].seq
    items = [item for k, item in enumerate(mission.items) if k != index]
    return replace(mission, items=tuple(_renumber(item, seq, -1) for item in items))


def set_airspeed(
    mission: Mission, index: int, airspeed: float, next_airspeed: float, last_index: int | None = None
) -> Mission:
    """Return the mission with another airspeed on the leg to an item, or on all legs up to a last item.

    airspeed: new airspeed on the leg to the item, m/s.
    next_airspeed: airspeed to restore after the last item, m/s.
    last_index: index of the last item; None for the item itself.

    A speed change directly before the item is edited, or else one is inserted. A second speed change after the last
    item restores ``next_airspeed``. It is omitted after the last item with a position, and before another speed change.
    """
    movable_item(mission, index)
    item_index = index if last_index is None else last_index
    has_speed_change = index > 0 and mission.items[index - 1].command == Command.DO_CHANGE_SPEED
    if has_speed_change:
        change = mission.items[index - 1]
        new_change = replace(change, params=(change.params[0], _round_to_milli(airspeed), *change.params[2:]))
        mission = _with_replaced_item(mission, index - 1, new_change)
    else:
        mission = _with_inserted_item(mission, index, _speed_item(mission.items[index].seq, airspeed))
        item_index += 1
    later_items = mission.items[item_index + 1 :]
    if not any(is_movable(item) for item in later_items) or later_items[0].command == Command.DO_CHANGE_SPEED:
        return mission
    return _with_inserted_item(mission, item_index + 1, _speed_item(mission.items[item_index].seq + 1, next_airspeed))


def _speed_item(seq: int, airspeed: float) -> MissionItem:
    """Return an item that changes the airspeed to a value, m/s."""
    params = (0.0, _round_to_milli(airspeed), -1.0, 0.0)
    return MissionItem(seq, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), params, 0.0, 0.0, 0.0)


def _with_replaced_item(mission: Mission, index: int, item: MissionItem) -> Mission:
    """Return the mission with another item at an index.

    Raises MissionError for an invalid item.
    """
    _check_item(mission, item)
    return replace(mission, items=(*mission.items[:index], item, *mission.items[index + 1 :]))


def _with_inserted_item(mission: Mission, index: int, item: MissionItem) -> Mission:
    """Return the mission with an item inserted at an index, and with later items renumbered.

    Raises MissionError for an invalid item.
    """
    _check_item(mission, item)
    renumbered_items = [_renumber(other, item.seq - 1, 1) for other in mission.items]
    return replace(mission, items=(*renumbered_items[:index], item, *renumbered_items[index:]))


def _check_item(mission: Mission, item: MissionItem) -> None:
    """Raise MissionError for an invalid item."""
    problem = item_problem(item)
    if problem is not None:
        raise MissionError(**problem.error_arguments(mission.source, f"{mission.source}: item {item.seq}"))


def _renumber(item: MissionItem, after_seq: int, shift: int) -> MissionItem:
    """Return an item with ``shift`` added to its number and its jump target, if they exceed ``after_seq``."""
    params = item.params
    if item.command == Command.DO_JUMP and params[0] > after_seq:
        params = (params[0] + shift, *params[1:])
    seq = item.seq + shift if item.seq > after_seq else item.seq
    return item if seq == item.seq and params is item.params else replace(item, seq=seq, params=params)


def _round_to_milli(value: float) -> float:
    """Round a number to a multiple of 0.001."""
    return round(value * 1e3) / 1e3
