"""The mission rule: report items that PX4 would refuse, under the names of its checks.

The checks follow `FeasibilityChecker` and `MissionFeasibilityChecker` of PX4's navigator for a fixed wing, with PX4's
parameters: FW_LND_ANG, MIS_TKO_LAND_REQ (its fixed-wing default, 2, requires a landing), and MIS_DIST_1WP 10 km.  These
are PX4's own limits and say nothing about the aircraft, so items that only PX4 refuses are reported, and fail only if
PX4 is to fly.  A missing landing, which PX4 requires by default, fails only if the user's parameter file requires a
landing, because most missions have no landing and one parameter changes the requirement.  A command that neither PX4
nor ArduPlane supports fails for any autopilot, and so does a route beyond the mission's own fence.  Invalid latitudes,
longitudes, frames and numbers of items were refused when the file was read.
"""

import itertools
import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Literal

import numpy as np

from aircraft.catalog import find_logged_aircraft
from flight.autopilots.parts import FeasibilityLimits, MissionParts
from flight.mission.commands import SKIPPED_REASON, Treatment, command_support
from flight.mission.fences import fence_problem
from flight.mission.ground_phases import landing_slopes
from flight.mission.items import (
    FENCES,
    LANDINGS,
    OVER_HOME,
    OVER_TERRAIN,
    PLACES,
    TAKEOFFS,
    Command,
    Frame,
    Mission,
    MissionItem,
    command_name,
    is_navigation,
)
from flight.mission.itinerary import make_itinerary
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import NOT_FLOWN, Finding, Message, make_finding, message, undecided_findings
from logs.verdict.measures.mission_ends import judges_return_after_last_item, missing_ends_text
from logs.verdict.places import Place
from logs.verdict.rule import Rule
from logs.verdict.tolerances import (
    FULL_CELL_VOLTAGE_V,
    NOMINAL_CELL_VOLTAGE_V,
    PX4_FIRST_WAYPOINT_DISTANCE_M,
    PX4_GATE_SPACING_M,
    PX4_LANDING_BUFFER_RAD,
    PX4_WAYPOINT_SPACING_M,
)
from world.airfield import STEEPEST_STRIP_SLOPE
from world.errors import FlightError
from world.frames import GeoOrigin, to_map
from world.wording import count_text

C = Command


