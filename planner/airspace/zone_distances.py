"""Penetration of zones by legs, for the search, and margins of path pieces to zones, for the certificate.

A search charges each leg for the depth of its penetration times the length of it, computed from a zone's extent across
and along the leg; for levels above ground the terrain is sampled. A certificate cuts pieces near a zone short enough
for heights and positions to belong together, and measures their distances exactly for straight edges and circles.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.airspace.zone_limits import KeptZones, MapSegment, first_near, line_between, reach_of
from world.airspace.zone_kernels import ZoneRecords, box_distance, edge_distance
from world.frames import PolyMapRecord, polymap
from world.kernels import Record, compiled, inlined
from world.terrain import pixel_height, segment_clearance

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]


# --- Penetration of zones, for the search ---

# The charge is 0 only if the leg violates no margin. An exclusion counts along the full part of the leg that is abreast
# of its shape, so that a leg through a concave part of the outline may be charged although it stays outside.

# Spacing of samples on a leg that leaves an inclusion (m), and their maximum number.
OUTSIDE_PITCH, MOST_PLACES = 100.0, 20
# Shortest length that is charged, m.
LEAST_STRETCH = 1.0
# Bound on the height above unknown ground, m.
UNKNOWN = 9000.0


class Stretch(NamedTuple):
    """Range of heights of a part of a path: above mean sea level, and above the ground below it, m."""

    lowest: float
    highest: float
    lowest_above_ground: float
    highest_above_ground: float


@compiled
def zone_excess(
    zones: KeptZones,
    heights: Heights,
    to_pixel: PolyMapRecord,
    pitch: float,
    a: Floats,
    b: Floats,
    beside: float,
    below: float,
    above: float,
) -> float:  # pragma: no cover - compiled
    """Depth of the leg a-b in zones enlarged by their margins, integrated over its length: m x km.

    pitch: of terrain samples (m), for levels above ground. beside, below, above: tracking error, m.
    """
    line = line_between(a[0], a[1], b[0], b[1])
    total, kept, records = 0.0, zones.kept, zones.records
    for z in range(zones.inclusions):
        wanted = kept[z].beside + beside
        total += _aside_excess(records, z, line, wanted)
        zone = records.zones[z]
        stretch = stretch_of(a[2], b[2], below, above)
        if zone.floor_above_ground or zone.ceiling_above_ground:
            stretch = _sampled_stretch(heights, to_pixel, pitch, a, b, 0.0, 1.0, below, above)
        over = beyond(zone, stretch) + kept[z].beyond
        total += max(0.0, over) * max(line.run, LEAST_STRETCH) / 1000.0
    most = zones.beside + beside
    west, east = min(a[0], b[0]) - most, max(a[0], b[0]) + most
    south, north = min(a[1], b[1]) - most, max(a[1], b[1]) + most
    for z in range(first_near(zones, west), kept.shape[0]):
        zone = records.zones[z]
        if zone.west > east:
            break
        if zone.east < west or zone.south > north or zone.north < south:
            continue
        depth, first, last = inside_depth(records, z, line, kept[z].beside + beside)
        if depth <= 0.0:
            continue
        rise = b[2] - a[2]
        stretch = stretch_of(a[2] + first * rise, a[2] + last * rise, below, above)
        if zone.floor_above_ground or zone.ceiling_above_ground:
            stretch = _sampled_stretch(heights, to_pixel, pitch, a, b, first, last, below, above)
        over = kept[z].beyond - beyond(zone, stretch)
        total += max(0.0, min(depth, over)) * max((last - first) * line.run, LEAST_STRETCH) / 1000.0
    return total


@compiled
def inside_depth(
    records: ZoneRecords, z: int, line: MapSegment, wanted: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Lateral shift that brings a line `wanted` m away from exclusion z on the map, and the line's fractions abreast.

    0 m if the line is that far away.
    """
    reach = reach_of(records, z, line, wanted)
    if not reach.inside and reach.distance >= wanted:
        return 0.0, 0.0, 0.0
    if reach.inside or reach.distance == 0.0:
        depth = wanted + max(0.0, min(reach.left, -reach.right))
    else:
        depth = wanted - reach.distance
    per_metre = 1.0 / max(line.run, 1e-9)
    first, last = (reach.first - wanted) * per_metre, (reach.last + wanted) * per_metre
    return max(depth, 1e-9), min(1.0, max(0.0, first)), min(1.0, max(0.0, last))


