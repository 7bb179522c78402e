"""Altitude margin a plan needs because gusts can exceed the climb or sink rate of the aircraft.

In a downdraft planfly's guidance descends rather than stall; in an updraft ArduPlane and PX4 climb rather than exceed
their airspeed.  A plan is safe only if each leg has a margin for the altitude lost or gained in a gust, above its
clearance, below a maximum height above ground, and above or below missiles and zones.  If a plan has less margin,
another plan is searched for that stays further away and leaves more climb or sink rate unused.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product
from typing import Literal, NamedTuple

import numpy as np

from aircraft.path_limits import Limits, turn_tangents
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.gust_height import LEAST_SIGMAS, gust_deviation
from planfly.workflow.airframe import Airframe
from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import airspace_pieces
from planner.evaluation.certify import certify, kill_distance
from planner.evaluation.certify_kernels import heights_above_ground
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Plan
from world.arrays import Floats
from world.scenario import Scenario
from world.wind import Turbulence

Search = Callable[[Limits], Plan]
Gust = Literal["downdrafts", "updrafts"]

# Rate of climb that a higher plan leaves unused for downdrafts, in standard deviations of the vertical gusts.
_UNUSED_SIGMAS = 1.2
# Maximum fraction of the maximum climb rate that is left unused.
_UNUSED_CLIMB_FRACTION = 0.25
# The same fraction if a height limit lies above the plan; the more climb rate is unused, the less altitude a downdraft
# costs.
_UNUSED_CLIMB_FRACTION_BELOW_A_LIMIT = 0.75
# Rate of sink that a lower plan leaves unused for updrafts, in standard deviations of the vertical gusts.
_UNUSED_SINK_SIGMAS = 1.0
# Maximum fraction of the maximum sink rate that is left unused.
_UNUSED_SINK_FRACTION = 0.6
# Fraction of the margin needed in level flight that a plan has at a fixed end, where a flight spends only seconds.  Of
# 24 flights each of a Zagi in moderate turbulence between ends with a half, none came below its clearance over ground
# at 0, 1,500 and 3,000 m; with a quarter, 5 did at 3,000 m.
_END_HEIGHT_FRACTION = 0.5
# Distance from an end at which a plan has the full margin that its leg needs, m; the margin grows linearly up to there.
_FULL_HEIGHT_DISTANCE_M = 1500.0
# Length of the parts of a leg near an end that are judged separately, m.
_PART_LENGTH_M = 250.0
# Height step at which a path is compared with missiles and zones, m, so that none thicker than this is missed.
_HEIGHT_STEP_M = 2.5
# Minimum ratio of the length of a leg's part to the tangent of the turn in this part.
_TANGENT_RATIO = 1.05
# Tolerance for rounding, m.
_ROUNDING_TOLERANCE_M = 1e-6


class Shortfall(NamedTuple):
    """Hazard into which gusts may move the aircraft.

    gust: "downdrafts" or "updrafts".
    depth: depth of the displacement into the hazard, m.
    into: "into" a clearance, a missile's sphere or a zone, "out of" a zone, or "above" a height, with its name.
    where: the leg or the end of the path.
    at_end: "start" or "destination" if no other path helps, because the end itself is too low or high; otherwise "".
    of_threats: True for a missile or a zone.
    """

    gust: Gust
    depth: float
    into: str
    where: str
    at_end: str = ""
    of_threats: bool = False


def keep_height(plan: Plan, airframe: Airframe, search: Search | None = None) -> Plan:
    """Return the plan if each leg has a margin for a one-in-a-hundred gust, otherwise another plan.

    If no other plan is found, the given plan is returned as not safe, with the reason in its certificate.

    search: plans the same scenario within other limits; None if no other path is to be searched for.

    >>> from planfly.workflow.airframe import load_airframe
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> airframe = load_airframe(scenario)
    >>> plan = plan_path(scenario, airframe.limits, seed=1)
    >>> keep_height(plan, airframe) is plan
    True
    """
    if not plan.safe or not _gusts_matter(plan, airframe):
        return plan
    if climb_problem := _climb_problem(plan, airframe):
        return _with_problems(plan, [climb_problem])
    shortfalls = find_shortfalls(plan, airframe)
    if not shortfalls:
        return plan
    if search is not None and not any(one.at_end for one in shortfalls):
        other = _other_plan(plan, airframe, search, shortfalls)
        if other is not None:
            return other
    return _with_problems(plan, [_shortfall_text(one, plan, airframe) for one in shortfalls])


def _gusts_matter(plan: Plan, airframe: Airframe) -> bool:
    """Return True if gusts may move the aircraft further than its tracking error includes."""
    return any(
        displacement(0.0, plan.scenario.wind.turbulence)
        for _, displacement in _gust_displacements(plan.scenario, airframe.autopilot)
    )


def _gust_displacements(
    scenario: Scenario, autopilot: Autopilot
) -> list[tuple[Gust, Callable[[float, Turbulence], float]]]:
    """Return the gusts that matter, each with its displacement, m, as a function of the unused rate, m/s."""
    found: list[tuple[Gust, Callable[[float, Turbulence], float]]] = [("downdrafts", autopilot.gust_sink)]
    # Above a path there are no hazards other than a maximum height or a zone.
    if scenario.zones or scenario.limits.max_height_m is not None:
        found.append(("updrafts", autopilot.gust_rise))
    return found


def _with_problems(plan: Plan, problems: list[str]) -> Plan:
    certificate = plan.certificate
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, *problems)))


def _climb_problem(plan: Plan, airframe: Airframe) -> str:
    """Return a line on why no margin is enough for downdrafts at the plan's altitude, or "" if a margin is enough.

    With a climb rate of less than `LEAST_SIGMAS`, several downdrafts follow before the aircraft has climbed back.  Of
    24 flights of a Zagi with a climb rate of 0.57 standard deviations, 3 lost more than 47 m; of 24 with 0.8, none did.
    """
    amsl, turbulence = float(plan.waypoints[:, 2].max()), plan.scenario.wind.turbulence
    climb, least = airframe.limits.surely().rates(amsl)[0], LEAST_SIGMAS * gust_deviation(turbulence)
    if climb >= least or not airframe.autopilot.gust_sink(climb, turbulence):
        return ""
    return (
        f"climbs {climb:.2f} m/s at {amsl:.0f} m at most; with less than {least:.2f} m/s downdrafts of {turbulence}"
        " turbulence may push it down further than any height margin covers; less turbulence, a lower mission or an"
        " aircraft that climbs better would help"
    )


def _other_plan(plan: Plan, airframe: Airframe, search: Search, shortfalls: list[Shortfall]) -> Plan | None:
    """Search for a plan with the margin that gusts need; return None if there is none."""
    shares = [_UNUSED_CLIMB_FRACTION]
    if _exceeds_a_limit(plan, limits_in_gusts(plan, airframe).reserve_height):
        shares.append(_UNUSED_CLIMB_FRACTION_BELOW_A_LIMIT)
    seen = list(shortfalls)
    for unused, from_threats in product(shares, (False, True)):
        # Most paths pass missiles and zones at the side, so stay away from their tops only if a path led above one.
        if from_threats and not any(one.of_threats for one in seen):
            continue
        within = limits_in_gusts(plan, airframe, unused)
        # Without a maximum height the first of the two limits keeps only sink for updrafts, no distance.
        from_zones_alone = all(one.of_threats for one in shortfalls) and plan.scenario.limits.max_height_m is None
        if not from_threats and from_zones_alone and not within.reserve_height:
            continue
        other = search(_with_margin_at_threats(within) if from_threats else within)
        if not other.safe:
            continue
        lacking = find_shortfalls(other, airframe)
        if not lacking:
            return other
        seen += lacking
    return None


def _with_margin_at_threats(kept: Limits) -> Limits:
    """Return limits that also require their margin to the ground or the maximum height at missiles and zones."""
    return replace(kept, reserve_threats=max(kept.reserve_height, kept.reserve_above))


def _exceeds_a_limit(plan: Plan, higher: float) -> bool:
    """Return True if a plan raised by `higher`, m, exceeds a ceiling or a maximum height."""
    if not higher:
        return False
    scenario, inner = plan.scenario, plan.waypoints[1:-1]
    if not inner.size:
        inner = plan.waypoints
    limits = [np.full(len(inner), scenario.ceiling)]
    if scenario.limits.max_height_m is not None and scenario.terrain is not None:
        limits.append(scenario.terrain.height(inner[:, 0], inner[:, 1]) + scenario.limits.max_height_m)
    return bool((inner[:, 2] + higher > np.minimum.reduce(limits)).any())


def limits_in_gusts(plan: Plan, airframe: Airframe, unused: float = _UNUSED_CLIMB_FRACTION) -> Limits:
    """Return search limits for paths with the margin that gusts need at the plan's altitude.

    unused: maximum fraction of the maximum climb rate that is left unused for downdrafts.
    """
    limits, autopilot, turbulence = airframe.limits.surely(), airframe.autopilot, plan.scenario.wind.turbulence
    climb, sink = limits.rates(float(plan.waypoints[:, 2].max()))
    deviation = gust_deviation(turbulence)
    for gust, displacement in _gust_displacements(plan.scenario, autopilot):
        if not displacement(0.0, turbulence):
            continue
        if gust == "downdrafts":
            left = max(0.0, min(_UNUSED_SIGMAS * deviation, unused * climb))
            limits = replace(limits, reserve_height=displacement(left, turbulence), reserve_climb=left)
        else:
            left = max(LEAST_SIGMAS * deviation, min(_UNUSED_SINK_SIGMAS * deviation, _UNUSED_SINK_FRACTION * sink))
            if sink < LEAST_SIGMAS * deviation:
                left = 0.0
            limits = replace(limits, reserve_above=displacement(left, turbulence), reserve_sink=left)
    return limits


def limits_of_others(plan: Plan, airframe: Airframe) -> Limits:
    """Return search limits for alternatives to a safe plan, which are the tightest limits that this plan meets."""
    limits = airframe.limits.surely()
    if not _gusts_matter(plan, airframe):
        return limits
    for unused in (_UNUSED_CLIMB_FRACTION, _UNUSED_CLIMB_FRACTION_BELOW_A_LIMIT):
        kept = limits_in_gusts(plan, airframe, unused)
        for within in (_with_margin_at_threats(kept), kept):
            if certify(make_problem(plan.scenario, within), plan.waypoints).ok:
                return within
    return limits


# --- Shortfalls ---


class _Parts(NamedTuple):
    """Path cut into parts near its ends.

    gust: the kind of gusts.
    points: ends of the parts, (p, 3), m.
    legs: leg of each part, (p - 1,).
    before, after: altitude that a gust may cost or add at a point, on the part before and the part after it, (p,), m.
    """

    gust: Gust
    points: Floats
    legs: list[int]
    before: Floats
    after: Floats


def find_shortfalls(plan: Plan, airframe: Airframe) -> list[Shortfall]:
    """Find the deepest displacement by gusts into a clearance or above a maximum height, into a missile and a zone."""
    limits, autopilot, turbulence = airframe.limits.surely(), airframe.autopilot, plan.scenario.wind.turbulence
    problem = make_problem(plan.scenario, limits)
    rates = np.array([limits.rates(float(amsl)) for amsl in plan.waypoints[:, 2]])
    climbs, found = limits.climb_rates(plan.waypoints), list[Shortfall | None]()
    for gust, displacement in _gust_displacements(plan.scenario, autopilot):
        if not displacement(0.0, turbulence):
            continue
        down = gust == "downdrafts"
        able, used = (rates[:, 0], np.maximum(0.0, climbs)) if down else (rates[:, 1], np.maximum(0.0, -climbs))
        # Minimum of the unused rates at the start and at the end of each leg.
        left = np.minimum(able[:-1] - used[:, 0], able[1:] - used[:, 1])
        # ArduPlane and PX4 have an altitude error even without such a gust; planfly's guidance does not.
        strays = 0.0 if down else float(problem.certified.tracking.up)
        needs = np.array([displacement(float(one), turbulence) + strays for one in left])
        at_ends = _END_HEIGHT_FRACTION * np.array([displacement(float(able[k]), turbulence) + strays for k in (0, -1)])
        parts = _cut_into_parts(problem, plan.waypoints, gust, needs, at_ends)
        found += [
            _into_clearance(problem, parts) if down else _above_maximum(problem, parts),
            _into_missile(problem, parts) if down else None,
            _into_zone(problem, parts),
        ]
    return [one for one in found if one is not None and one.depth > _ROUNDING_TOLERANCE_M]


def _cut_into_parts(problem: Problem, waypoints: Floats, gust: Gust, needs: Floats, at_ends: Floats) -> _Parts:
    """Cut the legs of a path near its ends into parts, but not within a turn.

    waypoints: (w, 3), m.
    needs: altitude that gusts may cost or add on each leg, (w - 1,), m.
    at_ends: margin needed at the ends, (2,), m.
    """
    ends = waypoints[[0, -1]]
    tangents = turn_tangents(problem.certified.aircraft, waypoints) * _TANGENT_RATIO
    points, legs = [waypoints[0]], list[int]()
    for leg, (a, b) in enumerate(pairwise(waypoints)):
        run = math.dist(a[:2], b[:2])
        count = math.ceil(run / _PART_LENGTH_M)
        for along in run * np.arange(1, count) / count:
            point = a + (b - a) * along / run
            is_near = min(math.dist(point, end) for end in ends) <= _FULL_HEIGHT_DISTANCE_M + _PART_LENGTH_M
            if is_near and tangents[leg] <= along <= run - tangents[leg + 1]:
                points.append(point)
                legs.append(leg)
        points.append(b)
        legs.append(leg)
    path, own = np.array(points), needs[legs]
    away = np.array([np.linalg.norm(path - end, axis=1) for end in ends])
    share, at_end = np.minimum(1.0, away.min(axis=0) / _FULL_HEIGHT_DISTANCE_M), at_ends[away.argmin(axis=0)]
    before, after = (at_end + share * (need - at_end) for need in ([*own[:1], *own], [*own, *own[-1:]]))
    return _Parts(gust, path, legs, before, after)


def _heights_at_ends(problem: Problem, parts: _Parts) -> list[tuple[str, float, int]]:
    """Return the name, the height above ground, m, and the index of the points at both ends."""
    terrain = problem.scenario.terrain
    if terrain is None:  # pragma: no cover - a problem has one
        return []
    over = parts.points[:, 2] - terrain.height(parts.points[:, 0], parts.points[:, 1])
    return [("start", float(over[0]), 0), ("destination", float(over[-1]), -1)]


def _into_clearance(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the deepest displacement of a path by a downdraft below its clearance, or None without one."""
    data = problem.certified
    into = f"into the clearance of {data.clearance:g} m"
    for name, over, k in _heights_at_ends(problem, parts):
        if (depth := float(parts.after[k]) + data.clearance - over) > _ROUNDING_TOLERANCE_M:
            return Shortfall(parts.gust, depth, into, f"at its {name}", at_end=name)
    lowest = Shortfall(parts.gust, 0.0, into, "")
    for piece in heights_above_ground(data, parts.points):
        k = int(piece["number"])
        # A part needs the margin of that of its ends which is nearer to the end of the path.
        need = max(parts.before[k], parts.after[k]) if piece["of_arc"] else min(parts.after[k], parts.before[k + 1])
        depth = float(need) + data.clearance - float(piece["height"])
        if depth > lowest.depth:
            lowest = Shortfall(parts.gust, depth, into, f"on leg {parts.legs[k]}")
    return lowest


