"""Measure a whole path with compiled code: height above ground, and time and exposure inside spheres.

A path consists of n points (m, (n, 3)) with a time (s) each: the rows of a flown track, or the points of a planned path
with the times at which they would be passed.  The results are exact on each straight segment.
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
from world.terrain import Terrain, path_clearances, segment_clearance

# Number of segments that share one bounding box.
_BLOCK_SEGMENTS = 256
# Number of segments that are treated as one if their block is far (`SPHERE_FAR_DIAGONALS`) from a sphere's center.
_JOINED_SEGMENTS = 16


def path_clearance(heights: Heights, to_pixel: PolyMapRecord, points: Floats) -> tuple[Floats, Floats]:
    """Return each segment's minimum height above ground, m, and its fraction of the segment.

    Both have shape (n - 1,).  The height is NaN if a segment leaves the terrain data; the fraction is then where it
    first does.

    heights, to_pixel: terrain heights, m, and map from positions to their pixels.
    points: ends of the segments, m, (n, 3).
    """
    clearance, fraction = _path_clearances(read_only(heights), to_pixel, read_only(np.ascontiguousarray(points)))
    return clearance, fraction


@compiled
def _path_clearances(heights: Heights, to_pixel: PolyMapRecord, points: Floats) -> tuple[Floats, Floats]:
    """Return each segment's minimum height above ground, and its fraction; see `path_clearance`."""
    return path_clearances(heights, to_pixel, points)


class SphereVisits(NamedTuple):
    """Visits of a path to m spheres; each field has shape (m,).

    time_inside: total time inside, s.
    exposure: integral of (scale/d)^4 over the time inside, s, with the distance d from the center.
    closest: minimum distance from the center, m; inf for a sphere of radius 0.
    closest_time: time of the minimum distance, s.
    entry_time: time of the first entry, s; NaN if the path never enters.
    """

    time_inside: Floats
    exposure: Floats
    closest: Floats
    closest_time: Floats
    entry_time: Floats


class _Boxes(NamedTuple):
    """Bounding boxes of blocks of segments.

    low, high: minimum and maximum corner, m, (blocks, 3).
    diagonal: m, (blocks,).
    """

    low: Floats
    high: Floats
    diagonal: Floats


def path_spheres(points: Floats, time: Floats, centres: Floats, radii: Floats, scales: Floats) -> SphereVisits:
    """Measure the visits of a path to m spheres; a radius of 0 stands for no sphere.

    points, time: points of the path, m, (n, 3), and their times, s, (n,).
    centres: centers of the spheres, m, (m, 3).
    radii, scales: radii of the spheres, and lengths that scale the exposure, m, (m,).

    >>> line, time = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]), np.array([0.0, 10.0])
    >>> visits = path_spheres(line, time, np.array([[50.0, 30.0, 0.0]]), np.array([50.0]), np.array([10.0]))
    >>> float(visits.closest[0]), round(float(visits.time_inside[0]), 6)
    (30.0, 8.0)
    """
    arrays = (read_only(np.ascontiguousarray(array)) for array in (points, time, centres, radii, scales))
    return _sphere_visits(*arrays)


@compiled
def _sphere_visits(points: Floats, time: Floats, centres: Floats, radii: Floats, scales: Floats) -> SphereVisits:
    """Measure the visits of a path to all spheres; see `path_spheres`.

    The segments are checked block by block; a block whose bounding box is outside a sphere is skipped.

    points, time: positions, m, (n, 3), and times, s, (n,), of the path.
    centres, radii, scales: one entry per sphere, as in `path_spheres`; a sphere with radius 0 is skipped.
    """
    boxes = _block_boxes(points)
    count = centres.shape[0]
    visits = SphereVisits(
        np.zeros(count), np.zeros(count), np.full(count, math.inf), np.zeros(count), np.full(count, math.nan)
    )
    for m in range(count):
        if radii[m] <= 0.0 or points.shape[0] < 2:
            continue
        nearest_block = 0
        nearest_distance = math.inf
        for block in range(boxes.diagonal.shape[0]):
            min_distance, _ = _box_distances(boxes, block, centres[m])
            if min_distance < nearest_distance:
                nearest_distance, nearest_block = min_distance, block
        _update_closest(points, time, nearest_block, centres[m], m, visits)
        for block in range(boxes.diagonal.shape[0]):
            min_distance, max_distance = _box_distances(boxes, block, centres[m])
            if min_distance < visits.closest[m]:
                _update_closest(points, time, block, centres[m], m, visits)
            if min_distance <= radii[m]:
                is_inside = max_distance <= radii[m] and min_distance > SPHERE_FAR_DIAGONALS * boxes.diagonal[block]
                _add_stay(
                    points,
                    time,
                    block,
                    _JOINED_SEGMENTS if is_inside else 1,
                    centres[m],
                    radii[m],
                    scales[m],
                    m,
                    visits,
                )
    return visits


