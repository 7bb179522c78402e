"""Lay out a plan's departure from home to its first waypoint, and its approach from the last waypoint to the strip.

Both are searched among a few thousand paths of straight legs, shortest first: launch courses or finals, with corners
and laps between them and the plan.  A path is accepted if it passes the plan's certificate (turns, slopes, clearance,
missiles, zones, bounds), and if the parts below the certificate's clearance are free, too: the climb from the ground
and the glide to the landing point.  If no path is accepted, the plan's certificate reports the best one.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits, aircraft_slopes
from aircraft.tracking import SPEED_SHARES
from planner.evaluation.certify import certify
from planner.evaluation.problem import ANGLE_MARGIN, Problem, make_problem
from planner.ground_ways import ClimbOut, Descent, GroundWays
from planner.plan import Certificate, Plan
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.pose_chains import (
    LAP_SIDE,
    MAX_LAPS,
    Spot,
    TurnLengths,
    arc_lengths,
    chains,
    fallen,
    measure,
    risen,
)
from world.airfield import STEEPEST_STRIP, LandingStrip, Launch, strip_slopes
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs
from world.scenario import Scenario
from world.terrain import Terrain

# Slope of departure and approach as a fraction of the aircraft's steepest climb and dive at cruise airspeed; a take-off
# climbs at least as steeply (MIN_CLIMB of the verdict).
SHARE = 0.7
# Slope of a glide as a fraction of the steepest dive at the landing airspeed.
GLIDE_SHARE = 0.85
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
# Distance from home within which terrain is ignored, m (LAUNCH_RUN of the verdict).
_LAUNCH_RUN_M = 50.0
# Required height above ground beyond it, as a fraction of the height climbed, up to the scenario's clearance.
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
# Required height of the glide above ground before that, as a fraction of its height over the landing point.
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


class FinalLaw(NamedTuple):
    """Airspeed and slope that the autopilot flies on a final.

    airspeed: true airspeed on the glide, m/s, as a function of tailwind (m/s) and altitude (m AMSL).
    slope: flown slope of the glide, m per m, as a function of height over and distance before the landing point (m),
    tailwind (m/s) and altitude of the point (m AMSL).
    """

    airspeed: Callable[[float, float], float]
    slope: Callable[[float, float, float, float], float]


def with_ground_ways(plan: Plan, limits: Limits, final: FinalLaw, climbed: ClimbOut | None = None) -> Plan:
    """Add the departure and approach that a plan's scenario requires, or the reason why they are missing.

    The scenario requires them by `[launch]` and `[landing]`; a plan without either table is returned unchanged.
    limits: limits of the plan.
    climbed: the departure to keep of a plan whose first legs are flown already.
    """
    scenario = plan.scenario
    if scenario.home is None or scenario.terrain is None or (scenario.launch is None and scenario.landing is None):
        return plan
    site = _make_site(plan, limits, scenario.home, scenario.terrain)
    climb = descent = None
    problems: list[str] = []
    if plan.flown_legs:
        climb = climbed
    elif scenario.launch is not None:
        climb, why = _find_climb_out(site, scenario.launch)
        problems += [f"climb-out: {why}"] if why else []
    if scenario.landing is not None:
        descent, why = _find_descent(site, scenario.landing, final)
        problems += [f"landing: {why}"] if why else []
    certificate = replace(plan.certificate, problems=(*plan.certificate.problems, *problems))
    return replace(plan, ways=GroundWays(climb, descent), certificate=certificate)


# ----------------------------------------------------------------------
# Checks of ground, aircraft and airspace that departure and approach share.


@dataclass(frozen=True, slots=True)
class _Site:
    """Plan, and the problems with which its departure and approach are certified.

    low: problem of the parts below the required clearance; of its certificate only the distances from missiles and
    zones are used.  radius: radius of the tightest turn, m.  turning: lengths that turns take of their legs.
    """

    plan: Plan
    limits: Limits
    home: Floats
    terrain: Terrain
    problem: Problem
    low: Problem
    radius: float
    turning: TurnLengths

    @property
    def scenario(self) -> Scenario:
        return self.plan.scenario

    def slopes(self, course: float, amsl: float) -> tuple[float, float]:
        """Return the climb and dive slopes (m per m) for a course (rad) at an altitude (m AMSL)."""
        certified = aircraft_slopes(self.problem.certified.aircraft, course, amsl)
        stated = (self.limits.max_climb, self.limits.max_dive)
        found = []
        for able, sure, most in zip(self.limits.slopes(course, amsl), certified, stated, strict=True):
            slope = min(SHARE * math.tan(able), math.tan(max(0.0, sure - 1.1 * ANGLE_MARGIN)))
            found.append(slope if most is None else min(slope, math.tan(max(0.0, most - 1.1 * ANGLE_MARGIN))))
        return found[0], found[1]

    def least_length(self, rise: float, side: int) -> float:
        """Return the length of the shortest path that gains (side 0) or loses (side 1) a height, m."""
        up = float(max(self.scenario.start[2], self.scenario.destination[2]))
        steepest = max(self.slopes(course, up)[side] for course in np.arange(8) * (math.pi / 4.0))
        return max(0.0, abs(rise)) / steepest if steepest > 0.0 else math.inf

    def certificate(self, chain: Floats, near: tuple[Floats, Floats]) -> Certificate:
        """Return the certificate of a chain (n, 3).

        near: two places, (3,) m; if a place is closer to the ground than required, less height is required near the
            place.
        """
        data = self.problem.certified
        start, end = (min(data.buffer, 0.75 * max(0.0, self.above(place) - data.clearance - 0.01)) for place in near)
        free = data._replace(
            start=_read_only(near[0]),
            destination=_read_only(near[1]),
            start_buffer=start,
            destination_buffer=end,
            start_course=math.nan,
            destination_course=math.nan,
        )
        return certify(replace(self.problem, certified=free), np.ascontiguousarray(chain))

    def above(self, place: Floats) -> float:
        """Return the height of a place above ground, m."""
        return float(place[2] - self.terrain.height(place[0], place[1]))

    def entered(self, chain: Sequence[Sequence[float]]) -> str:
        """Describe the missile or zone that a chain low over the ground enters; "" if it enters none."""
        found = certify(self.low, np.array(chain, dtype=np.float64))
        if found.kill_distance <= 0.0:
            return f"{-found.kill_distance:.0f} m inside a missile's reach"
        return f"{max(0.0, -found.zone_distance):.0f} m beyond a zone's edge" if found.zone_distance <= 0.0 else ""


def _make_site(plan: Plan, limits: Limits, home: Floats, terrain: Terrain) -> _Site:
    scenario = plan.scenario
    within = limits_for(find_algorithm(plan.algorithm, scenario.name), limits)
    problem = make_problem(scenario, within)
    # An inclusion with a floor begins above the field.
    zones = tuple(zone for zone in scenario.zones if zone.kind == "exclusion" or zone.floor is None)
    low = make_problem(replace(scenario, zones=zones), within)
    low = replace(low, certified=low.certified._replace(clearance=-1e5))
    up = float(max(scenario.start[2], scenario.destination[2]))
    radius = max(within.turn_radius(course, course + math.pi, up) for course in (0.0, 0.5 * math.pi))
    turning = arc_lengths(radius)
    if (tracking := within.tracking) is not None:
        # An estimate, as ground speeds depend on the course; the certificate decides.
        share = 1.0 + _WIND_FRACTION * scenario.wind.speed / within.airspeed
        before, after = (_turn_lengths_at(table, share) for table in (tracking.before, tracking.after))
        turning = TurnLengths(*(tuple(map(max, own, arcs)) for own, arcs in zip((before, after), turning, strict=True)))
    return _Site(plan, within, home, terrain, problem, low, radius, turning)


def _turn_lengths_at(table: Floats, share: float) -> list[float]:
    """Interpolate a tracking error's table, (t,) m, at a ground speed as a fraction of the airspeed."""
    return [float(np.interp(share, SPEED_SHARES, row)) for row in table]


