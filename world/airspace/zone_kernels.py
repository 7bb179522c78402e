"""Compiled distances to zones from a place and along a segment, exact for straight edges and circles.

Zones are records, and the edges of all polygons are records of one array, so that kernels read zones sequentially.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from world.airspace.zones import Cylinder, Ring, Zone, ZoneLevel
from world.by_reference import by_reference
from world.kernels import Record, Records, compiled, compiled_inline, inlined, inner, record_dtype

# One zone.  round: True for a cylinder, which `centre_east`, `centre_north` and `radius` describe completely.
# first_edge, last_edge: its range in the array of edges, the last not included.  west to north: its box on the map.
# floor, ceiling: m, -inf and inf if unlimited; above mean sea level, or above ground if the field after it is True.
ZONE = record_dtype(
    ("exclusion", np.bool_),
    ("round", np.bool_),
    "centre_east",
    "centre_north",
    "radius",
    ("first_edge", np.int64),
    ("last_edge", np.int64),
    "west",
    "east",
    "south",
    "north",
    "floor",
    "ceiling",
    ("floor_above_ground", np.bool_),
    ("ceiling_above_ground", np.bool_),
)
# One edge of a polygon, from a corner to the next, m.  The inside is to its left.
EDGE = record_dtype("east", "north", "to_east", "to_north")


@by_reference
class ZoneRecords(NamedTuple):
    """Zones for compiled code: (z,) of `ZONE` in the given order, and (e,) of `EDGE`, the edges of all polygons."""

    zones: Records
    edges: Records


def zone_records(zones: Sequence[Zone]) -> ZoneRecords:
    """Convert zones to the records that kernels read.

    >>> records = zone_records([Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))])
    >>> float(records.zones[0].north), len(records.edges)
    (700.0, 0)
    """
    out: Records = np.zeros(len(zones), ZONE)
    first = 0
    rings: list[Ring] = []
    for record, zone in zip(out, zones, strict=True):
        record.exclusion = zone.kind == "exclusion"
        record.floor, record.floor_above_ground = _level(zone.floor, -math.inf)
        record.ceiling, record.ceiling_above_ground = _level(zone.ceiling, math.inf)
        record.first_edge = first
        shape = zone.shape
        if isinstance(shape, Cylinder):
            record.round, record.radius = True, shape.radius
            record.centre_east, record.centre_north = shape.east, shape.north
            record.west, record.east = shape.east - shape.radius, shape.east + shape.radius
            record.south, record.north = shape.north - shape.radius, shape.north + shape.radius
        else:
            rings += shape.rings
            first += sum(map(len, shape.rings))
        record.last_edge = first
    edges = _edges(rings)
    _set_boxes(out, edges)
    for array in (out, edges):
        array.setflags(write=False)
    return ZoneRecords(out, edges)


def _set_boxes(zones: Records, edges: Records) -> None:
    """Set the boxes of polygons from their edges."""
    made = np.flatnonzero(~zones["round"])
    if made.size:
        # Every polygon has edges, and the edges of a polygon are consecutive.
        starts = zones["first_edge"][made]
        for low, high, name in (("west", "east", "east"), ("south", "north", "north")):
            zones[low][made] = np.minimum.reduceat(edges[name], starts)
            zones[high][made] = np.maximum.reduceat(edges[name], starts)


def _edges(rings: list[Ring]) -> Records:
    """Return (e,) of `EDGE` from every corner of the rings to the next corner of its ring."""
    corners = np.array([corner for ring in rings for corner in ring], dtype=np.float64).reshape(-1, 2)
    after = np.roll(corners, -1, axis=0)
    sizes = np.array([len(ring) for ring in rings], dtype=np.int64)
    ends = np.cumsum(sizes)
    after[ends - 1] = corners[ends - sizes]
    made: Records = np.zeros(len(corners), EDGE)
    made["east"], made["north"] = corners.T
    made["to_east"], made["to_north"] = after.T
    return made


def _level(level: ZoneLevel | None, absent: float) -> tuple[float, bool]:
    return (absent, False) if level is None else (level.height, level.datum == "ground")


@inlined
def box_distance(records: ZoneRecords, z: int, west: float, east: float, south: float, north: float) -> float:
    """Return the horizontal distance between the box of zone z and another box, m; 0 if they meet."""
    zone = records.zones[z]
    across = max(0.0, zone.west - east, west - zone.east)
    along = max(0.0, zone.south - north, south - zone.north)
    return math.sqrt(across * across + along * along)


@inlined
def distance_to_edge(edge: Record, east: float, north: float) -> float:
    """Return the horizontal distance from a place to one edge, m."""
    step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
    off_e, off_n = east - edge.east, north - edge.north
    share = (off_e * step_e + off_n * step_n) / (step_e * step_e + step_n * step_n)
    share = min(1.0, max(0.0, share))
    off_e -= share * step_e
    off_n -= share * step_n
    return math.sqrt(off_e * off_e + off_n * off_n)


@inner
def nearest_edge(records: ZoneRecords, z: int, east: float, north: float) -> tuple[float, int]:
    """Return the horizontal distance from a place to the outline of zone z, m, negative inside, and the nearest edge.

    The edge number is -1 for a cylinder, which has no edges.
    """
    zone = records.zones[z]
    if zone.round:
        out = math.sqrt((east - zone.centre_east) ** 2 + (north - zone.centre_north) ** 2)
        return float(out - zone.radius), -1
    nearest2, nearest = math.inf, zone.first_edge
    inside = False
    for k in range(zone.first_edge, zone.last_edge):
        edge = records.edges[k]
        step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
        off_e, off_n = east - edge.east, north - edge.north
        share = (off_e * step_e + off_n * step_n) / (step_e * step_e + step_n * step_n)
        share = min(1.0, max(0.0, share))
        off_e -= share * step_e
        off_n -= share * step_n
        away2 = off_e * off_e + off_n * off_n
        if away2 < nearest2:
            nearest2, nearest = away2, k
        # Ray casting to the east: an edge includes its lower end and excludes its upper end.
        if (edge.north > north) != (edge.to_north > north) and edge.east + step_e * (
            north - edge.north
        ) / step_n > east:
            inside = not inside
    return (-math.sqrt(nearest2) if inside else math.sqrt(nearest2)), nearest


@compiled
def edge_distance(records: ZoneRecords, z: int, east: float, north: float) -> float:
    """Return the horizontal distance from a place to the outline of zone z, m; negative inside its shape."""
    away, _ = nearest_edge(records, z, east, north)
    return away


@compiled_inline
def outside_band(zone: Record, up: float, ground: float) -> float:
    """Return the height below a zone's floor or above its ceiling, m.

    Negative between them, to the nearer one.
    zone: a record of `ZONE`.  up: m above mean sea level.  ground: height of the ground there, NaN if not known; the
    result is then NaN for a zone with levels above ground.
    """
    floor: float = zone.floor + ground if zone.floor_above_ground else zone.floor
    ceiling: float = zone.ceiling + ground if zone.ceiling_above_ground else zone.ceiling
    below, above = floor - up, up - ceiling
    # The comparison is written so that NaN is kept.
    return below if below > above or below != below else above


@inner
def inside_share(
    records: ZoneRecords, z: int, ax: float, ay: float, bx: float, by: float, first: float, last: float
) -> float:
    """Return the fraction of the segment a-b inside the shape of zone z, within its part from ``first`` to ``last``.

    first, last: fractions of the segment, 0 and 1 for all of it.  Exact: entries and exits alternate, so that the sum
    of the exit fractions minus the sum of the entry fractions, each clipped to first and last, is the fraction inside.
    A segment along an edge is outside if it is to the right of the edge, and inside if it is to the left.
    """
    zone = records.zones[z]
    dx, dy = bx - ax, by - ay
    if zone.round:
        off_e, off_n = ax - zone.centre_east, ay - zone.centre_north
        run2, along = dx * dx + dy * dy, dx * off_e + dy * off_n
        beside = off_e * off_e + off_n * off_n - zone.radius * zone.radius
        if run2 == 0.0:
            return last - first if beside <= 0.0 else 0.0
        square = along * along - run2 * beside
        if square <= 0.0:
            return 0.0
        half = math.sqrt(square) / run2
        enter = min(last, max(first, -along / run2 - half))
        leave = min(last, max(first, -along / run2 + half))
        return float(leave - enter)
    if dx == 0.0 and dy == 0.0:
        return last - first if edge_distance(records, z, ax, ay) <= 0.0 else 0.0
    inside = 0.0
    for k in range(zone.first_edge, zone.last_edge):
        edge = records.edges[k]
        # Signed distances of the two ends of the edge to the left of the segment's line, times the segment's length.
        before = dx * (edge.north - ay) - dy * (edge.east - ax)
        after = dx * (edge.to_north - ay) - dy * (edge.to_east - ax)
        if (before > 0.0) == (after > 0.0):
            continue
        step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
        # The inside is to the left of the edge: the segment enters where the edge crosses its line from left to right,
        # and leaves where the edge crosses from right to left.
        share = ((edge.east - ax) * step_n - (edge.north - ay) * step_e) / (dx * step_n - dy * step_e)
        share = min(last, max(first, share))
        inside += -share if before > 0.0 else share
    return max(0.0, inside)


@inlined
def _between(edge: Record, ax: float, ay: float, dx: float, dy: float, run2: float) -> tuple[float, float]:
    """Return the squared distance from an edge's first corner to the segment, and its fraction of the segment."""
    share = ((edge.east - ax) * dx + (edge.north - ay) * dy) / run2 if run2 > 0.0 else 0.0
    share = min(1.0, max(0.0, share))
    off_e, off_n = ax + share * dx - edge.east, ay + share * dy - edge.north
    return off_e * off_e + off_n * off_n, share


