"""The slope rule: judge if each leg can be climbed or descended at its speed, and how it was flown."""

import math

from logs.verdict.findings import UNKNOWN_AIRCRAFT, Fact, Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.acceptance import step
from logs.verdict.measures.route_requirements import RouteRequirements, slope_limit, steep_arc
from logs.verdict.measures.slopes import LegFit, SlopeMeasure, measure_slope
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import ease_slope
from logs.verdict.tolerances import (
    ABILITY_SIGMAS,
    ABILITY_TOLERANCE_RAD,
    CALM_WIND_MPS,
    GUST_SPEED_FRACTION,
    HEIGHT_ERROR_LIMIT_M,
    LEVEL_SLOPE_RAD,
    MIN_LEG_LENGTH_M,
    PLAN_TOLERANCE_RAD,
    SATURATED_TIME_S,
    SHORT_LEG_HEIGHT_ERROR_LIMIT_M,
    SLOPE_TOLERANCE_RAD,
    SPEED_TOLERANCE_MPS,
)
from logs.verdict.wording import place_text
from world.wind import W20


def slope_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the slope of each leg; if ``geometric``, judge the route alone, without a flight."""
    out = []
    for leg in range(requirements.legs):
        # Without a flight the path of a climb that cannot be flown is unknown.
        if requirements.leads_around(leg) and not geometric:
            continue
        measure = None if geometric else SlopeMeasure()
        if aligned is not None:
            measure = measure_slope(requirements, aligned, leg)
        out.append(_judge(requirements, leg, measure))
    return out


def _judge(requirements: RouteRequirements, leg: int, measure: SlopeMeasure | None) -> Finding:
    planned = float(requirements.slopes[leg])
    limit, source = slope_limit(requirements, leg)
    sign = 1.0 if planned >= 0.0 else -1.0
    if abs(planned) <= LEVEL_SLOPE_RAD and not _is_in_envelope(requirements, leg):
        # A level leg at a speed that the aircraft cannot fly fails by its speed, not by its slope.
        limit = max(limit, LEVEL_SLOPE_RAD)
    faults, facts = [], [f"slope {math.degrees(planned):+.2f}°"]
    if abs(planned) > limit + PLAN_TOLERANCE_RAD:
        rise = step(requirements, leg)
        if rise is None:
            faults.append(_steep_leg_message(requirements, leg, limit, source))
        else:
            facts.append(f"a step of {rise:.1f} m, beyond {math.degrees(limit):.1f}°, flown within its own height")
    faults += _steep_arc_faults(requirements, leg)
    fit: LegFit | None = None
    method = "route"
    if measure is not None:
        facts += _flown_facts(measure)
        weak = _performance_faults(requirements, leg, measure)
        shown = _flown_faults(requirements, leg, measure, limit, weak)
        # If the aircraft's limits apply, they judge, and so does a shown lack of performance; the height error on the
        # leg is only reported.
        facts += [one.brief for one in shown] if requirements.envelope else []
        faults += weak if requirements.envelope else [*shown, *weak]
        fit = measure.slope
        method = "not flown"
        if fit is not None:
            how = "least squares" if fit.fitted else "least squares, short leg,"
            method = f"{how} over {fit.run:.0f} m"
    ok: bool | None = not faults
    check = ""
    if not faults and (doubt := _uncertainty_text(requirements, leg)):
        ok, check = None, UNKNOWN_AIRCRAFT
        facts.insert(0, doubt)
    if measure is not None and not measure.finished:
        facts.append("the flight did not get to its end")
        ok = None if ok else False
    judged = planned if fit is None else fit.value
    return make_finding(
        "slope",
        requirements.leg(leg),
        ok=ok,
        reason=reason_of(faults, facts if measure is not None or not faults else ()),
        faults=faults,
        planned=math.degrees(planned),
        flown=None if fit is None else math.degrees(fit.value),
        limit=math.degrees(sign * limit),
        at_least=sign < 0.0,
        source=source,
        tolerance=math.degrees(PLAN_TOLERANCE_RAD if fit is None else fit.tolerance),
        margin=math.degrees(limit - sign * judged),
        unit="deg",
        method=method,
        check=check,
        facts=_measured_facts(requirements, leg, measure),
    )


def _uncertainty_text(requirements: RouteRequirements, leg: int) -> str:
    """Explain why an uncertain aircraft model leaves a slope within its limits undecided; return "" if decided.

    Only the aircraft's own limits count, because a tighter limit of the scenario says nothing about its ability.
    """
    planned, envelope = float(requirements.slopes[leg]), requirements.setup.envelope
    limits, certain, verb, off = (
        (requirements.climb, requirements.sure_climb, "climbs", envelope.climb_sd)
        if planned >= 0.0
        else (requirements.dive, requirements.sure_dive, "falls", envelope.descent_sd)
    )
    limit, sure = float(limits[leg]), float(certain[leg])
    # When judged without the aircraft's limits, there is no limit to be in doubt.
    if abs(planned) <= max(LEVEL_SLOPE_RAD, sure) or not sure < limit < math.inf:
        return ""
    slope, known, give = (math.degrees(angle) for angle in (abs(planned), limit, off))
    return f"{verb} {slope:.1f}°; the limit according to {envelope.source} is {known:.1f}°, give or take {give:.1f}°"


def _steep_arc_faults(requirements: RouteRequirements, leg: int) -> list[Message]:
    """Return a fault if the fly-by arc at a leg's end is beyond the aircraft's limit."""
    found = steep_arc(requirements, leg)
    if found is None:
        return []
    i = leg + 1
    place = requirements.waypoint(i)
    length = float(requirements.radius[i]) * abs(float(requirements.turns[i]))
    verb = "climbs" if found.tangent > 0.0 else "falls"
    legs = " and ".join(f"{math.degrees(abs(float(requirements.slopes[k]))):.1f}°" for k in (leg, i))
    slope, missing = math.degrees(math.atan(abs(found.tangent))), (abs(found.tangent) - found.limit) * length
    asks = (
        f"the arc at {place_text(place)} {verb} {slope:.1f}° for {length:.0f} m, where legs {leg} and {i} have {legs}:"
        f" flown by, it is shorter than the {2.0 * float(requirements.before[i]):.0f} m of leg that it replaces"
    )
    limit = f"; the aircraft can fly at most {math.degrees(math.atan(found.limit)):.1f}° there, {missing:.0f} m less"
    # A headline names the waypoint, not its item.
    return [Message(asks + limit, asks if place.item is None else f"the arc at {place_text(Place('waypoint', i))}")]


def _is_in_envelope(requirements: RouteRequirements, leg: int) -> bool:
    low, high = requirements.setup.envelope.level_speeds(float(requirements.points[leg, 2]))
    return low <= float(requirements.route.airspeed[leg]) <= high


def _steep_leg_message(requirements: RouteRequirements, leg: int, limit: float, source: str) -> Message:
    """Describe a planned slope beyond its limit, with the slope that the leg needs and the limit."""
    planned = float(requirements.slopes[leg])
    verb = "climbs" if planned >= 0.0 else "falls"
    asks = f"{math.degrees(abs(planned)):.1f}° for {_distance_text(float(requirements.runs[leg]))}"
    if requirements.runs[leg] < MIN_LEG_LENGTH_M:
        rise = abs(float(requirements.points[leg + 1, 2] - requirements.points[leg, 2]))
        asks = f"{round(rise, 1):g} m on the spot, {math.degrees(abs(planned)):.1f}°"
    return message(f"leg {leg} {verb} {asks}", f"; {_limit_text(requirements, leg, limit, source)}", placed=True)


def _limit_text(requirements: RouteRequirements, leg: int, limit: float, source: str) -> str:
    """Describe the limit on a leg's slope, and how the wind changes the limit."""
    if source == "scenario":
        return f"the scenario allows {math.degrees(limit):.1f}°"
    speed = float(requirements.route.airspeed[leg])
    up = float(max(requirements.points[leg, 2], requirements.points[leg + 1, 2]))
    at = f"at {speed:.0f} m/s and {up:.0f} m"
    if limit <= 0.0:
        return f"{at} the aircraft cannot fly steadily on this course"
    wind = requirements.setup.scenario.wind
    tail, cross = wind.along(float(requirements.courses[leg]), up)
    if math.hypot(tail, cross) < CALM_WIND_MPS:
        return f"{at} the aircraft can fly at most {math.degrees(limit):.1f}° in calm air"
    calm = requirements.setup.envelope.slope_limits(speed, up)[0 if requirements.slopes[leg] >= 0.0 else 1]
    blows = f"{abs(tail):.0f} m/s {'tailwind' if tail > 0.0 else 'headwind'}"
    if abs(cross) > abs(tail):
        blows = f"{abs(cross):.0f} m/s crosswind"
    calm_text = f"at most {math.degrees(calm):.1f}°" if math.isfinite(calm) else "no slope"
    return f"{at} the aircraft can fly {calm_text} in calm air, but {math.degrees(limit):.1f}° in this {blows}"


