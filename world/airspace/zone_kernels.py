"""Compute distances of positions and segments from zones in compiled code.

The distances are exact for straight edges and circles.

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
    """Zones for compiled code.

    zones: (z,) of `ZONE`, in the given order.
    edges: (e,) of `EDGE`, the edges of all polygons.
    """

    zones: Records
    edges: Records


def zone_records(zones: Sequence[Zone]) -> ZoneRecords:
    """Convert zones to the records that kernels read: one per zone, and one per edge of all polygons.

    >>> records = zone_records([Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))])
    >>> float(records.zones[0].north), len(records.edges)
    (700.0, 0)
    """
    records: Records = np.zeros(len(zones), ZONE)
    edge_count = 0
    rings: list[Ring] = []
    for record, zone in zip(records, zones, strict=True):
        record.exclusion = zone.kind == "exclusion"
        record.floor, record.floor_above_ground = _level_record(zone.floor, -math.inf)
        record.ceiling, record.ceiling_above_ground = _level_record(zone.ceiling, math.inf)
        record.first_edge = edge_count
        shape = zone.shape
        if isinstance(shape, Cylinder):
            record.round, record.radius = True, shape.radius
            record.centre_east, record.centre_north = shape.east, shape.north
            record.west, record.east = shape.east - shape.radius, shape.east + shape.radius
            record.south, record.north = shape.north - shape.radius, shape.north + shape.radius
        else:
            rings += shape.rings
            edge_count += sum(map(len, shape.rings))
        record.last_edge = edge_count
    # Edges from every corner to the next corner of its ring.
    corners = np.array([corner for ring in rings for corner in ring], dtype=np.float64).reshape(-1, 2)
    next_corners = np.roll(corners, -1, axis=0)
    sizes = np.array([len(ring) for ring in rings], dtype=np.int64)
    ends = np.cumsum(sizes)
    next_corners[ends - 1] = corners[ends - sizes]
    edges: Records = np.zeros(len(corners), EDGE)
    edges["east"], edges["north"] = corners.T
    edges["to_east"], edges["to_north"] = next_corners.T
    # Bounding boxes of the polygons; the boxes of cylinders are set above.
    polygons = np.flatnonzero(~records["round"])
    if polygons.size:
        # Every polygon has edges, and the edges of a polygon are consecutive.
        starts = records["first_edge"][polygons]
        for min_name, max_name, coordinate in (("west", "east", "east"), ("south", "north", "north")):
            records[min_name][polygons] = np.minimum.reduceat(edges[coordinate], starts)
            records[max_name][polygons] = np.maximum.reduceat(edges[coordinate], starts)
    for array in (records, edges):
        array.setflags(write=False)
    return ZoneRecords(records, edges)


def _level_record(level: ZoneLevel | None, default_height: float) -> tuple[float, bool]:
    """Return (height in m, is above ground) of a floor or ceiling.

    Without a level, return (default height, False).
    """
    return (default_height, False) if level is None else (level.height, level.datum == "ground")


@inlined
def box_distance(records: ZoneRecords, z: int, west: float, east: float, south: float, north: float) -> float:
    """Return the horizontal distance between a box on the map and the bounding box of zone z, m.

    z: index of the zone in ``records``.
    west, east, south, north: edges of the box, m.

    The distance is 0 if the boxes overlap.
    """
    zone = records.zones[z]
    east_gap = max(0.0, zone.west - east, west - zone.east)
    north_gap = max(0.0, zone.south - north, south - zone.north)
    return math.sqrt(east_gap * east_gap + north_gap * north_gap)


@inlined
def distance_to_edge(edge: Record, east: float, north: float) -> float:
    """Return the horizontal distance from a position (east, north, m) to an edge, a record of `EDGE`, m."""
    step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
    east_offset, north_offset = east - edge.east, north - edge.north
    fraction = (east_offset * step_e + north_offset * step_n) / (step_e * step_e + step_n * step_n)
    fraction = min(1.0, max(0.0, fraction))
    east_offset -= fraction * step_e
    north_offset -= fraction * step_n
    return math.sqrt(east_offset * east_offset + north_offset * north_offset)


@inner
def nearest_edge(records: ZoneRecords, z: int, east: float, north: float) -> tuple[float, int]:
    """Return the distance from a position to the outline of zone z, m, and the index of the nearest edge.

    z: index of the zone in ``records``.
    east, north: position, m.

    The distance is horizontal, and negative inside the zone. The index is -1 for a cylinder, which has no edges.
    """
    zone = records.zones[z]
    if zone.round:
        centre_distance = math.sqrt((east - zone.centre_east) ** 2 + (north - zone.centre_north) ** 2)
        return float(centre_distance - zone.radius), -1
    min_distance2, nearest_index = math.inf, zone.first_edge
    is_inside = False
    for k in range(zone.first_edge, zone.last_edge):
        edge = records.edges[k]
        step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
        east_offset, north_offset = east - edge.east, north - edge.north
        fraction = (east_offset * step_e + north_offset * step_n) / (step_e * step_e + step_n * step_n)
        fraction = min(1.0, max(0.0, fraction))
        east_offset -= fraction * step_e
        north_offset -= fraction * step_n
        distance2 = east_offset * east_offset + north_offset * north_offset
        if distance2 < min_distance2:
            min_distance2, nearest_index = distance2, k
        # Ray casting to the east: an edge includes its lower end and excludes its upper end.
        if (edge.north > north) != (edge.to_north > north) and edge.east + step_e * (
            north - edge.north
        ) / step_n > east:
            is_inside = not is_inside
    return (-math.sqrt(min_distance2) if is_inside else math.sqrt(min_distance2)), nearest_index


@compiled
def edge_distance(records: ZoneRecords, z: int, east: float, north: float) -> float:
    """Return the horizontal distance from a position to the outline of zone z, m; negative inside.

    The position is east and north, m.
    """
    distance, _ = nearest_edge(records, z, east, north)
    return distance


@compiled_inline
def height_outside_band(zone: Record, up: float, ground: float) -> float:
    """Return the distance of an altitude below a zone's floor or above its ceiling, m.

    zone: a record of `ZONE`.
    up: altitude, m AMSL.
    ground: altitude of the ground below, m AMSL; if it is NaN (unknown), the result is NaN for a zone with levels above
        ground.

    Between floor and ceiling the result is minus the distance to the nearer of the two.
    """
    floor: float = zone.floor + ground if zone.floor_above_ground else zone.floor
    ceiling: float = zone.ceiling + ground if zone.ceiling_above_ground else zone.ceiling
    height_below, height_above = floor - up, up - ceiling
    # The comparison is written so that NaN is kept.
    return height_below if height_below > height_above or height_below != height_below else height_above


@inner
def inside_fraction(
    records: ZoneRecords, z: int, ax: float, ay: float, bx: float, by: float, begin_fraction: float, end_fraction: float
) -> float:
    """Return the fraction of the segment a-b that is inside zone z on the map.

    Only a part of the segment is examined.

    ax, ay, bx, by: ends of the segment, east and north, m.
    begin_fraction, end_fraction: limits of the part, as fractions of the segment; 0 and 1 for the whole segment.

    The result is exact. Entries and exits alternate, so the fraction inside is the sum of the exit fractions minus the
    sum of the entry fractions, all clipped to the part. A segment along an edge is outside if it is to the right of the
    edge, and inside if it is to the left.
    """
    zone = records.zones[z]
    dx, dy = bx - ax, by - ay
    if zone.round:
        east_offset, north_offset = ax - zone.centre_east, ay - zone.centre_north
        run2, dot_product = dx * dx + dy * dy, dx * east_offset + dy * north_offset
        power = east_offset * east_offset + north_offset * north_offset - zone.radius * zone.radius
        if run2 == 0.0:
            return end_fraction - begin_fraction if power <= 0.0 else 0.0
        discriminant = dot_product * dot_product - run2 * power
        if discriminant <= 0.0:
            return 0.0
        half_fraction = math.sqrt(discriminant) / run2
        entry_fraction = min(end_fraction, max(begin_fraction, -dot_product / run2 - half_fraction))
        exit_fraction = min(end_fraction, max(begin_fraction, -dot_product / run2 + half_fraction))
        return float(exit_fraction - entry_fraction)
    if dx == 0.0 and dy == 0.0:
        return end_fraction - begin_fraction if edge_distance(records, z, ax, ay) <= 0.0 else 0.0
    fraction_inside = 0.0
    for k in range(zone.first_edge, zone.last_edge):
        edge = records.edges[k]
        # Signed distances of the two ends of the edge to the left of the segment's line, times the segment's length.
        start_side = dx * (edge.north - ay) - dy * (edge.east - ax)
        end_side = dx * (edge.to_north - ay) - dy * (edge.to_east - ax)
        if (start_side > 0.0) == (end_side > 0.0):
            continue
        step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
        # The inside is to the left of the edge: the segment enters where the edge crosses its line from left to right,
        # and leaves where the edge crosses from right to left.
        fraction = ((edge.east - ax) * step_n - (edge.north - ay) * step_e) / (dx * step_n - dy * step_e)
        fraction = min(end_fraction, max(begin_fraction, fraction))
        fraction_inside += -fraction if start_side > 0.0 else fraction
    return max(0.0, fraction_inside)


@inlined
def _corner_distance2(edge: Record, ax: float, ay: float, dx: float, dy: float, run2: float) -> tuple[float, float]:
    """Return the squared distance from an edge's first corner to a segment, m^2.

    Also return the segment's nearest point.

    ax, ay: start of the segment, east and north, m.
    dx, dy: vector of the segment, m.
    run2: squared length of the vector, m^2.

    The nearest point is given as a fraction of the segment.
    """
    fraction = ((edge.east - ax) * dx + (edge.north - ay) * dy) / run2 if run2 > 0.0 else 0.0
    fraction = min(1.0, max(0.0, fraction))
    east_offset, north_offset = ax + fraction * dx - edge.east, ay + fraction * dy - edge.north
    return east_offset * east_offset + north_offset * north_offset, fraction


@inner
def segment_distance(records: ZoneRecords, z: int, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Return the horizontal distance from the segment a-b to zone z, m, and the segment's nearest point.

    ax, ay, bx, by: ends of the segment, east and north, m.

    The nearest point is given as a fraction of the segment. If the segment meets the shape, the distance is 0, and the
    point is inside the shape or on its outline. The result is exact, because two straight lines that do not cross are
    nearest at an end of one of them.
    """
    zone = records.zones[z]
    dx, dy = bx - ax, by - ay
    run2 = dx * dx + dy * dy
    if zone.round:
        fraction = ((zone.centre_east - ax) * dx + (zone.centre_north - ay) * dy) / run2 if run2 > 0.0 else 0.0
        fraction = min(1.0, max(0.0, fraction))
        return max(0.0, edge_distance(records, z, ax + fraction * dx, ay + fraction * dy)), fraction
    distance_at_a, distance_at_b = edge_distance(records, z, ax, ay), edge_distance(records, z, bx, by)
    if distance_at_a <= 0.0:
        return 0.0, 0.0
    if distance_at_b <= 0.0:
        return 0.0, 1.0
    min_distance, min_fraction = (distance_at_a, 0.0) if distance_at_a <= distance_at_b else (distance_at_b, 1.0)
    for k in range(zone.first_edge, zone.last_edge):
        edge = records.edges[k]
        distance2, fraction = _corner_distance2(edge, ax, ay, dx, dy, run2)
        if distance2 < min_distance * min_distance:
            min_distance, min_fraction = math.sqrt(distance2), fraction
        start_side = dx * (edge.north - ay) - dy * (edge.east - ax)
        end_side = dx * (edge.to_north - ay) - dy * (edge.to_east - ax)
        if (start_side > 0.0) != (end_side > 0.0):
            step_e, step_n = edge.to_east - edge.east, edge.to_north - edge.north
            fraction = ((edge.east - ax) * step_n - (edge.north - ay) * step_e) / (dx * step_n - dy * step_e)
            if 0.0 <= fraction <= 1.0:
                return 0.0, fraction
    return min_distance, min_fraction
