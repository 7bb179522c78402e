"""Find where a path violates airspace zones, compiled: depth, duration, entry and exit.

Along a path, the depth of a violation changes no faster than the position or the height above ground.  A path is
therefore bisected until each part is certain to be on one side of the limit, and until no part can contain a point
deeper than the deepest known point.  Nothing between two samples is missed on straight lines, on arcs and over terrain.

shapely's distance and intersection take 170 times as long (1,000 zones, 36,000 rows: 7.7 s, here 0.05 s).  They give
only the depth at the rows (0.5 m off), and support neither arcs, heights above ground nor times.
"""

import math

import numpy as np

from logs.verdict.measures.path_moves import BLOCK_MOVES, move_blocks, move_point
from world.airspace.zone_kernels import ZoneRecords, box_distance, distance_to_edge, height_outside_band, nearest_edge
from world.arrays import Heights
from world.frames import POLYMAP, PolyMapRecord
from world.kernels import Record, Records, compiled, inlined, inner, read_only, record_dtype
from world.terrain import Terrain, ground_height

# ----------------------------------------------------------------------
# Parts of a move near a zone, compiled: bounds of the depth of a violation between the ends of a part.


# A part of a move.  first, last: fractions of the move at its ends.  east, north: position of its start, m.
# outline_distance, band_distance: distances of the start outside the zone's outline and altitude band, m.  edge: the
# zone's edge nearest to the start.  end_east to end_edge: the same for the part's end.
PART = record_dtype(
    "first",
    "last",
    "east",
    "north",
    "outline_distance",
    "band_distance",
    ("edge", np.int64),
    "end_east",
    "end_north",
    "end_outline_distance",
    "end_band_distance",
    ("end_edge", np.int64),
)


@inner
def distances_outside_zone(
    records: ZoneRecords, z: int, heights: Heights, to_pixel: PolyMapRecord, east: float, north: float, up: float
) -> tuple[float, float, int]:
    """Return how far a position is outside outline and altitude band of zone `z`, m, and the nearest edge.

    heights, to_pixel: terrain heights, m, and map from positions to their pixels.
    east, north, up: the position, m.
    A distance is negative inside.  The distance from a band above ground is NaN if the terrain there is unknown.
    """
    zone = records.zones[z]
    outline_distance, edge = nearest_edge(records, z, east, north)
    ground = 0.0
    if zone.floor_above_ground or zone.ceiling_above_ground:
        ground = ground_height(heights, to_pixel, east, north)
    return outline_distance, height_outside_band(zone, up, ground), edge


@inlined
def violation_depth(exclusion: bool, outline_distance: float, band_distance: float) -> float:
    """Return how deep a position violates a zone, m; negative if it complies.

    The depth is the shortest distance to the zone's limit, horizontally or vertically.  It is NaN if it depends on
    unknown ground.

    exclusion: True for an exclusion zone, False for an inclusion zone.
    outline_distance, band_distance: distances from `distances_outside_zone`, m.
    """
    if band_distance != band_distance:
        # A position outside the zone's outline is outside the zone whatever the height of the ground.
        if outline_distance <= 0.0:
            return math.nan
        band_distance = outline_distance
    distance = max(outline_distance, band_distance)
    return -distance if exclusion else distance


@inlined
def copy_move_part(source: Record, target: Record) -> None:
    """Copy all fields of one part of a move (`PART`) into another record."""
    target.first, target.last = source.first, source.last
    target.east, target.north, target.outline_distance, target.band_distance = (
        source.east,
        source.north,
        source.outline_distance,
        source.band_distance,
    )
    target.end_east, target.end_north, target.end_outline_distance = (
        source.end_east,
        source.end_north,
        source.end_outline_distance,
    )
    target.end_band_distance, target.edge, target.end_edge = source.end_band_distance, source.edge, source.end_edge


