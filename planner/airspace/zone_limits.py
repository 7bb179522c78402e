"""The zones that a plan keeps out of or stays inside: as arrays for compiled code, widened by what tracking needs."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_kernels import ZoneRecords, edge_distance, outside_band, zone_records
from world.airspace.zones import Zone
from world.kernels import Records, compiled, inlined, record_dtype
from world.scenario import Scenario
from world.terrain import Terrain

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]


# ----------------------------------------------------------------------
# Zones with what a path is to keep from each, in an order in which those near a leg are found fast.

# What a path keeps from one zone, m: beside its outline, and below its floor or above its ceiling (inside both, of an
# inclusion).  number: of the zone, as the scenario has them.  furthest_east: of this exclusion and of all before it, m.
KEPT = record_dtype(("number", np.int64), "beside", "beyond", "furthest_east")


class KeptZones(NamedTuple):
    """Zones in the order in which kernels read them: the inclusions, then the exclusions from west to east.

    records: the zones, and kept: `KEPT` records (z,) of them.
    inclusions: how many there are.
    beside: the most that is kept beside any, m.
    """

    records: ZoneRecords
    kept: Records
    inclusions: int
    beside: float


class ZoneMargins(NamedTuple):
    """What a path keeps from zones, m: beside and beyond as in `KEPT`.

    share: where a fixed end is nearer to a zone than that, of what the end keeps.
    """

    beside: float
    beyond: float
    share: float


def keep_zones(zones: Sequence[Zone], ends: Floats, terrain: Terrain | None, margins: ZoneMargins) -> KeptZones:
    """Zones with these margins, or with less from a zone that a fixed end is near.

    ends: (k, 3) m.  An end inside an exclusion, or outside an inclusion, leaves a margin of 0.

    >>> from world.airspace.zones import Cylinder
    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> ends = np.array([[0.0, 700.0 + 8.0, 60.0], [0.0, 3000.0, 60.0]])
    >>> kept = keep_zones([zone], ends, None, ZoneMargins(20.0, 10.0, 0.5)).kept
    >>> float(kept["beside"][0]), float(kept["beyond"][0])
    (4.0, 10.0)
    """
    given = zone_records(zones)
    order = np.lexsort((given.zones["west"], given.zones["exclusion"]))
    records = ZoneRecords(given.zones[order], given.edges)
    kept: Records = np.zeros(len(order), KEPT)
    kept["number"], kept["beside"], kept["beyond"] = order, margins.beside, margins.beyond
    inclusions = int((~records.zones["exclusion"]).sum())
    kept["furthest_east"][inclusions:] = np.maximum.accumulate(records.zones["east"][inclusions:])
    grounds = np.full(len(ends), np.nan) if terrain is None else terrain.height(ends[:, 0], ends[:, 1])
    _give_way(records, np.ascontiguousarray(ends), np.ascontiguousarray(grounds), margins.share, kept)
    for array in (records.zones, kept):
        array.setflags(write=False)
    return KeptZones(records, kept, inclusions, margins.beside)


@compiled
def _give_way(
    records: ZoneRecords, ends: Floats, grounds: Floats, share: float, kept: Records
) -> None:  # pragma: no cover - compiled
    """Let margins shrink to a share of what the ends (k, 3) keep; grounds: (k,) heights of the ground there."""
    for z in range(kept.shape[0]):
        zone, keeps = records.zones[z], kept[z]
        for k in range(ends.shape[0]):
            away = edge_distance(records, z, ends[k, 0], ends[k, 1])
            over = outside_band(zone, ends[k, 2], grounds[k])
            if not zone.exclusion:
                keeps.beside = min(keeps.beside, max(0.0, -share * away))
                keeps.beyond = min(keeps.beyond, max(0.0, -share * over))
            elif away < keeps.beside and not over >= keeps.beyond:
                # The one of the two of which more is left.
                if away * keeps.beyond >= over * keeps.beside or math.isnan(over):
                    keeps.beside = max(0.0, share * away)
                else:
                    keeps.beyond = max(0.0, share * over)


@compiled
def first_near(zones: KeptZones, west: float) -> int:  # pragma: no cover - compiled
    """The first exclusion of those, in their order, that may reach as far east as `west` (m)."""
    low, high = zones.inclusions, zones.kept.shape[0]
    while low < high:
        middle = (low + high) // 2
        if zones.kept[middle].furthest_east < west:
            low = middle + 1
        else:
            high = middle
    return low


# ----------------------------------------------------------------------
# The airspace of a problem for compiled code: zones, and the greatest height above ground.


class KeptAirspace(NamedTuple):
    """Where a path may be beside the map, its floor and its ceiling; lengths in m.

    zones: to keep out of, and to stay in.
    max_height: greatest height above ground, inf for none.
    buffer: kept below it, and start_buffer and destination_buffer at the ends.
    depths: the ground's heights, the other sign: seen from below, what is not to be exceeded is what is to be cleared.
    """

    zones: KeptZones
    max_height: float
    buffer: float
    start_buffer: float
    destination_buffer: float
    depths: Heights


def keep_airspace(scenario: Scenario, margins: ZoneMargins, buffer: float) -> KeptAirspace:
    """The airspace of a scenario with what is kept from it.

    buffer: kept below the greatest height, m; where a fixed end leaves less, the margins' share of that.

    >>> from world.scenario import load_scenario
    >>> space = keep_airspace(load_scenario("tight"), ZoneMargins(10.0, 5.0, 1.0), 5.0)
    >>> space.max_height, len(space.zones.kept)
    (inf, 0)
    """
    terrain, most = scenario.terrain, scenario.limits.max_height_m
    ends = np.stack([scenario.start, scenario.destination])
    zones = keep_zones(scenario.zones, ends, terrain, margins)
    asked = most is not None or any(zone.above_ground for zone in scenario.zones)
    # Where nobody asks for them, next to nothing that fits.
    depths = -terrain.heights if terrain is not None and asked else np.zeros((2, 2), dtype=np.float32)
    depths.setflags(write=False)
    buffers = [buffer, buffer]
    if most is not None and terrain is not None:
        left = most - (ends[:, 2] - terrain.height(ends[:, 0], ends[:, 1])) - 0.01
        buffers = [buffer if one >= buffer else margins.share * max(0.0, float(one)) for one in left]
    return KeptAirspace(zones, math.inf if most is None else most, buffer, buffers[0], buffers[1], depths)


def is_limited(airspace: KeptAirspace) -> bool:
    """Whether there is a zone or a greatest height.

    >>> from world.scenario import load_scenario
    >>> is_limited(keep_airspace(load_scenario("tight"), ZoneMargins(10.0, 5.0, 1.0), 5.0))
    False
    """
    return len(airspace.zones.kept) > 0 or airspace.max_height < math.inf


# ----------------------------------------------------------------------
# How a line lies to a zone's shape on the map: inside it, how near its outline, and how far aside and ahead that is.
#
# Shapes are taken into the line's own axes: along it from its beginning, and off to its left.


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
