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
# Distance from a sphere's surface that a step aims at, m, as in the planner; the navigation error may be a third of it.
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


def apply_suggestion(
    context: MissionContext, judged: JudgedMission, finding: Finding, suggestion: Suggestion
) -> Mission:
    """Return the mission with all changes of a suggestion of a finding.

    Raises MissionError if no item can be moved for the suggestion, or if it does not change the mission's items.
    """
    source = judged.mission.source
    if not can_apply(suggestion):
        raise MissionError(f"{source}: this suggestion does not change its items", field="suggestion")
    missions = []
    # Away from a missile, try to move a single waypoint first: each one that moves may fail elsewhere.
    for max_moves in (1, None) if any(change.what == "distance" for change in suggestion) else (None,):
        edited = _EditedMission(context, judged, max_moves)
        for change in suggestion:
            _CHANGES[change.what](edited, change, finding)
        if not edited.changed:
            raise MissionError(f"{source}: no item of the mission lies there: move one by hand", field="suggestion")
        missions.append(edited.mission)
    return (
        min(missions, key=lambda mission: len(context.judge(mission).verdict.failed))
        if len(missions) > 1
        else missions[0]
    )


class _EditedMission:
    """Mission whose items are moved one by one."""

    def __init__(self, context: MissionContext, judged: JudgedMission, max_moves: int | None) -> None:
        self.context, self.mission, self.route = context, judged.mission, judged.setup.route
        self.requirements, self.max_moves, self.changed = judged.requirements, max_moves, False

    def index_of(self, waypoint: int) -> int | None:
        """Return the index of a waypoint's item in the mission's list, or None if the waypoint has no item."""
        seq = int(self.route.items[waypoint])
        indices = [k for k in places(self.mission) if self.mission.items[k].seq == seq]
        return indices[0] if indices else None

    def points(self) -> Floats:
        """Return the waypoints of the route before the change, (w, 3), m."""
        return np.asarray(self.route.waypoints)

    def shift(self, waypoints: Sequence[int], offset: Floats) -> None:
        """Move the items of waypoints, each once, except landings.  offset: east, north and up, m."""
        for index in dict.fromkeys(self.index_of(waypoint) for waypoint in waypoints):
            if index is None or self.mission.items[index].command in LANDINGS:
                continue
            position = self.context.points(self.mission)[places(self.mission).index(index)]
            if offset[0] or offset[1]:
                self.mission = moved(
                    self.mission, index, *self.context.geographic(*(position[:2] + offset[:2]).tolist())
                )
            if offset[2] and math.isfinite(position[2]):
                self.mission = at_height(self.mission, index, float(position[2] + offset[2]), float(position[2]))
            self.mission, self.changed = self.context.retuned(self.mission, index), True

    def ends_of(self, legs: Sequence[int]) -> list[int]:
        """Return the waypoints at the ends of legs, without the ends of the route unless no others exist."""
        ends = sorted({end for leg in legs for end in (leg, leg + 1)})
        inner_ends = [end for end in ends if 0 < end < self.route.legs]
        return inner_ends or ends


def _leg_of_change(change: Change, route: Route) -> int:
    if change.place.kind != "leg" or change.place.index is None or change.place.index >= route.legs:
        raise MissionError("this suggestion names no leg of the route", field="suggestion")
    return change.place.index


