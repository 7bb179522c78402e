"""QGroundControl's ComplexItems as the simple items that they stand for.

Surveys and corridor scans carry their items with them (TransectStyleComplexItem.Items); a fixed-wing landing pattern is
three items.  Anything else is a recipe that only its ground station can follow.
"""

import json
from typing import Any

from flight.mission.items import Command, Frame
from world.errors import MissionError

_TRANSECTS = ("survey", "CorridorScan")
_LANDING = "fwLandingPattern"


def expand_items(items: list[Any], source: str, warnings: list[str]) -> list[Any]:
    """Items of a `.plan`, the complex ones replaced by what they stand for, with a warning for each.

    Raises MissionError for a kind that cannot be replaced, by name.  What an item holds is checked later.
    """
    out: list[Any] = []
    for k, item in enumerate(items):
        kind = item.get("type", "SimpleItem") if isinstance(item, dict) else "SimpleItem"
        if kind == "SimpleItem":
            out.append(item)
            continue
        where = f"{source}: mission.items.{k}"
        name = str(item.get("complexItemType", ""))[:40] if kind == "ComplexItem" else ""
        if name in _TRANSECTS:
            made = _transects(item, where, name)
        elif name == _LANDING:
            made = _landing(item, where, _last_number(out) + 1)
        else:
            raise MissionError(
                f"{where}.type: {json.dumps(kind)[:40]} {name!r}: only SimpleItem, {', '.join(_TRANSECTS)} and"
                f" {_LANDING} are read; have the ground station turn it into items first"
            )
        warnings.append(f"{where}: {name} taken as the {len(made)} simple items that it stands for")
        out += made
    return out


def _transects(item: dict[str, Any], where: str, name: str) -> list[Any]:
    held = item.get("TransectStyleComplexItem")
    items = held.get("Items") if isinstance(held, dict) else None
    if not isinstance(items, list) or not items:
        raise MissionError(
            f"{where}.TransectStyleComplexItem.Items: {name!r} without its items: a list is expected;"
            " have the ground station save the plan anew"
        )
    return items


def _last_number(items: list[Any]) -> int:
    """Number of the last item so far."""
    number = items[-1].get("doJumpId") if items and isinstance(items[-1], dict) else None
    return number if isinstance(number, int) else len(items)


def _landing(item: dict[str, Any], where: str, number: int) -> list[Any]:
    """DO_LAND_START, the way in (a spiral down, or a waypoint), and LAND, as QGC sends them."""
    approach = _coordinate(item, "landingApproachCoordinate", where) or _coordinate(item, "loiterCoordinate", where)
    land = _coordinate(item, "landCoordinate", where)
    if approach is None or land is None:
        key = "landCoordinate" if land is None else "landingApproachCoordinate"
        raise MissionError(f"{where}.{key}: missing: latitude, longitude and altitude are expected")
    relative = item.get("altitudesAreRelative", True)
    frame = Frame.GLOBAL_RELATIVE_ALT if relative else Frame.GLOBAL
    radius = item.get("loiterRadius", 0.0)
    if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0.0 <= radius <= 1e5:
        raise MissionError(f"{where}.loiterRadius: {json.dumps(radius)[:40]}: 0..100000 m is expected")
    turn = float(radius) if item.get("loiterClockwise", True) else -float(radius)
    spiral = item.get("useLoiterToAlt", True)
    into = (
        (Command.NAV_LOITER_TO_ALT, [1.0, turn, 0.0, 1.0]) if spiral else (Command.NAV_WAYPOINT, [0.0, 0.0, 0.0, None])
    )
    made: list[tuple[int, int, list[Any]]] = [
        (Command.DO_LAND_START, Frame.MISSION, [0.0] * 7),
        (into[0], frame, [*into[1], *approach]),
        (Command.NAV_LAND, frame, [0.0, 0.0, 0.0, None, *land]),
    ]
    return [
        {
            "type": "SimpleItem",
            "autoContinue": True,
            "command": int(command),
            "doJumpId": number + k,
            "frame": int(item_frame),
            "params": params,
        }
        for k, (command, item_frame, params) in enumerate(made)
    ]


def _coordinate(item: dict[str, Any], key: str, where: str) -> list[Any] | None:
    value = item.get(key)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3:
        raise MissionError(f"{where}.{key}: {json.dumps(value)[:40]}: latitude, longitude and altitude are expected")
    return value