@inner
def segment_distance(records: ZoneRecords, z: int, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Return the smallest horizontal distance from the segment a-b to the shape of zone z, m, and its fraction of a-b.

    The distance is 0 if the segment meets the shape, at a fraction inside it or on its outline; `edge_distance` gives
    the depth.  Exact: two straight pieces that do not cross are nearest at an end of one of them.
    """
    zone = records.zones[z]
    dx, dy = bx - ax, by - ay
    run2 = dx * dx + dy * dy
    if zone.round:
        share = ((zone.centre_east - ax) * dx + (zone.centre_north - ay) * dy) / run2 if run2 > 0.0 else 0.0
        share = min(1.0, max(0.0, share))
        return max(0.0, edge_distance(records, z, ax + share * dx, ay + share * dy)), share
    from_a, from_b = edge_distance(records, z, ax, ay), edge_distance(records, z, bx, by)
    if from_a <= 0.0:
        return 0.0, 0.0
    if from_b <= 0.0:
        return 0.0, 1.0
    best, best_at = (from_a, 0.0) if from_a <= from_b else (from_b, 1.0)
    for k in range(zone.first_edge, zone.last_edge):
        edge = records.edges[k]
        away2, share = _between(edge, ax, ay, dx, dy, run2)
        if away2 < best * best:
            best, best_at = math.sqrt(away2), share
        before = dx * (edge.north - ay) - dy * (edge.east - ax)
        after = dx * (edge.to_north - ay) - dy * (edge.to_east - ax)
        if (before > 0.0) != (after > 0.0):
            step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
            share = ((edge.east - ax) * step_n - (edge.north - ay) * step_e) / (dx * step_n - dy * step_e)
            if 0.0 <= share <= 1.0:
                return 0.0, share
    return best, best_at