def _distance_text(metres: float) -> str:
    return f"{metres / 1000.0:.1f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _throttle_times(measure: SlopeMeasure) -> tuple[tuple[str, float, float, str], ...]:
    """Return each throttle limit's name, its duration, s, and the speed error at the limit, m/s, with its direction."""
    return (("full", measure.at_full, measure.slow, "slow"), ("idle", measure.at_idle, measure.fast, "fast"))


def _flown_facts(measure: SlopeMeasure) -> list[str]:
    """Describe how the leg was flown."""
    facts = []
    if measure.slope is not None:
        facts.append(f"flown {math.degrees(measure.slope.value):+.2f}°")
    if measure.height_error is not None:
        facts.append(f"height within {abs(measure.height_error):.1f} m of the leg")
    facts += [f"throttle at {name} for {held:.0f} s" for name, held, _, _ in _throttle_times(measure) if held >= 1.0]
    return facts


def _measured_facts(requirements: RouteRequirements, leg: int, measure: SlopeMeasure | None) -> list[Fact]:
    """Return the measurements of a flown leg as facts."""
    if measure is None:
        return []
    facts = [] if measure.height_error is None else [Fact("height error", measure.height_error, "m")]
    if measure.slope is not None:
        off = math.degrees(measure.slope.value - float(requirements.slopes[leg]))
        facts.append(Fact("slope error", off, "deg"))
    for name, held, off, way in _throttle_times(measure):
        facts += [Fact(f"throttle at {name}", held, "s"), Fact(f"too {way}", off, "m/s")] if held > 0.0 else []
    return facts


