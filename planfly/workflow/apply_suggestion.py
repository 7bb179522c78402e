"""Apply a suggestion of a failed finding to the items of the mission.

A suggestion states a change of the path.  This module chooses the items to move, as few as possible and by the minimum
distance that the finding requires.  Suggestions about the aircraft, such as a larger battery, change no mission.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from flight.mission.edits import at_height, at_speed, moved, places
from flight.mission.items import LANDINGS, Mission
from flight.mission.route import Route
from logs.verdict.findings import Finding
from logs.verdict.measures.violated_legs import violated_legs
from logs.verdict.places import Change, Suggestion
from logs.verdict.trials import first_that_passes
from planfly.workflow.mission_context import JudgedMission, MissionContext
from world.arrays import Floats
from world.errors import MissionError
from world.geometry import leg_courses, signed_turns

# Direction east and north of a change to a side.
_SIDES = {"north": (0.0, 1.0), "east": (1.0, 0.0), "south": (0.0, -1.0), "west": (-1.0, 0.0)}
# Number of steps from a corner to the straight line in which a turn is made gentler.
_TURN_STEPS = 40
# Distance beyond a sphere's edge at which a step aims, m, as in the planner: the navigation error may be a third of it.
_SPHERE_MARGIN_M = 15.0


def can_apply(suggestion: Suggestion) -> bool:
    """Return True if every change of a suggestion can be made by moving items of a mission.

    >>> from logs.verdict.places import FLIGHT, Place
    >>> can_apply((Change("length", Place("leg", 1), 300.0, 400.0, "m"),))
    True
    >>> can_apply((Change("battery", FLIGHT, None, 1.2, "1"),))
    False
    """
    return bool(suggestion) and all(change.what in _CHANGES for change in suggestion)


def apply_suggestion(context: MissionContext, judged: JudgedMission, item: Finding, suggestion: Suggestion) -> Mission:
    """Return the mission with all changes of a suggestion of a finding.

    Raises MissionError if no item can be moved for it, or if it is no change of the mission's items.
    """
    source = judged.mission.source
    if not can_apply(suggestion):
        raise MissionError(f"{source}: this suggestion does not change its items", field="suggestion")
    made = []
    # Away from a missile, try to move a single waypoint first: each one that moves may fail elsewhere.
    for most in (1, None) if any(change.what == "distance" for change in suggestion) else (None,):
        sheet = _MovableMission(context, judged, most)
        for change in suggestion:
            _CHANGES[change.what](sheet, change, item)
        if not sheet.changed:
            raise MissionError(f"{source}: no item of the mission lies there: move one by hand", field="suggestion")
        made.append(sheet.mission)
    return min(made, key=lambda mission: len(context.judge(mission).verdict.failed)) if len(made) > 1 else made[0]


class _MovableMission:
    """Mission whose items are moved one after the other."""

    def __init__(self, context: MissionContext, judged: JudgedMission, most: int | None) -> None:
        self.context, self.mission, self.route = context, judged.mission, judged.setup.route
        self.requirements, self.most, self.changed = judged.requirements, most, False

    def index_of(self, waypoint: int) -> int | None:
        """Return the index in the mission's list of the item of a waypoint, or None if no item has it."""
        seq = int(self.route.items[waypoint])
        own = [k for k in places(self.mission) if self.mission.items[k].seq == seq]
        return own[0] if own else None

    def points(self) -> Floats:
        """Return the waypoints of the route before the change, (w, 3), m."""
        return np.asarray(self.route.waypoints)

    def shift(self, waypoints: Sequence[int], by: Floats) -> None:
        """Move the items of waypoints, each once, but no landings.  by: east, north and up, m."""
        for index in dict.fromkeys(self.index_of(one) for one in waypoints):
            if index is None or self.mission.items[index].command in LANDINGS:
                continue
            here = self.context.points(self.mission)[places(self.mission).index(index)]
            if by[0] or by[1]:
                self.mission = moved(self.mission, index, *self.context.geographic(*(here[:2] + by[:2]).tolist()))
            if by[2] and math.isfinite(here[2]):
                self.mission = at_height(self.mission, index, float(here[2] + by[2]), float(here[2]))
            self.mission, self.changed = self.context.retuned(self.mission, index), True

    def ends_of(self, legs: Sequence[int]) -> list[int]:
        """Return the waypoints at the ends of legs, without the ends of the route unless there are only these."""
        ends = sorted({end for leg in legs for end in (leg, leg + 1)})
        inner = [end for end in ends if 0 < end < self.route.legs]
        return inner or ends


def _leg_of_change(change: Change, route: Route) -> int:
    if change.place.kind != "leg" or change.place.index is None or change.place.index >= route.legs:
        raise MissionError("this suggestion names no leg of the route", field="suggestion")
    return change.place.index


def _lengthen_leg(sheet: _MovableMission, change: Change, _item: Finding) -> None:
    """Lengthen a leg by moving the rest of the route along the leg's course, so that no other leg changes."""
    leg = _leg_of_change(change, sheet.route)
    course = float(leg_courses(sheet.points())[leg])
    grow = change.wanted - (change.current or 0.0)
    onward = range(leg + 1, len(sheet.points()))
    sheet.shift(list(onward), grow * np.array([math.sin(course), math.cos(course), 0.0]))


