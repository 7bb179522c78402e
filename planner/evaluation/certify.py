"""Certify a finished path by checking every constraint continuously along legs and turns.

The scores of a search sample the path. A certificate measures the path exactly: turns, lengths of legs against the
lengths of their turns, slopes of legs and arcs, clearance above the bilinear terrain, map bounds, missile spheres,
zones and the maximum height above ground. With an autopilot's tracking error, distances are those of the flight, not of
the legs. Compiled measurements are in `planner.evaluation.certify_kernels`.
"""

import math

import numpy as np

from aircraft.path_limits import arc_slope, turn_tangents
from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import airspace_pieces
from planner.evaluation.certify_kernels import (
    heights_above_ground,
    leg_slope_limits,
    missile_distance,
    turn_and_roll_lengths,
    with_courses,
)
from planner.evaluation.corners import fly_by_radii, settling_length
from planner.evaluation.leg_constraints import CERTIFIED_LEG, slope_limits
from planner.evaluation.problem import ANGLE_MARGIN, Problem, ProblemArrays
from planner.plan import Certificate
from world.arrays import Floats
from world.geometry import leg_runs, leg_slopes, turning_angles

# Tolerance for rounding of a waypoint on a limit, rad and m.
_EPSILON = 1e-9


def certify(problem: Problem, waypoints: Floats) -> Certificate:
    """Compute the certificate of a path (w, 3) against the margins of `Problem.certified`.

    Clearance is exact for the bilinear terrain, along the legs and along the chords of the fly-by arcs. Distances to
    missile spheres and zones, and the headroom below the maximum height above ground, are measured on the same pieces.
    """
    data = problem.certified
    # A copy: compiled code has one type for arrays that are locked, as a plan's, and one for others.
    waypoints = np.array(waypoints, dtype=np.float64)
    problems: list[str] = []
    turn = _turn_margin(data, waypoints, problems)
    available_length = _leg_length_margin(data, waypoints, problems)
    slope = float(min(_arc_slope_margin(data, waypoints, problems), _leg_slope_margin(data, waypoints, problems)))
    clearance = _clearance_margin(data, waypoints, problems)
    bounds = _bounds_margin(data, waypoints, problems)
    distance = kill_distance(data, waypoints)
    zones, headroom = _airspace_margins(problem, waypoints, problems)
    return Certificate(turn, available_length, slope, clearance, bounds, distance, tuple(problems), zones, headroom)


def kill_distance(data: ProblemArrays, waypoints: Floats) -> float:
    """Return the distance from the path to the nearest missile sphere, m; negative inside, or inf without missiles."""
    return float(missile_distance(data, np.array(waypoints, dtype=np.float64)))


# How far inside its limit (negative: beyond), where, and what is wrong.
_Fault = tuple[float, str, str]
# Number of places that are named in addition to the worst.
_NAMED = 6


def _worst_and_others(found: list[_Fault]) -> list[str]:
    """Return a list with one line on the faults of one kind, the worst and its other places, or an empty list."""
    if not found:
        return []
    (_, where, what), *others = sorted(found, key=lambda one: one[0])
    named = ", ".join(name for _, name, _ in others[:_NAMED])
    more = f", {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    return [f"{where}: {what}" + (f" (also {named}{more})" if others else "")]


