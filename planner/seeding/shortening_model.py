"""Compute the augmented Lagrangian of a path's length, with gradient and Hessian.

It is used by `planner.seeding.shortening`.

The method of multipliers of Hestenes and Powell, in the form for inequalities of Rockafellar ("The multiplier method of
Hestenes and Powell applied to convex programming", Journal of Optimization Theory and Applications 12, 1973): a
constraint c >= 0 with multiplier m adds (max(0, m - p c)^2 - m^2) / 2 p to the length, and m becomes max(0, m - p c).
Constraints are distances from missiles, heights above ground, slopes, turns, and lengths of legs against their turns;
and, if requested, heights and slopes of flown corners (`planner.seeding.flown_corners`).
Their coefficients are computed once per round (`ActiveConstraints`). The Hessian omits the curvature of the
constraints; a constraint couples at most four consecutive waypoints, so the Hessian is banded.
"""

import math
from typing import NamedTuple

import numpy as np

from planner.evaluation.corners import (
    CORNER,
    LEG,
    SETTLING_FRACTION,
    SETTLING_LENGTH_M,
    courses_at_waypoint,
    measure_corner,
    measure_corners,
    measure_legs,
    roll_length,
    turn_length,
)
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits, slope_limits
from planner.evaluation.problem import ProblemArrays, clearance_at
from planner.evaluation.terrain_clearance import HEIGHT_LAG, compute_height_lags
from planner.evaluation.travel_cost import LegModel, model_leg
from planner.seeding.flown_corners import (
    NEAR_GROUND_HEIGHT_M,
    SAMPLES_PER_CORNER,
    FlownCorners,
    corner_derivatives,
    corner_point,
    corners_near_ground,
    height_above_required,
    height_derivatives,
    leg_index,
    no_corners,
    spare_arc_length,
    spare_length_derivatives,
)
from world.arrays import Floats, Ints
from world.frames import polymap
from world.kernels import Records, copy_into, inner
from world.terrain import pixel_height

# --- Active constraints of a round ---


# A sphere constrains the legs that come within this distance of its surface, m.
NEARBY_DISTANCE_M = 250.0
# Smallest turn, rad; smaller turns are measured at it.
MIN_TURN_RAD = 0.2
# Largest turn whose tangent of half the turn is taken, rad.
MAX_TURN_RAD = 3.0
# Upper limit on the length that a turn takes of a leg, m.
MAX_TURN_LENGTH_M = 1e4


class ActiveConstraints(NamedTuple):
    """Constraints of a path of w waypoints, with coefficients that are fixed for a round.

    pairs: (p, 2) indices of a leg and of a missile near it.
    distances: (p,) required distance of the leg from the missile's centre, m.
    samples: number of ground samples on each leg.
    low: (w - 1,) height that a leg requires in addition to the clearance, m.
    climb, dive: (w - 1,) tangents of the slope limits.
    before, after: (w,) lengths (m) that a turn takes of the legs before and after it, divided by the tangent of half
        the turn.
    roll: (w - 1,) length of a leg taken by the roll between turns to opposite sides, m.
    turns_in_legs: True if legs must be as long as their turns.
    turn_margin: spare length that a leg must have in addition to its turns, m.
    flown: the corners that are flown near the ground, or almost as steeply as can be.
    """

    pairs: Ints
    distances: Floats
    samples: int
    low: Floats
    climb: Floats
    dive: Floats
    before: Floats
    after: Floats
    roll: Floats
    turns_in_legs: bool
    turn_margin: float
    flown: FlownCorners