def _above_maximum(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the highest displacement by an updraft above the maximum height, or None without one."""
    data, most = problem.certified, problem.certified.airspace.max_height
    if most == math.inf:
        return None
    above = f"above the {most:.0f} m over ground that are allowed"
    for name, over, k in _heights_at_ends(problem, parts):
        if (depth := over + float(parts.after[k]) - most) > _ROUNDING_TOLERANCE_M:
            return Shortfall(parts.gust, depth, above, f"at its {name}", at_end=name)
    pieces = airspace_pieces(data, _gust_paths(parts)[-1])
    highest = max(pieces, key=lambda piece: float(piece["height"]))
    where = f"on leg {parts.legs[min(int(highest['number']), len(parts.legs) - 1)]}"
    return Shortfall(parts.gust, float(highest["height"]) - most, above, where)


def _into_missile(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the deepest displacement by a gust into the sphere of a missile, or None without one."""
    threats = problem.scenario.threats
    paths = _gust_paths(parts) if (threats.kill_radius > 0.0).any() else []
    deepest = min(paths, key=lambda path: kill_distance(problem.certified, path), default=None)
    if deepest is None or (distance := kill_distance(problem.certified, deepest)) >= 0.0:
        return None
    begins, steps = deepest[:-1, None], np.diff(deepest, axis=0)[:, None]
    # Nearest point of each leg to each missile, as a fraction of the leg.
    along = ((threats.position - begins) * steps).sum(axis=2) / (steps**2).sum(axis=2)
    nearest = begins + np.clip(along, 0.0, 1.0)[..., None] * steps
    outside = np.linalg.norm(nearest - threats.position, axis=2) - threats.kill_radius
    part, missile = np.unravel_index(np.argmin(np.where(threats.kill_radius > 0.0, outside, np.inf)), outside.shape)
    leg = parts.legs[int(part)]
    return Shortfall(
        parts.gust, -distance, f"into the reach of {threats.names[missile]}", f"on leg {leg}", of_threats=True
    )


def _into_zone(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the deepest displacement by a gust into an exclusion zone or out of an inclusion zone, or None."""
    data = problem.certified
    if not is_limited(data.airspace) or not problem.scenario.zones:
        return None
    found = [piece for path in _gust_paths(parts) for piece in airspace_pieces(data, path)]
    worst = min(found, key=lambda piece: float(piece["zones"]["nearest"]))
    if worst["zones"]["nearest"] >= 0.0:
        return None
    number = data.airspace.zones.required[int(worst["zones"]["zone"])]["number"]
    zone = problem.scenario.zones[int(number)]
    into = f"into {zone.name}" if zone.kind == "exclusion" else f"out of {zone.name}"
    where = f"on leg {parts.legs[min(int(worst['number']), len(parts.legs) - 1)]}"
    return Shortfall(parts.gust, -float(worst["zones"]["nearest"]), into, where, of_threats=True)


def _gust_paths(parts: _Parts) -> list[Floats]:
    """Return the path displaced by gusts, (p, 3) each, in steps that miss no hazard, up to the full displacement."""
    heights = np.maximum(parts.before, parts.after)
    count = max(1, math.ceil(float(heights.max()) / _HEIGHT_STEP_M))
    whole = np.array([0.0, 0.0, -1.0 if parts.gust == "downdrafts" else 1.0]) * heights[:, None]
    return [np.ascontiguousarray(parts.points + whole * k / count) for k in range(1, count + 1)]


def _shortfall_text(one: Shortfall, plan: Plan, airframe: Airframe) -> str:
    """Describe a shortfall and its remedies in one line."""
    better = "climbs better" if one.gust == "downdrafts" else "sinks faster"
    helps = f"less turbulence, an aircraft that {better}"
    is_held_down = one.gust == "updrafts" and not one.of_threats
    if one.at_end:
        lies = "higher" if one.gust == "downdrafts" else "lower"
        helps += f" or a {one.at_end} that is {math.ceil(one.depth)} m {lies}"
    elif is_held_down or _exceeds_a_limit(plan, limits_in_gusts(plan, airframe).reserve_height):
        helps += " or a higher limit on its height"
    else:
        helps = f"less turbulence, or an aircraft that {better},"
    gusts = f"in {plan.scenario.wind.turbulence} turbulence {one.gust} may take it"
    return f"{gusts} {one.depth:.0f} m {one.into} {one.where}; {helps} would help"
