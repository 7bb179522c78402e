"""The model's gradient against differences of its value, with every kind of constraint at work."""

import numpy as np
import pytest

from planner.evaluation.leg_constraints import precompute_limits
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.path_shortening import evenly
from planner.seeding.shortening_bindings import bindings, constraints_of
from planner.seeding.shortening_model import BAND, LagrangianModel, lagrangian
from tests.bench.task import make_task
from world.scenario import load_scenario


def zigzag(data: ProblemArrays, share: float, waypoints: int = 9) -> np.ndarray:
    """A path that breaks everything: through ground and spheres, too steep, too sharp."""
    path = evenly(np.array([data.start, data.destination]), waypoints)
    rng = np.random.default_rng(5)
    path[1:-1] += share * rng.normal(0.0, [1500.0, 1500.0, 500.0], (waypoints - 2, 3))
    return path


@pytest.mark.parametrize("name", ["hard-60", "jacksboro"])
def test_the_gradient_is_that_of_the_augmented_length(name: str) -> None:
    data = make_task(name).problem.search
    assert data.legs_hold_turns == (name == "jacksboro")
    path, limits = zigzag(data, 1.0 if name == "hard-60" else 0.3), precompute_limits(data)
    bound = bindings(data, path, 8, 0.5)
    # As if turns took far more of their legs: then these are too short.
    bound = bound._replace(before=40.0 * bound.before, after=40.0 * bound.after)
    count, size = constraints_of(bound), 3 * (len(path) - 2)
    multipliers = np.random.default_rng(6).uniform(0.0, 1.0, count)
    values, model = np.zeros(count), LagrangianModel(np.zeros(size), np.zeros((size, BAND)), np.zeros((4, 3)))

    def value(change: np.ndarray) -> float:
        moved = path.copy()
        moved[1:-1] += change.reshape(-1, 3)
        return float(lagrangian(data, limits, bound, moved, multipliers, values, 0.3, model))

    differences = np.zeros(size)
    for row in range(size):
        step = np.zeros(size)
        step[row] = 1e-3
        differences[row] = (value(step) - value(-step)) / 2e-3
    value(np.zeros(size))
    # The ground's slope is taken over metres, across the raster's folds.
    near = np.abs(model.gradient - differences) < 0.02 * np.abs(differences).max()
    assert near.all()
    assert np.corrcoef(model.gradient, differences)[0, 1] > 0.999
    # Every kind of constraint is broken somewhere.
    pairs, legs = len(bound.pairs), len(path) - 1
    ends = np.cumsum([pairs, legs * 8, 3 * legs, legs + 1, legs])
    kinds = np.split(values, ends[:-1])
    broken = [bool(kind.size > 0 and kind.min() < 0.0) for kind in kinds]
    # A number limits turns, or what legs have room for.
    assert broken == ([True, True, broken[2], False, True] if data.legs_hold_turns else [True, True, True, True, False])


def test_the_hessian_of_the_length_is_that_of_its_gradient() -> None:
    scenario = load_scenario("hard-07")
    task = make_task("hard-07")
    data = make_problem(scenario, task.airframe.limits).search._replace(max_turn=9.0)
    path, limits = zigzag(data, 1.0, 6), precompute_limits(data)
    # High above all of it nothing but the length is left.
    path[:, 2] += 5000.0
    bound = bindings(data, path, 4, 0.5)._replace(climb=np.full(5, 1e3), dive=np.full(5, 1e3))
    count, size = constraints_of(bound), 3 * (len(path) - 2)
    values, model = np.zeros(count), LagrangianModel(np.zeros(size), np.zeros((size, BAND)), np.zeros((4, 3)))

    def gradient(change: np.ndarray) -> np.ndarray:
        moved = path.copy()
        moved[1:-1] += change.reshape(-1, 3)
        lagrangian(data, limits, bound, moved, np.zeros(count), values, 0.1, model)
        return model.gradient.copy()

    columns = [(gradient(0.01 * row) - gradient(-0.01 * row)) / 0.02 for row in np.eye(size)]
    gradient(np.zeros(size))
    whole = np.array(
        [[model.band[max(i, j), abs(i - j)] if abs(i - j) < BAND else 0.0 for j in range(size)] for i in range(size)]
    )
    np.testing.assert_allclose(whole, np.array(columns).T, atol=1e-6)
