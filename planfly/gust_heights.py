"""Height that downdrafts take from an aircraft that climbs less than they sink, and plans that keep that height.

planfly's guidance gives up height before it stalls (`flight.autopilots.planfly.law`). A plan for it is safe only if
each leg has as much height above its clearance, missiles and zones as a downdraft may take there. Where a plan has
less, another is searched for that flies higher and climbs more gently.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, turn_tangents
from planfly.airframe import Airframe
from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import airspace_pieces
from planner.evaluation.certify import certify, kill_distance
from planner.evaluation.certify_kernels import heights_above_ground
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Plan
from world.wind import W20

Floats = NDArray[np.float64]
Search = Callable[[Limits], Plan]

# Least climb at which height is enough, in standard deviations of the vertical gusts: with less, several downdrafts
# take an aircraft down before it has climbed back. Of 24 flights of a Zagi that climbs 0.57 of one 3 came down by more
# than 47 m; of 24 that climbs 0.8 of one none did.
_LEAST_SIGMAS = 0.6
# Rate of climb that a higher plan leaves unused for downdrafts: this many standard deviations of the vertical gusts,
# but at most this share of the fastest climb. Where a height limit lies above the plan, a larger share is tried, too:
# the more climb is left, the less height a downdraft takes.
_UNUSED_SIGMAS, _UNUSED_SHARE, _UNUSED_SHARE_BELOW_A_LIMIT = 1.2, 0.25, 0.75
# At a fixed end a flight spends only seconds: there a plan keeps this share of the height that level flight takes, and
# from there more, until it is the whole of what the leg takes at this distance (m). Of 24 flights each of a Zagi in
# moderate turbulence between ends with a half, none came below its clearance over ground at 0, 1,500 and 3,000 m; with
# a quarter 5 did at 3,000 m.
_SHARE_AT_ENDS, _GROWS_OVER = 0.5, 1500.0
# Length of the parts of a leg near an end that are judged by themselves, m.
_PART = 250.0
# Difference of the heights at which a lowered path is compared with missiles and zones, m: none thicker is missed.
_STEP = 2.5
# A part of a leg must be this many times as long as the tangent of a turn that it holds.
_LONGER_THAN_TANGENT = 1.05
# Tolerance for rounding, m.
_EPSILON = 1e-6


class Shortfall(NamedTuple):
    """Something that a downdraft may take a plan into.

    depth: m.
    into: "into" a clearance, a missile's reach or a zone, or "out of" one, with its name.
    where: on which leg, or at which end.
    at_end: "start" or "destination" if no other path helps, because the end itself lies too low; otherwise "".
    below: whether it is a missile or a zone.
    """

    depth: float
    into: str
    where: str
    at_end: str = ""
    below: bool = False


def keep_height(plan: Plan, airframe: Airframe, search: Search | None = None) -> Plan:
    """The plan if each leg keeps the height that a downdraft of one in a hundred takes; otherwise a higher plan.

    Where no higher plan is found, the plan is returned with the reason in its certificate, and is not safe.

    search: plans the same scenario within other limits; None if no other path is wanted.

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
    if no_height_is_enough := _climbs_too_little(plan, airframe):
        return _refused(plan, [no_height_is_enough])
    shortfalls = find_shortfalls(plan, airframe)
    if not shortfalls:
        return plan
    if search is not None and not any(one.at_end for one in shortfalls):
        higher = _higher_plan(plan, airframe, search, shortfalls)
        if higher is not None:
            return higher
    return _refused(plan, [_in_words(one, plan, airframe) for one in shortfalls])


def _refused(plan: Plan, problems: list[str]) -> Plan:
    certificate = plan.certificate
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, *problems)))


def _climbs_too_little(plan: Plan, airframe: Airframe) -> str:
    """Why no height is enough for the downdrafts at the height of a plan, in one line; "" if some is."""
    amsl, turbulence = float(plan.waypoints[:, 2].max()), plan.scenario.wind.turbulence
    climb, least = airframe.limits.surely().rates(amsl)[0], _LEAST_SIGMAS * 0.1 * W20[turbulence]
    if climb >= least:
        return ""
    return (
        f"climbs {climb:.2f} m/s at {amsl:.0f} m at most; with less than {least:.2f} m/s downdrafts of {turbulence}"
        " turbulence may take it down further than any height allows for; less turbulence, a lower mission or an"
        " aircraft that climbs better would help"
    )


def _higher_plan(plan: Plan, airframe: Airframe, search: Search, shortfalls: list[Shortfall]) -> Plan | None:
    """A plan that keeps the height, None if none is found. shortfalls: of the plan."""
    shares = [_UNUSED_SHARE]
    if _is_below_a_limit(plan, limits_in_gusts(plan, airframe).reserve_height):
        shares.append(_UNUSED_SHARE_BELOW_A_LIMIT)
    seen = list(shortfalls)
    for unused, from_threats in product(shares, (False, True)):
        # Most ways lead beside missiles and zones: they count as taller only if a way that was found leads above one.
        if from_threats and not any(one.below for one in seen):
            continue
        within = limits_in_gusts(plan, airframe, unused)
        other = search(replace(within, reserve_threats=within.reserve_height) if from_threats else within)
        if not other.safe:
            continue
        lacking = find_shortfalls(other, airframe)
        if not lacking:
            return other
        seen += lacking
    return None


