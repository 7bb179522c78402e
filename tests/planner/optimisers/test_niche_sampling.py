"""Groups of rows: the best that lie apart are kept, new rows stand around them, and none that is not allowed."""

import numpy as np

from planner.optimisers.niche_sampling import CLEARING_RADIUS_RATIO, MIN_SELECTED_COUNT, NicheSampling
from world.arrays import Flags, Floats, Ints

LOWER, UPPER = np.array([[0.0, -10.0], [5.0, -20.0]]), np.array([[5.0, 10.0], [10.0, 20.0]])


def anywhere(rows: Floats, _groups: Ints) -> Flags:
    return np.ones(len(rows), dtype=np.bool_)


def sampling(seed: int = 1) -> NicheSampling:
    return NicheSampling(LOWER, UPPER, anywhere, np.random.default_rng(seed))


def inside(rows: Floats) -> bool:
    return bool(((rows >= LOWER[:, None]) & (rows <= UPPER[:, None])).all())


def test_first_rows_fill_the_boxes_and_gather_at_the_upper_side_where_asked() -> None:
    rows = sampling().draw_first(400)
    assert inside(rows)
    np.testing.assert_allclose(rows.mean(axis=1), 0.5 * (LOWER + UPPER), atol=1.0)
    rows = sampling().draw_first(4000, np.array([0.0, 0.25]))
    assert inside(rows)
    share = (rows[..., 1] == UPPER[:, None, 1]).mean()
    # A quarter of the box beyond it is a fifth of all draws.
    assert abs(share - 0.2) < 0.02
    assert not (rows[..., 0] == UPPER[:, None, 0]).any()


def test_the_same_seed_gives_the_same_rows() -> None:
    one, two, other = sampling(3), sampling(3), sampling(4)
    np.testing.assert_array_equal(one.draw_first(9), two.draw_first(9))
    assert not np.array_equal(one.draw_first(9), other.draw_first(9))


def test_rows_that_are_not_allowed_are_drawn_again() -> None:
    def left(rows: Floats, groups: Ints) -> Flags:
        return np.asarray((rows[:, 1] < 0.0) | (groups == 1))

    search = NicheSampling(LOWER, UPPER, left, np.random.default_rng(1))
    rows = search.draw_first(200)
    # Half of the draws are allowed, and each has nine: one of five hundred is not.
    assert (rows[0, :, 1] < 0.0).mean() > 0.97
    assert 0.3 < (rows[1, :, 1] < 0.0).mean() < 0.7


def test_the_best_that_lie_apart_are_kept_behind_the_elite() -> None:
    deviation = np.array([1.0, 1.0])
    near = 0.9 * CLEARING_RADIUS_RATIO
    group = np.array(
        [[2.0, 0.0], [2.0 + near, near], [2.0 + 1.1 * CLEARING_RADIUS_RATIO, 0.0], [4.0, 5.0], [1.0, -9.0]]
    )
    rows = np.stack([group, group + np.array([5.0, 0.0])])
    costs = np.array([[1.0, 2.0, 3.0, 4.0, np.inf]] * 2)
    elite = np.array([[0.5, 0.5], [9.5, 9.5]])
    out = sampling().draw_next(rows, costs, 12, deviation, np.inf, elite)
    assert inside(out)
    for g in range(2):
        np.testing.assert_array_equal(out[g, 0], elite[g])
        # The second lies too near the first in both variables, and the last has no cost.
        np.testing.assert_array_equal(out[g, 1:4], rows[g, [0, 2, 3]])
        kept = out[g, :4]
        away = np.abs(out[g, 4:, None, :] - kept[None]).max(axis=2).min(axis=1)
        assert (away > 0.0).all()
        assert (away < 5.0).all()


def test_a_row_that_costs_too_much_is_kept_only_to_have_a_few() -> None:
    group = np.column_stack([np.linspace(0.5, 4.5, 10), np.linspace(-9.0, 8.0, 10)])
    rows, costs = np.stack([group, group + np.array([5.0, 0.0])]), np.tile(np.arange(10.0), (2, 1))
    elite = np.array([[2.5, 9.0], [7.5, 9.0]])
    for most, kept in ((6.0, 8), (1.0, MIN_SELECTED_COUNT)):
        out = sampling().draw_next(rows, costs, 30, np.array([0.1, 0.1]), most, elite)
        same = [sum((row == old).all() for old in group) for row in out[0]]
        assert sum(same) == kept - 1


def test_at_most_half_of_the_rows_are_kept() -> None:
    rows = sampling().draw_first(50)
    costs = np.tile(np.arange(50.0), (2, 1))
    out = sampling(2).draw_next(rows, costs, 20, np.array([1e-3, 1e-3]), np.inf, rows[:, 49].copy())
    same = [(out[0, :, None] == rows[0]).all(axis=2).any(axis=1)]
    assert np.sum(same) == 10
