"""The take-off and landing rules: judge the slopes of take-off climb and final approach.

A simulated flight usually begins and ends in the air, so both are judged from the mission's items, whether or not the
mission was flown.  An approach steeper than the aircraft can sink misses its landing place, and fails.  A climb steeper
than the aircraft can climb is undecided, because QGroundControl draws a climb-out of 30 degrees (its
TakeoffMissionItem), and autopilots continue to climb.  Any part of a mission's own take-off or landing that is not
judged leaves the verdict undecided, and so does a slope that is close to the limit of an uncertain aircraft model.
"""

import math

from flight.mission.items import LANDINGS, TAKEOFFS, command_name
from flight.mission.return_path import RTL_NOT_CONTINUED_TEXT
from logs.verdict.findings import GROUND_PATH, UNKNOWN_AIRCRAFT, Finding, Message, make_finding, message
from logs.verdict.measures.route_requirements import RouteRequirements, ground_slope_limit
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_gentler_landing
from logs.verdict.tolerances import LEVEL_SLOPE_RAD, PLAN_TOLERANCE_RAD
from logs.verdict.wording import compared_texts, gentle_launch_text, place_text

# Verb, by rule, for the text that a flight begins or ends in the air if the phase is not flown.
_PHASE_VERBS = {"takeoff": "begins", "landing": "ends"}
_PHASE_TITLES = {"takeoff": "take-off", "landing": "landing"}
# Check, by rule, of a slope that is undecided because the aircraft's model is uncertain.
_UNCERTAIN_CHECK = {"takeoff": GROUND_PATH, "landing": UNKNOWN_AIRCRAFT}
# Result, by rule, for a slope beyond the limit.
_RESULT_BEYOND_LIMIT = {"takeoff": None, "landing": False}


