"""How a path meets zones of airspace, compiled: how deep, for how long, where it goes in and out.

How far beyond a zone's limit a place is changes no faster along a path than the path moves, or its height above the
ground does.  A way is cut in halves until that says of each part on which side it is, and that no part holds a deeper
place than is known.  Nothing between two looks is missed, on arcs and over terrain as on straight lines.
"""

import math

import numpy as np
from numpy.typing import NDArray

from logs.verdict.measures.path_moves import move_point
from logs.verdict.tolerances import FENCE_DEPTH, FENCE_EDGE
from world.airspace.zone_kernels import ZoneRecords, box_distance, edge_distance, outside_band
from world.frames import POLYMAP, PolyMapRecord, polymap
from world.kernels import Record, Records, compiled, record_dtype
from world.terrain import Terrain, ground_height

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# How a path meets one zone.  depth: m beyond the zone's limit at the most, negative where it stays on its right side;
# right where it is above 0, and for the zone that comes nearest to being violated; of every other one no less than its
# true value.  at_time, at_east, at_north, at_up, at_leg: where that is.  entries: how often it goes wrong.  beyond: s
# in all.  entry and exit: the first and the last of it.  unknown: whether some of it is above unknown ground, where the
# zone counts from the ground.
VISIT = record_dtype(
    "depth",
    "at_time",
    "at_east",
    "at_north",
    "at_up",
    ("at_leg", np.int64),
    ("entries", np.int64),
    "beyond",
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
# Consecutive moves: their box on the map, their least and greatest height, and the steepest ground below them, m per m.
BLOCK = record_dtype("west", "east", "south", "north", "low", "high", "steepest")
# A part of a move: its first and last share, and how far beyond the limit each is.
PART = record_dtype("first", "last", "before", "after")
# Moves of a block.
_BLOCK = 64
# Halves of halves: a way of 1,000 km comes down to `FENCE_EDGE` in 34.
_MOST_HALVES = 64
# s.  Two stays that are no further apart are one.
_TOUCH = 1e-6


def path_zones(moves: Records, records: ZoneRecords, terrain: Terrain | None) -> Records:
    """How a path meets each of z zones: (z,) of `VISIT`.

    moves: (m,) of `logs.verdict.measures.path_moves.MOVE`.  terrain: None where none is known.
    """
    heights, to_pixel, pitch = np.full((2, 2), np.nan, dtype=np.float32), np.zeros(1, POLYMAP)[0], 1.0
    if terrain is not None:
        heights, to_pixel, pitch = terrain.heights, terrain.to_pixel.record, terrain.spacing
    # What compiled code makes has its fields, and not numpy's records that have them as attributes.
    return _path_zones(moves, records, heights, to_pixel, pitch).view(VISIT)


@compiled
def _path_zones(
    moves: Records, records: ZoneRecords, heights: Heights, to_pixel: PolyMapRecord, pitch: float
) -> Records:  # pragma: no cover - compiled
    count = records.zones.shape[0]
    visits = np.zeros(count, VISIT)
    above_ground = False
    for z in range(count):
        zone = records.zones[z]
        above_ground = above_ground or zone.floor_above_ground or zone.ceiling_above_ground
    blocks = _blocks(moves, heights, to_pixel, pitch, above_ground)
    apart = np.zeros(count)
    for z in range(count):
        visits[z].depth = -math.inf
        if records.zones[z].exclusion:
            apart[z] = math.inf
            for b in range(blocks.shape[0]):
                block = blocks[b]
                apart[z] = min(apart[z], box_distance(records, z, block.west, block.east, block.south, block.north))
    parts = np.zeros(_MOST_HALVES, PART)
    known = -math.inf
    # The nearest first: what is known of them says of the others that they are further away.
    for z in np.argsort(apart, kind="mergesort"):
        if -apart[z] < known:
            visits[z].depth = -apart[z]
            continue
        _visit(moves, blocks, records, z, heights, to_pixel, known, parts, visits[z])
        known = max(known, min(0.0, visits[z].depth))
    return visits


@compiled
def _blocks(
    moves: Records, heights: Heights, to_pixel: PolyMapRecord, pitch: float, above_ground: bool
) -> Records:  # pragma: no cover - compiled
    """(b,) of `BLOCK`; the ground is looked at where a zone counts from it."""
    blocks = np.zeros((moves.shape[0] + _BLOCK - 1) // _BLOCK, BLOCK)
    for b in range(blocks.shape[0]):
        block = blocks[b]
        block.west, block.south, block.low = math.inf, math.inf, math.inf
        block.east, block.north, block.high = -math.inf, -math.inf, -math.inf
        for k in range(b * _BLOCK, min(moves.shape[0], (b + 1) * _BLOCK)):
            move = moves[k]
            east, north, up = move_point(move, 0.5)
            # No point of a move is further from its middle than half its length.
            half = 0.5 * move.length
            lift = 0.5 * abs(move.climb) + 1.25 * abs(move.bend)
            block.west, block.east = min(block.west, east - half), max(block.east, east + half)
            block.south, block.north = min(block.south, north - half), max(block.north, north + half)
            block.low, block.high = min(block.low, up - lift), max(block.high, up + lift)
        if above_ground:
            block.steepest = _steepest(block, heights, to_pixel, pitch)
    return blocks


@compiled
def _steepest(
    block: Record, heights: Heights, to_pixel: PolyMapRecord, pitch: float
) -> float:  # pragma: no cover - compiled
    """Steepest slope that the bilinear ground can have under a block, m per m; NaN adds nothing."""
    rows, cols = heights.shape
    west, south = polymap(to_pixel, block.west, block.south)
    east, north = polymap(to_pixel, block.east, block.north)
    # The map's axes may be turned against the raster's: both diagonals' ends.
    left, upper = polymap(to_pixel, block.west, block.north)
    right, lower = polymap(to_pixel, block.east, block.south)
    first_col, last_col = min(west, east, left, right), max(west, east, left, right)
    first_row, last_row = min(south, north, upper, lower), max(south, north, upper, lower)
    if not (last_col >= 0.0 and first_col <= cols - 1 and last_row >= 0.0 and first_row <= rows - 1):
        return 0.0
    steepest = 0.0
    for i in range(max(0, int(first_row) - 1), min(rows - 1, int(last_row) + 2)):
        for j in range(max(0, int(first_col) - 1), min(cols - 1, int(last_col) + 2)):
            over = max(abs(heights[i, j + 1] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i + 1, j]))
            down = max(abs(heights[i + 1, j] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i, j + 1]))
            steep = over * over + down * down
            # NaN compares as less.
            if steep > steepest:
                steepest = steep
    # A hair more, for what single precision rounds.
    return math.sqrt(steepest) / pitch * (1.0 + 1e-6)


