"""Measure how deep legs penetrate zones, for the search, and how far path pieces are from zones, for the certificate.

A search charges each leg the depth of its penetration times its length, computed from a zone's extent across and along
the leg; for levels above ground the terrain is sampled. A certificate cuts pieces near a zone so short that the heights
apply to the positions, and measures their distances exactly for straight edges and circles.
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

# Spacing of samples on a leg that leaves an inclusion, m.
OUTSIDE_PITCH = 100.0
# Maximum number of these samples.
MAX_SAMPLES = 20
# Shortest length that is charged, m.
MIN_CHARGED_LENGTH = 1.0
# Bound on the height above unknown ground, m.
UNKNOWN = 9000.0


class AltitudeBand(NamedTuple):
    """Vertical range of a part of a path, above mean sea level and above the ground below the part, m."""

    lowest: float
    highest: float
    lowest_above_ground: float
    highest_above_ground: float


@inner
def zone_excess(
    zones: ZonesWithMargins,
    heights: Heights,
    to_pixel: PolyMapRecord,
    pitch: float,
    a: Floats,
    b: Floats,
    lateral: float,
    below: float,
    above: float,
) -> float:
    """Return the depth of the leg a-b in zones enlarged by their margins, integrated over its length, m x km.

    pitch: spacing of terrain samples (m), for levels above ground. lateral, below, above: tracking error, m.
    """
    line = segment_between(a[0], a[1], b[0], b[1])
    total, required, records = 0.0, zones.required, zones.records
    for z in range(zones.inclusions):
        wanted = required[z].horizontal + lateral
        total += _inclusion_excess(records, z, line, wanted)
        zone = records.zones[z]
        band = altitude_band(a[2], b[2], below, above)
        if zone.floor_above_ground or zone.ceiling_above_ground:
            band = _sampled_altitude_band(heights, to_pixel, pitch, a, b, 0.0, 1.0, below, above)
        over = vertical_distance(zone, band) + required[z].vertical
        total += max(0.0, over) * max(line.run, MIN_CHARGED_LENGTH) / 1000.0
    widest = zones.max_horizontal + lateral
    west, east = min(a[0], b[0]) - widest, max(a[0], b[0]) + widest
    south, north = min(a[1], b[1]) - widest, max(a[1], b[1]) + widest
    for z in range(first_exclusion_near(zones, west), required.shape[0]):
        zone = records.zones[z]
        if zone.west > east:
            break
        if zone.east < west or zone.south > north or zone.north < south:
            continue
        depth, first, last = penetration_depth(records, z, line, required[z].horizontal + lateral)
        if depth <= 0.0:
            continue
        rise = b[2] - a[2]
        band = altitude_band(a[2] + first * rise, a[2] + last * rise, below, above)
        if zone.floor_above_ground or zone.ceiling_above_ground:
            band = _sampled_altitude_band(heights, to_pixel, pitch, a, b, first, last, below, above)
        over = required[z].vertical - vertical_distance(zone, band)
        total += max(0.0, min(depth, over)) * max((last - first) * line.run, MIN_CHARGED_LENGTH) / 1000.0
    return total


@inner
def penetration_depth(records: ZoneRecords, z: int, line: MapSegment, wanted: float) -> tuple[float, float, float]:
    """Return the lateral shift that moves a line `wanted` m away from exclusion z, and its fractions abreast of z.

    The shift is 0 m if the line already is that far away.
    """
    reach = view_shape(records, z, line, wanted)
    if not reach.inside and reach.distance >= wanted:
        return 0.0, 0.0, 0.0
    if reach.inside or reach.distance == 0.0:
        depth = wanted + max(0.0, min(reach.left, -reach.right))
    else:
        depth = wanted - reach.distance
    per_metre = 1.0 / max(line.run, 1e-9)
    first, last = (reach.first - wanted) * per_metre, (reach.last + wanted) * per_metre
    return max(depth, 1e-9), min(1.0, max(0.0, first)), min(1.0, max(0.0, last))


@inner
def _inclusion_excess(records: ZoneRecords, z: int, line: MapSegment, wanted: float) -> float:
    """Return how much a line's distance inside inclusion z falls short of `wanted` (m), times its length, m x km."""
    reach = view_shape(records, z, line, wanted)
    if reach.inside and reach.distance >= wanted:
        return 0.0
    samples = int(min(MAX_SAMPLES, 2.0 + line.run / OUTSIDE_PITCH))
    total = 0.0
    for k in range(samples):
        along = line.run * k / (samples - 1)
        east, north = line.east + along * line.course_east, line.north + along * line.course_north
        total += max(0.0, wanted + edge_distance(records, z, east, north))
    spacing = max(line.run, MIN_CHARGED_LENGTH) / samples
    # Between the samples the line may be nearer to the outline.
    nearest = max(1e-9, wanted - reach.distance) if total == 0.0 else 0.0
    return (total * spacing + nearest * MIN_CHARGED_LENGTH) / 1000.0


