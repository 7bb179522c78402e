"""The height rule: judge the maximum height above ground on each leg, and the ceiling.

Both are judged as planned and as flown.

The rule applies if the scenario has a `max_height_m`; without it, the bounds rule judges the ceiling.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import Finding, finding_reason, make_finding, message
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_flying_lower
from logs.verdict.tolerances import HEIGHT_TOLERANCE_M
from world.arrays import Floats
from world.terrain import Terrain


def height_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the maximum height above ground on each leg; return [] if the scenario has no limit.

    Without terrain data, a single unjudged finding stands for all legs.

    geometric: True to judge the planned path only.
    """
    scenario = requirements.setup.scenario
    limit, terrain = scenario.limits.max_height_m, scenario.terrain
    if limit is None:
        return []
    if terrain is None:
        reason = "no terrain was given, so heights above ground are unknown"
        return [
            make_finding(
                "height", FLIGHT, ok=None, reason=reason, limit=limit, source=requirements.limits_source, unit="m"
            )
        ]
    path = requirements.path
    path_heights = _Path(path.points, path.times, *max_segment_heights(terrain, path.points))
    planned_maxima = [_max_heights(path_heights, np.flatnonzero(path.legs == leg)) for leg in range(requirements.legs)]
    if geometric:
        return [
            _leg_finding(requirements, leg, limit, planned_maxima[leg], planned_maxima[leg], "fly-by path")
            for leg in range(requirements.legs)
        ]
    flown_maxima: list[_LegMaxima | None] = [None] * requirements.legs
    if aligned is not None:
        track = aligned.track
        path_heights = _Path(track.position, track.time, *max_segment_heights(terrain, track.position))
        flown_maxima = [
            _max_heights(path_heights, np.arange(*aligned.leg_segments(leg))) for leg in range(requirements.legs)
        ]
    return [
        _leg_finding(requirements, leg, limit, planned_maxima[leg], flown_maxima[leg], "flown track")
        for leg in range(requirements.legs)
    ]


def max_segment_heights(terrain: Terrain, points: Floats) -> tuple[Floats, Floats]:
    """Return each segment's maximum height above ground, m, and its fraction of the segment.

    Both have shape (n - 1,).  The height is exact for ground that is interpolated bilinearly, and NaN if a segment
    leaves the terrain data.  It is computed as a minimum height, with path and ground turned upside down.

    points: ends of the segments as east, north and up, m, (n, 3).
    """
    upside_down = points * np.array([1.0, 1.0, -1.0])
    inverted_heights, fraction = path_clearance(-terrain.heights, terrain.to_pixel.record, upside_down)
    return -inverted_heights, fraction


@dataclass(frozen=True, slots=True)
class _Path:
    """Path with the maximum height above ground of each of its n - 1 segments.

    points: m, (n, 3).
    times: s, (n,).
    max_heights: m, (n - 1,).
    fraction: position of each maximum as a fraction of its segment, (n - 1,).
    """

    points: Floats
    times: Floats
    max_heights: Floats
    fraction: Floats


@dataclass(frozen=True, slots=True)
class _LegMaxima:
    """Maxima of a leg's path.

    height: maximum height above ground, m; NaN if unknown.
    amsl: maximum altitude, m AMSL.
    time_and_place: text with the time and place of the maximum height.
    is_ground_known: True if the ground is known along the whole leg.
    """

    height: float
    amsl: float
    time_and_place: str
    is_ground_known: bool


def _max_heights(path: _Path, segments: NDArray[np.intp]) -> _LegMaxima | None:
    """Return the maximum height above ground and the maximum altitude on segments; None without segments.

    The height is NaN if the ground is unknown below all segments.

    segments: indices of segments of the path, (k,).
    """
    if not segments.size:
        return None
    amsl = float(max(path.points[segments, 2].max(), path.points[segments + 1, 2].max()))
    heights = path.max_heights[segments]
    is_known = np.isfinite(heights)
    if not is_known.any():
        return _LegMaxima(math.nan, amsl, "", is_ground_known=False)
    k = int(segments[np.nanargmax(heights)])
    time, position = (
        (1.0 - path.fraction[k]) * values[k] + path.fraction[k] * values[k + 1] for values in (path.times, path.points)
    )
    time_and_place = f"at {time:.1f} s, east {position[0]:.0f} m, north {position[1]:.0f} m"
    return _LegMaxima(float(path.max_heights[k]), amsl, time_and_place, bool(is_known.all()))


def _leg_finding(
    requirements: RouteRequirements,
    leg: int,
    limit: float,
    planned_maximum: _LegMaxima | None,
    judged_maximum: _LegMaxima | None,
    path_name: str,
) -> Finding:
    """Judge the maximum height above ground and the maximum altitude of one leg.

    limit: allowed height above ground, m.
    planned_maximum: maxima of the planned leg.
    judged_maximum: maxima of the planned or flown leg; None for a leg that was not flown.
    path_name: name of the judged path.
    """
    faults, facts, ok = [], [], None
    if judged_maximum is None:
        facts.append("the leg was not flown")
    else:
        ceiling = requirements.setup.scenario.ceiling
        height_text = f"{judged_maximum.height:.1f} m above ground {judged_maximum.time_and_place}"
        if judged_maximum.height > limit + HEIGHT_TOLERANCE_M:
            faults.append(message(height_text, f"; at most {limit:g} m are allowed"))
        elif math.isfinite(judged_maximum.height):
            facts.append(f"{height_text} at the highest")
        if judged_maximum.amsl > ceiling + HEIGHT_TOLERANCE_M:
            faults.append(
                message(f"{judged_maximum.amsl:.1f} m AMSL", f", above the scenario's ceiling of {ceiling:.0f} m")
            )
        if not judged_maximum.is_ground_known:
            facts.append("part of the terrain below the leg is unknown")
        ok = False if faults else True if judged_maximum.is_ground_known else None
    if (
        planned_maximum is not None
        and planned_maximum is not judged_maximum
        and planned_maximum.height > limit + HEIGHT_TOLERANCE_M
    ):
        facts.append(f"the planned path rises to {planned_maximum.height:.1f} m above ground")
    return make_finding(
        "height",
        requirements.leg_place(leg),
        ok=ok,
        reason=finding_reason(faults, facts),
        faults=faults,
        planned=None if planned_maximum is None else planned_maximum.height,
        flown=None if judged_maximum is None or judged_maximum is planned_maximum else judged_maximum.height,
        limit=limit,
        source=requirements.limits_source,
        tolerance=HEIGHT_TOLERANCE_M,
        margin=None if judged_maximum is None else limit - judged_maximum.height,
        unit="m",
        method=f"exact along the {path_name}",
    )


RULE = Rule(
    name="height",
    tolerances=("HEIGHT_TOLERANCE_M",),
    judge=height_findings,
    suggest=suggest_flying_lower,
    log=LogNeeds(("heights",), needs_planned_heights=True),
)
