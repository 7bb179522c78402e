"""Check the constraints on waypoints and legs that all scores share.

These are turns and their lengths, slopes, and map bounds.

The first part holds the scratch with which the paper's scores evaluate blocks of paths side by side. The second part
derives limits that hold for all paths of a problem (`PrecomputedLimits`) and adds the violations of one path, as counts
or as graded amounts (eq. 1-4 and 7 of Yang, Tang and Lozano, CEC 2014).
"""

import math
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import arc_slope, downwind_vector, slopes_along, wind_speed_at
from planner.evaluation.corners import Wind, courses_at_waypoint, roll_length, settling_length, turn_length
from planner.evaluation.problem import ProblemArrays, RequiredClearance, required_clearance
from world.arrays import Floats
from world.frames import PolyMapRecord
from world.kernels import Record, Records, compiled, inlined, inner

# --- Blocks of paths evaluated side by side ---


# Paths per block: the scratch of a block fits the level 1 cache.
PATHS_PER_BLOCK = 128


def _block_fields(value_type: type[np.generic], *names: str) -> list[tuple[str, type[np.generic], tuple[int]]]:
    """Return the definitions of record fields that hold one value for each path of a block.

    value_type: type of the values.
    names: names of the fields.
    """
    return [(name, value_type, (PATHS_PER_BLOCK,)) for name in names]


# One point of each path: position (m) and pixel.
_POINT = np.dtype(_block_fields(np.float64, "east", "north", "up", "column", "row"), align=True)
# Sums along each path.
_SUMS = np.dtype(
    _block_fields(np.float64, "below", "height", "kill", "detection", "turns", "slopes", "outside", "length"),
    align=True,
)
BLOCK_SCRATCH = np.dtype(
    [
        # Both ends of a leg, the step between them, and a point on it.
        ("begin", _POINT),
        ("end", _POINT),
        ("step", _POINT),
        ("point", _POINT),
        # Horizontal length of a leg, and the east, north and horizontal length of the previous leg, m.
        *_block_fields(np.float64, "run", "east_before", "north_before", "run_before"),
        ("sums", _SUMS),
        # Ground height at a point and the clearance required there, m.
        *_block_fields(np.float64, "ground", "need"),
        # Position within a pixel; position within the map, from -1 to 1; and one row of a polynomial.
        *_block_fields(np.float64, "u", "v", "x", "y", "inner"),
        # Heights of the four pixels around a point.
        *_block_fields(np.float32, "top_left", "top_right", "low_left", "low_right"),
        # Index of a pixel or cell; first entry and number of entries of a cell's units; paths still to be processed.
        *_block_fields(np.int64, "index", "first", "count", "active"),
    ],
    align=True,
)


@inlined
def clear_sums(sums: Record) -> None:
    """Reset all sums to 0."""
    for b in range(PATHS_PER_BLOCK):
        sums.below[b], sums.height[b], sums.kill[b], sums.detection[b] = 0.0, 0.0, 0.0, 0.0
        sums.turns[b], sums.slopes[b], sums.outside[b], sums.length[b] = 0.0, 0.0, 0.0, 0.0


@inlined
def copy_point(source: Record, target: Record, size: int) -> None:
    """Copy one point of each path of a block into another record.

    source, target: records with one entry per path for east, north and up, m, and for raster column and row.
    size: number of paths in the block.
    """
    for b in range(size):
        target.east[b], target.north[b], target.up[b] = source.east[b], source.north[b], source.up[b]
        target.column[b], target.row[b] = source.column[b], source.row[b]


@inlined
def subtract_points(end: Record, start: Record, size: int, out: Record) -> None:
    """Fill `out` with the vector from one point to another, for each path of a block.

    end, start, out: records with one entry per path for east, north and up, m, and for raster column and row.
    size: number of paths in the block.
    """
    for b in range(size):
        out.east[b] = end.east[b] - start.east[b]
        out.north[b] = end.north[b] - start.north[b]
        out.up[b] = end.up[b] - start.up[b]
        out.column[b] = end.column[b] - start.column[b]
        out.row[b] = end.row[b] - start.row[b]


