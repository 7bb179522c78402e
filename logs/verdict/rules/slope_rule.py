"""The slope rule: judge if each leg can be climbed or descended, and how it was flown.

The leg's airspeed is taken into account.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aircraft.envelope import ground_slope
from logs.verdict.findings import (
    AIRCRAFT_SLOPE,
    GROUND_FOLLOWING_ERROR,
    NOT_FLOWN,
    PITCH_LIMIT_TIME,
    UNKNOWN_AIRCRAFT,
    Fact,
    Finding,
    Message,
    finding_reason,
    make_finding,
    message,
)
from logs.verdict.measures.acceptance import negligible_step_height, slope_with_next_leg
from logs.verdict.measures.ground_following import follows_ground, mean_ground_slope, steepest_ground
from logs.verdict.measures.route_requirements import RouteRequirements, SteepArc, slope_limit, steep_arc
from logs.verdict.measures.slopes import SlopeMeasure, measure_slope
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_gentler_slope
from logs.verdict.tolerances import (
    ABILITY_SIGMAS,
    ABILITY_TOLERANCE_RAD,
    CALM_WIND_MPS,
    GUST_SPEED_FRACTION,
    HEIGHT_ERROR_LIMIT_M,
    LEVEL_SLOPE_RAD,
    MIN_LEG_LENGTH_M,
    NEGLIGIBLE_STEP_M,
    PLAN_TOLERANCE_RAD,
    SATURATED_TIME_S,
    SHORT_LEG_HEIGHT_ERROR_LIMIT_M,
    SLOPE_TOLERANCE_RAD,
    SPEED_TOLERANCE_MPS,
    UNDECIDED_FRACTION,
)
from logs.verdict.wording import compared_texts, place_text
from world.wind import W20


def slope_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the planned and the flown slope of each leg, except in the turnarounds of surveys.

    geometric: True to judge the planned route only.
    """
    findings, turnaround_legs = [], requirements.turnaround_legs()
    for leg in range(requirements.legs):
        if leg in turnaround_legs:
            continue
        slope = slope_with_next_leg(requirements, leg)
        if slope is not None and (geometric or (aligned is not None and aligned.passed[leg + 1])):
            findings.append(_vertical_leg_finding(requirements, leg, slope, is_flown=not geometric))
            continue
        measure = None if geometric else SlopeMeasure()
        if aligned is not None:
            measure = measure_slope(requirements, aligned, leg)
        is_complete = aligned is not None and bool(aligned.passed[-1])
        findings.append(_leg_finding(requirements, leg, measure, is_complete=is_complete))
    return findings


def _vertical_leg_finding(requirements: RouteRequirements, leg: int, slope: float, *, is_flown: bool) -> Finding:
    """Judge a vertical leg that the autopilot flies together with the next leg.

    A climb is undecided without a flight, because the aircraft flies below the line of the next leg.

    slope: slope of the vertical leg and the next leg flown as one, rad, positive for a climb.
    """
    sign = math.copysign(1.0, slope)
    limit, source = slope_limit(requirements, leg + 1, is_climb=sign > 0.0)
    certain_limits = requirements.certain_climb if sign > 0.0 else requirements.certain_dive
    is_uncertain = max(LEVEL_SLOPE_RAD, float(certain_limits[leg + 1])) < abs(slope)
    check = UNKNOWN_AIRCRAFT if is_uncertain and float(certain_limits[leg + 1]) < limit < math.inf else ""
    climb = float(requirements.points[leg + 1, 2] - requirements.points[leg, 2])
    reason = (
        f"{place_text(requirements.waypoint_place(leg + 1))} is passed at once; the {abs(climb):.0f} m"
        f" {'up' if climb > 0.0 else 'down'} to it are flown on the next leg, which then needs"
        f" {math.degrees(slope):+.2f}°"
    )
    if climb > 0.0 and not is_flown:
        check = check or NOT_FLOWN
        reason += ", and the aircraft flies below that leg as drawn, which only a flight can judge"
    return make_finding(
        "slope",
        requirements.leg_place(leg),
        ok=None if check else True,
        reason=reason,
        planned=math.degrees(slope),
        limit=math.degrees(sign * limit),
        at_least=sign < 0.0,
        source=source,
        tolerance=math.degrees(PLAN_TOLERANCE_RAD),
        margin=math.degrees(limit - abs(slope)),
        unit="deg",
        method="route",
        check=check,
    )


