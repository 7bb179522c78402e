"""Measure how legs penetrate zones, and how far a path is from zones.

The search uses the depths, and the certificate the distances.

The search penalises a leg by the depth of its penetration times its length, computed from the zone's extent across and
along the leg; for zone limits above ground the terrain is sampled. The certificate cuts the path near a zone into
pieces so short that each has practically one height above ground, and measures their distances from straight edges and
circles exactly.
"""

import math
from typing import NamedTuple

import numpy as np

from planner.airspace.zone_limits import MapSegment, ZonesWithMargins, first_exclusion_near, segment_between, view_shape
from world.airspace.zone_kernels import ZoneRecords, box_distance, edge_distance
from world.arrays import Floats, Heights
from world.frames import PolyMapRecord, polymap
from world.kernels import Record, inlined, inner
from world.terrain import pixel_height, segment_clearance

# --- Penetration of zones, for the search ---

# The charge is 0 only if the leg violates no margin. An exclusion is charged along the full part of the leg that is
# abreast of its shape, so that a leg through a concave part of the outline may be charged although it stays outside.

# Spacing of the samples on a leg that leaves an inclusion, m.
OUTSIDE_SAMPLE_SPACING = 100.0
# Maximum number of these samples.
MAX_SAMPLES = 20
# Shortest length that is charged, m.
MIN_CHARGED_LENGTH = 1.0
# Bound on the height above unknown ground, m.
UNKNOWN_HEIGHT_BOUND = 9000.0


class AltitudeBand(NamedTuple):
    """Vertical range of a part of a path, m: altitudes AMSL, and heights above the ground below it."""

    min_altitude: float
    max_altitude: float
    min_height: float
    max_height: float


@inner
def zone_penetration(
    zones: ZonesWithMargins,
    heights: Heights,
    to_pixel: PolyMapRecord,
    sample_spacing: float,
    a: Floats,
    b: Floats,
    lateral_error: float,
    error_below: float,
    error_above: float,
) -> float:
    """Return how much the leg a-b violates all zones and their margins: depth times length, m·km.

    In an exclusion the depth is the smaller of the horizontal and the vertical depth. For an inclusion the horizontal
    and the vertical distance outside are added.

    heights, to_pixel: ground heights, m, and the map from positions to their pixels.
    sample_spacing: spacing of the ground samples for zone limits that are stated above ground, m.
    a, b: (3,) ends of the leg, m.
    lateral_error, error_below, error_above: tracking error to the side, below and above, m.
    """
    line = segment_between(a[0], a[1], b[0], b[1])
    total, required, records = 0.0, zones.required, zones.records
    for z in range(zones.inclusions):
        required_distance = required[z].horizontal + lateral_error
        total += _inclusion_excess(records, z, line, required_distance)
        zone = records.zones[z]
        band = altitude_band(a[2], b[2], error_below, error_above)
        if zone.floor_above_ground or zone.ceiling_above_ground:
            band = _sampled_altitude_band(heights, to_pixel, sample_spacing, a, b, 0.0, 1.0, error_below, error_above)
        vertical_excess = vertical_distance(zone, band) + required[z].vertical
        total += max(0.0, vertical_excess) * max(line.length, MIN_CHARGED_LENGTH) / 1000.0
    max_margin = zones.max_horizontal + lateral_error
    west, east = min(a[0], b[0]) - max_margin, max(a[0], b[0]) + max_margin
    south, north = min(a[1], b[1]) - max_margin, max(a[1], b[1]) + max_margin
    for z in range(first_exclusion_near(zones, west), required.shape[0]):
        zone = records.zones[z]
        if zone.west > east:
            break
        if zone.east < west or zone.south > north or zone.north < south:
            continue
        depth, first_fraction, last_fraction = penetration_depth(
            records, z, line, required[z].horizontal + lateral_error
        )
        if depth <= 0.0:
            continue
        altitude_change = b[2] - a[2]
        band = altitude_band(
            a[2] + first_fraction * altitude_change, a[2] + last_fraction * altitude_change, error_below, error_above
        )
        if zone.floor_above_ground or zone.ceiling_above_ground:
            band = _sampled_altitude_band(
                heights, to_pixel, sample_spacing, a, b, first_fraction, last_fraction, error_below, error_above
            )
        vertical_excess = required[z].vertical - vertical_distance(zone, band)
        total += (
            max(0.0, min(depth, vertical_excess))
            * max((last_fraction - first_fraction) * line.length, MIN_CHARGED_LENGTH)
            / 1000.0
        )
    return total


