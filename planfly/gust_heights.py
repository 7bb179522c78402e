"""Height that gusts take from or give to an aircraft that climbs or sinks less than they do, and plans that allow it.

In a downdraft planfly's guidance gives up height before it stalls; in an updraft ArduPlane and PX4 rise before they
exceed their airspeed. A plan is safe only if each leg leaves as much height as a gust may take or give there: above its
clearance, below a maximum height above ground, and above or below missiles and zones. Where a plan leaves less, another
is searched for that keeps further away and leaves more climb or sink unused.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, turn_tangents
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.gust_height import LEAST_SIGMAS, gust_deviation
from planfly.airframe import Airframe
from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import airspace_pieces
from planner.evaluation.certify import certify, kill_distance
from planner.evaluation.certify_kernels import heights_above_ground
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Plan
from world.scenario import Scenario
from world.wind import Turbulence

Floats = NDArray[np.float64]
Search = Callable[[Limits], Plan]
Gust = Literal["downdrafts", "updrafts"]

# Rate of climb that a higher plan leaves unused for downdrafts: this many standard deviations of the vertical gusts,
# but at most this share of the fastest climb. Where a height limit lies above the plan, a larger share is tried, too:
# the more climb is left, the less height a downdraft takes.
_UNUSED_SIGMAS, _UNUSED_SHARE, _UNUSED_SHARE_BELOW_A_LIMIT = 1.2, 0.25, 0.75
# The same for the rate of sink that a lower plan leaves unused for updrafts.
_UNUSED_SINK_SIGMAS, _UNUSED_SINK_SHARE = 1.0, 0.6
# At a fixed end a flight spends only seconds: there a plan keeps this share of the height that level flight takes, and
# from there more, until it is the whole of what the leg takes at this distance (m). Of 24 flights each of a Zagi in
# moderate turbulence between ends with a half, none came below its clearance over ground at 0, 1,500 and 3,000 m; with
# a quarter 5 did at 3,000 m.
_SHARE_AT_ENDS, _GROWS_OVER = 0.5, 1500.0
# Length of the parts of a leg near an end that are judged by themselves, m.
_PART = 250.0
# A path is compared with missiles and zones at heights that differ by this, m: none thicker is missed.
_STEP = 2.5
# A part of a leg must be this many times as long as the tangent of a turn that it holds.
_LONGER_THAN_TANGENT = 1.05
# Tolerance for rounding, m.
_EPSILON = 1e-6


class Shortfall(NamedTuple):
    """Something that a gust may take a plan into.

    gust: "downdrafts" or "updrafts".
    depth: m.
    into: "into" a clearance, a missile's reach or a zone, "out of" one, or "above" a height, with its name.
    where: on which leg, or at which end.
    at_end: "start" or "destination" if no other path helps, because of the height of the end itself; otherwise "".
    of_threats: whether it is a missile or a zone.
    """

    gust: Gust
    depth: float
    into: str
    where: str
    at_end: str = ""
    of_threats: bool = False


def keep_height(plan: Plan, airframe: Airframe, search: Search | None = None) -> Plan:
    """The plan if each leg leaves the height that a gust of one in a hundred takes or gives; otherwise another plan.

    Where no other plan is found, the plan is returned with the reason in its certificate, and is not safe.

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
    if not plan.safe or not _is_moved(plan, airframe):
        return plan
    if no_height_is_enough := _climbs_too_little(plan, airframe):
        return _refused(plan, [no_height_is_enough])
    shortfalls = find_shortfalls(plan, airframe)
    if not shortfalls:
        return plan
    if search is not None and not any(one.at_end for one in shortfalls):
        other = _other_plan(plan, airframe, search, shortfalls)
        if other is not None:
            return other
    return _refused(plan, [_in_words(one, plan, airframe) for one in shortfalls])


def _is_moved(plan: Plan, airframe: Airframe) -> bool:
    """Whether gusts may take the aircraft into something by more than its tracking error allows for."""
    return any(moves(0.0, plan.scenario.wind.turbulence) for _, moves in _movements(plan.scenario, airframe.autopilot))


