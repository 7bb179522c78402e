"""Shortening: a path pulled taut under its constraints, all waypoints at once and free of their intervals.

A grid, a population or a moving of places finds the side of the obstacles on which to pass; how short a path is there
is a smooth problem in all coordinates, which Newton's steps solve in a millisecond or two
(`planner.seeding.shortening`).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits
from planner.evaluation.problem import ProblemArrays
from planner.optimisers.linear_algebra import band_cholesky, solve_band
from planner.seeding.shortening_model import (
    BAND,
    Bindings,
    LagrangianModel,
    bindings,
    carried,
    constraints_of,
    lagrangian,
)
from world.kernels import compiled

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# Newton's steps down a path's length under its constraints: the compiled part of `planner.seeding.shortening`.
#
# A step solves a band of equations (`planner.seeding.shortening_model`) and costs what a few evaluations of the path
# do.


# What is added to the matrix's diagonal, 1 / m: along a straight line a waypoint's place is free.
DAMPING = 2e-4
# Furthest that a step moves a waypoint along an axis, m.
LONGEST_STEP = 80.0
# Penalties, 1 / m, of the first round and of the last; rounds, steps of each, and halvings of a step.
FIRST_PENALTY, LAST_PENALTY, ROUNDS, STEPS, HALVINGS = 0.1, 1.0, 9, 5, 5
# A round ends with a step that moves no waypoint further than this, m.
STILL = 0.05


@compiled
def _newton_step(
    path: Floats, low: Floats, high: Floats, model: LagrangianModel, factor: Floats, step: Floats
) -> float:  # pragma: no cover - compiled
    """Fill the step (n,) down from a path, within its box; the furthest that it moves along an axis, m."""
    size = step.size
    for row in range(size):
        model.band[row, 0] += DAMPING
        place, axis = path[1 + row // 3, row % 3], row % 3
        downhill = -model.gradient[row]
        if (place <= low[axis] and downhill < 0.0) or (place >= high[axis] and downhill > 0.0):
            # Held by its bound: it neither moves nor is moved.
            model.gradient[row] = 0.0
            for k in range(1, BAND):
                model.band[row, k] = 0.0
                if row + k < size:
                    model.band[row + k, k] = 0.0
    band_cholesky(model.band, factor)
    solve_band(factor, model.gradient, step)
    furthest = 0.0
    for row in range(size):
        step[row] = -step[row]
        furthest = max(furthest, abs(step[row]))
    if furthest > LONGEST_STEP:
        for row in range(size):
            step[row] *= LONGEST_STEP / furthest
    return min(furthest, LONGEST_STEP)


class Shortening(NamedTuple):
    """A path (w, 3) m under way, what binds it, the multipliers of its constraints, rounds done, and models made."""

    path: Floats
    bound: Bindings
    multipliers: Floats
    rounds: int
    models: int


@compiled
def begin_shortening(
    data: ProblemArrays, path: Floats, samples: int, spare: float
) -> Shortening:  # pragma: no cover - compiled
    """The shortening of a path (w, 3) m before its first round.

    samples: of the ground on each leg.  spare: m by which it keeps further from spheres and ground than is asked.
    """
    bound = bindings(data, path, samples, spare)
    return Shortening(path.copy(), bound, np.zeros(constraints_of(bound)), 0, 0)


class _Descent(NamedTuple):
    """What a round's steps share: the box's corners (3,), the model, the matrix's factor, a step, and a trial."""

    low: Floats
    high: Floats
    model: LagrangianModel
    factor: Floats
    step: Floats
    trial: Floats


@compiled
def shorten_on(
    data: ProblemArrays, under_way: Shortening, spare: float, most: int
) -> Shortening:  # pragma: no cover - compiled
    """The shortening after as many rounds as are left, or after so many."""
    here, bound, multipliers, number, made = under_way
    limits, size = precompute_limits(data), 3 * (here.shape[0] - 2)
    descent = _Descent(
        np.array([data.west, data.south, data.floor]),
        np.array([data.east, data.north, data.ceiling]),
        LagrangianModel(np.zeros(size), np.zeros((size, BAND)), np.zeros((4, 3))),
        np.zeros((size, BAND)),
        np.zeros(size),
        here.copy(),
    )
    last = min(ROUNDS, number + most)
    while number < last:
        if number > 0:
            renewed = bindings(data, here, bound.samples, spare)
            multipliers = carried(bound, multipliers, renewed)
            bound = renewed
        penalty = FIRST_PENALTY * (LAST_PENALTY / FIRST_PENALTY) ** (number / (ROUNDS - 1))
        values = np.zeros(multipliers.size)
        made += _descend(data, limits, bound, here, multipliers, values, penalty, descent)
        for k in range(values.size):
            multipliers[k] = max(0.0, multipliers[k] - penalty * values[k])
        number += 1
    return Shortening(here, bound, multipliers, number, made)


