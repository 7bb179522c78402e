"""Give a plan the altitude margin that it needs in gusts.

Gusts can exceed the climb or sink rate of the aircraft.

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
from flight.autopilots.gust_height import MIN_SPARE_RATE_SIGMAS, gust_deviation
from planfly.workflow.uav import Uav
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

# Climb rate that a higher plan leaves unused for downdrafts, in standard deviations of the vertical gusts.
_UNUSED_SIGMAS = 1.2
# Maximum fraction of the maximum climb rate that is left unused.
_UNUSED_CLIMB_FRACTION = 0.25
# The same fraction if a height limit is above the plan; with more unused climb rate, a downdraft costs less altitude.
_UNUSED_CLIMB_FRACTION_BELOW_A_LIMIT = 0.75
# Sink rate that a lower plan leaves unused for updrafts, in standard deviations of the vertical gusts.
_UNUSED_SINK_SIGMAS = 1.0
# Maximum fraction of the maximum sink rate that is left unused.
_UNUSED_SINK_FRACTION = 0.6
# Margin required at a fixed end of a plan, as a fraction of the margin in level flight: a flight spends only seconds
# there.  A Zagi made 24 flights in moderate turbulence over ground at each of 0, 1,500 and 3,000 m.  With a half, no
# flight came below its clearance; with a quarter, 5 flights did at 3,000 m.
_END_HEIGHT_FRACTION = 0.5
# Distance from an end of the plan beyond which a leg needs its full margin, m; up to there the margin grows linearly.
_FULL_HEIGHT_DISTANCE_M = 1500.0
# Length of the parts of a leg near an end that are judged separately, m.
_PART_LENGTH_M = 250.0
# Step of the displacements for which a path is compared with missiles and zones, m; thicker hazards are not missed.
_HEIGHT_STEP_M = 2.5
# Minimum length of the part of a leg at a turn, as a ratio to the tangent length of the turn.
_TANGENT_RATIO = 1.05
# Tolerance for rounding, m.
_ROUNDING_TOLERANCE_M = 1e-6


class Shortfall(NamedTuple):
    """Missing altitude margin: a hazard into which gusts may move the aircraft.

    gust: "downdrafts" or "updrafts".
    depth: distance by which gusts may move the aircraft into the hazard, m.
    hazard: text that begins with "into", "out of" or "above", and names the clearance, the missile, the zone or the
    height.
    place: text that names the leg or the end of the path.
    end_name: "start" or "destination" if this end itself is too low or too high, so that no other path helps; otherwise
    "".
    is_threat: True for a missile or a zone.
    """

    gust: Gust
    depth: float
    hazard: str
    place: str
    end_name: str = ""
    is_threat: bool = False


def ensure_altitude_margin(plan: Plan, uav: Uav, search: Search | None = None) -> Plan:
    """Return a plan whose legs have an altitude margin for a one-in-a-hundred gust.

    This is the given plan, or another plan that `search` finds.  If no such plan is found, the given plan is returned
    as not safe, with the reason in its certificate.

    search: function that plans the same scenario within other limits; None to search for no other path.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> uav = load_uav(scenario)
    >>> plan = plan_path(scenario, uav.limits, seed=1)
    >>> ensure_altitude_margin(plan, uav) is plan
    True
    """
    if not plan.safe or not _gusts_displace_aircraft(plan, uav):
        return plan
    # An aircraft that climbs too slowly has no margin against downdrafts: further downdrafts arrive before it has
    # climbed back.  Of 24 flights of a Zagi with a climb rate of 0.57 standard deviations of the vertical gusts, 3 lost
    # more than 47 m; of 24 flights with 0.8, none did.
    amsl, turbulence = float(plan.waypoints[:, 2].max()), plan.scenario.wind.turbulence
    climb_rate = uav.limits.with_margin().max_climb_and_sink_rates(amsl)[0]
    min_climb_rate = MIN_SPARE_RATE_SIGMAS * gust_deviation(turbulence)
    if climb_rate < min_climb_rate and uav.autopilot.deviations.gust_sink(climb_rate, turbulence):
        problem_text = (
            f"the aircraft climbs at most {climb_rate:.2f} m/s at an altitude of {amsl:.0f} m. With less than"
            f" {min_climb_rate:.2f} m/s, downdrafts of {turbulence} turbulence may push it down further than any height"
            " margin covers. Less turbulence, a lower mission or an aircraft that climbs better would help"
        )
        return _with_problems(plan, [problem_text])
    shortfalls = find_shortfalls(plan, uav)
    if not shortfalls:
        return plan
    if search is not None and not any(shortfall.end_name for shortfall in shortfalls):
        other_plan = _search_other_plan(plan, uav, search, shortfalls)
        if other_plan is not None:
            return other_plan
    # One line for each shortfall, with its remedies: less turbulence, a better aircraft, and a change of the height
    # that limits the path, if there is one.
    problems = []
    for shortfall in shortfalls:
        is_downdraft, change = shortfall.gust == "downdrafts", ""
        is_below_height_limit = not is_downdraft and not shortfall.is_threat
        if shortfall.end_name:
            direction = "higher" if is_downdraft else "lower"
            change = f" or a {shortfall.end_name} that is {math.ceil(shortfall.depth)} m {direction}"
        elif is_below_height_limit or _exceeds_height_limit(plan, limits_in_gusts(plan, uav).reserve_height):
            change = " or a higher limit on the height"
        ability_text = "climbs better" if is_downdraft else "sinks faster"
        problems.append(
            f"in {turbulence} turbulence, {shortfall.gust} may move the aircraft {shortfall.depth:.0f} m"
            f" {shortfall.hazard} {shortfall.place}. Less turbulence{',' if change else ' or'} an aircraft that"
            f" {ability_text}{change} would help"
        )
    return _with_problems(plan, problems)


def _gusts_displace_aircraft(plan: Plan, uav: Uav) -> bool:
    """Return True if the plan's gusts displace an aircraft that has no climb or sink rate in reserve."""
    return any(
        displacement(0.0, plan.scenario.wind.turbulence)
        for _, displacement in _gust_displacements(plan.scenario, uav.autopilot)
    )