def _leg_finding(
    requirements: RouteRequirements, leg: int, measure: SlopeMeasure | None, *, is_complete: bool
) -> Finding:
    """Judge a leg's planned slope and, after a flight, its flown slope, altitude and throttle.

    measure: measurements of the flown leg; None before a flight.
    is_complete: True if the flight reached the last waypoint.
    """
    planned_slope = float(requirements.slopes[leg])
    limit, source = slope_limit(requirements, leg)
    sign = 1.0 if planned_slope >= 0.0 else -1.0
    if abs(planned_slope) <= LEVEL_SLOPE_RAD:
        min_speed, max_speed = requirements.setup.envelope.level_speeds(float(requirements.points[leg, 2]))
        if not min_speed <= float(requirements.route.leg_airspeeds[leg]) <= max_speed:
            # A level leg at a speed that the aircraft cannot fly fails by its speed, not by its slope.
            limit = max(limit, LEVEL_SLOPE_RAD)
    faults, facts = _planned_slope_messages(requirements, leg, limit, source)
    measured_facts: list[Fact] = []
    is_plan_steep = bool(faults)
    arc_faults = _steep_arc_faults(requirements, leg, measure)
    ground = None if faults or arc_faults else _steep_ground(requirements, leg, measure)
    if ground is not None:
        planned_slope, limit, source = ground.slope, ground.limit, ground.source
        sign = math.copysign(1.0, planned_slope)
        faults = [ground.fault]
    aircraft_facts = []
    if arc_faults or (faults and source == "aircraft"):
        aircraft_limits = requirements.climb if float(requirements.slopes[leg]) >= 0.0 else requirements.dive
        aircraft_facts.append(Fact(AIRCRAFT_SLOPE, math.degrees(float(aircraft_limits[leg])), "deg"))
    # The text of a planned fault already states the planned slope.
    facts = facts if faults or arc_faults else [f"slope {math.degrees(planned_slope):+.2f}°", *facts]
    slope_fit = measure.slope if measure is not None and ground is None else None
    method = "route"
    if measure is not None:
        flown_faults, flown_facts, measured_facts = _flown_messages(requirements, leg, measure, limit)
        faults, facts = faults + flown_faults, facts + flown_facts
        if slope_fit is not None:
            fit_text = "" if slope_fit.is_fitted else ", short leg,"
            method = f"least squares{fit_text} over {slope_fit.length:.0f} m"
        elif ground is None:
            method = "not flown"
    # Faults of the arc come last, because the arc at a steep leg's end is steep, too.
    faults = faults + arc_faults
    uncertainty = (
        "" if ground else _uncertainty_text(requirements, leg, limit, source, measure, has_failed=bool(faults))
    )
    check = UNKNOWN_AIRCRAFT if uncertainty and not faults else ""
    ok = None if check else not faults
    facts = [uncertainty, *facts] if uncertainty else facts
    if measure is not None and not measure.is_finished:
        facts.append("the leg was not flown to its end" if is_complete else "the flight did not reach its end")
        ok = False if faults else None
    # If the planned slope is too steep, the finding states its margin, otherwise the margin of the flown slope.
    deciding_fit = None if is_plan_steep else slope_fit
    return make_finding(
        "slope",
        requirements.leg_place(leg),
        ok=ok,
        reason=finding_reason(faults, facts if measure is not None or not faults else ()),
        faults=faults,
        planned=math.degrees(planned_slope),
        flown=None if slope_fit is None else math.degrees(slope_fit.value),
        limit=math.degrees(sign * limit),
        at_least=sign < 0.0,
        source=source,
        tolerance=math.degrees(PLAN_TOLERANCE_RAD if deciding_fit is None else deciding_fit.tolerance),
        margin=math.degrees(limit - sign * (planned_slope if deciding_fit is None else deciding_fit.value)),
        unit="deg",
        method=method,
        check=check,
        facts=(*measured_facts, *aircraft_facts),
    )