def takeoff_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the slope of the climb from home to the take-off item's waypoint.

    With a launch in the scenario, the climb to the next waypoint is judged if the item has no position of its own, and
    a launch too gentle to start the motor fails.  Return [] without a take-off item on the ground, and for a flown
    take-off, which the launch rule judges.
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
    setup, launch = requirements.setup, requirements.setup.scenario.launch
    trigger = setup.autopilot.ground.launch_trigger
    acceleration = math.inf if launch is None else launch.acceleration(setup.default_launch_speed)
    if trigger is not None and acceleration < trigger[0]:
        # The launch accelerates the aircraft too little to start the motor.
        fault = message(gentle_launch_text(acceleration, trigger), ": the motor never starts")
        return [
            make_finding(
                "takeoff",
                requirements.waypoint_place(0),
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
    if launch is not None and (waypoint == 0 or not has_own_position):
        # The climb leads from the ground at home to the next waypoint, on the launch course.
        next_altitude = float(requirements.points[waypoint + 1, 2])
        return [_slope_finding(requirements, "takeoff", waypoint, waypoint + 1, route.takeoff_ground, next_altitude)]
    if waypoint == 0 or not has_own_position:
        reason = f"the autopilot chooses the course of the climb to {altitude:.0f} m AMSL over home"
        return [_unjudged_finding("takeoff", requirements.waypoint_place(waypoint), reason)]
    imported_log = requirements.setup.imported_log
    if imported_log is not None and not imported_log.aircraft_known:
        return [
            _unjudged_finding(
                "takeoff", requirements.waypoint_place(waypoint), "no aircraft was named; name it with --aircraft"
            )
        ]
    # The flight starts over home, and climbs to the take-off item's own waypoint.
    return [_slope_finding(requirements, "takeoff", 0, waypoint, route.takeoff_ground, altitude)]


def landing_findings(
    requirements: RouteRequirements, _aligned: AlignedTrack | None = None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the slope from the last waypoint before the landing to the landing point.

    The finding is undecided if no waypoint of the route belongs to the landing.  Return [] without a landing item, and
    for a flown landing, which the touchdown rule judges.
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
        end_waypoint = requirements.waypoint_place(requirements.legs)
        is_return_continued = RTL_NOT_CONTINUED_TEXT in " ".join(route.notes)
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
    """Judge the slope of a take-off or a landing between two waypoints.

    rule: "takeoff" or "landing".
    first, last: waypoints.  If the first belongs to a loiter, the slope begins where the path leaves the circle.
    first_altitude, last_altitude: altitudes at these waypoints, m AMSL; None if the terrain there is unknown.
    """
    waypoint_place = requirements.waypoint_place(last)
    distance = requirements.straight_length(first) + float(requirements.runs[first + 1 : last].sum())
    if first_altitude is None or last_altitude is None:
        return _unjudged_finding(rule, waypoint_place, "the altitude of the terrain there is unknown")
    slope = math.atan2(last_altitude - first_altitude, distance)
    limit = ground_slope_limit(
        requirements,
        first,
        (first_altitude, last_altitude),
        is_climb=slope >= 0.0,
        is_landing=rule == "landing",
    )
    limit_deg = math.degrees(limit.limit)
    verb = "climbs" if slope >= 0.0 else "sinks"
    slope_text, limit_text = compared_texts(math.degrees(abs(slope)), limit_deg, "deg", 1)
    text = f"{verb} {abs(last_altitude - first_altitude):.0f} m in {distance:.0f} m, {slope_text}"
    ok: bool | None = True
    check, faults = "", list[Message]()
    ground_phases = requirements.setup.ground_phases
    is_flown = (ground_phases.take_off if rule == "takeoff" else ground_phases.approach) is not None
    if abs(slope) > limit.limit + PLAN_TOLERANCE_RAD:
        ok = _RESULT_BEYOND_LIMIT[rule]
        check = GROUND_PATH if ok is None else ""
        limit_text = f"; at most {limit_text} can be flown at {limit.airspeed:.1f} m/s and in this wind"
        if is_flown and rule == "landing":
            limit_text += " without gaining speed; a flight judges its touchdown instead"
        faults, reason = [message(f"the {_PHASE_TITLES[rule]} {text}", limit_text)], text + limit_text
    elif limit.certain < limit.limit and abs(slope) > max(limit.certain, LEVEL_SLOPE_RAD):
        ok, check, faults = None, _UNCERTAIN_CHECK[rule], [message(f"the {_PHASE_TITLES[rule]} {text}")]
        reason = (
            f"{text}; the limit according to {requirements.setup.envelope.source} is {limit_deg:.1f}° at"
            f" {limit.airspeed:.1f} m/s, but with its uncertainty only {math.degrees(limit.certain):.1f}° is certain"
        )
    else:
        reason = f"{text} (at most {limit_deg:.1f}° at {limit.airspeed:.1f} m/s)"
        reason += "" if is_flown else f"; not flown, because the flight {_PHASE_VERBS[rule]} in the air"
    return make_finding(
        rule,
        waypoint_place,
        ok=ok,
        reason=reason,
        faults=faults,
        planned=math.degrees(abs(slope)),
        limit=limit_deg,
        source=limit.source,
        tolerance=math.degrees(PLAN_TOLERANCE_RAD),
        margin=math.degrees(limit.limit - abs(slope)),
        unit="deg",
        method="mission items",
        check=check,
    )


def _unjudged_finding(rule: str, place: Place, reason: str) -> Finding:
    """Make the finding on a take-off or landing that cannot be judged, which leaves the verdict undecided."""
    fault = message(f"the {_PHASE_TITLES[rule]} at {place_text(place)} is not judged")
    return make_finding(rule, place, ok=None, reason=reason, faults=[fault], unit="deg", check=GROUND_PATH)


TAKEOFF = Rule(
    name="takeoff",
    tolerances=("PLAN_TOLERANCE_RAD", "LEVEL_SLOPE_RAD", "UNDECIDED_FRACTION"),
    judge=takeoff_findings,
)
LANDING = Rule(
    name="landing",
    tolerances=("PLAN_TOLERANCE_RAD", "LEVEL_SLOPE_RAD", "UNDECIDED_FRACTION"),
    judge=landing_findings,
    suggest=suggest_gentler_landing,
    log=LogNeeds(needs_aircraft=True),
)