@compiled
def violation(
    records: ZoneRecords, z: int, heights: Heights, to_pixel: PolyMapRecord, east: float, north: float, up: float
) -> float:  # pragma: no cover - compiled
    """How far beyond zone z's limit a place is, m: the least way, level or straight up or down, that ends it.

    Negative where it is on the right side: the way, level or upright, that it has at least.  NaN where the zone counts
    from the ground, which is not known there, and the map alone does not tell.
    """
    zone = records.zones[z]
    away = edge_distance(records, z, east, north)
    ground = 0.0
    if zone.floor_above_ground or zone.ceiling_above_ground:
        ground = ground_height(heights, to_pixel, east, north)
    off = outside_band(zone, up, ground)
    if off != off:
        # Beside its shape it is outside whatever the ground.
        if away <= 0.0:
            return math.nan
        off = away
    outside = max(away, off)
    return -outside if zone.exclusion else outside


@compiled
def _visit(
    moves: Records,
    blocks: Records,
    records: ZoneRecords,
    z: int,
    heights: Heights,
    to_pixel: PolyMapRecord,
    known: float,
    parts: Records,
    visit: Record,
) -> None:  # pragma: no cover - compiled
    """Fill in how a path meets zone z; known: m, depths below it need not be exact."""
    zone = records.zones[z]
    slope = zone.floor_above_ground or zone.ceiling_above_ground
    for b in range(blocks.shape[0]):
        block = blocks[b]
        steepest = block.steepest if slope else 0.0
        across, along = 0.5 * (block.east - block.west), 0.5 * (block.north - block.south)
        reach = math.sqrt(across * across + along * along)
        middle = violation(
            records, z, heights, to_pixel, block.west + across, block.south + along, 0.5 * (block.low + block.high)
        )
        highest = middle + max(reach, 0.5 * (block.high - block.low) + steepest * reach)
        if highest <= 0.0 and highest <= max(known, visit.depth):
            continue
        first = moves[b * _BLOCK]
        before = violation(records, z, heights, to_pixel, first.east, first.north, first.up)
        for k in range(b * _BLOCK, min(moves.shape[0], (b + 1) * _BLOCK)):
            east, north, up = move_point(moves[k], 1.0)
            after = violation(records, z, heights, to_pixel, east, north, up)
            _part_moves(moves[k], records, z, heights, to_pixel, steepest, known, before, after, parts, visit)
            before = after