def _flown_messages(
    requirements: RouteRequirements, leg: int, measure: SlopeMeasure, limit: float
) -> tuple[list[Message], list[str], list[Fact]]:
    """Return the faults of a flown leg, texts on what was measured, and the measurements.

    If the aircraft's limits are judged (`RouteRequirements.envelope`), only a lack of performance is a fault, and texts
    report the other deviations from the plan.

    limit: limit of the slope, rad.
    """
    performance_faults = _performance_faults(requirements, leg, measure, limit)
    flown_faults = _flown_faults(requirements, leg, measure, limit, performance_faults)
    named_facts: list[tuple[str, str]] = []
    measured: list[Fact] = []
    if measure.slope is not None:
        named_facts.append(("slope", f"flown {math.degrees(measure.slope.value):+.2f}°"))
    if measure.height_error is not None:
        is_over_ground = follows_ground(requirements, leg)
        line = "the leg's height above ground" if is_over_ground else "the leg"
        named_facts.append(("height", f"altitude within {abs(measure.height_error):.1f} m of {line}"))
        measured.append(Fact(GROUND_FOLLOWING_ERROR if is_over_ground else "height error", measure.height_error, "m"))
    if measure.slope is not None:
        slope_error = math.degrees(measure.slope.value - float(requirements.slopes[leg]))
        measured.append(Fact("slope error", slope_error, "deg"))
    for name, duration, error, direction in _throttle_times(measure):
        if duration >= 1.0:
            named_facts.append((name, f"{_throttle_text(requirements, name)} for {duration:.0f} s"))
        if duration > 0.0:
            measured += [Fact(f"throttle at {name}", duration, "s"), Fact(f"too {direction}", error, "m/s")]
    if measure.pitch_limit_time >= SATURATED_TIME_S:
        limit_name = requirements.setup.autopilot.speeds.max_pitch_name
        named_facts.append(("pitch", f"pitch at its limit {limit_name} for {measure.pitch_limit_time:.0f} s"))
        measured.append(Fact(PITCH_LIMIT_TIME, measure.pitch_limit_time, "s"))
    arc = steep_arc(requirements, leg)
    if arc is not None and _is_arc_within_tolerance(arc, measure):
        place = place_text(requirements.waypoint_place(leg + 1))
        named_facts.append(("arc", f"the arc at {place} misses its height by only {arc.missing_height:.1f} m"))
    facts = [text for name, text in named_facts if name not in flown_faults]
    if requirements.envelope:
        return performance_faults, facts + [fault.brief for fault in flown_faults.values()], measured
    return [*flown_faults.values(), *performance_faults], facts, measured


def _planned_slope_messages(
    requirements: RouteRequirements, leg: int, limit: float, source: str
) -> tuple[list[Message], list[str]]:
    """Return the faults of a leg's planned slope, and texts that explain a steep slope that is no fault.

    A leg that is too steep is no fault in two cases.  The first is a negligible step in height.  The second is a leg
    over ground that falls more steeply than the aircraft can descend: the aircraft is then only too high.

    limit: limit of the slope, rad.
    source: source of the limit: "scenario" or "aircraft".
    """
    faults: list[Message] = []
    facts: list[str] = []
    slope = float(requirements.slopes[leg])
    if abs(slope) > limit + PLAN_TOLERANCE_RAD:
        step = negligible_step_height(requirements, leg)
        ground_slope = mean_ground_slope(requirements, leg) if slope < 0.0 and source != "scenario" else math.nan
        if ground_slope < -limit:
            facts.append(
                f"the ground falls at {math.degrees(-ground_slope):.1f}° on average, more steeply than the"
                f" {math.degrees(limit):.1f}° that can be flown, so the aircraft gets too high, which is no failure"
            )
        elif step is not None:
            facts.append(f"a step of {step:.1f} m, steeper than {math.degrees(limit):.1f}°, but negligible")
        else:
            slope_text = f"at {math.degrees(abs(slope)):.1f}° for {_distance_text(float(requirements.runs[leg]))}"
            if requirements.runs[leg] < MIN_LEG_LENGTH_M:
                height = abs(float(requirements.points[leg + 1, 2] - requirements.points[leg, 2]))
                slope_text = f"{round(height, 1):g} m vertically, {math.degrees(abs(slope)):.1f}°"
            number, verb = requirements.leg_place(leg).number, "climbs" if slope >= 0.0 else "descends"
            if source == "aircraft" and (no_progress_text := _no_progress_text(requirements, leg)):
                airspeed = float(requirements.route.leg_airspeeds[leg])
                explanation = f"; leg {number} {verb} {slope_text} at {airspeed:.0f} m/s"
                faults.append(message(no_progress_text, explanation))
            else:
                limit_text = _limit_text(requirements, leg, limit, source)
                certain_text = _certain_limit_text(requirements, leg, limit, source)
                explanation = f"; {limit_text}; {certain_text}" if certain_text else f"; {limit_text}"
                faults.append(message(f"leg {number} {verb} {slope_text}", explanation, placed=True))
    return faults, facts


