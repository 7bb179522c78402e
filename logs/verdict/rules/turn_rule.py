"""The turn rule: can each corner be turned, and was it."""

import math

from flight.guidance.fly_by_path import SHARPEST
from flight.guidance.navigation_error import ERRORS
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.route_demands import ON_THE_SPOT, RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.turns import TurnMeasure, measure_turn
from world.geometry import fly_by_offset

# A turn passes if the bank stays within the limit and this, the aircraft within this of its arc on the outside, and the
# cross-track settles under this before the next turn; the design document's figures.
BANK_TOLERANCE = math.radians(5.0)
OVERSHOOT = 5.0
SETTLED = 1.0
# What gusts may add to the settled cross-track, m.
GUST_OFFSET = {"none": 0.0, "light": 0.5, "moderate": 1.0}
# A flown arc may pass its waypoint closer than the arc at the bank limit by this share, and by this, m, which is as far
# as an aircraft may be from its path with good guidance; arcs that pass it within that are not measured.
CLOSER_SHARE = 0.01
CLOSER = {"none": 0.6, "light": 0.8, "moderate": 1.0}
# Navigation may be off by this many of its standard deviations.
_NAV_SIGMAS = 3.0
# A planned angle is known to this, rad: 1e-7 degrees of latitude on a 130 m leg, and rounding.
PLAN_TOLERANCE = math.radians(0.01)


def turn_findings(shape: RouteDemands, flown: AlignedTrack | None, *, geometric: bool = False) -> list[Finding]:
    """Judge each inner waypoint; ``geometric`` judges the route alone, without a flight."""
    out = []
    for i in range(1, shape.legs):
        measure = None if geometric else TurnMeasure()
        if flown is not None:
            measure = measure_turn(shape, flown, i)
        out.append(_judge(shape, i, measure))
    return out


def turn_limit(shape: RouteDemands, i: int) -> tuple[float, str]:
    """Tighter of the scenario's and the aircraft's limit at a waypoint, rad, and whose it is."""
    fixed = shape.limits.max_turn
    aircraft = float(shape.turn_limit[i])
    # A circle has no angle: its corners are of our making.
    if fixed is not None and fixed <= aircraft and shape.setup.route.arcs[i] == 0.0:
        return fixed, "scenario"
    return aircraft, "aircraft" if math.isfinite(aircraft) else "none"


def _judge(shape: RouteDemands, i: int, measure: TurnMeasure | None) -> Finding:
    planned = abs(float(shape.turns[i]))
    limit, source = turn_limit(shape, i)
    if shape.runs[i - 1 : i + 1].min() < ON_THE_SPOT:
        reason = "a leg beside it goes straight up or down, which has no course to turn from or to"
        return make_finding("turn", shape.waypoint(i), ok=None, reason=reason, unit="deg")
    wrong = [_too_sharp(shape, i, planned, limit, source)] if planned > limit + PLAN_TOLERANCE else []
    facts = [
        f"turns {math.degrees(planned):.1f}°" + (f" of {math.degrees(limit):.1f}°" if math.isfinite(limit) else "")
    ]
    method, angle, tolerance = "route", None, PLAN_TOLERANCE
    if measure is not None:
        angle, tolerance = measure.angle, measure.tolerance or PLAN_TOLERANCE
        said, faults = _evidence(shape, i, measure, limit)
        wrong += faults
        facts += said
        method = "least-squares courses of both legs" if measure.fitted else "course change over the turn"
        if angle is None:
            method = "not flown"
    ok: bool | None = not wrong
    if measure is not None and not measure.over:
        facts.append("the flight did not get past it")
        ok = None if ok else False
    facts_text = "; ".join(facts)
    reason = facts_text
    if wrong:
        reason = "; ".join(wrong) + (f" ({facts_text})" if measure is not None else "")
    return make_finding(
        "turn",
        shape.waypoint(i),
        ok=ok,
        reason=reason,
        planned=math.degrees(planned),
        flown=None if angle is None else math.degrees(angle),
        limit=math.degrees(limit),
        source=source,
        tolerance=math.degrees(tolerance),
        margin=math.degrees(limit - (planned if angle is None else angle)),
        unit="deg",
        method=method,
    )