@inner
def active_constraints(
    data: ProblemArrays, path: Floats, samples: int, extra_margin: float, corners_too: bool
) -> ActiveConstraints:
    """Find the constraints that are active near a path (w, 3), and compute their coefficients.

    samples: number of ground samples on each leg.
    extra_margin: additional margin to spheres and ground, m.
    corners_too: True to also constrain the height and slope of flown corners. Each leg is then longer than its turns by
        at least twice the additional margin.
    """
    limits = precompute_limits(data)
    count = path.shape[0] - 1
    legs, corners, lags = np.zeros(count, dtype=LEG), np.zeros(count + 1, dtype=CORNER), np.zeros(count, HEIGHT_LAG)
    measure_legs(path, legs)
    measure_corners(data, limits.wind, path, legs, corners)
    if data.tracking.has_error:
        compute_height_lags(data.tracking, data.aircraft, limits.wind, path, legs, lags)
    extra_heights = np.zeros(count)
    climb = np.zeros(count)
    dive = np.zeros(count)
    roll = np.zeros(count)
    for i in range(count):
        max_climb, max_dive = slope_limits(data, path[i], path[i + 1])
        climb[i], dive[i] = math.tan(max_climb), math.tan(max_dive)
        extra_heights[i] = extra_margin + lags[i].max_below
        if data.legs_hold_turns and not data.fly_over:
            altitude = min(path[i, 2], path[i + 1, 2])
            roll[i] = roll_length(data.aircraft, legs, corners, i, altitude, limits.wind)
    before, after = np.zeros(count + 1), np.zeros(count + 1)
    if data.legs_hold_turns:
        _fill_turn_lengths(data, limits, path, legs, before, after)
    pairs, distances = _find_near_missiles(data, path, corners, lags, extra_margin)
    flown = no_corners(path.shape[0], extra_margin)
    turn_settings = data.legs_hold_turns, TURN_MARGIN_M
    if corners_too:
        flown = corners_near_ground(data, limits, path, corners, lags, extra_margin)
        turn_settings = data.legs_hold_turns, max(TURN_MARGIN_M, 2.0 * extra_margin)
    return ActiveConstraints(
        pairs, distances, samples, extra_heights, climb, dive, before, after, roll, *turn_settings, flown
    )


@inner
def _fill_turn_lengths(
    data: ProblemArrays, limits: PrecomputedLimits, path: Floats, legs: Records, before: Floats, after: Floats
) -> None:
    """Fill `before` and `after` (w,) with the lengths of the legs that the turn at each waypoint takes up.

    path: (w, 3) m.
    legs: filled `LEG` records (w - 1,) of the path.

    Each length (m) is divided by the tangent of half the turn. The quotient changes little with the turn, so that it
    can stay fixed in a round.
    """
    corners = np.zeros(1, dtype=CORNER)
    for i in range(path.shape[0]):
        ux, uy, vx, vy = courses_at_waypoint(data, legs, i)
        cross, dot = ux * vy - uy * vx, ux * vx + uy * vy
        turn = math.atan2(abs(cross), dot)
        if i in (0, path.shape[0] - 1) and turn == 0.0:
            continue
        if turn < MIN_TURN_RAD:
            turn = MIN_TURN_RAD
            sine = math.sin(turn) if cross >= 0.0 else -math.sin(turn)
            vx, vy = ux * math.cos(turn) - uy * sine, uy * math.cos(turn) + ux * sine
        measure_corner(data.aircraft, data.tracking, limits.wind, True, ux, uy, vx, vy, path[i, 2], corners[0])
        half_turn_tangent = math.tan(0.5 * min(turn, MAX_TURN_RAD))
        before[i] = min(MAX_TURN_LENGTH_M, corners[0].before) / half_turn_tangent
        after[i] = min(MAX_TURN_LENGTH_M, corners[0].after) / half_turn_tangent
        if data.fly_over:
            before[i], after[i] = 0.0, min(MAX_TURN_LENGTH_M, turn_length(True, corners, 0)) / half_turn_tangent


