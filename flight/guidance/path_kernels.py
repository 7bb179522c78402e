"""Where on a `flight.guidance.fly_by_path.FlyByPath` one is, its curvature, its height: for the compiled loop."""

import math

import numpy as np
from numpy.typing import NDArray

from world.geometry import wrap
from world.kernels import compiled

Floats = NDArray[np.float64]


@compiled
def project(piece: Floats, east: float, north: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Distance along a piece (m), cross-track error to the right (m) and the path's course there (rad)."""
    course, curvature = piece[4], piece[5]
    de, dn = east - piece[2], north - piece[3]
    if curvature == 0.0:
        return (
            de * math.sin(course) + dn * math.cos(course),
            de * math.cos(course) - dn * math.sin(course),
            course,
        )
    # From the centre, which lies right of the start by 1 / curvature.
    ve = de - math.cos(course) / curvature
    vn = dn + math.sin(course) / curvature
    side = math.copysign(1.0, curvature)
    here = math.atan2(side * vn, -side * ve)
    turned = wrap(here - course) * side
    if turned < -0.5 * math.pi:
        turned += 2.0 * math.pi
    return turned / abs(curvature), side * (1.0 / abs(curvature) - math.hypot(ve, vn)), here


@compiled
def mean_curvature(pieces: Floats, k: int, start: float, end: float) -> float:  # pragma: no cover - compiled
    """Mean curvature of the path between two distances, both at or after piece ``k``, 1/m."""
    total = 0.0
    for i in range(k, pieces.shape[0]):
        low = max(start, pieces[i, 0])
        high = min(end, pieces[i, 0] + pieces[i, 1])
        if high > low:
            total += pieces[i, 5] * (high - low)
        if pieces[i, 0] > end:
            break
    return total / (end - start)


@compiled
def most_curvature(pieces: Floats, k: int, start: float, end: float) -> float:  # pragma: no cover - compiled
    """Sharpest curvature of the path between two distances, both at or after piece ``k``, 1/m, positive."""
    most = 0.0
    for i in range(k, pieces.shape[0]):
        if pieces[i, 0] > end:
            break
        if pieces[i, 0] + pieces[i, 1] > start:
            most = max(most, abs(pieces[i, 5]))
    return most


@compiled
def profile(nodes: Floats, s: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Height (m), slope (tangent) and its change per metre of the height profile at distance ``s``."""
    k = 0
    while k + 1 < nodes.shape[0] and nodes[k + 1, 0] <= s:
        k += 1
    for i in range(k, min(k + 2, nodes.shape[0])):
        half = nodes[i, 3]
        if half > 0.0 and abs(s - nodes[i, 0]) < half:
            before = nodes[max(i - 1, 0), 2]
            bend = (nodes[i, 2] - before) / (2.0 * half)
            x = s - nodes[i, 0] + half
            return nodes[i, 1] + before * (x - half) + 0.5 * bend * x * x, before + bend * x, bend
    return nodes[k, 1] + nodes[k, 2] * (s - nodes[k, 0]), nodes[k, 2], 0.0