def _read_only(place: Floats) -> Floats:
    """Return a read-only copy of a place, because a writable array would make the kernels compile again."""
    out = np.array(place, dtype=np.float64)
    out.setflags(write=False)
    return out


def _chain(spots: Sequence[Spot], heights: Floats) -> Floats:
    return np.column_stack([np.array(spots), heights])


def _ground_profile(terrain: Terrain, begin: Spot, course: float, last: float) -> tuple[Floats, Floats]:
    """Return distances from a place along a course, m, and the ground heights at those distances, m, NaN if unknown."""
    run = np.arange(0.0, last + _GROUND_SPACING_M, _GROUND_SPACING_M)
    east, north = begin[0] + run * math.sin(course), begin[1] + run * math.cos(course)
    return run, terrain.height(east, north)


class _BestRefused:
    """Best of the refused paths, and the number of refused paths."""

    def __init__(self) -> None:
        self.tried, self._margin, self.problem = 0, -math.inf, ""

    def add(self, found: Certificate | None) -> None:
        """Include the certificate, if any, of a refused path; a path without a problem is in a missile's range."""
        if found is None:
            return
        self.tried += 1
        margin = min(found.clearance, found.kill_distance, found.zone_distance, found.bounds)
        if not self.problem or margin > self._margin:
            inside = f"{-found.kill_distance:.0f} m inside a missile's reach"
            self._margin, self.problem = margin, found.problems[0] if found.problems else inside