@compiled
def _descend(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    bound: Bindings,
    here: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    descent: _Descent,
) -> int:  # pragma: no cover - compiled
    """Step a path (w, 3) down, in place, and fill the constraints' values where it ends; models made."""
    low, high, model, step, trial = descent.low, descent.high, descent.model, descent.step, descent.trial
    merit, made = lagrangian(data, limits, bound, here, multipliers, values, penalty, model), 1
    for _ in range(STEPS):
        furthest, share, better = _newton_step(here, low, high, model, descent.factor, step), 1.0, False
        for _ in range(HALVINGS):
            for row in range(step.size):
                axis = row % 3
                place = here[1 + row // 3, axis] + share * step[row]
                trial[1 + row // 3, axis] = min(high[axis], max(low[axis], place))
            found = lagrangian(data, limits, bound, trial, multipliers, values, penalty, model)
            made += 1
            if found < merit:
                better = True
                break
            share *= 0.5
        if not better:
            break
        merit = found
        here[:] = trial
        if share * furthest < STILL:
            break
    lagrangian(data, limits, bound, here, multipliers, values, penalty, model)
    return made + 1


# Samples of the ground on a leg: one every so many m of the mean leg, within these.
SAMPLE_PITCH, FEWEST_SAMPLES, MOST_SAMPLES = 30.0, 6, 48
# What it keeps further from spheres and ground than is asked, m: what its last steps leave undecided.
SPARE = 0.1
# Models that one shortening makes at most.
MOST_MODELS = ROUNDS * (2 + STEPS * HALVINGS)
# Pairs of leg and missile that are looked at before the caller may end the work: some 5 ms.
PAIRS_AT_ONCE = 400_000


def shorten_path(
    data: ProblemArrays, path: Floats, *, spare: float = SPARE, pause: Callable[[], None] = lambda: None
) -> tuple[Floats, int]:
    """A path (w, 3) world m that is shorter or breaks less than this one, and the models made: each is an evaluation.

    spare: m by which it keeps further from spheres and ground than is asked.  pause: called after some milliseconds'
    work; what it raises ends the work.  Zones, and a greatest height above ground, are not looked at.

    >>> from planfly.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> data = make_problem(scenario, load_airframe(scenario).limits).search
    >>> high = np.array([scenario.start, [5000.0, 5000.0, 590.0], scenario.destination])
    >>> path, _ = shorten_path(data, evenly(high, 10))
    >>> path.shape, bool(np.array_equal(path[-1], scenario.destination))
    ((10, 3), True)
    """
    mean = math.dist(path[0], path[-1]) / (len(path) - 1)
    samples = int(min(MOST_SAMPLES, max(FEWEST_SAMPLES, math.ceil(mean / SAMPLE_PITCH))))
    rounds = max(1, PAIRS_AT_ONCE // (len(path) * max(1, len(data.missiles.missiles))))
    start = np.array(path, dtype=np.float64)
    # A grid's route ends at a grid's height.
    start[0], start[-1] = data.start, data.destination
    under_way: Shortening = begin_shortening(data, start, samples, spare)
    while under_way.rounds < ROUNDS:
        under_way = shorten_on(data, under_way, spare, min(ROUNDS, rounds))
        pause()
    return under_way.path, int(under_way.models)


def evenly(way: Floats, count: int) -> Floats:
    """Waypoints (count, 3) at equal distances along a way (k, 3).

    >>> evenly(np.array([[0.0, 0.0, 5.0], [30.0, 40.0, 5.0], [30.0, 90.0, 5.0]]), 5).tolist()
    [[0.0, 0.0, 5.0], [15.0, 20.0, 5.0], [30.0, 40.0, 5.0], [30.0, 65.0, 5.0], [30.0, 90.0, 5.0]]
    """
    runs = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(way, axis=0) ** 2).sum(axis=1)))])
    at = np.linspace(0.0, runs[-1], count)
    return np.column_stack([np.interp(at, runs, way[:, axis]) for axis in range(3)])