class _SteepGround(NamedTuple):
    """Ground that a leg follows and that is steeper than the aircraft or its autopilot can fly.

    slope: mean slope of the steep part of the ground, rad.
    limit: limit of the climb slope, rad, positive.
    source: source of the limit: "scenario", "aircraft" or "autopilot".
    fault: message on the slope, its limit, and how low the aircraft would get.
    """

    slope: float
    limit: float
    source: str
    fault: Message


def _steep_ground(requirements: RouteRequirements, leg: int, measure: SlopeMeasure | None) -> _SteepGround | None:
    """Return the ground on a leg that rises too steeply for the aircraft to follow it, or None.

    Return None also for a leg that does not follow the ground, and if the aircraft gets at most `NEGLIGIBLE_STEP_M` too
    low.  After a flight, the measured height error decides, and the autopilot's climb rate limits the slope, too.
    Falling ground is no fault, because the aircraft is then only higher than the leg demands.
    """
    if not follows_ground(requirements, leg):
        return None
    if measure is not None and (measure.height_error is None or measure.height_error >= -_height_error_limit(measure)):
        return None
    (limit, source), rate_name = slope_limit(requirements, leg, is_climb=True), ""
    if measure is not None:
        rate_slope, name = _rate_limit_slope(requirements, leg, is_climb=True)
        limit, source, rate_name = (rate_slope, "autopilot", name) if rate_slope < limit else (limit, source, "")
    ground = steepest_ground(requirements, leg, limit)
    if ground is None or ground.excess <= NEGLIGIBLE_STEP_M:
        return None
    limit_text = (
        f"{rate_name} allows only a climb of {math.degrees(limit):.1f}°"
        if rate_name
        else _limit_text(requirements, leg, limit, source)
    )
    brief = (
        f"leg {requirements.leg_place(leg).number} follows ground that rises at {math.degrees(ground.slope):.1f}°"
        f" for {_distance_text(ground.length)}"
    )
    explanation = f"; {limit_text}, so the aircraft would fly up to {ground.excess:.0f} m too low over the ground"
    return _SteepGround(ground.slope, limit, source, message(brief, explanation, placed=True))


def _limit_deviation(requirements: RouteRequirements, leg: int, limit: float, certain_limit: float) -> float:
    """Return the standard deviation of an uncertain slope limit, rad.

    The deviation, like the limit, is a slope over the ground.  If there is no slope that the aircraft can certainly
    fly, it is the deviation in still air.

    limit: limit by the aircraft's model, rad.
    certain_limit: limit reduced by the uncertainty of the model, rad.
    """
    envelope = requirements.setup.envelope
    if certain_limit <= 0.0:
        return envelope.climb_sd if float(requirements.slopes[leg]) >= 0.0 else envelope.descent_sd
    return (limit - certain_limit) / UNDECIDED_FRACTION


def _uncertainty_text(
    requirements: RouteRequirements,
    leg: int,
    limit: float,
    source: str,
    measure: SlopeMeasure | None,
    *,
    has_failed: bool,
) -> str:
    """Explain that the uncertainty of the aircraft's model leaves a leg's slope undecided.

    For a leg that has failed, the text instead states the slope that is certainly possible, for suggestions.  Return ""
    if the uncertainty does not matter, and for a planned slope above the limit, whose own message states the limit.

    limit, source: limit of the slope, rad, and its source.
    has_failed: True if the leg fails.
    """
    planned_slope, setup = float(requirements.slopes[leg]), requirements.setup
    if has_failed:
        return "" if abs(planned_slope) > limit else _certain_limit_text(requirements, leg, limit, source)
    # Only the limits of the aircraft are compared here, not a lower limit of the scenario.
    limits, certain_limits, verb = (
        (requirements.climb, requirements.certain_climb, "climbs")
        if planned_slope >= 0.0
        else (requirements.dive, requirements.certain_dive, "descends")
    )
    aircraft_limit, certain_limit = float(limits[leg]), float(certain_limits[leg])
    # Without the aircraft's limits there is no uncertain limit.
    if abs(planned_slope) > max(LEVEL_SLOPE_RAD, certain_limit) and certain_limit < aircraft_limit < math.inf:
        deviation = math.degrees(_limit_deviation(requirements, leg, aircraft_limit, certain_limit))
        return (
            f"{verb} at {math.degrees(abs(planned_slope)):.1f}°; the limit according to {setup.envelope.source} is"
            f" {math.degrees(aircraft_limit):.1f}° ± {deviation:.1f}°, so only {math.degrees(certain_limit):.1f}° is"
            " certain"
        )
    # The leg is undecided, too, if the model misses the climb that was stated for the aircraft.
    if measure is not None and measure.ability is not None and _slope_shortfall(requirements, leg, measure):
        shown = measure.ability.slope
        stated = _climb_shortfall(requirements, leg) + shown
        return (
            f"climbs at {math.degrees(planned_slope):.1f}°; the model climbs {math.degrees(shown):.1f}° at"
            f" {setup.autopilot.speeds.max_throttle_name}, but up to {math.degrees(stated):.1f}° was stated for it"
        )
    return ""