def mission_findings(setup: FlightSetup) -> list[Finding]:
    """Judge a mission's items by PX4's checks and planfly's own checks.

    Each check has one finding, on its most serious remark.  For ArduPlane, only failures of PX4's checks that hold
    for every autopilot are reported.
    """
    mission, origin, limits = setup.mission, setup.scenario.origin, setup.autopilot.checks.feasibility
    dialect = setup.autopilot.checks.dialect
    refuses = dialect == "px4"
    checks = (
        ("checkMissionItemValidity", _check_validity(mission, refuses)),
        ("checkTakeoff", _check_takeoff(mission)),
        ("checkFixedWingLanding", _check_landing(mission)),
        ("checkFixedWindLandApproach", _check_approach(mission, origin, limits)),
        ("checkTakeoffLandAvailable", _check_required_ends(mission, limits, refuses)),
        ("checkDistanceToFirstWaypoint", _check_first_distance(mission, origin)),
        ("checkDistancesBetweenWaypoints", _check_distances(mission, origin)),
        ("checkIfBelowHomeAltitude", _check_home_altitude(mission)),
        ("checkMissionAgainstGeofence", _check_fence(setup)),
    )
    findings = []
    for name, check_remarks in checks:
        source, check, function_text = "PX4", name, f" (see PX4's function {name})"
        remarks = list(check_remarks)
        if dialect == "ardupilot":
            # Items that only PX4 refuses do not concern a mission that ArduPlane flies.  The failures that remain hold
            # for every autopilot, and do not carry PX4's name.
            source, check, function_text = "mission", "", ""
            remarks = [remark for remark in remarks if remark[0] is False]
            if not remarks:
                continue
        # The finding has the gravest remark: failures come first, then undecided remarks, then mere notes.
        results: list[tuple[bool | None, int | None, str | Message]] = [
            ((False if refuses else None) if ok == REFUSED else ok, item, reason) for ok, item, reason in remarks
        ]
        results.sort(key=lambda result: {False: 0, None: 1, True: 2}[result[0]])
        ok, item, reason = results[0] if results else (True, None, "no objections")
        fault = reason if isinstance(reason, Message) else message(reason)
        # Remarks on the mission as a whole name no item.
        noun = "more remark" if any(other[1] is None for other in results[1:]) else "more item"
        findings.append(
            make_finding(
                "mission",
                Place("mission", item=item),
                ok=ok,
                reason=f"{fault.text}{_more_text(len(results) - 1, noun)}{function_text}",
                faults=[fault],
                source=source,
                method="mission items",
                check=check,
            )
        )
    refused_items = [
        item
        for item in mission.items
        if command_support(item.command).arduplane == Treatment.REFUSED != command_support(item.command).px4
    ]
    if refused_items and dialect == "ardupilot":
        function = "mavlink_int_to_mission_cmd"
        command_text = f"ArduPlane does not support {command_name(refused_items[0].command)}"
        fault = message(command_text, f"{_more_text(len(refused_items) - 1)}; PX4 accepts it")
        findings.append(
            make_finding(
                "mission",
                Place("mission", item=refused_items[0].seq),
                ok=False,
                reason=f"{fault.text} (see ArduPlane's function {function})",
                faults=[fault],
                source="ArduPlane",
                method="mission items",
                check=function,
            )
        )
    # No autopilot has a name for the last checks, which report the parts of a mission that are not judged.
    return [
        *findings,
        *([_unjoined_finding(setup)] if setup.route.unjoined_stops else []),
        *_unreached_findings(setup),
        *_unsimulated_findings(setup),
    ]


def blocking_findings(setup: FlightSetup) -> list[Finding]:
    """Return the findings on mission items that fail or leave the verdict undecided.

    The items of a plan are judged only if PX4 is to fly them, because planfly wrote them.
    """
    if setup.plan is not None and setup.autopilot.checks.dialect != "px4":
        return []
    return [finding for finding in mission_findings(setup) if finding.ok is False or undecided_findings([finding])]


# Remark of a check: result, item (None for the whole mission), and reason.  The result "refused" fails if PX4 is to
# fly; otherwise it is undecided.
REFUSED: Literal["refused"] = "refused"
_Remark = tuple[bool | Literal["refused"] | None, int | None, str | Message]


def _more_text(count: int, noun: str = "more item") -> str:
    """Return a text on further items or remarks, such as " (and 2 more items)"; "" without any."""
    return f" (and {count_text(count, noun)})" if count > 0 else ""


def _unjoined_finding(setup: FlightSetup) -> Finding:
    """Return a finding on a waypoint or loiter to which no tangent leads.

    The waypoint lies inside the circle of a loiter, or two loiters have no common tangent.

    The path to such a waypoint or loiter is not laid out, so it cannot be judged, and the finding fails.  For an
    imported flight the finding is not judged: see `logs.verdict.rules.completion_rule.imported_completion_finding`.
    """
    first_stop, *other_stops = setup.route.unjoined_stops
    autopilot = setup.autopilot.title
    if first_stop.is_circle:
        reason = f"no tangent joins its circle to the circle of item {first_stop.circle}"
    else:
        reason = f"lies inside the circle of item {first_stop.circle}"
    more_text = _more_text(len(other_stops))
    fault = message(
        reason,
        f": {autopilot} flies {('it anyway' if first_stop.is_circle else 'there')}, on a path that is not judged"
        f"{more_text}",
    )
    return make_finding(
        "mission",
        Place("mission", item=first_stop.item if first_stop.item >= 0 else None),
        ok=False if setup.imported_log is None else None,
        reason=fault.text,
        faults=[fault],
        source="route",
        method="mission items and circles laid out",
        check="unjoined",
    )


