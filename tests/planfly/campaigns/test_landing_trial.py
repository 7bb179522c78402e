"""The landing of a plan with a steep final is flown in dispersed conditions."""

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from flight.mission.commands import Command
from planfly.campaigns import landing_trial
from planfly.campaigns.landing_trial import landing_mission, steep_landing_failures
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import mission_of_plan
from planfly.workflow.uav import load_uav
from planner.plan import Plan
from world.scenario import load_scenario


@cache
def demo_plan() -> Plan:
    """The demo's plan: take-off, ridges, and a landing on a final of 4.9 degrees."""
    scenario = load_scenario("jacksboro")
    return make_plan(scenario, load_uav(scenario), 1)


def plan_with_final(degrees: float) -> Plan:
    """The demo's plan as if its final had another slope; its mission stays the same."""
    plan = demo_plan()
    assert plan.procedures is not None
    assert plan.procedures.descent is not None
    descent = replace(plan.procedures.descent, slope=math.tan(math.radians(degrees)))
    return replace(plan, procedures=replace(plan.procedures, descent=descent))


def count_flights(monkeypatch: pytest.MonkeyPatch, flyable: int) -> list[int]:
    """Replace flights by outcomes, of which the first ones are flyable; the list receives the flight numbers."""
    flown: list[int] = []

    def fly(_base: object, index: int) -> SimpleNamespace:
        flown.append(index)
        return SimpleNamespace(outcome="flyable" if index < flyable else "not flyable")

    monkeypatch.setattr(landing_trial, "fly_one", fly)
    return flown


@pytest.mark.parametrize(("flyable", "is_stated"), [(40, False), (38, False), (37, True), (0, True)])
def test_a_steep_final_that_holds_in_less_than_95_percent_is_stated(
    flyable: int, is_stated: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """38 of 40 are 95 %."""
    flown = count_flights(monkeypatch, flyable)
    plan = plan_with_final(6.0)
    texts = steep_landing_failures(plan, load_uav(plan.scenario))
    assert flown == list(range(40))
    assert bool(texts) == is_stated
    for text in texts:
        assert text.startswith(f"only {flyable} of 40 simulated landings succeed (95 % interval of the probability: ")
        assert "on a final of 6.0°. Use a strip or a landing course with a clear final of at most 5°" in text


def test_a_shallow_final_is_not_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    flown = count_flights(monkeypatch, 0)
    plan = demo_plan()
    assert steep_landing_failures(plan, load_uav(plan.scenario)) == ()
    assert flown == []


def test_the_landing_is_the_end_of_the_mission() -> None:
    """Its waypoints are those of the mission's last items: the path's end, the line-up, the glide, the landing."""
    plan = demo_plan()
    uav = load_uav(plan.scenario)
    whole = mission_of_plan(plan, uav)
    landing = landing_mission(whole)
    positions, expected = (
        [(item.lat_deg, item.lon_deg, item.alt) for item in mission.items if item.command == Command.NAV_WAYPOINT]
        for mission in (landing, whole)
    )
    assert positions == expected[-3:]
    assert [item.seq for item in landing.items] == list(range(1, len(landing.items) + 1))
    assert landing.items[-1].command == Command.NAV_LAND
    assert landing.home == whole.home
    assert np.isfinite(positions).all()
