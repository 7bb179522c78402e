"""Loiters on the map: where a route joins a circle, how far around it goes, and where it leaves.

A circle is flown as the corners of a polygon around it, each with an arc of the circle's radius: the arcs touch, so the
path is the circle, while turns, legs, heights and clearances are judged as everywhere else.  It is joined and left on
tangents.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import TAKEOFFS, Notes
from flight.mission.itinerary import MAX_STOPS, ItineraryStop, Loiter
from world.errors import MissionError

Floats = NDArray[np.float64]

# Course change at a corner of the polygon at most, rad: its corners then lie 8 % of the radius outside the circle.
CORNER = math.pi / 4.0
# Radii (m) that are flown.  Below the smallest a corner's legs would be no legs; no aircraft of ours turns as tightly.
TIGHTEST, WIDEST = 10.0, 20_000.0
# A stop must be this far (m) outside a circle to have a tangent to it.
_CLEAR = 2.0
# Places nearer to each other than this, m, are one; heights that differ by no more than this, m, are flown as one.
_SAME_PLACE, _SAME_HEIGHT = 1.0, 10.0
# Slope (tangent) of a spiral where no aircraft is known.
PLAIN_SLOPE = 0.05

# Who leaves a circle heading for what follows does so this much before the tangent, rad; and it turned so far, rad,
# from its way to the middle to the tangent that the circle is drawn from.
LINED_UP = math.radians(10.0)
_TO_TANGENT = 0.5 * math.pi

# Steepest climb and dive (tangents) that a spiral at this airspeed (m/s) and height (m AMSL) is flown with.
SpiralSlopes = Callable[[float, float], tuple[float, float]]
# Radius (m) of a loiter that states none, at this airspeed and height.
OwnRadius = Callable[[float, float], float]


def as_stated(loiter: Loiter) -> float:
    """Radius that a loiter's item states, m, 0 for none."""
    return abs(loiter.radius)


def as_at_sea(up: float) -> float:
    """By how much a circle is wider at a height (m AMSL) than at sea level: not at all."""
    return 1.0