# ----------------------------------------------------------------------
# Departure.


def _find_climb_out(site: _Site, launch: Launch) -> tuple[ClimbOut | None, str]:
    """Return the shortest accepted departure, or None and the reason."""
    data, target = site.problem.certified, site.plan.waypoints[0]
    ground, goal = float(site.home[2]), float(target[2])
    over = max(_MIN_TAKEOFF_HEIGHT_M, data.clearance + data.buffer + _CLEARANCE_EXCESS_M)
    up = ground + over
    launches, why = _find_launches(site, launch, over, max(up, goal))
    if not launches:
        return None, why
    nearest = _BestRefused()
    for laps in _lap_counts(site, goal - ground, 0):
        for _, course, spots in sorted(_departure_paths(site, launches, laps), key=lambda one: one[0]):
            found = _certify_climb_out(site, course, spots, up)
            if isinstance(found, ClimbOut):
                return found, ""
            nearest.add(found)
            if nearest.tried >= _MAX_CERTIFIED:
                break
    courses = (
        "on its course" if launch.course is not None else f"on {len({launch.course for launch in launches})} courses"
    )
    if not nearest.tried:
        return None, f"no path launched {courses} is long enough to climb to the start, {goal - ground:.0f} m over home"
    return None, f"none of {nearest.tried} paths launched {courses} is clear; the nearest: {nearest.problem}"


def _certify_climb_out(site: _Site, course: float, spots: list[Spot], up: float) -> ClimbOut | Certificate | None:
    """Return the departure over these corners, its certificate if it is refused, or None if it cannot be flown.

    up: altitude that the take-off climbs to, m AMSL.
    """
    onward, target = site.plan.waypoints[1:3], site.plan.waypoints[0]
    goal, top = float(target[2]), max(up, float(target[2]))
    found = None
    for share in _SLOPE_FACTORS:
        heights = risen(spots, float(site.home[2]), partial(_scaled_slope, site, share, 0, top), up, goal)
        if heights[-1] < goal - 1e-6:
            break
        chain = np.concatenate([_chain(spots, heights), onward])
        found = site.certificate(chain, (target, chain[0]))
        if found.ok and found.kill_distance > 0.0:
            return ClimbOut(site.home, course, up, chain[1 : len(spots) - 1], site.slopes(course, top)[0])
    return found


