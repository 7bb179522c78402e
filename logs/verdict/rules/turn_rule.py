"""The turn rule: judge whether the turn at each corner fits its legs, and how it was flown."""

import math

import numpy as np

from flight.guidance.navigation_error import ERRORS
from flight.mission.route import SHARPEST_FLY_BY_RAD
from logs.verdict.findings import UNKNOWN_AIRCRAFT, Fact, Finding, Message, finding_reason, make_finding, message
from logs.verdict.measures.acceptance import acceptance_limit, negligible_kink_distance
from logs.verdict.measures.bank_limit import bank_limit_text
from logs.verdict.measures.route_requirements import RouteRequirements, turn_limit
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.turns import TurnMeasure, measure_turns
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_gentler_turn
from logs.verdict.tolerances import (
    BANK_TOLERANCE_RAD,
    CORNER_CUT_FRACTION,
    CORNER_CUT_TOLERANCE_M,
    GUST_OFFSET_M,
    MAX_FLY_BY_OFFSET_RADII,
    MIN_LEG_LENGTH_M,
    NAVIGATION_SIGMAS,
    OVERSHOOT_TOLERANCE_M,
    PLAN_TOLERANCE_RAD,
    SETTLED_CROSS_TRACK_M,
    STRAIGHT_RADIUS_RATIO,
)
from logs.verdict.wording import compared_texts, count_text, place_text
from world.geometry import fly_by_offset


