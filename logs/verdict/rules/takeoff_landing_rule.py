"""The take-off and landing rules: judge the climb to a mission's first place, and its final approach.

A flight begins and ends in the air, so both are judged from only the mission's places, whether or not the mission was
flown.  An approach steeper than the aircraft can sink misses its landing place, and fails.  A climb steeper than the
aircraft can climb is not judged, because QGroundControl draws a climb-out of 30 degrees (its TakeoffMissionItem), and
autopilots continue to climb.  Any part of a mission's own take-off or landing that is not judged leaves the verdict
undecided.
"""

import math

from flight.mission.items import LANDINGS, TAKEOFFS, command_name
from flight.mission.return_path import RTL_NOT_CONTINUED_TEXT
from logs.verdict.findings import GROUND_PATH, Finding, make_finding, message
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.tolerances import PLAN_TOLERANCE_RAD
from logs.verdict.wording import gentle_launch_text, place_text
from world.airfield import Launch

# Verb for a flight that begins or ends in the air, without this phase.
_PHASE_VERBS = {"takeoff": "begins", "landing": "ends"}
_PHASE_TITLES = {"takeoff": "take-off", "landing": "landing"}
# Result for a slope beyond the limit.
_RESULT_BEYOND_LIMIT = {"takeoff": None, "landing": False}


def takeoff_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the climb from the ground at home to the take-off item's waypoint; return [] without a take-off item.

    Return [] also if the take-off was flown, because the launch rule then judges it.
    """
    if requirements.ground_phases is not None and requirements.ground_phases.procedures.take_off is not None:
        return []
    route, mission = requirements.setup.route, requirements.setup.mission
    items = [item for item in mission.items if item.command in TAKEOFFS]
    waypoint = _last_waypoint_of_item(requirements, items[0].seq) if items else -1
    # A take-off item in the air is a waypoint like any other.
    if waypoint < 0 or (route.items[:waypoint] >= 0).any():
        return []
    altitude, home = float(requirements.points[waypoint, 2]), mission.home
    has_own_position = home is not None and (items[0].lat_deg, items[0].lon_deg) != (home.lat_deg, home.lon_deg)
    launch = requirements.setup.scenario.launch
    if launch is not None and (launch_findings := _gentle_launch_findings(requirements, launch)):
        return launch_findings
    if launch is not None and (waypoint == 0 or not has_own_position):
        # From the ground at home to the next waypoint, on the launch course.
        next_altitude = float(requirements.points[waypoint + 1, 2])
        return [_slope_finding(requirements, "takeoff", waypoint, waypoint + 1, route.takeoff_ground, next_altitude)]
    if waypoint == 0 or not has_own_position:
        reason = f"the autopilot chooses the course of the climb to {altitude:.0f} m AMSL over home"
        return [_unjudged_finding("takeoff", requirements.waypoint(waypoint), reason)]
    source = requirements.setup.source
    if source is not None and not source.aircraft_known:
        return [_unjudged_finding("takeoff", requirements.waypoint(waypoint), "the aircraft is not named (--aircraft)")]
    # The flight starts over home, and climbs to the take-off item's own waypoint.
    return [_slope_finding(requirements, "takeoff", 0, waypoint, route.takeoff_ground, altitude)]


def _gentle_launch_findings(requirements: RouteRequirements, launch: Launch) -> list[Finding]:
    """Return a finding if a launch accelerates the aircraft too little to start the motor, otherwise [].

    The list is empty, too, if the autopilot needs no acceleration to start the motor.
    """
    setup = requirements.setup
    trigger, acceleration = setup.autopilot.ground.launch_trigger, launch.acceleration(setup.default_launch_speed)
    if trigger is None or acceleration >= trigger[0]:
        return []
    fault = message(gentle_launch_text(acceleration, trigger), ": the motor never starts")
    return [
        make_finding(
            "takeoff",
            requirements.waypoint(0),
            ok=False,
            reason=fault.text,
            faults=[fault],
            planned=acceleration,
            limit=trigger[0],
            at_least=True,
            source="autopilot",
            margin=acceleration - trigger[0],
            unit="m/s2",
            method="v²/2L of the scenario's launch",
        )
    ]


def landing_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the descent from the last waypoint to the landing; return [] for a mission without a landing item.

    Return [] also if the landing was flown, because the touchdown rule then judges it.
    """
    if requirements.ground_phases is not None and requirements.ground_phases.procedures.approach is not None:
        return []
    items = [item for item in requirements.setup.mission.items if item.command in LANDINGS]
    landing_waypoints = [waypoint for item in items if (waypoint := _last_waypoint_of_item(requirements, item.seq)) > 0]
    if not landing_waypoints:
        if not items:
            return []
        reason = f"{command_name(items[-1].command)} has no position of its own on the route"
        route = requirements.setup.route
        if route.rtl_start is not None:
            reason = RTL_NOT_CONTINUED_TEXT
        end_waypoint, is_return_continued = (
            requirements.waypoint(requirements.legs),
            RTL_NOT_CONTINUED_TEXT in " ".join(route.notes),
        )
        if route.rtl_start is not None and not is_return_continued:
            # The return ends the mission; the landing after it is not flown.
            return [make_finding("landing", end_waypoint, ok=None, reason=reason, unit="deg")]
        return [_unjudged_finding("landing", end_waypoint, reason)]
    waypoint, ground_altitude = landing_waypoints[-1], requirements.setup.route.landing_ground
    return [
        _slope_finding(
            requirements,
            "landing",
            waypoint - 1,
            waypoint,
            float(requirements.points[waypoint - 1, 2]),
            ground_altitude,
        )
    ]


