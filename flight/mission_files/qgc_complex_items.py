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
_COORDINATE = "latitude, longitude and altitude are expected"


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
        place = f"mission.items.{k}"
        name = str(item.get("complexItemType", ""))[:40] if kind == "ComplexItem" else ""
        if name in _TRANSECTS:
            made = _transects(item, source, place, name)
        elif name == _LANDING:
            made = _landing(item, source, place, _last_number(out) + 1)
        else:
            known = f"only SimpleItem, {', '.join(_TRANSECTS)} and {_LANDING} are read"
            allowed = f"{known}; have the ground station turn it into items first"
            shown = f"{json.dumps(kind)[:40]} {name!r}"
            raise MissionError.at(source, f"{place}.type", name or kind, allowed, shown=shown)
        warnings.append(f"{source}: {place}: {name} taken as the {len(made)} simple items that it stands for")
        out += made
    return out


def _transects(item: dict[str, Any], source: str, place: str, name: str) -> list[Any]:
    held = item.get("TransectStyleComplexItem")
    items = held.get("Items") if isinstance(held, dict) else None
    if not isinstance(items, list) or not items:
        field, shown = f"{place}.TransectStyleComplexItem.Items", f"{name!r} without its items"
        allowed = "a list is expected; have the ground station save the plan anew"
        raise MissionError.at(source, field, items, allowed, shown=shown)
    return items


def _last_number(items: list[Any]) -> int:
    """Number of the last item so far."""
    number = items[-1].get("doJumpId") if items and isinstance(items[-1], dict) else None
    return number if isinstance(number, int) else len(items)


def _landing(item: dict[str, Any], source: str, place: str, number: int) -> list[Any]:
    """DO_LAND_START, the way in (a spiral down, or a waypoint), and LAND, as QGC sends them."""

    def read(key: str) -> list[Any] | None:
        return _coordinate(item, key, source, place)

    approach = read("landingApproachCoordinate") or read("loiterCoordinate")
    land = read("landCoordinate")
    if approach is None or land is None:
        key = "landCoordinate" if land is None else "landingApproachCoordinate"
        raise MissionError.at(source, f"{place}.{key}", None, _COORDINATE, shown="missing")
    relative = item.get("altitudesAreRelative", True)
    frame = Frame.GLOBAL_RELATIVE_ALT if relative else Frame.GLOBAL
    radius = item.get("loiterRadius", 0.0)
    if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0.0 <= radius <= 1e5:
        shown = json.dumps(radius)[:40]
        raise MissionError.at(source, f"{place}.loiterRadius", radius, "0..100000 m is expected", shown=shown)
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


def _coordinate(item: dict[str, Any], key: str, source: str, place: str) -> list[Any] | None:
    value = item.get(key)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3:
        raise MissionError.at(source, f"{place}.{key}", value, _COORDINATE, shown=json.dumps(value)[:40])
    return value