@inlined
def depth_bounds(
    exclusion: bool, part: Record, length: float, height_change: float, max_distance: float
) -> tuple[float, float]:
    """Return lower and upper bounds of the depth of a violation along one part of a move, m.

    The depth is the distance into an exclusion zone, or out of an inclusion zone; it is negative for a compliant point.
    A distance changes by at most the length that is flown.  Along the part it is therefore at most half of (sum of the
    distances at both ends + length), and at least half of (this sum - length).

    length: length of the part, m.
    height_change: largest change of the part's height relative to the zone's altitude band, m.
    max_distance: upper bound of the depth relative to the zone's outline alone, m.
    """
    sign = -1.0 if exclusion else 1.0
    outline_sum = sign * (part.outline_distance + part.end_outline_distance)
    band_sum = sign * (part.band_distance + part.end_band_distance)
    outline_min = 0.5 * (outline_sum - length)
    outline_max = min(max_distance, 0.5 * (outline_sum + length))
    if band_sum != band_sum:
        # If the ground is unknown at one end, only the outline can show that the part is not inside an exclusion.
        return (-math.inf, outline_max) if exclusion else (outline_min, math.inf)
    band_min, band_max = 0.5 * (band_sum - height_change), 0.5 * (band_sum + height_change)
    if exclusion:
        return min(outline_min, band_min), min(outline_max, band_max)
    return max(outline_min, band_min), max(outline_max, band_max)


@inner
def max_violation_bound(records: ZoneRecords, z: int, move: Record, part: Record, length: float) -> float:
    """Return an upper bound on how deep a part of a move violates the outline of zone `z`, m.

    The bound is inf if the part turns by more than a radian.  It uses the edges nearest to the part's ends: on a
    straight line, the distance from an edge, or from the centre of a circle, is largest at an end.  An arc of less than
    a radian deviates from its chord by at most curvature x length^2 / 8.

    length: length of the part, m.
    """
    zone = records.zones[z]
    chord_deviation: float = 0.125 * abs(move.curvature) * length * length
    if abs(move.curvature) * length > 1.0:
        return math.inf
    if not zone.round:
        min_distance = math.inf
        for edge_index in (part.edge, part.end_edge):
            edge = records.edges[edge_index]
            start_distance = distance_to_edge(edge, part.east, part.north)
            end_distance = distance_to_edge(edge, part.end_east, part.end_north)
            min_distance = min(min_distance, max(start_distance, end_distance))
        return min_distance + chord_deviation
    if not zone.exclusion:
        return float(max(part.outline_distance, part.end_outline_distance) + chord_deviation)
    step_e, step_n = part.end_east - part.east, part.end_north - part.north
    offset_e, offset_n = zone.centre_east - part.east, zone.centre_north - part.north
    length_square = step_e * step_e + step_n * step_n
    fraction = (
        min(1.0, max(0.0, (offset_e * step_e + offset_n * step_n) / length_square)) if length_square > 0.0 else 0.0
    )
    offset_e -= fraction * step_e
    offset_n -= fraction * step_n
    return float(zone.radius - math.sqrt(offset_e * offset_e + offset_n * offset_n) + chord_deviation)


# Visit of a path to one zone.  depth: largest depth of a violation, m, negative if the path complies.  It is exact if
# it is positive, and for the zone that is nearest to being violated; for all others it is an upper bound.  at_time,
# at_east, at_north, at_up, at_leg: time, position and leg of the largest depth.  entries: number of violations.
# violation_time: total duration of the violations, s.  entry and exit: start of the first violation, end of the last.
# unknown: True if a part of the path is above unknown ground and the zone has a limit above ground.
VISIT = record_dtype(
    "depth",
    "at_time",
    "at_east",
    "at_north",
    "at_up",
    ("at_leg", np.int64),
    ("entries", np.int64),
    "violation_time",
    "entry_time",
    "entry_east",
    "entry_north",
    "entry_up",
    ("entry_leg", np.int64),
    "exit_time",
    "exit_east",
    "exit_north",
    "exit_up",
    ("exit_leg", np.int64),
    ("unknown", np.bool_),
)
# Numerical precision of depths, m: half of the rounding of a waypoint, `logs.verdict.tolerances.ROUNDING_M`, which is
# the tolerance of the verdict.
DEPTH_PRECISION = 0.01
# Precision of the positions at which a path enters and leaves a zone, m.
EDGE_PRECISION = 1e-3
# Largest number of parts in memory.  Bisecting a path of 1,000 km down to `EDGE_PRECISION` takes 34; one more is needed
# for the whole move, and one to swap two parts.
_MAX_PARTS = 64
# Largest pause between two violations that are counted as one, s.
_MERGE_TIME_S = 1e-6