def _movements(scenario: Scenario, autopilot: Autopilot) -> list[tuple[Gust, Callable[[float, Turbulence], float]]]:
    """Kinds of gusts that may take an autopilot into something, and how far (m) by the climb or sink left (m/s)."""
    found: list[tuple[Gust, Callable[[float, Turbulence], float]]] = [("downdrafts", autopilot.gust_sink)]
    # Above a path is nothing to come into but a maximum height or a zone.
    if scenario.zones or scenario.limits.max_height_m is not None:
        found.append(("updrafts", autopilot.gust_rise))
    return found


def _refused(plan: Plan, problems: list[str]) -> Plan:
    certificate = plan.certificate
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, *problems)))


def _climbs_too_little(plan: Plan, airframe: Airframe) -> str:
    """Why no height is enough for the downdrafts at the height of a plan, in one line; "" if some is.

    With a climb of less than `LEAST_SIGMAS`, several downdrafts take an aircraft down before it has climbed back. Of 24
    flights of a Zagi that climbs 0.57 standard deviations 3 came down by more than 47 m, of 24 with 0.8 none did.
    """
    amsl, turbulence = float(plan.waypoints[:, 2].max()), plan.scenario.wind.turbulence
    climb, least = airframe.limits.surely().rates(amsl)[0], LEAST_SIGMAS * gust_deviation(turbulence)
    if climb >= least or not airframe.autopilot.gust_sink(climb, turbulence):
        return ""
    return (
        f"climbs {climb:.2f} m/s at {amsl:.0f} m at most; with less than {least:.2f} m/s downdrafts of {turbulence}"
        " turbulence may take it down further than any height allows for; less turbulence, a lower mission or an"
        " aircraft that climbs better would help"
    )


def _other_plan(plan: Plan, airframe: Airframe, search: Search, shortfalls: list[Shortfall]) -> Plan | None:
    """A plan that leaves the height that gusts need, None if none is found. shortfalls: of the plan."""
    shares = [_UNUSED_SHARE]
    if _is_below_a_limit(plan, limits_in_gusts(plan, airframe).reserve_height):
        shares.append(_UNUSED_SHARE_BELOW_A_LIMIT)
    seen = list(shortfalls)
    for unused, from_threats in product(shares, (False, True)):
        # Most ways lead beside missiles and zones: more is kept from them only if a way that was found leads above one.
        if from_threats and not any(one.of_threats for one in seen):
            continue
        within = limits_in_gusts(plan, airframe, unused)
        # Without a maximum height the first of the two keeps nothing for updrafts but sink.
        from_zones_alone = all(one.of_threats for one in shortfalls) and plan.scenario.limits.max_height_m is None
        if not from_threats and from_zones_alone and not within.reserve_height:
            continue
        other = search(_from_threats(within) if from_threats else within)
        if not other.safe:
            continue
        lacking = find_shortfalls(other, airframe)
        if not lacking:
            return other
        seen += lacking
    return None


def _from_threats(kept: Limits) -> Limits:
    """Limits that keep from missiles and zones what they keep from the ground or from the maximum height."""
    return replace(kept, reserve_threats=max(kept.reserve_height, kept.reserve_above))


def _is_below_a_limit(plan: Plan, higher: float) -> bool:
    """Whether a plan that flies this much (m) higher between its ends exceeds a ceiling or a greatest height."""
    if not higher:
        return False
    scenario, inner = plan.scenario, plan.waypoints[1:-1]
    if not inner.size:
        inner = plan.waypoints
    limits = [np.full(len(inner), scenario.ceiling)]
    if scenario.limits.max_height_m is not None and scenario.terrain is not None:
        limits.append(scenario.terrain.height(inner[:, 0], inner[:, 1]) + scenario.limits.max_height_m)
    return bool((inner[:, 2] + higher > np.minimum.reduce(limits)).any())


def limits_in_gusts(plan: Plan, airframe: Airframe, unused: float = _UNUSED_SHARE) -> Limits:
    """The limits of a search, at the heights of a plan, for paths that leave the height that gusts need.

    unused: largest share of the fastest climb that is left unused for downdrafts.
    """
    limits, autopilot, turbulence = airframe.limits.surely(), airframe.autopilot, plan.scenario.wind.turbulence
    climb, sink = limits.rates(float(plan.waypoints[:, 2].max()))
    deviation = gust_deviation(turbulence)
    for gust, moves in _movements(plan.scenario, autopilot):
        if not moves(0.0, turbulence):
            continue
        if gust == "downdrafts":
            left = max(0.0, min(_UNUSED_SIGMAS * deviation, unused * climb))
            limits = replace(limits, reserve_height=moves(left, turbulence), reserve_climb=left)
        else:
            left = max(LEAST_SIGMAS * deviation, min(_UNUSED_SINK_SIGMAS * deviation, _UNUSED_SINK_SHARE * sink))
            if sink < LEAST_SIGMAS * deviation:
                left = 0.0
            limits = replace(limits, reserve_above=moves(left, turbulence), reserve_sink=left)
    return limits