def _gust_displacements(
    scenario: Scenario, autopilot: Autopilot
) -> list[tuple[Gust, Callable[[float, Turbulence], float]]]:
    """Return the kinds of gusts to consider, each with a function.

    The function returns the gust's vertical displacement, m.

    The function's arguments are the climb or sink rate that the aircraft holds in reserve, m/s, and the turbulence.
    Updrafts are considered only if the scenario has zones or a maximum height.
    """
    deviations = autopilot.deviations
    displacements: list[tuple[Gust, Callable[[float, Turbulence], float]]] = [("downdrafts", deviations.gust_sink)]
    # Above a path there are no hazards other than a maximum height or a zone.
    if scenario.zones or scenario.limits.max_height_m is not None:
        displacements.append(("updrafts", deviations.gust_rise))
    return displacements


def _with_problems(plan: Plan, problems: list[str]) -> Plan:
    """Return a plan with problems added to its certificate, which make the plan not safe."""
    certificate = plan.certificate
    return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, *problems)))


def _search_other_plan(plan: Plan, uav: Uav, search: Search, shortfalls: list[Shortfall]) -> Plan | None:
    """Search for a plan without shortfalls, within limits that leave climb and sink rate unused.

    Return None if no such plan is found.

    shortfalls: shortfalls of the given plan.
    """
    fractions = [_UNUSED_CLIMB_FRACTION]
    if _exceeds_height_limit(plan, limits_in_gusts(plan, uav).reserve_height):
        fractions.append(_UNUSED_CLIMB_FRACTION_BELOW_A_LIMIT)
    all_shortfalls = list(shortfalls)
    for unused_fraction, needs_threat_margin in product(fractions, (False, True)):
        # Most paths pass missiles and zones at the side: require a margin above them only if a path led over one.
        if needs_threat_margin and not any(shortfall.is_threat for shortfall in all_shortfalls):
            continue
        search_limits = limits_in_gusts(plan, uav, unused_fraction)
        # Without a maximum height, the limits without a margin at threats only leave sink rate unused.
        has_only_threats = (
            all(shortfall.is_threat for shortfall in shortfalls) and plan.scenario.limits.max_height_m is None
        )
        if not needs_threat_margin and has_only_threats and not search_limits.reserve_height:
            continue
        other_plan = search(_with_margin_at_threats(search_limits) if needs_threat_margin else search_limits)
        if not other_plan.safe:
            continue
        remaining = find_shortfalls(other_plan, uav)
        if not remaining:
            return other_plan
        all_shortfalls += remaining
    return None


def _with_margin_at_threats(limits: Limits) -> Limits:
    """Return limits that require the altitude margin also above and below missiles and zones."""
    return replace(limits, reserve_threats=max(limits.reserve_height, limits.reserve_above))