# Items after which a mission continues only if somebody sets the next item or arms the aircraft again.
_WAITING_ENDS = LANDINGS | {C.NAV_LOITER_UNLIM}
# Items that mark a landing sequence or a return path, which an autopilot may enter by itself after the mission.
_REENTRY_MARKS = (C.DO_LAND_START, C.DO_RETURN_PATH_START)


def _unreached_findings(setup: FlightSetup) -> list[Finding]:
    """Return a finding on navigation items after the mission's end; [] without any.

    These items are never reached.

    Items after a return to launch fail.  Items after a landing or an endless loiter are reached only if the pilot
    selects the next item, so they leave the verdict undecided.  Three kinds of items are not reported: items of a
    landing sequence and of a return path, which belong after the end, and items that a jump skips on purpose.
    """
    items = setup.mission.items
    if setup.imported_log is not None or not any(
        item.command in _WAITING_ENDS | {C.NAV_RETURN_TO_LAUNCH} for item in items
    ):
        return []
    itinerary = make_itinerary(setup.mission, resets_jump_counters=setup.autopilot.checks.resets_jump_counters)
    last = next((k for k, item in enumerate(items) if item.seq == itinerary.stops[-1].item), -1)
    end = items[last]
    if itinerary.endless_jump is not None or last < 0 or end.command not in _WAITING_ENDS | {C.NAV_RETURN_TO_LAUNCH}:
        return []
    later_items = itertools.takewhile(lambda item: item.command not in _REENTRY_MARKS, items[last + 1 :])
    unreached = [item for item in later_items if item.seq in itinerary.unreached and is_navigation(item.command)]
    if not unreached:
        return []
    is_waiting_end, first = end.command in _WAITING_ENDS, unreached[0]
    more_text = _more_text(len(unreached) - 1)
    end_text = f": {command_name(end.command)} (item {end.seq}) ends the mission"
    end_text += " until someone sets the next item" if is_waiting_end else ""
    item_text = f"item {first.seq}: " if is_waiting_end else ""
    fault = message(f"{item_text}{command_name(first.command)}{more_text} is never reached", end_text)
    return [
        make_finding(
            "mission",
            Place("mission", item=first.seq),
            ok=None if is_waiting_end else False,
            reason=fault.text,
            faults=[fault],
            source="route",
            method="mission items",
            check=NOT_FLOWN if is_waiting_end else "unreached",
        )
    ]


def _unsimulated_findings(setup: FlightSetup) -> Iterator[Finding]:
    """Yield an undecided finding for each item or setting that is not simulated.

    Only items and settings that change the flight path are reported.
    """
    remarks = [(open_item.item, open_item.text) for open_item in setup.route.open_items]
    if not setup.autopilot.checks.follows_terrain:
        items_above_terrain = sorted(set(setup.route.items[np.isfinite(setup.route.points["above_ground"])].tolist()))
        reason = f"the simulated {setup.autopilot.title} does not follow the item's height above terrain along the leg"
        remarks += [(seq, reason) for seq in items_above_terrain]
    if setup.scenario.returns is not None:
        # Returns from anywhere on the route are judged only to the mission's home.
        remarks += [
            (item.seq, f"{command_name(item.command)}: returns are judged only to the mission's home")
            for item in setup.mission.items
            if item.command == C.DO_SET_HOME
        ]
        if setup.autopilot.checks.dialect != "px4":
            remarks += [
                (
                    item.seq,
                    "the ground speed that DO_CHANGE_SPEED sets is not used in returns to launch; they are judged with"
                    " the parameter MIN_GROUNDSPEED",
                )
                for item in setup.mission.items
                if item.command == C.DO_CHANGE_SPEED and item.params[0] == 1.0
            ]
    slopes = landing_slopes(setup.mission, setup.route, setup.scenario)
    if setup.imported_log is None and slopes is not None and max(map(abs, slopes)) > STEEPEST_STRIP_SLOPE:
        steepest_text = f"the ground there has a slope of {max(map(abs, slopes)):.1%}"
        reason = f"NAV_LAND: not judged, because {steepest_text}; a touchdown is judged only on up to"
        remarks.append((int(setup.route.items[-1]), f"{reason} {STEEPEST_STRIP_SLOPE:.0%}"))
    # An imported flight was flown with its settings.
    texts = (
        setup.autopilot.checks.describe_unsimulated_settings(_mission_parts(setup))
        if setup.imported_log is None
        else []
    )
    # The route notes a loiter that is flown with another radius.
    unflown_radius = setup.autopilot.loiters.unflown_note
    if unflown_radius and unflown_radius in setup.route.notes and setup.imported_log is None:
        texts = [*texts, unflown_radius]
    settings = [(None, text) for text in texts]
    for seq, text in [*remarks, *settings]:
        # The text after "; " is an explanation, which is not part of the headline.
        brief, separator, explanation = text.partition("; ")
        yield make_finding(
            "mission",
            Place("mission", item=seq),
            ok=None,
            reason=text,
            faults=[message(brief if seq is None else f"item {seq}: {brief}", separator + explanation)],
            source="route",
            method="mission items",
            check=NOT_FLOWN,
        )