def _too_sharp(shape: RouteDemands, i: int, planned: float, limit: float, source: str) -> str:
    sharp = f"turns {math.degrees(planned):.1f}°"
    if source == "scenario":
        return f"{sharp}, beyond the scenario's {math.degrees(limit):.1f}°"
    speed = float(max(shape.setup.route.airspeed[i - 1 : i + 1]))
    if not math.isfinite(shape.radius[i]):
        return f"{sharp} where the wind leaves no way along a leg at {speed:.0f} m/s"
    if shape.setup.route.arcs[i] > 0.0:
        bank = math.degrees(shape.limits.max_bank)
        return (
            f"circles with radius {shape.radius[i]:.0f} m; at {speed:.0f} m/s and {bank:.0f}° bank the aircraft turns"
            f" with {shape.tightest[i]:.0f} m on these courses in this wind"
        )
    takes = "no length of leg is enough"
    if math.isfinite(shape.after[i]):
        takes = f"that takes {shape.after[i]:.0f} m of each leg"
        if shape.setup.route.fly_over[i]:
            takes = f"flying over it takes {shape.after[i]:.0f} m of the next leg"
    return (
        f"{sharp} between legs of {shape.runs[i - 1]:.0f} m and {shape.runs[i]:.0f} m: at {speed:.0f} m/s and"
        f" {math.degrees(shape.limits.max_bank):.0f}° bank (radius {shape.radius[i]:.0f} m) {takes}, and beside its"
        f" neighbours there is room for {math.degrees(limit):.1f}°"
    )


def _evidence(shape: RouteDemands, i: int, measure: TurnMeasure, limit: float) -> tuple[list[str], list[str]]:
    """AlignedTrack evidence in words, and what of it is not good enough."""
    said, wrong = [], []
    turbulence = shape.setup.scenario.wind.turbulence
    if measure.angle is not None and measure.tolerance is not None:
        said.append(f"flown {math.degrees(measure.angle):.2f}°")
        if measure.angle > limit + measure.tolerance:
            wrong.append(f"flown course change {math.degrees(measure.angle):.1f}° beyond {math.degrees(limit):.1f}°")
    if measure.peak_bank is not None and measure.held_bank is not None:
        most = shape.limits.max_bank + BANK_TOLERANCE
        # The roll of a gust, or into a turn, is not the turn's: the mean over a second counts.
        bank = measure.held_bank
        said.append(f"bank up to {math.degrees(measure.peak_bank):.1f}°")
        if bank > most:
            wrong.append(f"bank {math.degrees(bank):.1f}° beyond {math.degrees(most):.1f}°")
    wrong += _too_tight(shape, i, measure)
    if measure.radius is not None and measure.radius < 10.0 * shape.radius[i]:
        said.append(f"radius {measure.radius:.0f} m")
    if measure.overshoot is not None:
        said.append(f"overshoot {measure.overshoot:.1f} m")
        if measure.overshoot > OVERSHOOT:
            wrong.append(f"overshoots its arc by {measure.overshoot:.0f} m (at most {OVERSHOOT:.0f} m)")
    if measure.settled is not None and measure.over:
        said.append(f"settled to {measure.settled:.2f} m")
        most = SETTLED + GUST_OFFSET[turbulence]
        if measure.settled > most:
            wrong.append(f"still {measure.settled:.1f} m off the next leg at its end (at most {most:.1f} m)")
    if measure.full_circles:
        wrong.append(f"{measure.full_circles} full circle(s) flown at the corner")
    return said, wrong


def _too_tight(shape: RouteDemands, i: int, measure: TurnMeasure) -> list[str]:
    """What is wrong with a turn flown tighter than the bank limit's arc, by how closely it passed its waypoint.

    The legs of a turn that they have no room for are joined by a tighter arc, and a flight that follows it has used
    bank that it does not have, or slowed down.
    """
    turn, setup = abs(float(shape.turns[i])), shape.setup
    least = fly_by_offset(turn, float(shape.tightest[i])) if turn < SHARPEST else math.inf
    if measure.passed is None or not math.isfinite(least) or setup.route.fly_over[i] or setup.guidance != "path":
        return []
    slack = CLOSER_SHARE * least + CLOSER[setup.scenario.wind.turbulence] + _NAV_SIGMAS * ERRORS[setup.nav][0]
    if measure.passed >= least - slack:
        return []
    radius = measure.passed / least * float(shape.tightest[i])
    return [
        f"flown with a radius of {radius:.0f} m, {measure.passed:.1f} m from its waypoint; at"
        f" {math.degrees(shape.limits.max_bank):.0f}° bank in this wind it is {shape.tightest[i]:.0f} m, and"
        f" {least:.1f} m from it"
    ]