def _flown_faults(
    requirements: RouteRequirements, leg: int, measure: SlopeMeasure, limit: float, weak: list[Message]
) -> list[Message]:
    """Return faults in which the flown leg differs from the planned leg.

    weak: faults that show a lack of performance.
    """
    faults = []
    planned = float(requirements.slopes[leg])
    sign = 1.0 if planned >= 0.0 else -1.0
    fit = measure.slope
    if fit is not None:
        flown = math.degrees(fit.value)
        if sign * fit.value > limit + fit.tolerance:
            faults.append(message(f"flown {flown:+.1f}°, beyond {math.degrees(limit):.1f}°"))
        if fit.fitted and abs(fit.value - planned) > SLOPE_TOLERANCE_RAD + fit.tolerance:
            faults.append(message(f"flown at {flown:+.1f}° instead of {math.degrees(planned):+.1f}°"))
    if measure.height_error is not None:
        off = abs(measure.height_error)
        if off > (SHORT_LEG_HEIGHT_ERROR_LIMIT_M if measure.short else HEIGHT_ERROR_LIMIT_M):
            side = "above" if measure.height_error > 0.0 else "below"
            faults.append(message(f"{off:.0f} m {side} the leg"))
    covered = not weak and measure.ability is not None and measure.ability.covers(planned)
    most = SPEED_TOLERANCE_MPS + GUST_SPEED_FRACTION * W20[requirements.setup.scenario.wind.turbulence]
    for name, held, off, way in _throttle_times(measure):
        # If the aircraft showed more ability than the leg needs, the air caused the speed error.
        if held >= SATURATED_TIME_S and off > most and not (covered and name == _throttle_limit(planned)):
            faults.append(message(f"throttle at {name} for {held:.0f} s and {off:.1f} m/s too {way}"))
    return faults


def _throttle_limit(planned: float) -> str:
    """Return the name of the throttle limit, "full" or "idle", that a slope may reach."""
    return "full" if planned >= 0.0 else "idle"


def _performance_faults(requirements: RouteRequirements, leg: int, measure: SlopeMeasure) -> list[Message]:
    """Return a fault if the aircraft showed less climb or sink ability than the leg needs."""
    ability, planned = measure.ability, float(requirements.slopes[leg])
    if ability is None or abs(planned) <= LEVEL_SLOPE_RAD:
        return []
    if ability.slope - abs(planned) >= -ABILITY_TOLERANCE_RAD - ABILITY_SIGMAS * ability.error:
        return []
    verb = "climb" if planned >= 0.0 else "sink"
    speed = float(requirements.route.airspeed[leg])
    return [
        message(
            f"in {ability.seconds:.0f} s at {_throttle_limit(planned)} throttle the aircraft showed that it can {verb}"
            f" {math.degrees(ability.slope):.1f}° at {speed:.0f} m/s here",
            f"; the leg needs {math.degrees(abs(planned)):.1f}°",
        )
    ]


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
    suggest=ease_slope,
    log=LogNeeds(("heights",), planned_heights=True, aircraft=True, full_leg=True),
)