def _turn_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest margin of a turn to its limit, rad, and append turns that are too sharp to `problems`."""
    allowed = data.max_turn if data.legs_hold_turns else data.max_turn + ANGLE_MARGIN
    wanted = 0.0 if data.legs_hold_turns else ANGLE_MARGIN
    margins = allowed - turning_angles(with_courses(data, waypoints))
    largest = math.degrees(allowed - wanted)
    problems += _worst_and_others(
        [
            (margin, f"waypoint {i}", f"turns {math.degrees(allowed - margin):.1f} deg, allowed {largest:.1f} deg")
            for i, margin in enumerate(margins.tolist())
            if margin < wanted - _EPSILON
        ]
    )
    return float(margins.min(initial=math.inf))


def _leg_length_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest length of a leg that remains between its turns, m, and append too short legs to `problems`.

    Return inf if legs need not be as long as their turns.
    """
    problems += _worst_and_others(
        [
            (run, f"leg {i}", f"{run:.1f} m long, at least {CERTIFIED_LEG:g} m are required")
            for i, run in enumerate(leg_runs(waypoints).tolist())
            if run < CERTIFIED_LEG
        ]
    )
    smallest = math.inf
    found: list[_Fault] = []
    if not data.legs_hold_turns:
        return smallest
    lengths = turn_and_roll_lengths(data, waypoints)
    for i, (run, need, roll) in enumerate(zip(leg_runs(waypoints), *lengths, strict=True)):
        if need == 0.0:
            continue
        smallest = min(smallest, float(run - need - roll))
        settle = settling_length(float(need), float(run)) + roll
        if need + settle > run + _EPSILON:
            what = f"{run:.0f} m long, its turns need {need:.0f} m and {settle:.0f} m to settle"
            found.append((float(run - need) - settle, f"leg {i}", what))
    problems += _worst_and_others(found)
    return smallest


def _arc_slope_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest slope margin on the turn arcs, rad, and append arcs that are too steep to `problems`.

    An arc is shorter than the two pieces of leg that it replaces, so the same height change makes it steeper. Return
    inf if the arcs need no check.
    """
    smallest = math.inf
    limits_are_fixed = not (math.isnan(data.max_climb) or math.isnan(data.max_dive))
    if not data.legs_hold_turns or data.fly_over or limits_are_fixed:
        return smallest
    radii, tangents = fly_by_radii(data, waypoints), turn_tangents(data.aircraft, waypoints)
    rises = np.tan(leg_slopes(waypoints))
    found: list[_Fault] = []
    for i in range(1, len(waypoints) - 1):
        if tangents[i] <= 0.0 or radii[i] <= 0.0:
            continue
        slope = math.atan(arc_slope(rises[i - 1], rises[i], tangents[i], radii[i]))
        flat = np.array([0.0, 0.0, waypoints[i, 2]])
        for before, after in ((i - 1, i), (i, i + 1)):
            step = np.append((waypoints[after] - waypoints[before])[:2], waypoints[i, 2])
            climb, dive = slope_limits(data, flat, step)
            inside = min(climb - slope, dive + slope)
            smallest = min(smallest, inside + data.angle_margin)
            if inside < -_EPSILON:
                found.append((inside, f"turn at waypoint {i}", _slope_fault_text(slope, climb, dive, " along its arc")))
                break
    problems += _worst_and_others(found)
    return smallest


def _leg_slope_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest slope margin of the legs, rad, and append legs that are too steep to `problems`."""
    smallest = math.inf
    limits = leg_slope_limits(data, waypoints)
    found: list[_Fault] = []
    for i, (slope, climb, dive) in enumerate(zip(leg_slopes(waypoints), *limits, strict=True)):
        inside = min(climb - slope, dive + slope)
        smallest = min(smallest, inside + data.angle_margin)
        if inside < -_EPSILON:
            found.append((inside, f"leg {i}", _slope_fault_text(slope, climb, dive)))
    problems += _worst_and_others(found)
    return smallest


def _slope_fault_text(slope: float, climb: float, dive: float, where: str = "") -> str:
    verb, limit = ("climbs", climb) if slope > 0 else ("sinks", dive)
    return f"{verb} {math.degrees(abs(slope)):.1f} deg{where}, allowed {math.degrees(limit):.1f} deg"


