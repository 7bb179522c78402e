"""Lay out loiters on the map, from joining the circle to leaving it.

A loiter is laid out as the corners of a polygon around its circle, each with an arc of the circle's radius. The arcs
touch, so that the path is the circle, while turns, legs, altitudes and clearances are judged as everywhere else. The
circle is joined and left on tangents.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from flight.mission.items import TAKEOFFS, Notes
from flight.mission.itinerary import MAX_STOPS, ItineraryStop, Loiter
from world.arrays import Floats
from world.errors import MissionError

# Largest course change at a corner of the polygon, rad: the corners then lie 8 % of the radius outside the circle.
CORNER = math.pi / 4.0
# Smallest loiter radius that is flown, m: below it a corner's legs vanish, and no aircraft here turns as tightly.
TIGHTEST = 10.0
# Largest loiter radius that is flown, m.
WIDEST = 20_000.0
# Smallest distance of a stop from a circle for a tangent between them, m.
_MIN_TANGENT_CLEARANCE_M = 2.0
# Largest distance between two positions that are the same place, m.
_SAME_PLACE_M = 1.0
# Largest difference between two altitudes that are flown as one, m.
_SAME_ALTITUDE_M = 10.0
# Slope (tangent) of a spiral without a known aircraft.
PLAIN_SLOPE = 0.05

# Angle before the tangent at which an autopilot that exits on heading leaves its loiter, rad.
LINED_UP = math.radians(10.0)
# Angle it has turned by then, from its path to the center to the tangent at which the drawn loiter begins, rad.
_TURN_TO_TANGENT_RAD = 0.5 * math.pi

# Steepest climb and descent (tangents) in a spiral at an airspeed (m/s) and an altitude (m AMSL).
SpiralSlopes = Callable[[float, float], tuple[float, float]]
# Radius (m) of a loiter that states none, at an airspeed (m/s) and an altitude (m AMSL).
OwnRadius = Callable[[float, float], float]


def as_stated(loiter: Loiter) -> float:
    """Return the radius that a loiter's item states, m, 0 for none."""
    return abs(loiter.radius)


def as_at_sea(up: float) -> float:
    """Return the ratio of a loiter's radius at an altitude (m AMSL) to its radius at sea level: here 1."""
    return 1.0


@dataclass(frozen=True, slots=True)
class LoiterRules:
    """Rules by which an autopilot flies loiters.

    radius: radius of a loiter that states none, m, negative to the left; 0 for the aircraft's own radius.
    radius_name: name of the parameter that sets it, "" for none.
    radius_of: radius that the autopilot reads from a loiter's item, m, 0 for none.
    growth: ratio of the flown radius at an altitude (m AMSL) to the stated radius.
    at_middle: True if it steers to the loiter's center until it reaches the circle, and leaves as soon as the loiter is
        over for the line that begins at the center; otherwise it joins and leaves the circle on tangents.
    lines_up: True if, steering to the center, it counts turns from where it turns away from the center, and continues
        after the loiter is over until it heads for the next waypoint within `LINED_UP`.
    holds_height: True if it holds its altitude on the leg to a loiter that climbs or descends to an altitude.
    climb, sink: maximum climb and descent rate in a loiter, m/s.
    short: altitude tolerance, m.
    ends_in_circle: True if it loiters without end about a mission's last waypoint.
    unflown: note for people on the parts of its loiters that are not flown, "" for none.
    before_return: note for people on how it leaves a loiter before a return to launch, if that is not flown.

    >>> LoiterRules().radius, LoiterRules().at_middle
    (0.0, False)
    """

    radius: float = 0.0
    radius_name: str = ""
    radius_of: Callable[[Loiter], float] = as_stated
    growth: Callable[[float], float] = as_at_sea
    at_middle: bool = False
    lines_up: bool = False
    holds_height: bool = False
    climb: float = math.inf
    sink: float = math.inf
    short: float = 0.0
    ends_in_circle: bool = False
    unflown: str = ""
    before_return: str = ""

    def end_note(self) -> str:
        """Return a note for people on the loiter that follows the mission's end.

        >>> LoiterRules(80.0, "NAV_LOITER_RAD", ends_in_circle=True).end_note()
        'after the last waypoint the aircraft circles it without end, with NAV_LOITER_RAD, 80 m: flown once'
        """
        name = f"{self.radius_name}, " if self.radius_name else ""
        circle = f"with {name}{abs(self.radius):g} m"
        return f"after the last waypoint the aircraft circles it without end, {circle}: flown once"


