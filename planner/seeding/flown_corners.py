"""Constrain the heights and slopes of flown corners in shortening, with derivatives by the waypoints.

Around the end of a ridge a flight that cuts its corners passes over higher ground than the ground below the legs.
Without tracking error the flight is on the chords of fly-by arcs; with tracking error it is within a distance of the
legs before and after the waypoint, on both sides. A certificate measures all of these positions; shortening measures
samples of them. An arc is shorter than the legs it replaces, and steeper, so a path that climbs in circles must climb
less on its arcs.
"""

import math
from typing import NamedTuple

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.tracking import corner_deviation
from planner.evaluation.corners import ARC_STEP, fly_by_radii, half_blend_length
from planner.evaluation.leg_constraints import PrecomputedLimits, slope_limits
from planner.evaluation.problem import ProblemArrays, clearance_at
from planner.evaluation.terrain_clearance import lag_at
from world.arrays import Floats
from world.frames import polymap
from world.kernels import Records, inner
from world.terrain import pixel_height

# Number of samples along each of a corner's two legs and on each side, with tracking error.
SAMPLES_PER_LEG = 4
# Number of samples of a corner.
SAMPLES_PER_CORNER = 4 * SAMPLES_PER_LEG
# Smallest distance between a sampled corner and its legs, m.
MIN_DEPARTURE_M = 2.0
# Largest height of a sampled corner above the required height, m.
NEAR_GROUND_HEIGHT_M = 60.0
# Largest turn that is sampled, rad, because at half a turn the tangent is infinite.
MAX_TURN_RAD = 3.0
# Half-step of finite differences of the ground, m.
GROUND_STEP_M = 8.0
# Half-step of finite differences of the place of a sample, m.
CORNER_STEP_M = 0.5
# Slope of an arc, as a fraction of the slope limit, below which it is not constrained.
STEEP_FRACTION = 0.8
# Length of an arc in addition to the length for its climb or descent, m.
ARC_MARGIN_M = 1.0
# Additional length of an arc, as a fraction of the additional margin.
ARC_FRACTION = 0.4


class FlownCorners(NamedTuple):
    """Corners of a path of w waypoints that are flown near the ground or almost as steeply as possible.

    radii: (w,) radii of the turns near the ground, m; 0 for other corners.
    lowered: (w, 2) height required in addition to the clearance, m, because the flight is below the legs before and
        after the corner.
    steep_radii: (w,) radii of the arcs that are almost as steep as can be flown, m; 0 for other arcs.
    slopes: (w, 2) tangents of the steepest climb and dive there.
    slope_margin: spare length that an arc must have beyond what its climb or descent needs, m.
    """

    radii: Floats
    lowered: Floats
    steep_radii: Floats
    slopes: Floats
    slope_margin: float


@inner
def no_corners(count: int, margin: float) -> FlownCorners:
    """Return the `FlownCorners` of a path that has no corners near the ground.

    count: number w of waypoints of the path.
    margin: additional margin, m.
    """
    slope_margin = ARC_MARGIN_M + ARC_FRACTION * margin
    return FlownCorners(
        np.zeros(count), np.full((count, 2), margin), np.zeros(count), np.zeros((count, 2)), slope_margin
    )


