"""The kernels of planning are called with the types that a search calls them with: none is compiled after."""

import pytest

from planfly.workflow.uav import load_uav
from planner.search.kernel_calls import PARTS, call_kernels
from planner.search.plan_path import plan_path
from world.compile_events import notify_before_compiling
from world.scenario import load_scenario


def test_a_plan_compiles_nothing_after_them() -> None:
    scenario = load_scenario("tight")
    limits = load_uav(scenario).limits
    for part in PARTS:
        call_kernels(part, scenario, limits)
    compiled: list[None] = []
    with notify_before_compiling(lambda: compiled.append(None)):
        assert plan_path(scenario, limits, seed=1).safe
    assert compiled == []


def test_parts_are_named() -> None:
    scenario = load_scenario("tight")
    with pytest.raises(KeyError):
        call_kernels("none", scenario, load_uav(scenario).limits)
