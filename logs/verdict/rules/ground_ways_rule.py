"""The climb-out and approach rules: judge obstacles on the climb from home and on the glide to the landing point.

A planfly flight begins and ends in the air, unless its scenario has a launch or a strip; the launch rule and the
touchdown rule judge these flown parts.  Other departures and approaches are not flown.  They are laid out from the
mission's items and judged against ground, missile spheres and zones, whether or not the mission was flown.

If a mission takes off, the aircraft climbs from the ground at home towards the next place, or on the course in the
scenario's `[launch]`.  An obstacle at the steepest climb fails; an obstacle that is met only at `MIN_CLIMB_FRACTION` of
that climb leaves the finding undecided.  If the mission does not take off, a pilot flies the aircraft to its first
waypoint, perhaps on another path, so an obstacle on the straight path leaves the finding undecided.

The approach is the glide that the autopilot lays out (`Autopilot.landing_glide`).
"""

import math
from itertools import groupby
from typing import NamedTuple

from flight.mission.items import Command
from flight.mission.placing import SAME_PLACE
from logs.verdict.findings import GROUND_WAY, Finding, Message, make_finding, message
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.ways import (
    Profile,
    Way,
    first_item,
    first_obstacle_on,
    is_laid_out,
    landing_item,
    straight_way,
    way_clearance,
)
from logs.verdict.places import Place
from logs.verdict.rule import Rule
from logs.verdict.tolerances import (
    EARLY_TOUCHDOWN_DISTANCE_M,
    FIRST_CLIMB_HEIGHT_M,
    FLARE_HEIGHT_MARGIN_M,
    GLIDE_PATH_TOLERANCE_M,
    LANDING_POINT_ERROR_M,
    LAUNCH_RUN_M,
    MIN_CLIMB_FRACTION,
    MIN_LEG_LENGTH_M,
    PLAN_TOLERANCE_RAD,
)
from logs.verdict.wording import place_text
from world.frames import to_map
from world.geometry import wrap

# Step between the launch courses that `_free_courses_text` tries, deg.
_COURSE_STEP_DEG = 10


# ----------------------------------------------------------------------
# Obstacles on a path.


class _Obstacles(NamedTuple):
    """Obstacles on a path.

    clearance: minimum height above ground, m; NaN if unknown.
    at: distance along the path at which the minimum occurs, m.
    entered: sphere or zone that the path enters, "" if it enters none.
    """

    clearance: float
    at: float
    entered: str

    @property
    def free(self) -> bool:
        """True if the path hits neither ground nor sphere nor zone; False if the ground is unknown."""
        return self.clearance >= 0.0 and not self.entered

    def obstacle_message(self, subject: str, where: str) -> Message:
        """Describe the obstacle.  where: text that names the origin of the distance `at`."""
        if self.entered:
            return message(f"{subject} enters {self.entered}")
        return message(f"{subject} meets the ground", f", {-self.clearance:.0f} m into it {self.at:.0f} m {where}")


def _climb_slopes(requirements: RouteRequirements, leg: int, course: float, amsl: float) -> tuple[float, float]:
    """Return the nominal and the certain maximum climb slope on a course (rad) at an altitude (m AMSL), m per m."""
    speed, limits = float(requirements.route.airspeed[leg]), requirements.limits
    steepest, certain = (one.slopes(course, amsl, speed)[0] for one in (limits, limits.surely()))
    return math.tan(steepest), math.tan(certain)


# ----------------------------------------------------------------------
# The climb-out.