def path_zones(moves: Records, records: ZoneRecords, terrain: Terrain | None) -> Records:
    """Measure where and how deep a path violates each of z zones; return (z,) of dtype `VISIT`.

    moves: the path, (m,) of dtype `logs.verdict.measures.path_moves.MOVE`.
    terrain: None if unknown.
    """
    heights = read_only(np.full((2, 2), np.nan, dtype=np.float32))
    to_pixel = np.zeros(1, POLYMAP)[0]
    spacing = 1.0
    if terrain is not None:
        heights, to_pixel, spacing = terrain.heights, terrain.to_pixel.record, terrain.spacing
    # Arrays from compiled code are not numpy record arrays, whose fields are attributes.
    return _visit_zones(moves, records, heights, to_pixel, spacing).view(VISIT)


@compiled
def _visit_zones(
    moves: Records, records: ZoneRecords, heights: Heights, to_pixel: PolyMapRecord, spacing: float
) -> Records:
    """Return the visits of a path to all zones, (z,) of dtype `VISIT`; the nearest zone is visited first.

    For a zone that is certainly further away than the nearest zone, the depth is only an upper bound.

    moves: moves of the path, (m,) of dtype `MOVE`.
    heights, to_pixel, spacing: terrain heights, m, map from positions to their pixels, and distance between pixels, m.
    """
    count = records.zones.shape[0]
    visits = np.zeros(count, VISIT)
    above_ground = False
    for z in range(count):
        zone = records.zones[z]
        above_ground = above_ground or zone.floor_above_ground or zone.ceiling_above_ground
    blocks = move_blocks(moves, heights, to_pixel, spacing, above_ground)
    distances = np.zeros(count)
    for z in range(count):
        visits[z].depth = -math.inf
        if records.zones[z].exclusion:
            distances[z] = math.inf
            for b in range(blocks.shape[0]):
                block = blocks[b]
                distances[z] = min(
                    distances[z], box_distance(records, z, block.west, block.east, block.south, block.north)
                )
    parts = np.zeros(_MAX_PARTS, PART)
    known_depth = -math.inf
    # The depth for the nearest zone is a bound that shows that other zones are further away.
    for z in np.argsort(distances, kind="mergesort"):
        if -distances[z] < known_depth:
            visits[z].depth = -distances[z]
            continue
        _fill_visit(moves, blocks, records, z, heights, to_pixel, known_depth, parts, visits[z])
        known_depth = max(known_depth, min(0.0, visits[z].depth))
    return visits


@inner
def _fill_visit(
    moves: Records,
    blocks: Records,
    records: ZoneRecords,
    z: int,
    heights: Heights,
    to_pixel: PolyMapRecord,
    known_depth: float,
    parts: Records,
    visit: Record,
) -> None:
    """Fill `visit` with the visit of a path to zone `z`: greatest violation depth, entries and exits.

    blocks: bounding boxes of each `BLOCK_MOVES` moves, (b,) of dtype `BLOCK`.
    heights, to_pixel: terrain heights, m, and map from positions to their pixels.
    known_depth: depth below which the result need not be exact, m.
    parts: scratch records, which are overwritten.

    There are three rounds.  Round 0 checks only the ends of the moves.  Round 1 bisects moves to find the deepest
    point.  Round 2 finds the times of entry and exit, if the zone is violated.  Blocks that cannot be deeper than the
    depth found so far are skipped.
    """
    zone = records.zones[z]
    above_ground = zone.floor_above_ground or zone.ceiling_above_ground
    for round_number in range(3):
        for b in range(blocks.shape[0]):
            block = blocks[b]
            ground_slope = block.steepest if above_ground else 0.0
            half_width = 0.5 * (block.east - block.west)
            half_length = 0.5 * (block.north - block.south)
            half_diagonal = math.sqrt(half_width * half_width + half_length * half_length)
            half_height = 0.5 * (block.high - block.low)
            outline_distance, band_distance, _ = distances_outside_zone(
                records,
                z,
                heights,
                to_pixel,
                block.west + half_width,
                block.south + half_length,
                block.low + half_height,
            )
            max_depth = violation_depth(zone.exclusion, outline_distance, band_distance) + max(
                half_diagonal, half_height + ground_slope * half_diagonal
            )
            # The ground may be unknown near a center point with known ground, so such a block is not skipped.
            if max_depth <= (0.0 if round_number == 2 else max(known_depth, visit.depth)) and not (
                above_ground and outline_distance < half_diagonal
            ):
                continue
            first, last = b * BLOCK_MOVES, min(moves.shape[0], (b + 1) * BLOCK_MOVES)
            _add_block(
                moves[first:last], round_number, records, z, heights, to_pixel, ground_slope, known_depth, parts, visit
            )
        if round_number == 1 and not visit.depth > 0.0:
            break