class _Start(NamedTuple):
    """Launch: course (rad), place where the take-off is complete, and end of the first leg."""

    course: float
    over: Spot
    end: Spot


def _find_launches(site: _Site, launch: Launch, over: float, high: float) -> tuple[list[_Start], str]:
    """Return the launches that climb clear of ground, missiles and zones, or the reason why there are none.

    over: height above home up to which the launch climbs straight ahead, m.
    high: altitude of the climb performance, m AMSL.
    """
    courses = (
        [2.0 * math.pi * k / _LAUNCH_COURSE_COUNT for k in range(_LAUNCH_COURSE_COUNT)]
        if launch.course is None
        else [launch.course]
    )
    home, found, best = (float(site.home[0]), float(site.home[1])), [], (-math.inf, "")
    for course in courses:
        climb = site.slopes(course, high)[0]
        if climb <= 0.0:
            continue
        least = over / climb * _FIRST_LEG_FACTOR_AND_M[0] + _FIRST_LEG_FACTOR_AND_M[1]
        for longer in _FIRST_LEG_FACTORS:
            last = least * longer
            run, low = _ground_profile(site.terrain, home, course, last)
            height = climb * run
            needed = np.minimum(site.problem.certified.clearance, _CLIMB_CLEARANCE_FRACTION * height)
            room = (site.home[2] + height - low - needed)[run > _LAUNCH_RUN_M]
            where = f"on {round(math.degrees(course)) % 360}°"
            if not (room >= 0.0).all():
                worst = float(np.nanmin(room)) if not np.isnan(room).all() else -math.inf
                k = int(np.argmin(np.where(np.isnan(room), math.inf, room)))
                at = float(run[run > _LAUNCH_RUN_M][k])
                said = f"the nearest, {where}, is {-worst:.0f} m too low over the ground {at:.0f} m from home"
                best = max(best, (worst, said))
                break
            east, north = math.sin(course), math.cos(course)
            end = (home[0] + last * east, home[1] + last * north)
            risen_at = _TAKEOFF_DONE_FRACTION * over / climb
            ground = float(site.home[2])
            entered = site.entered([(*home, ground), (*end, ground + climb * last)])
            if entered:
                best = max(best, (-1e6, f"{where} it is {entered}"))
                break
            found.append(_Start(course, (home[0] + risen_at * east, home[1] + risen_at * north), end))
    whose = "the launch course leads" if launch.course is not None else f"none of {len(courses)} launch courses leads"
    no = "" if launch.course is None else "not "
    return found, f"{whose} {no}free of ground, missiles and zones at {SHARE:.0%} of the steepest climb: {best[1]}"


def _departure_paths(site: _Site, launches: Sequence[_Start], laps: int) -> Iterator[tuple[float, float, list[Spot]]]:
    """Yield the cost, launch course and corners of departures from home to the plan's first waypoint."""
    first, asked = site.plan.waypoints[0], site.scenario.start_course
    onward = float(leg_courses(site.plan.waypoints[:2])[0]) if asked is None else asked
    end, home = (float(first[0]), float(first[1])), (float(site.home[0]), float(site.home[1]))
    after = (float(site.plan.waypoints[1, 0]), float(site.plan.waypoints[1, 1]))
    least = site.least_length(float(first[2] - site.home[2]), 0) + math.dist(end, after)
    for course, over, begin in launches:
        tail = site.scenario.wind.along(course, float(site.home[2]))[0]
        for corners in chains(begin, course, end, onward, site.radius, laps):
            spots = [home, begin, *corners, end]
            way, before = measure([over, *spots[1:], after], site.turning), math.dist(home, over)
            if way.fits and before + way.length >= least:
                yield before + way.cost + (_TAILWIND_COST_M if tail > _MAX_TAILWIND_MPS else 0.0), course, spots


