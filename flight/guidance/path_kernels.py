"""Where on a `flight.guidance.fly_by_path.FlyByPath` one is, its curvature, its height: for the compiled loop."""

import math

import numpy as np
from numpy.typing import NDArray

from world.geometry import wrap
from world.kernels import Record, compiled, record_dtype

Records = NDArray[np.record]

# A straight piece or an arc of the path.
PIECE = record_dtype(
    "start",  # m along the path
    "length",  # m
    "east",  # m, of its start
    "north",
    "course",  # rad, at its start
    "curvature",  # 1/m, positive to the right
    ("leg", np.int64),  # of its start
    "leg_change",  # m along the path where the next leg begins; infinite where it does not
)
# A corner of the height profile and the parabola that blends it.
NODE = record_dtype(
    "distance",  # m along the path
    "height",  # m
    "slope",  # tangent, after it
    "half_length",  # m, of its parabola
)


@compiled
def project(piece: Record, east: float, north: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Distance along a piece (m), cross-track error to the right (m) and the path's course there (rad)."""
    course, curvature = piece.course, piece.curvature
    de, dn = east - piece.east, north - piece.north
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
def mean_curvature(pieces: Records, k: int, start: float, end: float) -> float:  # pragma: no cover - compiled
    """Mean curvature of the path between two distances, both at or after piece ``k``, 1/m."""
    total = 0.0
    for i in range(k, pieces.shape[0]):
        piece = pieces[i]
        low = max(start, piece.start)
        high = min(end, piece.start + piece.length)
        if high > low:
            total += piece.curvature * (high - low)
        if piece.start > end:
            break
    return total / (end - start)


@compiled
def most_curvature(pieces: Records, k: int, start: float, end: float) -> float:  # pragma: no cover - compiled
    """Sharpest curvature of the path between two distances, both at or after piece ``k``, 1/m, positive."""
    most = 0.0
    for i in range(k, pieces.shape[0]):
        piece = pieces[i]
        if piece.start > end:
            break
        if piece.start + piece.length > start:
            most = max(most, abs(piece.curvature))
    return most


@compiled
def profile(nodes: Records, s: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Height (m), slope (tangent) and its change per metre of the height profile at distance ``s``."""
    k = 0
    while k + 1 < nodes.shape[0] and nodes[k + 1].distance <= s:
        k += 1
    for i in range(k, min(k + 2, nodes.shape[0])):
        node = nodes[i]
        half = node.half_length
        if half > 0.0 and abs(s - node.distance) < half:
            before = nodes[max(i - 1, 0)].slope
            bend = (node.slope - before) / (2.0 * half)
            x = s - node.distance + half
            return node.height + before * (x - half) + 0.5 * bend * x * x, before + bend * x, bend
    node = nodes[k]
    return node.height + node.slope * (s - node.distance), node.slope, 0.0