def _is_below_a_limit(plan: Plan, higher: float) -> bool:
    """Whether a plan that flies this much (m) higher between its ends exceeds a ceiling or a greatest height."""
    scenario, inner = plan.scenario, plan.waypoints[1:-1]
    if not inner.size:
        inner = plan.waypoints
    limits = [np.full(len(inner), scenario.ceiling)]
    if scenario.limits.max_height_m is not None and scenario.terrain is not None:
        limits.append(scenario.terrain.height(inner[:, 0], inner[:, 1]) + scenario.limits.max_height_m)
    return bool((inner[:, 2] + higher > np.minimum.reduce(limits)).any())


def limits_in_gusts(plan: Plan, airframe: Airframe, unused: float = _UNUSED_SHARE) -> Limits:
    """The limits of a search, at the heights of a plan, for paths that keep the height that downdrafts take.

    unused: largest share of the fastest climb that is left unused.
    """
    limits, turbulence = airframe.limits.surely(), plan.scenario.wind.turbulence
    climb, _ = limits.rates(float(plan.waypoints[:, 2].max()))
    reserve = max(0.0, min(_UNUSED_SIGMAS * 0.1 * W20[turbulence], unused * climb))
    height = airframe.autopilot.gust_sink(reserve, turbulence)
    return replace(limits, reserve_height=height, reserve_climb=reserve)


def limits_of_others(plan: Plan, airframe: Airframe) -> Limits:
    """The limits of a search for plans beside a safe one: the tightest of `keep_height` that the safe plan meets."""
    limits = airframe.limits.surely()
    if not airframe.autopilot.gust_sink(0.0, plan.scenario.wind.turbulence):
        return limits
    for unused in (_UNUSED_SHARE, _UNUSED_SHARE_BELOW_A_LIMIT):
        kept = limits_in_gusts(plan, airframe, unused)
        for within in (replace(kept, reserve_threats=kept.reserve_height), kept):
            if certify(make_problem(plan.scenario, within), plan.waypoints).ok:
                return within
    return limits


# --- Shortfalls ---


class _Parts(NamedTuple):
    """A path cut into parts near its ends.

    points: (p, 3) m. legs: (p - 1) the leg of each part.
    before, after: (p,) height that a downdraft may take there on the part that ends, and on the one that begins, m.
    """

    points: Floats
    legs: list[int]
    before: Floats
    after: Floats


def find_shortfalls(plan: Plan, airframe: Airframe) -> list[Shortfall]:
    """What downdrafts may take a plan into: its clearance, a missile and a zone, the deepest of each."""
    limits, turbulence = airframe.limits.surely(), plan.scenario.wind.turbulence
    problem = make_problem(plan.scenario, limits)
    level = [limits.rates(float(plan.waypoints[k, 2]))[0] for k in (0, -1)]
    at_ends = _SHARE_AT_ENDS * np.array([airframe.autopilot.gust_sink(one, turbulence) for one in level])
    parts = _cut(problem, plan.waypoints, _needs(plan, airframe, limits), at_ends)
    found = [_into_clearance(problem, parts), _into_missile(problem, parts), _into_zone(problem, parts)]
    return [one for one in found if one is not None and one.depth > _EPSILON]


def _needs(plan: Plan, airframe: Airframe, limits: Limits) -> Floats:
    """Height (legs,) that downdrafts may take on each leg, m, by the smallest rate of climb that the leg leaves."""
    heights = zip(plan.waypoints[:-1, 2], plan.waypoints[1:, 2], strict=True)
    able = np.array([[limits.rates(float(amsl))[0] for amsl in ends] for ends in heights])
    left = (able - np.maximum(0.0, limits.climb_rates(plan.waypoints))).min(axis=1)
    turbulence = plan.scenario.wind.turbulence
    return np.array([airframe.autopilot.gust_sink(float(one), turbulence) for one in left])


def _cut(problem: Problem, waypoints: Floats, needs: Floats, at_ends: Floats) -> _Parts:
    """A path (w, 3) in parts: legs near an end are cut, but not where a turn leaves them.

    needs: (w - 1,) height that downdrafts may take on each leg, m. at_ends: (2,) height that is kept at the ends, m.
    """
    ends = waypoints[[0, -1]]
    tangents = turn_tangents(problem.certified.aircraft, waypoints) * _LONGER_THAN_TANGENT
    points, legs = [waypoints[0]], list[int]()
    for leg, (a, b) in enumerate(pairwise(waypoints)):
        run = math.dist(a[:2], b[:2])
        count = math.ceil(run / _PART)
        for along in run * np.arange(1, count) / count:
            point = a + (b - a) * along / run
            is_near = min(math.dist(point, end) for end in ends) <= _GROWS_OVER + _PART
            if is_near and tangents[leg] <= along <= run - tangents[leg + 1]:
                points.append(point)
                legs.append(leg)
        points.append(b)
        legs.append(leg)
    path, own = np.array(points), needs[legs]
    away = np.array([np.linalg.norm(path - end, axis=1) for end in ends])
    share, at_end = np.minimum(1.0, away.min(axis=0) / _GROWS_OVER), at_ends[away.argmin(axis=0)]
    before, after = (at_end + share * (need - at_end) for need in ([*own[:1], *own], [*own, *own[-1:]]))
    return _Parts(path, legs, before, after)


