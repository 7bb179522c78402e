"""Measure legs that follow the ground: the demanded altitude along the leg, and its slope."""

import math
from typing import NamedTuple

import numpy as np

from flight.guidance.path import GROUND_STEP_M
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import project_onto_leg
from world.arrays import Floats


class GroundSlope(NamedTuple):
    """Part of a leg on which the ground that it follows rises more steeply than a limit.

    slope: mean slope of the part, rad.
    length: horizontal length of the part, m.
    excess: height that an aircraft climbing at the limit lacks at the end of the part, m.
    """

    slope: float
    length: float
    excess: float


def follows_ground(requirements: RouteRequirements, leg: int) -> bool:
    """Return True if a leg demands a height above ground, and the ground is known."""
    return requirements.setup.scenario.terrain is not None and math.isfinite(
        float(requirements.setup.route.points["above_ground"][leg + 1])
    )


def mean_ground_slope(requirements: RouteRequirements, leg: int) -> float:
    """Return the slope from the ground at a leg's start to the ground at its end, rad.

    The slope is NaN for a leg that does not follow the ground, and for unknown ground.
    """
    terrain = requirements.setup.scenario.terrain
    if terrain is None or not follows_ground(requirements, leg):
        return math.nan
    start, end = requirements.points[leg], requirements.points[leg + 1]
    rise = float(terrain.height(end[0], end[1])) - float(terrain.height(start[0], start[1]))
    return math.atan2(rise, math.hypot(end[0] - start[0], end[1] - start[1]))


def demanded_altitudes(requirements: RouteRequirements, leg: int, positions: Floats) -> Floats:
    """Return the altitudes demanded at positions on a leg that follows the ground, m AMSL, (n,).

    The demanded height above ground changes linearly along the leg, as in `flight.guidance.path.fly_by_path`.  The
    altitude is NaN where the ground is unknown.
    positions: east and north, m, (n, 2); further columns are ignored.
    """
    terrain = requirements.setup.scenario.terrain
    if terrain is None:
        return np.full(len(positions), math.nan)
    start = requirements.points[leg]
    end_height = float(requirements.setup.route.points["above_ground"][leg + 1])
    start_height = float(start[2]) - float(terrain.height(start[0], start[1]))
    start_height = start_height if math.isfinite(start_height) else end_height
    distance, _ = project_onto_leg(requirements, leg, positions)
    fraction = np.clip(distance / max(float(requirements.runs[leg]), 1.0), 0.0, 1.0)
    ground = np.asarray(terrain.height(positions[:, 0], positions[:, 1]), dtype=np.float64)
    return ground + start_height + fraction * (end_height - start_height)


def altitude_error(requirements: RouteRequirements, leg: int, position: Floats) -> float:
    """Return how far a position is above the altitude that a leg demands there, m, negative below.

    The demanded altitude lies on the straight line between the leg's waypoints.  On a leg that follows the ground, it
    is the altitude from `demanded_altitudes`, and the error is NaN over unknown ground.

    position: east, north and up, m, (3,).
    """
    if follows_ground(requirements, leg):
        return float(position[2] - demanded_altitudes(requirements, leg, position[None])[0])
    distance, _ = project_onto_leg(requirements, leg, position[None])
    run, (start, end) = float(requirements.runs[leg]), requirements.points[leg : leg + 2, 2]
    return float(position[2] - np.interp(distance[0], [0.0, max(run, 1e-6)], [start, end]))


def steepest_ground(requirements: RouteRequirements, leg: int, limit: float) -> GroundSlope | None:
    """Find the part of a ground-following leg on which the aircraft falls behind the most.

    The aircraft climbs at a limit.

    The ground is sampled in steps of `GROUND_STEP_M`, like ArduPlane's terrain data.  Return None if no part of the leg
    is steeper than the limit, or if the ground or the limit is unknown.

    limit: steepest possible climb, rad.
    """
    start = requirements.points[leg, :2]
    unit = requirements.leg_unit(leg)
    run = float(requirements.runs[leg])
    distance = np.append(np.arange(0.0, run, GROUND_STEP_M), run)
    altitude = demanded_altitudes(requirements, leg, start + distance[:, None] * unit)
    is_known = np.isfinite(altitude)
    distance, altitude = distance[is_known], altitude[is_known]
    if len(distance) < 2 or not math.isfinite(limit):
        return None
    # Height of the leg above a climb at the limit.  Its largest rise is the height that the aircraft lacks.
    height = altitude - distance * math.tan(limit)
    rise = height - np.minimum.accumulate(height)
    end = int(np.argmax(rise))
    if rise[end] <= 0.0:
        return None
    begin = int(np.argmin(height[: end + 1]))
    length = float(distance[end] - distance[begin])
    return GroundSlope(math.atan2(float(altitude[end] - altitude[begin]), length), length, float(rise[end]))
