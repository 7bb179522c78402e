"""Compute the distances within which a waypoint counts as reached and a leg as followed."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from aircraft.path_limits import turn_radius_between
from flight.guidance.navigation_error import ERRORS
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    leg_performance,
    sharpest_fly_over_turn,
    slope_limit,
    tighter_turn_limit,
    turn_requirements,
)
from logs.verdict.tolerances import (
    FLY_OVER_SWING_RATIO,
    KINK_FRACTION,
    KINK_WAYPOINT_COUNT,
    LOITER_SWING_RADII,
    MIN_LEG_LENGTH_M,
    NAVIGATION_SIGMAS,
    NEGLIGIBLE_STEP_M,
    PLAN_TOLERANCE_RAD,
    WAYPOINT_PASS_MARGIN_M,
)
from world.arrays import Floats


def acceptance_limit(requirements: RouteRequirements, waypoint: int) -> tuple[float, str]:
    """Return the distance within which a waypoint is reached, m, and the source of this limit.

    The source is "mission" for the item's own acceptance radius, and "autopilot" for the autopilot's radius.  For an
    autopilot that follows the path, it is "fly-over" or "fly-by path"; the limit is then the distance at which the path
    passes the waypoint plus `WAYPOINT_PASS_MARGIN_M`.

    ArduPlane turns to the next leg at WP_RADIUS before a corner of 90 degrees or more, and at a fraction of WP_RADIUS
    before a gentler corner. The full WP_RADIUS is allowed at the mission's end and where a return to launch begins.
    """
    setup = requirements.setup
    mission_radius = float(setup.route.points["acceptance_radius"][waypoint])
    if mission_radius > 0.0:
        return mission_radius, "mission"
    if not setup.autopilot.turns.follows_path:
        is_inner = 0 < waypoint < requirements.legs and waypoint != setup.route.rtl_start
        turn = abs(float(requirements.turns[waypoint])) if is_inner else math.pi
        return setup.autopilot.turns.distance(turn, float(requirements.points[waypoint, 2])), "autopilot"
    path_radius = float(requirements.fly_by_offset[waypoint]) + WAYPOINT_PASS_MARGIN_M
    return path_radius, "fly-over" if setup.route.fly_over[waypoint] else "fly-by path"


def position_error(setup: FlightSetup) -> float:
    """Return the assumed maximum navigation error: three standard deviations on one axis, m."""
    return NAVIGATION_SIGMAS * ERRORS[setup.nav][0]


def turn_deviations(requirements: RouteRequirements, leg: int) -> Floats:
    """Return the largest distance of the planned turns at a leg's start and end from the legs, m, (2,).

    A fly-by arc passes R (1 - cos(turn / 2)) inside the legs.  A fly-over waypoint is passed on the course of the leg
    before it, and the arc from there swings R (1 - cos(turn)) beyond the next leg.
    """
    ends = slice(leg, leg + 2)
    turns, radius = np.abs(requirements.turns[ends]), requirements.radius[ends]
    depth_ratio = np.where(requirements.setup.route.fly_over[ends], 1.0 - np.cos(turns), 1.0 - np.cos(0.5 * turns))
    return np.where(np.isfinite(radius), radius, 0.0) * depth_ratio


def corridor_limit(requirements: RouteRequirements, leg: int) -> tuple[float, str]:
    """Return the half width (m) of the corridor along a leg, and the name of its source.

    The source is "scenario", "circle" (a loiter), "fly-by path" (the planned turns), "default" or "autopilot".
    Without a corridor in the scenario, the half width allows the planned turns at the leg's ends.  If the autopilot
    steers to the center of a loiter at the leg's end, the corridor includes the whole loiter and a turn back next to
    it.
    """
    half_width = requirements.setup.corridor
    if requirements.setup.scenario.limits.corridor_m is not None:
        return half_width, "scenario"
    ends = slice(leg, leg + 2)
    depths = turn_deviations(requirements, leg)
    imported_log = requirements.setup.imported_log
    radius_is_known = imported_log is None or imported_log.aircraft_known
    if radius_is_known and not requirements.setup.autopilot.turns.follows_path:
        # The autopilot may turn as late as at the waypoint.  Without a named aircraft the turn radius is an estimate.
        radius = np.where(requirements.setup.route.arc_radii[ends] == 0.0, requirements.radius[ends], 0.0)
        swings = np.where(np.isfinite(radius), radius, 0.0) * (1.0 - np.cos(requirements.turns[ends]))
        depths = np.maximum(depths, FLY_OVER_SWING_RATIO * swings)
    turn_width = float(depths.max()) + WAYPOINT_PASS_MARGIN_M
    if requirements.setup.autopilot.loiters.steers_to_center:
        arcs = requirements.setup.route.arc_radii[ends]
        tightest = requirements.min_radius[ends]
        turn_radius = float(np.where(np.isfinite(tightest), tightest, 0.0).max())
        # In a loiter that is too tight for the bank limit, the aircraft swings as widely as the bank limit demands.
        loiter_radius = float(arcs.max())
        loiter_width = (
            loiter_radius
            + (LOITER_SWING_RADII * turn_radius if loiter_radius < turn_radius else loiter_radius + turn_radius)
            + WAYPOINT_PASS_MARGIN_M
        )
        if arcs.any() and loiter_width > max(turn_width, half_width):
            return loiter_width, "circle"
    if turn_width > half_width:
        return turn_width, "fly-by path"
    return half_width, "default" if requirements.setup.autopilot.turns.follows_path else "autopilot"


def farthest_from_legs(points: Floats, legs: Floats) -> tuple[float, int]:
    """Return the maximum horizontal distance (m) of any point from its nearest leg, and the point's row.

    points: m, (n, 3).
    legs: ends of k consecutive legs, m, (k + 1, 3).

    >>> legs = np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 0.0], [100.0, 100.0, 0.0]])
    >>> farthest_from_legs(np.array([[5.0, 50.0, 0.0], [30.0, 60.0, 0.0], [50.0, 93.0, 0.0]]), legs)
    (30.0, 1)
    """
    min_squared_distances = np.full(len(points), math.inf)
    for start, end in zip(legs[:-1, :2], legs[1:, :2], strict=True):
        leg_vector, offsets = end - start, points[:, :2] - start
        fractions = np.clip(offsets @ leg_vector / max(float(leg_vector @ leg_vector), 1e-12), 0.0, 1.0)
        east, north = (offsets[:, axis] - fractions * leg_vector[axis] for axis in range(2))
        min_squared_distances = np.minimum(min_squared_distances, east * east + north * north)
    row = int(np.argmax(min_squared_distances))
    return math.sqrt(float(min_squared_distances[row])), row


# ----------------------------------------------------------------------
# Corners and altitude steps that need not be flown as drawn, because a path without them is practically the same.
#
# A sidestep of a few metres has two right angles without room for a turn, but a straight path passes within metres of
# both.  A step of a few metres in altitude is a vertical leg, but a climb that begins a little early misses it only by
# its height.


def negligible_kink_distance(requirements: RouteRequirements, waypoint: int) -> float | None:
    """Return the distance of a waypoint from a shortcut past it, m, or None if no shortcut is flyable.

    An aircraft that cannot fly the corner at the waypoint as drawn can fly the shortcut instead: a straight leg that
    omits the waypoint and up to `KINK_WAYPOINT_COUNT` - 1 of its neighbours.  If it omits several waypoints, the
    distance of the farthest one is returned.  Shortcuts that omit fewer waypoints are tried first.
    """
    for count in range(1, KINK_WAYPOINT_COUNT + 1):
        for first in range(max(1, waypoint - count + 1), min(waypoint, requirements.legs - count) + 1):
            ends = first, first + count - 1
            if ends not in requirements.shortcuts:
                requirements.shortcuts[ends] = shortcut_distance(requirements, *ends)
            if (distance := requirements.shortcuts[ends]) is not None:
                return distance
    return None


def shortcut_distance(requirements: RouteRequirements, first: int, last: int) -> float | None:
    """Return the largest distance of waypoints `first` to `last` from the straight leg that omits them, m.

    Return None if the distance exceeds `KINK_FRACTION` of the corridor's half width, if a waypoint belongs to a loiter,
    if the leg has no length, or if there is no room for the turns at its ends.
    """
    start, *omitted, end = requirements.points[first - 1 : last + 2, :2].tolist()
    if start == end:
        return None
    # For one point, this is ten times faster than `farthest_from_legs`.
    distance, leg_east, leg_north = 0.0, end[0] - start[0], end[1] - start[1]
    for point in omitted:
        east, north = point[0] - start[0], point[1] - start[1]
        fraction = (east * leg_east + north * leg_north) / max(leg_east * leg_east + leg_north * leg_north, 1e-12)
        fraction = min(1.0, max(0.0, fraction))
        distance = max(distance, math.hypot(east - fraction * leg_east, north - fraction * leg_north))
    if (
        distance > KINK_FRACTION * requirements.setup.corridor
        or requirements.setup.route.arc_radii[first : last + 1].any()
        or not _shortcut_fits(requirements, first, last)
    ):
        return None
    return distance


def _shortcut_fits(requirements: RouteRequirements, first: int, last: int) -> bool:
    """Return True if a leg that omits the waypoints `first` to `last` fits the route.

    The turns at both of its ends must fit.
    """
    previous_corner, next_corner = first - 1, last + 1
    if not (
        _turn_fits_alone(requirements, previous_corner - 1, previous_corner, next_corner)
        and _turn_fits_alone(requirements, previous_corner, next_corner, next_corner + 1)
    ):
        return False
    # Include the next turns on both sides, because they use part of the legs.
    start, end = max(0, first - 3), min(len(requirements.points), last + 4)
    # Each new leg has the airspeed of the original leg that begins at the same waypoint.
    route = requirements.setup.route
    waypoints = np.r_[start:first, next_corner:end]
    points = route.points[waypoints]
    points["airspeed"][1:] = route.leg_airspeeds[waypoints[:-1]]
    nearby_route = replace(route, points=points)
    turns = turn_requirements(nearby_route, leg_performance(requirements.limits))
    for new_corner, old_corner in ((previous_corner - start, previous_corner), (first - start, next_corner)):
        if not 0 < old_corner < requirements.legs:
            continue
        limit, _ = tighter_turn_limit(requirements, old_corner, float(turns.limit[new_corner]))
        if abs(float(turns.turns[new_corner])) > limit + PLAN_TOLERANCE_RAD:
            return False
    return True


def _turn_fits_alone(requirements: RouteRequirements, before: int, corner: int, after: int) -> bool:
    """Return True if the turn at `corner` fits the straight legs from `before` and to `after`.

    Neighbouring turns are ignored.  This necessary condition is ten times faster than the full check of
    `_shortcut_fits`.  The first and the last waypoint of the route have no turn.
    before, corner, after: waypoints.
    """
    route = requirements.setup.route
    if not 0 < corner < requirements.legs:
        return True
    points = [requirements.points[index].tolist() for index in (before, corner, after)]
    (run_in, course_in), (run_out, course_out) = (
        (math.dist(start[:2], end[:2]), math.atan2(end[0] - start[0], end[1] - start[1]))
        for start, end in pairwise(points)
    )
    if run_in == 0.0 or run_out == 0.0:
        # A vertical leg has no course.
        return True
    table = requirements.limits.performance(float(max(route.leg_airspeeds[before], route.leg_airspeeds[corner])))
    radius = turn_radius_between(table, course_in, course_out, points[1][2])
    if not math.isfinite(radius):
        aircraft_limit = 0.0
    elif route.fly_over[corner]:
        aircraft_limit = sharpest_fly_over_turn(run_out / radius)
    else:
        aircraft_limit = 2.0 * math.atan(min(run_in, run_out) / radius)
    limit, _ = tighter_turn_limit(requirements, corner, aircraft_limit)
    return abs(math.remainder(course_out - course_in, 2.0 * math.pi)) <= limit + PLAN_TOLERANCE_RAD


def negligible_step_height(requirements: RouteRequirements, leg: int) -> float | None:
    """Return the altitude change of a too steep leg if it is negligible, m; otherwise None.

    The returned change is positive, even in a descent.  A change of up to `NEGLIGIBLE_STEP_M` is negligible.  If a
    sequence of legs around the leg is too steep overall, the altitude change of the whole sequence is used.
    """
    limit, _ = slope_limit(requirements, leg)
    sign = 1.0 if requirements.slopes[leg] >= 0.0 else -1.0
    height_changes = sign * np.diff(requirements.points[:, 2])
    max_step = float(height_changes[leg])
    for first in range(leg, max(-1, leg - KINK_WAYPOINT_COUNT), -1):
        for last in range(leg, min(requirements.legs, leg + KINK_WAYPOINT_COUNT)):
            height_change = float(height_changes[first : last + 1].sum())
            distance = float(requirements.runs[first : last + 1].sum())
            if math.atan2(height_change, distance) > limit + PLAN_TOLERANCE_RAD:
                max_step = max(max_step, height_change)
    return max_step if max_step <= NEGLIGIBLE_STEP_M else None


def slope_with_next_leg(requirements: RouteRequirements, leg: int) -> float | None:
    """Return the slope of a vertical leg and the next leg flown as one, rad, positive for a climb.

    Where an item repeats the position of the item before it, ArduPlane passes both at once, whatever their altitudes
    (`verify_nav_wp`).  The aircraft then climbs or descends along the next leg, below or above the line of that leg.
    PX4 passes the second item only within its altitude tolerance, and otherwise circles.

    Return None if the leg is judged as drawn: a leg that is not vertical, the first or last leg, a loiter, a leg of an
    autopilot that follows the path or would circle, and a change of altitude that is too steep for the next leg.
    """
    autopilot, points, next_leg = requirements.setup.autopilot, requirements.points, leg + 1
    if (
        not 0 < leg < requirements.legs - 1
        or requirements.runs[leg] >= MIN_LEG_LENGTH_M
        or requirements.runs[next_leg] < MIN_LEG_LENGTH_M
        or requirements.setup.route.arc_radii[leg : leg + 2].any()
        or autopilot.turns.follows_path
    ):
        return None
    climb = float(points[next_leg, 2] - points[leg, 2])
    if climb == 0.0 or (autopilot.deviations.altitude_parameter and abs(climb) > autopilot.loiters.altitude_tolerance):
        return None
    slope = math.atan2(float(points[next_leg + 1, 2] - points[leg, 2]), float(requirements.runs[next_leg]))
    limit = slope_limit(requirements, next_leg, is_climb=slope >= 0.0)[0]
    return slope if abs(slope) <= limit + PLAN_TOLERANCE_RAD else None