def _mission_parts(setup: FlightSetup) -> MissionParts:
    """Collect the properties of a mission that decide which settings have an effect."""
    items, procedures = setup.mission.items, setup.ground_phases
    commands = {item.command for item in items}
    pairs = itertools.pairwise(_flown_items(setup.mission))
    aircraft = None
    # The aircraft of a log may not be on this machine.
    with suppress(FlightError):
        aircraft = find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft)
    # The voltage is unknown if the aircraft has no battery, or a guessed one.
    cells = 0 if setup.envelope.battery_guessed else round(setup.envelope.volts / NOMINAL_CELL_VOLTAGE_V)
    mission = setup.mission
    if mission.home is None:
        rally_distance = math.nan if mission.rally else math.inf
    else:
        origin = GeoOrigin(mission.home.lat_deg, mission.home.lon_deg)
        rally_distance = min(
            (math.hypot(*map(float, to_map(origin, point.lat_deg, point.lon_deg))) for point in mission.rally),
            default=math.inf,
        )
    checks = setup.autopilot.checks
    fence_at_home = ""
    if mission.home is not None and mission.fences:
        origin = GeoOrigin(mission.home.lat_deg, mission.home.lon_deg)
        problem = fence_problem(mission.fences, origin, 0.0, 0.0, any_inclusion_suffices=checks.any_inclusion_suffices)
        fence_at_home = "" if problem is None else problem[0]
    return MissionParts(
        returns=C.NAV_RETURN_TO_LAUNCH in commands or judges_return_after_last_item(setup),
        has_return_path=C.DO_RETURN_PATH_START in commands,
        takes_off=procedures.take_off is not None,
        lands=procedures.approach is not None,
        loiters_to_land=any(
            item.command == C.NAV_LOITER_TO_ALT and next_item.command in LANDINGS for item, next_item in pairs
        ),
        has_fence=bool(setup.mission.fences),
        fence_at_home=fence_at_home,
        smallest_inclusion=min(
            (item.params[0] for item in setup.mission.fences if item.command == C.NAV_FENCE_CIRCLE_INCLUSION),
            default=math.inf,
        ),
        rally_distance=rally_distance,
        enables_fence=any(item.command == C.DO_FENCE_ENABLE and item.params[0] == 1.0 for item in items),
        throttled_airspeeds=tuple(
            item.params[1]
            for item in items
            if item.command == C.DO_CHANGE_SPEED and item.params[0] == 0.0 and min(item.params[1:3]) > 0.0
        ),
        follows_terrain=any(item.frame in OVER_TERRAIN and item.has_position for item in items),
        moves_payload=not commands.isdisjoint((C.DO_GRIPPER, C.DO_WINCH, C.DO_GIMBAL_MANAGER_PITCHYAW)),
        wind=setup.scenario.wind.max_speed_at(setup.route.positions[:, 2]),
        full_voltage=cells * FULL_CELL_VOLTAGE_V if cells else math.inf,
        commands=frozenset(commands),
        aircraft=aircraft,
    )