def _certain_limit_text(requirements: RouteRequirements, leg: int, limit: float, source: str) -> str:
    """State the slope that an aircraft with an uncertain model can certainly fly.

    Suggested slopes do not exceed it.  Return "" if the whole limit is certain, or if the limit does not come from the
    aircraft.

    limit, source: limit of the slope, rad, and its source.
    """
    envelope, is_climb = requirements.setup.envelope, float(requirements.slopes[leg]) >= 0.0
    certain_limit = float((requirements.certain_climb if is_climb else requirements.certain_dive)[leg])
    if source != "aircraft" or not certain_limit < limit:
        return ""
    deviation = math.degrees(_limit_deviation(requirements, leg, limit, certain_limit))
    return (
        f"with the uncertainty of {envelope.source} (± {deviation:.1f}°) only"
        f" {math.degrees(certain_limit):.1f}° is certain"
    )


def _steep_arc_faults(requirements: RouteRequirements, leg: int, measure: SlopeMeasure | None) -> list[Message]:
    """Return a fault if the fly-by arc at a leg's end is steeper than the aircraft can fly, otherwise []."""
    arc = steep_arc(requirements, leg)
    if arc is None or (measure is not None and _is_arc_within_tolerance(arc, measure)):
        return []
    corner = leg + 1
    place = requirements.waypoint_place(corner)
    length = float(requirements.radius[corner]) * abs(float(requirements.turns[corner]))
    slope = math.degrees(math.atan(abs(arc.tangent)))
    verb = "climbs" if arc.tangent > 0.0 else "descends"
    slopes = " and ".join(f"{math.degrees(abs(float(requirements.slopes[k]))):.1f}°" for k in (leg, corner))
    first, second = requirements.leg_place(leg).number, requirements.leg_place(corner).number
    slope_text, limit_text = compared_texts(slope, math.degrees(math.atan(arc.limit)), "deg", 1)
    arc_text = f"the arc at {place_text(place)} {verb} at {slope_text} for {length:.0f} m"
    side = "below" if arc.tangent > 0.0 else "above"
    limit = (
        f"; the aircraft can fly at most {limit_text} there, and would end"
        f" {arc.missing_height:.0f} m {side} the arc's end; the arc is steeper than legs {first} and {second}"
        f" ({slopes}), because it replaces {2.0 * float(requirements.length_before[corner]):.0f} m of leg"
    )
    # A headline names the waypoint, not its item.
    brief = arc_text if place.item is None else f"the arc at {place_text(replace(place, item=None))}"
    return [Message(arc_text + limit, brief)]


def _is_arc_within_tolerance(arc: SteepArc, measure: SlopeMeasure) -> bool:
    """Return True if a leg was flown to its end, with a small height error on the steep arc there.

    The limit of this error is `HEIGHT_ERROR_LIMIT_M`.  Other rules judge the airspeed and the height above ground on
    the arc.
    """
    return measure.is_finished and arc.missing_height <= HEIGHT_ERROR_LIMIT_M


def _no_progress_text(requirements: RouteRequirements, leg: int) -> str:
    """State ground speed and wind if a headwind stops a climb or descent; otherwise "".

    The aircraft makes no progress if, at the steepest climb or descent, the horizontal part of its airspeed is not
    larger than the headwind.
    """
    speed, envelope = float(requirements.route.leg_airspeeds[leg]), requirements.setup.envelope
    for altitude in requirements.points[leg : leg + 2, 2].tolist():
        wind = requirements.wind_on(leg).components_on_course(float(requirements.courses[leg]), altitude)
        slopes_in_wind = envelope.slope_limits(speed, altitude, *wind)
        slopes_in_calm_air = envelope.slope_limits(speed, altitude)
        if np.isfinite(slopes_in_calm_air).all() and np.isnan(slopes_in_wind).any():
            tailwind, crosswind = wind
            progress = max(0.0, math.sqrt(max(0.0, speed**2 - crosswind**2)) + tailwind)
            crosswind_text = f" and {abs(crosswind):.1f} m/s of crosswind" if abs(crosswind) >= CALM_WIND_MPS else ""
            return f"no progress over the ground: {progress:.1f} m/s in {-tailwind:.1f} m/s of headwind{crosswind_text}"
    return ""