def _exceeds_height_limit(plan: Plan, height_change: float) -> bool:
    """Return True if a raised plan exceeds the ceiling or the maximum height.

    Return False for a change of 0.

    The ends of the plan are not raised, unless it has no other waypoints.

    height_change: change of altitude, m.
    """
    if not height_change:
        return False
    scenario, inner_points = plan.scenario, plan.waypoints[1:-1]
    if not inner_points.size:
        inner_points = plan.waypoints
    limits = [np.full(len(inner_points), scenario.ceiling)]
    if scenario.limits.max_height_m is not None and scenario.terrain is not None:
        limits.append(scenario.terrain.height(inner_points[:, 0], inner_points[:, 1]) + scenario.limits.max_height_m)
    return bool((inner_points[:, 2] + height_change > np.minimum.reduce(limits)).any())


def limits_in_gusts(plan: Plan, uav: Uav, unused_fraction: float = _UNUSED_CLIMB_FRACTION) -> Limits:
    """Return limits for a search for paths with the margin that gusts require.

    The margin is that at the given plan's altitude.

    unused_fraction: maximum fraction of the maximum climb rate that is left unused for downdrafts.
    """
    limits, autopilot, turbulence = uav.limits.with_margin(), uav.autopilot, plan.scenario.wind.turbulence
    climb, sink = limits.max_climb_and_sink_rates(float(plan.waypoints[:, 2].max()))
    deviation = gust_deviation(turbulence)
    for gust, displacement in _gust_displacements(plan.scenario, autopilot):
        if not displacement(0.0, turbulence):
            continue
        if gust == "downdrafts":
            unused_rate = max(0.0, min(_UNUSED_SIGMAS * deviation, unused_fraction * climb))
            limits = replace(limits, reserve_height=displacement(unused_rate, turbulence), reserve_climb=unused_rate)
        else:
            unused_rate = max(
                MIN_SPARE_RATE_SIGMAS * deviation, min(_UNUSED_SINK_SIGMAS * deviation, _UNUSED_SINK_FRACTION * sink)
            )
            if sink < MIN_SPARE_RATE_SIGMAS * deviation:
                unused_rate = 0.0
            limits = replace(limits, reserve_above=displacement(unused_rate, turbulence), reserve_sink=unused_rate)
    return limits


def limits_for_alternatives(plan: Plan, uav: Uav) -> Limits:
    """Return limits for a search for alternatives to a safe plan.

    They are the strictest limits for gusts that the plan meets.

    The limits with a margin for gusts at the ground, missiles and zones are tried first, then those with a margin at
    the ground only.  If the plan meets none of them, or gusts do not displace the aircraft, the limits have no such
    margin.
    """
    limits = uav.limits.with_margin()
    if not _gusts_displace_aircraft(plan, uav):
        return limits
    for unused_fraction in (_UNUSED_CLIMB_FRACTION, _UNUSED_CLIMB_FRACTION_BELOW_A_LIMIT):
        gust_limits = limits_in_gusts(plan, uav, unused_fraction)
        for candidate in (_with_margin_at_threats(gust_limits), gust_limits):
            if certify(make_problem(plan.scenario, candidate), plan.waypoints).ok:
                return candidate
    return limits


# --- Shortfalls ---


class _Parts(NamedTuple):
    """Path whose legs are cut into short parts near its ends, with the altitude margin that gusts need.

    A point has two margins, because the leg before a waypoint may need more than the leg after it.

    gust: the kind of gusts.
    points: ends of the parts, (p, 3) m.
    legs: leg of each part, (p - 1,).
    margin_before: margin at each point for the part that ends there, (p,) m.
    margin_after: margin at each point for the part that starts there, (p,) m.
    """

    gust: Gust
    points: Floats
    legs: list[int]
    margin_before: Floats
    margin_after: Floats