def _flown_items(mission: Mission) -> list[MissionItem]:
    """Return the items to whose position PX4 flies: waypoints, loiters, take-offs and landings."""
    return [item for item in mission.items if item.command in PLACES | TAKEOFFS | LANDINGS and item.has_position]


# Commands that PX4 accepts in a frame with coordinates.  It accepts all others only in `Frame.MISSION`
# (`parse_mavlink_mission_item` of its mission manager).  Mission Planner writes frame 3 for every command.
_PX4_LOCATED_COMMANDS = frozenset(
    {C.NAV_WAYPOINT, C.NAV_LOITER_UNLIM, C.NAV_LOITER_TIME, C.NAV_LOITER_TO_ALT, C.NAV_ROI, C.DO_SET_ROI}
    | {C.DO_SET_ROI_LOCATION, C.CONDITION_GATE, C.COMPONENT_ARM_DISARM, C.DO_AUTOTUNE_ENABLE}
    | TAKEOFFS
    | LANDINGS
    | FENCES
)


def _check_validity(mission: Mission, refuses: bool) -> Iterator[_Remark]:
    """Yield a remark on each item that PX4 refuses at upload.

    refuses: True if PX4 is to fly.  If False, a command without coordinates may have a frame with coordinates, because
        every file of Mission Planner contains such commands.
    """
    for item in mission.items:
        name, support = command_name(item.command), command_support(item.command)
        if support.px4 == Treatment.REFUSED:
            if support.arduplane == Treatment.REFUSED:
                yield False, item.seq, f"no autopilot supports {name}"
                continue
            verb = "skips" if support.reason == SKIPPED_REASON else "accepts"
            yield REFUSED, item.seq, f"PX4 does not support {name}; ArduPlane {verb} it"
        elif item.frame in OVER_TERRAIN and item.command in PLACES | TAKEOFFS | LANDINGS:
            yield (
                REFUSED,
                item.seq,
                f"{name} in frame {item.frame}, above terrain, which PX4 rejects and ArduPlane accepts",
            )
        elif refuses and item.frame != Frame.MISSION and item.command not in _PX4_LOCATED_COMMANDS:
            yield (
                REFUSED,
                item.seq,
                f"{name} in frame {item.frame}: PX4 accepts this command only in frame {int(Frame.MISSION)}",
            )
    if mission.items and mission.items[0].command == C.NAV_LAND:
        yield REFUSED, mission.items[0].seq, "the mission starts with a landing"


def _height_above_home(mission: Mission, item: MissionItem) -> float:
    """Return an item's height above home, m; NaN if unknown.

    A height above terrain is returned unchanged.
    """
    if item.frame in OVER_HOME | OVER_TERRAIN:
        return item.alt
    return item.alt - mission.home.alt if mission.home is not None else math.nan


def _check_takeoff(mission: Mission) -> Iterator[_Remark]:
    """Yield a remark on each take-off item that is not above home or comes after another navigation item."""
    has_earlier_place = False
    for item in mission.items:
        if item.command in TAKEOFFS:
            height = _height_above_home(mission, item)
            if height <= 0.0:
                yield REFUSED, item.seq, f"the takeoff altitude is {height:.1f} m above home, but must be above 0 m"
            if has_earlier_place:
                yield REFUSED, item.seq, "the takeoff is not the first waypoint item"
        has_earlier_place = has_earlier_place or item.command in PLACES | TAKEOFFS | LANDINGS | {C.NAV_RETURN_TO_LAUNCH}


def _check_landing(mission: Mission) -> Iterator[_Remark]:
    """Yield a remark on each item that breaks the order of DO_LAND_START, landings and return to launch."""
    commands = [item.command for item in mission.items]
    land_starts = [k for k, command in enumerate(commands) if command == C.DO_LAND_START]
    landings = [k for k, command in enumerate(commands) if command in LANDINGS]
    seq = [item.seq for item in mission.items]
    if len(land_starts) > 1:
        yield REFUSED, seq[land_starts[1]], "the mission has more than one DO_LAND_START"
    if landings and landings[0] == 0:
        yield REFUSED, seq[0], "the mission starts with a landing"
    for k, command in enumerate(commands):
        if command == C.NAV_RETURN_TO_LAUNCH and land_starts and land_starts[0] < k:
            yield REFUSED, seq[k], "a return to launch after DO_LAND_START is not possible"
    if land_starts and not any(land > land_starts[0] for land in landings):
        yield REFUSED, seq[land_starts[0]], "no landing follows DO_LAND_START"


