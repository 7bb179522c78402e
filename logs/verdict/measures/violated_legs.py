"""Find the legs on which a plan violates a threat, a zone or the area; findings name only the violated object."""

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import Finding
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.tolerances import ROUNDING_M
from world.arrays import Floats
from world.threats import Threats


def violated_legs(requirements: RouteRequirements, finding: Finding) -> tuple[int, ...]:
    """Return the legs of the planned path that violate the threat, zone or area of a failed finding.

    Return () for a finding of another rule.
    """
    path, place = requirements.path, finding.place
    scenario = requirements.setup.scenario
    if place.kind in ("missile", "radar") and place.index is not None:
        is_inside = _sphere_segments(path.points, scenario.threats, place.index, is_missile=place.kind == "missile")
        return tuple(np.unique(path.legs[is_inside]).tolist())
    facts = {fact.what: fact.value for fact in finding.facts}
    if "entry leg" in facts and "exit leg" in facts:
        return tuple(range(int(facts["entry leg"]), int(facts["exit leg"]) + 1))
    if finding.rule == "bounds":
        (west, east), (south, north) = scenario.bounds.tolist()
        min_corner, max_corner = np.array([west, south, scenario.floor]), np.array([east, north, scenario.ceiling])
        is_outside = np.asarray(
            ((path.points < min_corner - ROUNDING_M) | (path.points > max_corner + ROUNDING_M)).any(axis=1)
        )
        return tuple(np.unique(path.legs[is_outside[:-1] | is_outside[1:]]).tolist())
    return ()


def _sphere_segments(points: Floats, threats: Threats, number: int, *, is_missile: bool) -> NDArray[np.bool_]:
    """Return a mask (n - 1,): True for each path segment that enters the sphere of a threat.

    points: points of the path, m, (n, 3).
    number: index of the threat.
    """
    radius = float((threats.kill_radius if is_missile else threats.detection_radius)[number])
    start, step = points[:-1] - threats.position[number], np.diff(points, axis=0)
    length_square = (step**2).sum(axis=1)
    fraction = np.clip(
        np.divide(
            -(start * step).sum(axis=1), length_square, out=np.zeros_like(length_square), where=length_square > 0
        ),
        0,
        1,
    )
    nearest_offset = start + fraction[:, None] * step
    return np.asarray((nearest_offset**2).sum(axis=1) <= radius**2)