def _limit_text(requirements: RouteRequirements, leg: int, limit: float, source: str) -> str:
    """Describe the limit on a leg's slope, and the airspeed, altitude and wind for which it applies.

    limit: largest slope of a climb or a descent, rad.
    source: "scenario" for a limit of the scenario; any other source is the aircraft.
    """
    if source == "scenario":
        return f"the scenario allows {math.degrees(limit):.1f}°"
    speed = float(requirements.route.leg_airspeeds[leg])
    altitude = float(max(requirements.points[leg, 2], requirements.points[leg + 1, 2]))
    condition = f"at {speed:.0f} m/s and {altitude:.0f} m AMSL"
    if limit <= 0.0:
        return f"the aircraft cannot fly steadily on this course {condition}"
    wind = requirements.wind_on(leg)
    tailwind, crosswind = wind.components_on_course(float(requirements.courses[leg]), altitude)
    if math.hypot(tailwind, crosswind) < CALM_WIND_MPS:
        return f"the aircraft's limit is {math.degrees(limit):.1f}° {condition}, in calm air"
    wind_text = _wind_text(tailwind, crosswind)
    return f"the aircraft's limit is {math.degrees(limit):.1f}° {condition}, with {wind_text}"


def _wind_text(tailwind: float, crosswind: float) -> str:
    """Describe the notable wind components (m/s), such as "4.5 m/s tailwind and 5.3 m/s crosswind"."""
    along_name = "tailwind" if tailwind > 0.0 else "headwind"
    if min(abs(tailwind), abs(crosswind)) >= CALM_WIND_MPS:
        return f"{abs(tailwind):.1f} m/s {along_name} and {abs(crosswind):.1f} m/s crosswind"
    if abs(crosswind) > abs(tailwind):
        return f"{abs(crosswind):.0f} m/s crosswind"
    return f"{abs(tailwind):.0f} m/s {along_name}"


def _distance_text(distance: float) -> str:
    """Format a distance (m) in meters, or in kilometers from 1 km on."""
    return f"{distance / 1000.0:.1f} km" if distance >= 1000.0 else f"{distance:.0f} m"


def _throttle_text(requirements: RouteRequirements, name: str) -> str:
    """Describe a throttle limit: "full throttle", or "throttle at its limit" and the parameter.

    name: "full" or "idle".
    """
    limit_name = requirements.setup.autopilot.speeds.max_throttle_name
    return f"throttle at its limit {limit_name}" if name == "full" and limit_name else f"{name} throttle"


def _throttle_times(measure: SlopeMeasure) -> tuple[tuple[str, float, float, str], ...]:
    """Return one tuple for the time at full throttle, and one for the time at idle throttle.

    A tuple contains the name ("full" or "idle"), the duration, s, the airspeed error, m/s, and the direction of this
    error ("slow" or "fast").
    """
    return (
        ("full", measure.full_throttle_time, measure.speed_loss, "slow"),
        ("idle", measure.idle_throttle_time, measure.speed_gain, "fast"),
    )