def _check_approach(mission: Mission, origin: GeoOrigin, limits: FeasibilityLimits) -> Iterator[_Remark]:
    """Yield a remark on each landing approach that PX4 would reject, or whose height is unknown.

    PX4 rejects an approach that is too steep, or that begins with an unsupported item, below the landing point, or in
    an orbit around it.
    """
    max_angle = math.degrees(limits.landing_angle)
    for previous, item in zip(mission.items, mission.items[1:], strict=False):
        if item.command != C.NAV_LAND or previous.command not in PLACES | TAKEOFFS or not previous.has_position:
            continue
        altitude_difference = _height_above_home(mission, previous) - _height_above_home(mission, item)
        if math.isnan(altitude_difference):
            yield None, item.seq, "the height of the approach above the landing point is unknown"
            continue
        if altitude_difference <= 0.0:
            yield REFUSED, item.seq, "the approach waypoint must be above the landing point"
            continue
        distance = _distance_between(previous, item, origin)
        if previous.command == C.NAV_LOITER_TO_ALT:
            radius = 0.0 if math.isnan(previous.params[1]) else abs(previous.params[1])
            if distance <= radius:
                yield REFUSED, item.seq, "the landing point must be outside the orbit radius"
                continue
            distance = math.sqrt(distance * distance - radius * radius)
        elif previous.command != C.NAV_WAYPOINT:
            yield REFUSED, item.seq, "the approach must begin with a WAYPOINT or a LOITER_TO_ALT"
            continue
        angle = math.atan2(altitude_difference, distance)
        if angle > limits.landing_angle + PX4_LANDING_BUFFER_RAD:
            gentlest_distance = math.ceil(altitude_difference / math.tan(limits.landing_angle))
            lowest_height = math.floor(distance * math.tan(limits.landing_angle))
            reason = message(
                f"the landing glide slope is {math.degrees(angle):.1f}°, more than the maximum of {max_angle:.1f}°",
                f" of FW_LND_ANG: begin the glide {gentlest_distance} m instead of {distance:.0f} m before the landing"
                f" point, or {lowest_height} m instead of {altitude_difference:.0f} m above it",
            )
            yield REFUSED, item.seq, reason


def _check_required_ends(mission: Mission, limits: FeasibilityLimits, refuses: bool) -> Iterator[_Remark]:
    """Yield one remark on the take-off and the landing that MIS_TKO_LAND_REQ requires.

    A missing item is refused only if the user's parameter file states the requirement.

    refuses: True if PX4 is to fly.
    """
    missing_ends = missing_ends_text(mission, limits)
    if not missing_ends:
        yield True, None, "takeoff and landing are as MIS_TKO_LAND_REQ requires"
    elif limits.stated:
        yield REFUSED, None, missing_ends
    else:
        # The value of the parameter is unknown, so nothing is decided.  It does not concern other autopilots.
        yield None if refuses else True, None, missing_ends


def _distance_between(first: MissionItem, second: MissionItem, origin: GeoOrigin) -> float:
    """Return the horizontal distance between two items, m."""
    east, north = to_map(origin, [first.lat_deg, second.lat_deg], [first.lon_deg, second.lon_deg])
    return float(math.hypot(float(np.diff(east)[0]), float(np.diff(north)[0])))


def _check_first_distance(mission: Mission, origin: GeoOrigin) -> Iterator[_Remark]:
    """Yield a remark if the first flown item is too far from home.

    Another remark states that there is no home or no flown item.
    """
    flown_items = _flown_items(mission)
    if mission.home is None or not flown_items:
        yield True, None, "no home, so no distance to the first waypoint"
        return
    home = MissionItem(0, int(C.NAV_WAYPOINT), 0, (0.0,) * 4, mission.home.lat_deg, mission.home.lon_deg, 0.0)
    distance = _distance_between(home, flown_items[0], origin)
    if not distance < PX4_FIRST_WAYPOINT_DISTANCE_M:
        # This is only a warning in the releases whose control law is simulated here.
        yield (
            None,
            flown_items[0].seq,
            f"the first waypoint is {distance:.0f} m from home, more than the maximum of"
            f" {PX4_FIRST_WAYPOINT_DISTANCE_M:.0f} m",
        )