# Rules of an autopilot without its own.
USUAL_LOITERS = LoiterRules()


class PlacedStop(NamedTuple):
    """A stop of the itinerary on the map.

    position: (3,) east, north, up, m.
    """

    stop: ItineraryStop
    position: Floats


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """One waypoint of a route.

    stop: stop of the itinerary that it belongs to.
    position: east, north, up, m.
    arc: radius of the turn there, m, 0 for the radius at the bank limit.
    """

    stop: ItineraryStop
    position: tuple[float, float, float]
    arc: float = 0.0


class Unjoined(NamedTuple):
    """A stop that is not laid out at its stated position, because no tangent joins it to a circle.

    item, circle: seq of its item, and seq of the circle's item.
    is_circle: True if it is a circle, which is laid out on the other circle; otherwise it lies inside that circle and
        is left out.
    """

    item: int
    circle: int
    is_circle: bool


@dataclass(frozen=True, slots=True)
class Node:
    """A stop as a point, or as a circle about it; east, north, up in m.

    turn: radius of the circle, m, positive to the right, 0 for a point.
    """

    stop: ItineraryStop
    east: float
    north: float
    up: float
    turn: float = 0.0

    def away(self, other: "Node") -> float:
        """Return the distance between the centers, m."""
        return math.hypot(other.east - self.east, other.north - self.north)


def lay_circles(
    source: str,
    stops: list[PlacedStop],
    notes: Notes,
    own_radius: OwnRadius,
    slopes: SpiralSlopes,
    rules: LoiterRules = USUAL_LOITERS,
) -> tuple[list[RoutePoint], tuple[Unjoined, ...]]:
    """Lay out the waypoints of a route through points and around circles.

    Return them, and the stops that are not laid out as stated.

    source: name of the mission in errors.
    own_radius, slopes: abilities of the aircraft.
    rules: loiter rules of the autopilot.

    Stops inside a circle before or after them are left out, with a note, since no straight leg joins them. Raise
    MissionError for a loiter too wide or too long to lay out.
    """
    unjoined: list[Unjoined] = []
    nodes = _make_nodes(source, stops, notes, own_radius, rules, unjoined)
    courses = [tangent_course(a, b) for a, b in pairwise(nodes)]
    points: list[RoutePoint] = []
    up = float(stops[0].position[2])
    for k, node in enumerate(nodes):
        if node.turn == 0.0:
            up = node.up
            points.append(RoutePoint(node.stop, (node.east, node.north, up)))
            continue
        into = courses[k - 1] if k else (courses[k] if k < len(courses) else 0.0)
        onward = courses[k] if k < len(courses) else None
        run = math.hypot(node.east - points[-1].position[0], node.north - points[-1].position[1]) if points else 0.0
        tightest = own_radius(node.stop.airspeed, node.up) if rules.lines_up else 0.0
        laid = _corners_around(source, node, into, onward, up, run, tightest, slopes, rules)
        if not k:
            laid.insert(0, RoutePoint(node.stop, (*on_rim(node, into), laid[0].position[2])))
        up = laid[-1].position[2]
        points += laid
        if len(points) > MAX_STOPS:
            item = f"item {node.stop.item}"
            message = f"{source}: {item}: with its circles laid out the route has more than {MAX_STOPS:,} waypoints"
            raise MissionError(message, file=source, field=item)
    return points, tuple(unjoined)


