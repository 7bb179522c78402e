"""Apply a suggestion of a failed finding to the items of the mission.

A suggestion states changes of the path.  This module chooses the items to move, as few as possible and by the minimum
distance that the finding requires.  An item of a landing sequence is not moved to a side, because the landing point
would remain where it is.  Suggestions about the aircraft, such as a larger battery, change no mission.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from flight.mission.altitude_frames import find_misread_altitudes
from flight.mission.edits import movable_indices, move_item, set_airspeed, set_altitude, set_loiter_radius
from flight.mission.items import LANDINGS, OVER_TERRAIN, Command, Frame, Mission
from flight.mission.route import Route
from logs.verdict.findings import Finding, undecided_findings
from logs.verdict.measures.violated_legs import violated_legs
from logs.verdict.places import Change, ItemMove, Place, Suggestion
from logs.verdict.tolerances import HEIGHT_ERROR_LIMIT_M, MIN_LEG_LENGTH_M
from logs.verdict.trials import first_that_passes
from logs.verdict.verdict import Verdict
from planfly.workflow.mission_context import JudgedMission, MissionContext
from world.arrays import Floats
from world.errors import MissionError
from world.geometry import leg_courses, signed_turns

# Direction east and north of a change to a side.
_SIDE_DIRECTIONS = {"north": (0.0, 1.0), "east": (1.0, 0.0), "south": (0.0, -1.0), "west": (-1.0, 0.0)}
# Number of steps from a corner to the straight line in which a turn is made gentler.
_TURN_STEPS = 40
# Distance from a sphere's surface that a step aims at, m, as in the planner; the navigation error may be a third of it.
_SPHERE_MARGIN_M = 15.0
# Tried shares of a change of a leg's rise that are made at the leg's end, in this order.  None: the share depends on
# the leg's position in the route.
_END_FRACTIONS = (None, 1.0, 0.0, 0.5, 0.05, 0.1, 0.2, 0.8, 0.9, 0.95)
# Smallest share of the waypoints' move that the nearest point of their legs is assumed to follow; it limits the move.
_MIN_MOVE_SHARE = 0.2


def can_apply(suggestion: Suggestion) -> bool:
    """Return True if every change of a suggestion can be made by editing the items of a mission.

    >>> from logs.verdict.places import FLIGHT, Place
    >>> can_apply((Change("length", Place("leg", 1), 300.0, 400.0, "m"),))
    True
    >>> can_apply((Change("battery", FLIGHT, None, 1.2, "1"),))
    False
    """
    return bool(suggestion) and all(change.what in _CHANGE_FUNCTIONS for change in suggestion)


def apply_suggestion(
    context: MissionContext, judged_mission: JudgedMission, finding: Finding, suggestion: Suggestion
) -> Mission:
    """Return the mission with one suggestion of a finding applied.

    If several items can be moved, all choices are tried, and judged by geometry.  The mission with the fewest failed
    findings is returned; among equal ones, the mission with the fewest findings that become failed or undecided.
    If the suggestion states moves of items, no other item is moved.

    Raises MissionError if no item can be moved for the suggestion, or if it does not change the mission's items.
    """
    source = judged_mission.mission.source
    if not can_apply(suggestion):
        raise MissionError(f"{source}: this suggestion cannot be made by moving items", field="suggestion")
    best_mission, errors = None, []
    # Away from a missile: move a single waypoint or all of them, because each moved waypoint may fail elsewhere.  Move
    # them in one direction, or each in its own direction, for a path that bends around the missile.
    # To reduce the rise of a leg: move both ends, either end, or both by unequal shares, because the neighbouring legs
    # may fail.
    choices = [_Choice()]
    if any(change.what == "distance" for change in suggestion):
        choices = [_Choice(max_moves, radially) for max_moves, radially in product((1, None), (False, True))]
    elif [change.what for change in suggestion] == ["rise"]:
        choices = [_Choice(end_fraction=end_fraction) for end_fraction in _END_FRACTIONS]
    moved_items = frozenset(move.item for change in suggestion for move in change.moves)
    open_places = _open_places(judged_mission.verdict)
    fewest_open = math.inf, math.inf
    for choice in choices:
        edited_mission = _EditedMission(context, judged_mission, choice, moved_items)
        try:
            for change in suggestion:
                _CHANGE_FUNCTIONS[change.what](edited_mission, change, finding)
        except MissionError as error:
            errors.append(error)
            continue
        if not edited_mission.is_changed:
            continue
        if len(choices) == 1:
            return edited_mission.mission
        new_open_places = _open_places(context.judge(edited_mission.mission).verdict)
        key = sum(new_open_places.values()), len(new_open_places.keys() - open_places.keys())
        if key < fewest_open:
            best_mission, fewest_open = edited_mission.mission, key
        if fewest_open[1] == 0 and (finding.rule, finding.place) not in new_open_places:
            break
    if best_mission is not None:
        return best_mission
    if errors:
        raise errors[0]
    raise MissionError(
        f"{source}: the mission has no item at the place of this suggestion: change the mission by hand",
        field="suggestion",
    )


def _open_places(verdict: Verdict) -> dict[tuple[str, Place], bool]:
    """Return the failed and undecided findings of a verdict by (rule, place).

    The value is True for a failed and False for an undecided finding.
    """
    open_findings = (*undecided_findings(verdict.findings), *verdict.failed)
    return {(finding.rule, finding.place): finding.ok is False for finding in open_findings}


def item_moves(context: MissionContext, before: Mission, after: Mission) -> tuple[ItemMove, ...]:
    """Return the moves of the items from one mission to another; items that stay are left out.

    The result is empty if items were inserted, as for a change of airspeed.

    A change of altitude is 0 if the altitude is unknown.  Stating an altitude as a height above terrain is not a move.

    before, after: the mission before and after its items were moved.
    """
    if len(before.items) != len(after.items):
        return ()
    offsets = context.item_positions(after) - context.item_positions(before)
    moves = []
    for index, (east, north, up) in zip(movable_indices(before), offsets.tolist(), strict=True):
        old, new = before.items[index], after.items[index]
        if new.frame == old.frame and math.isfinite(old.alt):
            # The altitude of a stop above terrain changes with the ground, although its item states the same height.
            up = new.alt - old.alt
        is_height_over_terrain = new.frame in OVER_TERRAIN and old.frame not in OVER_TERRAIN
        altitudes = (0.0, 0.0) if is_height_over_terrain else (old.alt, new.alt)
        if (old.lat_deg, old.lon_deg, altitudes[0]) != (new.lat_deg, new.lon_deg, altitudes[1]):
            moves.append(ItemMove(old.seq, east, north, up if math.isfinite(up) else 0.0))
    return tuple(moves)


@dataclass(frozen=True, slots=True)
class _Choice:
    """Choice of the items to move for one suggestion.

    max_moves: greatest number of waypoints to move away from a missile; None for all.
    radially: True if each of these waypoints moves in its own direction from the missile.
    end_fraction: share of a change of a leg's rise that is made at the leg's end; the rest is made at its start.  None
    makes half of the change at each end, but on the first or last leg of the route all of it at the inner waypoint.
    """

    max_moves: int | None = None
    radially: bool = False
    end_fraction: float | None = None


class _EditedMission:
    """Mission whose items are moved one by one.

    It has the route and the route requirements before the moves.
    """

    def __init__(
        self, context: MissionContext, judged: JudgedMission, choice: _Choice, moved_items: frozenset[int]
    ) -> None:
        """Start with the unchanged mission.

        judged: the mission with its verdict.
        choice: choice of the items to move.
        moved_items: numbers of the only items that may move; empty if all items may move.
        """
        self.moved_items = moved_items
        self.context, self.mission, self.route = context, judged.mission, judged.setup.route
        self.requirements, self.choice = judged.requirements, choice
        self.is_changed = False
        # Items of landing sequences: a sequence begins at its DO_LAND_START, or else with the last position before the
        # landing.
        items, indices = judged.mission.items, set[int]()
        for landing in (index for index, item in enumerate(items) if item.command in LANDINGS):
            starts = [index for index in range(landing) if items[index].command == Command.DO_LAND_START]
            positions = [index for index in movable_indices(judged.mission) if index < landing]
            indices.update(range((starts or positions or [landing])[-1], landing + 1))
        self.approach_indices = frozenset(indices)
        # Offset of each moved item so far, east, north and up, m, by its index.
        self.offsets: dict[int, Floats] = {}

    def item_index(self, waypoint: int) -> int | None:
        """Return the index in the mission's list of the item of a waypoint.

        Return None for a waypoint without an item.

        waypoint: number of the waypoint in the route.
        """
        seq = int(self.route.items[waypoint])
        indices = [index for index in movable_indices(self.mission) if self.mission.items[index].seq == seq]
        return indices[0] if indices else None

    def waypoint_positions(self) -> Floats:
        """Return the positions of the waypoints before all moves, (w, 3), m."""
        return np.asarray(self.route.positions)

    def current_position(self, waypoint: int) -> Floats:
        """Return the position of a waypoint after the moves made so far, (3,), m."""
        index = self.item_index(waypoint)
        offset = np.zeros(3) if index is None else self.offsets.get(index, np.zeros(3))
        return np.asarray(self.route.positions[waypoint] + offset)

    def is_landing(self, waypoint: int) -> bool:
        """Return True if the item of a waypoint is a landing."""
        index = self.item_index(waypoint)
        return index is not None and self.mission.items[index].command in LANDINGS

    def move_items(self, waypoints: Sequence[int], offset: Floats, *, along_approach: bool = False) -> None:
        """Move the items of waypoints by an offset; an item with several waypoints is moved once.

        Landings stay, and so do items that may not move (`moved_items`).

        offset: east, north and up, m.
        along_approach: True for a move along the final approach, the only direction in which items of a landing
            sequence may move.  Raises MissionError for any other horizontal move of such an item.
        """
        for index in dict.fromkeys(self.item_index(waypoint) for waypoint in waypoints):
            if index is None or self.mission.items[index].command in LANDINGS:
                continue
            if self.moved_items and self.mission.items[index].seq not in self.moved_items:
                continue
            if offset[:2].any() and index in self.approach_indices and not along_approach:
                raise MissionError(
                    f"{self.mission.source}: this suggestion moves item {self.mission.items[index].seq} of the landing"
                    " sequence to a side: change the mission by hand",
                    field="suggestion",
                )
            position = self.context.item_positions(self.mission)[movable_indices(self.mission).index(index)]
            moved = self.mission
            if offset[:2].any():
                moved = move_item(moved, index, *self.context.to_geographic(*(position[:2] + offset[:2]).tolist()))
            if offset[2] and math.isfinite(position[2]):
                moved = set_altitude(moved, index, float(position[2] + offset[2]), float(position[2]))
            if moved.items[index] == self.mission.items[index]:
                continue
            self.mission = moved
            self.offsets[index] = self.offsets.get(index, np.zeros(3)) + offset
            self.mission, self.is_changed = self.context.with_updated_radii(self.mission, index), True

    def end_waypoints(self, legs: Sequence[int]) -> list[int]:
        """Return the numbers of the waypoints at the ends of legs, ascending.

        The first and last waypoint of the route are left out unless the legs have no other ends.
        """
        ends = sorted({end for leg in legs for end in (leg, leg + 1)})
        inner_ends = [end for end in ends if 0 < end < self.route.legs]
        return inner_ends or ends


def _changed_leg(change: Change, route: Route) -> int:
    """Return the index of the leg that a change refers to.

    Raises MissionError if it names no leg of the route.
    """
    if change.place.kind != "leg" or change.place.index is None or change.place.index >= route.legs:
        raise MissionError("this suggestion names no leg of the route", field="suggestion")
    return change.place.index


def _lengthen_leg(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Lengthen a leg by moving its end along its course, or its start if the leg ends with a landing."""
    leg = _changed_leg(change, edited.route)
    start, end = edited.current_position(leg), edited.current_position(leg + 1)
    step = end[:2] - start[:2]
    length = math.hypot(*step)
    if length < MIN_LEG_LENGTH_M:
        course = float(leg_courses(edited.waypoint_positions())[leg])
        step, length = np.array([math.sin(course), math.cos(course)]), 1.0
    offset = (change.wanted / length - 1.0) * step
    if edited.is_landing(leg + 1):
        edited.move_items([leg], np.array([*-offset, 0.0]), along_approach=True)
    else:
        edited.move_items([leg + 1], np.array([*offset, 0.0]))


