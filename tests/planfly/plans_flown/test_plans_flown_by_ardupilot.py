"""Plans of the default planner, flown by the autopilot that they are made for: nothing comes to harm."""

from pathlib import Path

import pytest

from flight.mission.from_plan import plan_mission
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from planfly.workflow.uav import load_uav
from tests.autopilot_plans import TERRAINS, harm_of, plan_scenario
from tests.autopilots import need_arduplane
from tests.soak import SOAK, scaled

# On each terrain in a soak; otherwise on two with the law, and once with the program itself.
NUMBERS = range(scaled(100, 0)) if SOAK else (4, 11)
REAL_NUMBERS = range(scaled(100, 0)) if SOAK else (7,)


def fly(number: int, autopilot: Path | None) -> None:
    """Plan, export and fly the scenario of this number with satellites' errors, in its wind and gusts."""
    scenario = plan_scenario(number)
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, number + 1)
    assert plan.safe, plan.certificate.problems
    mission = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
    setup = make_setup(scenario, uav, mission, number + 1, plan=plan)
    assert setup.nav == "gnss"
    flown = fly_and_judge(setup, FlightTask(autopilot=autopilot))
    assert flown.ended == "completed"
    harm = harm_of(scenario, plan.waypoints, flown.track)
    assert harm.text(scenario) == ""
    assert flown.verdict.flyable, [(found.rule, found.reason) for found in flown.verdict.findings if found.ok is False]


@pytest.mark.parametrize("number", NUMBERS)
def test_nothing_comes_to_harm_with_the_law(number: int) -> None:
    fly(number, None)


@pytest.mark.parametrize("number", REAL_NUMBERS)
def test_nothing_comes_to_harm_with_the_program(number: int) -> None:
    fly(number, need_arduplane())


def test_what_is_flown_is_on_each_terrain() -> None:
    names = {plan_scenario(number).name.split()[0] for number in (0, 4, 11)}
    assert names == set(TERRAINS)