@inner
def corners_near_ground(
    data: ProblemArrays, limits: PrecomputedLimits, path: Floats, corners: Records, lags: Records, margin: float
) -> FlownCorners:
    """Find a path's corners that are flown close to the ground, or almost as steeply as allowed.

    path: (w, 3) m.
    corners, lags: `CORNER` records of the turns, and `HEIGHT_LAG` records of the legs.
    margin: height added to the required clearance, m.

    A corner is near the ground if any of its samples is less than `NEAR_GROUND_HEIGHT_M` above the required height.
    Corners that hardly leave the legs are omitted. A path of fly-over waypoints has no such corners.
    """
    count = path.shape[0]
    flown, point = no_corners(count, margin), np.empty(3)
    lowered = flown.lowered
    if data.fly_over:
        return flown
    if data.legs_hold_turns and limits.slopes_by_aircraft:
        _find_steep_arcs(data, path, corners, flown)
    radii = fly_by_radii(data, path)
    for i in range(1, count - 1):
        radius = corners[i].radius if data.tracking.has_error else radii[i]
        if not 0.0 < radius < math.inf:
            continue
        length_in, length_out = _horizontal_length(path[i - 1], path[i]), _horizontal_length(path[i], path[i + 1])
        if data.tracking.has_error:
            if corners[i].excursion < MIN_DEPARTURE_M:
                continue
            begin_fraction = 1.0 - min(1.0, corners[i].before / length_in)
            lowered[i, 0] += max(0.0, lag_at(lags[i - 1], begin_fraction), lag_at(lags[i - 1], 1.0))
            lowered[i, 1] += max(0.0, lag_at(lags[i], 0.0), lag_at(lags[i], min(1.0, corners[i].after / length_out)))
        else:
            corner_point(data, path[i - 1], path[i], path[i + 1], radius, SAMPLES_PER_CORNER // 2, point)
            if _horizontal_length(point, path[i]) < MIN_DEPARTURE_M:
                continue
            slope_change = abs((path[i, 2] - path[i - 1, 2]) / length_in - (path[i + 1, 2] - path[i, 2]) / length_out)
            lowering = 0.25 * slope_change * slope_change * half_blend_length(data.aircraft, path[i, 2])
            lowered[i, 0] += lowering
            lowered[i, 1] += lowering
        for k in range(SAMPLES_PER_CORNER):
            corner_point(data, path[i - 1], path[i], path[i + 1], radius, k, point)
            if height_above_required(data, limits, point) < lowered[i, leg_index(k)] + NEAR_GROUND_HEIGHT_M:
                flown.radii[i] = radius
    return flown


@inner
def _find_steep_arcs(data: ProblemArrays, path: Floats, corners: Records, flown: FlownCorners) -> None:
    """Fill the radii of arcs whose slopes are close to their limits, and the slope limits of all arcs.

    path: (w, 3) m.
    corners: filled `CORNER` records (w,) of the path.
    flown: corners whose `slopes` and `steep_radii` are filled.

    A slope limit is the lower of the limits on the two courses of the corner. An arc is steep if its climb or descent
    needs more than `STEEP_FRACTION` of its length.
    """
    level_start, level_end = np.zeros(3), np.zeros(3)
    for i in range(1, path.shape[0] - 1):
        if not 0.0 < corners[i].radius < math.inf or math.isinf(corners[i].tangent):
            continue
        climb, dive = math.inf, math.inf
        level_start[2] = path[i, 2]
        for leg in (i - 1, i):
            level_end[0] = path[leg + 1, 0] - path[leg, 0]
            level_end[1] = path[leg + 1, 1] - path[leg, 1]
            level_end[2] = path[i, 2]
            climb_limit, dive_limit = slope_limits(data, level_start, level_end)
            climb, dive = min(climb, math.tan(climb_limit)), min(dive, math.tan(dive_limit))
        flown.slopes[i, 0], flown.slopes[i, 1] = climb, dive
        radius = corners[i].radius
        arc = radius * min(MAX_TURN_RAD, 2.0 * math.atan(corners[i].tangent / radius))
        for sign, max_slope in ((1.0, climb), (-1.0, dive)):
            if (
                spare_arc_length(path[i - 1], path[i], path[i + 1], radius, sign, max_slope)
                < (1.0 - STEEP_FRACTION) * arc
            ):
                flown.steep_radii[i] = radius


@inner
def spare_arc_length(
    previous: Floats, waypoint: Floats, next_waypoint: Floats, radius: float, sign: float, max_slope: float
) -> float:
    """Return how much longer a corner's arc is than its climb or descent needs, m; negative if too short.

    previous, waypoint, next_waypoint: (3,) m.
    radius: radius of the arc, m.
    sign: 1 for a climb, -1 for a descent.
    max_slope: tangent of the maximum slope.

    The slope of the arc is defined as in `aircraft.path_limits.arc_slope`.
    """
    length_in, length_out = _horizontal_length(previous, waypoint), _horizontal_length(waypoint, next_waypoint)
    ux = waypoint[0] - previous[0]
    uy = waypoint[1] - previous[1]
    vx = next_waypoint[0] - waypoint[0]
    vy = next_waypoint[1] - waypoint[1]
    turn = min(MAX_TURN_RAD, math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy))
    altitude_change = (
        radius
        * math.tan(0.5 * turn)
        * ((waypoint[2] - previous[2]) / length_in + (next_waypoint[2] - waypoint[2]) / length_out)
    )
    return radius * turn - sign * altitude_change / max_slope


