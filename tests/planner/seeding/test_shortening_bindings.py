"""What binds a path: the missiles near it by NumPy, and what is carried from one round to the next."""

import numpy as np

from planner.seeding.path_shortening import evenly
from planner.seeding.shortening_bindings import NEAR, Bindings, bindings, carried, constraints_of
from tests.bench.task import make_task


def bound_of(north: float = 0.0) -> tuple[np.ndarray, Bindings]:
    data = make_task("hard-60").problem.search
    path = evenly(np.array([data.start, data.destination]), 8)
    path[1:-1, 1] += north
    return path, bindings(data, path, 5, 0.0)


def test_the_missiles_near_each_leg_are_those_within_reach_of_it() -> None:
    path, bound = bound_of()
    data = make_task("hard-60").problem.search
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    pairs = {(int(leg), int(missile)) for leg, missile in bound.pairs}
    for k, missile in enumerate(data.missiles.missiles):
        place = np.array([missile["east"], missile["north"], missile["up"]])
        for i in range(len(path) - 1):
            away = np.sqrt(((path[i] + shares * (path[i + 1] - path[i]) - place) ** 2).sum(axis=1)).min()
            room = away - missile["radius"] - data.kill_margin
            # Within what the points on a leg lie apart it may be either.
            assert abs(room - NEAR) < 1.0 or ((i, k) in pairs) == (room < NEAR)
    assert len(pairs) > 10


def test_limits_of_slopes_and_what_is_wanted_are_the_problems_own() -> None:
    _, bound = bound_of()
    data = make_task("hard-60").problem.search
    np.testing.assert_allclose(bound.climb, np.tan(np.radians(19.5)))
    np.testing.assert_allclose(bound.dive, np.tan(np.radians(24.5)))
    np.testing.assert_allclose(bound.wide, data.missiles.missiles["radius"][bound.pairs[:, 1]] + 15.0)
    assert not bound.turns_in_legs
    assert constraints_of(bound) == len(bound.pairs) + 7 * (5 + 4) + 8


def test_turns_take_of_the_legs_what_a_corner_of_that_turn_takes() -> None:
    """Over the tangent of half the turn it is about the arc's radius: v^2 / g tan(bank), without wind or autopilot."""
    task = make_task("jacksboro")
    data = task.problem.search
    path = evenly(np.array([data.start, data.destination]), 8)
    path[3, 0] += 400.0
    bound = bindings(data, path, 5, 0.0)
    assert bound.turns_in_legs
    assert np.ptp(bound.before[1:-1]) < 0.5 * bound.before[1:-1].max()
    np.testing.assert_allclose(bound.before[1:-1], bound.after[1:-1])
    assert (bound.before[1:-1] > 30.0).all()


def test_multipliers_stay_with_their_leg_and_missile() -> None:
    (_, old), (_, new) = bound_of(), bound_of(150.0)
    multipliers = np.arange(constraints_of(old)) + 1.0
    kept = carried(old, multipliers, new)
    by_pair = {tuple(pair): multipliers[k] for k, pair in enumerate(old.pairs.tolist())}
    assert {tuple(pair) for pair in new.pairs.tolist()} - set(by_pair)
    for k, pair in enumerate(new.pairs.tolist()):
        assert kept[k] == by_pair.get(tuple(pair), 0.0)
    np.testing.assert_array_equal(kept[len(new.pairs) :], multipliers[len(old.pairs) :])