def _reduce_rise(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Reduce the climb or descent of a leg to the wanted change of altitude.

    One or both of its ends are moved.
    """
    leg = _changed_leg(change, edited.route)
    excess = float(edited.current_position(leg + 1)[2] - edited.current_position(leg)[2]) - change.wanted
    is_first, is_last = leg == 0, leg + 1 == edited.route.legs
    end_fraction = edited.choice.end_fraction
    if end_fraction is None:
        end_fraction = 0.0 if is_last and not is_first else 1.0 if is_first and not is_last else 0.5
    edited.move_items([leg], np.array([0.0, 0.0, (1.0 - end_fraction) * excess]))
    edited.move_items([leg + 1], np.array([0.0, 0.0, -end_fraction * excess]))


def _change_airspeed(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Set the airspeed on a leg, on the legs before and after a waypoint, or on the whole route.

    If the suggestion allows a range of airspeeds, the middle of the range is set.
    """
    place, route = change.place, edited.route
    airspeed = change.wanted if change.most is None else 0.5 * (change.wanted + change.most)
    legs = range(route.legs)
    if place.kind == "leg":
        legs = range(_changed_leg(change, route), _changed_leg(change, route) + 1)
    elif place.kind == "waypoint" and place.index is not None:
        legs = range(max(0, place.index - 1), min(route.legs, place.index + 1))
    for leg in reversed(legs):
        index = edited.item_index(leg + 1)
        if index is not None and airspeed != route.leg_airspeeds[leg]:
            edited.mission = set_airspeed(edited.mission, index, airspeed, float(route.leg_airspeeds[leg]))
            edited.is_changed = True


def _make_turn_gentler(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Move a waypoint towards the line between its neighbours.

    It is moved as far as its turn needs to become gentle enough.

    The waypoint is not moved if it is an end of the route, or if no move makes the turn gentle enough.
    """
    points, index = edited.waypoint_positions(), change.place.index
    if index is None or not 0 < index < edited.route.legs:
        return
    previous, corner, next_waypoint = points[index - 1], points[index], points[index + 1]
    chord = next_waypoint[:2] - previous[:2]
    fraction = float(np.clip((corner[:2] - previous[:2]) @ chord / max(float(chord @ chord), 1.0), 0.1, 0.9))
    straight_point = previous[:2] + fraction * chord

    def is_gentle(step: int) -> bool:
        """Return True if the turn is gentle enough after a step towards the straight line."""
        bent_points = np.array(
            [previous, [*(corner[:2] + step / _TURN_STEPS * (straight_point - corner[:2])), corner[2]], next_waypoint]
        )
        return math.degrees(abs(float(signed_turns(bent_points)[0]))) <= change.wanted - 0.1

    step = first_that_passes(range(1, _TURN_STEPS + 1), is_gentle)
    if step is not None:
        edited.move_items([index], np.array([*(step / _TURN_STEPS * (straight_point - corner[:2])), 0.0]))


def _change_altitude(edited: _EditedMission, change: Change, finding: Finding) -> None:
    """Raise or lower a waypoint, a leg, or the legs that violate a zone, by the wanted step.

    If the changes for two legs move the waypoint between them, it moves by the larger step, not by their sum.
    """
    sign = 1.0 if change.what == "height" else -1.0
    if change.place.kind == "waypoint" and change.place.index is not None:
        waypoints = {change.place.index}
    else:
        is_leg = change.place.kind == "leg"
        legs = [_changed_leg(change, edited.route)] if is_leg else violated_legs(edited.requirements, finding)
        waypoints = {end for leg in legs for end in (leg, leg + 1)}
    for waypoint in sorted(waypoints):
        previous_step = sign * float(edited.current_position(waypoint)[2] - edited.route.positions[waypoint, 2])
        if change.wanted > previous_step:
            edited.move_items([waypoint], np.array([0.0, 0.0, sign * (change.wanted - previous_step)]))


def _set_home_altitude(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Set the altitude of home; items with an altitude above home move with it."""
    if edited.mission.home is not None and edited.mission.home.alt != change.wanted:
        edited.mission = replace(edited.mission, home=replace(edited.mission.home, alt=change.wanted))
        edited.is_changed = True


def _set_altitude_frame(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Change the altitude frame of the items that seem misread, but not their numbers.

    An item seems misread if it fits the terrain only in the other frame.
    """
    scenario, mission, frame = edited.requirements.setup.scenario, edited.mission, Frame(int(change.wanted))
    below_ground, too_high = find_misread_altitudes(mission, scenario.origin, scenario.terrain)
    items, readings = list(mission.items), too_high if frame == Frame.GLOBAL else below_ground
    for reading in readings:
        items[reading.item_index] = replace(items[reading.item_index], frame=frame)
    if readings:
        edited.mission, edited.is_changed = replace(mission, items=tuple(items)), True


def _follow_ground(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """State the altitude of a leg's end as a height above terrain, so that the leg follows the ground.

    The mission is not changed without a terrain, or if the end has no item.

    If the start of the leg is below the required height, it is raised, but keeps its altitude frame, because another
    leg leads to it.
    """
    leg = _changed_leg(change, edited.route)
    terrain, index = edited.context.scenario.terrain, edited.item_index(leg + 1)
    if terrain is None or index is None:
        return
    start, end = edited.current_position(leg), edited.current_position(leg + 1)
    start_height, end_height = (float(place[2] - terrain.height(place[0], place[1])) for place in (start, end))
    missing_height = edited.context.scenario.limits.min_clearance_m + HEIGHT_ERROR_LIMIT_M - start_height
    if missing_height > 0.0:
        edited.move_items([leg], np.array([0.0, 0.0, float(math.ceil(missing_height))]))
    items = list(edited.mission.items)
    items[index] = replace(items[index], frame=Frame.GLOBAL_TERRAIN_ALT, alt=change.wanted)
    edited.mission, edited.is_changed = replace(edited.mission, items=tuple(items)), True
    offset = np.array([0.0, 0.0, change.wanted - end_height])
    edited.offsets[index] = edited.offsets.get(index, np.zeros(3)) + offset


def _end_with_loiter(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Turn the last waypoint into an unlimited loiter, so that the autopilot does not return by itself."""
    index = None if change.place.index is None else edited.item_index(change.place.index)
    if index is not None:
        items = list(edited.mission.items)
        items[index] = replace(items[index], command=Command.NAV_LOITER_UNLIM, params=(0.0,) * 4)
        edited.mission, edited.is_changed = replace(edited.mission, items=tuple(items)), True


def _change_loiter_radius(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Set the radius of a loiter, and keep its direction; a waypoint without an item is not changed."""
    index = None if change.place.index is None else edited.item_index(change.place.index)
    if index is not None:
        edited.mission = set_loiter_radius(edited.mission, index, change.wanted)
        edited.is_changed = True


def _move_inside_area(edited: _EditedMission, change: Change, _finding: Finding) -> None:
    """Move the waypoints outside the scenario's area into it, to the wanted distance from its borders.

    Borders are the edges, the floor and the ceiling.
    """
    scenario, points = edited.context.scenario, edited.waypoint_positions()
    (west, east), (south, north) = scenario.bounds.tolist()
    min_position = np.array([west, south, scenario.floor]) + change.wanted
    max_position = np.array([east, north, scenario.ceiling]) - change.wanted
    clipped = np.clip(points, min_position, max_position)
    is_outside = ((points < min_position - change.wanted) | (points > max_position + change.wanted)).any(axis=1)
    for waypoint in np.flatnonzero(is_outside).tolist():
        edited.move_items([waypoint], clipped[waypoint] - points[waypoint])


def _move_away_from_missile(edited: _EditedMission, change: Change, finding: Finding) -> None:
    """Move the waypoints near a missile so that the nearest point of their legs moves away from it.

    The mission is not changed if no leg violates the missile's sphere.
    """
    missile = edited.context.scenario.threats.position[change.place.index or 0, :2]
    legs, points = violated_legs(edited.requirements, finding), edited.waypoint_positions()
    if not legs:
        return
    offsets = points[:, :2] - missile
    distance = np.hypot(*offsets.T)
    waypoints = sorted(edited.end_waypoints(legs), key=lambda end: float(distance[end]))[: edited.choice.max_moves]
    if edited.choice.radially:
        for waypoint in waypoints:
            scale = (change.wanted + _SPHERE_MARGIN_M) / max(float(distance[waypoint]), 1.0)
            edited.move_items([waypoint], np.array([*(scale * offsets[waypoint]), 0.0]))
        return
    # The point on the legs that is nearest to the missile, and the direction from the missile to it.
    candidates = []
    for leg in legs:
        start, step = points[leg, :2], points[leg + 1, :2] - points[leg, :2]
        fraction = float(np.clip((missile - start) @ step / max(float(step @ step), 1.0), 0.0, 1.0))
        from_missile = start + fraction * step - missile
        candidates.append((math.hypot(*from_missile), leg, fraction, from_missile))
    nearest_distance, leg, fraction, direction = min(candidates, key=lambda candidate: candidate[0])
    if nearest_distance < 1.0:
        # The missile is on the leg: move perpendicular to the leg.
        step = points[leg + 1, :2] - points[leg, :2]
        direction, nearest_distance = np.array([-step[1], step[0]]), max(math.hypot(*step), 1.0)
    direction = direction / nearest_distance
    # The nearest point moves by this share of the waypoints' move.
    share = (1.0 - fraction) * (leg in waypoints) + fraction * (leg + 1 in waypoints)
    offset = (change.wanted + _SPHERE_MARGIN_M) / max(share, _MIN_MOVE_SHARE) * direction
    edited.move_items(waypoints, np.array([*offset, 0.0]))


def _move_sideways(edited: _EditedMission, change: Change, finding: Finding) -> None:
    """Move the ends of the legs that violate a zone east, west, north or south."""
    east, north = _SIDE_DIRECTIONS[change.what]
    legs = violated_legs(edited.requirements, finding)
    edited.move_items(edited.end_waypoints(legs), change.wanted * np.array([east, north, 0.0]))


def _land_from_other_end(edited: _EditedMission, _change: Change, _finding: Finding) -> None:
    """Turn the last landing sequence by half a turn about the landing point.

    The landing then leads over the strip in the opposite direction.  A mission without a landing is not changed.
    """
    mission, movable = edited.mission, movable_indices(edited.mission)
    landings = [index for index in movable if mission.items[index].command in LANDINGS]
    waypoints = {edited.item_index(waypoint): waypoint for waypoint in range(edited.route.legs + 1)}
    if not landings:
        return
    positions = edited.context.item_positions(mission)
    landing_point = positions[movable.index(landings[-1])]
    for index, position in zip(movable, positions, strict=True):
        if index in edited.approach_indices and index in waypoints:
            offset = 2.0 * (landing_point - position)
            edited.move_items([waypoints[index]], np.array([*offset[:2], 0.0]), along_approach=True)


_CHANGE_FUNCTIONS: dict[str, Callable[[_EditedMission, Change, Finding], None]] = {
    "length": _lengthen_leg,
    "rise": _reduce_rise,
    "airspeed": _change_airspeed,
    "turn": _make_turn_gentler,
    "height": _change_altitude,
    "descent": _change_altitude,
    "home altitude": _set_home_altitude,
    "altitude frame": _set_altitude_frame,
    "terrain height": _follow_ground,
    "landing course": _land_from_other_end,
    "end loiter": _end_with_loiter,
    "radius": _change_loiter_radius,
    "inset": _move_inside_area,
    "distance": _move_away_from_missile,
    **dict.fromkeys(_SIDE_DIRECTIONS, _move_sideways),
}
