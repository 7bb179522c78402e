"""Represent zones and their margins as arrays for compiled code.

Also measure distances of lines from shapes.

Each zone has a horizontal and a vertical margin. A fixed end that violates a margin reduces it for its zone. Exclusions
are sorted from west to east, so that a kernel visits only those near a leg. Distances are computed in the axes of the
line: along it from its start, and across it to the left.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from world.airspace.zone_kernels import ZoneRecords, edge_distance, height_outside_band, zone_records
from world.airspace.zones import Zone
from world.arrays import Floats, Heights
from world.by_reference import by_reference
from world.kernels import Records, compiled, inlined, inner, record_dtype
from world.scenario import Scenario
from world.terrain import Terrain

# --- Zones with their margins ---

# Margins of one zone, m: outside its outline, and below its floor or above its ceiling (for an inclusion, inside them).
# number: index of the zone in the scenario. furthest_east: eastern end of this exclusion and all before it, m.
REQUIRED_MARGINS = record_dtype(("number", np.int64), "horizontal", "vertical", "furthest_east")


@by_reference
class ZonesWithMargins(NamedTuple):
    """Zones in the order in which kernels visit them: inclusions, then exclusions from west to east.

    records: the zones.
    required: `REQUIRED_MARGINS` records (z,) with their margins.
    inclusions: number of inclusions.
    max_horizontal: largest horizontal margin, m.
    """

    records: ZoneRecords
    required: Records
    inclusions: int
    max_horizontal: float


class ZoneMargins(NamedTuple):
    """Margins that a path keeps to every zone, m.

    horizontal, vertical: as in `REQUIRED_MARGINS`.
    end_fraction: fraction of the distance between a zone and the start or destination that replaces the margin of this
        zone if that end is closer than the margin.
    """

    horizontal: float
    vertical: float
    end_fraction: float


def add_margins(zones: Sequence[Zone], ends: Floats, terrain: Terrain | None, margins: ZoneMargins) -> ZonesWithMargins:
    """Return zones with their required margins, reduced where a fixed end of the path violates a margin.

    ends: fixed ends of the path, (k, 3) m.
    terrain: ground heights, for zone limits above ground; None if unknown.
    margins: margins to every zone, before the reduction.

    The margin becomes 0 for an exclusion that contains an end, and for an inclusion that does not.

    >>> from world.airspace.zones import Cylinder
    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> ends = np.array([[0.0, 700.0 + 8.0, 60.0], [0.0, 3000.0, 60.0]])
    >>> required = add_margins([zone], ends, None, ZoneMargins(20.0, 10.0, 0.5)).required
    >>> float(required["horizontal"][0]), float(required["vertical"][0])
    (4.0, 10.0)
    """
    unsorted_records = zone_records(zones)
    order = np.lexsort((unsorted_records.zones["west"], unsorted_records.zones["exclusion"]))
    records = ZoneRecords(unsorted_records.zones[order], unsorted_records.edges)
    required: Records = np.zeros(len(order), REQUIRED_MARGINS)
    required["number"], required["horizontal"], required["vertical"] = order, margins.horizontal, margins.vertical
    inclusions = int((~records.zones["exclusion"]).sum())
    required["furthest_east"][inclusions:] = np.maximum.accumulate(records.zones["east"][inclusions:])
    ground_heights = np.full(len(ends), np.nan) if terrain is None else terrain.height(ends[:, 0], ends[:, 1])
    _reduce_margins(
        records, np.ascontiguousarray(ends), np.ascontiguousarray(ground_heights), margins.end_fraction, required
    )
    for array in (records.zones, required):
        array.setflags(write=False)
    return ZonesWithMargins(records, required, inclusions, margins.horizontal)


@compiled
def _reduce_margins(
    records: ZoneRecords, ends: Floats, ground_heights: Floats, fraction: float, required: Records
) -> None:
    """Reduce the margins that a fixed end violates to a fraction of the end's distance from the zone.

    ends: (k, 3) m.
    ground_heights: (k,) ground heights at the ends, m; NaN if unknown.
    fraction: 0 to 1.
    required: `REQUIRED_MARGINS` records (z,), which are changed.

    For an inclusion both margins are reduced. An end must keep only one of the two margins of an exclusion, so only the
    margin to which its distance is larger, in proportion, is reduced.
    """
    for z in range(required.shape[0]):
        zone, margin = records.zones[z], required[z]
        for k in range(ends.shape[0]):
            horizontal_distance = edge_distance(records, z, ends[k, 0], ends[k, 1])
            vertical_distance = height_outside_band(zone, ends[k, 2], ground_heights[k])
            if not zone.exclusion:
                margin.horizontal = min(margin.horizontal, max(0.0, -fraction * horizontal_distance))
                margin.vertical = min(margin.vertical, max(0.0, -fraction * vertical_distance))
            elif horizontal_distance < margin.horizontal and not vertical_distance >= margin.vertical:
                # Reduce the margin of which the end keeps the larger fraction.
                if horizontal_distance * margin.vertical >= vertical_distance * margin.horizontal or math.isnan(
                    vertical_distance
                ):
                    margin.horizontal = max(0.0, fraction * horizontal_distance)
                else:
                    margin.vertical = max(0.0, fraction * vertical_distance)


@inner
def first_exclusion_near(zones: ZonesWithMargins, west: float) -> int:
    """Return the index of the first exclusion that may reach east of `west`, m.

    All exclusions before it end further west. It is found by bisection, because exclusions are sorted.
    """
    low, high = zones.inclusions, zones.required.shape[0]
    while low < high:
        middle = (low + high) // 2
        if zones.required[middle].furthest_east < west:
            low = middle + 1
        else:
            high = middle
    return low


# --- Zones and maximum height of a problem ---


@by_reference
class PlannerAirspace(NamedTuple):
    """Zones and the maximum height above ground; lengths in m.

    zones: exclusions and inclusions with their margins.
    max_height: maximum height above ground, inf for none.
    buffer: margin below the maximum height, away from the ends of the path.
    start_buffer, destination_buffer: margin at the ends.
    depths: negated heights of the ground. With them, staying below the maximum height is computed like staying above
        the ground.
    """

    zones: ZonesWithMargins
    max_height: float
    buffer: float
    start_buffer: float
    destination_buffer: float
    depths: Heights


def make_airspace(scenario: Scenario, margins: ZoneMargins, buffer: float) -> PlannerAirspace:
    """Make the airspace of a scenario with its margins.

    buffer: margin below the maximum height, m. If a fixed end has a smaller margin, only a fraction of that margin
        (`ZoneMargins.end_fraction`) is required there.

    >>> from world.scenario import load_scenario
    >>> space = make_airspace(load_scenario("tight"), ZoneMargins(10.0, 5.0, 1.0), 5.0)
    >>> space.max_height, len(space.zones.required)
    (inf, 0)
    """
    terrain, max_height = scenario.terrain, scenario.limits.max_height_m
    ends = np.stack([scenario.start, scenario.destination])
    zones = add_margins(scenario.zones, ends, terrain, margins)
    needs_depths = max_height is not None or any(zone.has_level_above_ground for zone in scenario.zones)
    # If unused, a small array of the right type.
    depths = -terrain.heights if terrain is not None and needs_depths else np.zeros((2, 2), dtype=np.float32)
    depths.setflags(write=False)
    buffers = [buffer, buffer]
    if max_height is not None and terrain is not None:
        # 1 cm less, against rounding.
        headrooms = max_height - (ends[:, 2] - terrain.height(ends[:, 0], ends[:, 1])) - 0.01
        buffers = [
            buffer if headroom >= buffer else margins.end_fraction * max(0.0, float(headroom)) for headroom in headrooms
        ]
    return PlannerAirspace(
        zones, math.inf if max_height is None else max_height, buffer, buffers[0], buffers[1], depths
    )


def is_limited(airspace: PlannerAirspace) -> bool:
    """Return True if there is a zone or a maximum height above ground.

    >>> from world.scenario import load_scenario
    >>> is_limited(make_airspace(load_scenario("tight"), ZoneMargins(10.0, 5.0, 1.0), 5.0))
    False
    """
    return len(airspace.zones.required) > 0 or airspace.max_height < math.inf


# --- A line and a zone's shape on the map ---


class MapSegment(NamedTuple):
    """Horizontal line: start, unit course (east, north) and length, m."""

    east: float
    north: float
    course_east: float
    course_north: float
    length: float


class ShapeView(NamedTuple):
    """Shape as seen from a line, m.

    inside: True if the line starts in the shape.
    distance: distance from the line to the shape's outline, 0 if they meet; inf if beyond the requested limit.
    right, left: extent of the shape across the line, from its rightmost (negative) to its leftmost point.
    first, last: extent of the shape along the line, measured from the line's start.
    """

    inside: bool
    distance: float
    right: float
    left: float
    first: float
    last: float


@inlined
def segment_between(ax: float, ay: float, bx: float, by: float) -> MapSegment:
    """Return the line from (ax, ay) to (bx, by), m; a line without length gets the course north."""
    dx, dy = bx - ax, by - ay
    horizontal_length = math.sqrt(dx * dx + dy * dy)
    if horizontal_length < 1e-9:
        return MapSegment(ax, ay, 0.0, 1.0, 0.0)
    return MapSegment(ax, ay, dx / horizontal_length, dy / horizontal_length, horizontal_length)


@inner
def view_shape(records: ZoneRecords, z: int, line: MapSegment, max_distance: float) -> ShapeView:
    """Measure the shape of zone z in the axes of a line: its distance, and its extent across and along.

    max_distance: m; a larger distance may be returned as inf.

    The corners and edges of the shape are measured along the line from its start, and across it to the left. The line
    starts inside the shape if the shape's edges cross its axis an odd number of times ahead of its start.
    """
    zone = records.zones[z]
    if zone.round:
        east_offset, north_offset = zone.centre_east - line.east, zone.centre_north - line.north
        along = east_offset * line.course_east + north_offset * line.course_north
        across = north_offset * line.course_east - east_offset * line.course_north
        distance_beyond_end = along - min(line.length, max(0.0, along))
        min_distance = math.sqrt(distance_beyond_end * distance_beyond_end + across * across) - zone.radius
        max_inside_distance = math.sqrt(max(abs(along), abs(along - line.length)) ** 2 + across * across) - zone.radius
        is_inside = along * along + across * across <= zone.radius * zone.radius
        # The line is outside, or inside, or crosses the outline.
        distance = min_distance if min_distance > 0.0 else max(0.0, -max_inside_distance)
        return ShapeView(
            is_inside, distance, across - zone.radius, across + zone.radius, along - zone.radius, along + zone.radius
        )
    is_inside, distance2 = False, math.inf
    right = math.inf
    left = -math.inf
    first = math.inf
    last = -math.inf
    edges = records.edges
    for k in range(zone.first_edge, zone.last_edge):
        edge = edges[k]
        east_offset, north_offset = edge.east - line.east, edge.north - line.north
        along = east_offset * line.course_east + north_offset * line.course_north
        across = north_offset * line.course_east - east_offset * line.course_north
        east_offset, north_offset = edge.to_east - line.east, edge.to_north - line.north
        to_along = east_offset * line.course_east + north_offset * line.course_north
        to_across = north_offset * line.course_east - east_offset * line.course_north
        right = min(right, across)
        left = max(left, across)
        first = min(first, along)
        last = max(last, along)
        if (across > 0.0) != (to_across > 0.0):
            # The edge crosses the extended line; each crossing ahead of the line's start changes inside to outside.
            crossing = along + (to_along - along) * across / (across - to_across)
            is_inside = is_inside != (crossing > 0.0)
            if 0.0 <= crossing <= line.length:
                distance2 = 0.0
        is_ahead, is_behind = min(along, to_along) > line.length + max_distance, max(along, to_along) < -max_distance
        if (
            is_ahead
            or is_behind
            or min(across, to_across) > max_distance
            or max(across, to_across) < -max_distance
            or distance2 == 0.0
        ):
            continue
        distance2 = min(distance2, _edge_distance2(along, across, to_along, to_across, line.length))
    distance = math.sqrt(distance2)
    return ShapeView(is_inside, distance if distance <= max_distance else math.inf, right, left, first, last)


@inlined
def _edge_distance2(along: float, across: float, to_along: float, to_across: float, horizontal_length: float) -> float:
    """Return the squared distance between a line and an edge that does not cross the line, m^2.

    along, across, to_along, to_across: both ends of the edge, measured along the line from its start and across it, m.
    horizontal_length: length of the line, m.
    """
    # Two pieces that do not cross are nearest at an end of one of them.
    distance_beyond_end = along - min(horizontal_length, max(0.0, along))
    min_distance2 = distance_beyond_end * distance_beyond_end + across * across
    distance_beyond_end = to_along - min(horizontal_length, max(0.0, to_along))
    min_distance2 = min(min_distance2, distance_beyond_end * distance_beyond_end + to_across * to_across)
    along_step, across_step = to_along - along, to_across - across
    length2 = along_step * along_step + across_step * across_step
    # From the line's start, then from its end.
    fraction = min(1.0, max(0.0, -(along * along_step + across * across_step) / length2))
    x, y = along + fraction * along_step, across + fraction * across_step
    min_distance2 = min(min_distance2, x * x + y * y)
    fraction = min(1.0, max(0.0, ((horizontal_length - along) * along_step - across * across_step) / length2))
    x, y = along + fraction * along_step - horizontal_length, across + fraction * across_step
    return min(min_distance2, x * x + y * y)