@inner
def _find_near_missiles(
    data: ProblemArrays, path: Floats, corners: Records, lags: Records, extra_margin: float
) -> tuple[Ints, Floats]:
    """Return pairs (p, 2) of a leg and a missile near it, and the distance required in each pair, (p,) m.

    path: (w, 3) m.
    corners: filled `CORNER` records (w,) of the path.
    lags: filled `HEIGHT_LAG` records (w - 1,) of the path.
    extra_margin: additional margin to spheres, m.

    Distances are measured from the centre of a sphere. The required distance includes the excursion of the flight at a
    near corner, and the altitude lag in the direction of the missile.
    """
    missiles = data.missiles.missiles
    pairs, distances = [(0, 0) for _ in range(0)], [0.0 for _ in range(0)]
    for k in range(missiles.shape[0]):
        missile = missiles[k]
        for i in range(path.shape[0] - 1):
            ax, ay, az = path[i, 0] - missile.east, path[i, 1] - missile.north, path[i, 2] - missile.up
            dx, dy, dz = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 2] - path[i, 2]
            length2 = max(1e-6, dx * dx + dy * dy + dz * dz)
            fraction = min(1.0, max(0.0, -(ax * dx + ay * dy + az * dz) / length2))
            distance = math.sqrt((ax + fraction * dx) ** 2 + (ay + fraction * dy) ** 2 + (az + fraction * dz) ** 2)
            if distance > missile.radius + data.kill_margin + NEARBY_DISTANCE_M:
                continue
            length = math.sqrt(length2)
            # A missile near a corner also needs the excursion of the flight there.
            excursion = 0.0
            if fraction * length < corners[i].after:
                excursion = corners[i].excursion
            if (1.0 - fraction) * length < corners[i + 1].before:
                excursion = max(excursion, corners[i + 1].excursion)
            lag = max(lags[i].max_below, -lags[i].min_below) * abs(az + fraction * dz) / max(distance, 1.0)
            pairs.append((i, k))
            distances.append(missile.radius + data.kill_margin + extra_margin + excursion + lag)
    pair_array, required_distances = np.zeros((len(pairs), 2), dtype=np.int64), np.zeros(len(pairs))
    for p in range(len(pairs)):
        pair_array[p, 0], pair_array[p, 1] = pairs[p]
        required_distances[p] = distances[p]
    return pair_array, required_distances


@inner
def constraint_count(active: ActiveConstraints) -> int:
    """Return the number of constraints in `lagrangian`.

    The constraints are, in this order: pairs of leg and missile, ground samples, slopes and lengths of legs, turns, and
    flown corners.
    """
    legs = active.low.size
    return active.pairs.shape[0] + legs * (active.samples + 4) + (legs + 1) * (3 + SAMPLES_PER_CORNER)


@inner
def carry_multipliers(
    previous_active: ActiveConstraints, multipliers: Floats, next_active: ActiveConstraints
) -> Floats:
    """Return the multipliers (c,) for a new set of active constraints, taken from the previous set.

    Only the pairs of leg and missile differ between the sets. A pair that is in both keeps its multiplier, a new pair
    gets 0.
    """
    new_multipliers = np.zeros(constraint_count(next_active))
    pair_count = next_active.pairs.shape[0]
    previous_pair_count = previous_active.pairs.shape[0]
    copy_into(new_multipliers[pair_count:], multipliers[previous_pair_count:])
    k = 0
    for p in range(pair_count):
        # Both are sorted by missile and leg.
        while k < previous_pair_count and (
            previous_active.pairs[k, 1] < next_active.pairs[p, 1]
            or (
                previous_active.pairs[k, 1] == next_active.pairs[p, 1]
                and previous_active.pairs[k, 0] < next_active.pairs[p, 0]
            )
        ):
            k += 1
        if (
            k < previous_pair_count
            and previous_active.pairs[k, 0] == next_active.pairs[p, 0]
            and previous_active.pairs[k, 1] == next_active.pairs[p, 1]
        ):
            new_multipliers[p] = multipliers[k]
    return new_multipliers


# --- The model ---

# Half bandwidth of the Hessian: three coordinates of each of the four waypoints that a constraint couples.
HESSIAN_HALF_BANDWIDTH = 12
# Scale of turn constraints, m per rad.
TURN_SCALE_M_PER_RAD = 200.0
# Shortest leg, m: slightly more than the scores require.
MIN_LEG_M = 15.0
# Additional margin of slopes, m of height: the accuracy that the last steps reach.
SLOPE_MARGIN = 0.2
# Additional margin of leg lengths between turns, m: the accuracy that the last steps reach.
TURN_MARGIN_M = 1.0


class LagrangianModel(NamedTuple):
    """Derivatives of the augmented Lagrangian by the n coordinates of the inner waypoints.

    gradient: (n,).
    band: (n, `HESSIAN_HALF_BANDWIDTH`) Hessian; [i, k] is the entry of row i and column i - k.
    slopes: (4, 3) derivatives of the constraint that is added next: a row for each waypoint on which it depends.
    """

    gradient: Floats
    band: Floats
    slopes: Floats