@inner
def leg_index(sample: int) -> int:
    """Return 0 for a sample of a corner on the leg before the corner, 1 for one on the leg after it."""
    return 2 * sample // SAMPLES_PER_CORNER


@inner
def _horizontal_length(start: Floats, end: Floats) -> float:
    """Return the horizontal distance between two points, at least 1 mm, m."""
    return max(1e-3, math.hypot(end[0] - start[0], end[1] - start[1]))


@inner
def height_above_required(data: ProblemArrays, limits: PrecomputedLimits, point: Floats) -> float:
    """Return the height of a point (3,) above the lowest altitude allowed there, m; NaN off the terrain."""
    column, row = polymap(data.to_pixel, point[0], point[1])
    ground: float = pixel_height(data.heights, column, row)
    return point[2] - ground - clearance_at(limits.required, point[0], point[1])


@inner
def corner_point(
    data: ProblemArrays,
    previous_waypoint: Floats,
    waypoint: Floats,
    next_waypoint: Floats,
    radius: float,
    sample: int,
    out: Floats,
) -> None:
    """Fill `out` (3,) with the position of a sample of the flown corner at `waypoint`, m.

    previous_waypoint, waypoint, next_waypoint: (3,) m.
    radius: radius of the turn, m.
    sample: number of the sample, from 0 to `SAMPLES_PER_CORNER` - 1.

    With tracking error the samples are on both sides of the two legs, at the altitudes of the legs. Without it they are
    on the arc, whose altitude changes linearly between its tangent points.
    """
    length_in, length_out = _horizontal_length(previous_waypoint, waypoint), _horizontal_length(waypoint, next_waypoint)
    ux, uy = (waypoint[0] - previous_waypoint[0]) / length_in, (waypoint[1] - previous_waypoint[1]) / length_in
    vx, vy = (next_waypoint[0] - waypoint[0]) / length_out, (next_waypoint[1] - waypoint[1]) / length_out
    slope_in = (waypoint[2] - previous_waypoint[2]) / length_in
    slope_out = (next_waypoint[2] - waypoint[2]) / length_out
    cross = ux * vy - uy * vx
    turn = min(MAX_TURN_RAD, math.atan2(abs(cross), ux * vx + uy * vy))
    if data.tracking.has_error:
        # With a tracking error, samples alternate between both sides of the leg, at the largest deviation.
        speed = math.sqrt(radius * GRAVITY * data.aircraft.tan_max_bank)
        offset, length_before, length_after = corner_deviation(data.tracking, turn, speed)
        tangent = radius * math.tan(0.5 * turn)
        side = offset if sample % 2 == 0 else -offset
        fraction = (sample // 2 % SAMPLES_PER_LEG) / (SAMPLES_PER_LEG - 1.0)
        if leg_index(sample) == 0:
            along = -fraction * min(length_in, max(tangent, length_before))
            out[0], out[1] = waypoint[0] + ux * along - uy * side, waypoint[1] + uy * along + ux * side
            out[2] = waypoint[2] + along * slope_in
        else:
            along = fraction * min(length_out, max(tangent, length_after))
            out[0], out[1] = waypoint[0] + vx * along - vy * side, waypoint[1] + vy * along + vx * side
            out[2] = waypoint[2] + along * slope_out
        return
    # Without a tracking error, samples are on the arc.
    fraction = (sample + 1.0) / (SAMPLES_PER_CORNER + 1.0)
    tangent, side = radius * math.tan(0.5 * turn), 1.0 if cross >= 0.0 else -1.0
    # The middles of the chords are this far from the centre; the arc is further.
    chord_radius = radius * math.cos(0.5 * ARC_STEP)
    along = chord_radius * math.sin(fraction * turn) - tangent
    offset = side * (radius - chord_radius * math.cos(fraction * turn))
    out[0], out[1] = waypoint[0] + ux * along - uy * offset, waypoint[1] + uy * along + ux * offset
    out[2] = waypoint[2] - tangent * slope_in + fraction * tangent * (slope_in + slope_out)


@inner
def corner_derivatives(
    data: ProblemArrays, corner: Floats, radius: float, sample: int, gradient: Floats, point: Floats, slopes: Floats
) -> None:
    """Fill `slopes` with the derivatives of a value at a corner's sample by the corner's three waypoints.

    corner: (3, 3) the waypoints, m; changed during the computation, and restored.
    radius: radius of the arc, m.
    sample: number of the sample, as in `corner_point`.
    gradient: (3,) derivatives of the value with respect to the position of the sample.
    point: working memory, (3,).
    slopes: (3, 3) array to fill: row i is for waypoint i.

    A waypoint that moves also moves the sample, which changes the value (chain rule). The motion of the sample is
    computed by central differences with the step `CORNER_STEP_M`.
    """
    for row in range(3):
        for axis in range(3):
            coordinate, slopes[row, axis] = corner[row, axis], 0.0
            for sign in (1.0, -1.0):
                corner[row, axis] = coordinate + sign * CORNER_STEP_M
                corner_point(data, corner[0], corner[1], corner[2], radius, sample, point)
                for k in range(3):
                    slopes[row, axis] += sign * gradient[k] * point[k] / (2.0 * CORNER_STEP_M)
            corner[row, axis] = coordinate


@inner
def spare_length_derivatives(corner: Floats, radius: float, sign: float, max_slope: float, slopes: Floats) -> None:
    """Fill `slopes` (3, 3) with the derivatives of `spare_arc_length`: a row for each waypoint.

    corner: (3, 3) the waypoints, m; changed during the computation, and restored.
    radius: radius of the arc, m.
    sign: 1 for a climb, -1 for a descent.
    max_slope: tangent of the maximum slope.

    The derivatives are central differences with the step `CORNER_STEP_M`.
    """
    for row in range(3):
        for axis in range(3):
            coordinate, slopes[row, axis] = corner[row, axis], 0.0
            for direction in (1.0, -1.0):
                corner[row, axis] = coordinate + direction * CORNER_STEP_M
                value = spare_arc_length(corner[0], corner[1], corner[2], radius, sign, max_slope)
                slopes[row, axis] += direction * value / (2.0 * CORNER_STEP_M)
            corner[row, axis] = coordinate


@inner
def height_derivatives(data: ProblemArrays, x: float, y: float, out: Floats) -> None:
    """Fill `out` (3,) with the derivatives of the height above ground with respect to a point's position.

    x, y: east and north of the point, m.

    The derivatives by east and north are central differences of the ground with the step `GROUND_STEP_M`. They are 0 if
    the ground nearby is unknown.
    """
    heights, to_pixel = data.heights, data.to_pixel
    column, row = polymap(to_pixel, x + GROUND_STEP_M, y)
    ground_height = pixel_height(heights, column, row)
    column, row = polymap(to_pixel, x - GROUND_STEP_M, y)
    by_east = (ground_height - pixel_height(heights, column, row)) / (2.0 * GROUND_STEP_M)
    column, row = polymap(to_pixel, x, y + GROUND_STEP_M)
    ground_height = pixel_height(heights, column, row)
    column, row = polymap(to_pixel, x, y - GROUND_STEP_M)
    by_north = (ground_height - pixel_height(heights, column, row)) / (2.0 * GROUND_STEP_M)
    out[0], out[1], out[2] = -by_east, -by_north, 1.0
    if math.isnan(by_east + by_north):
        out[0], out[1] = 0.0, 0.0
