"""A suggestion of a failed finding as a change of the mission's items: what the button beside it does.

A suggestion says what of the path is to differ; which items move for it is decided here: the fewest, by as little as
the finding asks for.  What a suggestion asks of the aircraft, such as a larger battery, is no change of a mission.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import LANDINGS, Mission
from flight.mission.route import Route
from logs.verdict.findings import Finding
from logs.verdict.places import Change, Suggestion
from planfly.studio.desk import Desk, Judged
from planfly.studio.edits import at_height, at_speed, moved, places
from planfly.studio.states import violated_legs
from world.errors import MissionError
from world.geometry import leg_courses, signed_turns

Floats = NDArray[np.float64]

_PATH = (
    "length",
    "rise",
    "airspeed",
    "turn",
    "height",
    "descent",
    "inset",
    "distance",
    "north",
    "east",
    "south",
    "west",
)
_SIDES = {"north": (0.0, 1.0), "east": (1.0, 0.0), "south": (0.0, -1.0), "west": (-1.0, 0.0)}
# Steps in which a turn is made gentler, as shares of the way to the straight line.
_TURN_STEPS = 40
# Changes by a step, m, which are made again while the finding fails: so often, and by so much more than is asked then.
_STEPS = frozenset(("height", "descent", "inset", "distance", *_SIDES))
_MOST_STEPS, _FURTHER, _AND = 10, 1.5, 2.0
# m beyond a sphere's edge at which a step aims, as the planner does: navigation may be off by a third of it.
_ROOM = 15.0


def can_apply(suggestion: Suggestion) -> bool:
    """Whether all of a suggestion is a change of the mission's items.

    >>> from logs.verdict.places import FLIGHT, Place
    >>> can_apply((Change("length", Place("leg", 1), 300.0, 400.0, "m"),))
    True
    >>> can_apply((Change("battery", FLIGHT, None, 1.2, "1"),))
    False
    """
    return bool(suggestion) and all(change.what in _PATH for change in suggestion)


def apply_suggestion(desk: Desk, judged: Judged, item: Finding, which: int) -> Mission:
    """The mission with a suggestion of a finding made, until that finding passes.

    A step that the path is to make is the least: where an item moves by so much, its path moves by less.  What is still
    to do is done in further steps.  Raises MissionError where no item can be moved for it.
    """
    if not 0 <= which < len(item.suggestions) or not can_apply(item.suggestions[which]):
        raise MissionError(f"{judged.mission.source}: this suggestion is no change of its items", field="suggestion")
    suggestion = item.suggestions[which]
    # One waypoint alone first: each that moves may fail elsewhere.
    counts = (1, None) if any(change.what == "distance" for change in suggestion) else (None,)
    made = [_mended(desk, judged, item, suggestion, most) for most in counts]
    return min(made, key=lambda one: len(one.verdict.failed)).mission


def _mended(desk: Desk, judged: Judged, item: Finding, suggestion: Suggestion, most: int | None) -> Judged:
    """The mission with a suggestion made as often as its finding needs it, and judged.  most: waypoints that move."""
    kinds = [change.what for change in suggestion]
    judged = desk.judge(_changed(desk, judged, item, suggestion, most))
    for _ in range(_MOST_STEPS if set(kinds) <= _STEPS else 0):
        left = [one for one in judged.verdict.failed if (one.rule, one.place) == (item.rule, item.place)]
        alike = [(one, more) for one in left for more in one.suggestions if [change.what for change in more] == kinds]
        if not alike:
            break
        one, more = alike[0]
        further = tuple(replace(change, wanted=_FURTHER * change.wanted + _AND) for change in more)
        judged = desk.judge(_changed(desk, judged, one, further, most))
    return judged


def _changed(desk: Desk, judged: Judged, item: Finding, suggestion: Suggestion, most: int | None) -> Mission:
    """The mission with each change of a suggestion made once.  Raises MissionError where none moves an item."""
    sheet = _Sheet(desk, judged, most)
    for change in suggestion:
        _CHANGES[change.what](sheet, change, item)
    if not sheet.changed:
        raise MissionError(
            f"{judged.mission.source}: no item of the mission lies there: move one by hand", field="suggestion"
        )
    return sheet.mission


class _Sheet:
    """A mission whose items are moved one after the other."""

    def __init__(self, desk: Desk, judged: Judged, most: int | None) -> None:
        self.desk, self.mission, self.route = desk, judged.mission, judged.setup.route
        self.requirements, self.most, self.changed = judged.requirements, most, False

    def index_of(self, waypoint: int) -> int | None:
        """The item of a waypoint of the route, by its place in the mission's list; None where it is of none."""
        seq = int(self.route.items[waypoint])
        own = [k for k in places(self.mission) if self.mission.items[k].seq == seq]
        return own[0] if own else None

    def points(self) -> Floats:
        """Where the route's waypoints are, (w, 3) m, as they were before the change."""
        return np.asarray(self.route.waypoints)

    def shift(self, waypoints: Sequence[int], by: Floats) -> None:
        """Move the items of waypoints, each once, by so many metres east, north and up; a landing stays."""
        for index in dict.fromkeys(self.index_of(one) for one in waypoints):
            if index is None or self.mission.items[index].command in LANDINGS:
                continue
            here = self.desk.points(self.mission)[places(self.mission).index(index)]
            if by[0] or by[1]:
                self.mission = moved(self.mission, index, *self.desk.geographic(*(here[:2] + by[:2]).tolist()))
            if by[2] and math.isfinite(here[2]):
                self.mission = at_height(self.mission, index, float(here[2] + by[2]), float(here[2]))
            self.mission, self.changed = self.desk.retuned(self.mission, index), True

    def ends_of(self, legs: Sequence[int]) -> list[int]:
        """Waypoints at the ends of legs but the route's own ends, which stay where other waypoints can move."""
        ends = sorted({end for leg in legs for end in (leg, leg + 1)})
        inner = [end for end in ends if 0 < end < self.route.legs]
        return inner or ends


