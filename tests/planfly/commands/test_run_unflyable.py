"""`steep` and `tight`: the flight fails where the plan asks too much, and only there."""

import dataclasses

import pytest

from flight.mission.from_plan import plan_mission
from logs.verdict.verdict import Verdict
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import fly_and_judge
from planfly.workflow.uav import Uav, load_uav
from planner.plan import Plan
from world.scenario import load_scenario


def judge(plan: Plan, uav: Uav, first: int, last: int) -> Verdict:
    """The verdict on waypoints first..last of a plan, flown as a mission of their own."""
    mission = plan_mission(plan, uav.airspeed, uav.max_bank)
    # Item 0 sets the speed; item k + 1 is waypoint k.  Nobody flies there from home.
    part = dataclasses.replace(mission, home=None, items=(mission.items[0], *mission.items[first + 1 : last + 2]))
    setup = make_setup(plan.scenario, uav, part, 1)
    return fly_and_judge(setup).verdict


def failing_legs(verdict: Verdict, legs: int) -> set[int]:
    """Legs that a failed finding names, and those beside the waypoints that one names."""
    out: set[int] = set()
    for finding in verdict.findings:
        kind, number = finding.place.kind, finding.place.index
        if finding.ok is False and number is not None:
            out |= {number} if kind == "leg" else {number - 1, number} if kind == "waypoint" else set()
    return {leg for leg in out if 0 <= leg < legs}


@pytest.mark.parametrize(("name", "rule"), [("steep", "slope"), ("tight", "turn")])
def test_the_rest_of_it_flies(name: str, rule: str) -> None:
    scenario = load_scenario(name)
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, 1)
    assert plan.safe
    legs = len(plan.waypoints) - 1
    whole = judge(plan, uav, 0, legs)
    assert not whole.flyable
    assert rule in {finding.rule for finding in whole.findings if finding.ok is False}
    bad = failing_legs(whole, legs)
    assert 0 < len(bad) < legs - 2
    flown = 0
    starts = [leg for leg in range(legs) if leg not in bad and (leg == 0 or leg - 1 in bad)]
    for first in starts:
        last = min([leg for leg in bad if leg > first], default=legs)
        verdict = judge(plan, uav, first, last)
        assert verdict.flyable, (first, last, verdict.summary)
        flown += last - first
    assert flown == legs - len(bad)