@inner
def _add_constraint(
    value: float, first_waypoint: int, waypoint_count: int, multiplier: float, penalty: float, model: LagrangianModel
) -> float:
    """Add a constraint on consecutive waypoints to the model; return its contribution to the Lagrangian.

    value: value of the constraint, m; negative if violated.
    first_waypoint, waypoint_count: the waypoints of the path on which the value depends.
    multiplier: multiplier of the constraint.
    penalty: penalty factor, 1 / m.
    model: its gradient and band are updated. The derivatives of the value by the waypoints are in `model.slopes`.

    The contribution is (max(0, m - p c)^2 - m^2) / 2 p for the multiplier m, the penalty p and the value c. The fixed
    waypoints at the ends of the path have no row in the gradient.
    """
    new_multiplier = multiplier - penalty * value
    if not new_multiplier > 0.0:
        return -multiplier * multiplier / (2.0 * penalty)
    size, first_row = model.gradient.size, 3 * (first_waypoint - 1)
    for offset in range(3 * waypoint_count):
        row = first_row + offset
        if 0 <= row < size:
            model.gradient[row] -= new_multiplier * model.slopes[offset // 3, offset % 3]
            for other_offset in range(offset + 1):
                if first_row + other_offset >= 0:
                    model.band[row, offset - other_offset] += (
                        penalty
                        * model.slopes[offset // 3, offset % 3]
                        * model.slopes[other_offset // 3, other_offset % 3]
                    )
    return (new_multiplier * new_multiplier - multiplier * multiplier) / (2.0 * penalty)


@inner
def _add_length(path: Floats, model: LagrangianModel) -> float:
    """Add the derivatives of the path's length to the model, and return the length, m."""
    total, size, unit = 0.0, model.gradient.size, np.empty(3)
    for i in range(path.shape[0] - 1):
        length = 0.0
        for axis in range(3):
            unit[axis] = path[i + 1, axis] - path[i, axis]
            length += unit[axis] * unit[axis]
        length = max(1e-3, math.sqrt(length))
        total += length
        # Rows of the leg's two ends among the inner waypoints; a fixed end has no row.
        first_row, second_row = 3 * (i - 1), 3 * i
        for axis in range(3):
            unit[axis] /= length
            if first_row >= 0:
                model.gradient[first_row + axis] -= unit[axis]
            if second_row < size:
                model.gradient[second_row + axis] += unit[axis]
        for axis in range(3):
            for other_axis in range(3):
                curvature = ((1.0 if axis == other_axis else 0.0) - unit[axis] * unit[other_axis]) / length
                if first_row >= 0 and other_axis <= axis:
                    model.band[first_row + axis, axis - other_axis] += curvature
                if second_row < size and other_axis <= axis:
                    model.band[second_row + axis, axis - other_axis] += curvature
                if first_row >= 0 and second_row < size:
                    model.band[second_row + axis, 3 + axis - other_axis] -= curvature
    return total


@inner
def _add_travel_cost(data: ProblemArrays, path: Floats, model: LagrangianModel) -> float:
    """Add the derivatives of the path's cost in length, time and energy to the model; return the cost, m."""
    total, size, leg = 0.0, model.gradient.size, LegModel(np.zeros((2, 3)), np.zeros((2, 3, 2, 3)))
    for i in range(path.shape[0] - 1):
        total += model_leg(data.travel, data.aircraft, path[i], path[i + 1], leg)
        first_row = 3 * (i - 1)
        for offset in range(6):
            row = first_row + offset
            if 0 <= row < size:
                model.gradient[row] += leg.slopes[offset // 3, offset % 3]
                for other_offset in range(offset + 1):
                    if first_row + other_offset >= 0:
                        model.band[row, offset - other_offset] += leg.curvature[
                            offset // 3, offset % 3, other_offset // 3, other_offset % 3
                        ]
    return total


@inner
def _add_missiles(
    data: ProblemArrays,
    active: ActiveConstraints,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    model: LagrangianModel,
) -> float:
    """Add the distances between legs and missiles to the model.

    Return their contribution to the Lagrangian.

    path: (w, 3) m.
    multipliers: (c,) multipliers of all constraints.
    values: (c,) values of all constraints; the values of the constraints added here are filled.
    penalty: penalty factor, 1 / m.
    model: gradient and Hessian of the augmented Lagrangian, to which the constraints are added.

    These are the first constraints. Their value is the distance beyond the required distance from the missile, m.
    """
    merit, slopes, missiles = 0.0, model.slopes, data.missiles.missiles
    for p in range(active.pairs.shape[0]):
        i, missile = active.pairs[p, 0], missiles[active.pairs[p, 1]]
        ax, ay, az = path[i, 0] - missile.east, path[i, 1] - missile.north, path[i, 2] - missile.up
        dx, dy, dz = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 2] - path[i, 2]
        length2 = max(1e-6, dx * dx + dy * dy + dz * dz)
        fraction = min(1.0, max(0.0, -(ax * dx + ay * dy + az * dz) / length2))
        ax, ay, az = ax + fraction * dx, ay + fraction * dy, az + fraction * dz
        distance = max(1e-3, math.sqrt(ax * ax + ay * ay + az * az))
        first_slopes = slopes[0]
        first_slopes[0], first_slopes[1], first_slopes[2] = ax / distance, ay / distance, az / distance
        for axis in range(3):
            slopes[1, axis] = fraction * slopes[0, axis]
            slopes[0, axis] *= 1.0 - fraction
        values[p] = distance - active.distances[p]
        merit += _add_constraint(values[p], i, 2, multipliers[p], penalty, model)
    return merit


@inner
def _add_ground(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    active: ActiveConstraints,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    model: LagrangianModel,
    first_number: int,
) -> float:
    """Add a clearance constraint for each ground sample; return their contribution to the Lagrangian.

    path: (w, 3) m.
    multipliers: (c,) multipliers of all constraints.
    values: (c,) values of all constraints; the values of the constraints added here are filled.
    penalty: penalty factor, 1 / m.
    model: gradient and Hessian of the augmented Lagrangian, to which the constraints are added.
    first_number: number of the first of these constraints.

    The value of a constraint is the height above the required clearance, m.
    """
    merit = 0.0
    slopes = model.slopes
    heights = data.heights
    to_pixel = data.to_pixel
    for i in range(path.shape[0] - 1):
        for k in range(active.samples):
            fraction = (k + 1.0) / (active.samples + 1.0)
            x = path[i, 0] + fraction * (path[i + 1, 0] - path[i, 0])
            y = path[i, 1] + fraction * (path[i + 1, 1] - path[i, 1])
            z = path[i, 2] + fraction * (path[i + 1, 2] - path[i, 2])
            column, row = polymap(to_pixel, x, y)
            value = z - pixel_height(heights, column, row) - clearance_at(limits.required, x, y) - active.low[i]
            number = first_number + i * active.samples + k
            values[number] = value
            if multipliers[number] - penalty * value > 0.0:
                height_derivatives(data, x, y, slopes[0])
                for axis in range(3):
                    slopes[1, axis] = fraction * slopes[0, axis]
                    slopes[0, axis] *= 1.0 - fraction
            merit += _add_constraint(value, i, 2, multipliers[number], penalty, model)
    return merit


@inner
def _add_corners(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    flown: FlownCorners,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    model: LagrangianModel,
    first_number: int,
) -> float:
    """Add the heights of flown corners and the lengths of steep arcs; return their contribution.

    flown: the corners that are flown near the ground or almost as steeply as possible; other corners have the radius 0.
    path: (w, 3) m.
    multipliers: (c,) multipliers of all constraints.
    values: (c,) values of all constraints; the values of the constraints added here are filled.
    penalty: penalty factor, 1 / m.
    model: gradient and Hessian of the augmented Lagrangian, to which the constraints are added.
    first_number: number of the first of these constraints.

    A height is measured above the required height (m), a length beyond the length that the arc needs (m).
    """
    merit = 0.0
    point = np.empty(3)
    ground_gradient = np.empty(3)
    corner = np.empty((3, 3))
    for i in range(1, path.shape[0] - 1):
        radius = flown.radii[i]
        for k in range(3):
            copy_into(corner[k], path[i - 1 + k])
        for k in range(SAMPLES_PER_CORNER):
            number = first_number + i * SAMPLES_PER_CORNER + k
            values[number] = NEAR_GROUND_HEIGHT_M
            if radius <= 0.0:
                continue
            corner_point(data, corner[0], corner[1], corner[2], radius, k, point)
            value = height_above_required(data, limits, point) - flown.lowered[i, leg_index(k)]
            values[number] = value
            if multipliers[number] - penalty * value > 0.0:
                height_derivatives(data, point[0], point[1], ground_gradient)
                corner_derivatives(data, corner, radius, k, ground_gradient, point, model.slopes)
            merit += _add_constraint(value, i - 1, 3, multipliers[number], penalty, model)
        for k in range(2):
            number, radius = first_number + path.shape[0] * SAMPLES_PER_CORNER + 2 * i + k, flown.steep_radii[i]
            values[number] = NEAR_GROUND_HEIGHT_M
            if radius <= 0.0:
                continue
            sign, max_slope = 1.0 - 2.0 * k, flown.slopes[i, k]
            value = spare_arc_length(corner[0], corner[1], corner[2], radius, sign, max_slope) - flown.slope_margin
            values[number] = value
            if multipliers[number] - penalty * value > 0.0:
                spare_length_derivatives(corner, radius, sign, max_slope, model.slopes)
            merit += _add_constraint(value, i - 1, 3, multipliers[number], penalty, model)
    return merit


@inner
def _add_slopes(
    active: ActiveConstraints,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    model: LagrangianModel,
    first_number: int,
) -> float:
    """Add the limits on slopes and on lengths of legs; return their contribution to the Lagrangian.

    path: (w, 3) m.
    multipliers: (c,) multipliers of all constraints.
    values: (c,) values of all constraints; the values of the constraints added here are filled.
    penalty: penalty factor, 1 / m.
    model: gradient and Hessian of the augmented Lagrangian, to which the constraints are added.
    first_number: number of the first of these constraints.

    A leg has three constraints on its climb, its descent and its length. The value of a slope constraint is the height
    that could still be climbed or descended (m); the value of a length constraint is the excess over the minimum length
    (m).
    """
    merit, slopes = 0.0, model.slopes
    for i in range(path.shape[0] - 1):
        dx, dy, altitude_change = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 2] - path[i, 2]
        horizontal_length = max(1e-3, math.sqrt(dx * dx + dy * dy))
        # Kind 0 is the climb limit, kind 1 the dive limit, and kind 2 the minimum length.
        for kind in range(3):
            tangent = active.climb[i] if kind == 0 else active.dive[i] if kind == 1 else 1.0
            sign = -1.0 if kind == 0 else 1.0 if kind == 1 else 0.0
            second_slopes = slopes[1]
            second_slopes[0] = tangent * dx / horizontal_length
            second_slopes[1] = tangent * dy / horizontal_length
            second_slopes[2] = sign
            for axis in range(3):
                slopes[0, axis] = -slopes[1, axis]
            number = first_number + 3 * i + kind
            values[number] = (
                tangent * horizontal_length + sign * altitude_change - (MIN_LEG_M if kind == 2 else SLOPE_MARGIN)
            )
            merit += _add_constraint(values[number], i, 2, multipliers[number], penalty, model)
    return merit


@inner
def _add_turns(
    data: ProblemArrays,
    active: ActiveConstraints,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    model: LagrangianModel,
    first_number: int,
) -> float:
    """Add the limits on turns, and on legs that contain them; return their contribution to the Lagrangian.

    path: (w, 3) m.
    multipliers, values: (c,) multipliers and values of all constraints; the values from `first_number` on are filled.
    penalty: penalty factor, 1 / m.
    model: gradient and Hessian, to which the constraints are added.

    The value of a turn is the margin to its limit, scaled to m; the value of a leg is its spare length, m.
    """
    merit, slopes, count = 0.0, model.slopes, path.shape[0] - 1
    turn = np.zeros(count + 1)
    before_derivatives, after_derivatives = np.zeros((count + 1, 2)), np.zeros((count + 1, 2))
    # One constraint per waypoint: the margin of its turn.
    for i in range(count + 1):
        ux, uy = math.sin(data.start_course), math.cos(data.start_course)
        vx, vy = math.sin(data.destination_course), math.cos(data.destination_course)
        if i > 0:
            ux, uy = path[i, 0] - path[i - 1, 0], path[i, 1] - path[i - 1, 1]
        if i < count:
            vx, vy = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        if math.isnan(ux + vx):
            continue
        cross = ux * vy - uy * vx
        turn[i] = math.atan2(abs(cross), ux * vx + uy * vy)
        side, u2, v2 = 1.0 if cross >= 0.0 else -1.0, max(1.0, ux * ux + uy * uy), max(1.0, vx * vx + vy * vy)
        before_derivatives[i, 0], before_derivatives[i, 1] = side * uy / u2, -side * ux / u2
        after_derivatives[i, 0], after_derivatives[i, 1] = -side * vy / v2, side * vx / v2
        slopes[:] = 0.0
        _add_turn_derivatives(before_derivatives[i], after_derivatives[i], -TURN_SCALE_M_PER_RAD, slopes[:3])
        values[first_number + i] = TURN_SCALE_M_PER_RAD * (data.max_turn - turn[i])
        merit += _add_constraint(values[first_number + i], i - 1, 3, multipliers[first_number + i], penalty, model)
    if not active.turns_in_legs:
        return merit
    # One constraint per leg: the length that remains after the turns at its ends, the roll and settling.
    for i in range(count):
        number = first_number + count + 1 + i
        dx, dy = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        horizontal_length = max(1e-3, math.sqrt(dx * dx + dy * dy))
        begin_tangent = math.tan(0.5 * min(MAX_TURN_RAD, turn[i]))
        end_tangent = math.tan(0.5 * min(MAX_TURN_RAD, turn[i + 1]))
        needed_length = active.after[i] * begin_tangent + active.before[i + 1] * end_tangent + active.roll[i]
        slopes[:] = 0.0
        for axis, component in ((0, dx / horizontal_length), (1, dy / horizontal_length)):
            slopes[1, axis] = -(1.0 - SETTLING_FRACTION) * component
            slopes[2, axis] = (1.0 - SETTLING_FRACTION) * component
        begin_slope = -0.5 * active.after[i] * (1.0 + begin_tangent * begin_tangent)
        _add_turn_derivatives(before_derivatives[i], after_derivatives[i], begin_slope, slopes[:3])
        end_slope = -0.5 * active.before[i + 1] * (1.0 + end_tangent * end_tangent)
        _add_turn_derivatives(before_derivatives[i + 1], after_derivatives[i + 1], end_slope, slopes[1:])
        remaining_length = (1.0 - SETTLING_FRACTION) * horizontal_length - needed_length
        values[number] = remaining_length - min(SETTLING_LENGTH_M, needed_length) - active.turn_margin
        merit += _add_constraint(values[number], i - 1, 4, multipliers[number], penalty, model)
    return merit


@inner
def _add_turn_derivatives(before_derivatives: Floats, after_derivatives: Floats, factor: float, slopes: Floats) -> None:
    """Add a multiple of a turn's derivatives by its three waypoints to `slopes`.

    `slopes` has the shape (3, 3), one row per waypoint.

    before_derivatives, after_derivatives: derivatives of the turn with respect to the vectors of the legs before and
        after it, (2,): east and north.
    factor: factor on the derivatives.

    A waypoint changes the legs that end or begin at it.
    """
    for axis in range(2):
        slopes[0, axis] -= factor * before_derivatives[axis]
        slopes[1, axis] += factor * (before_derivatives[axis] - after_derivatives[axis])
        slopes[2, axis] += factor * after_derivatives[axis]


@inner
def lagrangian(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    active: ActiveConstraints,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    model: LagrangianModel,
) -> float:
    """Compute the augmented Lagrangian of a path (w, 3), m, and fill its derivatives.

    multipliers: (c,) multipliers of the constraints.
    values: (c,) array to fill with the values of the constraints, in the order of `constraint_count`.
    penalty: weight of the squared violations, per m.
    model: filled with gradient and Hessian.

    It is the length or cost of the path plus a term for each constraint, which increases with its violation.
    """
    model.gradient[:], model.band[:] = 0.0, 0.0
    first_number = active.pairs.shape[0]
    minimises_length = data.travel.time == 0.0 and data.travel.energy == 0.0
    merit = _add_length(path, model) if minimises_length else _add_travel_cost(data, path, model)
    merit += _add_missiles(data, active, path, multipliers, values, penalty, model)
    merit += _add_ground(data, limits, active, path, multipliers, values, penalty, model, first_number)
    first_number += active.samples * (path.shape[0] - 1)
    merit += _add_slopes(active, path, multipliers, values, penalty, model, first_number)
    first_number += 3 * (path.shape[0] - 1)
    merit += _add_turns(data, active, path, multipliers, values, penalty, model, first_number)
    first_number += 2 * path.shape[0] - 1
    merit += _add_corners(data, limits, active.flown, path, multipliers, values, penalty, model, first_number)
    return merit