def _lengthen_leg(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Lengthen a leg by moving the rest of the route along the leg's course, so that no other leg changes."""
    leg = _leg_of_change(change, edited.route)
    course = float(leg_courses(edited.points())[leg])
    extra_length = change.wanted - (change.current or 0.0)
    later_waypoints = range(leg + 1, len(edited.points()))
    edited.shift(list(later_waypoints), extra_length * np.array([math.sin(course), math.cos(course), 0.0]))


def _reduce_rise(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Reduce the climb or descent of a leg by moving both ends by half, or one end if the other ends the route."""
    leg, points = _leg_of_change(change, edited.route), edited.points()
    excess = float(points[leg + 1, 2] - points[leg, 2]) - change.wanted
    is_first, is_last = leg == 0, leg + 1 == edited.route.legs
    end_fraction = 0.0 if is_last and not is_first else 1.0 if is_first and not is_last else 0.5
    edited.shift([leg], np.array([0.0, 0.0, (1.0 - end_fraction) * excess]))
    edited.shift([leg + 1], np.array([0.0, 0.0, -end_fraction * excess]))


def _set_airspeed(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Change the airspeed on a leg, on both legs of a waypoint, or on the whole route."""
    place, route = change.place, edited.route
    airspeed = change.wanted if change.most is None else 0.5 * (change.wanted + change.most)
    legs = range(route.legs)
    if place.kind == "leg":
        legs = range(_leg_of_change(change, route), _leg_of_change(change, route) + 1)
    elif place.kind == "waypoint" and place.index is not None:
        legs = range(max(0, place.index - 1), min(route.legs, place.index + 1))
    for leg in reversed(legs):
        index = edited.index_of(leg + 1)
        if index is not None:
            edited.mission = at_speed(edited.mission, index, airspeed, float(route.airspeed[leg]))
            edited.changed = True


def _make_turn_gentler(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Make a turn gentler by moving the waypoint towards the line between its neighbours."""
    points, index = edited.points(), change.place.index
    if index is None or not 0 < index < edited.route.legs:
        return
    before, corner, after = points[index - 1], points[index], points[index + 1]
    chord = after[:2] - before[:2]
    fraction = float(np.clip((corner[:2] - before[:2]) @ chord / max(float(chord @ chord), 1.0), 0.1, 0.9))
    straight_point = before[:2] + fraction * chord

    def is_gentle(step: int) -> bool:
        bent_points = np.array(
            [before, [*(corner[:2] + step / _TURN_STEPS * (straight_point - corner[:2])), corner[2]], after]
        )
        return math.degrees(abs(float(signed_turns(bent_points)[0]))) <= change.wanted - 0.1

    step = first_that_passes(range(1, _TURN_STEPS + 1), is_gentle)
    if step is not None:
        edited.shift([index], np.array([*(step / _TURN_STEPS * (straight_point - corner[:2])), 0.0]))


def _change_altitude(edited: _EditedMission, change: Change, finding: Finding) -> None:
    """Raise or lower a leg, or the legs that violate a zone, by a step."""
    rise = change.wanted if change.what == "height" else -change.wanted
    legs = (
        [_leg_of_change(change, edited.route)]
        if change.place.kind == "leg"
        else violated_legs(edited.requirements, finding)
    )
    ends = sorted({end for leg in legs for end in (leg, leg + 1)})
    edited.shift(ends, np.array([0.0, 0.0, rise]))


def _move_inside_area(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Move waypoints inside that are too near to the edges, floor or ceiling of the area."""
    scenario, points = edited.context.scenario, edited.points()
    (west, east), (south, north) = scenario.bounds.tolist()
    min_position = np.array([west, south, scenario.floor]) + change.wanted
    max_position = np.array([east, north, scenario.ceiling]) - change.wanted
    clipped = np.clip(points, min_position, max_position)
    is_outside = ((points < min_position - change.wanted) | (points > max_position + change.wanted)).any(axis=1)
    for k in np.flatnonzero(is_outside).tolist():
        edited.shift([k], clipped[k] - points[k])


def _move_away_from_missile(edited: _EditedMission, change: Change, finding: Finding) -> None:
    """Move the waypoints near the sphere of a missile away from it."""
    centre = edited.context.scenario.threats.position[change.place.index or 0]
    legs, points = violated_legs(edited.requirements, finding), edited.points()
    from_missile = points[:, :2] - centre[:2]
    distance = np.hypot(from_missile[:, 0], from_missile[:, 1])
    for k in sorted(edited.ends_of(legs), key=lambda end: float(distance[end]))[: edited.max_moves]:
        if distance[k] > 1.0:
            edited.shift([k], np.array([*((change.wanted + _SPHERE_MARGIN_M) * from_missile[k] / distance[k]), 0.0]))


def _move_sideways(edited: _EditedMission, change: Change, finding: Finding) -> None:
    """Move the legs on which a zone is violated to one side."""
    east, north = _SIDES[change.what]
    legs = violated_legs(edited.requirements, finding)
    edited.shift(edited.ends_of(legs), change.wanted * np.array([east, north, 0.0]))


_CHANGES: dict[str, Callable[[_EditedMission, Change, Finding], None]] = {
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
