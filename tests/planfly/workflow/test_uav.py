"""The UAV holds what scenario and aircraft set together, and refuses what the aircraft cannot fly."""

import math
from pathlib import Path
from typing import Any

import pytest

from flight.mission.placing import implied_scenario
from planfly.workflow.uav import choose_seed, load_uav, with_tightened_limits
from tests.mission_lines import mission, wp
from tests.setups import small_scenario
from world.errors import ScenarioError
from world.scenario import with_flight
from world.scenario_tables import FlightTable


def test_the_scenario_goes_before_the_aircrafts_own_numbers() -> None:
    own = load_uav(small_scenario())
    assert own.aircraft.name == "aerosonde"
    assert own.airspeed == own.aircraft.airspeed
    assert own.battery == pytest.approx(own.aircraft.battery_energy / 3600.0)
    table = {"airspeed_mps": 22.0, "max_bank_deg": 21.0, "battery_wh": 42.0}
    given = load_uav(small_scenario(flight=table))
    assert (given.airspeed, given.battery) == (22.0, 42.0)
    assert given.max_bank == pytest.approx(math.radians(21.0))


def test_without_a_scenario_aircraft_and_autopilot_limit_the_bank(tmp_path: Path) -> None:
    """An X8 banks 35 degrees, and nobody else sets a limit, neither without a scenario nor in one that states none."""
    file = tmp_path / "mine.params"
    world = implied_scenario(mission(wp(0, 0), wp(0, 900), wp(0, 1800)), None).scenario
    for roll_limit, bank in ((45.0, 35.0), (33.0, 33.0)):
        file.write_text(f"FW_R_LIM {roll_limit}\nNPFG_PERIOD 10\n", encoding="utf-8")
        own = load_uav(with_flight(world, aircraft="x8", autopilot="px4", params=str(file)))
        assert math.degrees(own.max_bank) == pytest.approx(bank)
    stated = FlightTable(aircraft="x8", max_bank_deg=25.0)
    limited = implied_scenario(mission(wp(0, 0), wp(0, 900)), None, stated).scenario
    assert math.degrees(load_uav(limited).max_bank) == pytest.approx(25.0)
    assert math.degrees(load_uav(small_scenario(flight={"aircraft": "x8"})).max_bank) == pytest.approx(35.0)


def test_a_parameter_files_cruise_speed_goes_before_the_aircrafts(tmp_path: Path) -> None:
    file = tmp_path / "mine.param"
    file.write_text("AIRSPEED_CRUISE 23\n", encoding="utf-8")
    table = {"autopilot": "ardupilot", "params": str(file)}
    assert load_uav(small_scenario(flight=table)).airspeed == 23.0
    assert load_uav(small_scenario(flight=table | {"airspeed_mps": 22.0})).airspeed == 22.0
    file.write_text("TRIM_ARSPD_CM 4000\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"mine\.param: AIRSPEED_CRUISE: 40: allowed 18\.\.31 m/s for aerosonde"):
        load_uav(small_scenario(flight=table))
    # A file that does not state it changes nothing.
    file.write_text("WP_RADIUS 50\n", encoding="utf-8")
    assert load_uav(small_scenario(flight=table)).airspeed == 25.0


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"flight": {"aircraft": "zeppelin"}}, r"small: flight\.aircraft: .*zeppelin"),
        ({"flight": {"airspeed_mps": 58.0}}, r"small: flight\.airspeed_mps: 58: allowed 18"),
    ],
)
def test_what_the_aircraft_cannot_fly_names_its_key(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_uav(small_scenario(**tables))


def test_a_scenario_states_any_airspeed_of_a_slow_aircraft() -> None:
    """A Zagi, a foam wing, flies from 11 m/s on, by the limits of its folder."""
    slow = small_scenario(flight={"aircraft": "zagi", "airspeed_mps": 11.0})
    assert load_uav(slow).airspeed == 11.0


def test_no_wind_is_refused_here_as_what_it_leaves_is_for_the_verdict_to_say() -> None:
    assert load_uav(small_scenario(wind={"speed_mps": 30.0}, flight={"airspeed_mps": 25.0})).airspeed == 25.0


def test_tightened_limits_are_those_of_the_changed_scenario() -> None:
    uav = load_uav(small_scenario())
    tight = small_scenario(limits={"max_turn_deg": 20.0}, flight={"max_bank_deg": 15.0})
    tightened = with_tightened_limits(uav, tight)
    assert tightened.limits.max_turn == pytest.approx(math.radians(20.0))
    assert tightened.max_bank == pytest.approx(math.radians(15.0))
    assert (tightened.aircraft, tightened.battery) == (uav.aircraft, uav.battery)
    assert tightened.limits.envelope is uav.limits.envelope
    assert uav.limits.max_turn != tightened.limits.max_turn


def test_the_seed_asked_for_goes_before_the_scenarios() -> None:
    planner = {"waypoints": 8, "population": 60, "generations": 25}
    seeded = small_scenario(planner=planner | {"seed": 5})
    assert choose_seed(seeded, 0) == 0
    assert choose_seed(seeded, None) == 5
    assert choose_seed(small_scenario(planner=planner), None) == 1
