"""Measure a path for its certificate.

Measured are pieces of the path, their clearance and their distance to missiles.

A path is cut into straight pieces. Without tracking error these are its legs and the chords of its fly-by arcs. With it
they are parts of legs and corners, each with bounds on how far the flight deviates from it sideways, below and above;
distances are then measured from the worst positions within those bounds.
"""

import math

import numpy as np

from aircraft.path_limits import downwind_vector
from planner.evaluation.corners import (
    ARC_STEP,
    CORNER,
    LEG,
    fly_by_radii,
    fly_by_vertices,
    leg_parts_at_corner,
    measure_corners,
    measure_legs,
    roll_length,
    turn_length,
)
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem import ProblemArrays
from planner.evaluation.terrain_clearance import HEIGHT_LAG, compute_height_lags, lag_at
from world.arrays import Floats
from world.kernels import Record, Records, compiled, copy_into, inner, sort_few
from world.terrain import segment_clearance

# --- Pieces with tracking error ---


# A piece of a leg, or of a leg near the corner at a waypoint, and the number of that leg or waypoint. It has two ends;
# the lateral deviation of the flight at both ends and its maximum; and the largest deviation below and above, m.
TRACKED_PIECE = np.dtype(
    [
        ("of_corner", np.bool_),
        ("number", np.int64),
        ("begin", np.float64, (3,)),
        ("end", np.float64, (3,)),
        ("lateral_begin", np.float64),
        ("lateral_end", np.float64),
        ("lateral", np.float64),
        ("below", np.float64),
        ("above", np.float64),
    ],
    align=True,
)
# Cuts of a leg, in lengths of the height lag, which has all but decayed after four.
_CUTS = (0.5, 1.0, 2.0, 4.0)
# The tracking error grows from 0 at a fixed end to its full value at this distance, m.
END_DISTANCE_M = 100.0


@inner
def tracked_pieces(data: ProblemArrays, waypoints: Floats) -> Records:
    """Cut a path (w, 3) into straight pieces with bounds on the tracking error of the flight.

    Returns `TRACKED_PIECE` records, first of its legs, then of its corners. A leg is cut where its altitude lag has
    decayed and near the fixed ends. A corner gives two pieces: the part of the leg before it and the part of the leg
    after it, with the excursion of the flight at the corner as an additional lateral deviation.
    """
    count = waypoints.shape[0]
    legs, corners = np.zeros(count - 1, dtype=LEG), np.zeros(count, dtype=CORNER)
    lags, wind, across = np.zeros(count - 1, dtype=HEIGHT_LAG), downwind_vector(data.aircraft), data.tracking.across
    measure_legs(waypoints, legs)
    measure_corners(data, wind, waypoints, legs, corners)
    compute_height_lags(data.tracking, data.aircraft, wind, waypoints, legs, lags)
    pieces = np.zeros((count - 1) * (len(_CUTS) + 3) + 2 * count, dtype=TRACKED_PIECE)
    piece_count = 0
    for i in range(count - 1):
        # Ends of the pieces, as increasing fractions of the leg; the last is 1.
        piece_ends, begin_fraction = np.ones(len(_CUTS) + 3), 0.0
        for cut in range(len(_CUTS)):
            piece_ends[cut] = min(1.0, _CUTS[cut] / max(1e-9, lags[i].decay))
        end_zone = min(1.0, END_DISTANCE_M / max(1e-9, legs[i].run))
        piece_ends[len(_CUTS)], piece_ends[len(_CUTS) + 1] = end_zone, 1.0 - end_zone
        sort_few(piece_ends)
        for end_fraction in piece_ends:
            if end_fraction <= begin_fraction:
                continue
            piece = pieces[piece_count]
            _cut_piece(waypoints[i], waypoints[i + 1], begin_fraction, end_fraction, piece)
            piece.number = i
            piece.lateral_begin = _lateral_deviation(data, piece.begin, across)
            piece.lateral_end = _lateral_deviation(data, piece.end, across)
            _set_deviations(lags[i], begin_fraction, end_fraction, piece)
            piece.lateral = max(piece.lateral_begin, piece.lateral_end)
            begin_fraction = end_fraction
            piece_count += 1
    for i in range(1, count - 1):
        if corners[i].excursion <= 0.0:
            continue
        corner_legs = leg_parts_at_corner(
            waypoints[i - 1], waypoints[i], waypoints[i + 1], corners[i].before, corners[i].after
        )
        max_lateral = across + corners[i].excursion
        for k in range(2):
            piece = pieces[piece_count]
            _cut_piece(corner_legs[k], corner_legs[k + 1], 0.0, 1.0, piece)
            piece.of_corner, piece.number = True, i
            piece.lateral_begin, piece.lateral_end, piece.lateral = max_lateral, max_lateral, max_lateral
            if k == 0:
                begin_fraction = 1.0 - min(1.0, corners[i].before / max(1e-6, legs[i - 1].run))
                _set_deviations(lags[i - 1], begin_fraction, 1.0, piece)
            else:
                _set_deviations(lags[i], 0.0, min(1.0, corners[i].after / max(1e-6, legs[i].run)), piece)
            piece_count += 1
    return pieces[:piece_count]


