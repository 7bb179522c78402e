"""Lay out loiters on the map, from joining the circle to leaving it.

A loiter consists of the corners of a polygon around its circle, each with an arc of the circle's radius. The arcs
touch, so that the path is the circle, while turns, legs, altitudes and clearances are judged as everywhere else. The
path joins and leaves the circle on tangents.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from flight.mission.items import TAKEOFFS, Notes
from flight.mission.itinerary import MAX_STOPS, Loiter, RoutePoint
from world.errors import MissionError

# Maximum course change at a corner of the polygon, rad: the corners are then 8 % of the radius outside the circle.
MAX_CORNER_ANGLE_RAD = math.pi / 4.0
# Minimum loiter radius, m: at a smaller radius the legs of a corner vanish, and no aircraft here turns as tightly.
MIN_LOITER_RADIUS_M = 10.0
# Maximum loiter radius, m.
MAX_LOITER_RADIUS_M = 20_000.0
# Minimum distance of a stop from a circle for a tangent between them, m.
_MIN_TANGENT_CLEARANCE_M = 2.0
# Distance below which two positions are treated as the same, m.
_SAME_PLACE_M = 1.0
# Difference up to which two altitudes are treated as the same, m.
_SAME_ALTITUDE_M = 10.0
# Slope (tangent) of a spiral if the aircraft is unknown.
DEFAULT_SPIRAL_SLOPE = 0.05

# Heading error at which an autopilot that exits on heading leaves its loiter, rad.
EXIT_HEADING_TOLERANCE_RAD = math.radians(10.0)
# Angle between the course to the loiter's center and the tangent on which the route joins the loiter, rad: an autopilot
# that steers to the center has turned by this angle before the loiter of the route starts.
_TURN_TO_TANGENT_RAD = 0.5 * math.pi

# Function that returns the steepest climb and descent (tangents) in a spiral at an airspeed (m/s) and an altitude (m
# AMSL).
SpiralSlopes = Callable[[float, float], tuple[float, float]]
# Function that returns the default loiter radius (m) at an airspeed (m/s) and an altitude (m AMSL).
DefaultRadius = Callable[[float, float], float]


def item_radius(loiter: Loiter) -> float:
    """Return the radius that a loiter item states, m, without its sign; 0 if it states none."""
    return abs(loiter.radius)


def unit_scale(up: float) -> float:
    """Return 1: the ratio of flown to stated loiter radius of an autopilot that ignores the altitude.

    up: altitude of the loiter, m AMSL; not used.
    """
    return 1.0


@dataclass(frozen=True, slots=True)
class LoiterRules:
    """Rules by which an autopilot flies loiters.

    radius: default radius, m, negative to the left; 0 for a radius that depends on the aircraft.
    radius_name: name of the parameter of that radius; "" for none.
    radius_of: function that returns the radius that the autopilot reads from a loiter's item, m; 0 for none.
    radius_scale: function that returns the ratio of the flown radius at an altitude (m AMSL) to the stated radius.
    steers_to_center: True if the autopilot steers to the loiter's center until it reaches the circle, and leaves at
        once for the line from the center when the loiter ends; False if it joins and leaves the circle on tangents.
    exits_on_heading: True if the autopilot, after steering to the center, counts turns from its turn away from the
        center, and after the end of the loiter continues until it heads for the next waypoint within
        `EXIT_HEADING_TOLERANCE_RAD`.
    holds_height: True if the autopilot holds its altitude on the leg to a loiter to an altitude.
    max_climb_rate, max_sink_rate: limits in a loiter, m/s.
    altitude_tolerance: difference from its altitude at which a loiter to an altitude is complete, m.
    ends_in_circle: True if the autopilot loiters indefinitely about a mission's last waypoint.
    unflown_note: note on parts of loiters that are not simulated; "" for none.
    rtl_exit_note: note on the exit from a loiter before an RTL, if the route has another exit.

    >>> LoiterRules().radius, LoiterRules().steers_to_center
    (0.0, False)
    """

    radius: float = 0.0
    radius_name: str = ""
    radius_of: Callable[[Loiter], float] = item_radius
    radius_scale: Callable[[float], float] = unit_scale
    steers_to_center: bool = False
    exits_on_heading: bool = False
    holds_height: bool = False
    max_climb_rate: float = math.inf
    max_sink_rate: float = math.inf
    altitude_tolerance: float = 0.0
    ends_in_circle: bool = False
    unflown_note: str = ""
    rtl_exit_note: str = ""

    def end_note(self) -> str:
        """Return a note for an autopilot that loiters about the last waypoint after the mission's end.

        >>> LoiterRules(80.0, "NAV_LOITER_RAD", ends_in_circle=True).end_note()
        'after the last waypoint the aircraft loiters around it indefinitely, with NAV_LOITER_RAD, 80 m; ...'
        """
        name = f"{self.radius_name}," if self.radius_name else "a radius of"
        circle = f"with {name} {abs(self.radius):g} m"
        return f"after the last waypoint the aircraft loiters around it indefinitely, {circle}; one lap is simulated"


# Rules of an autopilot without loiter rules.
DEFAULT_LOITER_RULES = LoiterRules()


class UnjoinedStop(NamedTuple):
    """A stop that is not at its stated position in the route, because no tangent joins it to a circle.

    item, circle: seq of the stop's item, and seq of the circle's item.
    is_circle: True for a loiter, which moves to the other circle; False for a point inside that circle, which is
        omitted.
    """

    item: int
    circle: int
    is_circle: bool


def lay_out_waypoints(
    source: str,
    stops: list[RoutePoint],
    notes: Notes,
    default_radius: DefaultRadius,
    slopes: SpiralSlopes,
    rules: LoiterRules = DEFAULT_LOITER_RULES,
) -> tuple[list[RoutePoint], tuple[UnjoinedStop, ...]]:
    """Lay out the waypoints of a route along straight legs and around loiter circles.

    Return the waypoints, and the stops that are not flown at their stated positions.

    source: name of the mission in errors.
    default_radius: function that returns the aircraft's default loiter radius.
    slopes: function that returns the steepest climb and descent of the aircraft in a spiral.
    rules: loiter rules of the autopilot.

    notes: receives a note on each stop that is not flown as written.

    A stop inside the previous or next circle is omitted with a note, because no tangent leads to it. Raises
    MissionError if a loiter is too wide or too long to lay out.
    """
    unjoined: list[UnjoinedStop] = []
    nodes = _make_nodes(source, stops, notes, default_radius, rules, unjoined)
    courses = [tangent_course(node, next_node) for node, next_node in pairwise(nodes)]
    points: list[RoutePoint] = []
    up = stops[0].up
    for index, node in enumerate(nodes):
        if node.arc_radius == 0.0:
            up = node.up
            points.append(node)
            continue
        entry_course = courses[index - 1] if index else (courses[index] if index < len(courses) else 0.0)
        exit_course = courses[index] if index < len(courses) else None
        leg_length = points[-1].distance_to(node) if points else 0.0
        min_radius = default_radius(node.airspeed, node.up) if rules.exits_on_heading else 0.0
        corners = _corners_around(source, node, entry_course, exit_course, up, leg_length, min_radius, slopes, rules)
        if not index:
            corners.insert(0, node.placed_at((*point_on_circle(node, entry_course), corners[0].up)))
        up = corners[-1].up
        points += corners
        if len(points) > MAX_STOPS:
            item = f"item {node.item}"
            message = f"{source}: {item}: with its circles laid out the route has more than {MAX_STOPS:,} waypoints"
            raise MissionError(message, file=source, field=item)
    return points, tuple(unjoined)


def _make_nodes(
    source: str,
    stops: list[RoutePoint],
    notes: Notes,
    default_radius: DefaultRadius,
    rules: LoiterRules,
    unjoined: list[UnjoinedStop],
) -> list[RoutePoint]:
    """Return a route's points and loiter circles in flying order, each joined to the next by a tangent.

    unjoined: receives the stops that are not at their stated positions in the result.

    A point that lies inside the previous or next circle is omitted, with a note. If the take-off is inside the first
    circle, the flight therefore starts on that circle. A loiter that no tangent joins to the previous circle is flown
    on the previous circle, with a note.
    """
    nodes: list[RoutePoint] = []
    for stop in stops:
        node = stop
        if stop.loiter is not None:
            node = replace(
                node, arc_radius=_signed_radius(source, stop, stop.loiter, node.up, notes, default_radius, rules)
            )
            while (
                nodes
                and nodes[-1].arc_radius == 0.0
                and nodes[-1].distance_to(node) < abs(node.arc_radius) + _MIN_TANGENT_CLEARANCE_M
            ):
                inner_node = nodes.pop()
                _note_omitted_stop(inner_node, node, notes)
                # An autopilot that steers to the center passes a stop there, and a take-off there needs no leg.
                is_passed_anyway = (
                    inner_node.distance_to(node) < _SAME_PLACE_M and abs(inner_node.up - node.up) <= _SAME_ALTITUDE_M
                )
                if inner_node.item >= 0 and inner_node.command not in TAKEOFFS and not is_passed_anyway:
                    unjoined.append(UnjoinedStop(inner_node.item, stop.item, is_circle=False))
        previous = nodes[-1] if nodes else None
        if previous is not None and previous.arc_radius != 0.0 and not is_joined(previous, node):
            if node.arc_radius == 0.0:
                _note_omitted_stop(stop, previous, notes)
                unjoined.append(UnjoinedStop(stop.item, previous.item, is_circle=False))
                continue
            # Two loiters with the same stated radius and center may differ by the radius scale at their altitudes.
            previous_stated_radius = abs(previous.arc_radius) / rules.radius_scale(previous.up)
            stated_radius = abs(node.arc_radius) / rules.radius_scale(node.up)
            is_same_direction = math.copysign(1.0, previous.arc_radius) == math.copysign(1.0, node.arc_radius)
            if (
                previous.distance_to(node) >= _SAME_PLACE_M
                or abs(previous_stated_radius - stated_radius) >= _SAME_PLACE_M
                or not is_same_direction
            ):
                unjoined.append(UnjoinedStop(stop.item, previous.item, is_circle=True))
            notes.add(
                f"no tangent joins its circle to the circle of item {previous.item}, so it is flown on that circle",
                stop.item,
            )
            node = node.placed_at((previous.east, previous.north, node.up), previous.arc_radius)
        nodes.append(node)
    return nodes


def _note_omitted_stop(stop: RoutePoint, circle: RoutePoint, notes: Notes) -> None:
    """Add a note on a stop that is omitted because it lies inside a loiter circle."""
    text = f"not flown to, because it lies inside the circle of item {circle.item}, which is joined on a tangent"
    notes.add(text if stop.item >= 0 else f"home is {text}", stop.item if stop.item >= 0 else None)


def _signed_radius(
    source: str,
    stop: RoutePoint,
    loiter: Loiter,
    up: float,
    notes: Notes,
    default_radius: DefaultRadius,
    rules: LoiterRules,
) -> float:
    """Return the radius of a loiter, m, negative to the left.

    A note is added if it differs from the stated radius.

    loiter: loiter of the stop.
    up: altitude of the loiter, m AMSL.
    default_radius: function that returns the aircraft's default loiter radius.
    rules: loiter rules of the autopilot.

    Raises MissionError if the stated radius is too large.
    """
    radius, stated_radius = rules.radius_of(loiter), abs(loiter.radius)
    if radius > MAX_LOITER_RADIUS_M:
        allowed = f"allowed up to {MAX_LOITER_RADIUS_M:,.0f}"
        message = f"{source}: item {stop.item}: loiter radius {radius:g} m: {allowed}"
        raise MissionError(message, file=source, field="loiter radius", value=radius, allowed=allowed)
    radius_scale = rules.radius_scale(up)
    if radius == 0.0 and rules.radius != 0.0:
        is_left = rules.radius < 0.0 or loiter.radius < 0.0
        direction_text = " to the left" if is_left else ""
        reason = f"its radius of {stated_radius:g} m is ignored" if stated_radius > 0.0 else "the loiter has no radius"
        notes.add(f"{reason}, so {rules.radius_name} ({abs(rules.radius):g} m{direction_text}) is used", stop.item)
        return math.copysign(max(MIN_LOITER_RADIUS_M, abs(rules.radius) * radius_scale), -1.0 if is_left else 1.0)
    if radius == 0.0:
        radius = default_radius(stop.airspeed, up)
        notes.add(f"the loiter has no radius, so a radius of {radius:.0f} m is used", stop.item)
    elif radius < MIN_LOITER_RADIUS_M:
        notes.add(
            f"a loiter radius below {MIN_LOITER_RADIUS_M:.0f} m is simulated as {MIN_LOITER_RADIUS_M:.0f} m",
            stop.item,
        )
        radius = MIN_LOITER_RADIUS_M
    elif round(radius * radius_scale) != round(stated_radius):
        notes.add(
            f"the loiter radius of {stated_radius:g} m is flown as {radius * radius_scale:.0f} m, because the autopilot"
            " enlarges it with altitude",
            stop.item,
        )
    return math.copysign(radius * radius_scale, loiter.radius)


def is_joined(node: RoutePoint, next_node: RoutePoint) -> bool:
    """Return True if a tangent joins two circles or points, or if both are the same circle."""
    distance = node.distance_to(next_node)
    return distance > abs(next_node.arc_radius - node.arc_radius) + _MIN_TANGENT_CLEARANCE_M or (
        distance < 1.0 and abs(node.arc_radius - next_node.arc_radius) < 1.0
    )


def tangent_course(node: RoutePoint, next_node: RoutePoint) -> float:
    """Return the course of the tangent from a circle or point to the next, rad.

    The result is 0 if both are the same circle.
    """
    distance = node.distance_to(next_node)
    if distance < 1.0:
        return 0.0
    bearing = math.atan2(next_node.east - node.east, next_node.north - node.north)
    # Perpendicular to the tangent, the distance between the centers is the difference of the signed radii.
    return bearing - math.asin(min(1.0, max(-1.0, (next_node.arc_radius - node.arc_radius) / distance)))


def point_on_circle(node: RoutePoint, course: float, radius_ratio: float = 1.0) -> tuple[float, float]:
    """Return the point of a circle at which the aircraft flies on a course (rad): east and north, m.

    node: the circle, by its center and its signed radius.
    radius_ratio: distance of the point from the center, in radii; 1 for a point on the circle itself.
    """
    return (
        node.east - node.arc_radius * radius_ratio * math.cos(course),
        node.north + node.arc_radius * radius_ratio * math.sin(course),
    )


def circle_corners(node: RoutePoint, entry_course: float, sweep: float) -> list[tuple[float, float]]:
    """Return the corners (east, north, m) of the polygon around a part of a circle.

    entry_course: course at which the aircraft joins the circle, rad.
    sweep: angle that the aircraft flies around the circle, rad.

    >>> point = RoutePoint(1, 16, 0.0, 0.0, 0.0, 0, 25.0)
    >>> [(round(e), round(n)) for e, n in circle_corners(point.placed_at((100.0, 0.0, 0.0), 100.0), 0.0, math.pi / 2.0)]
    [(0, 41), (59, 100)]
    """
    count = max(1, math.ceil(sweep / MAX_CORNER_ANGLE_RAD - 1e-9))
    step, turn_sign = sweep / count, math.copysign(1.0, node.arc_radius)
    return [
        point_on_circle(node, entry_course + turn_sign * (index + 0.5) * step, 1.0 / math.cos(0.5 * step))
        for index in range(count)
    ]


def _corners_around(
    source: str,
    node: RoutePoint,
    entry_course: float,
    exit_course: float | None,
    previous_altitude: float,
    leg_length: float,
    min_radius: float,
    slopes: SpiralSlopes,
    rules: LoiterRules,
) -> list[RoutePoint]:
    """Return the waypoints of a loiter: corners of a polygon around its circle, from entry to exit course.

    node: center of the circle, at the altitude of the loiter, with its signed radius.
    entry_course, exit_course: courses at which the aircraft joins and leaves the circle, rad; ``exit_course`` is None
        at the mission's end.
    previous_altitude: altitude at the start of the leg to the circle, m AMSL.
    leg_length: length of that leg, m.
    min_radius: minimum loiter radius of the aircraft, m, which determines the duration of a tighter loiter; 0 if
        unknown.

    The aircraft circles for the turns, the time or the altitude change of the loiter, and then on to the exit course.
    Some autopilots leave a loiter as soon as its time is over. For them the circle ends at the last exit tangent before
    that time. In a loiter to an altitude the corners climb or descend evenly; otherwise they are level. Raises
    MissionError for a loiter with more corners than are flown.
    """
    radius, turn_sign = abs(node.arc_radius), math.copysign(1.0, node.arc_radius)
    entry_altitude, required_sweep = node.up, 0.0
    loiter = node.loiter
    if loiter is not None and loiter.to_altitude:
        climb_slope, dive_slope = slopes(node.airspeed, max(previous_altitude, node.up))
        climb_slope = min(climb_slope, rules.max_climb_rate / node.airspeed)
        dive_slope = min(dive_slope, rules.max_sink_rate / node.airspeed)
        entry_altitude = previous_altitude
        if not rules.holds_height:
            max_descent, max_climb = dive_slope * leg_length, climb_slope * leg_length
            entry_altitude = min(max(node.up, previous_altitude - max_descent), previous_altitude + max_climb)
        altitude_change = max(0.0, abs(node.up - entry_altitude) - rules.altitude_tolerance)
        if altitude_change > 0.0:
            # The altitude changes from the first to the last corner, which takes one corner angle less than the sweep.
            slope = climb_slope if node.up > entry_altitude else dive_slope
            required_sweep = altitude_change / slope / radius + MAX_CORNER_ANGLE_RAD
    elif loiter is not None:
        required_sweep = loiter.min_sweep(node.airspeed, max(radius, min_radius))
        if rules.exits_on_heading:
            required_sweep = max(0.0, required_sweep - _TURN_TO_TANGENT_RAD)
    sweep = required_sweep
    if exit_course is not None:
        sweep_to_exit = (turn_sign * (exit_course - entry_course)) % (2.0 * math.pi)
        exit_tolerance = EXIT_HEADING_TOLERANCE_RAD if rules.exits_on_heading else 1e-9
        extra_turns = (required_sweep - sweep_to_exit - exit_tolerance) / (2.0 * math.pi)
        leaves_at_once = (
            rules.steers_to_center and not rules.exits_on_heading and loiter is not None and not loiter.to_altitude
        )
        extra_turns = math.floor(extra_turns) if leaves_at_once else math.ceil(extra_turns)
        sweep = sweep_to_exit + 2.0 * math.pi * max(0, extra_turns)
    if sweep > MAX_STOPS * MAX_CORNER_ANGLE_RAD:
        turns, max_turns = (angle / (2.0 * math.pi) for angle in (sweep, MAX_STOPS * MAX_CORNER_ANGLE_RAD))
        item, allowed = f"item {node.item}", f"at most {max_turns:,.0f} are flown"
        raise MissionError.at(source, item, turns, allowed, shown=f"{turns:,.0f} turns to loiter")
    corners = circle_corners(node, entry_course, sweep)
    points = []
    for index, (east, north) in enumerate(corners):
        fraction = 1.0 if len(corners) == 1 else index / (len(corners) - 1)
        points.append(node.placed_at((east, north, entry_altitude + fraction * (node.up - entry_altitude)), radius))
    if exit_course is None and sweep > 0.0:
        points.append(node.placed_at((*point_on_circle(node, entry_course + turn_sign * sweep), node.up)))
    return points
