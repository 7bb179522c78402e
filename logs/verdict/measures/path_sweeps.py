"""Sweep along a whole path, compiled: height above ground, and time and exposure inside spheres.

A path is points (n, 3) m with a time (s) each: the rows of a flown track, or the waypoints of a route with the times at
which they would be passed.  The same code judges both, exactly on each straight segment.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from logs.verdict.tolerances import MAX_PLAUSIBLE_POSITION_M, SPHERE_FAR_DIAGONALS, SPHERE_STAY_TOLERANCE_S
from world.arrays import Floats, Heights
from world.frames import PolyMapRecord
from world.geometry import segment_exposure, sphere_window
from world.kernels import compiled, inner, read_only
from world.terrain import Terrain, segment_clearance

# Number of segments that share one bounding box.
_BLOCK_SEGMENTS = 256
# Number of segments joined to one if a sphere's center is `SPHERE_FAR_DIAGONALS` from a block of them.
_JOINED_SEGMENTS = 16


def path_clearance(heights: Heights, to_pixel: PolyMapRecord, points: Floats) -> tuple[Floats, Floats]:
    """Return the minimum height above ground on each segment, m, and its fraction of the segment, (n - 1,) each.

    Both are NaN if a segment leaves the raster or its data.
    """
    low, at = _path_clearance(read_only(heights), to_pixel, read_only(np.ascontiguousarray(points)))
    return low, at


@compiled
def _path_clearance(heights: Heights, to_pixel: PolyMapRecord, points: Floats) -> tuple[Floats, Floats]:
    count = max(0, points.shape[0] - 1)
    low, at = np.empty(count), np.empty(count)
    for k in range(count):
        low[k], at[k] = segment_clearance(heights, to_pixel, points[k], points[k + 1])
    return low, at


class SphereVisits(NamedTuple):
    """Visits of a path to m spheres, (m,) each.

    inside: s.
    exposure: integral of (scale/d)^4 over the time inside, s.
    closest: minimum distance to the center, m; inf for a sphere of radius 0.
    closest_time: s.
    entry_time: s, of the first entry; NaN if the path never enters.
    """

    inside: Floats
    exposure: Floats
    closest: Floats
    closest_time: Floats
    entry_time: Floats


class _Boxes(NamedTuple):
    """Minimum and maximum corner of each block of segments, m, (blocks, 3), and its diagonal, m, (blocks,)."""

    low: Floats
    high: Floats
    diagonal: Floats


def path_spheres(points: Floats, time: Floats, centres: Floats, radii: Floats, scales: Floats) -> SphereVisits:
    """Return the visits of a path to m spheres; a radius of 0 means that there is no sphere.

    points: (n, 3) m.  time: (n,) s.  centres: (m, 3) m.  radii, scales: (m,) m.

    >>> line, time = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]), np.array([0.0, 10.0])
    >>> visits = path_spheres(line, time, np.array([[50.0, 30.0, 0.0]]), np.array([50.0]), np.array([10.0]))
    >>> float(visits.closest[0]), round(float(visits.inside[0]), 6)
    (30.0, 8.0)
    """
    given = (read_only(np.ascontiguousarray(array)) for array in (points, time, centres, radii, scales))
    return _path_spheres(*given)


@compiled
def _path_spheres(points: Floats, time: Floats, centres: Floats, radii: Floats, scales: Floats) -> SphereVisits:
    boxes = _boxes(points)
    count = centres.shape[0]
    out = SphereVisits(
        np.zeros(count), np.zeros(count), np.full(count, math.inf), np.zeros(count), np.full(count, math.nan)
    )
    for m in range(count):
        if radii[m] <= 0.0 or points.shape[0] < 2:
            continue
        nearest = 0
        nearest_box = math.inf
        for block in range(boxes.diagonal.shape[0]):
            low, _ = _box_distances(boxes, block, centres[m])
            if low < nearest_box:
                nearest_box, nearest = low, block
        _closest(points, time, nearest, centres[m], m, out)
        for block in range(boxes.diagonal.shape[0]):
            low, high = _box_distances(boxes, block, centres[m])
            if low < out.closest[m]:
                _closest(points, time, block, centres[m], m, out)
            if low <= radii[m]:
                whole = high <= radii[m] and low > SPHERE_FAR_DIAGONALS * boxes.diagonal[block]
                _inside(points, time, block, _JOINED_SEGMENTS if whole else 1, centres[m], radii[m], scales[m], m, out)
    return out


@inner
def _boxes(points: Floats) -> _Boxes:
    segments = max(0, points.shape[0] - 1)
    count = -(-segments // _BLOCK_SEGMENTS)
    out = _Boxes(np.empty((count, 3)), np.empty((count, 3)), np.empty(count))
    for block in range(count):
        first, last = block * _BLOCK_SEGMENTS, min(segments, (block + 1) * _BLOCK_SEGMENTS)
        diagonal2 = 0.0
        for axis in range(3):
            low, high = math.inf, -math.inf
            for row in range(first, last + 1):
                low, high = min(low, points[row, axis]), max(high, points[row, axis])
            out.low[block, axis], out.high[block, axis] = low, high
            diagonal2 += (high - low) ** 2
        out.diagonal[block] = math.sqrt(diagonal2)
    return out


@inner
def _box_distances(boxes: _Boxes, block: int, centre: Floats) -> tuple[float, float]:
    """Return the minimum and the maximum distance of a block's bounding box from a point."""
    low2 = 0.0
    high2 = 0.0
    for axis in range(3):
        below, above = boxes.low[block, axis] - centre[axis], centre[axis] - boxes.high[block, axis]
        out = max(0.0, below, above)
        low2 += out * out
        far = max(abs(below), abs(above))
        high2 += far * far
    return math.sqrt(low2), math.sqrt(high2)


