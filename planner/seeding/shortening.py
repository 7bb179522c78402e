"""Find the shortest path near a given path under its constraints, by moving all waypoints at once.

Grids and populations decide on which side to pass each obstacle. Near such a path, length is a smooth function of all
coordinates under smooth constraints, and an augmented Lagrangian method with Newton steps minimises it in a millisecond
or two. Each round fixes the active constraints (`planner.seeding.shortening_model`), takes Newton steps in a box, and
updates the multipliers. A step solves a banded system and costs about as much as a few evaluations.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits
from planner.evaluation.problem import ProblemArrays
from planner.optimisers.linear_algebra import band_cholesky, solve_band
from planner.seeding.shortening_model import (
    HESSIAN_HALF_BANDWIDTH,
    ActiveConstraints,
    LagrangianModel,
    active_constraints,
    carry_multipliers,
    constraint_count,
    lagrangian,
)
from world.arrays import Floats
from world.kernels import compiled, copy_into, inner

# --- Newton steps and rounds ---


# Added to the diagonal of the Hessian, 1 / m: along a straight line the position of a waypoint is undetermined.
HESSIAN_DAMPING_PER_M = 2e-4
# Longest step of a waypoint along an axis, m.
MAX_STEP_M = 80.0
# Penalty of the first round, 1 / m.
FIRST_PENALTY_PER_M = 0.1
# Penalty of the last round, 1 / m.
LAST_PENALTY_PER_M = 1.0
# Number of rounds.
ROUND_COUNT = 9
# Number of steps per round.
STEPS_PER_ROUND = 5
# Number of halvings per step.
HALVINGS_PER_STEP = 5
# A round ends after a step that moves no waypoint further than this, m.
MIN_MOVE_M = 0.05


@inner
def _newton_step(
    path: Floats, min_corner: Floats, max_corner: Floats, model: LagrangianModel, factor: Floats, step: Floats
) -> float:
    """Fill `step` (n,) with a Newton step of a path within a box; return its largest component, m.

    path: (w, 3) m.
    min_corner, max_corner: (3,) corners of the box, m.
    model: gradient and Hessian at the path; coordinates at a bound that would leave the box are removed from both.
    factor: working memory, like the band of the Hessian.

    A step with a component beyond `MAX_STEP_M` is scaled down to it.
    """
    size = step.size
    for row in range(size):
        model.band[row, 0] += HESSIAN_DAMPING_PER_M
        coordinate, axis = path[1 + row // 3, row % 3], row % 3
        downhill = -model.gradient[row]
        if (coordinate <= min_corner[axis] and downhill < 0.0) or (coordinate >= max_corner[axis] and downhill > 0.0):
            # At an active bound of the box: remove the coordinate from the system.
            model.gradient[row] = 0.0
            for k in range(1, HESSIAN_HALF_BANDWIDTH):
                model.band[row, k] = 0.0
                if row + k < size:
                    model.band[row + k, k] = 0.0
    band_cholesky(model.band, factor)
    solve_band(factor, model.gradient, step)
    max_move = 0.0
    for row in range(size):
        step[row] = -step[row]
        max_move = max(max_move, abs(step[row]))
    if max_move > MAX_STEP_M:
        for row in range(size):
            step[row] *= MAX_STEP_M / max_move
    return min(max_move, MAX_STEP_M)


class Shortening(NamedTuple):
    """State of a shortening: path, active constraints, multipliers, and the work done.

    path: (w, 3) m.
    active: the constraints of the present round.
    multipliers: (c,) one for each constraint; it grows while the constraint is violated.
    rounds: number of completed rounds. In a round the constraints and multipliers are fixed.
    models: number of models evaluated; a model is the augmented Lagrangian of a path with its derivatives.
    corners_too: True to also constrain the height and slope of corners as they are flown.
    """

    path: Floats
    active: ActiveConstraints
    multipliers: Floats
    rounds: int
    models: int
    corners_too: bool


@compiled
def begin_shortening(
    data: ProblemArrays, path: Floats, samples: int, extra_margin: float, corners_too: bool
) -> Shortening:
    """Return the state of a new shortening of a path (w, 3) m, before its first round.

    samples: number of ground samples on each leg.
    extra_margin: additional margin to spheres and ground, m.
    corners_too: True to also constrain the height and slope of corners as they are flown.
    """
    active = active_constraints(data, path, samples, extra_margin, corners_too)
    return Shortening(path.copy(), active, np.zeros(constraint_count(active)), 0, 0, corners_too)


class _DescentScratch(NamedTuple):
    """Box of the waypoints, and working memory of a round's steps.

    min_corner, max_corner: (3,) corners of the box, m.
    model: gradient and Hessian.
    factor: Cholesky factor of the Hessian.
    step: (n,) step of the coordinates of the inner waypoints, m.
    trial: (w, 3) path after the step, m.
    """

    min_corner: Floats
    max_corner: Floats
    model: LagrangianModel
    factor: Floats
    step: Floats
    trial: Floats


@compiled
def continue_shortening(
    data: ProblemArrays, shortening: Shortening, extra_margin: float, max_rounds: int
) -> Shortening:
    """Continue a shortening by up to `max_rounds` rounds, but not beyond `ROUND_COUNT`; return its state.

    extra_margin: additional margin to spheres and ground, m.
    """
    path, active, multipliers, round_number, models, corners_too = shortening
    limits, size = precompute_limits(data), 3 * (path.shape[0] - 2)
    descent = _DescentScratch(
        np.array([data.west, data.south, data.floor]),
        np.array([data.east, data.north, data.ceiling]),
        LagrangianModel(np.zeros(size), np.zeros((size, HESSIAN_HALF_BANDWIDTH)), np.zeros((4, 3))),
        np.zeros((size, HESSIAN_HALF_BANDWIDTH)),
        np.zeros(size),
        path.copy(),
    )
    last_round = min(ROUND_COUNT, round_number + max_rounds)
    while round_number < last_round:
        if round_number > 0:
            new_active = active_constraints(data, path, active.samples, extra_margin, corners_too)
            multipliers = carry_multipliers(active, multipliers, new_active)
            active = new_active
        penalty = FIRST_PENALTY_PER_M * (LAST_PENALTY_PER_M / FIRST_PENALTY_PER_M) ** (round_number / (ROUND_COUNT - 1))
        values = np.zeros(multipliers.size)
        models += _descend(data, limits, active, path, multipliers, values, penalty, descent)
        for k in range(values.size):
            multipliers[k] = max(0.0, multipliers[k] - penalty * values[k])
        round_number += 1
    return Shortening(path, active, multipliers, round_number, models, corners_too)


@inner
def _descend(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    active: ActiveConstraints,
    path: Floats,
    multipliers: Floats,
    values: Floats,
    penalty: float,
    descent: _DescentScratch,
) -> int:
    """Minimise the augmented Lagrangian of a path (w, 3) in place; return the number of models evaluated.

    active: the active constraints and their coefficients.
    path: overwritten with the result, m.
    multipliers: (c,) multipliers of the constraints.
    values: (c,) array to fill with the final values of the constraints.
    penalty: penalty factor, 1 / m.
    descent: box of the waypoints, and working memory.

    Newton steps are taken; a step that does not lower the Lagrangian is halved several times. The descent ends after
    some steps, after a very short step, or if no halved step is better.
    """
    min_corner = descent.min_corner
    max_corner = descent.max_corner
    model = descent.model
    step = descent.step
    trial = descent.trial
    merit, models = lagrangian(data, limits, active, path, multipliers, values, penalty, model), 1
    for _ in range(STEPS_PER_ROUND):
        max_move = _newton_step(path, min_corner, max_corner, model, descent.factor, step)
        step_fraction = 1.0
        is_better = False
        for _ in range(HALVINGS_PER_STEP):
            for row in range(step.size):
                axis = row % 3
                coordinate = path[1 + row // 3, axis] + step_fraction * step[row]
                trial[1 + row // 3, axis] = min(max_corner[axis], max(min_corner[axis], coordinate))
            trial_merit = lagrangian(data, limits, active, trial, multipliers, values, penalty, model)
            models += 1
            if trial_merit < merit:
                is_better = True
                break
            step_fraction *= 0.5
        if not is_better:
            break
        merit = trial_merit
        for row in range(path.shape[0]):
            copy_into(path[row], trial[row])
        if step_fraction * max_move < MIN_MOVE_M:
            break
    lagrangian(data, limits, active, path, multipliers, values, penalty, model)
    return models + 1


# --- Shortening a path ---

# Spacing of ground samples on the mean leg, m.
SAMPLE_SPACING_M = 30.0
# Minimum number of ground samples per leg.
MIN_SAMPLES = 6
# Maximum number of ground samples per leg.
MAX_SAMPLES = 48
# Additional margin to spheres and ground, m: the accuracy that the last steps reach.
EXTRA_MARGIN_M = 0.1
# Maximum number of models per shortening.
MAX_MODELS = ROUND_COUNT * (2 + STEPS_PER_ROUND * HALVINGS_PER_STEP)
# Pairs of leg and missile between two calls of `check_stop`: some 5 ms.
PAIRS_PER_CHECK = 400_000


def shorten_path(
    data: ProblemArrays,
    path: Floats,
    *,
    extra_margin: float = EXTRA_MARGIN_M,
    corners_too: bool = False,
    check_stop: Callable[[], None] = lambda: None,
) -> tuple[Floats, int]:
    """Shorten a path (w, 3), or reduce its cost or violations; return it and the number of evaluations.

    extra_margin: additional margin to spheres and ground, m.
    corners_too: True to also constrain the height and slope of corners as they are flown, which is slower.
    check_stop: called after some milliseconds of work; an exception raised there stops it.

    The cost is defined by `data.travel`: length, time or energy. Each evaluated model is counted as one evaluation.
    Zones and the maximum height above ground are ignored.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> data = make_problem(scenario, load_uav(scenario).limits).search
    >>> high = np.array([scenario.start, [5000.0, 5000.0, 590.0], scenario.destination])
    >>> path, _ = shorten_path(data, resample(high, 10))
    >>> path.shape, bool(np.array_equal(path[-1], scenario.destination))
    ((10, 3), True)
    """
    mean_length = math.dist(path[0], path[-1]) / (len(path) - 1)
    samples = int(min(MAX_SAMPLES, max(MIN_SAMPLES, math.ceil(mean_length / SAMPLE_SPACING_M))))
    rounds = max(1, PAIRS_PER_CHECK // (len(path) * max(1, len(data.missiles.missiles))))
    start = np.array(path, dtype=np.float64)
    # A grid's route ends at the height of a layer.
    start[0], start[-1] = data.start, data.destination
    shortening: Shortening = begin_shortening(data, start, samples, extra_margin, corners_too)
    while shortening.rounds < ROUND_COUNT:
        shortening = continue_shortening(data, shortening, extra_margin, min(ROUND_COUNT, rounds))
        check_stop()
    return shortening.path, int(shortening.models)


def resample(route: Floats, count: int) -> Floats:
    """Return `count` waypoints at equal distances along a route (k, 3), ends included, (count, 3).

    >>> resample(np.array([[0.0, 0.0, 5.0], [30.0, 40.0, 5.0], [30.0, 90.0, 5.0]]), 5).tolist()
    [[0.0, 0.0, 5.0], [15.0, 20.0, 5.0], [30.0, 40.0, 5.0], [30.0, 65.0, 5.0], [30.0, 90.0, 5.0]]
    """
    distances = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(route, axis=0) ** 2).sum(axis=1)))])
    positions = np.linspace(0.0, distances[-1], count)
    return np.column_stack([np.interp(positions, distances, route[:, axis]) for axis in range(3)])