@compiled
def _part_moves(
    move: Record,
    records: ZoneRecords,
    z: int,
    heights: Heights,
    to_pixel: PolyMapRecord,
    steepest: float,
    known: float,
    before: float,
    after: float,
    parts: Records,
    visit: Record,
) -> None:  # pragma: no cover - compiled
    """Cut a move in halves until each part is certain, and add the parts to a visit in the order that they have."""
    # The most that the violation changes over the whole move: level, and upright.
    upright = max(abs(move.climb), abs(move.climb + 2.0 * move.bend)) + steepest * move.length
    change = max(move.length, upright)
    parts[0].first, parts[0].last, parts[0].before, parts[0].after = 0.0, 1.0, before, after
    left = 1
    while left > 0:
        part = parts[left - 1]
        first, last, before, after = part.first, part.last, part.before, part.after
        reach = change * (last - first)
        highest, lowest = 0.5 * (before + after + reach), 0.5 * (before + after - reach)
        # Between two places above unknown ground all counts as unknown.
        certain = highest <= 0.0 or lowest > 0.0 or (before != before and after != after)
        deeper = highest > max(visit.depth, known) + FENCE_DEPTH
        if reach > FENCE_EDGE and (deeper or not certain):
            middle = 0.5 * (first + last)
            east, north, up = move_point(move, middle)
            between = violation(records, z, heights, to_pixel, east, north, up)
            # The later half lies below the earlier one.
            part.first, part.before = middle, between
            left += 1
            parts[left - 1].first, parts[left - 1].last = first, middle
            parts[left - 1].before, parts[left - 1].after = before, between
            continue
        left -= 1
        _add_part(move, first, last, before, after, visit)


@compiled
def _add_part(
    move: Record, first: float, last: float, before: float, after: float, visit: Record
) -> None:  # pragma: no cover - compiled
    """Add a part of a move, wrong or right throughout or passing the limit once, to a visit."""
    for share, depth in ((first, before), (last, after)):
        if depth > visit.depth:
            visit.depth, visit.at_time, visit.at_leg = depth, move.time + share * move.lasts, move.leg
            visit.at_east, visit.at_north, visit.at_up = move_point(move, share)
    visit.unknown = visit.unknown or before != before or after != after
    if not (before > 0.0 or after > 0.0):
        return
    enter, leave = first, last
    if before <= 0.0:
        enter = first + (last - first) * before / (before - after)
    elif after <= 0.0:
        leave = first + (last - first) * before / (before - after)
    begins, ends = move.time + enter * move.lasts, move.time + leave * move.lasts
    visit.beyond += ends - begins
    if visit.entries == 0 or begins > visit.exit_time + _TOUCH:
        visit.entries += 1
        if visit.entries == 1:
            visit.entry_time, visit.entry_leg = begins, move.leg
            visit.entry_east, visit.entry_north, visit.entry_up = move_point(move, enter)
    visit.exit_time, visit.exit_leg = ends, move.leg
    visit.exit_east, visit.exit_north, visit.exit_up = move_point(move, leave)
