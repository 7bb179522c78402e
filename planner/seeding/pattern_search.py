"""Shorten one path by a pattern search with moves of single waypoints and of neighbouring groups.

After Hooke and Jeeves ("Direct search", Journal of the ACM 8, 1961), over a basis of triangular displacements of
several widths. Sampling finds the route around the obstacles; this local search finds the last percent of its length
with fewer evaluations. It minimises the length ratio plus priced violations.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from planner.evaluation.encoding import Encoding, WaypointFrames, frames_of
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
# Price of a terrain violation, length ratio per m x km.
TERRAIN_PRICE = 0.5
# Price of a bounds violation, length ratio per m.
BOUNDS_PRICE = 1.0
# Price of exposure, length ratio per unit of exposure.
EXPOSURE_PRICE = 5.0
# Price of any exposure at all: a sphere that is barely entered has almost none.
EXPOSED = 0.002
# Initial step along, as a fraction of the interval between waypoints.
FIRST_ALONG = 0.2
# Initial step across, as a fraction of the interval between waypoints.
FIRST_ACROSS = 0.15
# Initial step up, m.
FIRST_UP = 25.0
# Smallest step of a move, as a share of its initial step.
MIN_STEP = 0.002


# Evaluations between two questions whether to end: some 20 ms at most.
EVALUATIONS_AT_ONCE = 150


class _State(NamedTuple):
    """A search as far as it has come; vectors are (d,).

    here: with the lowest merit, which is `best`. feasible: the best feasible one (inf if none), of merit `shortest`.
    before: where the round began. steps: (k,) of the moves. move: the next of the round; alive: whether any has been
    tried in it. made: evaluations. ended: True if no move is left.
    """

    here: Floats
    best: float
    feasible: Floats
    shortest: float
    before: Floats
    steps: Floats
    move: int
    alive: bool
    made: int
    ended: bool


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
    """Shorten a path of the rotated encoding.

    vector: (d,). evaluations: maximum number. must_end: called after every `EVALUATIONS_AT_ONCE` evaluations; True
    ends the search with its present result. Return the best vectors (k, d), which are the best feasible vector, if any,
    and the vector with the lowest merit, and the number of evaluations made.
    """
    frames = frames_of(encoding)
    inner = encoding.waypoints - 2
    span = float(frames.edges[-1]) / inner
    moves, axes = _triangular_basis(inner)
    steps = np.array([FIRST_ALONG * span, FIRST_ACROSS * span, FIRST_UP])[axes]
    start = np.array(vector, dtype=np.float64)
    box, first = _Box(encoding.lower, encoding.upper), steps.copy()
    state: _State = _begin_search(data, frames, start, steps)
    while not state.ended:
        until = min(evaluations, state.made + EVALUATIONS_AT_ONCE)
        state = _continue_search(data, frames, box, moves, first, state, until, evaluations)
        if not state.ended and must_end():
            break
    if state.shortest <= state.best:
        vectors = [state.feasible]
    elif math.isinf(state.feasible[0]):
        vectors = [state.here]
    else:
        vectors = [state.feasible, state.here]
    return np.array(vectors), int(state.made)


def merits(scores: Floats) -> Floats:
    """Return the merits (n,) of scores (n, 8) by `planner.plan.Violation` and `Objective`, for minimisation."""
    prices = np.array([TURN_PRICE, SLOPE_PRICE, TERRAIN_PRICE, BOUNDS_PRICE])
    count = len(prices)
    ratio, exposure = scores[:, count + Objective.LENGTH_RATIO], scores[:, count + Objective.KILL_EXPOSURE]
    violated = (scores[:, :count] * prices).sum(axis=1)
    return np.asarray(ratio + violated + EXPOSURE_PRICE * exposure + EXPOSED * (exposure > 0.0))


@cache
def _triangular_basis(inner: int) -> tuple[Floats, Ints]:
    """Return triangular moves with half-widths of 1, 2, 4, ... waypoints, (k, 3 inner), and the axis of each, (k,)."""
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
def _make_candidate(data: ProblemArrays, waypoints: int) -> _Candidate:
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
    best: float,
    shortest: float,
) -> tuple[float, bool]:
    """Return the length ratio plus priced violations, and True if the path is feasible.

    Each part of the evaluation only adds to the merit. The evaluation therefore ends as soon as the merit reaches
    `best`, and `shortest` if the path is still feasible; the returned merit is then a lower bound.
    """
    path, inner, scratch = candidate.path, vector.reshape((vector.size // 3, 3)), candidate.scratch
    for i in range(inner.shape[0]):
        along, across = inner[i, 0], inner[i, 1]
        path[i + 1, 0] = frames.east[i] + frames.cosine[i] * along - frames.sine[i] * across
        path[i + 1, 1] = frames.north[i] + frames.sine[i] * along + frames.cosine[i] * across
        path[i + 1, 2] = inner[i, 2]
    violations, objectives = candidate.violations[0], candidate.objectives[0]
    violations.turn, violations.slope, violations.terrain, violations.bounds = 0.0, 0.0, 0.0, 0.0
    score_legs(data, limits, scratch, path, violations, objectives)
    merit, feasible = _violation_price(violations, objectives)
    if merit >= best and (merit >= shortest or not feasible):
        return merit, feasible
    score_ground(data, limits, scratch, path, violations)
    merit, feasible = _violation_price(violations, objectives)
    if merit >= best and (merit >= shortest or not feasible):
        return merit, feasible
    score_missiles(data, limits, scratch, path, violations, objectives)
    merit, feasible = _violation_price(violations, objectives)
    if merit >= best and (merit >= shortest or not feasible):
        return merit, feasible
    score_airspace(data, scratch, path, violations)
    return _violation_price(violations, objectives)


@inner
def _violation_price(violations: Record, objectives: Record) -> tuple[float, bool]:
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
def _begin_search(data: ProblemArrays, frames: WaypointFrames, start: Floats, steps: Floats) -> _State:
    """Return a new search at a vector (d,), with moves of the initial steps (k,), which the search modifies."""
    limits, candidate = precompute_limits(data), _make_candidate(data, start.size // 3 + 2)
    best, fit = _evaluate_merit(data, limits, frames, start, candidate, math.inf, math.inf)
    feasible = np.full(start.size, np.inf)
    if fit:
        copy_into(feasible, start)
    return _State(start, best, feasible, best if fit else math.inf, start.copy(), steps, 0, False, 1, False)


@inner
def _fill_trial(box: _Box, moves: Floats, k: int, steps: Floats, before: Floats, here: Floats, trial: Floats) -> None:
    """Fill a trial (d,) with the vector after move k, or after the round's whole displacement if there is no move k."""
    for d in range(here.size):
        step = steps[k] * moves[k, d] if k < moves.shape[0] else here[d] - before[d]
        trial[d] = min(box.upper[d], max(box.lower[d], here[d] + step))