@inner
def _block_boxes(points: Floats) -> _Boxes:
    """Return the bounding box of each block of `_BLOCK_SEGMENTS` successive segments of a path (n, 3)."""
    segments = max(0, points.shape[0] - 1)
    count = -(-segments // _BLOCK_SEGMENTS)
    boxes = _Boxes(np.empty((count, 3)), np.empty((count, 3)), np.empty(count))
    for block in range(count):
        first, last = block * _BLOCK_SEGMENTS, min(segments, (block + 1) * _BLOCK_SEGMENTS)
        diagonal_square = 0.0
        for axis in range(3):
            min_coordinate, max_coordinate = math.inf, -math.inf
            for row in range(first, last + 1):
                min_coordinate = min(min_coordinate, points[row, axis])
                max_coordinate = max(max_coordinate, points[row, axis])
            boxes.low[block, axis], boxes.high[block, axis] = min_coordinate, max_coordinate
            diagonal_square += (max_coordinate - min_coordinate) ** 2
        boxes.diagonal[block] = math.sqrt(diagonal_square)
    return boxes


@inner
def _box_distances(boxes: _Boxes, block: int, centre: Floats) -> tuple[float, float]:
    """Return the minimum and the maximum distance of a block's bounding box from a point, m."""
    min_square = 0.0
    max_square = 0.0
    for axis in range(3):
        lower_offset = boxes.low[block, axis] - centre[axis]
        upper_offset = centre[axis] - boxes.high[block, axis]
        outside_distance = max(0.0, lower_offset, upper_offset)
        min_square += outside_distance * outside_distance
        max_offset = max(abs(lower_offset), abs(upper_offset))
        max_square += max_offset * max_offset
    return math.sqrt(min_square), math.sqrt(max_square)


@inner
def _update_closest(points: Floats, time: Floats, block: int, centre: Floats, m: int, visits: SphereVisits) -> None:
    """Update the closest approach to sphere `m` in `visits` with the segments of one block."""
    for k in range(block * _BLOCK_SEGMENTS, min(points.shape[0] - 1, (block + 1) * _BLOCK_SEGMENTS)):
        length_square = 0.0
        projection = 0.0
        for axis in range(3):
            step = points[k + 1, axis] - points[k, axis]
            length_square += step * step
            projection += step * (centre[axis] - points[k, axis])
        fraction = min(1.0, max(0.0, projection / length_square)) if length_square > 0.0 else 0.0
        distance, _, _ = sphere_window(points[k], points[k + 1], centre, 0.0)
        if distance < visits.closest[m]:
            visits.closest[m] = distance
            visits.closest_time[m] = time[k] + fraction * (time[k + 1] - time[k])


@inner
def _add_stay(
    points: Floats,
    time: Floats,
    block: int,
    step: int,
    centre: Floats,
    radius: float,
    scale: float,
    m: int,
    visits: SphereVisits,
) -> None:
    """Add one block's time and exposure inside sphere `m` to `visits`.

    step: number of consecutive segments that are treated as one straight segment.
    """
    last = min(points.shape[0] - 1, (block + 1) * _BLOCK_SEGMENTS)
    k = block * _BLOCK_SEGMENTS
    while k < last:
        end = min(last, k + step)
        fraction, mean_exposure = segment_exposure(points[k], points[end], centre, radius, scale)
        if fraction > 0.0:
            duration = time[end] - time[k]
            if math.isnan(visits.entry_time[m]):
                _, entry_fraction, _ = sphere_window(points[k], points[end], centre, radius)
                visits.entry_time[m] = time[k] + entry_fraction * duration
            visits.time_inside[m] += fraction * duration
            visits.exposure[m] += mean_exposure * duration
        k = end


# ----------------------------------------------------------------------
# Clearance of each segment of a flown track, and the track's stays in a sphere; rows may be implausible here.


@dataclass(frozen=True, slots=True)
class SphereStay:
    """One stay inside a sphere.

    start, end: times of entry and exit, s.
    closest: minimum distance from the center, m.
    closest_time: start time of the segment with the minimum distance, s.
    whole: True if the track left the sphere again.
    """

    start: float
    end: float
    closest: float
    closest_time: float
    whole: bool


def segment_clearances(terrain: Terrain, position: Floats) -> tuple[Floats, Floats]:
    """Return each track segment's minimum height above ground, m, and its fraction of the segment.

    Both have shape (t - 1,).  The height is NaN if the segment leaves the terrain data or has an implausible end.

    position: positions of the track, m, (t, 3).
    """
    return _plausible_clearances(terrain.heights, terrain.to_pixel.record, read_only(np.ascontiguousarray(position)))


def sphere_stays(time: Floats, position: Floats, centre: Floats, radius: float) -> list[SphereStay]:
    """Return a track's stays inside a sphere, in order of time.

    There are none for a radius of 0 or a track of fewer than two rows.  A stay that lasts until the last row is not
    `whole`.

    time, position: times, s, (t,), and positions, m, (t, 3), of the track.
    centre: center of the sphere, m, (3,).
    """
    if not radius > 0.0 or len(position) < 2:
        return []
    track = read_only(np.ascontiguousarray(position))
    center = read_only(np.ascontiguousarray(centre))
    closest, entry_fraction, exit_fraction = _sphere_windows(track, center, float(radius))
    rows = np.flatnonzero(exit_fraction > entry_fraction)
    if not rows.size:
        return []
    step = np.diff(time)
    start, end = (time[rows] + fractions[rows] * step[rows] for fractions in (entry_fraction, exit_fraction))
    first_indices = np.flatnonzero(np.append(True, start[1:] - end[:-1] > SPHERE_STAY_TOLERANCE_S))
    stays: list[SphereStay] = []
    for indices in np.split(np.arange(rows.size), first_indices[1:]):
        closest_row = rows[indices[np.argmin(closest[rows[indices]])]]
        last = rows[indices[-1]]
        is_whole = not (last == len(step) - 1 and exit_fraction[last] >= 1.0)
        values = (
            float(start[indices[0]]),
            float(end[indices[-1]]),
            float(closest[closest_row]),
            float(time[closest_row]),
        )
        stays.append(SphereStay(*values, whole=bool(is_whole)))
    return stays


@inner
def _is_plausible(position: Floats, k: int) -> bool:
    """Return True if the position in row `k` is plausible: finite, and at most 10,000 km from the origin."""
    limit = MAX_PLAUSIBLE_POSITION_M
    return abs(position[k, 0]) <= limit and abs(position[k, 1]) <= limit and abs(position[k, 2]) <= limit


@compiled
def _plausible_clearances(
    heights: Heights, to_pixel: PolyMapRecord, position: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover
    """Compute clearances as `_path_clearances` does, but with NaN for segments with an implausible end."""
    count = max(0, position.shape[0] - 1)
    clearance = np.full(count, math.nan)
    fraction = np.zeros(count)
    for k in range(count):
        if _is_plausible(position, k) and _is_plausible(position, k + 1):
            clearance[k], fraction[k] = segment_clearance(heights, to_pixel, position[k], position[k + 1])
    return clearance, fraction


@compiled
def _sphere_windows(
    position: Floats, centre: Floats, radius: float
) -> tuple[Floats, Floats, Floats]:  # pragma: no cover
    """Return each segment's minimum distance from a sphere's center (m), and its entry and exit.

    Entry and exit are fractions of the segment, (t - 1,) each.  For a segment with an implausible end, the distance is
    inf and both fractions are 0.
    """
    count = position.shape[0] - 1
    closest = np.full(count, math.inf)
    entry = np.zeros(count)
    exit_ = np.zeros(count)
    for k in range(count):
        if _is_plausible(position, k) and _is_plausible(position, k + 1):
            closest[k], entry[k], exit_[k] = sphere_window(position[k], position[k + 1], centre, radius)
    return closest, entry, exit_
