"""Height that downdrafts take from an aircraft with little climb in hand: a plan that keeps as much, or is not safe.

Planfly's guidance gives up height before it stalls (`flight.autopilots.planfly.law`).  Where a plan has less above its
clearance than a downdraft may take on a leg, another is searched for that keeps more height and asks for less climb.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, ground_speed_on
from flight.autopilots.autopilot import Autopilot
from planfly.airframe import Airframe
from planner.evaluation.certify import certify
from planner.evaluation.certify_kernels import heights_above_ground
from planner.evaluation.problem import make_problem
from planner.plan import Plan
from world.geometry import leg_courses, leg_slopes
from world.wind import W20

Floats = NDArray[np.float64]

# Climb that a plan which keeps height for downdrafts keeps in hand: so many standard deviations of theirs, and at most
# this share of what the aircraft can.
_IN_HAND, _SHARE = 1.2, 0.25
# Length of the parts of a leg that are looked at, m.
_PART = 250.0
# Tolerance for rounding, m.
_EPSILON = 1e-6


def keep_height(plan: Plan, airframe: Airframe, search: Callable[[Limits], Plan] | None = None) -> Plan:
    """A safe plan that keeps the height that downdrafts may take; as it is where it does, or with what is wrong.

    search: plans the same scenario within other limits; None not to look for another path.

    >>> from planfly.airframe import load_airframe
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> airframe = load_airframe(scenario)
    >>> plan = plan_path(scenario, airframe.limits, seed=1)
    >>> keep_height(plan, airframe) is plan
    True
    """
    if not plan.safe or not airframe.autopilot.gust_sink(0.0, plan.scenario.wind.turbulence):
        return plan
    kept = limits_in_gusts(plan, airframe)
    problems = _lacking(plan, airframe, kept)
    if not problems:
        return plan
    # Most ways lie beside missiles and zones: only where one leads above them is it kept from them, too.
    for within in (kept, replace(kept, reserve_threats=kept.reserve_height)):
        if search is None:
            break
        other = search(within)
        if other.safe and not _lacking(other, airframe, kept):
            return other
    certificate = plan.certificate
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, *problems)))


def limits_in_gusts(plan: Plan, airframe: Airframe) -> Limits:
    """The limits of a search, at the heights of a plan, that keeps above ground what downdrafts may take."""
    limits, turbulence = airframe.limits.surely(), plan.scenario.wind.turbulence
    climb, _ = limits.rates(float(plan.waypoints[:, 2].max()))
    reserve = max(0.0, min(_IN_HAND * 0.1 * W20[turbulence], _SHARE * climb))
    height = airframe.autopilot.gust_sink(reserve, turbulence)
    return replace(limits, reserve_height=height, reserve_climb=reserve)


def limits_of_others(plan: Plan, airframe: Airframe) -> Limits:
    """The limits of plans beside a safe one: those that keep height where it does, or needs to."""
    limits = airframe.limits.surely()
    if not airframe.autopilot.gust_sink(0.0, plan.scenario.wind.turbulence):
        return limits
    kept = limits_in_gusts(plan, airframe)
    return kept if certify(make_problem(plan.scenario, kept), plan.waypoints).ok else limits


def _lacking(plan: Plan, airframe: Airframe, kept: Limits) -> list[str]:
    """What downdrafts may take a plan into, a line each.

    kept: the limits that keep height; near an end that has less than theirs, a leg needs the same share of it.
    """
    data = make_problem(plan.scenario, kept).certified
    needs = _needs(plan, airframe.autopilot, kept)
    low, leg = 0.0, 0
    parts, legs = _in_parts(plan.waypoints)
    for piece in heights_above_ground(data, parts):
        k = int(piece["number"])
        number = legs[k]
        # An arc lies between two parts.
        need = max(needs[number], needs[legs[k - 1]]) if piece["of_arc"] else needs[number]
        left = float(piece["height"]) - data.clearance - need * float(piece["buffer"]) / data.buffer
        low, leg = min((low, leg), (left, number))
    lowered = np.array(plan.waypoints, dtype=np.float64)
    lowered[:, 2] -= np.maximum([0.0, *needs], [*needs, 0.0])
    below = certify(make_problem(plan.scenario, airframe.limits.surely()), lowered)
    into = {
        f"the clearance of {data.clearance:g} m on leg {leg}": -low,
        "a missile's reach": -below.kill_distance,
        "a zone": -below.zone_distance,
    }
    gusts = f"in {plan.scenario.wind.turbulence} turbulence downdrafts may take it"
    helps = "less turbulence, or an aircraft that climbs better, would help"
    return [f"{gusts} {depth:.0f} m into {what}; {helps}" for what, depth in into.items() if depth > _EPSILON]


def _in_parts(waypoints: Floats) -> tuple[Floats, list[int]]:
    """A path (w, 3) with points in between, and the leg of each part: what an end needs is not the whole leg's need."""
    points, legs = [waypoints[0]], list[int]()
    for leg, (a, b) in enumerate(pairwise(waypoints)):
        count = math.ceil(float(np.linalg.norm(b - a)) / _PART)
        points += [a + (b - a) * k / count for k in range(1, count + 1)]
        legs += [leg] * count
    return np.array(points), legs


def _needs(plan: Plan, autopilot: Autopilot, limits: Limits) -> list[float]:
    """Height (m) that downdrafts may take on each leg, by the climb that it leaves in hand."""
    table, turbulence, needs = limits.performance(), plan.scenario.wind.turbulence, []
    legs = zip(leg_courses(plan.waypoints), leg_slopes(plan.waypoints), plan.waypoints[1:, 2], strict=True)
    for course, slope, up in legs:
        amsl = float(up)
        climbs = float(ground_speed_on(table, float(course), amsl)) * math.tan(float(slope))
        needs.append(autopilot.gust_sink(limits.rates(amsl)[0] - max(0.0, climbs), turbulence))
    return needs