def _reduce_rise(sheet: _MovableMission, change: Change, _item: Finding) -> None:
    """Reduce the climb or descent of a leg by moving both ends by half, or one end if the other ends the route."""
    leg, points = _leg_of_change(change, sheet.route), sheet.points()
    excess = float(points[leg + 1, 2] - points[leg, 2]) - change.wanted
    first, last = leg == 0, leg + 1 == sheet.route.legs
    share = 0.0 if last and not first else 1.0 if first and not last else 0.5
    sheet.shift([leg], np.array([0.0, 0.0, (1.0 - share) * excess]))
    sheet.shift([leg + 1], np.array([0.0, 0.0, -share * excess]))


def _set_airspeed(sheet: _MovableMission, change: Change, _item: Finding) -> None:
    """Change the airspeed on a leg, on both legs of a waypoint, or on the whole route."""
    place, route = change.place, sheet.route
    wanted = change.wanted if change.most is None else 0.5 * (change.wanted + change.most)
    legs = range(route.legs)
    if place.kind == "leg":
        legs = range(_leg_of_change(change, route), _leg_of_change(change, route) + 1)
    elif place.kind == "waypoint" and place.index is not None:
        legs = range(max(0, place.index - 1), min(route.legs, place.index + 1))
    for leg in reversed(legs):
        index = sheet.index_of(leg + 1)
        if index is not None:
            sheet.mission = at_speed(sheet.mission, index, wanted, float(route.airspeed[leg]))
            sheet.changed = True


def _make_turn_gentler(sheet: _MovableMission, change: Change, _item: Finding) -> None:
    """Make a turn gentler by moving the waypoint towards the line between its neighbours."""
    points, i = sheet.points(), change.place.index
    if i is None or not 0 < i < sheet.route.legs:
        return
    before, here, after = points[i - 1], points[i], points[i + 1]
    way = after[:2] - before[:2]
    share = float(np.clip((here[:2] - before[:2]) @ way / max(float(way @ way), 1.0), 0.1, 0.9))
    foot = before[:2] + share * way

    def is_gentle(step: int) -> bool:
        corner = np.array([before, [*(here[:2] + step / _TURN_STEPS * (foot - here[:2])), here[2]], after])
        return math.degrees(abs(float(signed_turns(corner)[0]))) <= change.wanted - 0.1

    step = first_that_passes(range(1, _TURN_STEPS + 1), is_gentle)
    if step is not None:
        sheet.shift([i], np.array([*(step / _TURN_STEPS * (foot - here[:2])), 0.0]))


def _change_altitude(sheet: _MovableMission, change: Change, item: Finding) -> None:
    """Raise or lower a leg, or the legs that violate a zone, by a step."""
    up = change.wanted if change.what == "height" else -change.wanted
    legs = (
        [_leg_of_change(change, sheet.route)] if change.place.kind == "leg" else violated_legs(sheet.requirements, item)
    )
    ends = sorted({end for leg in legs for end in (leg, leg + 1)})
    sheet.shift(ends, np.array([0.0, 0.0, up]))


def _move_inside_area(sheet: _MovableMission, change: Change, _item: Finding) -> None:
    """Move waypoints inside that are too near to the edges, floor or ceiling of the area."""
    scenario, points = sheet.context.scenario, sheet.points()
    (west, east), (south, north) = scenario.bounds.tolist()
    low = np.array([west, south, scenario.floor]) + change.wanted
    high = np.array([east, north, scenario.ceiling]) - change.wanted
    inside = np.clip(points, low, high)
    outside = ((points < low - change.wanted) | (points > high + change.wanted)).any(axis=1)
    for k in np.flatnonzero(outside).tolist():
        sheet.shift([k], inside[k] - points[k])


def _move_away_from_missile(sheet: _MovableMission, change: Change, item: Finding) -> None:
    """Move the waypoints near the sphere of a missile away from it."""
    centre = sheet.context.scenario.threats.position[change.place.index or 0]
    legs, points = violated_legs(sheet.requirements, item), sheet.points()
    away = points[:, :2] - centre[:2]
    length = np.hypot(away[:, 0], away[:, 1])
    for k in sorted(sheet.ends_of(legs), key=lambda end: float(length[end]))[: sheet.most]:
        if length[k] > 1.0:
            sheet.shift([k], np.array([*((change.wanted + _SPHERE_MARGIN_M) * away[k] / length[k]), 0.0]))


def _move_sideways(sheet: _MovableMission, change: Change, item: Finding) -> None:
    """Move the legs on which a zone is violated to one side."""
    east, north = _SIDES[change.what]
    legs = violated_legs(sheet.requirements, item)
    sheet.shift(sheet.ends_of(legs), change.wanted * np.array([east, north, 0.0]))


_CHANGES: dict[str, Callable[[_MovableMission, Change, Finding], None]] = {
    "length": _lengthen_leg,
    "rise": _reduce_rise,
    "airspeed": _set_airspeed,
    "turn": _make_turn_gentler,
    "height": _change_altitude,
    "descent": _change_altitude,
    "inset": _move_inside_area,
    "distance": _move_away_from_missile,
    **dict.fromkeys(_SIDES, _move_sideways),
}
