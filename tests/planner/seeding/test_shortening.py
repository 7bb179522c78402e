"""Steps down a path stay in the box, and break less from start to end."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from benchmarks.planning.smooth_search import Programme
from benchmarks.task import is_safe, make_task
from planner.evaluation.problem import make_problem
from planner.search.plan_path import plan_path
from planner.seeding import shortening
from planner.seeding.shortening import (
    MAX_MODELS,
    MAX_STEP_M,
    ROUND_COUNT,
    STEPS_PER_ROUND,
    begin_shortening,
    continue_shortening,
    resample,
    shorten_path,
)
from world.arrays import Floats
from world.geometry import path_length
from world.scenario import Scenario


def test_waypoints_stay_on_the_map_and_between_floor_and_ceiling() -> None:
    data = make_task("hard-60").problem.search._replace(ceiling=520.0, east=9700.0)
    start = resample(np.array([data.start, [9650.0, 3000.0, 515.0], data.destination]), 14)
    path = continue_shortening(data, begin_shortening(data, start, 10, 0.0, False), 0.0, ROUND_COUNT).path
    assert path[:, 2].max() <= 520.0
    assert path[:, 0].max() <= 9700.0
    np.testing.assert_array_equal(path[[0, -1]], start[[0, -1]])


def test_no_round_moves_a_waypoint_further_than_its_steps() -> None:
    data = make_task("hard-60").problem.search
    start = resample(np.array([data.start, [2000.0, 8000.0, 590.0], data.destination]), 20)
    under_way = begin_shortening(data, start, 10, 0.0, False)
    before = under_way.path.copy()
    for _ in range(ROUND_COUNT):
        under_way = continue_shortening(data, under_way, 0.0, 1)
        moved = float(np.abs(under_way.path - before).max())
        assert moved <= STEPS_PER_ROUND * MAX_STEP_M + 1e-9
        assert moved > 1.0 or under_way.rounds > 1
        before = under_way.path.copy()
    assert under_way.rounds == ROUND_COUNT
    # Nothing is left to do.
    np.testing.assert_array_equal(continue_shortening(data, under_way, 0.0, ROUND_COUNT).path, before)


# ----------------------------------------------------------------------
# Shortened paths against SciPy's SLSQP on the same problem, and against lengths by plain geometry.


def first_path(name: str) -> Floats:
    task = make_task(name)
    return plan_path(task.scenario, task.problem.limits, seed=1, first_safe=True).waypoints


@pytest.mark.parametrize("name", ["hard-30", "hard-60"])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_it_is_as_short_as_slsqp_makes_it(name: str) -> None:
    task, start = make_task(name), first_path(name)
    path, models = shorten_path(task.problem.search, start)
    theirs = Programme(task).shortened(start)
    assert is_safe(task.certificate(path))
    assert task.length_ratio(path) < task.length_ratio(start) - 0.001
    assert task.length_ratio(path) < 1.001 * task.length_ratio(theirs)
    assert 10 < models <= MAX_MODELS


def test_a_string_about_a_sphere(make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]) -> None:
    """From the side of a sphere it goes round it: tangents and an arc, or little more by straight legs outside."""
    unit = {"east_m": 3000.0, "north_m": 0.0, "kill_radius_m": 1000.0, "kill_scale_m": 200.0, "amsl_m": 0.0}
    unit |= {"detection_radius_m": 1000.0, "detection_scale_m": 200.0}
    scenario = small(
        terrain={"kind": "flat", "amsl_m": 0},
        threats=[unit],
        limits={"max_climb_deg": 20, "max_dive_deg": 20, "max_turn_deg": 45},
        # At the height of both ends the sphere is a circle, and there is no room above.
        area={"east_m": [-500, 6500], "north_m": [-3000, 3000], "ceiling_amsl_m": 154},
    )
    data = make_problem(scenario, make_limits(scenario)).search
    start = np.column_stack([np.linspace(0.0, 6000.0, 14), 1500.0 * np.sin(np.linspace(0.0, math.pi, 14))])
    path, _ = shorten_path(data, np.column_stack([start, np.full(14, 150.0)]))
    radius = math.sqrt((1000.0 + data.kill_margin) ** 2 - 150.0**2)
    string = 2.0 * math.sqrt(3000.0**2 - radius**2) + 2.0 * radius * math.asin(radius / 3000.0)
    # Twelve waypoints on the tangents' ends and between: an arc of a rad is longer by 1/12 of a leg's square.
    assert string * 0.9999 < path_length(path) < string * 1.002
    np.testing.assert_allclose(path[[0, -1]], [[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]], atol=1e-9)


def test_in_the_open_it_is_straight(make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]) -> None:
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[])
    data = make_problem(scenario, make_limits(scenario)).search
    start = np.column_stack([np.linspace(0.0, 6000.0, 8), [0, 300, -200, 500, 100, -400, 200, 0], np.full(8, 150.0)])
    path, _ = shorten_path(data, start)
    assert path_length(path) == pytest.approx(6000.0, rel=1e-4)


def test_many_missiles_are_looked_at_in_slices_with_the_same_result(monkeypatch: pytest.MonkeyPatch) -> None:
    data, start = make_task("hard-60").problem.search, first_path("hard-60")
    asked: list[int] = []
    whole, models = shorten_path(data, start, check_stop=lambda: asked.append(0))
    assert len(asked) == 1
    monkeypatch.setattr(shortening, "PAIRS_PER_CHECK", 1)
    sliced, again = shorten_path(data, start, check_stop=lambda: asked.append(0))
    assert len(asked) == 1 + shortening.ROUND_COUNT
    np.testing.assert_array_equal(whole, sliced)
    assert models == again


def test_points_at_equal_distances_lie_on_the_way() -> None:
    way = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 100.0, 50.0]])
    points = resample(way, 30)
    steps = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    assert len(points) == 30
    # One step cuts the corner.
    assert np.count_nonzero(np.abs(steps - steps.max()) > 1e-9) == 1
    np.testing.assert_array_equal(points[[0, -1]], way[[0, -1]])