def limits_of_others(plan: Plan, airframe: Airframe) -> Limits:
    """The limits of a search for plans beside a safe one: the tightest of `keep_height` that the safe plan meets."""
    limits = airframe.limits.surely()
    if not _is_moved(plan, airframe):
        return limits
    for unused in (_UNUSED_SHARE, _UNUSED_SHARE_BELOW_A_LIMIT):
        kept = limits_in_gusts(plan, airframe, unused)
        for within in (_from_threats(kept), kept):
            if certify(make_problem(plan.scenario, within), plan.waypoints).ok:
                return within
    return limits


# --- Shortfalls ---


class _Parts(NamedTuple):
    """A path cut into parts near its ends.

    gust: which kind of gusts is looked at.
    points: (p, 3) m. legs: (p - 1) the leg of each part.
    before, after: (p,) height that a gust may take or give there on the part that ends, and on the one that begins, m.
    """

    gust: Gust
    points: Floats
    legs: list[int]
    before: Floats
    after: Floats


def find_shortfalls(plan: Plan, airframe: Airframe) -> list[Shortfall]:
    """What gusts may take a plan into: its clearance or maximum height, a missile and a zone, the deepest of each."""
    limits, autopilot, turbulence = airframe.limits.surely(), airframe.autopilot, plan.scenario.wind.turbulence
    problem = make_problem(plan.scenario, limits)
    rates = np.array([limits.rates(float(amsl)) for amsl in plan.waypoints[:, 2]])
    climbs, found = limits.climb_rates(plan.waypoints), list[Shortfall | None]()
    for gust, moves in _movements(plan.scenario, autopilot):
        if not moves(0.0, turbulence):
            continue
        down = gust == "downdrafts"
        able, used = (rates[:, 0], np.maximum(0.0, climbs)) if down else (rates[:, 1], np.maximum(0.0, -climbs))
        # The least that a leg leaves, at its beginning or at its end.
        left = np.minimum(able[:-1] - used[:, 0], able[1:] - used[:, 1])
        # ArduPlane and PX4 stray in height even without such a gust; planfly's guidance does not.
        strays = 0.0 if down else float(problem.certified.tracking.up)
        needs = np.array([moves(float(one), turbulence) + strays for one in left])
        at_ends = _SHARE_AT_ENDS * np.array([moves(float(able[k]), turbulence) + strays for k in (0, -1)])
        parts = _cut(problem, plan.waypoints, gust, needs, at_ends)
        found += [
            _into_clearance(problem, parts) if down else _above_maximum(problem, parts),
            _into_missile(problem, parts) if down else None,
            _into_zone(problem, parts),
        ]
    return [one for one in found if one is not None and one.depth > _EPSILON]


def _cut(problem: Problem, waypoints: Floats, gust: Gust, needs: Floats, at_ends: Floats) -> _Parts:
    """A path (w, 3) in parts: legs near an end are cut, but not where a turn leaves them.

    needs: (w - 1,) height that gusts may take or give on each leg, m. at_ends: (2,) what counts of it at the ends, m.
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
    return _Parts(gust, path, legs, before, after)


def _at_ends(problem: Problem, parts: _Parts) -> list[tuple[str, float, int]]:
    """Name, height above ground (m) and index of the points at both ends."""
    terrain = problem.scenario.terrain
    if terrain is None:  # pragma: no cover - a problem has one
        return []
    over = parts.points[:, 2] - terrain.height(parts.points[:, 0], parts.points[:, 1])
    return [("start", float(over[0]), 0), ("destination", float(over[-1]), -1)]


def _into_clearance(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far a downdraft may take a path below its clearance, where that is deepest; None if nowhere."""
    data = problem.certified
    into = f"into the clearance of {data.clearance:g} m"
    for name, over, k in _at_ends(problem, parts):
        if (depth := float(parts.after[k]) + data.clearance - over) > _EPSILON:
            return Shortfall(parts.gust, depth, into, f"at its {name}", at_end=name)
    lowest = Shortfall(parts.gust, 0.0, into, "")
    for piece in heights_above_ground(data, parts.points):
        k = int(piece["number"])
        # A part needs what it needs at its end nearer to the path's.
        need = max(parts.before[k], parts.after[k]) if piece["of_arc"] else min(parts.after[k], parts.before[k + 1])
        depth = float(need) + data.clearance - float(piece["height"])
        if depth > lowest.depth:
            lowest = Shortfall(parts.gust, depth, into, f"on leg {parts.legs[k]}")
    return lowest