@inlined
def interpolate_legs(start: Record, step: Record, fraction: float, size: int, out: Record) -> None:
    """Fill `out` with the point at a fraction of a leg, for each path of a block.

    start, step, out: records with one entry per path for east, north and up, m, and for raster column and row; `step`
        is the vector from the start to the end of the leg.
    fraction: 0 to 1.
    size: number of paths in the block.
    """
    for b in range(size):
        out.east[b] = start.east[b] + fraction * step.east[b]
        out.north[b] = start.north[b] + fraction * step.north[b]
        out.up[b] = start.up[b] + fraction * step.up[b]
        out.column[b] = start.column[b] + fraction * step.column[b]
        out.row[b] = start.row[b] + fraction * step.row[b]


@inlined
def load_waypoints(to_pixel: PolyMapRecord, paths: Floats, first_path: int, i: int, size: int, block: Record) -> None:
    """Copy waypoint i of each path into `block.end`, and compute its raster pixel as `polymap` does.

    to_pixel: map from east and north to column and row.
    paths: (n, w, 3) m.
    first_path: number of the first path of the block.
    size: number of paths in the block.
    block: scratch of the block of paths.
    """
    end = block.end
    x = block.x
    y = block.y
    inner = block.inner
    east, north, up = end.east, end.north, end.up
    for b in range(size):
        east[b] = paths[first_path + b, i, 0]
        north[b] = paths[first_path + b, i, 1]
        up[b] = paths[first_path + b, i, 2]
    centre_x = to_pixel.centre_x
    centre_y = to_pixel.centre_y
    half_x = to_pixel.half_x
    half_y = to_pixel.half_y
    for b in range(size):
        x[b] = (east[b] - centre_x) / half_x
        y[b] = (north[b] - centre_y) / half_y
    _evaluate_polynomials(to_pixel.u, to_pixel.size, size, x, y, inner, end.column)
    _evaluate_polynomials(to_pixel.v, to_pixel.size, size, x, y, inner, end.row)


@inlined
def _evaluate_polynomials(
    coefficients: Floats, terms: int, size: int, x: Floats, y: Floats, inner: Floats, out: Floats
) -> None:
    """Fill `out` with the sum of coefficients[i, j] x^i y^j for each path, by Horner's method.

    coefficients: (terms, terms); only those with i + j < terms are used.
    size: number of paths in the block.
    x, y, out: one value per path.
    inner: working memory, one value per path.
    """
    for b in range(size):
        out[b] = 0.0
    for i in range(terms - 1, -1, -1):
        for b in range(size):
            inner[b] = 0.0
        for j in range(terms - 1 - i, -1, -1):
            coefficient = coefficients[i, j]
            for b in range(size):
                inner[b] = inner[b] * y[b] + coefficient
        for b in range(size):
            out[b] = out[b] * x[b] + inner[b]


# --- Limits and violations of one path ---

# Upper bound on the length of any roll between two turns, m: at 60 degrees of bank and 90 m/s over the ground.
MAX_ROLL_LENGTH_M = 50.0
# Shortest leg without a violation in the graded scores, m.
MIN_LEG_M = 10.0
# Shortest leg without a violation in the certificate, m.
MIN_CERTIFIED_LEG_M = 5.0


class PrecomputedLimits(NamedTuple):
    """Limits that hold for all paths of a problem.

    cos_max_turn: cosine of the largest turn.
    wind: downwind unit vector, east and north.
    climb_slope, dive_slope: tangents of the slope limits. If the aircraft limits slopes, they are those that it can fly
    on every course and at every altitude; a steeper leg may be possible and is checked by itself.
    slopes_by_aircraft: True if the aircraft limits slopes, False if the scenario limits both climbs and dives.
    straight_distance: distance from start to destination in three dimensions, m.
    required: clearance above ground.
    """

    cos_max_turn: float
    wind: Wind
    climb_slope: float
    dive_slope: float
    slopes_by_aircraft: bool
    straight_distance: float
    required: RequiredClearance


