"""The waypoint rule: how close the track came to each waypoint."""

import math

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack, approaches
from logs.verdict.tolerances import EQUALLY_CLOSE, PASS, PASS_HEIGHT

Floats = NDArray[np.float64]


def waypoint_findings(demands: RouteDemands, aligned: AlignedTrack | None) -> list[Finding]:
    """Judge how close the track came to each waypoint."""
    apexes = demands.apexes()
    return [_waypoint(demands, aligned, i, apexes) for i in range(len(demands.points))]


def _waypoint(demands: RouteDemands, aligned: AlignedTrack | None, i: int, apexes: Floats) -> Finding:
    offset = float(demands.fly_by_offset[i])
    limit = offset + PASS
    away, off, reason = math.nan, math.nan, "missed: nothing was flown"
    if aligned is not None:
        away, off = _closest(demands, aligned, i, float(apexes[i, 2]))
        reason = f"passed at {away:.1f} m, {abs(off):.1f} m {'above' if off >= 0.0 else 'below'}"
        if offset >= 1.0:
            reason += f" (the fly-by path passes at {offset:.0f} m)"
    height = PASS_HEIGHT + float(demands.blend_deviation[i])
    ok = aligned is not None and away <= limit and abs(off) <= height
    if aligned is not None and not ok:
        reason = f"missed: {reason}; at most {limit:.0f} m and {height:.0f} m of height count as passed"
        if i > 0 and not aligned.passed[i]:
            reason = f"missed: the flight ended {math.hypot(away, off):.0f} m away"
    return make_finding(
        "waypoint",
        demands.waypoint(i),
        ok=ok,
        reason=reason,
        planned=offset,
        flown=away,
        limit=limit,
        source="fly-over" if demands.setup.route.fly_over[i] else "fly-by path",
        tolerance=0.0,
        margin=limit - away,
        unit="m",
        method="closest approach, horizontal",
    )


def _closest(demands: RouteDemands, aligned: AlignedTrack, i: int, level: float) -> tuple[float, float]:
    """Closest horizontal approach between the neighbouring waypoints, m, and the height above ``level`` there."""
    first = int(aligned.rows[i - 1]) if i else 0
    last = int(aligned.rows[i + 1]) if i + 1 < len(demands.points) else len(aligned.track) - 1
    position = aligned.track.position[first : max(last, first + 1) + 1]
    distance, fraction = approaches(position, demands.points[i])
    if not distance.size:
        off = aligned.track.position[-1] - demands.points[i]
        return math.hypot(off[0], off[1]), float(off[2])
    # Of equally close rows the one nearest in height.
    near = np.flatnonzero(distance <= distance.min() + EQUALLY_CLOSE)
    up = position[near, 2] + fraction[near] * (position[near + 1, 2] - position[near, 2]) - level
    return float(distance.min()), float(up[np.argmin(np.abs(up))])
