"""Traps: paths that turn back or go round, certified, and not looked for where a straight frame does."""

from collections.abc import Callable

import numpy as np
import pytest

import planner.search.plan_path as whole
from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.plan import Certificate
from planner.search.plan_path import plan_path
from planner.search.search_state import Search
from world.geometry import leg_courses
from world.scenario import Scenario, load_scenario


@pytest.mark.parametrize("name", ["trap-u", "trap-valley", "trap-wall", "trap-spiral"])
def test_traps_are_left_by_ways_that_no_straight_frame_holds(
    name: str, make_limits: Callable[[Scenario], Limits]
) -> None:
    scenario = load_scenario(name)
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    assert plan.safe, plan.certificate.problems
    frame = rotated_frame(scenario.start, scenario.destination)
    assert np.diff(frame.rotate(plan.waypoints)[:, 0]).min() < -100.0


def test_the_spiral_goes_round(make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("trap-spiral")
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    courses = np.unwrap(leg_courses(plan.waypoints))
    assert np.abs(courses - courses[0]).max() > 1.25 * np.pi


def test_it_is_not_looked_for_where_a_straight_frame_holds_a_short_path(
    make_limits: Callable[[Scenario], Limits], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(_search: Search, _found: object) -> tuple[np.ndarray, Certificate]:
        raise AssertionError("a route that turns back was looked for")

    monkeypatch.setattr(whole, "search_turning_back", refused)
    for name in ("hard-07", "hard-60"):
        scenario = load_scenario(name)
        assert plan_path(scenario, make_limits(scenario), seed=1).safe