def _clearance_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest height above the required clearance, m, and append violations to `problems`.

    Return NaN if the path leaves the terrain.
    """
    smallest = math.inf
    low: dict[str, float] = {}
    for piece in heights_above_ground(data, waypoints):
        margin = float(piece["height"]) - data.clearance
        smallest = math.nan if math.isnan(margin) or math.isnan(smallest) else min(smallest, margin)
        if margin >= float(piece["buffer"]) - _EPSILON:
            continue
        name = f"turn at waypoint {piece['number']}" if piece["of_arc"] else f"leg {piece['number']}"
        if math.isnan(margin) or not low.get(name, math.inf) <= margin:
            low[name] = margin
    wanted = f"{data.clearance:g} m and {data.buffer:.1f} m in reserve required"
    off = [(0.0, name, "leaves the terrain that is known") for name, margin in low.items() if math.isnan(margin)]
    over = [
        (margin, name, f"{margin + data.clearance:.1f} m above ground at its lowest, {wanted}")
        for name, margin in low.items()
        if not math.isnan(margin)
    ]
    problems += [*_worst_and_others(off), *_worst_and_others(over)]
    return smallest


def _bounds_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest distance of a waypoint from the edge of the map, the floor or the ceiling, m.

    Append violations to `problems`.
    """
    low = np.array([data.west, data.south, data.floor])
    high = np.array([data.east, data.north, data.ceiling])
    margins = np.minimum(waypoints - low, high - waypoints).min(axis=1)
    problems += _worst_and_others(
        [
            (float(margins[i]), f"waypoint {i}", f"{-margins[i]:.1f} m outside the area, floor or ceiling")
            for i in np.nonzero(margins < -_EPSILON)[0]
        ]
    )
    return float(margins.min())


def _airspace_margins(problem: Problem, waypoints: Floats, problems: list[str]) -> tuple[float, float]:
    """Return the smallest distance to a zone and the smallest headroom below the maximum height, m; inf without limits.

    Append violations to `problems`.
    """
    data, space = problem.certified, problem.certified.airspace
    if not is_limited(space):
        return math.inf, math.inf
    pieces = airspace_pieces(data, np.ascontiguousarray(waypoints))
    headroom = float((space.max_height - pieces["height"]).min())
    near: dict[str, tuple[float, int]] = {}
    high: dict[str, float] = {}
    for piece in pieces:
        name = f"turn at waypoint {piece['number']}" if piece["of_corner"] else f"leg {piece['number']}"
        zone_margin, left = piece["zones"], float(space.max_height - piece["height"])
        if not zone_margin["satisfied"]:
            near[name] = min(near.get(name, (math.inf, 0)), (float(zone_margin["nearest"]), int(zone_margin["zone"])))
        # NaN off the terrain is reported by the clearance.
        if left < float(piece["buffer"]) - _EPSILON:
            high[name] = min(high.get(name, math.inf), left)
    for zone in dict.fromkeys(z for _, z in near.values()):
        problems += _worst_and_others(
            [
                (distance, name, _zone_fault_text(problem, distance, z))
                for name, (distance, z) in near.items()
                if z == zone
            ]
        )
    wanted = f"{space.max_height:g} m allowed, {space.buffer:.1f} m in reserve required"
    problems += _worst_and_others(
        [
            (left, name, f"{space.max_height - left:.1f} m above ground at its highest, {wanted}")
            for name, left in high.items()
        ]
    )
    return float(pieces["zones"]["nearest"].min()), headroom


def _zone_fault_text(problem: Problem, distance: float, z: int) -> str:
    """Return the message for a piece at this distance (m) from zone z, in the kernels' numbering."""
    required = problem.certified.airspace.zones.required[z]
    zone = problem.scenario.zones[int(required["number"])]
    if distance < 0.0:
        return f"{-distance:.1f} m {'inside' if zone.kind == 'exclusion' else 'outside'} {zone.name}"
    where = "from" if zone.kind == "exclusion" else "inside the edge of"
    wanted = f"{required['horizontal']:g} m or {required['vertical']:g} m in height required"
    return f"{distance:.1f} m {where} {zone.name}, {wanted}"