def _above_maximum(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far an updraft may take a path above its maximum height above ground; None if nowhere or without one."""
    data, most = problem.certified, problem.certified.airspace.max_height
    if most == math.inf:
        return None
    above = f"above the {most:.0f} m over ground that are allowed"
    for name, over, k in _at_ends(problem, parts):
        if (depth := over + float(parts.after[k]) - most) > _EPSILON:
            return Shortfall(parts.gust, depth, above, f"at its {name}", at_end=name)
    pieces = airspace_pieces(data, _moved(parts)[-1])
    highest = max(pieces, key=lambda piece: float(piece["height"]))
    where = f"on leg {parts.legs[min(int(highest['number']), len(parts.legs) - 1)]}"
    return Shortfall(parts.gust, float(highest["height"]) - most, above, where)


def _into_missile(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far a gust may take a path into a missile's sphere, where that is deepest; None if nowhere."""
    threats = problem.scenario.threats
    paths = _moved(parts) if (threats.kill_radius > 0.0).any() else []
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
    return Shortfall(
        parts.gust, -distance, f"into the reach of {threats.names[missile]}", f"on leg {leg}", of_threats=True
    )


def _into_zone(problem: Problem, parts: _Parts) -> Shortfall | None:
    """How far a gust may take a path into an exclusion zone, or out of an inclusion zone; None if nowhere."""
    data = problem.certified
    if not is_limited(data.airspace) or not problem.scenario.zones:
        return None
    found = [piece for path in _moved(parts) for piece in airspace_pieces(data, path)]
    worst = min(found, key=lambda piece: float(piece["zones"]["nearest"]))
    if worst["zones"]["nearest"] >= 0.0:
        return None
    number = data.airspace.zones.required[int(worst["zones"]["zone"])]["number"]
    zone = problem.scenario.zones[int(number)]
    into = f"into {zone.name}" if zone.kind == "exclusion" else f"out of {zone.name}"
    where = f"on leg {parts.legs[min(int(worst['number']), len(parts.legs) - 1)]}"
    return Shortfall(parts.gust, -float(worst["zones"]["nearest"]), into, where, of_threats=True)


def _moved(parts: _Parts) -> list[Floats]:
    """The path (p, 3) as gusts move it, at steps on the way in which nothing is missed; the last is the whole way."""
    heights = np.maximum(parts.before, parts.after)
    count = max(1, math.ceil(float(heights.max()) / _STEP))
    whole = np.array([0.0, 0.0, -1.0 if parts.gust == "downdrafts" else 1.0]) * heights[:, None]
    return [np.ascontiguousarray(parts.points + whole * k / count) for k in range(1, count + 1)]


def _in_words(one: Shortfall, plan: Plan, airframe: Airframe) -> str:
    """One line for a person, with what would help."""
    better = "climbs better" if one.gust == "downdrafts" else "sinks faster"
    helps = f"less turbulence, an aircraft that {better}"
    is_held_down = one.gust == "updrafts" and not one.of_threats
    if one.at_end:
        lies = "higher" if one.gust == "downdrafts" else "lower"
        helps += f" or a {one.at_end} that is {math.ceil(one.depth)} m {lies}"
    elif is_held_down or _is_below_a_limit(plan, limits_in_gusts(plan, airframe).reserve_height):
        helps += " or a higher limit on its height"
    else:
        helps = f"less turbulence, or an aircraft that {better},"
    gusts = f"in {plan.scenario.wind.turbulence} turbulence {one.gust} may take it"
    return f"{gusts} {one.depth:.0f} m {one.into} {one.where}; {helps} would help"