@inner
def penetration_depth(
    records: ZoneRecords, z: int, line: MapSegment, required_distance: float
) -> tuple[float, float, float]:
    """Return the depth of a line in exclusion z with its margin, and the part of the line next to it.

    required_distance: required distance from the zone, m.

    Returns three numbers. The first is the depth: the distance by which the line would have to be shifted sideways to
    be `required_distance` away from the zone, m; 0 if it is far enough away. The others are the beginning and the end
    of the part, as fractions of the line's length.
    """
    view = view_shape(records, z, line, required_distance)
    if not view.inside and view.distance >= required_distance:
        return 0.0, 0.0, 0.0
    if view.inside or view.distance == 0.0:
        depth = required_distance + max(0.0, min(view.left, -view.right))
    else:
        depth = required_distance - view.distance
    per_metre = 1.0 / max(line.length, 1e-9)
    first_fraction = (view.first - required_distance) * per_metre
    last_fraction = (view.last + required_distance) * per_metre
    return max(depth, 1e-9), min(1.0, max(0.0, first_fraction)), min(1.0, max(0.0, last_fraction))


@inner
def _inclusion_excess(records: ZoneRecords, z: int, line: MapSegment, required_distance: float) -> float:
    """Return how much a line violates inclusion z and its margin: distance outside times length, m·km.

    required_distance: required distance from the edge, on the inside, m.

    The result is 0 for a line that keeps this distance everywhere.
    """
    view = view_shape(records, z, line, required_distance)
    if view.inside and view.distance >= required_distance:
        return 0.0
    sample_count = int(min(MAX_SAMPLES, 2.0 + line.length / OUTSIDE_SAMPLE_SPACING))
    total = 0.0
    for k in range(sample_count):
        distance = line.length * k / (sample_count - 1)
        east, north = line.east + distance * line.course_east, line.north + distance * line.course_north
        total += max(0.0, required_distance + edge_distance(records, z, east, north))
    spacing = max(line.length, MIN_CHARGED_LENGTH) / sample_count
    # Between the samples the line may be nearer to the outline.
    shortfall = max(1e-9, required_distance - view.distance) if total == 0.0 else 0.0
    return (total * spacing + shortfall * MIN_CHARGED_LENGTH) / 1000.0


@inlined
def altitude_band(start_altitude: float, end_altitude: float, error_below: float, error_above: float) -> AltitudeBand:
    """Return the range of altitudes of a straight line, extended by the tracking error.

    The range of heights above ground is practically unlimited, as for unknown ground.

    start_altitude, end_altitude: altitudes of both ends, m.
    error_below, error_above: vertical tracking error, m.
    """
    min_altitude = min(start_altitude, end_altitude) - error_below
    max_altitude = max(start_altitude, end_altitude) + error_above
    return AltitudeBand(min_altitude, max_altitude, -UNKNOWN_HEIGHT_BOUND, UNKNOWN_HEIGHT_BOUND)


@inner
def _sampled_altitude_band(
    heights: Heights,
    to_pixel: PolyMapRecord,
    sample_spacing: float,
    a: Floats,
    b: Floats,
    first_fraction: float,
    last_fraction: float,
    error_below: float,
    error_above: float,
) -> AltitudeBand:
    """Return the vertical range of a part of the line a-b: its altitudes, and its heights above ground.

    heights, to_pixel: ground heights, m, and the map from positions to their pixels.
    sample_spacing: spacing of the ground samples, m.
    a, b: (3,) ends of the line, m.
    first_fraction, last_fraction: limits of the part, as fractions of the line.
    error_below, error_above: vertical tracking error, m, by which the ranges are extended.

    The heights above ground are measured at samples. If the ground is unknown at a sample, they are not limited.
    """
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    band = altitude_band(a[2] + first_fraction * dz, a[2] + last_fraction * dz, error_below, error_above)
    first_column, first_row = polymap(to_pixel, a[0] + first_fraction * dx, a[1] + first_fraction * dy)
    last_column, last_row = polymap(to_pixel, a[0] + last_fraction * dx, a[1] + last_fraction * dy)
    sample_count = 2 + int((last_fraction - first_fraction) * math.sqrt(dx * dx + dy * dy) / sample_spacing)
    min_height, max_height = math.inf, -math.inf
    for k in range(sample_count):
        fraction = k / (sample_count - 1)
        ground_height = pixel_height(
            heights,
            first_column + fraction * (last_column - first_column),
            first_row + fraction * (last_row - first_row),
        )
        if math.isnan(ground_height):
            return band
        height = a[2] + (first_fraction + fraction * (last_fraction - first_fraction)) * dz - ground_height
        min_height, max_height = min(min_height, height - error_below), max(max_height, height + error_above)
    return AltitudeBand(band.min_altitude, band.max_altitude, min_height, max_height)


