"""What binds a path: the missiles near it by NumPy, and what is carry_multipliers from one round to the next."""

from typing import Literal

import numpy as np
import pytest

from aircraft.tracking import zero_tracking_error
from benchmarks.task import make_task
from planner.evaluation.leg_constraints import precompute_limits
from planner.evaluation.problem import ProblemArrays, make_problem
from planner.evaluation.travel_cost import NO_WINDS, WindGrid, make_travel_cost, path_cost
from planner.seeding.flown_corners import SAMPLES_PER_CORNER
from planner.seeding.shortening import resample
from planner.seeding.shortening_model import (
    HESSIAN_HALF_BANDWIDTH,
    NEARBY_DISTANCE_M,
    ActiveConstraints,
    LagrangianModel,
    active_constraints,
    carry_multipliers,
    constraint_count,
    lagrangian,
)
from world.scenario import load_scenario


def linear_winds() -> WindGrid:
    """Return a grid of winds that are linear in place, up to 8 m/s, in an area of 60 km by 60 km by 6 km."""
    x, y, z = np.meshgrid(*(np.linspace(-1.0, 1.0, 3) for _ in range(3)), indexing="ij")
    velocities = np.stack([4.0 * x - 2.0 * y + 2.0 * z, 3.0 * y - x + z], axis=-1)
    winds = WindGrid(np.array([-3e4, -3e4, -2000.0]), np.array([3e4, 3e4, 3000.0]), velocities)
    for array in winds:
        array.setflags(write=False)
    return winds


def bound_of(north: float = 0.0) -> tuple[np.ndarray, ActiveConstraints]:
    data = make_task("hard-60").problem.search
    path = resample(np.array([data.start, data.destination]), 8)
    path[1:-1, 1] += north
    return path, active_constraints(data, path, 5, 0.0, False)


def test_the_missiles_near_each_leg_are_those_within_reach_of_it() -> None:
    path, active = bound_of()
    data = make_task("hard-60").problem.search
    shares = np.linspace(0.0, 1.0, 501)[:, None]
    pairs = {(int(leg), int(missile)) for leg, missile in active.pairs}
    for k, missile in enumerate(data.missiles.missiles):
        place = np.array([missile["east"], missile["north"], missile["up"]])
        for i in range(len(path) - 1):
            away = np.sqrt(((path[i] + shares * (path[i + 1] - path[i]) - place) ** 2).sum(axis=1)).min()
            room = away - missile["radius"] - data.kill_margin
            # Within what the points on a leg lie apart it may be either.
            assert abs(room - NEARBY_DISTANCE_M) < 1.0 or ((i, k) in pairs) == (room < NEARBY_DISTANCE_M)
    assert len(pairs) > 10


def test_limits_of_slopes_and_what_is_wanted_are_the_problems_own() -> None:
    _, active = bound_of()
    data = make_task("hard-60").problem.search
    np.testing.assert_allclose(active.climb, np.tan(np.radians(19.5)))
    np.testing.assert_allclose(active.dive, np.tan(np.radians(24.5)))
    np.testing.assert_allclose(active.distances, data.missiles.missiles["radius"][active.pairs[:, 1]] + 15.0)
    assert not active.turns_in_legs
    assert constraint_count(active) == len(active.pairs) + 7 * (5 + 4) + 8 * (3 + SAMPLES_PER_CORNER)


def test_turns_take_of_the_legs_what_a_corner_of_that_turn_takes() -> None:
    """Over the tangent of half the turn it is about the arc's radius: v^2 / g tan(bank), without wind or autopilot."""
    task = make_task("jacksboro-air")
    data = task.problem.search
    path = resample(np.array([data.start, data.destination]), 8)
    path[3, 0] += 400.0
    active = active_constraints(data, path, 5, 0.0, False)
    assert active.turns_in_legs
    assert np.ptp(active.before[1:-1]) < 0.5 * active.before[1:-1].max()
    np.testing.assert_allclose(active.before[1:-1], active.after[1:-1])
    assert (active.before[1:-1] > 30.0).all()


def test_multipliers_stay_with_their_leg_and_missile() -> None:
    (_, old), (_, new) = bound_of(), bound_of(150.0)
    multipliers = np.arange(constraint_count(old)) + 1.0
    kept = carry_multipliers(old, multipliers, new)
    by_pair = {tuple(pair): multipliers[k] for k, pair in enumerate(old.pairs.tolist())}
    assert {tuple(pair) for pair in new.pairs.tolist()} - set(by_pair)
    for k, pair in enumerate(new.pairs.tolist()):
        assert kept[k] == by_pair.get(tuple(pair), 0.0)
    np.testing.assert_array_equal(kept[len(new.pairs) :], multipliers[len(old.pairs) :])


# ----------------------------------------------------------------------
# The model's gradient against differences of its value, with every kind of constraint at work.


def zigzag(data: ProblemArrays, share: float, waypoints: int = 9) -> np.ndarray:
    """A path that breaks everything: through ground and spheres, too steep, too sharp."""
    path = resample(np.array([data.start, data.destination]), waypoints)
    rng = np.random.default_rng(5)
    path[1:-1] += share * rng.normal(0.0, [1500.0, 1500.0, 500.0], (waypoints - 2, 3))
    return path


