"""How deep a leg is in zones, and how long: what a search is charged for it.

What is charged is 0 only where the leg keeps out of them.  An exclusion counts along the whole part of the leg that is
level with its shape, so that a leg may be charged that passes a hollow of it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.airspace.kept_zones import KeptZones, first_near
from planner.airspace.zone_reach import MapSegment, line_between, reach_of
from world.airspace.zone_kernels import ZoneRecords, edge_distance
from world.frames import PolyMapRecord, polymap
from world.kernels import Record, compiled, inlined
from world.terrain import pixel_height

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# A leg that leaves an inclusion is looked at this often (m), and this many times at most.
OUTSIDE_PITCH, MOST_PLACES = 100.0, 20
# Shortest stretch that counts, m: depth is charged for at least that.
LEAST_STRETCH = 1.0
# Where the ground is not known, heights are taken to be within this of it, m.
UNKNOWN = 9000.0


class Stretch(NamedTuple):
    """Lowest and highest of a part of a path, above mean sea level and above the ground below it, m."""

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
    """Depth in zones along the leg a-b, with their margins, summed over its length: m x km.

    pitch: between samples of the ground (m), for levels above ground.  beside, below, above: how far from the leg a
    flight may be, m.
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
    """How far a line must move sideways to be `wanted` m from exclusion z on the map, and the shares of it about that.

    0 m where it is that far from it.
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
    """How far a line is from being `wanted` m inside inclusion z on the map, summed over its length: m x km."""
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
    # Between the places it may be less far inside than at them.
    nearest = max(1e-9, wanted - reach.distance) if total == 0.0 else 0.0
    return (total * stretch + nearest * LEAST_STRETCH) / 1000.0


@inlined
def stretch_of(up: float, to_up: float, below: float, above: float) -> Stretch:  # pragma: no cover - compiled
    """The heights of a level or slanting line of which the ground is not asked; below, above: what is added to them."""
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
    """The heights of a-b between two shares of it, above ground by samples."""
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
    """How far heights are below a zone's floor or above its ceiling, m; negative where they are not.

    Of an exclusion how far all of them are, of an inclusion how far the furthest is.
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