@inner
def _add_block(
    moves: Records,
    round_number: int,
    records: ZoneRecords,
    z: int,
    heights: Heights,
    to_pixel: PolyMapRecord,
    ground_slope: float,
    known_depth: float,
    parts: Records,
    visit: Record,
) -> None:
    """Update the visit of a path to zone `z` with a block of consecutive moves.

    round_number: 0 updates the depth from the moves' ends; 1 and 2 bisect the moves (see `_fill_visit`).
    heights, to_pixel: terrain heights, m, and map from positions to their pixels.
    ground_slope: upper bound on the slope of the ground below the block, m per m.
    known_depth: depth below which the result need not be exact, m.
    parts: scratch records, which are overwritten.
    """
    part = parts[0]
    part.end_east, part.end_north, up = move_point(moves[0], 0.0)
    part.end_outline_distance, part.end_band_distance, part.end_edge = distances_outside_zone(
        records, z, heights, to_pixel, part.end_east, part.end_north, up
    )
    for k in range(moves.shape[0]):
        part.first, part.last = 0.0, 1.0
        part.east, part.north, part.outline_distance = part.end_east, part.end_north, part.end_outline_distance
        part.band_distance, part.edge = part.end_band_distance, part.end_edge
        part.end_east, part.end_north, up = move_point(moves[k], 1.0)
        part.end_outline_distance, part.end_band_distance, part.end_edge = distances_outside_zone(
            records, z, heights, to_pixel, part.end_east, part.end_north, up
        )
        if round_number == 0:
            _update_depth(moves[k], part, records.zones[z].exclusion, visit)
        else:
            _bisect_move(
                moves[k], round_number == 2, records, z, heights, to_pixel, ground_slope, known_depth, parts, visit
            )