@inner
def _cut_piece(start: Floats, end: Floats, begin_fraction: float, end_fraction: float, piece: Record) -> None:
    """Set the ends of a piece to the points at two fractions of a line.

    start, end: (3,) ends of the line, m.
    begin_fraction, end_fraction: 0 to 1.
    piece: record whose ends are set.
    """
    for axis in range(3):
        piece.begin[axis] = start[axis] + begin_fraction * (end[axis] - start[axis])
        piece.end[axis] = start[axis] + end_fraction * (end[axis] - start[axis])


@inner
def _set_deviations(lag: Record, begin_fraction: float, end_fraction: float, piece: Record) -> None:
    """Set the deviations of a piece below and above its leg, between two fractions of the leg.

    lag: `HEIGHT_LAG` record of the leg.
    begin_fraction, end_fraction: 0 to 1.
    piece: record whose largest distances below and above the leg (m, not negative) are set.
    """
    begin_lag, end_lag = lag_at(lag, begin_fraction), lag_at(lag, end_fraction)
    piece.below, piece.above = max(0.0, begin_lag, end_lag), max(0.0, -begin_lag, -end_lag)


@inner
def _lateral_deviation(data: ProblemArrays, position: Floats, across: float) -> float:
    """Return the lateral deviation of the flight at a position on the path, m.

    It grows from 0 at the start and the destination to `across` at the distance `END_DISTANCE_M`.
    """
    end_distance = min(
        math.hypot(position[0] - data.start[0], position[1] - data.start[1]),
        math.hypot(position[0] - data.destination[0], position[1] - data.destination[1]),
    )
    return across * min(1.0, end_distance / END_DISTANCE_M)


# --- Certified quantities ---

# A straight piece of a leg, or of the arc at a waypoint, with its number: its smallest height above ground (m, NaN off
# the terrain) and the buffer required there (m).
CERTIFIED_PIECE = np.dtype(
    [("of_arc", np.bool_), ("number", np.int64), ("height", np.float64), ("buffer", np.float64)], align=True
)
# Maximum number of pieces of one arc: its chords and one on either leg.
_MAX_PIECES = math.ceil(math.pi / ARC_STEP) + 2