def _check_distances(mission: Mission, origin: GeoOrigin) -> Iterator[_Remark]:
    """Yield remarks on gates too close to a waypoint, and on the longest leg.

    The latter remark is made if older PX4 releases refuse the leg.
    """
    # Condition gates that are too close to the waypoint before or after the gate.
    flown_items = [
        item
        for item in mission.items
        if item.has_position and (item.command in PLACES | TAKEOFFS | LANDINGS or item.command == C.CONDITION_GATE)
    ]
    for previous, following in itertools.pairwise(flown_items):
        has_gate = C.CONDITION_GATE in (previous.command, following.command)
        if has_gate and _distance_between(previous, following, origin) < PX4_GATE_SPACING_M:
            yield REFUSED, following.seq, "the gate and the neighbouring waypoint are too close together"
    flown_items = _flown_items(mission)
    if len(flown_items) < 2:
        return
    east, north = to_map(origin, [item.lat_deg for item in flown_items], [item.lon_deg for item in flown_items])
    distances = np.hypot(np.diff(east), np.diff(north))
    k = int(np.argmax(distances))
    if distances[k] > PX4_WAYPOINT_SPACING_M:
        reason = f"{distances[k]:.0f} m between waypoints; PX4 releases with MIS_DIST_WPS refuse more than"
        yield (
            True,
            flown_items[k + 1].seq,
            f"{reason} {PX4_WAYPOINT_SPACING_M:.0f} m by default; newer releases have no limit",
        )


def _check_home_altitude(mission: Mission) -> Iterator[_Remark]:
    """Yield a remark on each flown item below home.

    If the file has no home, the only remark is on the first item with a height above home.
    """
    for item in _flown_items(mission):
        if item.frame in OVER_HOME and mission.home is None:
            reason = "the file has heights above home but no home; PX4 refuses them until the vehicle has a home"
            yield None, item.seq, reason
            return
        if _height_above_home(mission, item) < 0.0:
            yield True, item.seq, f"waypoint {item.seq} is below home, for which PX4 only warns"


def _check_fence(setup: FlightSetup) -> Iterator[_Remark]:
    """Yield a remark on each item whose position violates the mission's own fence by PX4's test.

    PX4 tests the positions of all items, but not the path between them or a loiter's circle: the fence rule judges the
    path.  An item that the route does not reach matters only to PX4.

    Without a fence, the only remark states this.  There are no remarks if the autopilot requires only that the aircraft
    is inside any one of several inclusion zones.  The fence rule then judges the flight by the union of these zones.
    """
    mission, checks, origin = setup.mission, setup.autopilot.checks, setup.scenario.origin
    if not mission.fences:
        yield True, None, "the mission has no geofence"
        return
    if checks.any_inclusion_suffices:
        return
    route_items = set(setup.route.items.tolist())
    for item in _flown_items(mission):
        east, north = map(float, to_map(origin, item.lat_deg, item.lon_deg))
        problem = fence_problem(mission.fences, origin, east, north)
        if problem is not None:
            violation, fence_item = problem
            reason = message(f"geofence violation: {violation}", f" (fence item {fence_item})")
            yield False if item.seq in route_items else REFUSED, item.seq, reason


RULE = Rule(
    name="mission",
    tolerances=(
        *("NOMINAL_CELL_VOLTAGE_V", "FULL_CELL_VOLTAGE_V"),
        *("PX4_LANDING_BUFFER_RAD", "PX4_FIRST_WAYPOINT_DISTANCE_M", "PX4_WAYPOINT_SPACING_M", "PX4_GATE_SPACING_M"),
    ),
)
