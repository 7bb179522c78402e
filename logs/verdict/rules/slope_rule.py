"""The slope rule: can each leg be climbed or descended at its speed, and was it."""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.path_limits import arc_slope
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.leg_fits import Fit
from logs.verdict.measures.route_demands import ON_THE_SPOT, RouteDemands
from logs.verdict.measures.slopes import SATURATED, SURE, SlopeMeasure, measure_slope
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.rules.turn_rule import PLAN_TOLERANCE
from world.wind import W20

# A leg passes if its fitted slope is within this (rad) of the plan, beside the fit's own tolerance, and its height
# within this (m) of the leg's line, away from the blends at its ends; more where there is no such place.
OFF_SLOPE = math.radians(0.5)
OFF_HEIGHT = 10.0
OFF_HEIGHT_SHORT = 15.0
# A leg within this (rad) of level.
LEVEL = math.radians(0.5)
# With the throttle at a limit for `SATURATED`, the mean airspeed may be off by this (m/s, and a gust's standard
# deviation in turbulence).
OFF_SPEED = 1.0
# Standard deviation of the gust along the track, as a share of the wind at 6 m (MIL-F-8785C: 0.1 high up to 0.2 at the
# ground).
GUST_SHARE = 0.15
# What an aircraft showed that it can may fall short of what a leg asks by this (rad) and `SURE` of its standard errors.
SHOWN_TOLERANCE = math.radians(0.1)


