"""Newton's steps down a path's length under its constraints: the compiled part of `planner.seeding.path_shortening`.

A step solves a band of equations (`planner.seeding.shortening_model`) and costs what a few evaluations of the path do.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits
from planner.evaluation.problem_arrays import ProblemArrays
from planner.optimisers.linear_algebra import band_cholesky, solve_band
from planner.seeding.shortening_bindings import Bindings, bindings, carried, constraints_of
from planner.seeding.shortening_model import BAND, LagrangianModel, lagrangian
from world.kernels import compiled

Floats = NDArray[np.float64]

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
