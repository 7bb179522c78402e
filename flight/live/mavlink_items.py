"""Mission items on the wire: MISSION_ITEM_INT made and parsed, MISSION_ITEM parsed (MAVLink mission protocol).

Made in the INT form alone: the float MISSION_ITEM moves a waypoint by up to 0.5 m.  pymavlink is imported when a
message is made, so that reading files does not wait for it.
"""

import math
from enum import IntEnum
from typing import Any

from flight.mission.items import FENCES, Command, ItemProblem, MissionItem, is_located, item_problem, on_grid
from world.errors import MissionError

_INT32_MAX = 2**31 - 1


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: which of a vehicle's three lists an item belongs to."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


def item_type(item: MissionItem) -> MissionType:
    """List that an item belongs to, by its command."""
    if item.command in FENCES:
        return MissionType.FENCE
    return MissionType.RALLY if item.command == Command.NAV_RALLY_POINT else MissionType.MISSION


def to_message(
    item: MissionItem,
    *,
    target_system: int = 1,
    target_component: int = 1,
    current: bool = False,
    seq: int | None = None,
    mission_type: MissionType | None = None,
) -> Any:
    """MISSION_ITEM_INT of an item: x and y are rounded to 1e-7 degrees, never truncated.

    seq: None keeps the item's own number.  mission_type: None takes the one of its command.

    >>> message = to_message(MissionItem(3, 16, 0, (0.0,) * 4, 46.0, 8.0, 500.0))
    >>> message.get_type(), message.seq, message.x
    ('MISSION_ITEM_INT', 3, 460000000)
    """
    from pymavlink.dialects.v20 import common

    return common.MAVLink_mission_item_int_message(
        target_system,
        target_component,
        item.seq if seq is None else seq,
        int(item.frame),
        int(item.command),
        int(current),
        int(item.autocontinue),
        *item.params,
        item.x,
        item.y,
        item.alt,
        int(item_type(item) if mission_type is None else mission_type),
    )


def from_message(message: Any, source: str) -> MissionItem:
    """Item of a MISSION_ITEM_INT or MISSION_ITEM message; ``source`` names the sender in messages.

    INT32_MAX in an integer x or y is NaN (MAVLink's "unset").  A float's latitude and longitude go to the nearest
    1e-7 degrees.  Raises MissionError, one line: item, field, value, what is allowed.
    """
    command, frame = int(message.command), int(message.frame)
    located = is_located(command, frame)
    if message.get_type() == "MISSION_ITEM":
        lat, lon = (on_grid(value) if located else value + 0.0 for value in (message.x, message.y))
    else:
        scale = 1e7 if located else 1.0
        lat, lon = (math.nan if value == _INT32_MAX else value / scale for value in (message.x, message.y))
    params = tuple(float(value) for value in (message.param1, message.param2, message.param3, message.param4))
    p1, p2, p3, p4 = (value + 0.0 for value in params)
    item = MissionItem(
        int(message.seq), command, frame, (p1, p2, p3, p4), lat, lon, float(message.z), bool(message.autocontinue)
    )
    for name, value in (*zip(("p1", "p2", "p3", "p4"), params, strict=True), ("altitude", item.alt)):
        if math.isinf(value):
            problem = ItemProblem(name, value, "a finite number, or NaN for unset")
            raise MissionError(**problem.at(source, f"{source}: item {item.seq}"))
    fault = item_problem(item)
    if fault is not None:
        raise MissionError(**fault.at(source, f"{source}: item {item.seq}"))
    return item