@inner
def precompute_limits(data: ProblemArrays) -> PrecomputedLimits:
    """Return the limits that are the same for all paths of a problem.

    If the aircraft limits slopes, the smallest limit on any course and at any altitude is taken: a leg within it needs
    no further check.
    """
    climb, dive = data.max_climb, data.max_dive
    slopes_by_aircraft = math.isnan(climb) or math.isnan(dive)
    if math.isnan(climb):
        climb = _min_slope_limit(data, data.aircraft.climb)
    if math.isnan(dive):
        dive = _min_slope_limit(data, data.aircraft.descent)
        # No leg, whatever its slope, may lead to an altitude at which the aircraft cannot fly level.
        if data.aircraft.equivalent > 0.0 and _min_slope_limit(data, data.aircraft.climb) < 0.0:
            dive = -1.0
    straight_distance2 = 0.0
    for k in range(3):
        straight_distance2 += (data.destination[k] - data.start[k]) ** 2
    return PrecomputedLimits(
        # No turn exceeds half a circle; -2 is below any rounded cosine.
        math.cos(data.max_turn) if data.max_turn < math.pi else -2.0,
        downwind_vector(data.aircraft),
        math.tan(climb - data.angle_margin),
        math.tan(dive - data.angle_margin),
        slopes_by_aircraft,
        math.sqrt(straight_distance2),
        required_clearance(data),
    )


@inlined
def _min_slope_limit(data: ProblemArrays, air_angles: Floats) -> float:
    """Return the steepest slope that the aircraft can fly on every course at all altitudes, rad.

    air_angles: (h,) steepest climb (or descent) relative to the air at the table's heights, rad.

    The slope over the ground is smallest in the strongest tailwind. The result is -1 if there is no such slope: at some
    height the angle is not positive, or the wind is about as fast as the aircraft.
    """
    wind = max(wind_speed_at(data.aircraft, data.floor), wind_speed_at(data.aircraft, data.ceiling))
    speed, air_angle = data.aircraft.airspeed, math.inf
    for k in range(air_angles.size):
        air_angle = min(air_angle, air_angles[k])
    # A headwind of about the airspeed leaves no ground speed, so that no slope is defined.
    if not air_angle > 0.0 or wind >= 0.99 * speed * math.cos(air_angle):
        return -1.0
    return math.atan2(speed * math.sin(air_angle), speed * math.cos(air_angle) + wind)


@inlined
def _course_slope_limits(
    data: ProblemArrays, ux: float, uy: float, start_altitude: float, end_altitude: float, wind: Wind
) -> tuple[float, float]:
    """Return the climb and dive limits on a course between two altitudes, rad.

    ux, uy: east and north of the course, a unit vector.
    start_altitude, end_altitude: m AMSL.
    wind: downwind unit vector.

    If the scenario states a limit, that limit applies. Otherwise it is the lowest limit of the aircraft at three
    altitudes: the two given altitudes and the altitude half-way between them. The angle margin is subtracted in both
    cases.
    """
    climb, dive = data.max_climb, data.max_dive
    if math.isnan(climb) or math.isnan(dive):
        wx, wy = wind
        aircraft_climb, aircraft_dive = math.inf, math.inf
        for fraction in (0.0, 0.5, 1.0):
            climb_angle, dive_angle = slopes_along(
                data.aircraft,
                ux * wx + uy * wy,
                ux * wy - uy * wx,
                start_altitude + fraction * (end_altitude - start_altitude),
            )
            aircraft_climb, aircraft_dive = min(aircraft_climb, climb_angle), min(aircraft_dive, dive_angle)
        if math.isnan(climb):
            climb = aircraft_climb
        if math.isnan(dive):
            dive = aircraft_dive
    return climb - data.angle_margin, dive - data.angle_margin


@compiled
def slope_limits(data: ProblemArrays, start: Floats, end: Floats) -> tuple[float, float]:
    """Return the climb and dive limits of a leg, rad.

    start, end: (3,) ends of the leg, m. A leg without horizontal length is taken to lead north.

    Each limit is the smallest limit at three altitudes of the leg, minus the margin `angle_margin`.
    """
    dx, dy = end[0] - start[0], end[1] - start[1]
    horizontal_length = math.sqrt(dx * dx + dy * dy)
    ux, uy = (dx / horizontal_length, dy / horizontal_length) if horizontal_length > 0.0 else (0.0, 1.0)
    return _course_slope_limits(data, ux, uy, start[2], end[2], downwind_vector(data.aircraft))


