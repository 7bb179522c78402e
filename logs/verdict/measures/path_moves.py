"""Represent a path as moves: straight segments and arcs.

The altitude of a move is a parabola over its horizontal distance.

The moves of a planned path are its exact segments and arcs; the moves of a flown track are the straight lines from row
to row.  The same code judges both.
"""

import math
from itertools import pairwise

import numpy as np

from flight.guidance.path import FlyByPath, point_on_piece, profile_at
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from world.arrays import Floats, Heights
from world.frames import PolyMapRecord, polymap
from world.kernels import Record, Records, inner, record_dtype

# A move.  east, north, up: its start, m.  course_east, course_north: unit vector of its course there, both 0 for a
# vertical move.  length: horizontal, m.  curvature: 1/m, positive to the right.  climb, bend: m; at the fraction f of a
# move the altitude is up + climb * f + bend * f * f.  time: time of its start, s.  lasts: duration, s.  leg: leg of the
# route.
MOVE = record_dtype(
    "east",
    "north",
    "up",
    "course_east",
    "course_north",
    "length",
    "curvature",
    "climb",
    "bend",
    "time",
    "lasts",
    ("leg", np.int64),
)


@inner
def move_point(move: Record, fraction: float) -> tuple[float, float, float]:
    """Return the position at a fraction of a move: east, north and up, m."""
    distance = fraction * move.length
    forward_offset, lateral_offset = distance, 0.0
    if move.curvature != 0.0:
        course_change = move.curvature * distance
        forward_offset = math.sin(course_change) / move.curvature
        lateral_offset = (1.0 - math.cos(course_change)) / move.curvature
    return (
        move.east + forward_offset * move.course_east + lateral_offset * move.course_north,
        move.north + forward_offset * move.course_north - lateral_offset * move.course_east,
        move.up + (move.climb + move.bend * fraction) * fraction,
    )


def planned_moves(requirements: RouteRequirements, first: int = 0, last: int | None = None) -> Records:
    """Return the moves of a route's fly-by path, flown at each leg's ground speed.

    The airspeed replaces the ground speed on a leg whose course cannot be held in the wind.

    first, last: first and last leg to return; by default all legs.
    """
    speeds = np.where(
        np.isfinite(requirements.ground_speed), requirements.ground_speed, requirements.route.leg_airspeeds
    )
    moves = path_moves(requirements.setup.path, speeds, first, requirements.legs - 1 if last is None else last)
    return moves[(moves["leg"] >= first) & (moves["leg"] <= (requirements.legs if last is None else last))]


def path_moves(path: FlyByPath, speeds: Floats, first_leg: int, last_leg: int) -> Records:
    """Return the moves of all pieces of a fly-by path that touch the legs `first_leg` to `last_leg`.

    The first move begins at time 0.  A piece may also cover part of a neighbouring leg.

    speeds: ground speed on each leg of the route, m/s, (legs,).
    """
    nodes = path.nodes
    breaks = np.concatenate([nodes["distance"] - nodes["half_length"], nodes["distance"] + nodes["half_length"]])
    rows, clock = [], 0.0
    for piece in path.pieces:
        if piece.leg + 1 < first_leg or piece.leg > last_leg:
            continue
        start, end = float(piece.start), float(piece.start + piece.length)
        inner = breaks[(breaks > start) & (breaks < end)]
        changes = [piece.leg_change] if start < piece.leg_change < end else []
        cuts = np.unique(np.concatenate([[start], inner, changes, [end]]))
        for first, last in pairwise(cuts.tolist()):
            middle, half_length = 0.5 * (first + last), 0.5 * (last - first)
            # Evaluate the profile at the midpoint, because another parabola or leg may begin at an end.
            altitude, slope, bend = profile_at(nodes, middle)
            east, north = point_on_piece(piece, first - start)
            course = piece.course + piece.curvature * (first - start)
            up = altitude - slope * half_length + 0.5 * bend * half_length * half_length
            leg = int(piece.leg) + int(middle > piece.leg_change)
            length, duration = last - first, (last - first) / speeds[leg]
            climb = (slope - bend * half_length) * length
            move_bend = 0.5 * bend * length * length
            rows.append(
                (
                    east,
                    north,
                    up,
                    math.sin(course),
                    math.cos(course),
                    length,
                    piece.curvature,
                    climb,
                    move_bend,
                    clock,
                    duration,
                    leg,
                )
            )
            clock += duration
    return np.array(rows, MOVE)


def flown_moves(aligned: AlignedTrack, first: int = 0, last: int | None = None) -> Records:
    """Return the moves of a flown track, one from each row to the next.

    first, last: first and last leg to return; by default all legs.

    Rows before the route's first leg belong to the first leg, and rows after its last leg to the last leg.
    """
    legs = len(aligned.rows) - 1
    last = legs - 1 if last is None else last
    start = 0 if first <= 0 else int(aligned.rows[first])
    end = len(aligned.track) if last >= legs - 1 else int(aligned.rows[last + 1]) + 1
    moves = straight_moves(aligned.track.position[start:end], aligned.track.time[start:end])
    moves["leg"] = np.clip(aligned.track.leg[start : start + len(moves)], 0, legs - 1)
    return moves


