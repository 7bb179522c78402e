"""The climb-out and approach rules: judge obstacles after the take-off and before the landing.

Judged are the climb from home, and the glide to the landing point.

A planfly flight begins and ends in the air, unless its scenario has a launch or a strip; the launch rule and the
touchdown rule judge these flown parts.  Other departures and approaches are not flown.  They are laid out from the
mission's items and judged against ground, missile spheres and zones, whether or not the mission was flown.

If a mission takes off, the aircraft climbs from the ground at home towards the next place, or on the course in the
scenario's `[launch]`.  An obstacle at the steepest climb fails; an obstacle that is met only at `MIN_CLIMB_FRACTION` of
that climb leaves the finding undecided.  If the mission does not take off, a pilot flies the aircraft to its first
waypoint, perhaps on another path, so an obstacle on the straight path leaves the finding undecided.

The approach is the glide that the autopilot lays out (`GroundRules.glide`).
"""

import math
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple

from flight.mission.items import Command
from flight.mission.placing import HOME_ALTITUDE_TOLERANCE_M, SAME_POSITION_DISTANCE_M
from logs.verdict.findings import GROUND_PATH, Finding, Message, make_finding, message
from logs.verdict.measures.ground_paths import (
    GroundPath,
    has_ground_paths,
    hazard_on_path,
    landing_item,
    min_path_clearance,
    straight_path,
    takeoff_item,
)
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.rule import Rule
from logs.verdict.suggestions import home_height, home_height_text
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

# Smallest slope of a climb that is checked for obstacles, m per m.
_MIN_CLIMB_SLOPE = 1e-3
# Step between the launch courses that `_clear_courses_text` tries, deg.
_COURSE_STEP_DEG = 10


# ----------------------------------------------------------------------
# Obstacles on a path.


class _Obstacles(NamedTuple):
    """Obstacles on a path.

    clearance: minimum height above ground, m; NaN if unknown.
    distance: distance along the path to the minimum height, m.
    entered_hazard: sphere or zone that the path enters, "" if it enters none.
    """

    clearance: float
    distance: float
    entered_hazard: str

    @property
    def is_clear(self) -> bool:
        """True if the path hits neither ground nor sphere nor zone; False if the ground is unknown."""
        return self.clearance >= 0.0 and not self.entered_hazard

    def obstacle_message(self, subject: str, origin: str, condition: str = "") -> Message:
        """Describe the obstacle.

        subject: name of the path.
        origin: text on the place from which `distance` is measured, such as "from home".
        condition: words on the slope at which the path is flown; "" for none.
        """
        if self.entered_hazard:
            return message(f"{subject} enters {self.entered_hazard}")
        return message(
            f"{subject} hits the ground",
            f"{condition}: {self.distance:.0f} m {origin} it is {-self.clearance:.0f} m below the surface",
        )


def _climb_slopes(requirements: RouteRequirements, leg: int, course: float, altitude: float) -> tuple[float, float]:
    """Return the nominal and the certain maximum climb slope on a course at a leg's airspeed, m per m.

    The certain slope is the nominal slope reduced by the uncertainty of the aircraft's model.

    course: rad.
    altitude: m AMSL.
    """
    speed, limits = float(requirements.route.leg_airspeeds[leg]), requirements.limits
    max_slope, certain_slope = (
        limit_set.slopes(course, altitude, speed)[0] for limit_set in (limits, limits.with_margin())
    )
    return math.tan(max_slope), math.tan(certain_slope)


# ----------------------------------------------------------------------
# The climb-out.


