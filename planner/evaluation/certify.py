"""Certify a finished path by checking every constraint continuously along legs and turns.

The scores of a search sample the path. A certificate measures the path exactly: turns, lengths of legs against the
lengths of their turns, slopes of legs and arcs, clearance above the bilinear terrain, map bounds, missile spheres,
zones and the maximum height above ground. With an autopilot's tracking error, distances are those of the flight, not of
the legs. Compiled measurements are in `planner.evaluation.certify_kernels`.
"""

import math
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import arc_slope, turn_tangents
from aircraft.tracking import zero_tracking_error
from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import airspace_pieces
from planner.evaluation.certify_kernels import (
    add_end_course_points,
    corner_excursions,
    heights_above_ground,
    leg_slope_limits,
    missile_distance,
    turn_and_roll_lengths,
)
from planner.evaluation.corners import fly_by_radii, settling_length
from planner.evaluation.leg_constraints import MIN_CERTIFIED_LEG_M, slope_limits
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN_M, Problem, ProblemArrays
from planner.plan import Certificate, path_digest
from world.arrays import Floats
from world.geometry import leg_runs, leg_slopes, turning_angles

# Tolerance for rounding of a waypoint on a limit, rad and m.
_EPSILON = 1e-9


def certify(problem: Problem, waypoints: Floats) -> Certificate:
    """Compute the certificate of a path (w, 3) with the margins of `Problem.certified`.

    The clearance is measured along the legs and along the chords of the fly-by arcs; it is exact for bilinearly
    interpolated terrain. The distances to missile spheres and zones, and the headroom below the maximum height, are
    measured along the same lines.
    """
    data = problem.certified
    # Copy the array: a plan's waypoints are read-only, for which the kernels would be compiled again.
    waypoints = np.array(waypoints, dtype=np.float64)
    problems: list[str] = []
    turns = turning_angles(add_end_course_points(data, waypoints))
    problems += _summarise_faults(
        [
            (
                data.max_turn - turn,
                f"waypoint {i}",
                f"turns {math.degrees(turn):.1f}°; at most {math.degrees(data.max_turn):.1f}° are allowed",
            )
            for i, turn in enumerate(turns.tolist())
            if data.max_turn - turn < -_EPSILON
        ]
    )
    available_length = _leg_length_margin(data, waypoints, problems)
    slope = _arc_slope_margin(data, waypoints, problems)
    faults: list[_Fault] = []
    limits = leg_slope_limits(data, waypoints)
    for i, (leg_slope, climb, dive) in enumerate(zip(leg_slopes(waypoints), *limits, strict=True)):
        margin = min(climb - leg_slope, dive + leg_slope)
        slope = min(slope, margin)
        if margin < -_EPSILON:
            faults.append((margin, f"leg {i}", _slope_fault_text(data, leg_slope, climb, dive)))
    problems += _summarise_faults(faults)
    clearance = _clearance_margin(data, waypoints, problems)
    # Distances of the waypoints from the edges of the map, the floor and the ceiling. The distance from an edge of the
    # map is reduced by the autopilot's excursion at the corner.
    min_corner = np.array([data.west, data.south, data.floor])
    max_corner = np.array([data.east, data.north, data.ceiling])
    distances = np.minimum(waypoints - min_corner, max_corner - waypoints)
    if data.tracking.has_error:
        distances[:, :2] -= corner_excursions(data, waypoints)[:, None]
    bounds = distances.min(axis=1)
    problems += _summarise_faults(
        [
            (
                float(bounds[i]),
                f"waypoint {i}",
                f"{-bounds[i]:.1f} m beyond the edge of the area, the floor or the ceiling",
            )
            for i in np.nonzero(bounds < -_EPSILON)[0]
        ]
    )
    distance = kill_distance(data, waypoints)
    zones, headroom = _airspace_margins(problem, waypoints, problems)
    return Certificate(
        _without_rounding(float((data.max_turn - turns).min(initial=math.inf))),
        available_length,
        _without_rounding(float(slope)),
        clearance,
        _without_rounding(float(bounds.min())),
        distance,
        tuple(problems),
        zones,
        headroom,
        path_digest(waypoints),
    )


def kill_distance(data: ProblemArrays, waypoints: Floats) -> float:
    """Return the distance from a path (w, 3) to the nearest missile sphere, m.

    The distance is negative inside a sphere, and inf without missiles.
    """
    return float(missile_distance(data, np.array(waypoints, dtype=np.float64)))


def required_kill_distance(problem: Problem) -> float:
    """Return the distance from missile spheres that a path must keep, m.

    It is the margin of the certificate. If an end of the path is closer to a sphere, it is slightly less than the
    distance of that end, because no path is further away than its ends.
    """
    # A path is never further from missile spheres than its own ends.
    ends = (problem.scenario.start, problem.scenario.destination)
    return min(
        CERTIFIED_KILL_MARGIN_M, *(kill_distance(problem.certified, np.stack([end, end])) - 1e-6 for end in ends)
    )


