"""Pattern search that shortens one path by moves of single waypoints and of neighbouring groups.

After Hooke and Jeeves ("Direct search", Journal of the ACM 8, 1961), over a basis of triangular displacements of
several widths. Sampling finds the route around the obstacles; this local search finds the last percent of its length
with fewer evaluations. It minimises the length ratio plus priced violations.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import Encoding, WaypointFrames, frames_of
from planner.evaluation.graded_scores import PathScratch, make_scratch, score_path
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits
from planner.evaluation.problem import OBJECTIVES, VIOLATIONS, ProblemArrays
from planner.plan import Objective
from world.kernels import Record, Records, compiled, copy_into, inner

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Prices of violations, in length ratios per unit of turn (rad), slope, terrain (m x km), bounds (m) and exposure.
TURN_PRICE, SLOPE_PRICE, TERRAIN_PRICE, BOUNDS_PRICE, EXPOSURE_PRICE = 2.0, 20.0, 0.5, 1.0, 5.0
# Price of any exposure at all: a sphere that is barely entered has almost none.
EXPOSED = 0.002
# Initial steps: along and across as shares of the interval between waypoints; up in m.
FIRST_ALONG, FIRST_ACROSS, FIRST_UP = 0.2, 0.15, 25.0
# Smallest step of a move, as a share of its initial step.
MIN_STEP = 0.002


class _Found(NamedTuple):
    """Best feasible vector (d,) (inf if none), the vector with the lowest merit, and whether they are the same."""

    feasible: Floats
    cheapest: Floats
    same: bool
    evaluations: int


class _Box(NamedTuple):
    """Bounds (d,) of vectors."""

    lower: Floats
    upper: Floats


class _Candidate(NamedTuple):
    """A path (w, 3), its `VIOLATIONS` and `OBJECTIVES` records (1,), and scratch for evaluating it."""

    path: Floats
    violations: Records
    objectives: Records
    scratch: PathScratch


def search_patterns(data: ProblemArrays, encoding: Encoding, vector: Floats, evaluations: int) -> tuple[Floats, int]:
    """Shorten a path of the rotated encoding.

    vector: (d,). evaluations: maximum number. Returns the best vectors (k, d), namely the best feasible one, if any,
    and the one with the lowest merit; and the number of evaluations made.
    """
    frames = frames_of(encoding)
    inner = encoding.waypoints - 2
    span = float(frames.edges[-1]) / inner
    moves, axes = _triangular_basis(inner)
    steps = np.array([FIRST_ALONG * span, FIRST_ACROSS * span, FIRST_UP])[axes]
    start = np.array(vector, dtype=np.float64)
    found = _search(data, frames, _Box(encoding.lower, encoding.upper), start, moves, steps, evaluations)
    if found.same:
        vectors = [found.feasible]
    elif math.isinf(found.feasible[0]):
        vectors = [found.cheapest]
    else:
        vectors = [found.feasible, found.cheapest]
    return np.array(vectors), int(found.evaluations)


def merits(scores: Floats) -> Floats:
    """Merits (n,), which the search minimises, of scores (n, 8) by `planner.plan.Violation` and `Objective`."""
    prices = np.array([TURN_PRICE, SLOPE_PRICE, TERRAIN_PRICE, BOUNDS_PRICE])
    count = len(prices)
    ratio, exposure = scores[:, count + Objective.LENGTH_RATIO], scores[:, count + Objective.KILL_EXPOSURE]
    violated = (scores[:, :count] * prices).sum(axis=1)
    return np.asarray(ratio + violated + EXPOSURE_PRICE * exposure + EXPOSED * (exposure > 0.0))


@cache
def _triangular_basis(inner: int) -> tuple[Floats, Ints]:
    """Moves (k, 3 inner): triangles with half-widths of 1, 2, 4, ... waypoints; and the axis (k,) of each."""
    rows: list[Floats] = []
    axes: list[int] = []
    place = np.arange(inner, dtype=np.float64)
    width = 1
    while width <= max(1, inner // 2):
        for centre in np.arange(0.0, inner, max(1.0, width / 2)):
            triangle = np.maximum(0.0, 1.0 - np.abs(place - centre) / width)
            for axis in range(3):
                if axis == 0 and width > 1:
                    continue
                move = np.zeros((inner, 3))
                move[:, axis] = triangle
                rows.append(move.ravel())
                axes.append(axis)
        width *= 2
    return np.array(rows), np.array(axes)


@inner
def _make_candidate(data: ProblemArrays, waypoints: int) -> _Candidate:  # pragma: no cover - compiled
    path = np.empty((waypoints, 3))
    copy_into(path[0], data.start)
    copy_into(path[-1], data.destination)
    return _Candidate(path, np.zeros(1, dtype=VIOLATIONS), np.zeros(1, dtype=OBJECTIVES), make_scratch(waypoints))


@inner
def _merit(
    data: ProblemArrays, limits: PrecomputedLimits, frames: WaypointFrames, vector: Floats, candidate: _Candidate
) -> tuple[float, bool]:  # pragma: no cover - compiled
    """Length ratio plus priced violations, and whether the path is feasible."""
    path, inner = candidate.path, vector.reshape((vector.size // 3, 3))
    for i in range(inner.shape[0]):
        along, across = inner[i, 0], inner[i, 1]
        path[i + 1, 0] = frames.east[i] + frames.cosine[i] * along - frames.sine[i] * across
        path[i + 1, 1] = frames.north[i] + frames.sine[i] * along + frames.cosine[i] * across
        path[i + 1, 2] = inner[i, 2]
    violations, objectives = candidate.violations[0], candidate.objectives[0]
    violations.turn, violations.slope, violations.terrain, violations.bounds = 0.0, 0.0, 0.0, 0.0
    score_path(data, limits, candidate.scratch, path, violations, objectives)
    return _price(violations, objectives)


@inner
def _price(violations: Record, objectives: Record) -> tuple[float, bool]:  # pragma: no cover - compiled
    price, feasible = EXPOSURE_PRICE * objectives.kill_exposure, True
    if objectives.kill_exposure > 0.0:
        price += EXPOSED
        feasible = False
    price += TURN_PRICE * violations.turn
    price += SLOPE_PRICE * violations.slope
    price += TERRAIN_PRICE * violations.terrain
    price += BOUNDS_PRICE * violations.bounds
    feasible = feasible and violations.turn == 0.0 and violations.slope == 0.0
    feasible = feasible and violations.terrain == 0.0 and violations.bounds == 0.0
    return objectives.length_ratio + price, feasible


@compiled
def _search(
    data: ProblemArrays,
    frames: WaypointFrames,
    box: _Box,
    start: Floats,
    moves: Floats,
    steps: Floats,
    max_evaluations: int,
) -> _Found:  # pragma: no cover - compiled
    """Search from a vector (d,) with moves (k, d) of these initial steps (k,), which it modifies."""
    limits, candidate = precompute_limits(data), _make_candidate(data, start.size // 3 + 2)
    feasible = np.full(start.size, np.inf)
    here, trial, before = start.copy(), start.copy(), start.copy()
    best, fit = _merit(data, limits, frames, here, candidate)
    shortest = best if fit else math.inf
    if fit:
        copy_into(feasible, here)
    made = 1
    first = steps.copy()
    while made < max_evaluations:
        alive = False
        copy_into(before, here)
        # The last trial of a round repeats the displacement of the whole round (pattern move).
        for k in range(moves.shape[0] + 1):
            if made >= max_evaluations or (k < moves.shape[0] and abs(steps[k]) < MIN_STEP * first[k]):
                continue
            better = False
            for _ in range(2):
                for d in range(start.size):
                    step = steps[k] * moves[k, d] if k < moves.shape[0] else here[d] - before[d]
                    trial[d] = min(box.upper[d], max(box.lower[d], here[d] + step))
                merit, fit = _merit(data, limits, frames, trial, candidate)
                made += 1
                if fit and merit < shortest:
                    shortest = merit
                    copy_into(feasible, trial)
                if merit < best:
                    best, better = merit, True
                    copy_into(here, trial)
                    break
                if k == moves.shape[0]:
                    break
                steps[k] = -steps[k]
            if k < moves.shape[0]:
                steps[k] *= 1.5 if better else 0.5
                alive = True
        if not alive:
            break
    return _Found(feasible, here, shortest <= best, made)