@inner
def _closest(points: Floats, time: Floats, block: int, centre: Floats, m: int, out: SphereVisits) -> None:
    """Update the minimum distance to sphere m and its time in `out` with one block."""
    for k in range(block * _BLOCK_SEGMENTS, min(points.shape[0] - 1, (block + 1) * _BLOCK_SEGMENTS)):
        length2 = 0.0
        along = 0.0
        for axis in range(3):
            step = points[k + 1, axis] - points[k, axis]
            length2 += step * step
            along += step * (centre[axis] - points[k, axis])
        f = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
        away, _, _ = sphere_window(points[k], points[k + 1], centre, 0.0)
        if away < out.closest[m]:
            out.closest[m] = away
            out.closest_time[m] = time[k] + f * (time[k + 1] - time[k])


@inner
def _inside(
    points: Floats,
    time: Floats,
    block: int,
    step: int,
    centre: Floats,
    radius: float,
    scale: float,
    m: int,
    out: SphereVisits,
) -> None:
    """Add one block's time and exposure inside sphere m to `out`."""
    last = min(points.shape[0] - 1, (block + 1) * _BLOCK_SEGMENTS)
    k = block * _BLOCK_SEGMENTS
    while k < last:
        end = min(last, k + step)
        share, mean = segment_exposure(points[k], points[end], centre, radius, scale)
        if share > 0.0:
            lasts = time[end] - time[k]
            if math.isnan(out.entry_time[m]):
                _, enter, _ = sphere_window(points[k], points[end], centre, radius)
                out.entry_time[m] = time[k] + enter * lasts
            out.inside[m] += share * lasts
            out.exposure[m] += mean * lasts
        k = end


# ----------------------------------------------------------------------
# The encounters of a flown track: the ground under each of its segments, and the spheres it passes through.
#
# The formulas come from the `world` package; here they are only run along a track, exactly per segment, at any rate.


@dataclass(frozen=True, slots=True)
class Passage:
    """One stay inside a sphere.

    start, end: s.  closest: minimum distance from the center, m.  whole: True if the track left the sphere again.
    """

    start: float
    end: float
    closest: float
    closest_time: float
    whole: bool


def segment_clearances(terrain: Terrain, position: Floats) -> tuple[Floats, Floats]:
    """Return the minimum height above ground on each segment of a track, m, and its fraction of the segment.

    position: (t, 3).  Returns (t - 1,) twice; NaN if the segment leaves the terrain's data or is not a number.
    """
    return _clearances(terrain.heights, terrain.to_pixel.record, read_only(np.ascontiguousarray(position)))


def passages(time: Floats, position: Floats, centre: Floats, radius: float) -> list[Passage]:
    """Return the stays of a track inside a sphere, in order.

    time: (t,) s.  position: (t, 3).  centre: (3,).  A point on the surface is inside.
    """
    if not radius > 0.0 or _boxes_are_disjoint(position, centre, radius):
        return []
    track, middle = read_only(np.ascontiguousarray(position)), read_only(np.ascontiguousarray(centre))
    closest, enter, leave = _windows(track, middle, float(radius))
    rows = np.flatnonzero(leave > enter)
    if not rows.size:
        return []
    step = np.diff(time)
    start, end = (time[rows] + share[rows] * step[rows] for share in (enter, leave))
    first = np.flatnonzero(np.append(True, start[1:] - end[:-1] > SPHERE_STAY_TOLERANCE_S))
    found: list[Passage] = []
    for here in np.split(np.arange(rows.size), first[1:]):
        row, last = rows[here[np.argmin(closest[rows[here]])]], rows[here[-1]]
        whole = not (last == len(step) - 1 and leave[last] >= 1.0)
        place = (float(start[here[0]]), float(end[here[-1]]), float(closest[row]), float(time[row]))
        found.append(Passage(*place, whole=bool(whole)))
    return found


def _boxes_are_disjoint(position: Floats, centre: Floats, radius: float) -> bool:
    """Return True if the track's bounding box does not overlap the sphere's."""
    good = position[np.isfinite(position).all(axis=1)]
    if not len(good):
        return True
    return bool((good.min(axis=0) > centre + radius).any() or (good.max(axis=0) < centre - radius).any())


@compiled
def _clearances(
    heights: Heights, to_pixel: PolyMapRecord, position: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover
    count = max(0, position.shape[0] - 1)
    low = np.full(count, math.nan)
    at = np.zeros(count)
    for k in range(count):
        if np.abs(position[k : k + 2]).max() <= MAX_PLAUSIBLE_POSITION_M:
            low[k], at[k] = segment_clearance(heights, to_pixel, position[k], position[k + 1])
    return low, at


@compiled
def _windows(position: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats, Floats]:  # pragma: no cover
    count = position.shape[0] - 1
    closest = np.full(count, math.inf)
    enter = np.zeros(count)
    leave = np.zeros(count)
    for k in range(count):
        if np.abs(position[k : k + 2]).max() <= MAX_PLAUSIBLE_POSITION_M:
            closest[k], enter[k], leave[k] = sphere_window(position[k], position[k + 1], centre, radius)
    return closest, enter, leave
