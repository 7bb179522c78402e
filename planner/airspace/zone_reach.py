"""How a line lies to a zone's shape on the map: inside it, how near its outline, and how far aside and ahead that is.

Shapes are taken into the line's own axes: along it from its beginning, and off to its left.
"""

import math
from typing import NamedTuple

from world.airspace.zone_kernels import ZoneRecords
from world.kernels import compiled, inlined


class MapSegment(NamedTuple):
    """A level line on the map: its beginning and its unit course, east and north, and its length, m."""

    east: float
    north: float
    course_east: float
    course_north: float
    run: float


class ShapeView(NamedTuple):
    """A shape seen from a line, m.

    inside: whether the line begins in it.
    distance: from the line to the shape's outline, 0 where they meet; inf where that is more than was asked for.
    right, left: furthest off the line of the shape's places, negative to the right.
    first, last: nearest and furthest along the line of them.
    """

    inside: bool
    distance: float
    right: float
    left: float
    first: float
    last: float


@inlined
def line_between(ax: float, ay: float, bx: float, by: float) -> MapSegment:  # pragma: no cover - compiled
    """The line from a to b; of no length it leads north."""
    dx, dy = bx - ax, by - ay
    run = math.sqrt(dx * dx + dy * dy)
    if run < 1e-9:
        return MapSegment(ax, ay, 0.0, 1.0, 0.0)
    return MapSegment(ax, ay, dx / run, dy / run, run)


@compiled
def reach_of(records: ZoneRecords, z: int, line: MapSegment, within: float) -> ShapeView:  # pragma: no cover - compiled
    """Zone z's shape seen from a line; distances above `within` (m) do not matter."""
    zone = records.zones[z]
    if zone.round:
        off_e, off_n = zone.centre_east - line.east, zone.centre_north - line.north
        along = off_e * line.course_east + off_n * line.course_north
        off = off_n * line.course_east - off_e * line.course_north
        return _circle_reach(along, off, zone.radius, line.run)
    inside, distance2 = False, math.inf
    right, left, first, last = math.inf, -math.inf, math.inf, -math.inf
    edges = records.edges
    for k in range(zone.first_edge, zone.last_edge):
        edge = edges[k]
        off_e, off_n = edge.east - line.east, edge.north - line.north
        along = off_e * line.course_east + off_n * line.course_north
        off = off_n * line.course_east - off_e * line.course_north
        off_e, off_n = edge.to_east - line.east, edge.to_north - line.north
        to_along = off_e * line.course_east + off_n * line.course_north
        to_off = off_n * line.course_east - off_e * line.course_north
        right, left, first, last = min(right, off), max(left, off), min(first, along), max(last, along)
        if (off > 0.0) != (to_off > 0.0):
            crossing = along + (to_along - along) * off / (off - to_off)
            inside = inside != (crossing > 0.0)
            if 0.0 <= crossing <= line.run:
                distance2 = 0.0
        ahead, behind = min(along, to_along) > line.run + within, max(along, to_along) < -within
        if ahead or behind or min(off, to_off) > within or max(off, to_off) < -within or distance2 == 0.0:
            continue
        distance2 = min(distance2, _edge_distance2(along, off, to_along, to_off, line.run))
    distance = math.sqrt(distance2)
    return ShapeView(inside, distance if distance <= within else math.inf, right, left, first, last)


@inlined
def _circle_reach(along: float, off: float, radius: float, run: float) -> ShapeView:  # pragma: no cover - compiled
    """A circle, its centre at this place in the line's axes."""
    beside = along - min(run, max(0.0, along))
    nearest = math.sqrt(beside * beside + off * off) - radius
    furthest = math.sqrt(max(abs(along), abs(along - run)) ** 2 + off * off) - radius
    inside = along * along + off * off <= radius * radius
    # All of it outside, all of it inside, or across the outline.
    distance = nearest if nearest > 0.0 else max(0.0, -furthest)
    return ShapeView(inside, distance, off - radius, off + radius, along - radius, along + radius)


@inlined
def _edge_distance2(
    along: float, off: float, to_along: float, to_off: float, run: float
) -> float:  # pragma: no cover - compiled
    """Squared distance of an edge that does not cross the line from it: at an end of the one or of the other."""
    beside = along - min(run, max(0.0, along))
    nearest = beside * beside + off * off
    beside = to_along - min(run, max(0.0, to_along))
    nearest = min(nearest, beside * beside + to_off * to_off)
    step, rise = to_along - along, to_off - off
    length2 = step * step + rise * rise
    # From the line's beginning and from its end.
    share = min(1.0, max(0.0, -(along * step + off * rise) / length2))
    x, y = along + share * step, off + share * rise
    nearest = min(nearest, x * x + y * y)
    share = min(1.0, max(0.0, ((run - along) * step - off * rise) / length2))
    x, y = along + share * step - run, off + share * rise
    return min(nearest, x * x + y * y)
