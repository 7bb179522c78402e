"""Passes along a whole path, compiled: height above ground, and time and exposure inside spheres.

A path is points (n, 3) m with a time (s) each: a flown track's rows, or a route's waypoints with the times that
they would be passed at.  Both are judged by the same code, exact on each straight segment.
"""

import math

import numpy as np
from numpy.typing import NDArray

from world.frames import PolyMapRecord
from world.geometry import segment_exposure, sphere_window
from world.kernels import compiled
from world.terrain import segment_clearance

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# Segments that share one bounding box.
_BLOCK = 256
# Segments joined to one where a sphere is far from a block of them (30 of its diagonals): the exposure changes by
# less than 0.1 %.
_JOINED = 16
_FAR = 30.0


@compiled
def path_clearance(
    heights: Heights, to_pixel: PolyMapRecord, points: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover - compiled
    """Smallest height above ground on each segment and the fraction of it where that is, (n - 1,) each.

    NaN where a segment leaves the raster or its data.
    """
    count = max(0, points.shape[0] - 1)
    low, at = np.empty(count), np.empty(count)
    for k in range(count):
        low[k], at[k] = segment_clearance(heights, to_pixel, points[k], points[k + 1])
    return low, at


@compiled
def path_spheres(
    points: Floats, time: Floats, centres: Floats, radii: Floats, scales: Floats
) -> Floats:  # pragma: no cover - compiled
    """How a path meets each of m spheres, (m, 5).

    Columns: s inside; the integral over that time of (scale/d)^4, s; closest distance to the centre, m; the time of
    that; the time of first entry (NaN where it never enters).  A radius of 0 is no sphere.
    """
    boxes = _boxes(points)
    out = np.zeros((centres.shape[0], 5))
    for m in range(centres.shape[0]):
        out[m, 2] = math.inf
        out[m, 4] = math.nan
        if radii[m] <= 0.0 or points.shape[0] < 2:
            continue
        nearest = 0
        nearest_box = math.inf
        for block in range(boxes.shape[0]):
            low, _ = _box_distances(boxes[block], centres[m])
            if low < nearest_box:
                nearest_box, nearest = low, block
        _closest(points, time, nearest, centres[m], out[m])
        for block in range(boxes.shape[0]):
            low, high = _box_distances(boxes[block], centres[m])
            if low < out[m, 2]:
                _closest(points, time, block, centres[m], out[m])
            if low <= radii[m]:
                whole = high <= radii[m] and low > _FAR * boxes[block, 6]
                _inside(points, time, block, _JOINED if whole else 1, centres[m], radii[m], scales[m], out[m])
    return out


@compiled
def _boxes(points: Floats) -> Floats:  # pragma: no cover - compiled
    """Least and greatest corner of each block of segments, and its diagonal, (blocks, 7)."""
    segments = max(0, points.shape[0] - 1)
    out = np.empty(((segments + _BLOCK - 1) // _BLOCK, 7))
    for block in range(out.shape[0]):
        first, last = block * _BLOCK, min(segments, (block + 1) * _BLOCK)
        diagonal2 = 0.0
        for k in range(3):
            low, high = math.inf, -math.inf
            for row in range(first, last + 1):
                low, high = min(low, points[row, k]), max(high, points[row, k])
            out[block, k], out[block, 3 + k] = low, high
            diagonal2 += (high - low) ** 2
        out[block, 6] = math.sqrt(diagonal2)
    return out


@compiled
def _box_distances(box: Floats, centre: Floats) -> tuple[float, float]:  # pragma: no cover - compiled
    """Least and greatest distance of a box from a point."""
    low2 = 0.0
    high2 = 0.0
    for k in range(3):
        below, above = box[k] - centre[k], centre[k] - box[3 + k]
        out = max(0.0, below, above)
        low2 += out * out
        far = max(abs(below), abs(above))
        high2 += far * far
    return math.sqrt(low2), math.sqrt(high2)


@compiled
def _closest(points: Floats, time: Floats, block: int, centre: Floats, out: Floats) -> None:  # pragma: no cover
    """Bring the closest distance and its time up to date with one block."""
    for k in range(block * _BLOCK, min(points.shape[0] - 1, (block + 1) * _BLOCK)):
        length2 = 0.0
        along = 0.0
        for axis in range(3):
            step = points[k + 1, axis] - points[k, axis]
            length2 += step * step
            along += step * (centre[axis] - points[k, axis])
        f = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
        away, _, _ = sphere_window(points[k], points[k + 1], centre, 0.0)
        if away < out[2]:
            out[2] = away
            out[3] = time[k] + f * (time[k + 1] - time[k])


@compiled
def _inside(
    points: Floats, time: Floats, block: int, step: int, centre: Floats, radius: float, scale: float, out: Floats
) -> None:  # pragma: no cover - compiled
    """Add one block's time and exposure inside the sphere."""
    last = min(points.shape[0] - 1, (block + 1) * _BLOCK)
    k = block * _BLOCK
    while k < last:
        end = min(last, k + step)
        share, mean = segment_exposure(points[k], points[end], centre, radius, scale)
        if share > 0.0:
            lasts = time[end] - time[k]
            if math.isnan(out[4]):
                _, enter, _ = sphere_window(points[k], points[end], centre, radius)
                out[4] = time[k] + enter * lasts
            out[0] += share * lasts
            out[1] += mean * lasts
        k = end