@pytest.mark.parametrize(
    ("name", "corners"),
    [("hard-60", ""), ("jacksboro-air", ""), ("jacksboro-air", "arcs"), ("jacksboro-air", "tracked")],
)
def test_the_gradient_is_that_of_the_augmented_length(name: str, corners: str) -> None:
    data = make_task(name).problem.search
    if corners == "arcs":
        data = data._replace(tracking=zero_tracking_error())
    assert data.legs_hold_turns == (name == "jacksboro-air")
    path, limits = zigzag(data, 1.0 if name == "hard-60" else 0.3), precompute_limits(data)
    if corners:
        # Along both legs of a corner, and so along its arc.
        path[3, 2], path[5, 2] = path[4, 2] - 1000.0, path[4, 2] + 1000.0
    active = active_constraints(data, path, 8, 0.5, bool(corners))
    # As if turns took far more of their legs: then these are too short.
    active = active._replace(before=40.0 * active.before, after=40.0 * active.after)
    count, size = constraint_count(active), 3 * (len(path) - 2)
    multipliers = np.random.default_rng(6).uniform(0.0, 1.0, count)
    values, model = (
        np.zeros(count),
        LagrangianModel(np.zeros(size), np.zeros((size, HESSIAN_HALF_BANDWIDTH)), np.zeros((4, 3))),
    )

    def value(change: np.ndarray) -> float:
        moved = path.copy()
        moved[1:-1] += change.reshape(-1, 3)
        return float(lagrangian(data, limits, active, moved, multipliers, values, 0.3, model))

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
    pairs, legs = len(active.pairs), len(path) - 1
    ends = np.cumsum([pairs, legs * 8, 3 * legs, legs + 1, legs])
    *kinds, heights, arcs = np.split(values, [*ends, ends[-1] + len(path) * SAMPLES_PER_CORNER])
    broken = [bool(kind.size > 0 and kind.min() < 0.0) for kind in kinds]
    assert [kind.min() < 0.0 for kind in (heights, arcs)] == [bool(corners)] * 2
    # A number limits turns, or what legs have room for.
    assert broken == ([True, True, broken[2], False, True] if data.legs_hold_turns else [True, True, True, True, False])


def test_the_hessian_of_the_length_is_that_of_its_gradient() -> None:
    scenario = load_scenario("hard-07")
    task = make_task("hard-07")
    data = make_problem(scenario, task.uav.limits).search._replace(max_turn=9.0)
    path, limits = zigzag(data, 1.0, 6), precompute_limits(data)
    # High above all of it nothing but the length is left.
    path[:, 2] += 5000.0
    active = active_constraints(data, path, 4, 0.5, False)._replace(climb=np.full(5, 1e3), dive=np.full(5, 1e3))
    count, size = constraint_count(active), 3 * (len(path) - 2)
    values, model = (
        np.zeros(count),
        LagrangianModel(np.zeros(size), np.zeros((size, HESSIAN_HALF_BANDWIDTH)), np.zeros((4, 3))),
    )

    def gradient(change: np.ndarray) -> np.ndarray:
        moved = path.copy()
        moved[1:-1] += change.reshape(-1, 3)
        lagrangian(data, limits, active, moved, np.zeros(count), values, 0.1, model)
        return model.gradient.copy()

    columns = [(gradient(0.01 * row) - gradient(-0.01 * row)) / 0.02 for row in np.eye(size)]
    gradient(np.zeros(size))
    whole = np.array(
        [
            [model.band[max(i, j), abs(i - j)] if abs(i - j) < HESSIAN_HALF_BANDWIDTH else 0.0 for j in range(size)]
            for i in range(size)
        ]
    )
    np.testing.assert_allclose(whole, np.array(columns).T, atol=1e-6)


@pytest.mark.parametrize("is_forecast", [False, True])
@pytest.mark.parametrize("objective", ["time", "energy"])
def test_the_gradient_of_time_and_energy_is_that_of_their_values(
    objective: Literal["time", "energy"], is_forecast: bool
) -> None:
    task = make_task("jacksboro-air")
    problem = make_problem(task.scenario, task.uav.limits)
    shear = problem.search.aircraft._replace(wind_speed=9.0, wind_gradient=0.005)
    winds = linear_winds() if is_forecast else NO_WINDS
    travel = make_travel_cost(objective, task.uav.limits.envelope, shear, winds)
    assert travel is not None
    data = problem.search._replace(travel=travel, aircraft=shear, max_turn=9.0, legs_hold_turns=False)
    path, limits = zigzag(data, 0.1, 6), precompute_limits(data)
    # Far above all of it nothing but the cost is left.
    path[:, 2] += 1000.0
    active = active_constraints(data, path, 4, 0.5, False)._replace(climb=np.full(5, 1e3), dive=np.full(5, 1e3))
    active = active._replace(distances=np.zeros_like(active.distances))
    count, size = constraint_count(active), 3 * (len(path) - 2)
    values, model = (
        np.zeros(count),
        LagrangianModel(np.zeros(size), np.zeros((size, HESSIAN_HALF_BANDWIDTH)), np.zeros((4, 3))),
    )

    def value(change: np.ndarray) -> float:
        moved = path.copy()
        moved[1:-1] += change.reshape(-1, 3)
        return float(lagrangian(data, limits, active, moved, np.zeros(count), values, 0.3, model))

    differences = np.array([(value(0.05 * step) - value(-0.05 * step)) / 0.1 for step in np.eye(size)])
    legs = path_cost(travel, shear, path)
    assert value(np.zeros(size)) == pytest.approx(legs, rel=1e-9)
    np.testing.assert_allclose(model.gradient, differences, rtol=1e-3, atol=1e-4)
    # No direction that the curvature takes for a way down without end.
    whole = np.zeros((size, size))
    for row in range(size):
        for back in range(min(HESSIAN_HALF_BANDWIDTH, row + 1)):
            whole[row, row - back] = whole[row - back, row] = model.band[row, back]
    assert np.linalg.eigvalsh(whole).min() > -1e-9
