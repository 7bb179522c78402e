"""The bank limit of a flight, named by who sets it: aircraft, autopilot or scenario, whichever is lowest."""

import math
from dataclasses import replace

import pytest

from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Mission
from flight.mission.placing import implied_scenario
from logs.verdict.measures.bank_limit import bank_limit_text
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from tests.mission_lines import mission, wp
from world.scenario import Scenario, with_flight

# A circle of 60 m, which at 18 m/s takes 28.8 degrees in calm air; in 8 m/s of wind 26 m/s, and 49.
LOITER: Mission = mission(wp(0, 0), wp(0, 900), wp(0, 1800, command=18, p="2 0 60 1"), wp(0, 4000))


def scenario_with(stated: float | None, in_file: bool) -> Scenario:
    """The scenario of a mission for an X8, whose bank limit is 35°; or a scenario's own with this limit."""
    made = with_flight(implied_scenario(LOITER, None).scenario, aircraft="x8")
    if stated is None:
        return made
    return replace(with_flight(made, max_bank_deg=stated), external=not in_file)


@pytest.mark.parametrize(
    ("roll_limit", "scenario_limit", "bank", "owner"),
    [
        # Without a scenario only aircraft and autopilot limit the bank.
        (50.0, None, 35.0, "the aircraft's"),
        (32.0, None, 32.0, "PX4's"),
        (50.0, 30.0, 30.0, "the scenario's"),
        (50.0, 45.0, 35.0, "the aircraft's"),
    ],
)
def test_the_lowest_bank_limit_is_named(
    roll_limit: float, scenario_limit: float | None, bank: float, owner: str
) -> None:
    scenario = scenario_with(scenario_limit, in_file=True)
    uav = load_uav(scenario)
    law = Px4(Px4Parameters.defaults()).with_parameters(FW_R_LIM=roll_limit)
    limits = replace(uav.limits, max_bank=min(uav.limits.max_bank, law.turns.max_bank))
    setup = make_setup(scenario, replace(uav, autopilot=law, limits=limits), LOITER, 1)
    assert math.degrees(setup.max_bank) == pytest.approx(bank)
    assert bank_limit_text(setup) == f"{owner} bank limit of {bank:.0f}°"


@pytest.mark.parametrize(
    ("roll_limit", "text"),
    [
        (50.0, "the aircraft's bank limit of 35° (a guess: state --bank)"),
        # The autopilot has the same limit, so that a higher limit of the aircraft would not help.
        (35.0, "PX4's bank limit of 35°"),
    ],
)
def test_a_guessed_limit_is_named_only_if_it_decides_alone(roll_limit: float, text: str) -> None:
    scenario = scenario_with(None, in_file=True)
    uav = load_uav(scenario)
    law = Px4(Px4Parameters.defaults()).with_parameters(FW_R_LIM=roll_limit)
    limits = replace(uav.limits, max_bank=min(uav.limits.max_bank, law.turns.max_bank))
    setup = make_setup(scenario, replace(uav, autopilot=law, limits=limits), LOITER, 1)
    guessed = replace(setup.limits.envelope, bank_guessed=True)
    setup = replace(setup, limits=replace(setup.limits, envelope=guessed))
    assert bank_limit_text(setup) == text