def _lap_counts(site: _Site, rise: float, side: int) -> list[int]:
    """Return the numbers of laps with which to try to gain (side 0) or lose (side 1) a height, m, fewest first."""
    most = math.ceil(site.least_length(rise, side) / _SLOPE_FACTORS[-1] / (4.0 * LAP_SIDE * site.radius))
    return list(range(min(MAX_LAPS, most) + 1))


# ----------------------------------------------------------------------
# Approach.


class _Final(NamedTuple):
    """Final: course (rad), length and height over the landing point (m), line-up, (2, 3) m, and landing point."""

    course: float
    length: float
    height: float
    line_up: Floats
    point: Floats


def _find_descent(site: _Site, strip: LandingStrip, final: FinalLaw) -> tuple[Descent | None, str]:
    """Return the first accepted approach, or None and the reason."""
    field = float(site.terrain.height(strip.east, strip.north))
    point = np.array([strip.east, strip.north, field])
    into = strip.into(site.scenario.wind, field)
    courses = (
        [into]
        if into is not None
        else [2.0 * math.pi * k / _LANDING_COURSE_COUNT for k in range(_LANDING_COURSE_COUNT)]
    )
    finals, reasons = [], []
    for course in courses:
        rough = _strip_fault(site.terrain, strip, course)
        if rough:
            reasons.append(rough)
            continue
        made, why = _find_finals(site, strip, course, point, final)
        finals += made
        reasons += [why] if not made else []
    if not finals:
        return None, reasons[0]
    why = ""
    for one in finals[:_MAX_FINALS]:
        corners, why = _path_to_line_up(site, one)
        if corners is None:
            continue
        go_around = _min_go_around_height(site, one)
        if go_around is None:
            why = f"no height would do for a go-around on {round(math.degrees(one.course)) % 360}°"
            continue
        return Descent(corners, one.line_up, point, one.course, one.height / one.length, go_around), ""
    return None, why


def _strip_fault(terrain: Terrain, strip: LandingStrip, course: float) -> str:
    """Describe the fault of a strip's ground; "" if it is suitable."""
    for name, slope in zip(("along", "across"), strip_slopes(terrain, strip, course), strict=True):
        if math.isnan(slope):
            return "the ground of the strip is not known to its ends"
        if abs(slope) > STEEPEST_STRIP:
            on = f"on {round(math.degrees(course)) % 360}°"
            return f"the strip slopes by {abs(slope):.0%} {name} it {on}; at most {STEEPEST_STRIP:.0%} can be landed on"
    return ""


def _find_finals(
    site: _Site, strip: LandingStrip, course: float, point: Floats, law: FinalLaw
) -> tuple[list[_Final], str]:
    """Return the unobstructed flyable finals on a course, the shallowest and shortest first, or the reason for none."""
    field = float(point[2])
    tail = site.scenario.wind.along(course, field)[0]
    able = GLIDE_SHARE * math.tan(site.limits.slopes(course, field, law.airspeed(tail, field))[1])
    lengths = _FINAL_LENGTHS_M if strip.approach is None else (strip.approach,)
    slopes = _FINAL_SLOPES_RAD if strip.slope is None else (strip.slope,)
    pairs = sorted(((a, s) for a in lengths for s in slopes), key=lambda one: (one[1] > _PX4_MAX_SLOPE_RAD, one))
    found, why = list[_Final](), (-math.inf, "")
    for length, slope in pairs:
        height = length * math.tan(slope)
        flown = law.slope(height, length, tail, field)
        if flown > able:
            steep, most = math.degrees(math.atan(flown)), math.degrees(math.atan(able))
            why = max(why, (-1e6, f"a glide of {steep:.1f}° is steeper than the {most:.1f}° that can be flown there"))
            continue
        made = _Final(course, length, height, _line_up_points(site, point, course, length, height), point)
        margin, blocked = _obstacle_on(site, made)
        if blocked:
            why = max(why, (margin, f"a final of {length:.0f} m at {math.degrees(slope):.1f}° {blocked}"))
        else:
            found.append(made)
    return found, f"on {round(math.degrees(course)) % 360}° {why[1]}"