@inner
def _bisect_move(
    move: Record,
    in_order: bool,
    records: ZoneRecords,
    z: int,
    heights: Heights,
    to_pixel: PolyMapRecord,
    ground_slope: float,
    known_depth: float,
    parts: Records,
    visit: Record,
) -> None:
    """Bisect a move until each part can be decided, and update a visit with the parts.

    in_order: True to bisect until each part is on one side of the limit, and add the parts in order of time; False to
        bisect until no part can be deeper than the known depth.
    parts: scratch records: the move, whose end must not change (the next move begins there), and a stack of its parts.
    """
    exclusion = records.zones[z].exclusion
    # Largest change of the height relative to the altitude band over the whole move.
    climb = max(abs(move.climb), abs(move.climb + 2.0 * move.bend)) + ground_slope * move.length
    copy_move_part(parts[0], parts[1])
    top = 1
    while top > 0:
        part = parts[top]
        fraction = part.last - part.first
        span, change = fraction * move.length, fraction * climb
        target_depth = 0.0 if in_order else max(visit.depth, known_depth) + DEPTH_PRECISION
        min_depth, max_depth = depth_bounds(exclusion, part, span, change, math.inf)
        is_certain = max_depth <= target_depth or (in_order and min_depth > 0.0) or max(span, change) <= EDGE_PRECISION
        if not is_certain:
            # Nothing can be decided if the ground is unknown at both ends.
            start_depth = violation_depth(exclusion, part.outline_distance, part.band_distance)
            end_depth = violation_depth(exclusion, part.end_outline_distance, part.end_band_distance)
            is_certain = start_depth != start_depth and end_depth != end_depth
        if not is_certain:
            # A closer bound with the nearest edges takes longer.
            max_distance = max_violation_bound(records, z, move, part, span)
            min_depth, max_depth = depth_bounds(exclusion, part, span, change, max_distance)
            is_certain = max_depth <= target_depth
        if is_certain:
            if in_order:
                _add_part(move, part, exclusion, visit)
            else:
                _update_depth(move, part, exclusion, visit)
            top -= 1
            continue
        earlier = parts[top + 1]
        copy_move_part(part, earlier)
        earlier.last = part.first = middle = 0.5 * (part.first + part.last)
        east, north, up = move_point(move, middle)
        outline_distance, band_distance, edge = distances_outside_zone(records, z, heights, to_pixel, east, north, up)
        part.east, part.north, part.outline_distance = east, north, outline_distance
        part.band_distance, part.edge = band_distance, edge
        earlier.end_east, earlier.end_north, earlier.end_outline_distance = east, north, outline_distance
        earlier.end_band_distance, earlier.end_edge = band_distance, edge
        if not in_order and violation_depth(
            exclusion, part.end_outline_distance, part.end_band_distance
        ) > violation_depth(exclusion, earlier.outline_distance, earlier.band_distance):
            # Put the half that may be deeper on top: its depth may make the other half irrelevant.
            copy_move_part(part, parts[_MAX_PARTS - 1])
            copy_move_part(earlier, part)
            copy_move_part(parts[_MAX_PARTS - 1], earlier)
        top += 1


@inner
def _update_depth(move: Record, part: Record, exclusion: bool, visit: Record) -> None:
    """Update the deepest point of a visit, and its flag for unknown ground, with the ends of a part."""
    for end in range(2):
        depth = violation_depth(exclusion, part.outline_distance, part.band_distance)
        if end:
            depth = violation_depth(exclusion, part.end_outline_distance, part.end_band_distance)
        if depth > visit.depth:
            fraction = part.last if end else part.first
            visit.depth, visit.at_time, visit.at_leg = depth, move.time + fraction * move.lasts, move.leg
            visit.at_east, visit.at_north, visit.at_up = move_point(move, fraction)
        visit.unknown = visit.unknown or depth != depth


@inner
def _add_part(move: Record, part: Record, exclusion: bool, visit: Record) -> None:
    """Add the violation in a part of a move to a visit.

    The part crosses the zone's limit at most once; the crossing is interpolated linearly between the depths at its
    ends.
    """
    start_depth = violation_depth(exclusion, part.outline_distance, part.band_distance)
    end_depth = violation_depth(exclusion, part.end_outline_distance, part.end_band_distance)
    if not (start_depth > 0.0 or end_depth > 0.0):
        return
    entry_fraction, exit_fraction = part.first, part.last
    if start_depth <= 0.0:
        entry_fraction += (exit_fraction - entry_fraction) * start_depth / (start_depth - end_depth)
    elif end_depth <= 0.0:
        exit_fraction = entry_fraction + (exit_fraction - entry_fraction) * start_depth / (start_depth - end_depth)
    entry_time = move.time + entry_fraction * move.lasts
    exit_time = move.time + exit_fraction * move.lasts
    visit.violation_time += exit_time - entry_time
    if visit.entries == 0 or entry_time > visit.exit_time + _MERGE_TIME_S:
        visit.entries += 1
        if visit.entries == 1:
            visit.entry_time, visit.entry_leg = entry_time, move.leg
            visit.entry_east, visit.entry_north, visit.entry_up = move_point(move, entry_fraction)
    visit.exit_time, visit.exit_leg = exit_time, move.leg
    visit.exit_east, visit.exit_north, visit.exit_up = move_point(move, exit_fraction)