@dataclass(frozen=True, slots=True)
class LoiterRules:
    """How an autopilot flies loiters.

    radius: of a loiter that states none, m, negative to the left; 0 for a radius of the aircraft's own.
    radius_name: the parameter that sets it, "" for none.
    radius_of: the radius of a loiter's item that is read, m, 0 for none.
    growth: by how much a circle is wider at a height (m AMSL) than is stated.
    at_middle: whether it flies at the circle's middle until it comes to the rim, and leaves as soon as the loiter is
        over for the line that begins in the middle; else it joins and leaves the circle on tangents.
    lines_up: whether, flying at the middle, it counts from where it turns away from that, and goes on when the loiter
        is over until it heads for what follows, within `LINED_UP`.
    holds_height: whether on the way to a loiter to a height it holds the height at which it set out.
    climb, sink: its fastest in circles, m/s.
    short: by how much a height may be missed, m.
    ends_in_circle: whether after a mission's last waypoint it circles about that without end.
    unflown: what of its circles is not flown, a note for people, "" for nothing.
    before_return: how it leaves a circle that a return to launch follows, where that is not flown, a note for people.

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
        """What comes after the mission's end, a note for people.

        >>> LoiterRules(80.0, "NAV_LOITER_RAD", ends_in_circle=True).end_note()
        'after the last waypoint it circles about that without end, with NAV_LOITER_RAD, 80 m: flown once by its law'
        """
        name = f"{self.radius_name}, " if self.radius_name else ""
        circle = f"with {name}{abs(self.radius):g} m"
        return f"after the last waypoint it circles about that without end, {circle}: flown once by its law"


# Of an autopilot that has none of its own.
USUAL_LOITERS = LoiterRules()


class PlacedStop(NamedTuple):
    """A stop of the itinerary on the map; position: (3,) east, north, up, m."""

    stop: ItineraryStop
    position: Floats


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """One waypoint of a route.

    stop: the stop that it belongs to.
    position: east, north, up, m.
    arc: radius that the path turns with there, m, 0 for the bank limit's.
    """

    stop: ItineraryStop
    position: tuple[float, float, float]
    arc: float = 0.0


class Unjoined(NamedTuple):
    """A stop of a mission that is not laid out where its item says, for no tangent joins it to a circle.

    item, circle: seqs of its item and of the circle's.
    is_circle: whether it is a circle itself, laid out on the other; else it lies inside that, and is left out.
    """

    item: int
    circle: int
    is_circle: bool


@dataclass(frozen=True, slots=True)
class Node:
    """A stop as a point, or as a circle about it; east, north, up in m.

    turn: the circle's radius, m, positive to the right, 0 for a point.
    """

    stop: ItineraryStop
    east: float
    north: float
    up: float
    turn: float = 0.0

    def away(self, other: "Node") -> float:
        """How far apart the middles are, m."""
        return math.hypot(other.east - self.east, other.north - self.north)


def lay_circles(
    source: str,
    stops: list[PlacedStop],
    notes: Notes,
    own_radius: OwnRadius,
    slopes: SpiralSlopes,
    rules: LoiterRules = USUAL_LOITERS,
) -> tuple[list[RoutePoint], tuple[Unjoined, ...]]:
    """Waypoints of a route through points and around circles, and the stops that are not laid out as asked for.

    source: names the mission in errors.  own_radius, slopes: of the aircraft.  rules: of whoever flies.  Stops inside a
    circle before or after them are left out, with a note: no straight leg joins them.  Raises MissionError for a loiter
    too wide or too long to lay out.
    """
    unjoined: list[Unjoined] = []
    nodes = _nodes(source, stops, notes, own_radius, rules, unjoined)
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
        laid = _around(source, node, into, onward, up, run, tightest, slopes, rules)
        if not k:
            laid.insert(0, RoutePoint(node.stop, (*on_rim(node, into), laid[0].position[2])))
        up = laid[-1].position[2]
        points += laid
        if len(points) > MAX_STOPS:
            item = f"item {node.stop.item}"
            message = f"{source}: {item}: more than {MAX_STOPS:,} places, circles laid out"
            raise MissionError(message, file=source, field=item)
    return points, tuple(unjoined)


def _nodes(
    source: str, stops: list[PlacedStop], notes: Notes, own_radius: OwnRadius, rules: LoiterRules,
    unjoined: list[Unjoined],
) -> list[Node]:  # fmt: skip
    """Points and circles in flying order, each with a tangent to the next; ``unjoined`` gets the others.

    A flight that takes off inside its first circle begins on that: of take-offs nothing is flown.
    """
    nodes: list[Node] = []
    for stop, (east, north, up) in stops:
        node = Node(stop, float(east), float(north), float(up))
        if stop.loiter is not None:
            node = replace(node, turn=_turn(source, stop, stop.loiter, float(up), notes, own_radius, rules))
            while nodes and nodes[-1].turn == 0.0 and nodes[-1].away(node) < abs(node.turn) + _CLEAR:
                inside = nodes.pop()
                _left_out(inside.stop, node.stop, notes)
                # Who flies at the middle comes past a place there, and needs no take-off's.
                on_the_way = inside.away(node) < _SAME_PLACE and abs(inside.up - node.up) <= _SAME_HEIGHT
                if inside.stop.item >= 0 and inside.stop.command not in TAKEOFFS and not on_the_way:
                    unjoined.append(Unjoined(inside.stop.item, stop.item, is_circle=False))
        before = nodes[-1] if nodes else None
        if before is not None and before.turn != 0.0 and not is_joined(before, node):
            if node.turn == 0.0:
                _left_out(stop, before.stop, notes)
                unjoined.append(Unjoined(stop.item, before.stop.item, is_circle=False))
                continue
            # Two circles of one item's radius about one place differ by what their heights make of it.
            wide, own = abs(before.turn) / rules.growth(before.up), abs(node.turn) / rules.growth(node.up)
            one_side = math.copysign(1.0, before.turn) == math.copysign(1.0, node.turn)
            if before.away(node) >= _SAME_PLACE or abs(wide - own) >= _SAME_PLACE or not one_side:
                unjoined.append(Unjoined(stop.item, before.stop.item, is_circle=True))
            notes.add(
                f"its circle has no tangent from that of item {before.stop.item}: flown on that circle", stop.item
            )
            node = replace(node, east=before.east, north=before.north, turn=before.turn)
        nodes.append(node)
    return nodes


def _left_out(stop: ItineraryStop, circle: ItineraryStop, notes: Notes) -> None:
    name = f"lies inside the circle of item {circle.item}, which is joined on a tangent: not flown to"
    notes.add(name if stop.item >= 0 else f"home {name}", stop.item if stop.item >= 0 else None)


def _turn(
    source: str, stop: ItineraryStop, loiter: Loiter, up: float, notes: Notes, own_radius: OwnRadius, rules: LoiterRules
) -> float:
    """Signed radius of a loiter, m."""
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
    """Whether a tangent leads from one circle to another circle or point, or both are one circle."""
    apart = a.away(b)
    return apart > abs(b.turn - a.turn) + _CLEAR or (apart < 1.0 and abs(a.turn - b.turn) < 1.0)


def tangent_course(a: Node, b: Node) -> float:
    """Course of the tangent from one circle (or point) to the next, rad; of one circle to itself, north."""
    apart = a.away(b)
    if apart < 1.0:
        return 0.0
    bearing = math.atan2(b.east - a.east, b.north - a.north)
    # Square to the tangent, the centres lie b.turn - a.turn apart.
    return bearing - math.asin(min(1.0, max(-1.0, (b.turn - a.turn) / apart)))


def on_rim(node: Node, course: float, out: float = 1.0) -> tuple[float, float]:
    """Where the circle is flown on this course; ``out``: that many radii from the centre instead."""
    return (
        node.east - node.turn * out * math.cos(course),
        node.north + node.turn * out * math.sin(course),
    )


def circle_corners(node: Node, into: float, sweep: float) -> list[tuple[float, float]]:
    """East and north (m) of the corners around a circle, joined on a course and flown around by an angle, rad.

    >>> point = ItineraryStop(1, 16, 0.0, 0.0, 0.0, 0, 25.0)
    >>> [(round(e), round(n)) for e, n in circle_corners(Node(point, 100.0, 0.0, 0.0, 100.0), 0.0, math.pi / 2.0)]
    [(0, 41), (59, 100)]
    """
    count = max(1, math.ceil(sweep / CORNER - 1e-9))
    step, side = sweep / count, math.copysign(1.0, node.turn)
    return [on_rim(node, into + side * (k + 0.5) * step, 1.0 / math.cos(0.5 * step)) for k in range(count)]


def _around(
    source: str, node: Node, into: float, onward: float | None, up: float, run: float, tightest: float,
    slopes: SpiralSlopes, rules: LoiterRules,
) -> list[RoutePoint]:  # fmt: skip
    """Corners around a circle, joined on one course and left on another (None: the mission ends there).

    up: height where the leg before started, m.  run: its length, m.  tightest: radius of the aircraft's own, m, that a
    smaller circle is flown wider to; 0 where that is not known.

    For whoever leaves as soon as its time is over, the circle is drawn to the last tangent before that.
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
            # Heights are counted between the corners, of which there is one more than spaces between them.
            wanted = missing / (climb if node.up > first else dive) / radius + CORNER
    elif loiter is not None:
        wanted = loiter.sweep(node.stop.airspeed, max(radius, tightest))
        if rules.lines_up:
            wanted = max(0.0, wanted - _TO_TANGENT)
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