@compiled
def _continue_search(
    data: ProblemArrays,
    frames: WaypointFrames,
    box: _Box,
    moves: Floats,
    first: Floats,
    state: _State,
    until: int,
    max_evaluations: int,
) -> _State:
    """Continue a search, with moves (k, d) of initial steps `first` (k,), for at least `max_evaluations`."""
    here, best, feasible, shortest, before, steps, move, alive, made, _ = state
    limits, candidate, trial = precompute_limits(data), _make_candidate(data, here.size // 3 + 2), here.copy()
    while made < max_evaluations:
        if move == 0:
            alive = False
            copy_into(before, here)
        # The last trial of a round repeats the displacement of the whole round (pattern move).
        for k in range(move, moves.shape[0] + 1):
            if made >= until and made < max_evaluations:
                return _State(here, best, feasible, shortest, before, steps, k, alive, made, False)
            if made >= max_evaluations or (k < moves.shape[0] and abs(steps[k]) < MIN_STEP * first[k]):
                continue
            better = False
            for _ in range(2):
                _fill_trial(box, moves, k, steps, before, here, trial)
                merit, fit = _evaluate_merit(data, limits, frames, trial, candidate, best, shortest)
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
        move = 0
        if not alive:
            break
    return _State(here, best, feasible, shortest, before, steps, 0, alive, made, True)