def _last_waypoint_of_item(requirements: RouteRequirements, seq: int) -> int:
    """Return the last waypoint that belongs to a mission item, or -1 if there is none."""
    waypoints = [k for k, item in enumerate(requirements.setup.route.items) if int(item) == seq]
    return waypoints[-1] if waypoints else -1


def _slope_finding(
    requirements: RouteRequirements,
    rule: str,
    first: int,
    last: int,
    first_altitude: float | None,
    last_altitude: float | None,
) -> Finding:
    """Judge the slope from `first_altitude` at waypoint `first` to `last_altitude` at waypoint `last`, m AMSL.

    rule: "takeoff" or "landing".
    An altitude is None if the terrain there is unknown.
    """
    waypoint_place = requirements.waypoint(last)
    distance = float(requirements.runs[first:last].sum())
    if first_altitude is None or last_altitude is None:
        return _unjudged_finding(rule, waypoint_place, "the altitude of the terrain there is unknown")
    slope = math.atan2(last_altitude - first_altitude, distance)
    limit, source = _slope_limit(requirements, first, first_altitude, last_altitude, slope)
    verb = "climbs" if slope >= 0.0 else "sinks"
    text = f"{verb} {abs(last_altitude - first_altitude):.0f} m in {distance:.0f} m, {math.degrees(abs(slope)):.1f}°"
    is_within = abs(slope) <= limit + PLAN_TOLERANCE_RAD
    ground_phases = requirements.setup.ground_phases
    is_flown = (ground_phases.take_off if rule == "takeoff" else ground_phases.approach) is not None
    reason = f"{text} (at most {math.degrees(limit):.1f}°)"
    reason += "" if is_flown else f"; not flown, because the flight {_PHASE_VERBS[rule]} in the air"
    fault = message(
        f"the {_PHASE_TITLES[rule]} {text}",
        f"; at most {math.degrees(limit):.1f}° can be flown at this speed and in this wind",
    )
    ok = True if is_within else _RESULT_BEYOND_LIMIT[rule]
    return make_finding(
        rule,
        waypoint_place,
        ok=ok,
        reason=reason if is_within else fault.text.removeprefix(f"the {_PHASE_TITLES[rule]} "),
        faults=[] if is_within else [fault],
        planned=math.degrees(abs(slope)),
        limit=math.degrees(limit),
        source=source,
        tolerance=math.degrees(PLAN_TOLERANCE_RAD),
        margin=math.degrees(limit - abs(slope)),
        unit="deg",
        method="mission items",
        check=GROUND_PATH if ok is None else "",
    )


def _unjudged_finding(rule: str, place: Place, reason: str) -> Finding:
    """Return a finding that a take-off or landing is not judged, which leaves the verdict undecided."""
    fault = message(f"the {_PHASE_TITLES[rule]} at {place_text(place)} is not judged")
    return make_finding(rule, place, ok=None, reason=reason, faults=[fault], unit="deg", check=GROUND_PATH)


def _slope_limit(
    requirements: RouteRequirements, leg: int, first_altitude: float, last_altitude: float, slope: float
) -> tuple[float, str]:
    """Return the slope limit (rad) of a climb or descent on a leg's course, and the name of its source.

    slope: rad; its sign selects the limit for a climb or for a descent.
    """
    direction, limits = (0 if slope >= 0.0 else 1), requirements.limits
    speed, course = float(requirements.route.leg_airspeeds[leg]), float(requirements.courses[leg])
    aircraft_limit = min(
        limits.slopes(course, altitude, speed)[direction] for altitude in (first_altitude, last_altitude)
    )
    scenario_limit = (limits.max_climb, limits.max_dive)[direction]
    if scenario_limit is not None and scenario_limit < aircraft_limit:
        return scenario_limit, "scenario"
    return aircraft_limit, "aircraft"


TAKEOFF = Rule(
    name="takeoff",
    tolerances=("PLAN_TOLERANCE_RAD",),
    judge=takeoff_findings,
)
LANDING = Rule(
    name="landing",
    tolerances=("PLAN_TOLERANCE_RAD",),
    judge=landing_findings,
    log=LogNeeds(needs_aircraft=True),
)