def climbout_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the climb from home to the first waypoint.

    Return [] if home or the terrain is missing, if the first waypoint is over home, if the take-off is vertical, or if
    the take-off itself was simulated.
    """
    home, terrain = requirements.setup.mission.home, requirements.setup.scenario.terrain
    if not has_ground_paths(requirements) or home is None or terrain is None:
        return []
    if requirements.ground_phases is not None and requirements.ground_phases.procedures.take_off is not None:
        return []
    east, north = to_map(requirements.setup.scenario.origin, home.lat_deg, home.lon_deg)
    start = (float(east), float(north))
    first_waypoint, takeoff = takeoff_item(requirements.setup)
    first_point, ground_altitude = requirements.points[first_waypoint], float(terrain.height(*start))
    place = requirements.waypoint_place(first_waypoint)
    if takeoff is not None:
        if takeoff.command == Command.NAV_VTOL_TAKEOFF:
            return []
        # The launch is on the scenario's course, or along the first leg if the scenario states no course.
        stated_launch = requirements.setup.scenario.launch
        course, slope = float(requirements.courses[0]), math.tan(float(requirements.slopes[0]))
        launch = _Launch(course, float(requirements.runs[0]), slope)
        if stated_launch is not None and stated_launch.course is not None:
            course_text = f"on the launch course {round(math.degrees(stated_launch.course)) % 360}°"
            launch = launch._replace(course_text=course_text)
            if abs(float(wrap(stated_launch.course - course))) > PLAN_TOLERANCE_RAD:
                course = stated_launch.course
                launch = _Launch(course, leg_length=math.inf, slope=0.0, course_text=course_text)
    else:
        course = math.atan2(first_point[0] - start[0], first_point[1] - start[1])
        distance = math.dist(first_point[:2], start)
        if distance < SAME_POSITION_DISTANCE_M:
            return []
    if math.isnan(ground_altitude):
        return [
            _unjudged_finding("climbout", place, "the terrain at home is unknown", is_undecided=takeoff is not None)
        ]
    max_slope, certain_slope = _climb_slopes(requirements, max(0, first_waypoint - 1), course, ground_altitude)
    if not max_slope > 0.0:
        reason = "the aircraft cannot climb there at this speed and in this wind"
        return [_unjudged_finding("climbout", place, reason, is_undecided=takeoff is not None)]
    if takeoff is None:
        # A climb from the ground, then a straight line to the first waypoint.
        top_altitude = max(float(first_point[2]), ground_altitude + FIRST_CLIMB_HEIGHT_M)
        climb_distance = (top_altitude - ground_altitude) / max_slope
        profile = [(0.0, ground_altitude), (climb_distance, top_altitude), (distance, float(first_point[2]))]
        if climb_distance >= distance:
            profile = [(0.0, ground_altitude), (distance, ground_altitude + max_slope * distance)]
        path = straight_path(start, course, profile)
        return [_air_start_finding(place, _find_obstacles(requirements, path))]
    takeoff_altitude = float(requirements.points[0, 2])
    if takeoff_altitude <= ground_altitude:
        reason = f"the take-off ends {ground_altitude - takeoff_altitude:.0f} m below the ground at home"
        return [_unjudged_finding("climbout", place, reason, is_undecided=True)]
    if home_height(requirements.setup) < -HOME_ALTITUDE_TOLERANCE_M:
        return [_unjudged_finding("climbout", place, home_height_text(requirements.setup), is_undecided=False)]
    steepest, gentlest = (
        _take_off_climb(requirements, start, launch, (ground_altitude, takeoff_altitude), slope)
        for slope in (max_slope, max(_MIN_CLIMB_SLOPE, MIN_CLIMB_FRACTION * certain_slope))
    )
    return [
        _launch_finding(
            requirements,
            launch,
            place,
            steepest,
            gentlest,
            (start, ground_altitude, takeoff_altitude),
            certain_slope,
        )
    ]


def _unjudged_finding(rule: str, place: Place, reason: str, *, is_undecided: bool) -> Finding:
    """Make the finding on a climb-out or an approach that cannot be judged.

    rule: "climbout" or "approach".
    is_undecided: True if this finding leaves the verdict undecided.
    """
    title = "climb-out" if rule == "climbout" else rule
    fault = message(f"the {title} at {place_text(place)} is not judged: {reason}")
    return make_finding(
        rule, place, ok=None, reason=reason, faults=[fault], unit="m", check=GROUND_PATH if is_undecided else ""
    )


class _Launch(NamedTuple):
    """Course on which a take-off climbs, and the first leg if it has the same course.

    course: rad.
    leg_length: length of the leg, m; inf if the first leg has another course.
    slope: slope of the leg, m per m; 0 if the first leg has another course.
    course_text: description of the course, "" if the scenario states no course.
    """

    course: float
    leg_length: float
    slope: float
    course_text: str = ""


class _Climb(NamedTuple):
    """Straight climb of a take-off from home.

    slope: m per m.
    length: horizontal distance of its end from home, m.
    obstacles: obstacles on the climb.
    """

    slope: float
    length: float
    obstacles: _Obstacles


def _take_off_climb(
    requirements: RouteRequirements,
    start: tuple[float, float],
    launch: _Launch,
    altitudes: tuple[float, float],
    slope: float,
) -> _Climb:
    """Lay out the take-off climb with a given slope (m per m), and find the obstacles on it.

    start: east and north of home, m.
    altitudes: altitudes of the ground at home and of the end of the take-off, m AMSL.
    """
    # A straight climb until the aircraft is on the first leg.
    ground, leg_start = altitudes
    climb_distance = (leg_start - ground) / slope
    if climb_distance < launch.leg_length:
        slope_difference = slope - launch.slope
        joining_distance = (leg_start - ground) / slope_difference if slope_difference > 0.0 else math.inf
        climb_distance = min(launch.leg_length, max(climb_distance, joining_distance))
    profile = [(0.0, ground), (climb_distance, ground + slope * climb_distance)]
    obstacles = _find_obstacles(requirements, straight_path(start, launch.course, profile))
    return _Climb(slope, profile[-1][0], obstacles)


def _find_obstacles(requirements: RouteRequirements, path: GroundPath) -> _Obstacles:
    """Find the obstacles on a path from home.

    The height above ground is not checked on the first `LAUNCH_RUN_M`.  If the whole path is shorter, it is inf.
    """
    terrain, end = requirements.setup.scenario.terrain, float(path.distance[-1])
    entered_hazard = hazard_on_path(requirements, path)
    if terrain is None or end <= LAUNCH_RUN_M:
        return _Obstacles(clearance=math.inf, distance=0.0, entered_hazard=entered_hazard)
    return _Obstacles(*min_path_clearance(terrain, path.between(LAUNCH_RUN_M, end)), entered_hazard)


def _air_start_finding(place: Place, obstacles: _Obstacles) -> Finding:
    """Judge the straight climb from home to the first waypoint of a mission that starts in the air."""
    subject = f"the climb from home to {_item_text(place)}"
    if math.isnan(obstacles.clearance) and not obstacles.entered_hazard:
        reason, check, ok = f"the terrain below {subject} is unknown", "", None
    elif obstacles.is_clear:
        reason = f"straight from home: {_clearance_text(obstacles)}; not flown, because the flight begins in the air"
        check = ""
        ok = True
    else:
        subject = f"the flight starts in the air, but a straight climb from home to {_item_text(place)}"
        fault = obstacles.obstacle_message(subject, "from home", " even at the maximum climb angle")
        return _path_finding("climbout", place, obstacles, ok=None, outcome=fault, check=GROUND_PATH)
    return _path_finding("climbout", place, obstacles, ok, message(reason), check)


def _launch_finding(
    requirements: RouteRequirements,
    launch: _Launch,
    place: Place,
    steepest: _Climb,
    gentlest: _Climb,
    start: tuple[tuple[float, float], float, float],
    certain_slope: float,
) -> Finding:
    """Judge the climb of a mission that takes off, towards its next waypoint or on a launch course.

    steepest: steepest climb of the aircraft.
    gentlest: climb at `MIN_CLIMB_FRACTION` of the certain slope.
    start: launch position (east, north, m), its ground altitude and the altitude at the end of the climb (m AMSL).
    certain_slope: steepest climb reduced by the uncertainty of the aircraft's model, m per m.
    """
    to_item, obstacles = requirements.leg_place(0).to_item, steepest.obstacles
    item_text = "the next waypoint" if to_item is None else f"item {to_item}"
    direction_text = launch.course_text or f"towards {item_text}"
    subject = f"the climb from home {direction_text}"
    if math.isnan(obstacles.clearance) and not obstacles.entered_hazard:
        reason = message(f"the terrain below {subject} is unknown")
        return _path_finding("climbout", place, obstacles, ok=None, outcome=reason)
    is_certain, end_height = certain_slope == steepest.slope, start[2] - start[1]
    if not obstacles.is_clear:
        fault = obstacles.obstacle_message(subject, "from home", " even at the maximum climb angle")
        climb_text = _climb_text(steepest, launch, item_text, end_height)
        text = f"{fault.text}. {climb_text}. {_clear_courses_text(requirements, *start)}"
        fault = replace(fault, text=text)
        return _path_finding(
            "climbout", place, obstacles, False if is_certain else None, fault, "" if is_certain else GROUND_PATH
        )
    certain_text = "" if is_certain else "certain "
    subject += f", at {100.0 * MIN_CLIMB_FRACTION:.0f} % of the steepest {certain_text}climb,"
    min_obstacles = gentlest.obstacles
    if math.isnan(min_obstacles.clearance) and not min_obstacles.entered_hazard:
        reason = message(f"{subject} leads to where the terrain is unknown")
        return _path_finding("climbout", place, obstacles, ok=None, outcome=reason)
    if not min_obstacles.is_clear:
        fault = min_obstacles.obstacle_message(subject, "from home")
        climb_text = _climb_text(gentlest, launch, item_text, end_height)
        limit_text = (
            ""
            if is_certain
            else (
                f". The steepest climb is {_degrees_text(steepest.slope)}, but only"
                f" {_degrees_text(max(0.0, certain_slope))} is certain for this aircraft"
            )
        )
        fault = replace(fault, text=f"{fault.text}. {climb_text}{limit_text}")
        return _path_finding("climbout", place, obstacles, ok=None, outcome=fault, check=GROUND_PATH)
    return _path_finding(
        "climbout",
        place,
        obstacles,
        ok=True,
        outcome=message(f"{direction_text}: {_clearance_text(obstacles)}"),
    )


def _climb_text(climb: _Climb, launch: _Launch, item_text: str, end_height: float) -> str:
    """Describe the angle of a climb, and its end if that lies beyond the leg to its item.

    item_text: name of the item at the end of the leg.
    end_height: height above home at which the take-off ends, m.
    """
    text = f"The climb angle is {_degrees_text(climb.slope)}"
    # The take-off holds its course until it has reached its height.
    if climb.length > launch.leg_length:
        text += (
            f", and the climb ends {end_height:.0f} m above home after {climb.length:.0f} m. {item_text.capitalize()}"
            f" is only {launch.leg_length:.0f} m from home"
        )
    return text


def _degrees_text(slope: float) -> str:
    """Return a slope (m per m) as an angle, such as "1.7°"."""
    return f"{math.degrees(math.atan(slope)):.1f}°"


def _clear_courses_text(
    requirements: RouteRequirements, home_position: tuple[float, float], ground_altitude: float, top_altitude: float
) -> str:
    """Describe the widest range of launch courses on which the steepest climb is clear of obstacles.

    home_position: east and north, m.
    ground_altitude, top_altitude: altitudes of the ground at home and of the end of the climb, m AMSL.
    """

    def is_clear(course: float) -> bool:
        """Return True if a launch on a course (rad) climbs to the take-off's altitude without obstacles."""
        climb, _ = _climb_slopes(requirements, 0, course, ground_altitude)
        if not climb > 0.0:
            return False
        return _find_obstacles(
            requirements,
            straight_path(
                home_position,
                course,
                [(0.0, ground_altitude), ((top_altitude - ground_altitude) / climb, top_altitude)],
            ),
        ).is_clear

    courses = list(range(0, 360, _COURSE_STEP_DEG))
    is_course_clear = [is_clear(math.radians(course)) for course in courses]
    if not any(is_course_clear):
        return "No launch course is clear of obstacles"
    # Begin after a course with obstacles, so that no range is cut at north.
    start = is_course_clear.index(False) if False in is_course_clear else 0
    courses_from_start = [
        (courses[k % len(courses)], is_course_clear[k % len(courses)]) for k in range(start, start + len(courses))
    ]
    ranges = [
        [course for course, _ in group]
        for is_clear_range, group in groupby(courses_from_start, key=lambda entry: entry[1])
        if is_clear_range
    ]
    widest_range = max(ranges, key=len)
    if len(widest_range) == 1:
        return f"A launch course of {widest_range[0]:03d}° would be clear of obstacles"
    return f"A launch course of {widest_range[0]:03d}° to {widest_range[-1]:03d}° would be clear of obstacles"