def _flown_faults(
    requirements: RouteRequirements, leg: int, measure: SlopeMeasure, limit: float, performance_faults: list[Message]
) -> dict[str, Message]:
    """Return the faults of a flown leg by kind: "slope", "height", or speed at "full" or "idle" throttle.

    limit: limit of the slope, rad.
    performance_faults: faults that show a lack of performance; an airspeed error is then always a fault.
    """
    faults = {}
    planned_slope = float(requirements.slopes[leg])
    sign = 1.0 if planned_slope >= 0.0 else -1.0
    slope_fit = measure.slope
    if slope_fit is not None:
        flown_slope = math.degrees(slope_fit.value)
        if sign * slope_fit.value > limit + slope_fit.tolerance:
            limit_deg, tolerance_deg = math.degrees(limit), math.degrees(slope_fit.tolerance)
            limit_text = f"steeper than the limit of {limit_deg:.1f}° with its tolerance of {tolerance_deg:.1f}°"
            no_progress_text = _no_progress_text(requirements, leg) if limit == 0.0 else ""
            faults["slope"] = message(f"flown at {flown_slope:+.1f}°, {no_progress_text or limit_text}")
        elif slope_fit.is_fitted and abs(slope_fit.value - planned_slope) > SLOPE_TOLERANCE_RAD + slope_fit.tolerance:
            faults["slope"] = message(f"flown at {flown_slope:+.1f}° instead of {math.degrees(planned_slope):+.1f}°")
    if measure.height_error is not None and abs(measure.height_error) > _height_error_limit(measure):
        side = "above" if measure.height_error > 0.0 else "below"
        line = "its height above ground" if follows_ground(requirements, leg) else "the leg"
        error_text, max_text = compared_texts(abs(measure.height_error), _height_error_limit(measure), "m", 0)
        faults["height"] = message(f"{error_text} {side} {line}", f" (at most {max_text})")
    has_ability = not performance_faults and measure.ability is not None and measure.ability.exceeds(planned_slope)
    max_error = SPEED_TOLERANCE_MPS + GUST_SPEED_FRACTION * W20[requirements.setup.scenario.wind.turbulence]
    for name, duration, error, direction in _throttle_times(measure):
        # If the aircraft showed more ability than the leg needs, the air caused the speed error.
        if (
            duration >= SATURATED_TIME_S
            and error > max_error
            and not (has_ability and name == _throttle_limit(planned_slope))
        ):
            throttle_text = _throttle_text(requirements, name)
            error_text, max_text = compared_texts(error, max_error, "m/s", 1)
            brief = f"{throttle_text} for {duration:.0f} s and {error_text} too {direction}"
            faults[name] = message(brief, f" (at most {max_text})")
    return faults


def _throttle_limit(planned_slope: float) -> str:
    """Return the throttle limit that a slope (rad) may require: "full" for a climb, "idle" for a descent."""
    return "full" if planned_slope >= 0.0 else "idle"


def _slope_shortfall(requirements: RouteRequirements, leg: int, measure: SlopeMeasure) -> float:
    """Return by how much the slope flown at the throttle limit falls short of the planned slope, rad.

    The tolerance and the error of the flown slope are subtracted.  Return 0 if nothing is missing, for a nearly level
    leg, and if no slope at the throttle limit was measured.
    """
    ability, planned_slope = measure.ability, abs(float(requirements.slopes[leg]))
    if ability is None or planned_slope <= LEVEL_SLOPE_RAD:
        return 0.0
    return max(0.0, planned_slope - ability.slope - ABILITY_TOLERANCE_RAD - ABILITY_SIGMAS * ability.error)


def _climb_shortfall(requirements: RouteRequirements, leg: int) -> float:
    """Return by how much the model's climb slope at a limited throttle is below the stated slope, rad.

    Return 0 for a descent, and for an autopilot that does not limit the throttle.
    """
    setup = requirements.setup
    is_limited = bool(setup.autopilot.speeds.max_throttle_name) and float(requirements.slopes[leg]) > 0.0
    return setup.envelope.climb_shortfall if is_limited else 0.0


def _performance_faults(
    requirements: RouteRequirements, leg: int, measure: SlopeMeasure, limit: float
) -> list[Message]:
    """Return a fault for each limit on climb or descent that kept the aircraft from flying a leg.

    The limits are the autopilot's climb or sink rate, and the slope that the aircraft showed at the throttle limit.

    limit: limit of the slope, rad.
    """
    texts = []
    planned_slope, ability = float(requirements.slopes[leg]), measure.ability
    is_climb = planned_slope >= 0.0
    speed = float(requirements.route.leg_airspeeds[leg])
    rate_slope, rate_name = _rate_limit_slope(requirements, leg, is_climb=is_climb)
    if (
        rate_slope < abs(planned_slope) - ABILITY_TOLERANCE_RAD
        and measure.height_error is not None
        and (-measure.height_error if is_climb else measure.height_error) > _height_error_limit(measure)
    ):
        text = (
            f"{rate_name} allows only a {'climb' if is_climb else 'descent'} of {math.degrees(rate_slope):.1f}° at"
            f" {speed:.1f} m/s"
        )
        altitude = float(requirements.points[leg : leg + 2, 2].mean())
        tailwind, crosswind = requirements.wind_on(leg).components_on_course(float(requirements.courses[leg]), altitude)
        if math.hypot(tailwind, crosswind) >= CALM_WIND_MPS:
            text += f", with {_wind_text(tailwind, crosswind)}"
        texts.append(text)
    if ability is not None and _slope_shortfall(requirements, leg, measure) > _climb_shortfall(requirements, leg):
        limit_name = requirements.setup.autopilot.speeds.max_throttle_name if is_climb else ""
        throttle_text = limit_name or f"{_throttle_limit(planned_slope)} throttle"
        texts.append(
            f"measured over {ability.duration:.0f} s at {throttle_text}: the aircraft can"
            f" {'climb' if is_climb else 'sink'} at most {math.degrees(ability.slope):.1f}° at {speed:.0f} m/s here,"
            " over the ground in the mean wind, without gusts, vertical wind or a change of airspeed"
        )
    # A leg that is too steep as planned has a fault that states its slope; otherwise the first fault states it.
    if texts and abs(planned_slope) <= limit + PLAN_TOLERANCE_RAD:
        texts[0] += f"; the leg needs {math.degrees(abs(planned_slope)):.1f}°"
    return [message(text) for text in texts]