def climbout_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the path from the ground at home to the first place with one finding, if the mission has a home.

    Return [] if the first place is over home, or if the aircraft takes off vertically.
    """
    home, ground = requirements.setup.mission.home, requirements.setup.scenario.terrain
    if not is_laid_out(requirements) or home is None or ground is None:
        return []
    if requirements.ground is not None and requirements.ground.ways.take_off is not None:
        return []
    east, north = to_map(requirements.setup.scenario.origin, home.lat_deg, home.lon_deg)
    begin = (float(east), float(north))
    first, takeoff = first_item(requirements)
    here, low = requirements.points[first], float(ground.height(*begin))
    place = requirements.waypoint(first)
    if takeoff is not None:
        if takeoff.command == Command.NAV_VTOL_TAKEOFF:
            return []
        launch = _launch(requirements)
        course, run, slope = launch.course, launch.run, launch.slope
    else:
        course, run = math.atan2(here[0] - begin[0], here[1] - begin[1]), math.dist(here[:2], begin)
        if run < SAME_PLACE:
            return []
    if math.isnan(low):
        return [_unjudged_finding("climbout", place, "the ground at home is not known", opens=takeoff is not None)]
    steepest, certain = _climb_slopes(requirements, max(0, first - 1), course, low)
    if not steepest > 0.0:
        reason = "the aircraft cannot climb there at this speed and in this wind"
        return [_unjudged_finding("climbout", place, reason, opens=takeoff is not None)]
    if takeoff is None:
        way = straight_way(begin, course, _climb_profile(low, float(here[2]), run, steepest))
        return [_air_start_finding(place, _find_obstacles(requirements, way))]
    up = float(requirements.points[0, 2])
    if up <= low:
        reason = f"the take-off's height is not above the ground at home, which is at {low:.0f} m AMSL"
        return [_unjudged_finding("climbout", place, reason, opens=True)]
    met, least = (
        _find_obstacles(requirements, straight_way(begin, course, _takeoff_profile(low, up, run, slope, climb)))
        for climb in (steepest, max(1e-3, MIN_CLIMB_FRACTION * certain))
    )
    return [_launch_finding(requirements, launch.way, place, met, least, (begin, low, up), certain == steepest)]


def _unjudged_finding(rule: str, place: Place, reason: str, *, opens: bool) -> Finding:
    """Return a finding on a path that is not judged.  opens: True if it leaves the verdict undecided."""
    title = "climb-out" if rule == "climbout" else rule
    fault = message(f"the {title} at {place_text(place)} is not judged: {reason}")
    return make_finding(
        rule, place, ok=None, reason=reason, faults=[fault], unit="m", check=GROUND_WAY if opens else ""
    )


class _Launch(NamedTuple):
    """Launch course and the leg flown on it.

    course: rad.
    run: distance flown on the course, m.
    slope: slope of the leg, m per m.
    way: description of the course, "" along the first leg.
    """

    course: float
    run: float
    slope: float
    way: str = ""


def _launch(requirements: RouteRequirements) -> _Launch:
    """Return the launch on the scenario's course, or along the first leg if the scenario states no course.

    The first leg's run and slope apply if the leg is on the launch course.
    """
    stated = requirements.setup.scenario.launch
    along = _Launch(
        float(requirements.courses[0]), float(requirements.runs[0]), math.tan(float(requirements.slopes[0]))
    )
    if stated is None or stated.course is None:
        return along
    way = f"on the launch course {round(math.degrees(stated.course)) % 360}°"
    if abs(float(wrap(stated.course - along.course))) <= PLAN_TOLERANCE_RAD:
        return along._replace(way=way)
    return _Launch(stated.course, math.inf, 0.0, way)


def _climb_profile(low: float, up: float, run: float, climb: float) -> Profile:
    """Return the profile of a climb from the ground followed by a straight line to a place.

    low: altitude of the ground, m AMSL.
    up: altitude of the place, m AMSL.
    run: distance of the place, m.
    climb: climb slope, m per m.
    """
    top = max(up, low + FIRST_CLIMB_HEIGHT_M)
    reached = (top - low) / climb
    if reached >= run:
        return [(0.0, low), (run, low + climb * run)]
    return [(0.0, low), (reached, top), (run, up)]


def _takeoff_profile(low: float, up: float, run: float, slope: float, climb: float) -> Profile:
    """Return the climb profile from the ground until the aircraft is on the first leg.

    low: altitude of the ground, m AMSL.
    up: altitude at which the leg begins over home and to which the take-off climbs, m AMSL.
    run: length of the leg, m.
    slope: slope of the leg, m per m.
    climb: climb slope, m per m.
    """
    reached = (up - low) / climb
    if reached < run:
        on_leg = (up - low) / (climb - slope) if climb > slope else math.inf
        reached = min(run, max(reached, on_leg))
    return [(0.0, low), (reached, low + climb * reached)]


def _find_obstacles(requirements: RouteRequirements, way: Way) -> _Obstacles:
    """Return the obstacles on a path from home; the first `LAUNCH_RUN_M` of the path may be close to the ground."""
    ground, end = requirements.setup.scenario.terrain, float(way.run[-1])
    entered = first_obstacle_on(requirements, way)
    if ground is None or end <= LAUNCH_RUN_M:
        return _Obstacles(math.inf, 0.0, entered)
    return _Obstacles(*way_clearance(ground, way.between(LAUNCH_RUN_M, end)), entered)


def _air_start_finding(place: Place, met: _Obstacles) -> Finding:
    """Judge the direct climb from home to the first waypoint, not simulated, of a mission that starts in the air."""
    subject = f"the climb from home to {_item_text(place)}"
    if math.isnan(met.clearance) and not met.entered:
        reason, check, ok = f"the ground below {subject} is not known", "", None
    elif met.free:
        reason, check, ok = (
            f"straight from home: {_clearance_text(met)}; not flown, as the flight begins in the air",
            "",
            True,
        )
    else:
        fault = met.obstacle_message(subject, "from home, at the steepest climb")
        return _finding("climbout", place, met, None, fault, GROUND_WAY)
    return _finding("climbout", place, met, ok, message(reason), check)


def _launch_finding(
    requirements: RouteRequirements,
    way: str,
    place: Place,
    met: _Obstacles,
    least: _Obstacles,
    launch: tuple[tuple[float, float], float, float],
    is_known: bool,
) -> Finding:
    """Judge the climb of a mission that takes off, towards its next place or on a launch course.

    way: description of the launch course, "" along the first leg.
    met: obstacles at the steepest climb.
    least: obstacles at the minimum climb.
    launch: launch place (east, north, m), altitude of the ground there and altitude at the end of the climb (m AMSL).
    is_known: True if the aircraft's climb is certain.
    """
    to_item = requirements.leg(0).to_item
    towards = f"towards {'the next place' if to_item is None else f'item {to_item}'}"
    subject = f"the climb from home {way or towards}"
    if math.isnan(met.clearance) and not met.entered:
        reason = message(f"the ground below {subject} is not known")
        return _finding("climbout", place, met, None, reason)
    if not met.free:
        fault = met.obstacle_message(subject, "from home, at the steepest climb")
        other = _free_courses_text(requirements, *launch)
        fault = message(fault.brief, fault.text[len(fault.brief) :] + other)
        return _finding("climbout", place, met, False if is_known else None, fault, "" if is_known else GROUND_WAY)
    at_least = f"{subject}, at {100.0 * MIN_CLIMB_FRACTION:.0f} % of the steepest,"
    if math.isnan(least.clearance) and not least.entered:
        return _finding("climbout", place, met, None, message(f"{at_least} leads to where the ground is not known"))
    if not least.free:
        return _finding("climbout", place, met, None, least.obstacle_message(at_least, "from home"), GROUND_WAY)
    return _finding(
        "climbout", place, met, True, message(f"{subject.removeprefix('the climb from home ')}: {_clearance_text(met)}")
    )


def _free_courses_text(requirements: RouteRequirements, begin: tuple[float, float], low: float, up: float) -> str:
    """Describe the widest range of courses on which a launch climbs to the take-off's altitude without obstacles."""

    def is_free(course: float) -> bool:
        climb, _ = _climb_slopes(requirements, 0, course, low)
        if not climb > 0.0:
            return False
        return _find_obstacles(requirements, straight_way(begin, course, [(0.0, low), ((up - low) / climb, up)])).free

    courses = list(range(0, 360, _COURSE_STEP_DEG))
    free = [is_free(math.radians(course)) for course in courses]
    if not any(free):
        return "; no launch course climbs clear"
    # Begin after a course with obstacles, so that no range is cut at north.
    start = free.index(False) if False in free else 0
    turned = [(courses[k % len(courses)], free[k % len(courses)]) for k in range(start, start + len(courses))]
    ranges = [[course for course, _ in group] for is_one, group in groupby(turned, key=lambda one: one[1]) if is_one]
    widest = max(ranges, key=len)
    if len(widest) == 1:
        return f"; launched on {widest[0]:03d}° it would climb clear"
    return f"; launched on {widest[0]:03d}° to {widest[-1]:03d}° it would climb clear"