@inlined
def altitude_band(up: float, to_up: float, below: float, above: float) -> AltitudeBand:
    """Return the vertical range of a straight line over unknown ground; below, above: tracking error, m."""
    lowest, highest = min(up, to_up) - below, max(up, to_up) + above
    return AltitudeBand(lowest, highest, -UNKNOWN, UNKNOWN)


@inner
def _sampled_altitude_band(
    heights: Heights,
    to_pixel: PolyMapRecord,
    pitch: float,
    a: Floats,
    b: Floats,
    first: float,
    last: float,
    below: float,
    above: float,
) -> AltitudeBand:
    """Return the vertical range of a-b between two fractions of its length, with sampled heights above ground."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    plain = altitude_band(a[2] + first * dz, a[2] + last * dz, below, above)
    column, row = polymap(to_pixel, a[0] + first * dx, a[1] + first * dy)
    to_column, to_row = polymap(to_pixel, a[0] + last * dx, a[1] + last * dy)
    samples = 2 + int((last - first) * math.sqrt(dx * dx + dy * dy) / pitch)
    lowest, highest = math.inf, -math.inf
    for k in range(samples):
        share = k / (samples - 1)
        ground = pixel_height(heights, column + share * (to_column - column), row + share * (to_row - row))
        if math.isnan(ground):
            return plain
        over = a[2] + (first + share * (last - first)) * dz - ground
        lowest, highest = min(lowest, over - below), max(highest, over + above)
    return AltitudeBand(plain.lowest, plain.highest, lowest, highest)


@inlined
def vertical_distance(zone: Record, band: AltitudeBand) -> float:
    """Return the distance of a vertical range below a zone's floor or above its ceiling, m; negative between them.

    The distance is the smallest over the range for an exclusion, and the largest for an inclusion.
    """
    under_low, under_high = band.lowest, band.highest
    if zone.floor_above_ground:
        under_low, under_high = band.lowest_above_ground, band.highest_above_ground
    over_low, over_high = band.lowest, band.highest
    if zone.ceiling_above_ground:
        over_low, over_high = band.lowest_above_ground, band.highest_above_ground
    far: float = max(zone.floor - under_high, over_low - zone.ceiling)
    if not zone.exclusion:
        far = max(zone.floor - under_low, over_high - zone.ceiling)
    return far


# --- Margins to zones, for the certificate ---

# Length of pieces near a zone, m: short enough for the heights to apply to the positions.
CUT = 25.0
# Margin of a piece of a path. nearest: smallest distance outside an exclusion or inside an inclusion, horizontal or
# vertical, m; negative if a zone is violated. satisfied: True if every zone's margin is satisfied. zone: the nearest
# zone, with preference for a violated margin; -1 without a zone.
ZONE_MARGIN = np.dtype([("nearest", np.float64), ("satisfied", np.bool_), ("zone", np.int64)])


@inner
def measure_zone_margin(
    zones: ZonesWithMargins,
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    lateral: Floats,
    below: float,
    above: float,
    margin: Record,
) -> None:
    """Fill the `ZONE_MARGIN` record of the piece a-b.

    depths: negated heights of the ground. lateral: (2,) lateral tracking error at a and b; below, above: vertical
    tracking error, m.
    """
    margin.nearest, margin.satisfied, margin.zone = math.inf, True, -1
    records, widest = zones.records, max(lateral[0], lateral[1])
    west, east = min(a[0], b[0]) - widest, max(a[0], b[0]) + widest
    south, north = min(a[1], b[1]) - widest, max(a[1], b[1]) + widest
    run = math.hypot(b[0] - a[0], b[1] - a[1])
    one, two, wide = a.copy(), b.copy(), lateral.copy()
    for z in range(zones.required.shape[0]):
        need, zone = zones.required[z], records.zones[z]
        wanted = max(need.horizontal, need.vertical)
        far = max(wanted, min(margin.nearest, 1e9))
        if zone.exclusion and box_distance(records, z, west, east, south, north) >= far:
            continue
        grounded = zone.floor_above_ground or zone.ceiling_above_ground
        band = altitude_band(a[2], b[2], below, above)
        if grounded:
            band = _exact_altitude_band(heights, depths, to_pixel, a, b, lateral, below, above)
        away, over = _horizontal_distance(records, z, a, b, far + widest) - widest, vertical_distance(zone, band)
        if _distance_to_violation(zone, away, over) >= far:
            continue
        pieces = max(1, math.ceil(run / CUT))
        for k in range(pieces):
            for axis in range(3):
                one[axis] = a[axis] + (b[axis] - a[axis]) * k / pieces
                two[axis] = a[axis] + (b[axis] - a[axis]) * (k + 1) / pieces
            for end in range(2):
                wide[end] = lateral[0] + (lateral[1] - lateral[0]) * (k + end) / pieces
            band = altitude_band(one[2], two[2], below, above)
            if grounded:
                band = _exact_altitude_band(heights, depths, to_pixel, one, two, wide, below, above)
            off = max(wide[0], wide[1])
            away, over = _horizontal_distance(records, z, one, two, far + off) - off, vertical_distance(zone, band)
            _update_margin(zone, need, z, away, over, margin)


@inner
def _update_margin(zone: Record, need: Record, z: int, away: float, over: float, margin: Record) -> None:
    """Update the record with the distances of a piece from a zone."""
    enough = away >= need.horizontal or over >= need.vertical
    if not zone.exclusion:
        enough = away >= need.horizontal and -over >= need.vertical
    here = _distance_to_violation(zone, away, over)
    # A zone whose margin is violated takes precedence over a nearer one.
    if margin.satisfied != enough:
        if not enough:
            margin.zone = z
    elif here < margin.nearest or margin.zone < 0:
        margin.zone = z
    margin.satisfied = margin.satisfied and enough
    margin.nearest = min(margin.nearest, here)


@inner
def _distance_to_violation(zone: Record, away: float, over: float) -> float:
    """Return the distance from violating a zone, given the horizontal and vertical distances, m."""
    return max(away, over) if zone.exclusion else min(away, -over)


@inner
def _horizontal_distance(records: ZoneRecords, z: int, a: Floats, b: Floats, within: float) -> float:
    """Return the smallest horizontal distance of a-b outside an exclusion or inside an inclusion, m; else negative.

    Distances above `within` may be inf.
    """
    line = segment_between(a[0], a[1], b[0], b[1])
    reach = view_shape(records, z, line, within)
    if records.zones[z].exclusion:
        if reach.inside or reach.distance == 0.0:
            return -max(0.0, min(reach.left, -reach.right))
        return reach.distance
    if reach.inside and reach.distance > 0.0:
        return reach.distance
    return -max(0.0, edge_distance(records, z, a[0], a[1]), edge_distance(records, z, b[0], b[1]))


@inner
def _exact_altitude_band(
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    lateral: Floats,
    below: float,
    above: float,
) -> AltitudeBand:
    """Return the vertical range along a-b, also above the ground on a-b and within `lateral` (2,) m to both sides."""
    plain = altitude_band(a[2], b[2], below, above)
    run = max(1e-9, math.hypot(b[0] - a[0], b[1] - a[1]))
    ux, uy = (b[0] - a[0]) / run, (b[1] - a[1]) / run
    one, two = a.copy(), b.copy()
    lowest, highest = math.inf, -math.inf
    for side in (0.0, -1.0, 1.0):
        for end, at, off in ((one, a, lateral[0]), (two, b, lateral[1])):
            end[0], end[1], end[2] = at[0] + side * off * uy, at[1] - side * off * ux, at[2]
        clearance, _ = segment_clearance(heights, to_pixel, one, two)
        one[2], two[2] = -a[2], -b[2]
        mirrored, _ = segment_clearance(depths, to_pixel, one, two)
        if math.isnan(clearance) or math.isnan(mirrored):
            return plain
        lowest, highest = min(lowest, clearance - below), max(highest, above - mirrored)
    return AltitudeBand(plain.lowest, plain.highest, lowest, highest)