def turn_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the turn at each inner waypoint, except at the waypoints of turnarounds.

    geometric: True to judge the planned turns only.
    """
    measures: list[TurnMeasure | None] = [None if geometric else TurnMeasure()] * (requirements.legs - 1)
    if aligned is not None:
        follows_arcs = requirements.setup.imported_log is None
        measures = [*measure_turns(requirements, aligned, follows_arcs=follows_arcs)]
    turnaround_waypoints = requirements.turnaround_waypoints()
    return [
        _turn_finding(requirements, waypoint, measure, aligned)
        for waypoint, measure in enumerate(measures, 1)
        if waypoint not in turnaround_waypoints
    ]


def _turn_finding(
    requirements: RouteRequirements, waypoint: int, measure: TurnMeasure | None, aligned: AlignedTrack | None
) -> Finding:
    """Judge the turn at a waypoint; a turn next to a vertical leg is not judged.

    measure: measurements of the flown turn; None to judge only the planned turn.
    """
    planned_turn = abs(float(requirements.turns[waypoint]))
    limit, source = turn_limit(requirements, waypoint)
    # A negative limit means that a neighbouring turn needs more than the whole leg.  That turn has the fault.
    limit = max(limit, 0.0)
    if requirements.runs[waypoint - 1 : waypoint + 1].min() < MIN_LEG_LENGTH_M:
        reason = "a neighbouring leg is vertical and has no course, so the turn cannot be judged"
        return make_finding("turn", requirements.waypoint_place(waypoint), ok=None, reason=reason, unit="deg")
    faults, facts, check, judged_turn = _judge_planned_turn(requirements, waypoint, limit, source)
    # With a known aircraft, the planned turn is compared with its limits, and the flown turn is only described.
    is_judged_as_planned = measure is None or bool(requirements.envelope)
    radius, route = float(requirements.radius[waypoint]), requirements.setup.route
    acceptance_radius = float(route.points["acceptance_radius"][waypoint])
    if route.fly_over[waypoint] and acceptance_radius and math.isfinite(radius):
        offset = fly_by_offset(planned_turn, radius)
        if offset > acceptance_radius:
            lateral = radius * (1.0 - math.cos(planned_turn))
            facts.append(
                f"flown over, because a fly-by arc would pass {offset:.0f} m away, outside the acceptance radius of"
                f" {acceptance_radius:.0f} m; after the waypoint the turn swings up to {lateral:.0f} m off the next leg"
            )
    angle = None if measure is None else measure.angle
    tolerance = PLAN_TOLERANCE_RAD
    if measure is not None:
        if not is_judged_as_planned:
            tolerance = measure.tolerance or PLAN_TOLERANCE_RAD
            judged_turn = planned_turn if angle is None else angle
        flown_faults = _flown_faults(requirements, waypoint, measure, limit)
        facts += [text for name, text in _flown_facts(requirements, waypoint, measure) if name not in flown_faults]
        facts += [fault.brief for fault in flown_faults.values()] if is_judged_as_planned else []
        faults += [] if is_judged_as_planned else flown_faults.values()
    ok: bool | None = False if faults else None if check else True
    if measure is not None and not measure.is_complete:
        facts.append(_unflown_turn_text(requirements, waypoint, measure, aligned))
        ok = None if ok is not False else False
    method, measured_facts = "route", []
    if measure is not None:
        fit_text = "least-squares courses of both legs" if measure.is_fitted else "course change over the turn"
        method = "not flown" if measure.angle is None else fit_text
        quantities = (
            ("overshoot", measure.overshoot, "m"),
            ("settled", measure.settled_distance if measure.is_complete else None, "m"),
            ("bank", None if measure.held_bank is None else math.degrees(measure.held_bank), "deg"),
            ("radius", measure.radius, "m"),
            ("nearest pass", None if measure.pass_time is None else measure.min_distance, "m"),
        )
        measured_facts = [Fact(quantity, value, unit) for quantity, value, unit in quantities if value is not None]
    return make_finding(
        "turn",
        requirements.waypoint_place(waypoint),
        ok=ok,
        reason=finding_reason(faults, facts if measure is not None or not faults else ()),
        faults=faults,
        planned=math.degrees(planned_turn),
        flown=None if angle is None else math.degrees(angle),
        limit=math.degrees(limit),
        source=source,
        tolerance=math.degrees(tolerance),
        margin=None if judged_turn is None else math.degrees(limit - judged_turn),
        unit="deg",
        method=method,
        check=check if ok is None else "",
        facts=measured_facts,
    )


def _judge_planned_turn(
    requirements: RouteRequirements, waypoint: int, limit: float, source: str
) -> tuple[list[Message], list[str], str, float | None]:
    """Compare the planned turn at a waypoint with its limit (rad).

    Return the faults, texts that describe the turn, `UNKNOWN_AIRCRAFT` if the limit is not known and "" otherwise, and
    the planned turn, rad.  A negligible kink is no fault, and its turn is returned as None.

    source: source of the limit: "scenario" or "aircraft".
    """
    turn = abs(float(requirements.turns[waypoint]))
    angle_text, limit_text = compared_texts(math.degrees(turn), math.degrees(limit), "deg", 1)
    turn_text = f"turns {angle_text}"
    facts = [turn_text + (f" (at most {limit_text})" if math.isfinite(limit) else "")]
    if turn <= limit + PLAN_TOLERANCE_RAD:
        return [], facts, "", turn
    lateral = negligible_kink_distance(requirements, waypoint)
    if lateral is not None:
        facts.append(f"a negligible kink: a flyable path without this waypoint passes it at {lateral:.1f} m")
        return [], facts, "", None
    # The message states the turn and the scenario's limit, or the length of leg that the turn needs.
    speed = float(max(requirements.route.leg_airspeeds[waypoint - 1 : waypoint + 1]))
    radius, bank_text = float(requirements.radius[waypoint]), bank_limit_text(requirements.setup)
    if source == "scenario":
        sharp_turn = message(f"{turn_text}, more than the scenario's limit of {math.degrees(limit):.1f}°")
    elif not math.isfinite(radius):
        sharp_turn = message(f"{turn_text} where the wind is too strong to hold the course of a leg at {speed:.0f} m/s")
    elif requirements.setup.route.arc_radii[waypoint] > 0.0:
        sharp_turn = message(
            f"circles with radius {radius:.0f} m",
            f"; at {speed:.0f} m/s and {bank_text} the smallest turn radius on these courses"
            f" in this wind is {requirements.min_radius[waypoint]:.0f} m",
        )
    else:
        used_length = float(requirements.length_after[waypoint])
        length_text = "no leg would be long enough for the turn"
        if used_length < MAX_FLY_BY_OFFSET_RADII * radius:
            is_fly_over = requirements.setup.route.fly_over[waypoint]
            used_text = "the next leg, after the waypoint" if is_fly_over else "each leg"
            length_text = f"the turn takes {used_length:.0f} m of {used_text}"
        room_text = f"room for only {math.degrees(limit):.1f}°" if limit > 0.0 else "no room"
        sharp_turn = message(
            f"{turn_text}, but its legs ({requirements.runs[waypoint - 1]:.0f} m and {requirements.runs[waypoint]:.0f}"
            f" m) leave {room_text}",
            f" beside the neighbouring turns. At {speed:.0f} m/s and {bank_text} the radius is {radius:.0f} m, and"
            f" {length_text}",
        )
    # The aircraft's bank limit may be a guess.
    if source == "aircraft" and turn <= float(requirements.possible_turn_limit[waypoint]) + PLAN_TOLERANCE_RAD:
        return [], [sharp_turn.text], UNKNOWN_AIRCRAFT, turn
    return [sharp_turn], [], "", turn


def _unflown_turn_text(
    requirements: RouteRequirements, waypoint: int, measure: TurnMeasure, aligned: AlignedTrack | None
) -> str:
    """Explain why a turn was not flown: the flight ended before it, or the autopilot skipped a leg.

    For an imported flight, the text only states that the legs were not flown one after the other.
    """
    if measure.pass_time is not None:
        return "its legs were not flown one after the other"
    if aligned is None or int(aligned.guidance_legs.max()) < waypoint:
        return "the flight did not get past it"
    active_times = [
        float(np.count_nonzero(aligned.guidance_legs == leg)) * aligned.tick for leg in (waypoint - 1, waypoint)
    ]
    leg = waypoint if active_times[1] <= active_times[0] else waypoint - 1
    active_time, leg_length = min(active_times), float(requirements.runs[leg])
    radius, _ = acceptance_limit(requirements, leg + 1)
    return (
        f"{requirements.setup.autopilot.title} flew {place_text(requirements.leg_place(leg))} for only"
        f" {active_time:.1f} s: the leg is {leg_length:.0f} m long, and a waypoint counts as reached within"
        f" {radius:.0f} m"
    )


def _flown_facts(requirements: RouteRequirements, waypoint: int, measure: TurnMeasure) -> list[tuple[str, str]]:
    """Return the measured quantities of a flown turn, as pairs of name and text."""
    facts = []
    if measure.angle is not None and measure.tolerance is not None:
        facts.append(("course change", f"flown course change {math.degrees(measure.angle):.2f}°"))
    if measure.peak_bank is not None and measure.held_bank is not None:
        facts.append(("bank", f"bank up to {math.degrees(measure.peak_bank):.1f}°"))
    if measure.radius is not None and measure.radius < STRAIGHT_RADIUS_RATIO * requirements.radius[waypoint]:
        facts.append(("radius", f"radius {measure.radius:.0f} m"))
    if measure.pass_time is not None and measure.min_distance is not None:
        facts.append(("nearest pass", f"nearest pass {measure.min_distance:.1f} m, at {measure.pass_time:.1f} s"))
    if measure.overshoot is not None:
        facts.append(("overshoot", f"overshoot {measure.overshoot:.1f} m"))
    if measure.overrun:
        overrun_text = f"passed {measure.overrun:.0f} m beyond the end of the next leg, which was not joined"
        facts.append(("overrun", overrun_text))
    if measure.settled_distance is not None and measure.is_complete:
        facts.append(("settled", f"settled to {measure.settled_distance:.2f} m from the next leg"))
    return facts


def _flown_faults(
    requirements: RouteRequirements, waypoint: int, measure: TurnMeasure, limit: float
) -> dict[str, Message]:
    """Return the faults of a flown turn by measured quantity: a name as in `_flown_facts`, or "circles".

    limit: largest permitted course change, rad.
    """
    faults, setup = {}, requirements.setup
    if measure.angle is not None and measure.tolerance is not None and measure.angle > limit + measure.tolerance:
        flown_angle, max_angle = math.degrees(measure.angle), math.degrees(limit)
        faults["course change"] = message(
            f"flown course change {flown_angle:.1f}°, more than the limit of {max_angle:.1f}°"
        )
    max_bank = requirements.limits.max_bank + BANK_TOLERANCE_RAD
    # The one-second mean is judged, because gusts and the roll into the turn change the bank only for a moment.
    if measure.held_bank is not None and measure.held_bank > max_bank:
        faults["bank"] = message(
            f"bank {math.degrees(measure.held_bank):.1f}°, more than the limit of {math.degrees(max_bank):.1f}°"
        )
    # A flight along the arc between legs that are too short for their turn exceeded the bank limit or slowed down.
    turn, min_radius = abs(float(requirements.turns[waypoint])), float(requirements.min_radius[waypoint])
    # planfly's guidance also has no arc to follow at a sharper corner with short legs.
    min_distance = fly_by_offset(turn, min_radius) if turn < SHARPEST_FLY_BY_RAD else math.inf
    # An autopilot that does not keep to the arc may pass the waypoint at any distance.
    follows_arc = (
        setup.autopilot.turns.keeps_to_arcs and setup.imported_log is None and not setup.route.fly_over[waypoint]
    )
    if measure.min_distance is not None and math.isfinite(min_distance) and follows_arc:
        tolerance = CORNER_CUT_FRACTION * min_distance + CORNER_CUT_TOLERANCE_M[setup.scenario.wind.turbulence]
        tolerance += NAVIGATION_SIGMAS * ERRORS[setup.nav][0]
        if measure.min_distance < min_distance - tolerance:
            faults["radius"] = message(
                f"passes its waypoint {measure.min_distance:.1f} m away, closer than the bank limit permits",
                f"; an arc at {math.degrees(requirements.limits.max_bank):.0f}° of bank in this wind (radius"
                f" {min_radius:.0f} m) passes the waypoint {min_distance:.1f} m away",
            )
    if measure.overshoot is not None and measure.overshoot > OVERSHOOT_TOLERANCE_M:
        passed_text = "its arc" if measure.pass_time is None else "its next leg"
        overshoot_text, _ = compared_texts(measure.overshoot, OVERSHOOT_TOLERANCE_M, "m", 0)
        faults["overshoot"] = message(
            f"overshoots {passed_text} by {overshoot_text}", f" (at most {OVERSHOOT_TOLERANCE_M:.0f} m)"
        )
    max_offset = SETTLED_CROSS_TRACK_M + GUST_OFFSET_M[setup.scenario.wind.turbulence]
    if measure.settled_distance is not None and measure.is_complete and measure.settled_distance > max_offset:
        offset_text, max_text = compared_texts(measure.settled_distance, max_offset, "m", 1)
        faults["settled"] = message(f"still {offset_text} off the next leg at its end", f" (at most {max_text})")
    if measure.full_circles:
        faults["circles"] = message(f"{count_text(measure.full_circles, 'full circle')} flown at the corner")
    return faults


RULE = Rule(
    name="turn",
    tolerances=(
        *(
            "PLAN_TOLERANCE_RAD",
            "MIN_LEG_LENGTH_M",
            "U_TURN_RAD",
            "MAX_FLY_BY_OFFSET_RADII",
            "BANK_TOLERANCE_RAD",
            "POSSIBLE_BANK_RAD",
            "OVERSHOOT_TOLERANCE_M",
            "SETTLED_CROSS_TRACK_M",
        ),
        *(
            "GUST_OFFSET_M",
            "CORNER_CUT_FRACTION",
            "CORNER_CUT_TOLERANCE_M",
            "NAVIGATION_SIGMAS",
            "SETTLING_WATCH_TIME_S",
            "STRAIGHT_RADIUS_RATIO",
            "KINK_FRACTION",
        ),
        *(
            "KINK_WAYPOINT_COUNT",
            "TURN_EXCLUSION_M",
            "MIN_COURSE_STRETCH_M",
            "COURSE_ERROR_FLOOR_RAD",
            "MAX_UNSTEADINESS_RAD",
            "ROUGH_COURSE_ERROR_RAD",
        ),
    ),
    judge=turn_findings,
    suggest=suggest_gentler_turn,
    log=LogNeeds(needs_aircraft=True, needs_no_gap=True),
)