# ----------------------------------------------------------------------
# The approach.


def approach_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the glide from the last waypoint to the landing point with one finding, if the mission lands."""
    found, ground, setup = landing_item(requirements), requirements.setup.scenario.terrain, requirements.setup
    if found is None or ground is None or not is_laid_out(requirements):
        return []
    if requirements.ground is not None and requirements.ground.ways.approach is not None:
        return []
    at, leg = found[0], found[0] - 1
    place, item = requirements.waypoint(at), _item_text(requirements.waypoint(at))
    begin, point = requirements.points[leg], requirements.points[at]
    run, course, low = float(requirements.runs[leg]), float(requirements.courses[leg]), setup.route.landing_ground
    high, under = float(begin[2]), float(ground.height(float(point[0]), float(point[1])))
    if math.isnan(low) or math.isnan(under) or run < MIN_LEG_LENGTH_M:
        reason = "the height of the ground at the landing point is not known"
        return [_unjudged_finding("approach", place, reason, opens=True)]
    if high <= low:
        reason = "it begins no higher than the landing point"
        return [_unjudged_finding("approach", place, reason, opens=True)]
    glide = setup.autopilot.landing_glide(high - low, run, setup.scenario.wind.along(course, low)[0], low)
    flare = (run - glide.flare_distance, low + glide.flare_height)
    way = straight_way(begin, course, [(0.0, high), *([flare] if glide.flare_distance > 0.0 else []), (run, low)])
    last, room, at_run = run - EARLY_TOUCHDOWN_DISTANCE_M, math.inf, 0.0
    if last > 0.0:
        room, at_run = way_clearance(ground, way.between(0.0, last))
    met = _Obstacles(room, run - at_run, first_obstacle_on(requirements, way))
    subject = f"the glide to {item}"
    if math.isnan(met.clearance) and not met.entered:
        return [_finding("approach", place, met, None, message(f"the ground below {subject} is not known"))]
    obstacle_message = met.obstacle_message(subject, "before the landing point")
    # With a landing point below the ground the glide hits the ground early: the elevation file may be some metres off.
    if met.entered or met.clearance + min(LANDING_POINT_ERROR_M, max(0.0, under - low)) < 0.0:
        return [_finding("approach", place, met, False, obstacle_message)]
    if met.clearance < 0.0:
        fault = message(
            f"the landing point of {item} is {under - low:.0f} m below the ground", f": {obstacle_message.text}"
        )
        return [_finding("approach", place, met, None, fault, GROUND_WAY)]
    if low - under > LANDING_POINT_ERROR_M:
        fault = message(f"the landing point of {item} is {low - under:.0f} m above the ground")
        return [_finding("approach", place, met, None, fault, GROUND_WAY)]
    until = run - glide.flare_distance - max(0.0, FLARE_HEIGHT_MARGIN_M - glide.flare_height) / glide.slope
    room = way_clearance(ground, way.between(0.0, until))[0] if until > 0.0 else math.inf
    if room < GLIDE_PATH_TOLERANCE_M:
        fault = message(
            f"{subject} passes the ground by {room:.1f} m",
            f", and may be flown {GLIDE_PATH_TOLERANCE_M:.0f} m lower than laid out",
        )
        return [_finding("approach", place, met, None, fault, GROUND_WAY)]
    reason = f"glides down at {math.degrees(math.atan(glide.slope)):.1f}°"
    if glide.flare_distance > 0.0:
        reason += (
            f", flares {glide.flare_height:.1f} m over the landing point and {glide.flare_distance:.0f} m before it"
        )
    reason += f"; {_clearance_text(met)} until {EARLY_TOUCHDOWN_DISTANCE_M:.0f} m before it"
    reason += "" if setup.ground_ways.approach is not None else "; not flown, as the flight ends in the air"
    return [_finding("approach", place, met, True, message(reason))]


# ----------------------------------------------------------------------


def _item_text(place: Place) -> str:
    """Name the item of a waypoint."""
    return "the first place" if place.item is None else f"item {place.item}"


def _clearance_text(met: _Obstacles) -> str:
    return "nothing is in the way" if math.isinf(met.clearance) else f"{met.clearance:.0f} m above ground or more"


def _finding(rule: str, place: Place, met: _Obstacles, ok: bool | None, said: Message, check: str = "") -> Finding:
    return make_finding(
        rule,
        place,
        ok=ok,
        reason=said.text,
        faults=[] if ok else [said],
        planned=met.clearance,
        limit=0.0,
        at_least=True,
        source="terrain",
        tolerance=0.0,
        margin=None if met.entered else met.clearance,
        unit="m",
        method="laid out from the mission's items, exact over the elevation file",
        check=check,
    )


CLIMBOUT = Rule(
    name="climbout",
    tolerances=("LAUNCH_RUN_M", "FIRST_CLIMB_HEIGHT_M", "MIN_CLIMB_FRACTION", "PLAN_TOLERANCE_RAD", "ROUNDING_M"),
    judge=climbout_findings,
)
APPROACH = Rule(
    name="approach",
    tolerances=(
        "EARLY_TOUCHDOWN_DISTANCE_M",
        "GLIDE_PATH_TOLERANCE_M",
        "FLARE_HEIGHT_MARGIN_M",
        "LANDING_POINT_ERROR_M",
        "ROUNDING_M",
    ),
    judge=approach_findings,
)