@compiled
def _aside_excess(
    records: ZoneRecords, z: int, line: MapSegment, wanted: float
) -> float:  # pragma: no cover - compiled
    """Shortfall of a line's distance inside inclusion z from `wanted` (m), integrated over its length: m x km."""
    reach = reach_of(records, z, line, wanted)
    if reach.inside and reach.distance >= wanted:
        return 0.0
    places = int(min(MOST_PLACES, 2.0 + line.run / OUTSIDE_PITCH))
    total = 0.0
    for k in range(places):
        along = line.run * k / (places - 1)
        east, north = line.east + along * line.course_east, line.north + along * line.course_north
        total += max(0.0, wanted + edge_distance(records, z, east, north))
    stretch = max(line.run, LEAST_STRETCH) / places
    # Between the samples the line may be nearer to the outline.
    nearest = max(1e-9, wanted - reach.distance) if total == 0.0 else 0.0
    return (total * stretch + nearest * LEAST_STRETCH) / 1000.0


@inlined
def stretch_of(up: float, to_up: float, below: float, above: float) -> Stretch:  # pragma: no cover - compiled
    """Range of heights of a straight line with unknown ground; below, above: tracking error, m."""
    lowest, highest = min(up, to_up) - below, max(up, to_up) + above
    return Stretch(lowest, highest, -UNKNOWN, UNKNOWN)