def straight_moves(points: Floats, time: Floats) -> Records:
    """Return the n - 1 straight moves between n points, all on leg 0.

    points: m, (n, 3).
    time: times of the points, s, (n,).

    >>> moves = straight_moves(np.array([[0.0, 0.0, 50.0], [30.0, 40.0, 60.0]]), np.array([0.0, 2.0]))
    >>> float(moves[0].length), float(moves[0].course_east), float(moves[0].climb), float(moves[0].lasts)
    (50.0, 0.6, 10.0, 2.0)
    """
    steps = np.diff(points, axis=0)
    moves: Records = np.zeros(len(steps), MOVE)
    for axis, name in enumerate(("east", "north", "up")):
        moves[name] = points[:-1, axis]
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    moves["course_east"] = np.divide(steps[:, 0], lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    moves["course_north"] = np.divide(steps[:, 1], lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    moves["length"], moves["climb"] = lengths, steps[:, 2]
    moves["time"], moves["lasts"] = time[:-1], np.diff(time)
    return moves


# ----------------------------------------------------------------------
# Blocks of consecutive moves, compiled.  If a block stays clear of a zone, its moves need not be checked.


# Bounding box of a block on the map, its minimum and maximum altitude, and the steepest ground below it, m per m.
BLOCK = record_dtype("west", "east", "south", "north", "low", "high", "steepest")
# Number of moves in a block.
BLOCK_MOVES = 64


@inner
def move_blocks(
    moves: Records, heights: Heights, to_pixel: PolyMapRecord, spacing: float, reads_ground: bool
) -> Records:
    """Return the bounding box of each `BLOCK_MOVES` consecutive moves, (b,) of dtype `BLOCK`.

    heights, to_pixel, spacing: terrain heights, m, map from positions to their pixels, and distance between pixels, m.
    reads_ground: True to compute the steepest ground below each block, for zones with a limit above ground.
    """
    blocks = np.zeros((moves.shape[0] + BLOCK_MOVES - 1) // BLOCK_MOVES, BLOCK)
    for b in range(blocks.shape[0]):
        block = blocks[b]
        block.west, block.south, block.low = math.inf, math.inf, math.inf
        block.east, block.north, block.high = -math.inf, -math.inf, -math.inf
        for k in range(b * BLOCK_MOVES, min(moves.shape[0], (b + 1) * BLOCK_MOVES)):
            move = moves[k]
            east, north, up = move_point(move, 0.5)
            # No point of a move is further from its midpoint than half its length.
            half_length = 0.5 * move.length
            half_height = 0.5 * abs(move.climb) + 1.25 * abs(move.bend)
            block.west, block.east = min(block.west, east - half_length), max(block.east, east + half_length)
            block.south, block.north = min(block.south, north - half_length), max(block.north, north + half_length)
            block.low, block.high = min(block.low, up - half_height), max(block.high, up + half_height)
        if reads_ground:
            block.steepest = _steepest_ground(block, heights, to_pixel, spacing)
    return blocks


@inner
def _steepest_ground(block: Record, heights: Heights, to_pixel: PolyMapRecord, spacing: float) -> float:
    """Return an upper bound on the slope of the interpolated ground below a block, m per m.

    Steps to pixels without data (NaN) are ignored.  Return 0 outside the raster.
    """
    rows, cols = heights.shape
    west, south = polymap(to_pixel, block.west, block.south)
    east, north = polymap(to_pixel, block.east, block.north)
    # The map's axes may be rotated against the raster's axes: use the ends of both diagonals.
    left, upper = polymap(to_pixel, block.west, block.north)
    right, lower = polymap(to_pixel, block.east, block.south)
    first_col, last_col = min(west, east, left, right), max(west, east, left, right)
    first_row, last_row = min(south, north, upper, lower), max(south, north, upper, lower)
    if not (last_col >= 0.0 and first_col <= cols - 1 and last_row >= 0.0 and first_row <= rows - 1):
        return 0.0
    max_step_square = 0.0
    for i in range(max(0, int(first_row) - 1), min(rows - 1, int(last_row) + 2)):
        for j in range(max(0, int(first_col) - 1), min(cols - 1, int(last_col) + 2)):
            col_step = max(abs(heights[i, j + 1] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i + 1, j]))
            row_step = max(abs(heights[i + 1, j] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i, j + 1]))
            step_square = col_step * col_step + row_step * row_step
            # A comparison with NaN is False.
            if step_square > max_step_square:
                max_step_square = step_square
    # The factor allows for the rounding of single precision.
    return math.sqrt(max_step_square) / spacing * (1.0 + 1e-6)
