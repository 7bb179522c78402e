"""Lay out a plan's departure and approach.

They lead from home to the first waypoint, and from the last waypoint to the strip.

Both are searched among a few thousand paths of straight legs, shortest first. A path consists of a launch course or a
final, and of corners and laps between it and the plan. A path is accepted if it passes the plan's certificate (turns,
slopes, clearance, missiles, zones, bounds), and if the parts below the certificate's clearance are free, too: the climb
from the ground and the glide to the landing point. If no path is accepted, the plan's certificate reports the best one.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits, aircraft_slopes
from aircraft.tracking import SPEED_RATIOS
from planner.airspace.zone_limits import ZoneMargins, make_airspace
from planner.evaluation.certify import certify
from planner.evaluation.problem import ANGLE_MARGIN_RAD, Problem, make_problem
from planner.plan import GIVEN_WAYPOINTS, Certificate, Plan
from planner.procedures import ClimbOut, DepartureAndApproach, Descent
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.pose_chains import (
    LAP_SIDE_RADII,
    MAX_LAPS,
    MapPoint,
    TurnLengths,
    arc_turn_lengths,
    candidate_chains,
    climb_altitudes,
    descent_altitudes,
    measure_path,
)
from world.airfield import STEEPEST_STRIP_SLOPE, LandingStrip, Launch, strip_slopes
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs
from world.scenario import Scenario
from world.terrain import Terrain

# Slope of departure and approach as a fraction of the aircraft's steepest climb and dive at cruise airspeed; the climb
# of a take-off is at least as steep (MIN_CLIMB of the verdict).
SLOPE_FRACTION = 0.7
# Slope of a glide as a fraction of the steepest dive at the landing airspeed.
GLIDE_SLOPE_FRACTION = 0.85
# Fractions of these slopes that are tried in turn: the arc of a turn is steeper than its legs, by a quarter at a right
# angle.
_SLOPE_FACTORS = (1.0, 0.75, 0.6)
# Height of the end of a take-off above the clearance of the certificate, m.
_CLEARANCE_EXCESS_M = 2.0
# Lowest end of a take-off above home, m.
_MIN_TAKEOFF_HEIGHT_M = 40.0
# Length of the first leg: a factor on the climb to the take-off height, and an additional length, m.
_FIRST_LEG_FACTOR_AND_M = (1.05, 30.0)
# Factors on the length of the first leg that are tried in turn.
_FIRST_LEG_FACTORS = (1.0, 1.7)
# Fraction of the climb at which a take-off is complete; the rest of the leg must hold the turn at its end.
_TAKEOFF_DONE_FRACTION = 0.8
# Slope relative to the air of a slow take-off, with the minimum pitch of 12 degrees and the default dispersions: 52 of
# 60 take-offs of four aircraft were at least as steep.
_SLOW_TAKEOFF_SLOPE = 0.16
# Drift of a take-off, which holds its heading: a fraction of the crosswind times the time of the climb.  The same
# take-offs drifted by 0.4 to 0.9 of it where the crosswind was above 3 m/s.
_DRIFT_FRACTION = 0.8
# Standard deviation of the forecast's wind speed, m/s: 2.5 m/s in 80 % of cases (ICAO Annex 3, Attachment B).
_WIND_FORECAST_ERROR_MPS = 1.95
# Standard deviation of the heights of an elevation file, m: 9.0 m at 90 % in North America (Rodriguez et al.,
# JPL D-31639, 2005), divided by 1.645.
MAP_HEIGHT_SD_M = 5.5
# Error of these heights that an approach allows for, in standard deviations: the ground is higher in one case of
# twenty.
_MAP_HEIGHT_SIGMAS = 1.645
# Distance from home within which terrain is ignored, m (LAUNCH_RUN of the verdict).
_LAUNCH_RUN_M = 50.0
# Required height above ground beyond this distance, as a fraction of the height climbed; at most the clearance.
_CLIMB_CLEARANCE_FRACTION = 0.5
# Spacing of the ground samples under the climb and the glide, m.
_GROUND_SPACING_M = 10.0
# Number of launch courses.
_LAUNCH_COURSE_COUNT = 36
# Number of landing courses if there is no wind.
_LANDING_COURSE_COUNT = 12
# Tailwind above which a launch is penalised, m/s.
_MAX_TAILWIND_MPS = 0.5
# Penalty of a launch with tailwind, m of path length.
_TAILWIND_COST_M = 5000.0
# Lengths of the final that are tried if the scenario states none, m.
_FINAL_LENGTHS_M = (500.0, 600.0, 700.0, 800.0, 900.0, 1000.0, 1200.0, 1500.0, 2000.0)
# Slopes of the final that are tried if the scenario states none, rad.
_FINAL_SLOPES_RAD = tuple(math.radians(slope) for slope in (3.5, 4.0, 4.5, 4.9, 5.5, 6.0, 7.0))
# Steepest glide slope that PX4 accepts, rad; steeper slopes are tried last.
_PX4_MAX_SLOPE_RAD = math.radians(5.0)
# Length of the line-up, in radii of the tightest turn.
_LINE_UP_RADII = 4.0
# Smallest length of the line-up, m.
_MIN_LINE_UP_M = 500.0
# Distance before the landing point within which the glide may meet the ground, m.
_GROUND_CONTACT_ZONE_M = 60.0
# Required height of the glide above ground before this zone, as a fraction of its height over the landing point.
_GLIDE_CLEARANCE_FRACTION = 0.4
# Upper limit of this height, m.
_MAX_GLIDE_CLEARANCE_M = 10.0
# Lowest height of a go-around over home, m.
_MIN_GO_AROUND_HEIGHT_M = 50.0
# Required height of a go-around above ground, m.
_GO_AROUND_CLEARANCE_M = 30.0
# Step of the go-around heights that are tried, m.
_GO_AROUND_STEP_M = 10.0
# Upper limit of the go-around heights that are tried, m.
_MAX_GO_AROUND_HEIGHT_M = 1000.0
# Increase of the ground speed for the length of turns, as a fraction of the wind speed.
_WIND_FRACTION = 0.5
# Maximum number of certified paths for each end.
_MAX_CERTIFIED = 500
# Maximum number of finals that are tried.
_MAX_FINALS = 8


class FinalModel(NamedTuple):
    """Airspeed and slope that the autopilot flies on a final.

    airspeed: true airspeed on the glide, m/s, as a function of tailwind (m/s) and altitude (m AMSL).
    slope: flown slope of the glide, m per m, as a function of four numbers: height over the landing point and distance
    before it (m), tailwind (m/s), and altitude of the landing point (m AMSL).
    """

    airspeed: Callable[[float, float], float]
    slope: Callable[[float, float, float, float], float]


def add_departure_and_approach(
    plan: Plan, limits: Limits, final_model: FinalModel, kept_departure: ClimbOut | None = None
) -> Plan:
    """Add the departure and approach that a scenario requires to its plan, or a problem if there is none.

    limits: limits of the plan.
    final_model: airspeed and slope of the autopilot on a final.
    kept_departure: departure of a plan whose first legs have already been flown.

    The tables `[launch]` and `[landing]` of a scenario require them. Without these tables the plan is returned
    unchanged.
    """
    scenario = plan.scenario
    if scenario.home is None or scenario.terrain is None or (scenario.launch is None and scenario.landing is None):
        return plan
    site = _make_site(plan, limits, scenario.home, scenario.terrain)
    climb = descent = None
    problems: list[str] = []
    if plan.flown_legs:
        climb = kept_departure
    elif scenario.launch is not None:
        climb, reason = _find_departure(site, scenario.launch)
        problems += [f"climb-out: {reason}"] if reason else []
    if scenario.landing is not None:
        # The height reserve grows by the error of the elevation file. The limits already allow for the autopilot's
        # altitude error; both errors are independent and add as squares.
        altitude_error = 0.0 if limits.tracking is None else limits.tracking.up
        added_height = math.hypot(altitude_error, _MAP_HEIGHT_SIGMAS * MAP_HEIGHT_SD_M) - altitude_error
        careful_site = _make_site(
            plan, replace(limits, reserve_height=limits.reserve_height + added_height), scenario.home, scenario.terrain
        )
        descent, reason = _find_approach(careful_site, scenario.landing, final_model)
        if descent is None:
            descent, reason = _find_approach(site, scenario.landing, final_model)
        problems += [f"landing: {reason}"] if reason else []
    certificate = replace(plan.certificate, problems=(*plan.certificate.problems, *problems))
    return replace(plan, procedures=DepartureAndApproach(climb, descent), certificate=certificate)


# ----------------------------------------------------------------------
# Checks of ground, aircraft and airspace that departure and approach share.


@dataclass(frozen=True, slots=True)
class _Site:
    """Plan and surroundings of a departure and an approach, and the problems that certify both.

    limits: limits within which the plan's algorithm plans.
    home: (3,) m, on the ground.
    problem: problem for the parts at or above the required clearance.
    low_problem: problem for the parts below the required clearance, without margins to zones; its certificate is only
        used for distances from missiles and zones.
    turn_radius: radius of the tightest turn, m.
    turn_lengths: lengths that turns take of their legs.
    """

    plan: Plan
    limits: Limits
    home: Floats
    terrain: Terrain
    problem: Problem
    low_problem: Problem
    turn_radius: float
    turn_lengths: TurnLengths

    @property
    def scenario(self) -> Scenario:
        """Scenario of the plan."""
        return self.plan.scenario

    def slopes(self, course: float, amsl: float) -> tuple[float, float]:
        """Return the climb and the dive slope of departures and approaches, m per m, both positive.

        course: rad.
        amsl: altitude, m.

        They are `SLOPE_FRACTION` of the aircraft's steepest slopes, and stay below the limits of the certificate and of
        the scenario.
        """
        certified_slopes = aircraft_slopes(self.problem.certified.aircraft, course, amsl)
        # Slopes stay 1.1 times the angle margin below a limit: the margin of the certificate, and 10 % for rounding.
        stated_limits = (self.limits.max_climb, self.limits.max_dive)
        slopes = []
        for aircraft_slope, certified_slope, stated_limit in zip(
            self.limits.slopes(course, amsl), certified_slopes, stated_limits, strict=True
        ):
            slope = min(
                SLOPE_FRACTION * math.tan(aircraft_slope), math.tan(max(0.0, certified_slope - 1.1 * ANGLE_MARGIN_RAD))
            )
            slopes.append(
                slope if stated_limit is None else min(slope, math.tan(max(0.0, stated_limit - 1.1 * ANGLE_MARGIN_RAD)))
            )
        return slopes[0], slopes[1]

    def min_path_length(self, height_change: float, is_descent: bool) -> float:
        """Return the shortest path length on which the aircraft can change its altitude by a height, m.

        height_change: height to climb or descend, m.
        is_descent: True for a descent.

        The length is inf if the aircraft cannot climb (or descend) on any of eight courses.
        """
        altitude = float(max(self.scenario.start[2], self.scenario.destination[2]))
        max_slope = max(self.slopes(course, altitude)[is_descent] for course in np.arange(8) * (math.pi / 4.0))
        return max(0.0, abs(height_change)) / max_slope if max_slope > 0.0 else math.inf

    def certify_path(self, path: Floats, end_points: tuple[Floats, Floats]) -> Certificate:
        """Certify a path, (n, 3) m, for which the required height is reduced near two points.

        end_points: the two points, (3,) m. The required height is reduced near a point that is itself closer to the
            ground than required.
        """
        data = self.problem.certified
        # Near a low end, three quarters of the available height are required; 1 cm less, against rounding.
        start_buffer, end_buffer = (
            min(data.buffer, 0.75 * max(0.0, self.height_above_ground(point) - data.clearance - 0.01))
            for point in end_points
        )
        relaxed_data = data._replace(
            start=_read_only(end_points[0]),
            destination=_read_only(end_points[1]),
            start_buffer=start_buffer,
            destination_buffer=end_buffer,
            start_course=math.nan,
            destination_course=math.nan,
        )
        return certify(replace(self.problem, certified=relaxed_data), np.ascontiguousarray(path))

    def height_above_ground(self, point: Floats) -> float:
        """Return the height of a point (3,) above ground, m."""
        return float(point[2] - self.terrain.height(point[0], point[1]))

    def describe_obstacle(self, chain: Sequence[Sequence[float]]) -> str:
        """Describe the missile or zone that a path close to the ground enters; "" if it enters none.

        chain: positions of the path, (n, 3) m.
        """
        certificate = certify(self.low_problem, np.array(chain, dtype=np.float64))
        if certificate.kill_distance <= 0.0:
            return f"{-certificate.kill_distance:.0f} m inside a missile's reach"
        return (
            f"{max(0.0, -certificate.zone_distance):.0f} m beyond a zone's edge"
            if certificate.zone_distance <= 0.0
            else ""
        )


def _make_site(plan: Plan, limits: Limits, home: Floats, terrain: Terrain) -> _Site:
    """Make the problems that certify departures and approaches, and measure the size of turns in them.

    plan: plan of the part in the air.
    limits: limits of the path, without those of the planning algorithm.
    home: position of home, (3,) m.
    terrain: ground heights.

    A second problem certifies departures and approaches near the ground: it has neither a clearance nor inclusions with
    a floor.
    """
    scenario = plan.scenario
    algorithm = scenario.planner.algorithm if plan.algorithm == GIVEN_WAYPOINTS else plan.algorithm
    algorithm_limits = limits_for(find_algorithm(algorithm, scenario.name), limits)
    problem = make_problem(scenario, algorithm_limits)
    # An inclusion with a floor begins above the field.
    zones = tuple(zone for zone in scenario.zones if zone.kind == "exclusion" or zone.floor is None)
    low_problem = make_problem(replace(scenario, zones=zones), algorithm_limits)
    edges = make_airspace(low_problem.scenario, ZoneMargins(0.0, 0.0, 1.0), 0.0)
    low_problem = replace(low_problem, certified=low_problem.certified._replace(clearance=-1e5, airspace=edges))
    altitude = float(max(scenario.start[2], scenario.destination[2]))
    turn_radius = max(
        algorithm_limits.turn_radius(course, course + math.pi, altitude) for course in (0.0, 0.5 * math.pi)
    )
    turn_lengths = arc_turn_lengths(turn_radius)
    if (tracking := algorithm_limits.tracking) is not None:
        # An estimate, as ground speeds depend on the course; the certificate decides.
        speed_ratio = 1.0 + _WIND_FRACTION * scenario.wind.speed / algorithm_limits.airspeed
        lengths_before, lengths_after = (
            [float(np.interp(speed_ratio, SPEED_RATIOS, row)) for row in length_table]
            for length_table in (tracking.before, tracking.after)
        )
        turn_lengths = TurnLengths(
            *(
                tuple(map(max, error_lengths, arc_row))
                for error_lengths, arc_row in zip((lengths_before, lengths_after), turn_lengths, strict=True)
            )
        )
    return _Site(plan, algorithm_limits, home, terrain, problem, low_problem, turn_radius, turn_lengths)


def _read_only(position: Floats) -> Floats:
    """Return a read-only copy of a position, because a writable array would make kernels compile again."""
    copy = np.array(position, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def _join_altitudes(points: Sequence[MapPoint], altitudes: Floats) -> Floats:
    """Return the path (n, 3) over n points of the map at altitudes (n,)."""
    return np.column_stack([np.array(points), altitudes])


def _ground_profile(terrain: Terrain, start: MapPoint, course: float, length: float) -> tuple[Floats, Floats]:
    """Return distances along a course, m, and the terrain altitudes there, m AMSL.

    Unknown altitudes are NaN.

    start: east and north of the first point, m.
    course: rad.
    length: length of the profile, m.
    """
    distances = np.arange(0.0, length + _GROUND_SPACING_M, _GROUND_SPACING_M)
    east, north = start[0] + distances * math.sin(course), start[1] + distances * math.cos(course)
    return distances, terrain.height(east, north)


class _BestRejected:
    """Number of rejected paths, and the problem of the best of them, for a message."""

    def __init__(self) -> None:
        """Start without rejected paths."""
        self.count, self._margin, self.problem = 0, -math.inf, ""

    def add(self, certificate: Certificate | None) -> None:
        """Count a rejected path, and keep its problem if it has the largest margin so far.

        certificate: certificate of the path; None is not counted. A path that is rejected although its certificate has
            no problem is inside a missile's reach.
        """
        if certificate is None:
            return
        self.count += 1
        margin = min(certificate.clearance, certificate.kill_distance, certificate.zone_distance, certificate.bounds)
        if not self.problem or margin > self._margin:
            reach_text = f"{-certificate.kill_distance:.0f} m inside a missile's reach"
            self._margin, self.problem = margin, certificate.problems[0] if certificate.problems else reach_text


# ----------------------------------------------------------------------
# Departure.


def _find_departure(site: _Site, launch: Launch) -> tuple[ClimbOut | None, str]:
    """Find the shortest accepted departure; return it and "", or None and the reason why none is accepted.

    site: plan, limits and terrain around home.
    launch: launch of the scenario, which may prescribe a course.

    A departure may circle before it leads to the plan's first waypoint; the smallest number of laps is tried first.
    """
    data, first_waypoint = site.problem.certified, site.plan.waypoints[0]
    home_altitude, start_altitude = float(site.home[2]), float(first_waypoint[2])
    takeoff_height = max(_MIN_TAKEOFF_HEIGHT_M, data.clearance + data.buffer + _CLEARANCE_EXCESS_M)
    takeoff_altitude = home_altitude + takeoff_height
    launches, reason = _find_launches(site, launch, takeoff_height, max(takeoff_altitude, start_altitude))
    if not launches:
        return None, reason
    best_rejected = _BestRejected()
    for laps in _list_lap_counts(site, start_altitude - home_altitude, False):
        for _, course, points in sorted(_list_departures(site, launches, laps), key=lambda path: path[0]):
            outcome = _make_departure(site, course, points, takeoff_altitude)
            if isinstance(outcome, ClimbOut):
                return outcome, ""
            best_rejected.add(outcome)
            if best_rejected.count >= _MAX_CERTIFIED:
                break
    courses = (
        "on the launch course"
        if launch.course is not None
        else f"on {len({candidate.course for candidate in launches})} courses"
    )
    if not best_rejected.count:
        return (
            None,
            f"no departure {courses} is long enough to climb to the start,"
            f" {start_altitude - home_altitude:.0f} m above home",
        )
    return (
        None,
        f"none of {best_rejected.count} departures {courses} is clear; the best departure: {best_rejected.problem}",
    )


def _make_departure(
    site: _Site, course: float, points: list[MapPoint], takeoff_altitude: float
) -> ClimbOut | Certificate | None:
    """Make the departure over some points of the map; return it, or a certificate if it is rejected.

    site: plan, limits and terrain around home.
    course: launch course, rad.
    points: east and north of the departure from home to the first waypoint, m.
    takeoff_altitude: altitude at the end of the take-off, m AMSL.

    It is tried with several climb slopes, the steepest first, until it passes the certificate. If all are rejected, the
    certificate of the last one is returned; None if the path is too short even for the steepest climb.
    """
    next_waypoints, first_waypoint = site.plan.waypoints[1:3], site.plan.waypoints[0]
    goal_altitude, top_altitude = float(first_waypoint[2]), max(takeoff_altitude, float(first_waypoint[2]))
    certificate = None
    for slope_factor in _SLOPE_FACTORS:
        altitudes = climb_altitudes(
            points,
            float(site.home[2]),
            partial(_scale_slope, site, slope_factor, False, top_altitude),
            takeoff_altitude,
            goal_altitude,
        )
        if altitudes[-1] < goal_altitude - 1e-6:
            break
        chain = np.concatenate([_join_altitudes(points, altitudes), next_waypoints])
        certificate = site.certify_path(chain, (first_waypoint, chain[0]))
        if certificate.ok and certificate.kill_distance > 0.0:
            return ClimbOut(
                site.home, course, takeoff_altitude, chain[1 : len(points) - 1], site.slopes(course, top_altitude)[0]
            )
    return certificate


class _Launch(NamedTuple):
    """Launch: course (rad), point where the take-off is complete, and end of the first leg.

    drifted_ends: points where a slow take-off is complete in the weakest and in the strongest expected crosswind.
    """

    course: float
    takeoff_end: MapPoint
    end: MapPoint
    drifted_ends: tuple[MapPoint, ...]

    def fits(self, points: Sequence[MapPoint], turn_lengths: TurnLengths) -> bool:
        """Return True if the first legs are long enough for their turns, also after a take-off that drifts.

        points: home, end of the first leg, and the points after it.
        """
        return all(measure_path([end, *points[1:4]], turn_lengths).fits for end in self.drifted_ends)


def _find_launches(site: _Site, launch: Launch, takeoff_height: float, altitude: float) -> tuple[list[_Launch], str]:
    """Return the launches clear of ground, missiles and zones, and the reason to state if there are none.

    takeoff_height: height above home up to which the launch climbs straight ahead, m.
    altitude: altitude for which the climb performance is computed, m AMSL.

    Each launch course is tried with first legs of several lengths.
    """
    airspeed = site.limits.airspeed
    climb_time = takeoff_height / (_SLOW_TAKEOFF_SLOPE * airspeed)
    courses = (
        [2.0 * math.pi * number / _LAUNCH_COURSE_COUNT for number in range(_LAUNCH_COURSE_COUNT)]
        if launch.course is None
        else [launch.course]
    )
    home, launches, best_rejected = (float(site.home[0]), float(site.home[1])), [], (-math.inf, "")
    for course in courses:
        climb_slope = site.slopes(course, altitude)[0]
        if climb_slope <= 0.0:
            continue
        min_length = takeoff_height / climb_slope * _FIRST_LEG_FACTOR_AND_M[0] + _FIRST_LEG_FACTOR_AND_M[1]
        for length_factor in _FIRST_LEG_FACTORS:
            length = min_length * length_factor
            distances, terrain_heights = _ground_profile(site.terrain, home, course, length)
            heights = climb_slope * distances
            required_heights = np.minimum(site.problem.certified.clearance, _CLIMB_CLEARANCE_FRACTION * heights)
            margins = (site.home[2] + heights - terrain_heights - required_heights)[distances > _LAUNCH_RUN_M]
            course_text = f"{round(math.degrees(course)) % 360}°"
            if np.isnan(margins).any():
                best_rejected = max(best_rejected, (-1e6, f"{course_text} (leads over unknown terrain)"))
                break
            if margins.min() < 0.0:
                worst_margin, worst_index = float(margins.min()), int(np.argmin(margins))
                distance = float(distances[distances > _LAUNCH_RUN_M][worst_index])
                reason = f"{course_text} ({-worst_margin:.0f} m too low above the ground {distance:.0f} m from home)"
                best_rejected = max(best_rejected, (worst_margin, reason))
                break
            east, north = math.sin(course), math.cos(course)
            end = (home[0] + length * east, home[1] + length * north)
            takeoff_distance = _TAKEOFF_DONE_FRACTION * takeoff_height / climb_slope
            home_altitude = float(site.home[2])
            obstacle = site.describe_obstacle([(*home, home_altitude), (*end, home_altitude + climb_slope * length)])
            if obstacle:
                best_rejected = max(best_rejected, (-1e6, f"{course_text} ({obstacle})"))
                break
            takeoff_end = (home[0] + takeoff_distance * east, home[1] + takeoff_distance * north)
            # Ends of a slow take-off in the least and in the strongest expected crosswind.
            tailwind, crosswind = site.scenario.wind.components_on_course(course, home_altitude)
            slow_distance = climb_time * max(1.0, airspeed + tailwind)
            drifts = [
                _DRIFT_FRACTION * climb_time * (crosswind + error)
                for error in (-_WIND_FORECAST_ERROR_MPS, _WIND_FORECAST_ERROR_MPS)
            ]
            drifted_ends = tuple(
                (home[0] + slow_distance * east + drift * north, home[1] + slow_distance * north - drift * east)
                for drift in drifts
            )
            launches.append(_Launch(course, takeoff_end, end, drifted_ends))
    if not launches and not best_rejected[1]:
        course_name = "any course" if launch.course is None else "the launch course"
        return [], f"the aircraft cannot climb on {course_name}"
    subject = "the launch course is" if launch.course is not None else f"none of {len(courses)} launch courses is"
    negation, best_text = ("", "; the best course is ") if launch.course is None else ("not ", ": course ")
    return (
        launches,
        f"{subject} {negation}clear of ground, missiles and zones at {SLOPE_FRACTION:.0%} of the "
        f"steepest climb{best_text}{best_rejected[1]}",
    )


def _list_departures(
    site: _Site, launches: Sequence[_Launch], laps: int
) -> Iterator[tuple[float, float, list[MapPoint]]]:
    """Yield departures from home to the plan's first waypoint: cost (m), launch course (rad) and points.

    site: plan, limits and terrain around home.
    launches: the launches to try, with their courses.
    laps: number of laps in which the aircraft gains height.
    """
    first_waypoint, start_course = site.plan.waypoints[0], site.scenario.start_course
    next_course = float(leg_courses(site.plan.waypoints[:2])[0]) if start_course is None else start_course
    end, home = (float(first_waypoint[0]), float(first_waypoint[1])), (float(site.home[0]), float(site.home[1]))
    next_point = (float(site.plan.waypoints[1, 0]), float(site.plan.waypoints[1, 1]))
    min_length = site.min_path_length(float(first_waypoint[2] - site.home[2]), False) + math.dist(end, next_point)
    for launch in launches:
        course, takeoff_end = launch.course, launch.takeoff_end
        tailwind = site.scenario.wind.components_on_course(course, float(site.home[2]))[0]
        for corners in candidate_chains(launch.end, course, end, next_course, site.turn_radius, laps):
            points = [home, launch.end, *corners, end]
            measures = measure_path([takeoff_end, *points[1:], next_point], site.turn_lengths)
            takeoff_distance = math.dist(home, takeoff_end)
            is_long_enough = measures.fits and takeoff_distance + measures.length >= min_length
            if is_long_enough and launch.fits([*points, next_point], site.turn_lengths):
                yield (
                    takeoff_distance + measures.cost + (_TAILWIND_COST_M if tailwind > _MAX_TAILWIND_MPS else 0.0),
                    course,
                    points,
                )


def _list_lap_counts(site: _Site, height_change: float, is_descent: bool) -> list[int]:
    """Return the numbers of laps to try, in increasing order, for gaining or losing a height.

    height_change: height to gain or lose, m.
    is_descent: True for a descent.
    """
    max_laps = math.ceil(
        site.min_path_length(height_change, is_descent) / _SLOPE_FACTORS[-1] / (4.0 * LAP_SIDE_RADII * site.turn_radius)
    )
    return list(range(min(MAX_LAPS, max_laps) + 1))


# ----------------------------------------------------------------------
# Approach.


class _Final(NamedTuple):
    """Final approach: course (rad), length and height over the landing point (m), and its positions.

    final_waypoints: line-up, (2, 3) m.
    point: landing point, (3,) m.
    """

    course: float
    length: float
    height: float
    final_waypoints: Floats
    point: Floats


def _find_approach(site: _Site, strip: LandingStrip, final_model: FinalModel) -> tuple[Descent | None, str]:
    """Find the first accepted approach; return it and "", or None and the reason why none is accepted.

    site: plan, limits and terrain around the strip.
    strip: landing strip of the scenario.
    final_model: airspeed and slope at which the autopilot flies a final.

    The finals on all landing courses of the strip are tried in turn. An approach is accepted if a path leads from the
    plan's last waypoint to the final, and if a go-around clears the ground.
    """
    field_altitude = float(site.terrain.height(strip.east, strip.north))
    point = np.array([strip.east, strip.north, field_altitude])
    landing_course = strip.landing_course(site.scenario.wind, field_altitude)
    courses = (
        [landing_course]
        if landing_course is not None
        else [2.0 * math.pi * number / _LANDING_COURSE_COUNT for number in range(_LANDING_COURSE_COUNT)]
    )
    finals, reasons = [], []
    for course in courses:
        strip_faults = [
            "the terrain at the ends of the strip is unknown"
            if math.isnan(slope)
            else f"the strip slopes by {abs(slope):.0%} {direction} its course of {round(math.degrees(course)) % 360}°;"
            f" landings are planned on slopes of at most {STEEPEST_STRIP_SLOPE:.0%}"
            for direction, slope in zip(("along", "across"), strip_slopes(site.terrain, strip, course), strict=True)
            if not abs(slope) <= STEEPEST_STRIP_SLOPE
        ]
        if strip_faults:
            reasons.append(strip_faults[0])
            continue
        course_finals, reason = _find_finals(site, strip, course, point, final_model)
        finals += course_finals
        reasons += [reason] if not course_finals else []
    if not finals:
        return None, reasons[0]
    reason = ""
    for final in finals[:_MAX_FINALS]:
        corners, reason = _find_path_to_line_up(site, final)
        if corners is None:
            continue
        go_around = _min_go_around_height(site, final)
        if go_around is None:
            reason = (
                f"no climb height up to {_MAX_GO_AROUND_HEIGHT_M:,.0f} m clears the ground in a go-around on course"
                f" {round(math.degrees(final.course)) % 360}°"
            )
            continue
        return Descent(corners, final.final_waypoints, point, final.course, final.height / final.length, go_around), ""
    return None, reason


def _find_finals(
    site: _Site, strip: LandingStrip, course: float, point: Floats, final_model: FinalModel
) -> tuple[list[_Final], str]:
    """Return the clear and flyable finals on a course, and the reason to state if there are none.

    site: plan, limits and terrain around the strip.
    strip: landing strip, which may prescribe the length (m) and the slope (rad) of the final.
    course: landing course, rad.
    point: landing point, (3,) m.
    final_model: airspeed and slope at which the autopilot flies a final.

    Finals that PX4 accepts come first, then the shortest ones.
    """
    field_altitude = float(point[2])
    tailwind = site.scenario.wind.components_on_course(course, field_altitude)[0]
    max_slope = GLIDE_SLOPE_FRACTION * math.tan(
        site.limits.slopes(course, field_altitude, final_model.airspeed(tailwind, field_altitude))[1]
    )
    lengths = _FINAL_LENGTHS_M if strip.approach is None else (strip.approach,)
    slopes = _FINAL_SLOPES_RAD if strip.slope is None else (strip.slope,)
    pairs = sorted(
        ((final_length, final_slope) for final_length in lengths for final_slope in slopes),
        key=lambda pair: (pair[1] > _PX4_MAX_SLOPE_RAD, pair),
    )
    finals, best_rejected = list[_Final](), (-math.inf, "")
    for length, slope in pairs:
        height = length * math.tan(slope)
        flown_slope = final_model.slope(height, length, tailwind, field_altitude)
        if flown_slope > max_slope:
            flown_deg, max_deg = math.degrees(math.atan(flown_slope)), math.degrees(math.atan(max_slope))
            fault = (
                f"the approach needs a descent angle of {flown_deg:.1f}°, but the steepest that the aircraft can fly is"
                f" {max_deg:.1f}°"
            )
            best_rejected = max(best_rejected, (-1e6, fault))
            continue
        # Start of the line-up leg and start of the glide.
        distances = np.array([length + max(_MIN_LINE_UP_M, _LINE_UP_RADII * site.turn_radius), length])
        east, north = point[0] - distances * math.sin(course), point[1] - distances * math.cos(course)
        final = _Final(course, length, height, np.column_stack([east, north, np.full(2, point[2] + height)]), point)
        margin, obstacle = _check_final(site, final)
        if obstacle:
            best_rejected = max(
                best_rejected, (margin, f"a final approach of {length:.0f} m at {math.degrees(slope):.1f}° {obstacle}")
            )
        else:
            finals.append(final)
    return finals, f"on a course of {round(math.degrees(course)) % 360}°, {best_rejected[1]}"


def _check_final(site: _Site, final: _Final) -> tuple[float, str]:
    """Check a final for ground, missiles and zones; return a margin, m, and a text on its obstacle.

    The margin is 0 and the text "" if the final is clear. Otherwise the margin is at most 0, and the text completes the
    sentence "a final approach ...". The glide must keep its ground clearance, and must be free of missiles and zones at
    all altitudes from the line-up down to the field; the level part before it needs a certificate.
    """
    glide_start, point = final.final_waypoints[1], final.point
    distances, terrain_heights = _ground_profile(
        site.terrain, (float(glide_start[0]), float(glide_start[1])), final.course, final.length
    )
    heights = final.height * (1.0 - distances / final.length)
    margins = (
        float(point[2])
        + heights
        - terrain_heights
        - np.minimum(_MAX_GLIDE_CLEARANCE_M, _GLIDE_CLEARANCE_FRACTION * heights)
    )
    judged_margins = margins[distances <= final.length - _GROUND_CONTACT_ZONE_M]
    if np.isnan(judged_margins).any():
        return -math.inf, "leads over unknown terrain"
    if judged_margins.min(initial=0.0) < 0.0:
        return float(judged_margins.min()), f"is {-float(judged_margins.min()):.0f} m too low above the ground"
    obstacle = site.describe_obstacle([glide_start.tolist(), [float(point[0]), float(point[1]), float(glide_start[2])]])
    obstacle = obstacle or site.describe_obstacle([[*glide_start[:2].tolist(), float(point[2])], point.tolist()])
    if obstacle:
        return -math.inf, f"is {obstacle}"
    point_above = np.array([point[0], point[1], glide_start[2]])
    chain = np.concatenate([final.final_waypoints, point_above[None]])
    certificate = site.certify_path(chain, (chain[0], chain[0]))
    if not certificate.ok:
        return min(certificate.clearance, 0.0) - 1.0, f"is not clear: {certificate.problems[0]}"
    return 0.0, "" if certificate.kill_distance > 0.0 else "is inside a missile's reach"


def _find_path_to_line_up(site: _Site, final: _Final) -> tuple[Floats | None, str]:
    """Find the shortest accepted path from the plan's last waypoint to the line-up of a final.

    Returns the corners between these two points, (n, 3) m, and ""; or None and the reason why no path is accepted.
    """
    waypoints, final_altitude = site.plan.waypoints, float(final.final_waypoints[0, 2])
    last_waypoint, end_altitude = waypoints[-1], float(waypoints[-1, 2])
    destination_course = site.scenario.destination_course
    course = float(leg_courses(waypoints[-2:])[0]) if destination_course is None else destination_course
    start = (float(last_waypoint[0]), float(last_waypoint[1]))
    end = (float(final.final_waypoints[0, 0]), float(final.final_waypoints[0, 1]))
    previous_waypoints = waypoints[-3:-1]
    previous_points = [(float(waypoint[0]), float(waypoint[1])) for waypoint in previous_waypoints]
    glide_start = (float(final.final_waypoints[1, 0]), float(final.final_waypoints[1, 1]))
    best_rejected = _BestRejected()
    point_above = np.array([final.point[0], final.point[1], final_altitude])
    is_descent = final_altitude < end_altitude
    extra_length = math.dist(previous_points[-1], start) + math.dist(end, glide_start)
    extra_length += sum(math.dist(leg_start, leg_end) for leg_start, leg_end in pairwise(previous_points))
    min_length = site.min_path_length(end_altitude - final_altitude, is_descent) + extra_length
    top_altitude = max(end_altitude, final_altitude)
    for laps in _list_lap_counts(site, end_altitude - final_altitude, is_descent):
        paths = [
            [start, *corners, end]
            for corners in candidate_chains(start, course, end, final.course, site.turn_radius, laps)
        ]
        measured_paths = [
            (measure_path([*previous_points, *points, glide_start], site.turn_lengths), points) for points in paths
        ]
        fitting_paths = [
            (measures.cost, points)
            for measures, points in measured_paths
            if measures.fits and measures.length >= min_length
        ]
        for _, points in sorted(fitting_paths):
            for slope_factor in _SLOPE_FACTORS:
                climb, dive = (
                    partial(_scale_slope, site, slope_factor, dives, top_altitude) for dives in (False, True)
                )
                altitudes = descent_altitudes(points, end_altitude, climb, dive, final_altitude)
                if abs(altitudes[0] - end_altitude) > 1e-6 or abs(altitudes[-1] - final_altitude) > 1e-6:
                    break
                path = _join_altitudes(points, altitudes)
                chain = np.concatenate([previous_waypoints, path, final.final_waypoints[1:], point_above[None]])
                certificate = site.certify_path(chain, (last_waypoint, last_waypoint))
                if certificate.ok and certificate.kill_distance > 0.0:
                    return chain[len(previous_waypoints) + 1 : len(previous_waypoints) + len(points) - 1], ""
                best_rejected.add(certificate)
            if best_rejected.count >= _MAX_CERTIFIED:
                break
    route_text = f"from the destination to the final on course {round(math.degrees(final.course)) % 360}°"
    if not best_rejected.count:
        climb_text = f"{abs(end_altitude - final_altitude):.0f} m of {'descent' if is_descent else 'climb'}"
        return None, f"no path {route_text} is long enough for its turns and {climb_text}"
    return (
        None,
        f"none of {best_rejected.count} paths {route_text} is clear; the best path: {best_rejected.problem}."
        " Try a higher destination (height_m) or another strip",
    )


def _scale_slope(site: _Site, factor: float, is_descent: bool, altitude: float, course: float) -> float:
    """Return a fraction of the steepest climb or dive slope on a course, m per m.

    factor: the fraction, 0 to 1.
    is_descent: True for the dive slope.
    altitude: m AMSL.
    course: rad.
    """
    return factor * site.slopes(course, altitude)[is_descent]


def _min_go_around_height(site: _Site, final: _Final) -> float | None:
    """Return the minimum height above home for a go-around, m; None if no height is sufficient.

    The go-around climbs straight ahead from the landing point at `SLOPE_FRACTION` of the steepest climb, and then flies
    back to the line-up.
    """
    home_altitude, field_altitude = float(site.home[2]), float(final.point[2])
    line_up = final.final_waypoints[0]
    # The height must be above the line-up: an aircraft that aborts above the go-around height turns back at once.
    min_height = max(
        _MIN_GO_AROUND_HEIGHT_M,
        field_altitude - home_altitude + _MIN_GO_AROUND_HEIGHT_M,
        float(line_up[2]) - home_altitude + _GO_AROUND_CLEARANCE_M,
    )
    for height in np.arange(
        math.ceil(min_height / _GO_AROUND_STEP_M) * _GO_AROUND_STEP_M, _MAX_GO_AROUND_HEIGHT_M, _GO_AROUND_STEP_M
    ).tolist():
        top_altitude = home_altitude + height
        climb_slope = site.slopes(final.course, top_altitude)[0]
        if climb_slope <= 0.0:
            return None
        distances, terrain_heights = _ground_profile(
            site.terrain,
            (float(final.point[0]), float(final.point[1])),
            final.course,
            (top_altitude - field_altitude) / climb_slope,
        )
        margins = (field_altitude + climb_slope * distances - terrain_heights)[distances > _LAUNCH_RUN_M]
        # Over unknown ground the margin is NaN.
        if not (margins >= 0.0).all():
            continue
        turn_point = np.array(
            [
                final.point[0] + distances[-1] * math.sin(final.course),
                final.point[1] + distances[-1] * math.cos(final.course),
                top_altitude,
            ]
        )
        # Heights above ground from there back to the line-up.
        length = float(leg_runs(np.stack([turn_point, line_up]))[0])
        fractions = np.linspace(0.0, 1.0, max(2, math.ceil(length / _GROUND_SPACING_M)))
        east, north = (turn_point[axis] + fractions * (line_up[axis] - turn_point[axis]) for axis in range(2))
        if line_up[2] > top_altitude:
            course = math.atan2(line_up[0] - turn_point[0], line_up[1] - turn_point[1])
            climb_slope = site.slopes(course, float(line_up[2]))[0]
            altitudes = np.minimum(line_up[2], top_altitude + max(0.0, climb_slope) * length * fractions)
        else:
            altitudes = top_altitude + fractions * (line_up[2] - top_altitude)
        heights = altitudes - site.terrain.height(east, north)
        if (heights >= _GO_AROUND_CLEARANCE_M).all():
            return float(height)
    return None