def least_height(data: ProblemArrays, waypoints: Floats) -> float:
    """Return the least height above ground of a path's legs and fly-by arcs, m; NaN off the terrain.

    waypoints: (w, 3) m.

    The tracking error of the autopilot is ignored.
    """
    exact_data = data._replace(tracking=zero_tracking_error())
    return float(heights_above_ground(exact_data, np.array(waypoints, dtype=np.float64))["height"].min())


# A fault: its margin to the limit (negative beyond it), its place and its description.
_Fault = tuple[float, str, str]
# Number of places that are named in addition to the worst.
_MAX_NAMED_PLACES = 6


def _summarise_faults(faults: list[_Fault]) -> list[str]:
    """Describe all faults of one kind in one line; return [the line], or [] without faults.

    faults: margin, place and description of each fault.

    The line describes the worst fault, and names the places of the others.
    """
    if not faults:
        return []
    (_, place, problem), *others = sorted(faults, key=lambda fault: fault[0])
    other_places = ", ".join(name for _, name, _ in others[:_MAX_NAMED_PLACES])
    remainder = f" and {len(others) - _MAX_NAMED_PLACES} more" if len(others) > _MAX_NAMED_PLACES else ""
    return [f"{place}: {problem}" + (f" (also {other_places}{remainder})" if others else "")]


def _without_rounding(margin: float) -> float:
    """Return 0 for a margin that is negative only because of rounding; return any other margin unchanged.

    A margin below 0 therefore always means a problem.
    """
    return 0.0 if -_EPSILON <= margin < 0.0 else margin


def _leg_length_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest spare length of a leg, m; append legs that are too short to `problems`.

    Every leg needs a minimum length. If legs have to contain their turns, a leg with turns also needs the lengths of
    its turns, of settling between them, and of rolling from one bank to the other.
    """
    runs = leg_runs(waypoints)
    problems += _summarise_faults(
        [
            (length, f"leg {i}", f"{length:.1f} m long; at least {MIN_CERTIFIED_LEG_M:g} m are required")
            for i, length in enumerate(runs.tolist())
            if length < MIN_CERTIFIED_LEG_M
        ]
    )
    min_margin = float(runs.min()) - MIN_CERTIFIED_LEG_M
    if not data.legs_hold_turns:
        return min_margin
    faults: list[_Fault] = []
    lengths = turn_and_roll_lengths(data, waypoints)
    for i, (length, turns_length, roll_length) in enumerate(zip(runs.tolist(), *lengths, strict=True)):
        if turns_length == 0.0:
            continue
        settling_and_roll = settling_length(float(turns_length), length) + float(roll_length)
        margin = length - float(turns_length) - settling_and_roll
        min_margin = min(min_margin, margin)
        if margin < -_EPSILON:
            description = (
                f"{length:.0f} m long, but its turns need {turns_length:.0f} m and settling after them"
                f" {settling_and_roll:.0f} m more, both with the plan's margin for the autopilot's turns"
            )
            faults.append((margin, f"leg {i}", description))
    problems += _summarise_faults(faults)
    return _without_rounding(min_margin)


def _arc_slope_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest slope margin on turn arcs, rad; append arcs that are too steep to `problems`.

    An arc is shorter than the parts of the legs that it replaces, so the same change of height makes it steeper. Arcs
    are only checked if the aircraft limits the slopes, legs have to contain their turns, and waypoints are fly-by;
    otherwise the margin is inf.
    """
    min_margin = math.inf
    limits_are_fixed = not (math.isnan(data.max_climb) or math.isnan(data.max_dive))
    if not data.legs_hold_turns or data.fly_over or limits_are_fixed:
        return min_margin
    radii, tangents = fly_by_radii(data, waypoints), turn_tangents(data.aircraft, waypoints)
    leg_tangents = np.tan(leg_slopes(waypoints))
    faults: list[_Fault] = []
    for i in range(1, len(waypoints) - 1):
        if tangents[i] <= 0.0 or radii[i] <= 0.0:
            continue
        slope = math.atan(arc_slope(leg_tangents[i - 1], leg_tangents[i], tangents[i], radii[i]))
        level_start = np.array([0.0, 0.0, waypoints[i, 2]])
        level_ends = [
            np.append((waypoints[k + 1] - waypoints[k])[:2], waypoints[i, 2])
            for k in (i - 1, i)  # the courses before and after the turn
        ]
        climbs, dives = zip(*(slope_limits(data, level_start, end) for end in level_ends), strict=True)
        climb, dive = min(climbs), min(dives)
        margin = min(climb - slope, dive + slope)
        min_margin = min(min_margin, margin)
        if margin < -_EPSILON:
            faults.append(
                (margin, f"turn at waypoint {i}", _slope_fault_text(data, slope, climb, dive, " along its arc"))
            )
    problems += _summarise_faults(faults)
    return min_margin