@compiled
def missile_distance(data: ProblemArrays, waypoints: Floats) -> float:
    """Return the distance between the flight of a path (w, 3) and the nearest missile sphere, m.

    The flight may deviate from the legs and arcs by the tracking error. The distance is inf without missiles.
    """
    min_distance = math.inf
    if data.tracking.has_error:
        for piece in tracked_pieces(data, waypoints):
            start, end = piece.begin.copy(), piece.end.copy()
            for height_shift in (0.0, -piece.below, piece.above):
                start[2], end[2] = piece.begin[2] + height_shift, piece.end[2] + height_shift
                min_distance = min(min_distance, _segment_distance(data.threats, start, end, math.inf) - piece.lateral)
        return min_distance
    leg_count = waypoints.shape[0] - 1
    for i in range(leg_count):
        min_distance = _segment_distance(data.threats, waypoints[i], waypoints[i + 1], min_distance)
    radii = fly_by_radii(data, waypoints)
    for i in range(1, leg_count):
        arc = fly_by_vertices(data.aircraft, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        for k in range(max(1, arc.shape[0] - 1)):
            min_distance = _segment_distance(data.threats, arc[k], arc[min(k + 1, arc.shape[0] - 1)], min_distance)
    return min_distance


@inner
def _segment_distance(threats: Records, start: Floats, end: Floats, min_distance: float) -> float:
    """Return the distance from a segment to the nearest missile sphere, m; at most `min_distance`.

    The distance is negative inside a sphere.

    threats: records of the threats; those without a kill radius are ignored.
    start, end: (3,) ends of the segment, m.
    min_distance: smallest distance found on other segments, m.
    """
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length2 = dx * dx + dy * dy + dz * dz
    for k in range(threats.shape[0]):
        threat = threats[k]
        if threat.kill_radius <= 0.0:
            continue
        x, y, z = start[0] - threat.east, start[1] - threat.north, start[2] - threat.up
        along = dx * x + dy * y + dz * z
        fraction = min(1.0, max(0.0, -along / length2)) if length2 > 0.0 else 0.0
        # From the closest point itself: a difference of squares loses digits.
        x, y, z = x + fraction * dx, y + fraction * dy, z + fraction * dz
        min_distance = min(min_distance, math.sqrt(x * x + y * y + z * z) - threat.kill_radius)
    return min_distance


# Distance of the added points from the ends of the path, m; only the courses to them matter.
_END_POINT_DISTANCE_M = 1e4


@compiled
def add_end_course_points(data: ProblemArrays, path: Floats) -> Floats:
    """Add a point at each end of a path (w, 3), to measure the turns from and to the end courses.

    One distant point lies before the start, the other after the destination, both on the prescribed courses. Without a
    prescribed course the point extends the leg, so that there is no turn.
    """
    count = path.shape[0]
    out = np.empty((count + 2, 3))
    for i in range(count):
        copy_into(out[i + 1], path[i])
    for added_row, end_row, neighbour_row, course, sign in (
        (0, 0, 1, data.start_course, -1.0),
        (count + 1, count - 1, count - 2, data.destination_course, 1.0),
    ):
        copy_into(out[added_row], path[end_row])
        if math.isnan(course):
            for axis in range(2):
                out[added_row, axis] = 2.0 * path[end_row, axis] - path[neighbour_row, axis]
        else:
            out[added_row, 0] += sign * _END_POINT_DISTANCE_M * math.sin(course)
            out[added_row, 1] += sign * _END_POINT_DISTANCE_M * math.cos(course)
    return out


@compiled
def turn_and_roll_lengths(data: ProblemArrays, waypoints: Floats) -> tuple[Floats, Floats]:  # pragma: no cover
    """Return the lengths that each leg needs for its turns, and for rolling between opposite banks.

    waypoints: (w, 3) m.

    Returns the turn lengths and the roll lengths, (w - 1,) m each. The roll lengths of fly-over waypoints are 0: a
    fly-over turn begins at its waypoint, and its turn length already extends to the point where the track has rejoined
    the next leg.
    """
    count = waypoints.shape[0]
    legs, corners = np.zeros(count - 1, dtype=LEG), np.zeros(count, dtype=CORNER)
    turns, rolls = np.zeros(count - 1), np.zeros(count - 1)
    wind = downwind_vector(data.aircraft)
    measure_legs(waypoints, legs)
    measure_corners(data, wind, waypoints, legs, corners)
    for i in range(count - 1):
        turns[i] = turn_length(data.fly_over, corners, i)
        if not data.fly_over:
            altitude = min(waypoints[i, 2], waypoints[i + 1, 2])
            rolls[i] = roll_length(data.aircraft, legs, corners, i, altitude, wind)
    return turns, rolls


@compiled
def corner_excursions(data: ProblemArrays, waypoints: Floats) -> Floats:
    """Return the largest distance of the flight from the legs at each waypoint, m, (w,)."""
    count = waypoints.shape[0]
    legs, corners = np.zeros(count - 1, dtype=LEG), np.zeros(count, dtype=CORNER)
    measure_legs(waypoints, legs)
    measure_corners(data, downwind_vector(data.aircraft), waypoints, legs, corners)
    excursions = np.empty(count)
    for i in range(count):
        excursions[i] = corners[i].excursion
    return excursions


@compiled
def leg_slope_limits(data: ProblemArrays, waypoints: Floats) -> tuple[Floats, Floats]:
    """Return the maximum climb and dive angles of each leg, (w - 1,) rad each."""
    count = waypoints.shape[0] - 1
    climbs, dives = np.empty(count), np.empty(count)
    for i in range(count):
        climbs[i], dives[i] = slope_limits(data, waypoints[i], waypoints[i + 1])
    return climbs, dives


@compiled
def heights_above_ground(data: ProblemArrays, waypoints: Floats) -> Records:
    """Measure the smallest height above ground and the required buffer of each piece of a path (w, 3).

    Returns `CERTIFIED_PIECE` records, first of its legs, then of its arcs or corners.
    """
    if data.tracking.has_error:
        # The height includes the tracking error below the piece and to either side of it, and is NaN over unknown
        # ground.
        tracked = tracked_pieces(data, waypoints)
        out = np.zeros(tracked.size, dtype=CERTIFIED_PIECE)
        for k in range(tracked.size):
            piece = tracked[k]
            dx, dy = piece.end[0] - piece.begin[0], piece.end[1] - piece.begin[1]
            horizontal_length = max(1e-9, math.hypot(dx, dy))
            min_height = math.inf
            for side in (0.0, -1.0, 1.0):
                offset_start, offset_end = piece.begin.copy(), piece.end.copy()
                for end, lateral in ((offset_start, piece.lateral_begin), (offset_end, piece.lateral_end)):
                    end[0] += side * lateral * dy / horizontal_length
                    end[1] -= side * lateral * dx / horizontal_length
                    end[2] -= piece.below
                height, _ = segment_clearance(data.heights, data.to_pixel, offset_start, offset_end)
                min_height = math.nan if math.isnan(height) or math.isnan(min_height) else min(min_height, height)
            out[k].of_arc, out[k].number, out[k].height = piece.of_corner, piece.number, min_height
            ends = data.start_buffer, data.destination_buffer
            out[k].buffer = required_buffer(data, data.buffer, ends, piece.begin, piece.end)
        return out
    leg_count = waypoints.shape[0] - 1
    radii = fly_by_radii(data, waypoints)
    pieces = np.zeros(leg_count + leg_count * _MAX_PIECES, dtype=CERTIFIED_PIECE)
    for i in range(leg_count):
        _measure_piece(data, waypoints[i], waypoints[i + 1], False, i, pieces[i])
    piece_count = leg_count
    for i in range(1, leg_count):
        arc = fly_by_vertices(data.aircraft, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        for k in range(max(1, arc.shape[0] - 1)):
            _measure_piece(data, arc[k], arc[min(k + 1, arc.shape[0] - 1)], True, i, pieces[piece_count])
            piece_count += 1
    return pieces[:piece_count]


@inner
def _measure_piece(data: ProblemArrays, start: Floats, end: Floats, of_arc: bool, number: int, out: Record) -> None:
    """Fill the `CERTIFIED_PIECE` record for a straight piece from `start` to `end`.

    start, end: (3,) ends of the piece, m.
    of_arc: True for a piece of an arc, False for a piece of a leg.
    number: number of the leg or arc.
    out: the record to fill.
    """
    height, _ = segment_clearance(data.heights, data.to_pixel, start, end)
    out.of_arc, out.number, out.height = of_arc, number, height
    out.buffer = required_buffer(data, data.buffer, (data.start_buffer, data.destination_buffer), start, end)


@inner
def required_buffer(
    data: ProblemArrays, buffer: float, end_buffers: tuple[float, float], a: Floats, b: Floats
) -> float:
    """Return the height that a piece a-b requires in addition to the clearance, m.

    buffer: additional height away from the ends, m.
    end_buffers: additional heights at the start and the destination, m.
    a, b: (3,) ends of the piece, m.

    If an end has a smaller buffer, the required height grows with the distance from that end, up to `buffer`. It grows
    half as fast as in a search, which has to allow for the ground between its samples.
    """
    for end, end_buffer in ((data.start, end_buffers[0]), (data.destination, end_buffers[1])):
        if end_buffer < buffer:
            dx = b[0] - a[0]
            dy = b[1] - a[1]
            x = a[0] - end[0]
            y = a[1] - end[1]
            run2 = dx * dx + dy * dy
            fraction = min(1.0, max(0.0, -(dx * x + dy * y) / run2)) if run2 > 0.0 else 0.0
            distance = math.sqrt((x + fraction * dx) ** 2 + (y + fraction * dy) ** 2)
            buffer = min(buffer, end_buffer + 0.5 * data.buffer_growth * distance)
    return buffer