@inlined
def vertical_distance(zone: Record, band: AltitudeBand) -> float:
    """Return how far altitudes are below a zone's floor or above its ceiling, m; negative between both.

    For an exclusion the smallest distance in the range is taken, because no altitude may be inside the zone. For an
    inclusion the largest distance is taken, because all altitudes must be inside.
    """
    floor_min, floor_max = band.min_altitude, band.max_altitude
    if zone.floor_above_ground:
        floor_min, floor_max = band.min_height, band.max_height
    ceiling_min, ceiling_max = band.min_altitude, band.max_altitude
    if zone.ceiling_above_ground:
        ceiling_min, ceiling_max = band.min_height, band.max_height
    distance: float = max(zone.floor - floor_max, ceiling_min - zone.ceiling)
    if not zone.exclusion:
        distance = max(zone.floor - floor_min, ceiling_max - zone.ceiling)
    return distance


# --- Margins to zones, for the certificate ---

# Length of pieces near a zone, m: short enough for the heights to apply to the positions.
MAX_PIECE_LENGTH = 25.0
# Margin of a piece of a path. nearest: smallest distance outside an exclusion or inside an inclusion, horizontal or
# vertical, m; negative if a zone is violated. excess: smallest excess over a zone's required distance, m; negative if
# a margin is violated. zone: the nearest zone, with preference for a violated margin; -1 without a zone.
ZONE_MARGIN = np.dtype([("nearest", np.float64), ("excess", np.float64), ("zone", np.int64)])


@inner
def measure_zone_margin(
    zones: ZonesWithMargins,
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    lateral_error: Floats,
    error_below: float,
    error_above: float,
    margin: Record,
) -> None:
    """Measure the margins of a straight piece a-b of a path to all zones; fill its `ZONE_MARGIN` record.

    heights, depths, to_pixel: ground heights, m, the same with the opposite sign, and the map from positions to pixels.
    a, b: (3,) ends of the piece, m. lateral_error: (2,) lateral tracking error at a and b, m.
    error_below, error_above: vertical tracking error, m. margin: the record to fill.
    """
    margin.nearest, margin.excess, margin.zone = math.inf, math.inf, -1
    records, max_lateral_error = zones.records, max(lateral_error[0], lateral_error[1])
    west, east = min(a[0], b[0]) - max_lateral_error, max(a[0], b[0]) + max_lateral_error
    south, north = min(a[1], b[1]) - max_lateral_error, max(a[1], b[1]) + max_lateral_error
    horizontal_length = math.hypot(b[0] - a[0], b[1] - a[1])
    piece_start, piece_end, piece_error = a.copy(), b.copy(), lateral_error.copy()
    for z in range(zones.required.shape[0]):
        required, zone = zones.required[z], records.zones[z]
        max_required = max(required.horizontal, required.vertical)
        # A zone further away than this cannot change the margin.
        search_distance = max(max_required, min(max(margin.nearest, max_required + margin.excess), 1e9))
        if zone.exclusion and box_distance(records, z, west, east, south, north) >= search_distance:
            continue
        uses_ground = zone.floor_above_ground or zone.ceiling_above_ground
        band = altitude_band(a[2], b[2], error_below, error_above)
        if uses_ground:
            band = _exact_altitude_band(heights, depths, to_pixel, a, b, lateral_error, error_below, error_above)
        horizontal = _horizontal_distance(records, z, a, b, search_distance + max_lateral_error) - max_lateral_error
        vertical = vertical_distance(zone, band)
        if _distance_to_violation(zone, horizontal, vertical) >= search_distance:
            continue
        # The zone may be near: measure short pieces, whose heights and positions belong together.
        piece_count = max(1, math.ceil(horizontal_length / MAX_PIECE_LENGTH))
        for k in range(piece_count):
            for axis in range(3):
                piece_start[axis] = a[axis] + (b[axis] - a[axis]) * k / piece_count
                piece_end[axis] = a[axis] + (b[axis] - a[axis]) * (k + 1) / piece_count
            for end in range(2):
                piece_error[end] = lateral_error[0] + (lateral_error[1] - lateral_error[0]) * (k + end) / piece_count
            band = altitude_band(piece_start[2], piece_end[2], error_below, error_above)
            if uses_ground:
                band = _exact_altitude_band(
                    heights, depths, to_pixel, piece_start, piece_end, piece_error, error_below, error_above
                )
            max_piece_error = max(piece_error[0], piece_error[1])
            horizontal = (
                _horizontal_distance(records, z, piece_start, piece_end, search_distance + max_piece_error)
                - max_piece_error
            )
            vertical = vertical_distance(zone, band)
            _update_margin(zone, required, z, horizontal, vertical, margin)


