"""Steps down a path stay in the box, and break less from start to end."""

import numpy as np

from planner.seeding.path_shortening import evenly
from planner.seeding.shortening_kernels import LONGEST_STEP, ROUNDS, STEPS, begin_shortening, shorten_on
from tests.bench.task import make_task


def test_waypoints_stay_on_the_map_and_between_floor_and_ceiling() -> None:
    data = make_task("hard-60").problem.search._replace(ceiling=520.0, east=9700.0)
    start = evenly(np.array([data.start, [9650.0, 3000.0, 515.0], data.destination]), 14)
    path = shorten_on(data, begin_shortening(data, start, 10, 0.0), 0.0, ROUNDS).path
    assert path[:, 2].max() <= 520.0
    assert path[:, 0].max() <= 9700.0
    np.testing.assert_array_equal(path[[0, -1]], start[[0, -1]])


def test_no_round_moves_a_waypoint_further_than_its_steps() -> None:
    data = make_task("hard-60").problem.search
    start = evenly(np.array([data.start, [2000.0, 8000.0, 590.0], data.destination]), 20)
    under_way = begin_shortening(data, start, 10, 0.0)
    before = under_way.path.copy()
    for _ in range(ROUNDS):
        under_way = shorten_on(data, under_way, 0.0, 1)
        moved = float(np.abs(under_way.path - before).max())
        assert moved <= STEPS * LONGEST_STEP + 1e-9
        assert moved > 1.0 or under_way.rounds > 1
        before = under_way.path.copy()
    assert under_way.rounds == ROUNDS
    # Nothing is left to do.
    np.testing.assert_array_equal(shorten_on(data, under_way, 0.0, ROUNDS).path, before)