@inlined
def slope_excess(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    ux: float,
    uy: float,
    horizontal_length: float,
    start_altitude: float,
    end_altitude: float,
) -> float:
    """Return the excess of a leg's slope over its limit, m per m of horizontal length (eq. 3-4).

    ux, uy: unit vector along the leg's course.
    horizontal_length: m.
    start_altitude, end_altitude: altitudes of the leg's start and end, m.

    The excess is 0 within the limit.
    """
    altitude_change = end_altitude - start_altitude
    excess = max(
        0.0,
        altitude_change - limits.climb_slope * horizontal_length,
        -altitude_change - limits.dive_slope * horizontal_length,
    )
    is_outside = min(start_altitude, end_altitude) < data.floor or max(start_altitude, end_altitude) > data.ceiling
    if limits.slopes_by_aircraft and (excess > 0.0 or is_outside):
        climb, dive = _course_slope_limits(data, ux, uy, start_altitude, end_altitude, limits.wind)
        excess = max(
            0.0,
            altitude_change - math.tan(climb) * horizontal_length,
            -altitude_change - math.tan(dive) * horizontal_length,
        )
    return excess / max(horizontal_length, 1.0)


@inlined
def _turn_excess(cos_max_turn: float, max_turn: float, ux: float, uy: float, vx: float, vy: float) -> float:
    """Return the angle by which the turn between unit courses u and v exceeds its limit, rad; else 0.

    max_turn, cos_max_turn: the limit, rad, and its cosine.
    ux, uy, vx, vy: east and north of the courses; (0, 0) for a leg without length, whose excess is 0.

    This is eqs. 1 and 2 of Yang, Tang and Lozano 2014.
    """
    dot = ux * vx + uy * vy
    if dot >= cos_max_turn or (ux == 0.0 and uy == 0.0) or (vx == 0.0 and vy == 0.0):
        return 0.0
    # Slightly above zero, so that an excess lost to rounding is counted.
    return max(1e-12, math.atan2(abs(ux * vy - uy * vx), dot) - max_turn)


@inner
def add_leg_violations(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    path: Floats,
    legs: Records,
    corners: Records,
    by_amount: bool,
    violations: Record,
) -> None:
    """Add turn, slope and bounds violations of a path (w, 3) to a `VIOLATIONS` record (eq. 1-4, 7).

    legs, corners: filled `LEG` records (w - 1,) and `CORNER` records (w,) of the path.
    by_amount: True to add the excess of each violation, False to add 1.

    If `legs_hold_turns` is set, a leg that is too short for the turns at its ends adds to the turn violations. With
    `by_amount`, so does any leg shorter than `MIN_LEG_M`.
    """
    # Another order of these lines would change the order of summation, and with it the last digits.
    _add_turn_violations(data, limits, legs, by_amount, violations)
    _add_bounds_violations(data, path, corners, by_amount, violations)
    if data.legs_hold_turns:
        _add_leg_length_violations(data, limits, path, legs, corners, by_amount, violations)
    for i in range(legs.shape[0]):
        # Coincident waypoints have no course between them, and would hide two sharp turns.
        violations.turn += max(0.0, MIN_LEG_M - legs[i].run) / 100.0 if by_amount else 0.0
        altitude_change, horizontal_length = path[i + 1, 2] - path[i, 2], legs[i].run
        excess = max(
            0.0,
            altitude_change - limits.climb_slope * horizontal_length,
            -altitude_change - limits.dive_slope * horizontal_length,
        ) / max(horizontal_length, 1.0)
        if limits.slopes_by_aircraft:
            excess = slope_excess(
                data, limits, legs[i].east, legs[i].north, horizontal_length, path[i, 2], path[i + 1, 2]
            )
        violations.slope += _score_excess(excess, by_amount)
    if limits.slopes_by_aircraft and data.legs_hold_turns and not data.fly_over:
        for i in range(1, legs.shape[0]):
            violations.slope += _score_excess(_arc_slope_excess(data, limits, path, i, legs, corners), by_amount)


@inlined
def _add_turn_violations(
    data: ProblemArrays, limits: PrecomputedLimits, legs: Records, by_amount: bool, violations: Record
) -> None:
    """Add the turns that are too sharp, including the turns from and to prescribed end courses.

    legs: filled `LEG` records (w - 1,) of the path.
    by_amount: True to add the excess over the turn limit, rad; False to add 1 for each turn.
    violations: `VIOLATIONS` record, to whose turn violation they are added.
    """
    max_turn, leg_count = data.max_turn, legs.shape[0]
    for i in range(1, leg_count):
        ux = legs[i - 1].east
        uy = legs[i - 1].north
        vx = legs[i].east
        vy = legs[i].north
        violations.turn += _score_excess(_turn_excess(limits.cos_max_turn, max_turn, ux, uy, vx, vy), by_amount)
    for i, end_course in ((0, data.start_course), (leg_count, data.destination_course)):
        if not math.isnan(end_course):
            ux, uy, vx, vy = courses_at_waypoint(data, legs, i)
            violations.turn += _score_excess(_turn_excess(limits.cos_max_turn, max_turn, ux, uy, vx, vy), by_amount)