# ----------------------------------------------------------------------
# The approach.


def approach_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the glide from the last waypoint to the landing point.

    Return [] if the mission does not land, if the terrain is unknown, or if the landing was flown.
    """
    landing, terrain, setup = landing_item(requirements.setup), requirements.setup.scenario.terrain, requirements.setup
    if landing is None or terrain is None or not has_ground_paths(requirements):
        return []
    if requirements.ground_phases is not None and requirements.ground_phases.procedures.approach is not None:
        return []
    waypoint, leg = landing[0], landing[0] - 1
    place, item_text = requirements.waypoint_place(waypoint), _item_text(requirements.waypoint_place(waypoint))
    glide_start, landing_point = requirements.straight_start(leg), requirements.points[waypoint]
    length, course = requirements.straight_length(leg), float(requirements.courses[leg])
    start_altitude, point_altitude = float(glide_start[2]), setup.route.landing_ground
    ground_altitude = float(terrain.height(float(landing_point[0]), float(landing_point[1])))
    if point_altitude is None or math.isnan(ground_altitude) or length < MIN_LEG_LENGTH_M:
        reason = "the terrain height at the landing point is unknown"
        return [_unjudged_finding("approach", place, reason, is_undecided=True)]
    if start_altitude <= point_altitude:
        reason = f"the glide begins {point_altitude - start_altitude:.0f} m below the landing point"
        return [_unjudged_finding("approach", place, reason, is_undecided=True)]
    tailwind, _ = setup.scenario.wind.components_on_course(course, point_altitude)
    glide = setup.autopilot.ground.glide(start_altitude - point_altitude, length, tailwind, point_altitude)
    flare = (length - glide.flare_distance, point_altitude + glide.flare_height)
    path = straight_path(
        glide_start,
        course,
        [(0.0, start_altitude), *([flare] if glide.flare_distance > 0.0 else []), (length, point_altitude)],
    )
    end, clearance, position = length - EARLY_TOUCHDOWN_DISTANCE_M, math.inf, 0.0
    if end > 0.0:
        clearance, position = min_path_clearance(terrain, path.between(0.0, end))
    obstacles = _Obstacles(clearance, length - position, hazard_on_path(requirements, path))
    subject = f"the glide to {item_text}"
    if math.isnan(obstacles.clearance) and not obstacles.entered_hazard:
        return [
            _path_finding(
                "approach", place, obstacles, ok=None, outcome=message(f"the terrain below {subject} is unknown")
            )
        ]
    obstacle_message = obstacles.obstacle_message(subject, "before the landing point")
    # A glide to a landing point below the ground hits the ground early.  The elevation data may be wrong by metres.
    if (
        obstacles.entered_hazard
        or obstacles.clearance + min(LANDING_POINT_ERROR_M, max(0.0, ground_altitude - point_altitude)) < 0.0
    ):
        return [_path_finding("approach", place, obstacles, ok=False, outcome=obstacle_message)]
    if obstacles.clearance < 0.0:
        fault = message(
            f"the landing point of {item_text} is {ground_altitude - point_altitude:.0f} m below the ground",
            f": {obstacle_message.text}",
        )
        return [_path_finding("approach", place, obstacles, ok=None, outcome=fault, check=GROUND_PATH)]
    if point_altitude - ground_altitude > LANDING_POINT_ERROR_M:
        fault = message(
            f"the landing point of {item_text} is {point_altitude - ground_altitude:.0f} m above the ground"
        )
        return [_path_finding("approach", place, obstacles, ok=None, outcome=fault, check=GROUND_PATH)]
    judged_end = length - glide.flare_distance - max(0.0, FLARE_HEIGHT_MARGIN_M - glide.flare_height) / glide.slope
    clearance = min_path_clearance(terrain, path.between(0.0, judged_end))[0] if judged_end > 0.0 else math.inf
    if clearance < GLIDE_PATH_TOLERANCE_M:
        fault = message(
            f"{subject} clears the ground by only {clearance:.1f} m",
            f"; the flight may be {GLIDE_PATH_TOLERANCE_M:.0f} m lower than planned",
        )
        return [_path_finding("approach", place, obstacles, ok=None, outcome=fault, check=GROUND_PATH)]
    reason = f"glides down at {math.degrees(math.atan(glide.slope)):.1f}°"
    if glide.flare_distance > 0.0:
        reason += (
            f", flares {glide.flare_height:.1f} m above the landing point and {glide.flare_distance:.0f} m before it"
        )
    reason += f"; {_clearance_text(obstacles)} until {EARLY_TOUCHDOWN_DISTANCE_M:.0f} m before the landing point"
    reason += "" if setup.ground_phases.approach is not None else "; not flown, because the flight ends in the air"
    return [_path_finding("approach", place, obstacles, ok=True, outcome=message(reason))]


# ----------------------------------------------------------------------


def _item_text(place: Place) -> str:
    """Name the mission item of a waypoint, or "the first waypoint" if the waypoint has no item."""
    return "the first waypoint" if place.item is None else f"item {place.item}"


def _clearance_text(obstacles: _Obstacles) -> str:
    """Describe the minimum height above ground on a path without obstacles.

    The text is "no obstacle" if no height was checked.
    """
    return (
        "no obstacle"
        if math.isinf(obstacles.clearance)
        else f"{obstacles.clearance:.0f} m above ground at the lowest point"
    )


def _path_finding(
    rule: str, place: Place, obstacles: _Obstacles, ok: bool | None, outcome: Message, check: str = ""
) -> Finding:
    """Make the finding on a climb-out or an approach, with its height above ground as the number.

    rule: "climbout" or "approach".
    ok: None if the finding is not judged.
    outcome: message with the reason; it is a fault unless the finding passes.
    check: see `logs.verdict.findings.Finding`.
    """
    return make_finding(
        rule,
        place,
        ok=ok,
        reason=outcome.text,
        faults=[] if ok else [outcome],
        planned=obstacles.clearance,
        limit=0.0,
        at_least=True,
        source="terrain",
        tolerance=0.0,
        margin=None if obstacles.entered_hazard else obstacles.clearance,
        unit="m",
        method="computed from the mission's items, without sampling error over the terrain data",
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