def slope_findings(shape: RouteDemands, flown: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """Judge each leg; ``geometric`` judges the route alone, without a flight."""
    out = []
    for leg in range(shape.legs):
        measure = None if geometric else SlopeMeasure()
        if flown is not None:
            measure = measure_slope(shape, flown, leg)
        out.append(_judge(shape, leg, measure))
    return out


def slope_limit(shape: RouteDemands, leg: int) -> tuple[float, str]:
    """Tighter limit on a leg's climb or, for a leg that falls, dive: rad, positive, and whose it is."""
    rising = shape.slopes[leg] >= 0.0
    fixed = shape.limits.max_climb if rising else shape.limits.max_dive
    aircraft = float((shape.climb if rising else shape.dive)[leg])
    if fixed is not None and fixed <= aircraft:
        return fixed, "scenario"
    return aircraft, "aircraft" if math.isfinite(aircraft) else "none"


def _judge(shape: RouteDemands, leg: int, measure: SlopeMeasure | None) -> Finding:
    planned = float(shape.slopes[leg])
    limit, source = slope_limit(shape, leg)
    sign = 1.0 if planned >= 0.0 else -1.0
    if abs(planned) <= LEVEL and not _in_envelope(shape, leg):
        # A level leg at a speed that the aircraft cannot fly fails by its speed, not by its slope.
        limit = max(limit, LEVEL)
    wrong = [_too_steep(shape, leg, limit, source)] if abs(planned) > limit + PLAN_TOLERANCE else []
    wrong += _steep_arc(shape, leg)
    facts = [f"slope {math.degrees(planned):+.2f}°"]
    fit: Fit | None = None
    method = "route"
    if measure is not None:
        said, faults = _evidence(shape, leg, measure, limit)
        facts += said
        wrong += faults
        fit = measure.slope
        method = "not flown"
        if fit is not None:
            how = "least squares" if fit.fitted else "least squares, short leg,"
            method = f"{how} over {fit.run:.0f} m"
    ok: bool | None = not wrong
    if measure is not None and not measure.finished:
        facts.append("the flight did not get to its end")
        ok = None if ok else False
    text = "; ".join(facts)
    judged = planned if fit is None else fit.value
    return make_finding(
        "slope",
        f"leg {leg}",
        ok=ok,
        reason="; ".join(wrong) + (f" ({text})" if measure is not None else "") if wrong else text,
        planned=math.degrees(planned),
        flown=None if fit is None else math.degrees(fit.value),
        limit=math.degrees(sign * limit),
        source=source,
        tolerance=math.degrees(PLAN_TOLERANCE if fit is None else fit.tolerance),
        margin=math.degrees(limit - sign * judged),
        unit="deg",
        method=method,
    )


def steep_arc(shape: RouteDemands, leg: int) -> tuple[float, float] | None:
    """Tangent of the slope of the fly-by arc at a leg's end, and of what the aircraft can on the mean of its courses.

    None where that leaves the airspeed within `OFF_SPEED`: what the aircraft cannot climb or sink on the arc it takes
    from its speed or adds to it, g dh / V.
    """
    i = leg + 1
    if i == shape.legs or shape.setup.route.fly_over[i] or shape.setup.route.arcs[i] > 0.0:
        return None
    reach, length = float(shape.before[i]), float(shape.radius[i]) * abs(float(shape.turns[i]))
    if not 0.0 < reach < min(shape.runs[leg : leg + 2]):
        return None
    tangent = arc_slope(math.tan(shape.slopes[leg]), math.tan(shape.slopes[i]), reach, float(shape.radius[i]))
    limits = (shape.climb if tangent > 0.0 else shape.dive)[leg : leg + 2]
    if not np.isfinite(limits).all() or not (limits > 0.0).all():
        return None
    can, speed = float(np.tan(limits).mean()), float(shape.setup.route.airspeed[leg])
    return (tangent, can) if GRAVITY * (abs(tangent) - can) * length / speed > OFF_SPEED else None


def _steep_arc(shape: RouteDemands, leg: int) -> list[str]:
    """What the fly-by arc at a leg's end asks beyond what the aircraft can, in words."""
    found = steep_arc(shape, leg)
    if found is None:
        return []
    i = leg + 1
    tangent, can = found
    length = float(shape.radius[i]) * abs(float(shape.turns[i]))
    verb = "climbs" if tangent > 0.0 else "falls"
    legs = " and ".join(f"{math.degrees(abs(float(shape.slopes[k]))):.1f}°" for k in (leg, i))
    missing = (abs(tangent) - can) * length
    return [
        f"the arc at {shape.waypoint(i)} {verb} {math.degrees(math.atan(abs(tangent))):.1f}° for {length:.0f} m,"
        f" where legs {leg} and {i} have {legs}: flown by, it is shorter than the {2.0 * float(shape.before[i]):.0f} m"
        f" of leg that it replaces; the aircraft can {math.degrees(math.atan(can)):.1f}° there, {missing:.0f} m less"
    ]


def _in_envelope(shape: RouteDemands, leg: int) -> bool:
    low, high = shape.setup.envelope.level_speeds(float(shape.points[leg, 2]))
    return low <= float(shape.setup.route.airspeed[leg]) <= high


def _too_steep(shape: RouteDemands, leg: int, limit: float, source: str) -> str:
    planned = float(shape.slopes[leg])
    verb = "climbs" if planned >= 0.0 else "falls"
    says = f"leg {leg} {verb} {math.degrees(abs(planned)):.1f}° for {_distance(float(shape.runs[leg]))}"
    if shape.runs[leg] < ON_THE_SPOT:
        rise = abs(float(shape.points[leg + 1, 2] - shape.points[leg, 2]))
        says = f"leg {leg} {verb} {f'{rise:.1f}'.removesuffix('.0')} m on the spot, {math.degrees(abs(planned)):.1f}°"
    if source == "scenario":
        return f"{says}; the scenario allows {math.degrees(limit):.1f}°"
    speed = float(shape.setup.route.airspeed[leg])
    up = float(max(shape.points[leg, 2], shape.points[leg + 1, 2]))
    at = f"at {speed:.0f} m/s and {up:.0f} m"
    if limit <= 0.0:
        return f"{says}; {at} the aircraft has no steady flight on this course"
    wind = shape.setup.scenario.wind
    tail, cross = wind.along(float(shape.courses[leg]), up)
    if math.hypot(tail, cross) < 0.5:
        return f"{says}; {at} the aircraft can {math.degrees(limit):.1f}° in calm air"
    calm = shape.setup.envelope.slope_limits(speed, up)[0 if planned >= 0.0 else 1]
    blows = f"{abs(tail):.0f} m/s {'tailwind' if tail > 0.0 else 'headwind'}"
    if abs(cross) > abs(tail):
        blows = f"{abs(cross):.0f} m/s crosswind"
    calm_text = f"{math.degrees(calm):.1f}°" if math.isfinite(calm) else "nothing"
    return f"{says}; {at} the aircraft can {calm_text} in calm air but {math.degrees(limit):.1f}° in this {blows}"


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:.1f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _evidence(shape: RouteDemands, leg: int, measure: SlopeMeasure, limit: float) -> tuple[list[str], list[str]]:
    """AlignedTrack evidence in words, and what of it is not good enough."""
    said, wrong = [], []
    planned = float(shape.slopes[leg])
    sign = 1.0 if planned >= 0.0 else -1.0
    fit = measure.slope
    if fit is not None:
        said.append(f"flown {math.degrees(fit.value):+.2f}°")
        if sign * fit.value > limit + fit.tolerance:
            wrong.append(f"flown {math.degrees(fit.value):+.1f}°, beyond {math.degrees(limit):.1f}°")
        if fit.fitted and abs(fit.value - planned) > OFF_SLOPE + fit.tolerance:
            wrong.append(f"flown at {math.degrees(fit.value):+.1f}° instead of {math.degrees(planned):+.1f}°")
    if measure.height_error is not None:
        said.append(f"height within {abs(measure.height_error):.1f} m of the leg")
        if abs(measure.height_error) > (OFF_HEIGHT_SHORT if measure.short else OFF_HEIGHT):
            where = "above" if measure.height_error > 0.0 else "below"
            wrong.append(f"{abs(measure.height_error):.0f} m {where} the leg")
    short, fits = _ability(shape, leg, measure)
    wrong += short
    most = OFF_SPEED + GUST_SHARE * W20[shape.setup.scenario.wind.turbulence]
    for name, held, off, word in (
        ("full", measure.at_full, measure.slow, "slow"),
        ("idle", measure.at_idle, measure.fast, "fast"),
    ):
        if held >= 1.0:
            said.append(f"throttle at {name} for {held:.0f} s")
        # Where the aircraft showed that it can more than the leg asks, the air took the speed.
        if held >= SATURATED and off > most and not (fits and name == _throttle(planned)):
            wrong.append(f"throttle at {name} for {held:.0f} s and {off:.1f} m/s too {word}")
    return said, wrong


def _throttle(planned: float) -> str:
    """Name of the throttle limit that a slope may come to."""
    return "full" if planned >= 0.0 else "idle"


def _ability(shape: RouteDemands, leg: int, measure: SlopeMeasure) -> tuple[list[str], bool]:
    """What is wrong where the aircraft showed that it can less than the leg asks, and whether it showed that it can."""
    shown, planned = measure.shown, float(shape.slopes[leg])
    if shown is None:
        return [], False
    spare = shown.slope - abs(planned)
    if abs(planned) <= LEVEL or spare >= -SHOWN_TOLERANCE - SURE * shown.error:
        return [], shown.covers(planned)
    verb = "climb" if planned >= 0.0 else "sink"
    speed = float(shape.setup.route.airspeed[leg])
    return [
        f"in {shown.seconds:.0f} s at {_throttle(planned)} throttle the aircraft showed that it can {verb}"
        f" {math.degrees(shown.slope):.1f}° at {speed:.0f} m/s here; the leg asks for {math.degrees(abs(planned)):.1f}°"
    ], False
