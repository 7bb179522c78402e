"""The parameters of a flight: whose they are, and which of a person's are flown with or left out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import aircraft_names, load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.open_settings import OPEN_SETTINGS
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.process import (
    FLYING,
    SIMULATION,
    collect_arduplane_parameters,
    load_aircraft_parameters,
    load_user_parameters,
)
from flight.autopilots.sitl.servos import load_servo_map
from flight.simulation.setup import FlightSetup
from tests.setups import setup_maker
from world.errors import ParameterError
from world.scenario import with_flight

AEROSONDE = load_aircraft("aerosonde")
SERVOS = load_servo_map(AEROSONDE)


def setup_at(speed: float = 25.0, params: Path | None = None) -> FlightSetup:
    setup = setup_maker(AEROSONDE)(np.array([[0.0, 0.0, 500.0], [0.0, 900.0, 500.0]]), speeds=speed)
    if params is None:
        return setup
    scenario = with_flight(setup.scenario, params=str(params))
    return replace(setup, scenario=scenario, autopilot=ArduPlane(ArduPilotParameters.load(AEROSONDE, params)))


def test_the_simulations_the_servos_and_the_aircrafts_are_all_given() -> None:
    found = collect_arduplane_parameters(setup_at(), AEROSONDE, SERVOS, {})
    assert found.values.items() >= SIMULATION.items() | SERVOS.parameters().items()
    assert (found.values["TRIM_THROTTLE"], found.values["ROLL_LIMIT_DEG"]) == (77.0, 30.0)
    assert (found.changed, found.unused) == ({}, ())


@pytest.mark.parametrize(("name", "monitor"), [("aerosonde", 4.0), ("c172x", 0.0)])
def test_the_battery_is_measured_where_there_is_one(name: str, monitor: float) -> None:
    aircraft = load_aircraft(name)
    given = collect_arduplane_parameters(setup_at(), aircraft, load_servo_map(aircraft), {}).values
    assert given["BATT_MONITOR"] == monitor
    assert given.get("BATT_FS_LOW_ACT", 0.0) == 0.0


def test_the_missions_speed_is_the_cruise_speed_unless_the_person_has_one() -> None:
    assert collect_arduplane_parameters(setup_at(22.0), AEROSONDE, SERVOS, {}).values["AIRSPEED_CRUISE"] == 22.0
    own = {"AIRSPEED_CRUISE": 23.0}
    assert collect_arduplane_parameters(setup_at(22.0), AEROSONDE, SERVOS, own).values["AIRSPEED_CRUISE"] == 23.0


def test_a_persons_come_on_top_and_what_they_change_is_known() -> None:
    own = {"ROLL_LIMIT_DEG": 40.0, "TRIM_THROTTLE": 77.0, "NAVL1_PERIOD": 15.0}
    found = collect_arduplane_parameters(setup_at(), AEROSONDE, SERVOS, own)
    assert (found.values["ROLL_LIMIT_DEG"], found.values["NAVL1_PERIOD"]) == (40.0, 15.0)
    # What states the aircraft's own value changes nothing.
    assert found.changed == {"ROLL_LIMIT_DEG": 40.0, "NAVL1_PERIOD": 15.0}


@pytest.mark.parametrize("name", ["SERVO1_REVERSED", "SIM_RATE_HZ", "ARSPD_TYPE", "SERIAL0_BAUD", "INS_ACCOFFS_X"])
def test_a_persons_of_their_hardware_are_left_out(name: str) -> None:
    found = collect_arduplane_parameters(setup_at(), AEROSONDE, SERVOS, {name: 99.0})
    assert found.values.get(name) != 99.0
    assert (found.changed, found.unused) == ({}, (name,))


def test_a_program_flies_without_an_airspeed_sensor_where_the_file_says_so() -> None:
    given = [
        collect_arduplane_parameters(setup_at(), AEROSONDE, SERVOS, own).values for own in ({}, {"ARSPD_USE": 0.0})
    ]
    assert [values["ARSPD_USE"] for values in given] == [1.0, 0.0]


def test_a_program_gets_the_settings_of_the_attitude_controllers() -> None:
    own = {"RLL2SRV_RMAX": 40.0, "RLL2SRV_TCONST": 0.7, "PTCH2SRV_RMAX_UP": 40.0, "PTCH2SRV_TCONST": 0.7}
    assert collect_arduplane_parameters(setup_at(), AEROSONDE, SERVOS, own).changed == own


def test_a_persons_file_is_read_by_present_names_and_units(tmp_path: Path) -> None:
    file = tmp_path / "mine.parm"
    file.write_text("LIM_ROLL_CD 3500\nTRIM_ARSPD_CM 2400\nRLL_RATE_P,0.2\nSERVO3_MAX 1900\n", encoding="utf-8")
    assert load_user_parameters(setup_at(params=file)) == {
        "ROLL_LIMIT_DEG": 35.0,
        "AIRSPEED_CRUISE": 24.0,
        "RLL_RATE_P": 0.2,
        "SERVO3_MAX": 1900.0,
    }
    assert load_user_parameters(setup_at()) == {}


@pytest.mark.parametrize("name", aircraft_names())
def test_each_aircrafts_speeds_are_its_own(name: str) -> None:
    aircraft = load_aircraft(name)
    found = load_aircraft_parameters(aircraft)
    speeds = [found[f"AIRSPEED_{kind}"] for kind in ("MIN", "CRUISE", "MAX")]
    assert speeds == [aircraft.airspeed_min, aircraft.airspeed, aircraft.airspeed_max]
    # Each is one that both the law and a real ArduPlane fly with.
    assert ArduPilotParameters.load(aircraft).by_origin("aircraft").items() <= found.items()


def test_an_aircraft_without_parameters_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"ardupilot\.parm"):
        load_aircraft_parameters(replace(AEROSONDE, folder=tmp_path))


def test_a_program_gets_the_settings_that_it_is_said_to_fly() -> None:
    """Flaps it gets, too, and planfly's aircraft have none."""
    given = {name for name in OPEN_SETTINGS if name.startswith(FLYING) and "FLAP" not in name}
    assert {name for name, setting in OPEN_SETTINGS.items() if setting.by_program} == given