def _into_clearance(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far a downdraft may take a path below its clearance, where that is deepest; None if nowhere."""
    data, terrain = problem.certified, problem.scenario.terrain
    if terrain is None:  # pragma: no cover - a problem has one
        return None
    into = f"into the clearance of {data.clearance:g} m"
    for name, k in (("start", 0), ("destination", -1)):
        east, north, up = parts.points[k].tolist()
        depth = float(parts.after[k]) + data.clearance - (up - float(terrain.height(east, north)))
        if depth > _EPSILON:
            return Shortfall(depth, into, f"at its {name}", at_end=name)
    lowest = Shortfall(0.0, into, "")
    for piece in heights_above_ground(data, parts.points):
        k = int(piece["number"])
        # A part needs what it needs at its end nearer to the path's.
        need = max(parts.before[k], parts.after[k]) if piece["of_arc"] else min(parts.after[k], parts.before[k + 1])
        depth = float(need) + data.clearance - float(piece["height"])
        if depth > lowest.depth:
            lowest = Shortfall(depth, into, f"on leg {parts.legs[k]}")
    return lowest


def _into_missile(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far a downdraft may take a path into a missile's sphere, where that is deepest; None if nowhere."""
    threats = problem.scenario.threats
    paths = _lowered(parts) if (threats.kill_radius > 0.0).any() else []
    deepest = min(paths, key=lambda path: kill_distance(problem.certified, path), default=None)
    if deepest is None or (distance := kill_distance(problem.certified, deepest)) >= 0.0:
        return None
    begins, steps = deepest[:-1, None], np.diff(deepest, axis=0)[:, None]
    # Where each leg is nearest to each missile, as a share of the leg.
    along = ((threats.position - begins) * steps).sum(axis=2) / (steps**2).sum(axis=2)
    nearest = begins + np.clip(along, 0.0, 1.0)[..., None] * steps
    outside = np.linalg.norm(nearest - threats.position, axis=2) - threats.kill_radius
    part, missile = np.unravel_index(np.argmin(np.where(threats.kill_radius > 0.0, outside, np.inf)), outside.shape)
    leg = parts.legs[int(part)]
    return Shortfall(-distance, f"into the reach of {threats.names[missile]}", f"on leg {leg}", below=True)


def _into_zone(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far a downdraft may take a path into an exclusion zone, or out of an inclusion zone; None if nowhere."""
    data = problem.certified
    if not is_limited(data.airspace) or not problem.scenario.zones:
        return None
    found = [piece for path in _lowered(parts) for piece in airspace_pieces(data, np.ascontiguousarray(path))]
    worst = min(found, key=lambda piece: float(piece["zones"]["nearest"]))
    if worst["zones"]["nearest"] >= 0.0:
        return None
    number = data.airspace.zones.required[int(worst["zones"]["zone"])]["number"]
    zone = problem.scenario.zones[int(number)]
    into = f"into {zone.name}" if zone.kind == "exclusion" else f"out of {zone.name}"
    where = f"on leg {parts.legs[int(worst['number'])]}"
    return Shortfall(-float(worst["zones"]["nearest"]), into, where, below=True)


def _lowered(parts: _Parts) -> list[Floats]:
    """The path (p, 3) as low as downdrafts may take it, and at steps on the way down, in which nothing is missed."""
    depths = np.maximum(parts.before, parts.after)
    count = max(1, math.ceil(float(depths.max()) / _STEP))
    down = np.array([0.0, 0.0, 1.0]) * depths[:, None]
    return [parts.points - down * k / count for k in range(1, count + 1)]


def _in_words(one: Shortfall, plan: Plan, airframe: Airframe) -> str:
    """One line for a person, with what would help."""
    helps = "less turbulence, an aircraft that climbs better"
    if one.at_end:
        helps += f" or a {one.at_end} that is {math.ceil(one.depth)} m higher"
    elif _is_below_a_limit(plan, limits_in_gusts(plan, airframe).reserve_height):
        helps += " or a higher limit on its height"
    else:
        helps = "less turbulence, or an aircraft that climbs better,"
    gusts = f"in {plan.scenario.wind.turbulence} turbulence downdrafts may take it"
    return f"{gusts} {one.depth:.0f} m {one.into} {one.where}; {helps} would help"