def find_shortfalls(plan: Plan, uav: Uav) -> list[Shortfall]:
    """Return the shortfall for each kind of gust and hazard.

    It is that at the place where the aircraft gets deepest into the hazard.

    Hazards are the required clearance, the maximum height, missiles and zones.  Only displacements into a hazard are
    returned.
    """
    limits, autopilot, turbulence = uav.limits.with_margin(), uav.autopilot, plan.scenario.wind.turbulence
    problem = make_problem(plan.scenario, limits)
    rates = np.array([limits.max_climb_and_sink_rates(float(amsl)) for amsl in plan.waypoints[:, 2]])
    climbs, shortfalls = limits.leg_climb_rates(plan.waypoints), list[Shortfall | None]()
    for gust, displacement in _gust_displacements(plan.scenario, autopilot):
        if not displacement(0.0, turbulence):
            continue
        is_downdraft = gust == "downdrafts"
        max_rates, used_rates = (
            (rates[:, 0], np.maximum(0.0, climbs)) if is_downdraft else (rates[:, 1], np.maximum(0.0, -climbs))
        )
        # Minimum of the unused rates at the start and at the end of each leg.
        unused_rates = np.minimum(max_rates[:-1] - used_rates[:, 0], max_rates[1:] - used_rates[:, 1])
        # In an updraft ArduPlane and PX4 have their usual altitude error, too; planfly's guidance has none.
        altitude_error = 0.0 if is_downdraft else float(problem.certified.tracking.up)
        margins = np.array([displacement(float(rate), turbulence) + altitude_error for rate in unused_rates])
        end_margins = _END_HEIGHT_FRACTION * np.array(
            [displacement(float(max_rates[end]), turbulence) + altitude_error for end in (0, -1)]
        )
        parts = _cut_into_parts(problem, plan.waypoints, gust, margins, end_margins)
        shortfalls += [
            _clearance_shortfall(problem, parts) if is_downdraft else _max_height_shortfall(problem, parts),
            _missile_shortfall(problem, parts) if is_downdraft else None,
            _zone_shortfall(problem, parts),
        ]
    return [shortfall for shortfall in shortfalls if shortfall is not None and shortfall.depth > _ROUNDING_TOLERANCE_M]


def _cut_into_parts(problem: Problem, waypoints: Floats, gust: Gust, margins: Floats, end_margins: Floats) -> _Parts:
    """Cut the legs near the ends of a path into short parts, each with the margin that it needs.

    Near an end of the path, the margin grows with the distance from the end.  Legs are not cut within turns.

    waypoints: positions, (w, 3), m.
    margins: altitude that gusts may cost or add on each leg, (w - 1,), m.
    end_margins: margin needed at both ends of the path, (2,), m.
    """
    ends = waypoints[[0, -1]]
    tangents = turn_tangents(problem.certified.aircraft, waypoints) * _TANGENT_RATIO
    points, legs = [waypoints[0]], list[int]()
    for leg, (leg_start, leg_end) in enumerate(pairwise(waypoints)):
        length = math.dist(leg_start[:2], leg_end[:2])
        count = math.ceil(length / _PART_LENGTH_M)
        for distance in length * np.arange(1, count) / count:
            point = leg_start + (leg_end - leg_start) * distance / length
            is_near = min(math.dist(point, end) for end in ends) <= _FULL_HEIGHT_DISTANCE_M + _PART_LENGTH_M
            if is_near and tangents[leg] <= distance <= length - tangents[leg + 1]:
                points.append(point)
                legs.append(leg)
        points.append(leg_end)
        legs.append(leg)
    path, part_margins = np.array(points), margins[legs]
    end_distances = np.array([np.linalg.norm(path - end, axis=1) for end in ends])
    fraction = np.minimum(1.0, end_distances.min(axis=0) / _FULL_HEIGHT_DISTANCE_M)
    nearest_end_margin = end_margins[end_distances.argmin(axis=0)]
    margin_before, margin_after = (
        nearest_end_margin + fraction * (margins_of_side - nearest_end_margin)
        for margins_of_side in ([*part_margins[:1], *part_margins], [*part_margins, *part_margins[-1:]])
    )
    return _Parts(gust, path, legs, margin_before, margin_after)


def _heights_at_ends(problem: Problem, parts: _Parts) -> list[tuple[str, float, int]]:
    """Return (name, height above ground, m, index in `parts.points`) for both ends of a path.

    Return [] without terrain.
    """
    terrain = problem.scenario.terrain
    if terrain is None:  # pragma: no cover - a problem always has terrain
        return []
    end_heights = parts.points[:, 2] - terrain.height(parts.points[:, 0], parts.points[:, 1])
    return [("start", float(end_heights[0]), 0), ("destination", float(end_heights[-1]), -1)]