@inlined
def _add_bounds_violations(
    data: ProblemArrays, path: Floats, corners: Records, by_amount: bool, violations: Record
) -> None:
    """Add the waypoints that are off the map, below the floor or above the ceiling.

    The constraint is eq. 7 of Yang, Tang and Lozano 2014. The excursion of the flight at a corner reduces the distance
    to the map's edges.

    path: (w, 3) m.
    corners: filled `CORNER` records (w,) of the path.
    by_amount: True to add the excess, m; False to add 1 for each waypoint.
    violations: `VIOLATIONS` record, to whose bounds violation they are added.
    """
    west = data.west
    east = data.east
    south = data.south
    north = data.north
    floor, ceiling = data.floor, data.ceiling
    for i in range(path.shape[0]):
        x, y, z = path[i, 0], path[i, 1], path[i, 2]
        excursion = corners[i].excursion
        excess = max(0.0, west - x + excursion, x - east + excursion, south - y + excursion, y - north + excursion)
        excess = max(excess, floor - z, z - ceiling)
        violations.bounds += _score_excess(excess, by_amount)


@inlined
def _add_leg_length_violations(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    path: Floats,
    legs: Records,
    corners: Records,
    by_amount: bool,
    violations: Record,
) -> None:
    """Add the missing lengths of legs that are too short for their turns, in units of 100 m.

    A leg must be long enough for its turns, the roll between them, and settling.

    path: (w, 3) m.
    legs, corners: filled `LEG` records (w - 1,) and `CORNER` records (w,) of the path.
    by_amount: True to add the amounts, at most 10 each; False to add 1 for each leg that is too short.
    violations: `VIOLATIONS` record, to whose turn violation the amounts are added.
    """
    for i in range(legs.shape[0]):
        required_length, horizontal_length = turn_length(data.fly_over, corners, i), legs[i].run
        missing_length = (
            required_length + settling_length(required_length, horizontal_length) - horizontal_length
            if required_length > 0.0
            else 0.0
        )
        if missing_length > -MAX_ROLL_LENGTH_M and not data.fly_over:
            altitude = min(path[i, 2], path[i + 1, 2])
            missing_length += roll_length(data.aircraft, legs, corners, i, altitude, limits.wind)
        violations.turn += _score_excess(min(10.0, max(0.0, missing_length / 100.0)), by_amount)


@inlined
def _arc_slope_excess(
    data: ProblemArrays, limits: PrecomputedLimits, path: Floats, i: int, legs: Records, corners: Records
) -> float:
    """Return how much the arc at waypoint i is too steep for the aircraft, m per m; 0 if it is not.

    path: (w, 3) m.
    i: index of an inner waypoint.
    legs, corners: filled `LEG` records (w - 1,) and `CORNER` records (w,) of the path.

    The arc must be within the limits on the course before the turn and on the course after it.
    """
    slope_in = (path[i, 2] - path[i - 1, 2]) / max(legs[i - 1].run, 1.0)
    slope_out = (path[i + 1, 2] - path[i, 2]) / max(legs[i].run, 1.0)
    slope = arc_slope(slope_in, slope_out, corners[i].tangent, corners[i].radius)
    if -limits.dive_slope <= slope <= limits.climb_slope:
        return 0.0
    excess = 0.0
    for leg in (i - 1, i):
        climb, dive = _course_slope_limits(data, legs[leg].east, legs[leg].north, path[i, 2], path[i, 2], limits.wind)
        excess = max(excess, slope - math.tan(climb), -slope - math.tan(dive))
    return excess


@inlined
def _score_excess(excess: float, by_amount: bool) -> float:
    """Return what an excess over a limit adds to a score.

    by_amount: True to add the excess itself, False to add 1 for any excess above 0.
    """
    if by_amount:
        return excess
    return 1.0 if excess > 0.0 else 0.0
