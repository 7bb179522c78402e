"""Shorten one path by a pattern search with moves of single waypoints and of neighbouring groups.

After Hooke and Jeeves ("Direct search", Journal of the ACM 8, 1961), over a basis of triangular displacements of
several widths. Sampling finds the route around the obstacles; this local search finds the last percent of its length
with fewer evaluations. It minimises the merit of the path: its length ratio plus a price for its violations.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from planner.evaluation.encoding import Encoding, WaypointFrames, require_frames
from planner.evaluation.graded_scores import (
    PathScratch,
    make_scratch,
    score_airspace,
    score_ground,
    score_legs,
    score_missiles,
)
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits
from planner.evaluation.problem import OBJECTIVES, VIOLATIONS, ProblemArrays
from planner.plan import Objective
from world.arrays import Floats, Ints
from world.kernels import Record, Records, compiled, copy_into, inner

# Price of a turn violation, length ratio per rad.
TURN_PRICE = 2.0
# Price of a slope violation, length ratio per unit of slope.
SLOPE_PRICE = 20.0
# Price of a terrain violation, length ratio per m·km.
TERRAIN_PRICE = 0.5
# Price of a bounds violation, length ratio per m.
BOUNDS_PRICE = 1.0
# Price of exposure, length ratio per unit of exposure.
EXPOSURE_PRICE = 5.0
# Price of any exposure at all: a sphere that is barely entered has almost none.
ANY_EXPOSURE_PRICE = 0.002
# Initial step along, as a fraction of the interval between waypoints.
FIRST_STEP_ALONG_FRACTION = 0.2
# Initial step across, as a fraction of the interval between waypoints.
FIRST_STEP_ACROSS_FRACTION = 0.15
# Initial step up, m.
FIRST_STEP_UP_M = 25.0
# Smallest step of a move, as a fraction of its initial step.
MIN_SCALE = 0.002


# Number of evaluations between two calls of `must_end`: some 20 ms at most.
EVALUATIONS_PER_CHECK = 150


class _State(NamedTuple):
    """State of a pattern search; vectors are (d,).

    In a round every move is tried once. The merit of a path is its length ratio plus a price for its violations; lower
    is better.

    best_vector, best_merit: vector with the lowest merit.
    feasible_vector, feasible_merit: vector with the lowest merit among those without violations; the merit is inf if
        there is none.
    round_start: vector at the beginning of the round.
    steps: (k,) present size of each move, with its sign.
    move: next move of the round.
    has_moved: True if a move was tried in the round.
    evaluations: number of evaluations.
    is_done: True if all moves have become too small, or the maximum number of evaluations is reached.
    """

    best_vector: Floats
    best_merit: float
    feasible_vector: Floats
    feasible_merit: float
    round_start: Floats
    steps: Floats
    move: int
    has_moved: bool
    evaluations: int
    is_done: bool


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


def search_patterns(
    data: ProblemArrays,
    encoding: Encoding,
    vector: Floats,
    evaluations: int,
    must_end: Callable[[], bool] = lambda: False,
) -> tuple[Floats, int]:
    """Shorten a path of the rotated encoding; return vectors (k, d) and the number of evaluations.

    vector: the path, (d,).
    evaluations: maximum number of evaluations.
    must_end: called after every `EVALUATIONS_PER_CHECK` evaluations; if it returns True, the search ends with its
        present result.

    Single waypoints and groups of neighbours are moved in turn, along one axis at a time. A move that lowers the merit
    (the length ratio plus priced violations) is kept, and its step grows; otherwise its step shrinks and changes sign.

    The vectors are the best feasible vector, if there is one, and the vector with the lowest merit, if it is another
    one.
    """
    frames = require_frames(encoding)
    inner_count = encoding.waypoints - 2
    interval = float(frames.edges[-1]) / inner_count
    moves, axes = _triangular_basis(inner_count)
    steps = np.array([FIRST_STEP_ALONG_FRACTION * interval, FIRST_STEP_ACROSS_FRACTION * interval, FIRST_STEP_UP_M])[
        axes
    ]
    start = np.array(vector, dtype=np.float64)
    box, initial_steps = _Box(encoding.lower, encoding.upper), steps.copy()
    state: _State = _begin_search(data, frames, start, steps)
    while not state.is_done:
        next_check = min(evaluations, state.evaluations + EVALUATIONS_PER_CHECK)
        state = _continue_search(data, frames, box, moves, initial_steps, state, next_check, evaluations)
        if not state.is_done and must_end():
            break
    if state.feasible_merit <= state.best_merit:
        vectors = [state.feasible_vector]
    elif math.isinf(state.feasible_vector[0]):
        vectors = [state.best_vector]
    else:
        vectors = [state.feasible_vector, state.best_vector]
    return np.array(vectors), int(state.evaluations)


def merits(scores: Floats) -> Floats:
    """Return the merit of each row of scores (n, 8), (n,): length ratio plus priced violations.

    The columns of the scores are those of `planner.plan.Violation` and then of `planner.plan.Objective`.
    """
    prices = np.array([TURN_PRICE, SLOPE_PRICE, TERRAIN_PRICE, BOUNDS_PRICE])
    count = len(prices)
    length_ratio, exposure = scores[:, count + Objective.LENGTH_RATIO], scores[:, count + Objective.KILL_EXPOSURE]
    violation_price = (scores[:, :count] * prices).sum(axis=1)
    return np.asarray(
        length_ratio + violation_price + EXPOSURE_PRICE * exposure + ANY_EXPOSURE_PRICE * (exposure > 0.0)
    )


@cache
def _triangular_basis(inner_count: int) -> tuple[Floats, Ints]:
    """Return the moves of a search, (k, 3 inner_count), and the axis of each, (k,).

    A move displaces one waypoint by 1 and its neighbours by less, in the shape of a triangle with a half-width of 1, 2,
    4, ... waypoints. The axis is 0 for along, 1 for across and 2 for up; along, only single waypoints are moved.
    """
    moves: list[Floats] = []
    axes: list[int] = []
    positions = np.arange(inner_count, dtype=np.float64)
    width = 1
    while width <= max(1, inner_count // 2):
        for centre in np.arange(0.0, inner_count, max(1.0, width / 2)):
            triangle = np.maximum(0.0, 1.0 - np.abs(positions - centre) / width)
            for axis in range(3):
                if axis == 0 and width > 1:
                    continue
                move = np.zeros((inner_count, 3))
                move[:, axis] = triangle
                moves.append(move.ravel())
                axes.append(axis)
        width *= 2
    return np.array(moves), np.array(axes)


@inner
def _make_candidate(data: ProblemArrays, waypoints: int) -> _Candidate:
    """Make a candidate path of a number of waypoints, with its ends set, and working memory to score it."""
    path = np.empty((waypoints, 3))
    copy_into(path[0], data.start)
    copy_into(path[-1], data.destination)
    return _Candidate(path, np.zeros(1, dtype=VIOLATIONS), np.zeros(1, dtype=OBJECTIVES), make_scratch(waypoints))


@inner
def _evaluate_merit(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    frames: WaypointFrames,
    vector: Floats,
    candidate: _Candidate,
    best_merit: float,
    feasible_merit: float,
) -> tuple[float, bool]:
    """Return the merit of a vector (length ratio plus priced violations), and True if it is feasible.

    frames: origin and rotation of the frame in which each waypoint moves.
    vector: (3 n,) along, across and altitude of the n inner waypoints in their frames, m.
    candidate: working memory; its path is overwritten with the waypoints, and its records with the scores.
    best_merit, feasible_merit: merits above which a vector is of no use, for any vector and for a feasible one.

    Each part of the evaluation only adds to the merit. Therefore the evaluation ends as soon as the merit reaches
    `best_merit` and, if the path is feasible so far, also `feasible_merit`. The returned merit is then a lower bound.
    """
    path, waypoints, scratch = candidate.path, vector.reshape((vector.size // 3, 3)), candidate.scratch
    for i in range(waypoints.shape[0]):
        along, across = waypoints[i, 0], waypoints[i, 1]
        path[i + 1, 0] = frames.east[i] + frames.cosine[i] * along - frames.sine[i] * across
        path[i + 1, 1] = frames.north[i] + frames.sine[i] * along + frames.cosine[i] * across
        path[i + 1, 2] = waypoints[i, 2]
    violations, objectives = candidate.violations[0], candidate.objectives[0]
    violations.turn, violations.slope, violations.terrain, violations.bounds = 0.0, 0.0, 0.0, 0.0
    score_legs(data, limits, scratch, path, violations, objectives)
    merit, is_feasible = _merit_of_scores(violations, objectives)
    if merit >= best_merit and (merit >= feasible_merit or not is_feasible):
        return merit, is_feasible
    score_ground(data, limits, scratch, path, violations)
    merit, is_feasible = _merit_of_scores(violations, objectives)
    if merit >= best_merit and (merit >= feasible_merit or not is_feasible):
        return merit, is_feasible
    score_missiles(data, limits, scratch, path, violations, objectives)
    merit, is_feasible = _merit_of_scores(violations, objectives)
    if merit >= best_merit and (merit >= feasible_merit or not is_feasible):
        return merit, is_feasible
    score_airspace(data, scratch, path, violations)
    return _merit_of_scores(violations, objectives)


@inner
def _merit_of_scores(violations: Record, objectives: Record) -> tuple[float, bool]:
    """Return the merit of a path (length ratio plus priced violations), and True if it has no violation.

    violations, objectives: `VIOLATIONS` and `OBJECTIVES` records of the path.
    """
    price, is_feasible = EXPOSURE_PRICE * objectives.kill_exposure, True
    if objectives.kill_exposure > 0.0:
        price += ANY_EXPOSURE_PRICE
        is_feasible = False
    price += TURN_PRICE * violations.turn
    price += SLOPE_PRICE * violations.slope
    price += TERRAIN_PRICE * violations.terrain
    price += BOUNDS_PRICE * violations.bounds
    is_feasible = is_feasible and violations.turn == 0.0 and violations.slope == 0.0
    is_feasible = is_feasible and violations.terrain == 0.0 and violations.bounds == 0.0
    return objectives.length_ratio + price, is_feasible


@compiled
def _begin_search(data: ProblemArrays, frames: WaypointFrames, start: Floats, steps: Floats) -> _State:
    """Return the state of a new search that starts at a vector (d,).

    frames: origin and rotation of the frame in which each waypoint moves.
    start: (d,) along, across and altitude of each inner waypoint in its frame, m.
    steps: (k,) initial size of each move; the search changes this array.
    """
    limits, candidate = precompute_limits(data), _make_candidate(data, start.size // 3 + 2)
    best_merit, is_feasible = _evaluate_merit(data, limits, frames, start, candidate, math.inf, math.inf)
    feasible_vector = np.full(start.size, np.inf)
    if is_feasible:
        copy_into(feasible_vector, start)
    return _State(
        start,
        best_merit,
        feasible_vector,
        best_merit if is_feasible else math.inf,
        start.copy(),
        steps,
        0,
        False,
        1,
        False,
    )


@inner
def _fill_trial(
    box: _Box, moves: Floats, k: int, steps: Floats, round_start: Floats, vector: Floats, trial: Floats
) -> None:
    """Apply move k to a vector (d,), clip the result to the box, and fill `trial` (d,) with it.

    If k is one more than the last move, the displacement of the whole round is repeated instead.

    moves, steps: moves, (n, d), and the size of each, (n,).
    round_start: (d,) vector at the beginning of the round.
    """
    for d in range(vector.size):
        step = steps[k] * moves[k, d] if k < moves.shape[0] else vector[d] - round_start[d]
        trial[d] = min(box.upper[d], max(box.lower[d], vector[d] + step))


@compiled
def _continue_search(
    data: ProblemArrays,
    frames: WaypointFrames,
    box: _Box,
    moves: Floats,
    initial_steps: Floats,
    state: _State,
    next_check: int,
    max_evaluations: int,
) -> _State:
    """Continue a search up to `next_check` evaluations, or to its end; return its state.

    moves, initial_steps: (k, d) moves and (k,) their initial sizes; a move that fails is tried in the other direction.
    state: its vectors are overwritten.

    The search ends at `max_evaluations`, or when all moves are too small.
    """
    best_vector, best_merit, feasible_vector, feasible_merit, round_start, steps, move, has_moved, evaluations, _ = (
        state
    )
    limits = precompute_limits(data)
    candidate = _make_candidate(data, best_vector.size // 3 + 2)
    trial = best_vector.copy()
    while evaluations < max_evaluations:
        if move == 0:
            has_moved = False
            copy_into(round_start, best_vector)
        # The last trial of a round repeats the displacement of the whole round (pattern move).
        for k in range(move, moves.shape[0] + 1):
            if evaluations >= next_check and evaluations < max_evaluations:
                return _State(
                    best_vector,
                    best_merit,
                    feasible_vector,
                    feasible_merit,
                    round_start,
                    steps,
                    k,
                    has_moved,
                    evaluations,
                    False,
                )
            if evaluations >= max_evaluations or (k < moves.shape[0] and abs(steps[k]) < MIN_SCALE * initial_steps[k]):
                continue
            is_better = False
            for _ in range(2):
                _fill_trial(box, moves, k, steps, round_start, best_vector, trial)
                merit, is_feasible = _evaluate_merit(data, limits, frames, trial, candidate, best_merit, feasible_merit)
                evaluations += 1
                if is_feasible and merit < feasible_merit:
                    feasible_merit = merit
                    copy_into(feasible_vector, trial)
                if merit < best_merit:
                    best_merit, is_better = merit, True
                    copy_into(best_vector, trial)
                    break
                if k == moves.shape[0]:
                    break
                steps[k] = -steps[k]
            if k < moves.shape[0]:
                # A successful move grows, an unsuccessful one shrinks.
                steps[k] *= 1.5 if is_better else 0.5
                has_moved = True
        move = 0
        if not has_moved:
            break
    return _State(
        best_vector, best_merit, feasible_vector, feasible_merit, round_start, steps, 0, has_moved, evaluations, True
    )
