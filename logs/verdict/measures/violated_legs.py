"""Find the legs on which a plan violates a threat, a zone or the area.

Legs that pass a missile's sphere closely are included.

A finding names only the threat, the zone or the area, not the legs.
"""

import math

import numpy as np

from logs.verdict.findings import Finding
from logs.verdict.measures.path_sweeps import path_spheres
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.tolerances import ROUNDING_M
from world.arrays import Floats


def violated_legs(requirements: RouteRequirements, finding: Finding) -> tuple[int, ...]:
    """Return the legs of the planned path that violate a failed finding's threat, zone or area.

    For a zone, these are all legs from the first to the last violation.  Return () for a finding of another rule.
    """
    path, place = requirements.path, finding.place
    scenario = requirements.setup.scenario
    if place.kind in ("missile", "radar") and place.index is not None:
        # Segments that enter the sphere of the threat.
        threats = scenario.threats
        radius = float((threats.kill_radius if place.kind == "missile" else threats.detection_radius)[place.index])
        is_inside = np.asarray(_segment_distances(path.points, threats.position[place.index]) <= radius)
        return tuple(np.unique(path.legs[is_inside]).tolist())
    facts = {fact.what: fact.value for fact in finding.facts}
    if "entry leg" in facts and "exit leg" in facts:
        return tuple(range(int(facts["entry leg"]), int(facts["exit leg"]) + 1))
    if finding.rule == "bounds":
        (west, east), (south, north) = scenario.bounds.tolist()
        min_corner = np.array([west, south, scenario.floor])
        max_corner = np.array([east, north, scenario.ceiling])
        is_outside = np.asarray(
            ((path.points < min_corner - ROUNDING_M) | (path.points > max_corner + ROUNDING_M)).any(axis=1)
        )
        return tuple(np.unique(path.legs[is_outside[:-1] | is_outside[1:]]).tolist())
    return ()


def legs_near_missiles(requirements: RouteRequirements, max_distance: float) -> dict[int, tuple[float, int]]:
    """Find the legs of the planned path that come within `max_distance` (m) of a missile's sphere.

    Return, by leg, the distance from the nearest sphere, m, negative inside, and the index of its threat.
    """
    path, threats = requirements.path, requirements.setup.scenario.threats
    radii = threats.kill_radius
    closest = path_spheres(path.points, path.times, threats.position, radii, threats.kill_scale).closest
    nearest: dict[int, tuple[float, int]] = {}
    for number in np.flatnonzero((radii > 0.0) & (closest <= radii + max_distance)).tolist():
        distances = _segment_distances(path.points, threats.position[number]) - radii[number]
        for segment in np.flatnonzero(distances <= max_distance).tolist():
            leg = int(path.legs[segment])
            nearest[leg] = min(nearest.get(leg, (math.inf, 0)), (float(distances[segment]), number))
    return nearest


def _segment_distances(points: Floats, centre: Floats) -> Floats:
    """Return the distance of each segment of a path from a point, m, (n - 1,).

    points: points of the path, m, (n, 3).
    """
    start, step = points[:-1] - centre, np.diff(points, axis=0)
    length_square = (step**2).sum(axis=1)
    fraction = np.clip(
        np.divide(
            -(start * step).sum(axis=1), length_square, out=np.zeros_like(length_square), where=length_square > 0
        ),
        0,
        1,
    )
    nearest_offset = start + fraction[:, None] * step
    return np.asarray(np.sqrt((nearest_offset**2).sum(axis=1)))