def _line_up_points(site: _Site, point: Floats, course: float, length: float, height: float) -> Floats:
    away = np.array([length + max(_MIN_LINE_UP_M, _LINE_UP_RADII * site.radius), length])
    east, north = point[0] - away * math.sin(course), point[1] - away * math.cos(course)
    return np.column_stack([east, north, np.full(2, point[2] + height)])


def _obstacle_on(site: _Site, final: _Final) -> tuple[float, str]:
    """Return a final's margin to its obstacle, m, negative if blocked, and the obstacle's description, or ""."""
    begin, point = final.line_up[1], final.point
    run, low = _ground_profile(site.terrain, (float(begin[0]), float(begin[1])), final.course, final.length)
    over = final.height * (1.0 - run / final.length)
    room = float(point[2]) + over - low - np.minimum(_MAX_GLIDE_CLEARANCE_M, _GLIDE_CLEARANCE_FRACTION * over)
    asked = room[run <= final.length - _GROUND_CONTACT_ZONE_M]
    if np.isnan(asked).any():
        return -math.inf, "leads over ground that is not known"
    if asked.min(initial=0.0) < 0.0:
        return float(asked.min()), f"is {-float(asked.min()):.0f} m too low over the ground"
    entered = site.entered([begin.tolist(), [float(point[0]), float(point[1]), float(begin[2])]])
    entered = entered or site.entered([[*begin[:2].tolist(), float(point[2])], point.tolist()])
    if entered:
        return -math.inf, f"is {entered}"
    above = np.array([point[0], point[1], begin[2]])
    chain = np.concatenate([final.line_up, above[None]])
    found = site.certificate(chain, (chain[0], chain[0]))
    if not found.ok:
        return min(found.clearance, 0.0) - 1.0, f"is not free: {found.problems[0]}"
    return 0.0, "" if found.kill_distance > 0.0 else "is inside a missile's reach"


def _path_to_line_up(site: _Site, final: _Final) -> tuple[Floats | None, str]:
    """Return corners (n, 3) of the shortest path from the plan's end to a line-up, or None and the reason."""
    path, goal = site.plan.waypoints, float(final.line_up[0, 2])
    last, high = path[-1], float(path[-1, 2])
    asked = site.scenario.destination_course
    course = float(leg_courses(path[-2:])[0]) if asked is None else asked
    begin, end = (float(last[0]), float(last[1])), (float(final.line_up[0, 0]), float(final.line_up[0, 1]))
    before = path[-3:-1]
    flown = [(float(one[0]), float(one[1])) for one in before]
    after = (float(final.line_up[1, 0]), float(final.line_up[1, 1]))
    nearest = _BestRefused()
    above = np.array([final.point[0], final.point[1], goal])
    side = int(goal < high)
    aside = math.dist(flown[-1], begin) + math.dist(end, after)
    aside += sum(math.dist(a, b) for a, b in pairwise(flown))
    least = site.least_length(high - goal, side) + aside
    for laps in _lap_counts(site, high - goal, side):
        ways = [[begin, *corners, end] for corners in chains(begin, course, end, final.course, site.radius, laps)]
        measured = [(measure([*flown, *spots, after], site.turning), spots) for spots in ways]
        fitting = [(way.cost, spots) for way, spots in measured if way.fits and way.length >= least]
        for _, spots in sorted(fitting):
            for share in _SLOPE_FACTORS:
                heights = _approach_altitudes(site, spots, share, high, goal)
                if abs(heights[0] - high) > 1e-6 or abs(heights[-1] - goal) > 1e-6:
                    break
                chain = np.concatenate([before, _chain(spots, heights), final.line_up[1:], above[None]])
                found = site.certificate(chain, (last, last))
                if found.ok and found.kill_distance > 0.0:
                    return chain[len(before) + 1 : len(before) + len(spots) - 1], ""
                nearest.add(found)
            if nearest.tried >= _MAX_CERTIFIED:
                break
    where = f"from the destination to the final on {round(math.degrees(final.course)) % 360}°"
    if not nearest.tried:
        return None, f"no path {where} is long enough for its turns and {high - goal:.0f} m of descent"
    remedy = "a higher destination (height_m) or another strip may have one"
    return None, f"none of {nearest.tried} paths {where} is clear: {remedy}; the nearest: {nearest.problem}"