def _make_nodes(
    source: str,
    stops: list[PlacedStop],
    notes: Notes,
    own_radius: OwnRadius,
    rules: LoiterRules,
    unjoined: list[Unjoined],
) -> list[Node]:
    """Return points and circles in flying order, each joined to the next by a tangent.

    Append the stops that no tangent joins to ``unjoined``.

    A flight that takes off inside its first circle begins on that circle: no part of its take-off is flown.
    """
    nodes: list[Node] = []
    for stop, (east, north, up) in stops:
        node = Node(stop, float(east), float(north), float(up))
        if stop.loiter is not None:
            node = replace(node, turn=_signed_radius(source, stop, stop.loiter, float(up), notes, own_radius, rules))
            while nodes and nodes[-1].turn == 0.0 and nodes[-1].away(node) < abs(node.turn) + _MIN_TANGENT_CLEARANCE_M:
                inside = nodes.pop()
                _note_left_out(inside.stop, node.stop, notes)
                # An autopilot that steers to the center passes a place there, and a take-off there needs no leg.
                on_the_way = inside.away(node) < _SAME_PLACE_M and abs(inside.up - node.up) <= _SAME_ALTITUDE_M
                if inside.stop.item >= 0 and inside.stop.command not in TAKEOFFS and not on_the_way:
                    unjoined.append(Unjoined(inside.stop.item, stop.item, is_circle=False))
        before = nodes[-1] if nodes else None
        if before is not None and before.turn != 0.0 and not is_joined(before, node):
            if node.turn == 0.0:
                _note_left_out(stop, before.stop, notes)
                unjoined.append(Unjoined(stop.item, before.stop.item, is_circle=False))
                continue
            # Two loiters of one stated radius about one place may differ by the growth at their altitudes.
            wide, own = abs(before.turn) / rules.growth(before.up), abs(node.turn) / rules.growth(node.up)
            one_side = math.copysign(1.0, before.turn) == math.copysign(1.0, node.turn)
            if before.away(node) >= _SAME_PLACE_M or abs(wide - own) >= _SAME_PLACE_M or not one_side:
                unjoined.append(Unjoined(stop.item, before.stop.item, is_circle=True))
            notes.add(
                f"its circle has no tangent from that of item {before.stop.item}: flown on that circle", stop.item
            )
            node = replace(node, east=before.east, north=before.north, turn=before.turn)
        nodes.append(node)
    return nodes


def _note_left_out(stop: ItineraryStop, circle: ItineraryStop, notes: Notes) -> None:
    name = f"lies inside the circle of item {circle.item}, which is joined on a tangent: not flown to"
    notes.add(name if stop.item >= 0 else f"home {name}", stop.item if stop.item >= 0 else None)


def _signed_radius(
    source: str, stop: ItineraryStop, loiter: Loiter, up: float, notes: Notes, own_radius: OwnRadius, rules: LoiterRules
) -> float:
    """Return the signed radius of a loiter, m."""
    radius, stated = rules.radius_of(loiter), abs(loiter.radius)
    if radius > WIDEST:
        allowed = f"allowed up to {WIDEST:,.0f}"
        message = f"{source}: item {stop.item}: loiter radius {radius:g} m: {allowed}"
        raise MissionError(message, file=source, field="loiter radius", value=radius, allowed=allowed)
    grows = rules.growth(up)
    if radius == 0.0 and rules.radius != 0.0:
        left = rules.radius < 0.0 or loiter.radius < 0.0
        side = " to the left" if left else ""
        why = f"its radius of {stated:g} m is not read" if stated > 0.0 else "loiter without a radius"
        notes.add(f"{why}: flown with {rules.radius_name}, {abs(rules.radius):g} m{side}", stop.item)
        return math.copysign(max(TIGHTEST, abs(rules.radius) * grows), -1.0 if left else 1.0)
    if radius == 0.0:
        radius = own_radius(stop.airspeed, up)
        notes.add(f"loiter without a radius: flown with {radius:.0f} m", stop.item)
    elif radius < TIGHTEST:
        notes.add(f"loiter radius below {TIGHTEST:.0f} m: flown with {TIGHTEST:.0f} m", stop.item)
        radius = TIGHTEST
    elif round(radius * grows) != round(stated):
        notes.add(f"loiter radius {stated:g} m: flown with {radius * grows:.0f} m at this height", stop.item)
    return math.copysign(radius * grows, loiter.radius)


def is_joined(a: Node, b: Node) -> bool:
    """Return True if a tangent joins a circle to another circle or point, or both are the same circle."""
    apart = a.away(b)
    return apart > abs(b.turn - a.turn) + _MIN_TANGENT_CLEARANCE_M or (apart < 1.0 and abs(a.turn - b.turn) < 1.0)