def _slope_fault_text(data: ProblemArrays, slope: float, climb: float, dive: float, place_text: str = "") -> str:
    """Describe a slope that exceeds the limit of climb or dive.

    slope: rad, positive for a climb.
    climb, dive: the limits, rad.
    place_text: place on the path, such as `` along its arc``.
    """
    verb, limit, stated, rate = (
        ("climbs", climb, data.max_climb, "climb") if slope > 0 else ("sinks", dive, data.max_dive, "sink")
    )
    margins = f", including a plan's margins for gusts and the autopilot's {rate} rate" if math.isnan(stated) else ""
    return (
        f"{verb} at {math.degrees(abs(slope)):.1f}°{place_text}; at most {math.degrees(limit):.1f}° are"
        f" allowed{margins}"
    )


def _clearance_margin(data: ProblemArrays, waypoints: Floats, problems: list[str]) -> float:
    """Return the smallest margin of a path to the required height, m; append violations to `problems`.

    The required height above ground is the clearance plus the buffer. The margin is NaN if the path leaves the terrain.
    """
    pieces = heights_above_ground(data, waypoints)
    margins = pieces["height"] - data.clearance - pieces["buffer"]
    too_low: dict[str, _LowPlace] = {}
    off_terrain: dict[str, None] = {}
    for piece, margin in zip(pieces, margins.tolist(), strict=True):
        name = f"turn at waypoint {piece['number']}" if piece["of_arc"] else f"leg {piece['number']}"
        if math.isnan(margin):
            off_terrain[name] = None
        elif margin < -_EPSILON:
            known = too_low.get(name, _LowPlace(math.inf, math.inf))
            too_low[name] = _LowPlace(min(known.margin, margin), min(known.height, float(piece["height"])))
    required_text = f"{data.clearance:g} m of clearance and {data.buffer:.1f} m of margin are required"
    problems += _summarise_faults([(0.0, name, "leaves the terrain data") for name in off_terrain])
    problems += _summarise_faults(
        [
            (
                place.margin,
                name,
                f"{abs(place.height):.1f} m {'below' if place.height < 0.0 else 'above'} ground at its lowest point;"
                f" {required_text}",
            )
            for name, place in too_low.items()
            if name not in off_terrain
        ]
    )
    return _without_rounding(float(margins.min()))


class _LowPlace(NamedTuple):
    """Lowest place of a leg or a turn, m.

    margin: smallest margin to the required height.
    height: smallest height above ground.
    """

    margin: float
    height: float


def _airspace_margins(problem: Problem, waypoints: Floats, problems: list[str]) -> tuple[float, float]:
    """Return the smallest margins to zones and to the maximum height, m; append violations to `problems`.

    Both are inf if the scenario has neither zones nor a maximum height.
    """
    data, space = problem.certified, problem.certified.airspace
    if not is_limited(space):
        return math.inf, math.inf
    pieces = airspace_pieces(data, np.ascontiguousarray(waypoints))
    # The height of a piece off the terrain is NaN, which the clearance reports.
    headroom = float(np.fmin.reduce(space.max_height - pieces["height"] - pieces["buffer"], initial=math.inf))
    zone_faults: dict[str, tuple[float, int]] = {}
    height_faults: dict[str, float] = {}
    for piece in pieces:
        name = f"turn at waypoint {piece['number']}" if piece["of_corner"] else f"leg {piece['number']}"
        zone_margin, piece_headroom = piece["zones"], float(space.max_height - piece["height"])
        if zone_margin["excess"] < -_EPSILON:
            zone_faults[name] = min(
                zone_faults.get(name, (math.inf, 0)), (float(zone_margin["nearest"]), int(zone_margin["zone"]))
            )
        if piece_headroom < float(piece["buffer"]) - _EPSILON:
            height_faults[name] = min(height_faults.get(name, math.inf), piece_headroom)
    for index in dict.fromkeys(z for _, z in zone_faults.values()):
        required = space.zones.required[index]
        zone = problem.scenario.zones[int(required["number"])]
        side, relation = ("inside", "from") if zone.kind == "exclusion" else ("outside", "inside the edge of")
        required_text = (
            f"{required['horizontal']:g} m horizontally or {required['vertical']:g} m vertically are required"
        )
        problems += _summarise_faults(
            [
                (
                    distance,
                    name,
                    f"{-distance:.1f} m {side} {zone.name}"
                    if distance < 0.0
                    else f"{distance:.1f} m {relation} {zone.name}; {required_text}",
                )
                for name, (distance, z) in zone_faults.items()
                if z == index
            ]
        )
    required_text = f"at most {space.max_height:g} m minus a margin of {space.buffer:.1f} m are allowed"
    problems += _summarise_faults(
        [
            (
                piece_headroom,
                name,
                f"{space.max_height - piece_headroom:.1f} m above ground at its highest point; {required_text}",
            )
            for name, piece_headroom in height_faults.items()
        ]
    )
    return _without_rounding(float(pieces["zones"]["excess"].min())), _without_rounding(headroom)