@compiled
def _sampled_stretch(
    heights: Heights,
    to_pixel: PolyMapRecord,
    pitch: float,
    a: Floats,
    b: Floats,
    first: float,
    last: float,
    below: float,
    above: float,
) -> Stretch:  # pragma: no cover - compiled
    """Range of heights of a-b between two fractions of it, above ground by samples."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    plain = stretch_of(a[2] + first * dz, a[2] + last * dz, below, above)
    column, row = polymap(to_pixel, a[0] + first * dx, a[1] + first * dy)
    to_column, to_row = polymap(to_pixel, a[0] + last * dx, a[1] + last * dy)
    places = 2 + int((last - first) * math.sqrt(dx * dx + dy * dy) / pitch)
    lowest, highest = math.inf, -math.inf
    for k in range(places):
        share = k / (places - 1)
        ground = pixel_height(heights, column + share * (to_column - column), row + share * (to_row - row))
        if math.isnan(ground):
            return plain
        over = a[2] + (first + share * (last - first)) * dz - ground
        lowest, highest = min(lowest, over - below), max(highest, over + above)
    return Stretch(plain.lowest, plain.highest, lowest, highest)


@inlined
def beyond(zone: Record, stretch: Stretch) -> float:  # pragma: no cover - compiled
    """Distance of heights below a zone's floor or above its ceiling, m; negative between them.

    For an exclusion the smallest over the range of heights, for an inclusion the largest.
    """
    under_low, under_high = stretch.lowest, stretch.highest
    if zone.floor_above_ground:
        under_low, under_high = stretch.lowest_above_ground, stretch.highest_above_ground
    over_low, over_high = stretch.lowest, stretch.highest
    if zone.ceiling_above_ground:
        over_low, over_high = stretch.lowest_above_ground, stretch.highest_above_ground
    far: float = max(zone.floor - under_high, over_low - zone.ceiling)
    if not zone.exclusion:
        far = max(zone.floor - under_low, over_high - zone.ceiling)
    return far


# --- Margins to zones, for the certificate ---

# Pieces near a zone are cut to this length (m), so that heights and positions belong together.
CUT = 25.0
# Margin of a piece of a path. nearest: smallest distance outside an exclusion or inside an inclusion, horizontal or
# vertical, m; negative where a zone is violated. kept: whether every zone's margin is satisfied. zone: the nearest
# zone, preferring those whose margin is violated; -1 for none.
ZONE_ROOM = np.dtype([("nearest", np.float64), ("kept", np.bool_), ("zone", np.int64)])


@compiled
def measure_zone_room(
    zones: KeptZones,
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    beside: Floats,
    below: float,
    above: float,
    room: Record,
) -> None:  # pragma: no cover - compiled
    """Fill the `ZONE_ROOM` record of the piece a-b.

    depths: negated heights of the ground. beside: (2,) lateral tracking error at a and b; below, above: vertical
    tracking error, m.
    """
    room.nearest, room.kept, room.zone = math.inf, True, -1
    records, most = zones.records, max(beside[0], beside[1])
    west, east = min(a[0], b[0]) - most, max(a[0], b[0]) + most
    south, north = min(a[1], b[1]) - most, max(a[1], b[1]) + most
    run = math.hypot(b[0] - a[0], b[1] - a[1])
    one, two, wide = a.copy(), b.copy(), beside.copy()
    for z in range(zones.kept.shape[0]):
        keeps, zone = zones.kept[z], records.zones[z]
        wanted = max(keeps.beside, keeps.beyond)
        far = max(wanted, min(room.nearest, 1e9))
        if zone.exclusion and box_distance(records, z, west, east, south, north) >= far:
            continue
        grounded = zone.floor_above_ground or zone.ceiling_above_ground
        stretch = stretch_of(a[2], b[2], below, above)
        if grounded:
            stretch = _exact_stretch(heights, depths, to_pixel, a, b, beside, below, above)
        away, over = _away(records, z, a, b, far + most) - most, beyond(zone, stretch)
        if _room(zone, away, over) >= far:
            continue
        pieces = max(1, math.ceil(run / CUT))
        for k in range(pieces):
            for axis in range(3):
                one[axis] = a[axis] + (b[axis] - a[axis]) * k / pieces
                two[axis] = a[axis] + (b[axis] - a[axis]) * (k + 1) / pieces
            for end in range(2):
                wide[end] = beside[0] + (beside[1] - beside[0]) * (k + end) / pieces
            stretch = stretch_of(one[2], two[2], below, above)
            if grounded:
                stretch = _exact_stretch(heights, depths, to_pixel, one, two, wide, below, above)
            off = max(wide[0], wide[1])
            away, over = _away(records, z, one, two, far + off) - off, beyond(zone, stretch)
            _note(zone, keeps, z, away, over, room)


@compiled
def _note(
    zone: Record, keeps: Record, z: int, away: float, over: float, room: Record
) -> None:  # pragma: no cover - compiled
    """Update the record with the distances of a piece from a zone."""
    enough = away >= keeps.beside or over >= keeps.beyond
    if not zone.exclusion:
        enough = away >= keeps.beside and -over >= keeps.beyond
    here = _room(zone, away, over)
    # A zone whose margin is violated takes precedence over a nearer one.
    if room.kept != enough:
        if not enough:
            room.zone = z
    elif here < room.nearest or room.zone < 0:
        room.zone = z
    room.kept = room.kept and enough
    room.nearest = min(room.nearest, here)


@compiled
def _room(zone: Record, away: float, over: float) -> float:  # pragma: no cover - compiled
    """Distance from violating a zone, given the horizontal and vertical distances, m."""
    return max(away, over) if zone.exclusion else min(away, -over)


@compiled
def _away(records: ZoneRecords, z: int, a: Floats, b: Floats, within: float) -> float:  # pragma: no cover - compiled
    """Smallest horizontal distance of the line a-b outside an exclusion or inside an inclusion, m; else negative.

    Distances above `within` may be inf.
    """
    line = line_between(a[0], a[1], b[0], b[1])
    reach = reach_of(records, z, line, within)
    if records.zones[z].exclusion:
        if reach.inside or reach.distance == 0.0:
            return -max(0.0, min(reach.left, -reach.right))
        return reach.distance
    if reach.inside and reach.distance > 0.0:
        return reach.distance
    return -max(0.0, edge_distance(records, z, a[0], a[1]), edge_distance(records, z, b[0], b[1]))


@compiled
def _exact_stretch(
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    beside: Floats,
    below: float,
    above: float,
) -> Stretch:  # pragma: no cover - compiled
    """Range of heights along a-b, and above the ground below it and `beside` (2,) m to both sides."""
    plain = stretch_of(a[2], b[2], below, above)
    run = max(1e-9, math.hypot(b[0] - a[0], b[1] - a[1]))
    ux, uy = (b[0] - a[0]) / run, (b[1] - a[1]) / run
    one, two = a.copy(), b.copy()
    lowest, highest = math.inf, -math.inf
    for side in (0.0, -1.0, 1.0):
        for end, at, off in ((one, a, beside[0]), (two, b, beside[1])):
            end[0], end[1], end[2] = at[0] + side * off * uy, at[1] - side * off * ux, at[2]
        least, _ = segment_clearance(heights, to_pixel, one, two)
        one[2], two[2] = -a[2], -b[2]
        most, _ = segment_clearance(depths, to_pixel, one, two)
        if math.isnan(least) or math.isnan(most):
            return plain
        lowest, highest = min(lowest, least - below), max(highest, above - most)
    return Stretch(plain.lowest, plain.highest, lowest, highest)
