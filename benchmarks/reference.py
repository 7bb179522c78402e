"""References for the compiled evaluation and ranking: vectorised NumPy, and compiled brute force.

Both are written from the paper's equations and the conventions of `planner.evaluation.paper_scores.paper_scores`, and
agree with it to 1e-12; they serve problems whose limits are numbers and whose ends have no course.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.evaluation.problem import ProblemArrays
from planner.optimisers.preference import Level
from world.arrays import Floats, Ints
from world.frames import PolyMapRecord
from world.geometry import MIN_RANGE_M
from world.kernels import Records
from world.terrain import EDGE_TOLERANCE

# Number of points of a leg at which the paper's equations are evaluated.
POINTS = 6


def pixels_of(to_pixel: PolyMapRecord, east: Floats, north: Floats) -> tuple[Floats, Floats]:
    """Return the pixel coordinates of map positions by the vectorised polynomial."""
    size = int(to_pixel["size"])
    a = (east - to_pixel["centre_x"]) / to_pixel["half_x"]
    b = (north - to_pixel["centre_y"]) / to_pixel["half_y"]
    u, v = np.zeros_like(a), np.zeros_like(a)
    for i in range(size - 1, -1, -1):
        row_u, row_v = np.zeros_like(a), np.zeros_like(a)
        for j in range(size - 1 - i, -1, -1):
            row_u = row_u * b + to_pixel["u"][i, j]
            row_v = row_v * b + to_pixel["v"][i, j]
        u, v = u * a + row_u, v * a + row_v
    return u, v


def bilinear(heights: NDArray[np.float32], col: Floats, row: Floats) -> Floats:
    """Return the heights at pixel coordinates; NaN outside the raster."""
    rows, cols = heights.shape
    inside = (
        (col >= -EDGE_TOLERANCE)
        & (col <= cols - 1 + EDGE_TOLERANCE)
        & (row >= -EDGE_TOLERANCE)
        & (row <= rows - 1 + EDGE_TOLERANCE)
    )
    i = np.clip(row.astype(np.int64), 0, heights.shape[0] - 2)
    j = np.clip(col.astype(np.int64), 0, heights.shape[1] - 2)
    v, u = row - i, col - j
    top = heights[i, j] * (1.0 - u) + heights[i, j + 1] * u
    low = heights[i + 1, j] * (1.0 - u) + heights[i + 1, j + 1] * u
    return np.where(inside, top * (1.0 - v) + low * v, np.nan)


def numpy_scores(data: ProblemArrays, paths: Floats) -> tuple[Ints, Floats]:
    """Return counts (n, 4) and objectives (n, 4) of paths (n, w, 3) in one vectorised batch (eq. 1-11)."""
    legs = np.diff(paths, axis=1)
    counts, objectives = np.empty((len(paths), 4), dtype=np.int64), np.empty((len(paths), 4))
    cross = legs[:, :-1, 0] * legs[:, 1:, 1] - legs[:, :-1, 1] * legs[:, 1:, 0]
    dot = legs[:, :-1, 0] * legs[:, 1:, 0] + legs[:, :-1, 1] * legs[:, 1:, 1]
    counts[:, 0] = (np.arctan2(np.abs(cross), dot + 0.0) > data.max_turn).sum(axis=1)
    run = np.hypot(legs[..., 0], legs[..., 1])
    climb, dive = math.tan(data.max_climb - data.angle_margin), math.tan(data.max_dive - data.angle_margin)
    counts[:, 1] = ((legs[..., 2] > climb * run) | (-legs[..., 2] > dive * run)).sum(axis=1)
    low = np.array([data.west, data.south, data.floor])
    high = np.array([data.east, data.north, data.ceiling])
    counts[:, 3] = ((paths < low) | (paths > high)).any(axis=2).sum(axis=1)
    share = np.arange(POINTS) / POINTS
    points = (paths[:, :-1, None, :] + share[:, None] * legs[:, :, None, :]).reshape(len(paths), -1, 3)
    points = np.concatenate([points, paths[:, -1:]], axis=1)
    col, row = pixels_of(data.to_pixel, paths[..., 0], paths[..., 1])
    places = []
    for one in (col, row):
        between = (one[:, :-1, None] + share * np.diff(one, axis=1)[:, :, None]).reshape(len(paths), -1)
        places.append(np.concatenate([between, one[:, -1:]], axis=1))
    ground = bilinear(data.heights, *places)
    counts[:, 2] = (~(points[..., 2] > ground + data.clearance + data.buffer)).sum(axis=1)
    threats = data.threats
    offset = points[:, :, None, :] - np.stack([threats["east"], threats["north"], threats["up"]], axis=1)
    squared = (offset**2).sum(axis=-1)
    near = np.maximum(squared, MIN_RANGE_M * MIN_RANGE_M) ** 2
    for column, kind in ((1, "kill"), (2, "detection")):
        radius, scale = threats[f"{kind}_radius"], threats[f"{kind}_scale"]
        inside = (squared <= radius**2) & (radius > 0.0)
        objectives[:, column] = np.where(inside, scale**4 / near, 0.0).sum(axis=(1, 2))
    objectives[:, 0] = np.sqrt((legs**2).sum(axis=2)).sum(axis=1) / np.linalg.norm(data.destination - data.start)
    above = np.where(np.isnan(ground), 0.0, np.maximum(0.0, points[..., 2] - ground))
    objectives[:, 3] = above[:, :-1].sum(axis=1) / POINTS
    return counts, objectives


@njit
def _bilinear_at(heights: NDArray[np.float32], col: float, row: float) -> float:
    """Return the height at pixel coordinates; NaN outside the raster."""
    rows, cols = heights.shape
    if not (
        -EDGE_TOLERANCE <= col <= cols - 1 + EDGE_TOLERANCE and -EDGE_TOLERANCE <= row <= rows - 1 + EDGE_TOLERANCE
    ):
        return math.nan
    i, j = min(int(row), rows - 2), min(int(col), cols - 2)
    v, u = row - i, col - j
    top = heights[i, j] * (1.0 - u) + heights[i, j + 1] * u
    low = heights[i + 1, j] * (1.0 - u) + heights[i + 1, j + 1] * u
    return float(top * (1.0 - v) + low * v)


@njit
def _exposures_at(threats: Records, point: Floats, out: Floats) -> None:
    """Add the kill and detection exposure at a point to `out`."""
    for k in range(threats.shape[0]):
        unit = threats[k]
        d2 = (point[0] - unit.east) ** 2 + (point[1] - unit.north) ** 2 + (point[2] - unit.up) ** 2
        near = max(d2, MIN_RANGE_M * MIN_RANGE_M) ** 2
        if unit.kill_radius > 0.0 and d2 <= unit.kill_radius**2:
            out[1] += unit.kill_scale**4 / near
        if unit.detection_radius > 0.0 and d2 <= unit.detection_radius**2:
            out[2] += unit.detection_scale**4 / near


class _Limits(NamedTuple):
    """Largest turn (rad), tangents of climb and dive, required clearance and straight distance (m)."""

    max_turn: float
    climb: float
    dive: float
    clearance: float
    straight: float


@njit
def _brute(
    paths: Floats,
    cols: Floats,
    rows: Floats,
    heights: NDArray[np.float32],
    threats: Records,
    low: Floats,
    high: Floats,
    limits: _Limits,
) -> tuple[Ints, Floats]:
    """Score paths with every unit tested at every point; cols, rows: pixels of their waypoints."""
    number, count, _ = paths.shape
    counts, objectives = np.zeros((number, 4), dtype=np.int64), np.zeros((number, 4))
    point = np.empty(3)
    for n in range(number):
        path = paths[n]
        for i in range(count):
            if (path[i] < low).any() or (path[i] > high).any():
                counts[n, 3] += 1
        for i in range(count - 1):
            ux, uy, rise = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 2] - path[i, 2]
            run = math.hypot(ux, uy)
            if rise > limits.climb * run or -rise > limits.dive * run:
                counts[n, 1] += 1
            objectives[n, 0] += math.sqrt(ux * ux + uy * uy + rise * rise) / limits.straight
            if i > 0:
                bx, by = path[i, 0] - path[i - 1, 0], path[i, 1] - path[i - 1, 1]
                if math.atan2(abs(bx * uy - by * ux), bx * ux + by * uy + 0.0) > limits.max_turn:
                    counts[n, 0] += 1
            for j in range(POINTS + (i == count - 2)):
                f = j / POINTS
                for axis in range(3):
                    point[axis] = path[i, axis] + f * (path[i + 1, axis] - path[i, axis])
                col = cols[n, i] + f * (cols[n, i + 1] - cols[n, i])
                row = rows[n, i] + f * (rows[n, i + 1] - rows[n, i])
                ground = _bilinear_at(heights, col, row)
                if not point[2] > ground + limits.clearance:
                    counts[n, 2] += 1
                if j < POINTS and not math.isnan(ground):
                    objectives[n, 3] += max(0.0, point[2] - ground) / POINTS
                _exposures_at(threats, point, objectives[n])
    return counts, objectives


def brute_scores(data: ProblemArrays, paths: Floats) -> tuple[Ints, Floats]:
    """Return counts (n, 4) and objectives (n, 4) of paths (n, w, 3).

    The code is compiled, and uses no lists of near threats.
    """
    cols, rows = pixels_of(data.to_pixel, paths[..., 0], paths[..., 1])
    low = np.array([data.west, data.south, data.floor])
    high = np.array([data.east, data.north, data.ceiling])
    straight = float(np.linalg.norm(data.destination - data.start))
    slopes = math.tan(data.max_climb - data.angle_margin), math.tan(data.max_dive - data.angle_margin)
    limits = _Limits(data.max_turn, *slopes, data.clearance + data.buffer, straight)
    return _brute(paths, cols, rows, data.heights, data.threats, low, high, limits)


@njit
def _prefers(u: Floats, v: Floats, columns: Ints, goals: Floats, ends: Ints) -> bool:
    """Return True if u is preferred to v, by definition (see `planner.optimisers.preference`).

    columns, goals: columns and goals of all levels, one level after another.
    ends: index in `columns` after the last column of each level.
    """
    begin = 0
    for level in range(ends.size):
        better, worse, equal, open_goal, better_in, worse_in = False, False, True, False, False, False
        for k in range(begin, ends[level]):
            a, b = u[columns[k]], v[columns[k]]
            if a > goals[k]:
                better |= a < b
                worse |= a > b
                equal &= a == b
            else:
                open_goal |= b > goals[k]
                better_in |= a < b
                worse_in |= a > b
        begin = ends[level]
        if not equal:
            return better and not worse
        if open_goal:
            return True
        if level == ends.size - 1:
            return better_in and not worse_in
    return False


@njit
def _count_preferred(scores: Floats, columns: Ints, goals: Floats, ends: Ints) -> Ints:
    """Count, for each row of scores, the rows that are preferred to it."""
    out = np.zeros(scores.shape[0], dtype=np.int64)
    for u in range(scores.shape[0]):
        for v in range(scores.shape[0]):
            out[v] += _prefers(scores[u], scores[v], columns, goals, ends)
    return out


def _flat(levels: Sequence[Level]) -> tuple[Ints, Floats, Ints]:
    """Return columns and goals of all levels, one level after another, and the index after each level."""
    columns = np.array([column for level in levels for column in level.columns])
    goals = np.array([goal for level in levels for goal in level.goals])
    return columns, goals, np.cumsum([len(level.columns) for level in levels])


def preferred(u: Floats, v: Floats, levels: Sequence[Level]) -> bool:
    """Return True if the score row u (c,) is preferred to v by definition."""
    return bool(_prefers(u, v, *_flat(levels)))


def ranks_by_definition(scores: Floats, levels: Sequence[Level]) -> Ints:
    """Count the rows preferred to each row (n, c) -> (n,), pair by pair, O(n^2)."""
    return np.asarray(_count_preferred(scores, *_flat(levels)))