def _clearance_shortfall(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the deepest displacement by a downdraft into the required clearance.

    A shortfall at the start or the destination is returned first, because no other path avoids it.  The depth is 0 m if
    no displacement reaches into the clearance.
    """
    data = problem.certified
    hazard_text = f"into the clearance of {data.clearance:g} m"
    for name, height, index in _heights_at_ends(problem, parts):
        if (depth := float(parts.margin_after[index]) + data.clearance - height) > _ROUNDING_TOLERANCE_M:
            return Shortfall(parts.gust, depth, hazard_text, f"at its {name}", end_name=name)
    deepest_shortfall = Shortfall(parts.gust, 0.0, hazard_text, "")
    for piece in heights_above_ground(data, parts.points):
        index = int(piece["number"])
        # A part needs the smaller margin of its two ends, which is the margin nearer to the end of the path.
        margin = (
            max(parts.margin_before[index], parts.margin_after[index])
            if piece["of_arc"]
            else min(parts.margin_after[index], parts.margin_before[index + 1])
        )
        depth = float(margin) + data.clearance - float(piece["height"])
        if depth > deepest_shortfall.depth:
            deepest_shortfall = Shortfall(parts.gust, depth, hazard_text, f"on leg {parts.legs[index]}")
    return deepest_shortfall


def _max_height_shortfall(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the shortfall at the place where an updraft lifts the aircraft highest above ground.

    A shortfall at the start or the destination is returned first, because no other path avoids it.  The depth is the
    height above the maximum height, negative if the aircraft stays below.  Returns None without a maximum height.
    """
    data, max_height = problem.certified, problem.certified.airspace.max_height
    if max_height == math.inf:
        return None
    hazard_text = f"above the allowed {max_height:.0f} m above ground"
    for name, height, index in _heights_at_ends(problem, parts):
        if (depth := height + float(parts.margin_after[index]) - max_height) > _ROUNDING_TOLERANCE_M:
            return Shortfall(parts.gust, depth, hazard_text, f"at its {name}", end_name=name)
    pieces = airspace_pieces(data, _gust_paths(parts)[-1])
    highest_piece = max(pieces, key=lambda piece: float(piece["height"]))
    place_text = f"on leg {parts.legs[min(int(highest_piece['number']), len(parts.legs) - 1)]}"
    return Shortfall(parts.gust, float(highest_piece["height"]) - max_height, hazard_text, place_text)


def _missile_shortfall(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the deepest displacement by a gust into the sphere of a missile.

    Return None if no gust reaches a sphere.
    """
    threats = problem.scenario.threats
    paths = _gust_paths(parts) if (threats.kill_radius > 0.0).any() else []
    closest_path = min(paths, key=lambda path: kill_distance(problem.certified, path), default=None)
    if closest_path is None or (distance := kill_distance(problem.certified, closest_path)) >= 0.0:
        return None
    leg_starts, steps = closest_path[:-1, None], np.diff(closest_path, axis=0)[:, None]
    # Nearest point of each leg to each missile, as a fraction of the leg.
    fractions = ((threats.position - leg_starts) * steps).sum(axis=2) / (steps**2).sum(axis=2)
    nearest_points = leg_starts + np.clip(fractions, 0.0, 1.0)[..., None] * steps
    distance_outside = np.linalg.norm(nearest_points - threats.position, axis=2) - threats.kill_radius
    part, missile = np.unravel_index(
        np.argmin(np.where(threats.kill_radius > 0.0, distance_outside, np.inf)), distance_outside.shape
    )
    leg = parts.legs[int(part)]
    return Shortfall(
        parts.gust, -distance, f"into the kill zone of {threats.names[missile]}", f"on leg {leg}", is_threat=True
    )


def _zone_shortfall(problem: Problem, parts: _Parts) -> Shortfall | None:
    """Return the deepest displacement by a gust into an exclusion zone or out of an inclusion zone.

    Return None without such a displacement.
    """
    data = problem.certified
    if not is_limited(data.airspace) or not problem.scenario.zones:
        return None
    pieces = [piece for path in _gust_paths(parts) for piece in airspace_pieces(data, path)]
    worst_piece = min(pieces, key=lambda piece: float(piece["zones"]["nearest"]))
    if worst_piece["zones"]["nearest"] >= 0.0:
        return None
    number = data.airspace.zones.required[int(worst_piece["zones"]["zone"])]["number"]
    zone = problem.scenario.zones[int(number)]
    hazard_text = f"into {zone.name}" if zone.kind == "exclusion" else f"out of {zone.name}"
    place_text = f"on leg {parts.legs[min(int(worst_piece['number']), len(parts.legs) - 1)]}"
    return Shortfall(parts.gust, -float(worst_piece["zones"]["nearest"]), hazard_text, place_text, is_threat=True)


def _gust_paths(parts: _Parts) -> list[Floats]:
    """Return copies of a path that are displaced vertically by 1, 2, ... steps, (p, 3), m, each.

    The last copy has the full displacement by the gusts. A step is at most `_HEIGHT_STEP_M` high, so that no hazard is
    missed.
    """
    margins = np.maximum(parts.margin_before, parts.margin_after)
    step_count = max(1, math.ceil(float(margins.max()) / _HEIGHT_STEP_M))
    displacement = np.array([0.0, 0.0, -1.0 if parts.gust == "downdrafts" else 1.0]) * margins[:, None]
    return [np.ascontiguousarray(parts.points + displacement * step / step_count) for step in range(1, step_count + 1)]
