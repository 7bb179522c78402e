"""The clearance buffer grows from what a fixed end leaves of it."""

from collections.abc import Callable

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import make_problem
from planner.plan import Violation
from world.scenario import Scenario


def test_buffer_grows_from_a_low_start(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    low = small(start={"east_m": 0, "north_m": 0, "height_m": 31})
    data = make_problem(low, make_limits(low)).search
    assert 0.9 < data.start_buffer < 1.0
    path = np.array([[0, 0, low.start[2]], [1500, -1500, 200], [4200, -1500, 200], [6000, 0, 150]])
    assert not graded_scores(data, path[None])[0][0, Violation.TERRAIN]
    path[1, 2] = 30.0
    assert graded_scores(data, path[None])[0][0, Violation.TERRAIN] > 0
