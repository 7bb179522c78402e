"""What our compiled judge and ranking are measured against: vectorised NumPy, and compiled brute force.

Both are written from the paper's equations and the conventions of `planner.evaluation.paper_scores.paper_scores`, and
agree with it to 1e-12; they serve problems whose limits are numbers and whose ends have no course.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.evaluation.problem_arrays import Rules
from world.frames import PolyMapRecord
from world.geometry import CLOSEST
from world.terrain import EDGE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POINTS = 6


def pixels_of(to_pixel: PolyMapRecord, east: Floats, north: Floats) -> tuple[Floats, Floats]:
    """Pixel coordinates of map positions: the polynomial, vectorised."""
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
    """Heights at pixel coordinates; NaN outside the raster."""
    rows, cols = heights.shape
    inside = (col >= -EDGE) & (col <= cols - 1 + EDGE) & (row >= -EDGE) & (row <= rows - 1 + EDGE)
    i = np.clip(row.astype(np.int64), 0, heights.shape[0] - 2)
    j = np.clip(col.astype(np.int64), 0, heights.shape[1] - 2)
    v, u = row - i, col - j
    top = heights[i, j] * (1.0 - u) + heights[i, j + 1] * u
    low = heights[i + 1, j] * (1.0 - u) + heights[i + 1, j + 1] * u
    return np.where(inside, top * (1.0 - v) + low * v, np.nan)


def numpy_scores(rules: Rules, paths: Floats) -> tuple[Ints, Floats]:
    """Counts (n, 4) and objectives (n, 4) of paths (n, w, 3): one vectorised batch over all of them (eq. 1-11)."""
    legs = np.diff(paths, axis=1)
    counts, objectives = np.empty((len(paths), 4), dtype=np.int64), np.empty((len(paths), 4))
    cross = legs[:, :-1, 0] * legs[:, 1:, 1] - legs[:, :-1, 1] * legs[:, 1:, 0]
    dot = legs[:, :-1, 0] * legs[:, 1:, 0] + legs[:, :-1, 1] * legs[:, 1:, 1]
    counts[:, 0] = (np.arctan2(np.abs(cross), dot + 0.0) > rules.max_turn).sum(axis=1)
    run = np.hypot(legs[..., 0], legs[..., 1])
    climb, dive = math.tan(rules.climb - rules.spare), math.tan(rules.dive - rules.spare)
    counts[:, 1] = ((legs[..., 2] > climb * run) | (-legs[..., 2] > dive * run)).sum(axis=1)
    low = np.array([rules.bounds[0, 0], rules.bounds[1, 0], rules.floor])
    high = np.array([rules.bounds[0, 1], rules.bounds[1, 1], rules.ceiling])
    counts[:, 3] = ((paths < low) | (paths > high)).any(axis=2).sum(axis=1)
    share = np.arange(POINTS) / POINTS
    points = (paths[:, :-1, None, :] + share[:, None] * legs[:, :, None, :]).reshape(len(paths), -1, 3)
    points = np.concatenate([points, paths[:, -1:]], axis=1)
    col, row = pixels_of(rules.to_pixel, paths[..., 0], paths[..., 1])
    places = []
    for one in (col, row):
        between = (one[:, :-1, None] + share * np.diff(one, axis=1)[:, :, None]).reshape(len(paths), -1)
        places.append(np.concatenate([between, one[:, -1:]], axis=1))
    ground = bilinear(rules.heights, *places)
    counts[:, 2] = (~(points[..., 2] > ground + rules.clearance + rules.reserve)).sum(axis=1)
    offset = points[:, :, None, :] - rules.threats[None, None, :, :3]
    squared = (offset**2).sum(axis=-1)
    near = np.maximum(squared, CLOSEST * CLOSEST) ** 2
    for column in (3, 5):
        radius, scale = rules.threats[:, column], rules.threats[:, column + 1]
        inside = (squared <= radius**2) & (radius > 0.0)
        objectives[:, column // 2] = np.where(inside, scale**4 / near, 0.0).sum(axis=(1, 2))
    objectives[:, 0] = np.sqrt((legs**2).sum(axis=2)).sum(axis=1) / np.linalg.norm(rules.destination - rules.start)
    above = np.where(np.isnan(ground), 0.0, np.maximum(0.0, points[..., 2] - ground))
    objectives[:, 3] = above[:, :-1].sum(axis=1) / POINTS
    return counts, objectives


@njit
def _bilinear_at(heights: NDArray[np.float32], col: float, row: float) -> float:
    rows, cols = heights.shape
    if not (-EDGE <= col <= cols - 1 + EDGE and -EDGE <= row <= rows - 1 + EDGE):
        return math.nan
    i, j = min(int(row), rows - 2), min(int(col), cols - 2)
    v, u = row - i, col - j
    top = heights[i, j] * (1.0 - u) + heights[i, j + 1] * u
    low = heights[i + 1, j] * (1.0 - u) + heights[i + 1, j + 1] * u
    return float(top * (1.0 - v) + low * v)


@njit
def _exposures_at(units: Floats, point: Floats, out: Floats) -> None:
    for k in range(units.shape[0]):
        d2 = (point[0] - units[k, 0]) ** 2 + (point[1] - units[k, 1]) ** 2 + (point[2] - units[k, 2]) ** 2
        near = max(d2, CLOSEST * CLOSEST) ** 2
        if units[k, 3] > 0.0 and d2 <= units[k, 3] ** 2:
            out[1] += units[k, 4] ** 4 / near
        if units[k, 5] > 0.0 and d2 <= units[k, 5] ** 2:
            out[2] += units[k, 6] ** 4 / near


@njit
def _brute(
    paths: Floats,
    cols: Floats,
    rows: Floats,
    heights: NDArray[np.float32],
    units: Floats,
    box: Floats,
    limits: Floats,
) -> tuple[Ints, Floats]:
    """Compiled, every unit at every point.  limits: max_turn, tan climb, tan dive, clearance, straight length."""
    number, count, _ = paths.shape
    counts, objectives = np.zeros((number, 4), dtype=np.int64), np.zeros((number, 4))
    point = np.empty(3)
    for n in range(number):
        way = paths[n]
        for i in range(count):
            if (way[i] < box[0]).any() or (way[i] > box[1]).any():
                counts[n, 3] += 1
        for i in range(count - 1):
            ux, uy, rise = way[i + 1, 0] - way[i, 0], way[i + 1, 1] - way[i, 1], way[i + 1, 2] - way[i, 2]
            run = math.hypot(ux, uy)
            if rise > limits[1] * run or -rise > limits[2] * run:
                counts[n, 1] += 1
            objectives[n, 0] += math.sqrt(ux * ux + uy * uy + rise * rise) / limits[4]
            if i > 0:
                bx, by = way[i, 0] - way[i - 1, 0], way[i, 1] - way[i - 1, 1]
                if math.atan2(abs(bx * uy - by * ux), bx * ux + by * uy + 0.0) > limits[0]:
                    counts[n, 0] += 1
            for j in range(POINTS + (i == count - 2)):
                f = j / POINTS
                for axis in range(3):
                    point[axis] = way[i, axis] + f * (way[i + 1, axis] - way[i, axis])
                col = cols[n, i] + f * (cols[n, i + 1] - cols[n, i])
                row = rows[n, i] + f * (rows[n, i + 1] - rows[n, i])
                ground = _bilinear_at(heights, col, row)
                if not point[2] > ground + limits[3]:
                    counts[n, 2] += 1
                if j < POINTS and not math.isnan(ground):
                    objectives[n, 3] += max(0.0, point[2] - ground) / POINTS
                _exposures_at(units, point, objectives[n])
    return counts, objectives


def brute_scores(rules: Rules, paths: Floats) -> tuple[Ints, Floats]:
    """Do the same, compiled, without lists of near threats."""
    cols, rows = pixels_of(rules.to_pixel, paths[..., 0], paths[..., 1])
    low = [rules.bounds[0, 0], rules.bounds[1, 0], rules.floor]
    high = [rules.bounds[0, 1], rules.bounds[1, 1], rules.ceiling]
    straight = float(np.linalg.norm(rules.destination - rules.start))
    slopes = math.tan(rules.climb - rules.spare), math.tan(rules.dive - rules.spare)
    limits = np.array([rules.max_turn, *slopes, rules.clearance + rules.reserve, straight])
    return _brute(paths, cols, rows, rules.heights, rules.threats, np.array([low, high]), limits)


@njit
def _generic(scores: Floats, columns: Ints, goals: Floats, ends: Ints) -> Ints:
    """Count the rows preferred to each row by the relation as it is defined, pair by pair, O(n^2)."""
    count = scores.shape[0]
    out = np.zeros(count, dtype=np.int64)
    for u in range(count):
        for v in range(count):
            begin = 0
            for level in range(ends.size):
                better, worse, equal, open_goal, better_in, worse_in = False, False, True, False, False, False
                for k in range(begin, ends[level]):
                    a, b = scores[u, columns[k]], scores[v, columns[k]]
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
                    out[v] += better and not worse
                    break
                if open_goal:
                    out[v] += 1
                    break
                if level == ends.size - 1:
                    out[v] += better_in and not worse_in
    return out


def compiled_generic_ranks(scores: Floats, levels: tuple[tuple[tuple[int, ...], tuple[float, ...]], ...]) -> Ints:
    """Ranks (n,) of rows (n, c); levels: columns and goals of each."""
    columns = np.array([column for own, _ in levels for column in own])
    goals = np.array([goal for _, own in levels for goal in own])
    return _generic(scores, columns, goals, np.cumsum([len(own) for own, _ in levels]))