@inner
def _update_margin(zone: Record, required: Record, z: int, horizontal: float, vertical: float, margin: Record) -> None:
    """Update a `ZONE_MARGIN` record, which keeps the smallest margins, with the distances to zone z.

    zone: shape and altitude limits of the zone.
    required: required horizontal and vertical distances, m.
    horizontal: distance outside an exclusion or inside an inclusion, m.
    vertical: distance below the zone's floor or above its ceiling, m.
    margin: the record to update.
    """
    excess = max(horizontal - required.horizontal, vertical - required.vertical)
    if not zone.exclusion:
        excess = min(horizontal - required.horizontal, -vertical - required.vertical)
    distance = _distance_to_violation(zone, horizontal, vertical)
    # A zone whose margin is violated takes precedence over a nearer one.
    if (margin.excess >= 0.0) != (excess >= 0.0):
        if excess < 0.0:
            margin.zone = z
    elif distance < margin.nearest or margin.zone < 0:
        margin.zone = z
    margin.excess = min(margin.excess, excess)
    margin.nearest = min(margin.nearest, distance)


@inner
def _distance_to_violation(zone: Record, horizontal: float, vertical: float) -> float:
    """Return how far a piece of a path is from violating a zone, m; negative if it violates the zone.

    horizontal: distance outside an exclusion or inside an inclusion, m.
    vertical: distance below the zone's floor or above its ceiling, m.
    """
    return max(horizontal, vertical) if zone.exclusion else min(horizontal, -vertical)


@inner
def _horizontal_distance(records: ZoneRecords, z: int, a: Floats, b: Floats, max_distance: float) -> float:
    """Return the horizontal distance of the line a-b from the edge of zone z, m; negative in a violation.

    This is the distance from the edge for a line outside an exclusion or inside an inclusion. It is minus the depth (or
    0) for a line that enters the exclusion, and minus the distance of the further end for a line that leaves the
    inclusion. A distance above `max_distance` may be returned as inf.
    """
    line = segment_between(a[0], a[1], b[0], b[1])
    view = view_shape(records, z, line, max_distance)
    if records.zones[z].exclusion:
        if view.inside or view.distance == 0.0:
            return -max(0.0, min(view.left, -view.right))
        return view.distance
    if view.inside and view.distance > 0.0:
        return view.distance
    return -max(0.0, edge_distance(records, z, a[0], a[1]), edge_distance(records, z, b[0], b[1]))


@inner
def _exact_altitude_band(
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    lateral_error: Floats,
    error_below: float,
    error_above: float,
) -> AltitudeBand:
    """Return the vertical range of the line a-b, with the exact range of its heights above ground.

    heights, depths, to_pixel: ground heights, m, the same with the opposite sign, and the map from positions to pixels.
    a, b: (3,) ends of the line, m.
    lateral_error: (2,) width of the ground strip on each side of the line that is included, at a and at b, m.
    error_below, error_above: vertical tracking error, m, by which the ranges are extended.
    """
    band = altitude_band(a[2], b[2], error_below, error_above)
    horizontal_length = max(1e-9, math.hypot(b[0] - a[0], b[1] - a[1]))
    ux, uy = (b[0] - a[0]) / horizontal_length, (b[1] - a[1]) / horizontal_length
    offset_start, offset_end = a.copy(), b.copy()
    min_height, max_height = math.inf, -math.inf
    for side in (0.0, -1.0, 1.0):
        for end, point, offset in ((offset_start, a, lateral_error[0]), (offset_end, b, lateral_error[1])):
            end[0], end[1], end[2] = point[0] + side * offset * uy, point[1] - side * offset * ux, point[2]
        clearance, _ = segment_clearance(heights, to_pixel, offset_start, offset_end)
        offset_start[2], offset_end[2] = -a[2], -b[2]
        depth_clearance, _ = segment_clearance(depths, to_pixel, offset_start, offset_end)
        if math.isnan(clearance) or math.isnan(depth_clearance):
            return band
        min_height = min(min_height, clearance - error_below)
        max_height = max(max_height, error_above - depth_clearance)
    return AltitudeBand(band.min_altitude, band.max_altitude, min_height, max_height)