def _height_error_limit(measure: SlopeMeasure) -> float:
    """Return the largest accepted height error of a leg, m."""
    return SHORT_LEG_HEIGHT_ERROR_LIMIT_M if measure.is_short else HEIGHT_ERROR_LIMIT_M


def _rate_limit_slope(requirements: RouteRequirements, leg: int, *, is_climb: bool) -> tuple[float, str]:
    """Return the slope over the ground at the autopilot's rate limit, rad, and the limit's name.

    The slope is inf without a limit, and for an imported flight whose log does not contain the parameter.
    """
    setup = requirements.setup
    rate_limit = setup.autopilot.speeds.climb_limit if is_climb else setup.autopilot.speeds.sink_limit
    parameters = setup.autopilot.parameters
    stated_names = {} if parameters is None else parameters.by_origin("file")
    if not rate_limit.name or (setup.imported_log is not None and rate_limit.name.split(" ")[0] not in stated_names):
        return math.inf, ""
    speed = float(requirements.route.leg_airspeeds[leg])
    altitude = float(requirements.points[leg : leg + 2, 2].mean())
    wind = requirements.wind_on(leg).components_on_course(float(requirements.courses[leg]), altitude)
    slope = ground_slope(math.asin(min(1.0, rate_limit.rate / speed)), speed, *wind)
    return (math.inf if math.isnan(slope) else slope), rate_limit.name


RULE = Rule(
    name="slope",
    tolerances=(
        *(
            "PLAN_TOLERANCE_RAD",
            "MIN_LEG_LENGTH_M",
            "NEGLIGIBLE_STEP_M",
            "KINK_WAYPOINT_COUNT",
            "SLOPE_TOLERANCE_RAD",
            "HEIGHT_ERROR_LIMIT_M",
            "SHORT_LEG_HEIGHT_ERROR_LIMIT_M",
        ),
        *(
            "PITCH_LIMIT_TOLERANCE_RAD",
            "LEVEL_SLOPE_RAD",
            "UNDECIDED_FRACTION",
            "CALM_WIND_MPS",
            "SPEED_TOLERANCE_MPS",
            "GUST_SPEED_FRACTION",
            "ABILITY_TOLERANCE_RAD",
            "ABILITY_SIGMAS",
            "SATURATED_TIME_S",
            "SPEED_MEMORY_S",
        ),
        *(
            "MIN_AIRBORNE_AIRSPEED_MPS",
            "SATURATED_FRACTION",
            "FULL_THROTTLE_FRACTION",
            "IDLE_THROTTLE_FRACTION",
            "ZERO_CURRENT_A",
            "SATURATED_THROTTLE_FRACTION",
            "ABILITY_WINDOW_S",
        ),
        *(
            "ABILITY_SETTLING_S",
            "ABILITY_SAMPLE_INTERVAL_S",
            "CLIMB_RATE_RESOLUTION_MPS",
            "MAX_CONDITION_NUMBER",
            "MAX_ABILITY_STD_ERROR_RAD",
            "MAX_STEADY_ACCELERATION_MPS2",
            "BLEND_EXCLUSION_M",
        ),
        *(
            "MIN_SLOPE_STRETCH_M",
            "MIN_STRETCH_TIME_S",
            "SLOPE_ERROR_FLOOR_RAD",
            "MAX_UNSTEADINESS_RAD",
            "ROUGH_SLOPE_ERROR_RAD",
        ),
    ),
    judge=slope_findings,
    suggest=suggest_gentler_slope,
    log=LogNeeds(("heights",), needs_planned_heights=True, needs_aircraft=True, needs_full_leg=True),
)