def _approach_altitudes(site: _Site, spots: list[Spot], share: float, high: float, goal: float) -> Floats:
    """Return the altitudes of a path between two altitudes at a fraction of its slope limits, (n,) m AMSL."""
    top = max(high, goal)
    climb, dive = (partial(_scaled_slope, site, share, side, top) for side in (0, 1))
    return fallen(spots, high, climb, dive, goal)


def _scaled_slope(site: _Site, share: float, side: int, amsl: float, course: float) -> float:
    """Return a fraction of the climb (side 0) or dive (1) slope on a course, m per m."""
    return share * site.slopes(course, amsl)[side]


def _min_go_around_height(site: _Site, final: _Final) -> float | None:
    """Return the minimum height above home of a go-around that returns to the line-up, m, or None if none does.

    It climbs straight ahead from the landing point at `SHARE` of the steepest climb, then flies back to the line-up.
    """
    home, field = float(site.home[2]), float(final.point[2])
    target = final.line_up[0]
    # Above the line-up: an aircraft that aborts above the go-around height turns at once, between the hills.
    first = max(
        _MIN_GO_AROUND_HEIGHT_M,
        field - home + _MIN_GO_AROUND_HEIGHT_M,
        float(target[2]) - home + _GO_AROUND_CLEARANCE_M,
    )
    for height in np.arange(
        math.ceil(first / _GO_AROUND_STEP_M) * _GO_AROUND_STEP_M, _MAX_GO_AROUND_HEIGHT_M, _GO_AROUND_STEP_M
    ).tolist():
        top = home + height
        climb = site.slopes(final.course, top)[0]
        if climb <= 0.0:
            return None
        run, low = _ground_profile(
            site.terrain, (float(final.point[0]), float(final.point[1])), final.course, (top - field) / climb
        )
        room = (field + climb * run - low)[run > _LAUNCH_RUN_M]
        turned = np.array(
            [final.point[0] + run[-1] * math.sin(final.course), final.point[1] + run[-1] * math.cos(final.course), top]
        )
        if (room >= 0.0).all() and _return_clearance(site, turned, target) >= _GO_AROUND_CLEARANCE_M:
            return float(height)
    return None


def _return_clearance(site: _Site, turned: Floats, target: Floats) -> float:
    """Return the minimum height above ground on the way from a go-around back to the line-up, m; -inf if unknown."""
    run = float(leg_runs(np.stack([turned, target]))[0])
    share = np.linspace(0.0, 1.0, max(2, math.ceil(run / _GROUND_SPACING_M)))
    east, north = (turned[k] + share * (target[k] - turned[k]) for k in range(2))
    if target[2] > turned[2]:
        climb = site.slopes(math.atan2(target[0] - turned[0], target[1] - turned[1]), float(target[2]))[0]
        up = np.minimum(target[2], turned[2] + max(0.0, climb) * run * share)
    else:
        up = turned[2] + share * (target[2] - turned[2])
    room = up - site.terrain.height(east, north)
    return -math.inf if np.isnan(room).any() else float(room.min())