def tangent_course(a: Node, b: Node) -> float:
    """Return the course of the tangent from a circle or point to the next, rad; 0 for the same circle."""
    apart = a.away(b)
    if apart < 1.0:
        return 0.0
    bearing = math.atan2(b.east - a.east, b.north - a.north)
    # Across the tangent, the centers are b.turn - a.turn apart.
    return bearing - math.asin(min(1.0, max(-1.0, (b.turn - a.turn) / apart)))


def on_rim(node: Node, course: float, out: float = 1.0) -> tuple[float, float]:
    """Return the point on a circle where its course is ``course``, or ``out`` radii from the center."""
    return (
        node.east - node.turn * out * math.cos(course),
        node.north + node.turn * out * math.sin(course),
    )


def circle_corners(node: Node, into: float, sweep: float) -> list[tuple[float, float]]:
    """Return the corners (east, north, m) around a circle, joined on a course and flown by an angle, rad.

    >>> point = ItineraryStop(1, 16, 0.0, 0.0, 0.0, 0, 25.0)
    >>> [(round(e), round(n)) for e, n in circle_corners(Node(point, 100.0, 0.0, 0.0, 100.0), 0.0, math.pi / 2.0)]
    [(0, 41), (59, 100)]
    """
    count = max(1, math.ceil(sweep / CORNER - 1e-9))
    step, side = sweep / count, math.copysign(1.0, node.turn)
    return [on_rim(node, into + side * (k + 0.5) * step, 1.0 / math.cos(0.5 * step)) for k in range(count)]


def _corners_around(
    source: str,
    node: Node,
    into: float,
    onward: float | None,
    up: float,
    run: float,
    tightest: float,
    slopes: SpiralSlopes,
    rules: LoiterRules,
) -> list[RoutePoint]:
    """Return the corners around a circle that the path joins on one course and leaves on another.

    into, onward: those courses, rad; ``onward`` is None at the mission's end.

    up: altitude at the start of the leg before, m AMSL.
    run: length of that leg, m.
    tightest: the aircraft's own radius, m, to which a smaller circle is widened in flight; 0 if unknown.

    For an autopilot that leaves as soon as its time is over, the circle ends at the last tangent before that.
    """
    radius, side = abs(node.turn), math.copysign(1.0, node.turn)
    first, wanted = node.up, 0.0
    loiter = node.stop.loiter
    if loiter is not None and loiter.to_height:
        climb, dive = slopes(node.stop.airspeed, max(up, node.up))
        climb, dive = min(climb, rules.climb / node.stop.airspeed), min(dive, rules.sink / node.stop.airspeed)
        first = up if rules.holds_height else min(max(node.up, up - dive * run), up + climb * run)
        missing = max(0.0, abs(node.up - first) - rules.short)
        if missing > 0.0:
            # Altitudes are interpolated between the corners, of which there is one more than intervals.
            wanted = missing / (climb if node.up > first else dive) / radius + CORNER
    elif loiter is not None:
        wanted = loiter.sweep(node.stop.airspeed, max(radius, tightest))
        if rules.lines_up:
            wanted = max(0.0, wanted - _TURN_TO_TANGENT_RAD)
    sweep = wanted
    if onward is not None:
        part = (side * (onward - into)) % (2.0 * math.pi)
        early = LINED_UP if rules.lines_up else 1e-9
        more = (wanted - part - early) / (2.0 * math.pi)
        at_once = rules.at_middle and not rules.lines_up and loiter is not None and not loiter.to_height
        more = math.floor(more) if at_once else math.ceil(more)
        sweep = part + 2.0 * math.pi * max(0, more)
    if sweep > MAX_STOPS * CORNER:
        turns, allowed = sweep / (2.0 * math.pi), f"at most {MAX_STOPS * CORNER / (2.0 * math.pi):,.0f} are flown"
        item = f"item {node.stop.item}"
        raise MissionError.at(source, item, turns, allowed, shown=f"{turns:,.0f} turns to loiter")
    corners = circle_corners(node, into, sweep)
    points = []
    for k, (east, north) in enumerate(corners):
        share = 1.0 if len(corners) == 1 else k / (len(corners) - 1)
        points.append(RoutePoint(node.stop, (east, north, first + share * (node.up - first)), radius))
    if onward is None and sweep > 0.0:
        points.append(RoutePoint(node.stop, (*on_rim(node, into + side * sweep), node.up)))
    return points