def _leg(change: Change, route: Route) -> int:
    if change.place.kind != "leg" or change.place.index is None or change.place.index >= route.legs:
        raise MissionError("this suggestion names no leg of the route", field="suggestion")
    return change.place.index


def _length(sheet: _Sheet, change: Change, _item: Finding) -> None:
    """A longer leg: what follows it moves on along its course, so that no other leg changes."""
    leg = _leg(change, sheet.route)
    course = float(leg_courses(sheet.points())[leg])
    grow = change.wanted - (change.current or 0.0)
    onward = range(leg + 1, len(sheet.points()))
    sheet.shift(list(onward), grow * np.array([math.sin(course), math.cos(course), 0.0]))


def _rise(sheet: _Sheet, change: Change, _item: Finding) -> None:
    """A leg that climbs or falls less: the end that is not the route's moves, both by half where neither is."""
    leg, points = _leg(change, sheet.route), sheet.points()
    excess = float(points[leg + 1, 2] - points[leg, 2]) - change.wanted
    first, last = leg == 0, leg + 1 == sheet.route.legs
    share = 0.0 if last and not first else 1.0 if first and not last else 0.5
    sheet.shift([leg], np.array([0.0, 0.0, (1.0 - share) * excess]))
    sheet.shift([leg + 1], np.array([0.0, 0.0, -share * excess]))


def _airspeed(sheet: _Sheet, change: Change, _item: Finding) -> None:
    """Another speed on a leg, on both legs of a waypoint, or on the whole way."""
    place, route = change.place, sheet.route
    wanted = change.wanted if change.most is None else 0.5 * (change.wanted + change.most)
    legs = range(route.legs)
    if place.kind == "leg":
        legs = range(_leg(change, route), _leg(change, route) + 1)
    elif place.kind == "waypoint" and place.index is not None:
        legs = range(max(0, place.index - 1), min(route.legs, place.index + 1))
    for leg in reversed(legs):
        index = sheet.index_of(leg + 1)
        if index is not None:
            sheet.mission = at_speed(sheet.mission, index, wanted, float(route.airspeed[leg]))
            sheet.changed = True


def _turn(sheet: _Sheet, change: Change, _item: Finding) -> None:
    """A gentler turn: the waypoint moves towards the line between its neighbours."""
    points, i = sheet.points(), change.place.index
    if i is None or not 0 < i < sheet.route.legs:
        return
    before, here, after = points[i - 1], points[i], points[i + 1]
    way = after[:2] - before[:2]
    share = float(np.clip((here[:2] - before[:2]) @ way / max(float(way @ way), 1.0), 0.1, 0.9))
    foot = before[:2] + share * way
    for step in range(1, _TURN_STEPS + 1):
        bent = here[:2] + step / _TURN_STEPS * (foot - here[:2])
        corner = np.array([before, [*bent, here[2]], after])
        if math.degrees(abs(float(signed_turns(corner)[0]))) <= change.wanted - 0.1:
            sheet.shift([i], np.array([*(bent - here[:2]), 0.0]))
            return


def _height(sheet: _Sheet, change: Change, item: Finding) -> None:
    """A leg, or the path at a zone, higher or lower by a step."""
    up = change.wanted if change.what == "height" else -change.wanted
    legs = [_leg(change, sheet.route)] if change.place.kind == "leg" else violated_legs(sheet.requirements, item)
    ends = sorted({end for leg in legs for end in (leg, leg + 1)})
    sheet.shift(ends, np.array([0.0, 0.0, up]))


def _inset(sheet: _Sheet, change: Change, _item: Finding) -> None:
    """Waypoints that are too near to the area's edges, its floor or its ceiling, moved inside."""
    scenario, points = sheet.desk.scenario, sheet.points()
    (west, east), (south, north) = scenario.bounds.tolist()
    low = np.array([west, south, scenario.floor]) + change.wanted
    high = np.array([east, north, scenario.ceiling]) - change.wanted
    inside = np.clip(points, low, high)
    outside = ((points < low - change.wanted) | (points > high + change.wanted)).any(axis=1)
    for k in np.flatnonzero(outside).tolist():
        sheet.shift([k], inside[k] - points[k])


def _distance(sheet: _Sheet, change: Change, item: Finding) -> None:
    """The waypoints about a missile's sphere, moved away from it."""
    centre = sheet.desk.scenario.threats.position[change.place.index or 0]
    legs, points = violated_legs(sheet.requirements, item), sheet.points()
    away = points[:, :2] - centre[:2]
    length = np.hypot(away[:, 0], away[:, 1])
    for k in sorted(sheet.ends_of(legs), key=lambda end: float(length[end]))[: sheet.most]:
        if length[k] > 1.0:
            sheet.shift([k], np.array([*((change.wanted + _ROOM) * away[k] / length[k]), 0.0]))


def _aside(sheet: _Sheet, change: Change, item: Finding) -> None:
    """The legs on which a zone is violated, moved to one side."""
    east, north = _SIDES[change.what]
    legs = violated_legs(sheet.requirements, item)
    sheet.shift(sheet.ends_of(legs), change.wanted * np.array([east, north, 0.0]))


_CHANGES: dict[str, Callable[[_Sheet, Change, Finding], None]] = {
    "length": _length,
    "rise": _rise,
    "airspeed": _airspeed,
    "turn": _turn,
    "height": _height,
    "descent": _height,
    "inset": _inset,
    "distance": _distance,
    **dict.fromkeys(_SIDES, _aside),
}
