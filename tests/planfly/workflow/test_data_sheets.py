"""A folder from a data sheet: it does what the sheet says, flies by both laws, and is made whole or not at all."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from aircraft.data_sheet import DataSheet, check_sheet, size_aircraft
from aircraft.uncertainty import read_draws, read_uncertainty
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.dynamics.characteristics import level_flight_modes
from flight.dynamics.envelope_tables import load_envelope
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import fastest_level_flight, full_throttle_climb, slowest_level_flight, steady_flight
from flight.simulation.simulate import Flight, fly_to_end
from planfly.workflow.data_sheets import (
    AircraftParameters,
    climb_deviation,
    factor_effect,
    make_data_sheet_folder,
    overridden_texts,
    read_aircraft_parameters,
    with_parameters,
)
from tests.setups import setup_maker
from world.errors import FlightError, ParameterError

FOAM = DataSheet(mass=2.1, span=1.6, cruise=15.0, stall=10.0, layout="wing")
FILES = {
    *("README.md", "ardupilot.parm", "ardupilot.toml", "draws.csv", "gains.toml", "uncertainty.toml"),
    *("foam.toml", "foam.xml"),
}


@pytest.fixture(scope="module")
def foam(tmp_path_factory: pytest.TempPathFactory) -> Aircraft:
    return make_data_sheet_folder(tmp_path_factory.mktemp("sheets") / "foam", FOAM)


def test_the_model_does_what_the_sheet_says(foam: Aircraft) -> None:
    assert {file.name for file in foam.folder.iterdir()} == FILES
    fdm = Fdm(foam, is_tested=True)
    climb, fast, slow = (
        full_throttle_climb(fdm, 15.0, 500.0),
        fastest_level_flight(fdm, 500.0),
        slowest_level_flight(fdm, 0.0),
    )
    assert climb is not None
    assert fast is not None
    assert slow is not None
    assert math.degrees(climb.climb) == pytest.approx(12.0, abs=0.3)
    assert fast.airspeed == pytest.approx(1.65 * 15.0, rel=0.01)
    # The propeller's pull carries some of it: up to a tenth.
    assert 0.9 * 10.0 < slow.airspeed < 10.0
    assert (foam.stall_speed, foam.mass, foam.wing_span, foam.airspeed) == (10.0, 2.1, 1.6, 15.0)


def test_a_battery_that_level_flight_empties_at_once_is_refused(tmp_path: Path) -> None:
    """25 kg at 25 m/s with a drag of a twentieth of the weight need 300 W and more: 0.6 Wh last for 7 s at most."""
    sheet = DataSheet(mass=25.0, span=4.0, cruise=25.0, stall=16.0, volts=3.0, energy=0.6 * 3600.0)
    with pytest.raises(
        FlightError, match=r"^battery 3 V, 0\.6 Wh: level flight .* empties the battery in [1-7] s; expected at"
    ):
        make_data_sheet_folder(tmp_path / "heavy", sheet)
    assert not (tmp_path / "heavy").exists()


def test_it_is_stable(foam: Aircraft) -> None:
    modes = {mode.name: mode for mode in level_flight_modes(foam, 15.0)}
    assert modes["short period"].damping > 0.3
    assert modes["Dutch roll"].damping > 0.05


@pytest.mark.parametrize("law", ["planfly", "arduplane"])
def test_it_flies(foam: Aircraft, law: str) -> None:
    way = np.array([[0.0, 0.0, 500.0], [0.0, 500.0, 520.0], [400.0, 800.0, 540.0], [900.0, 700.0, 520.0]])
    setup = setup_maker(foam)(way, speeds=15.0, wind=(3.0, 200.0), turbulence="light", bank_deg=35.0)
    if law == "arduplane":
        setup = replace(setup, autopilot=ArduPlane(ArduPilotParameters.load(foam)))
    flown = fly_to_end(Flight(setup, foam))
    assert flown.ended == "completed"
    if law == "planfly":
        assert np.abs(flown.track.cross_track[300:]).max() < 3.0
        assert np.abs(flown.track.height_error[300:]).max() < 2.0


def test_its_intervals_are_those_of_its_draws(foam: Aircraft) -> None:
    known = read_uncertainty(foam.folder)
    assert known is not None
    # A guessed climb is known to 6 degrees; the draws give what is stated.
    assert math.degrees(known.climb_sd) == pytest.approx(6.0, abs=0.1)
    draws = read_draws(foam.folder / "draws.csv")
    angles, tops, powers = [], [], []
    for seed in range(40):
        fdm = Fdm(foam, is_tested=True, variation=Variation(properties=draws.properties(seed)))
        climb = full_throttle_climb(fdm, 15.0, 500.0)
        assert climb is not None
        angles.append(math.degrees(climb.climb))
        top = fastest_level_flight(fdm, 500.0)
        assert top is not None
        tops.append(top.airspeed)
        level = steady_flight(fdm, 15.0, 500.0)
        assert level is not None
        fdm.apply_trim(level.vector())
        powers.append(math.log(float(fdm.read().power)))
    # The fastest level flight is 25 m/s, with the deviation that the same draws have.
    assert np.std(tops) == pytest.approx(known.max_speed_sd, rel=0.4)
    assert np.std(powers) == pytest.approx(known.power_sd, rel=0.25)
    # Least drag 0.35 by its share of 0.7 of the drag, efficiency 0.29, little else: as for 22 real aircraft.
    assert known.power_sd == pytest.approx(0.37, abs=0.03)
    assert load_envelope(foam).fastest_sd == known.max_speed_sd > 0.5
    # 40 draws give a deviation to about 11 % (one standard deviation).
    assert np.std(angles) == pytest.approx(6.0, rel=0.4)


def test_a_stated_climb_is_known_well(tmp_path: Path) -> None:
    """An aircraft with more drag has the motor for its climb: draws follow the stated climb, not the drag."""
    made = make_data_sheet_folder(tmp_path / "foam", replace(FOAM, climb=math.radians(12.0)))
    known, draws = read_uncertainty(made.folder), read_draws(made.folder / "draws.csv")
    assert known is not None
    assert math.degrees(known.climb_sd) == pytest.approx(1.5, abs=0.01)
    assert not known.climb_guessed
    climbs = []
    for seed in range(20):
        climb = full_throttle_climb(
            Fdm(made, is_tested=True, variation=Variation(properties=draws.properties(seed))), 15.0, 500.0
        )
        assert climb is not None
        climbs.append(math.degrees(climb.climb))
    assert np.std(climbs) == pytest.approx(1.5, rel=0.5)
    drag, thrust = (draws.values[:, draws.names.index(f"ident/{name}")] for name in ("zero-lift-drag", "thrust"))
    assert np.corrcoef(np.log(drag), np.log(thrust))[0, 1] > 0.15


def test_it_surely_flies_as_fast_as_it_cruises(tmp_path: Path) -> None:
    """The cruise speed is stated, not guessed: a sheet whose top is 1 m/s above it is sure of that much."""
    made = make_data_sheet_folder(tmp_path / "foam", replace(FOAM, top=16.0, climb=math.radians(4.0)))
    table = load_envelope(made)
    assert table.level_speeds(500.0)[1] == pytest.approx(16.0, abs=0.3)
    assert table.with_margin().level_speeds(500.0)[1] == pytest.approx(15.0, abs=0.1)


@pytest.mark.parametrize("energy", [0.0, 74.0 * 3600.0])
def test_a_battery_that_nobody_stated_is_a_guess(tmp_path: Path, energy: float) -> None:
    made = make_data_sheet_folder(tmp_path / "foam", replace(FOAM, volts=14.8, energy=energy))
    assert load_envelope(made).battery_guessed is (energy == 0.0)


@pytest.mark.parametrize("bank_deg", [0.0, 40.0])
def test_a_bank_limit_that_nobody_stated_is_a_guess(tmp_path: Path, bank_deg: float) -> None:
    made = make_data_sheet_folder(tmp_path / "foam", replace(FOAM, bank=math.radians(bank_deg)))
    assert load_envelope(made).bank_guessed is (bank_deg == 0.0)
    assert math.degrees(made.max_bank) == pytest.approx(bank_deg or 35.0)


def test_parameters_are_data(tmp_path: Path) -> None:
    file = tmp_path / "mine.parm"
    # TRIM_THROTTLE 45 is ArduPlane's own value and says nothing.
    file.write_text("AIRSPEED_CRUISE 16\nARSPD_FBW_MIN 12\nTECS_CLMB_MAX 4\nTRIM_THROTTLE 45\nLIM_ROLL_CD 3000\n")
    stated = read_aircraft_parameters(file).values
    assert stated == {"AIRSPEED_CRUISE": 16.0, "AIRSPEED_MIN": 12.0, "TECS_CLMB_MAX": 4.0, "ROLL_LIMIT_DEG": 30.0}
    made = make_data_sheet_folder(tmp_path / "mine", DataSheet(2.1, 1.6, 0.0, 0.0), file)
    assert (made.airspeed, made.stall_speed) == (16.0, 10.0)
    assert math.degrees(made.max_bank) == pytest.approx(30.0)
    climb = full_throttle_climb(Fdm(made, is_tested=True), 16.0, 500.0)
    assert climb is not None
    # 4 m/s at 16 m/s.
    assert climb.climb == pytest.approx(math.asin(0.25), abs=math.radians(0.4))
    known = read_uncertainty(made.folder)
    assert known is not None
    assert math.degrees(known.climb_sd) == pytest.approx(1.5, abs=0.1)
    assert "TECS_CLMB_MAX 4\n" in (made.folder / "ardupilot.parm").read_text()


def test_parameters_of_px4_are_the_same_data_by_its_own_names(tmp_path: Path) -> None:
    """FW_AIRSPD_TRIM 15 is PX4's own value and says nothing; its stall speed and FW_R_LIM 50 are stated as such."""
    file = tmp_path / "mine.params"
    lines = ("FW_AIRSPD_TRIM 16", "FW_AIRSPD_MIN 13", "FW_AIRSPD_STALL 10", "FW_T_CLMB_MAX 4", "FW_R_LIM 40")
    file.write_text("".join(f"1\t1\t{line.replace(' ', chr(9))}\t9\n" for line in lines), encoding="ascii")
    stated = read_aircraft_parameters(file)
    assert stated.values == {
        "AIRSPEED_CRUISE": 16.0,
        "AIRSPEED_MIN": 13.0,
        "AIRSPEED_STALL": 10.0,
        "TECS_CLMB_MAX": 4.0,
        "ROLL_LIMIT_DEG": 40.0,
    }
    assert set(stated.texts.values()) == set(lines)
    made = make_data_sheet_folder(tmp_path / "mine", DataSheet(2.1, 1.6, 0.0, 0.0), file)
    assert (made.airspeed, made.stall_speed) == (16.0, 10.0)
    assert math.degrees(made.max_bank) == pytest.approx(40.0)
    assert "From the parameter file: FW_AIRSPD_TRIM 16, " in (made.folder / "README.md").read_text()
    file.write_text("1\t1\tFW_AIRSPD_TRIM\t15\t9\n1\t1\tFW_R_LIM\t50\t9\n", encoding="ascii")
    assert read_aircraft_parameters(file).values == {"ROLL_LIMIT_DEG": 50.0}


def test_a_bank_limit_at_the_default_is_stated(tmp_path: Path) -> None:
    """ArduPlane's default is 45 degrees."""
    file = tmp_path / "mine.parm"
    file.write_text("ROLL_LIMIT_DEG 45\nTECS_CLMB_MAX 5\n", encoding="ascii")
    assert read_aircraft_parameters(file).values == {"ROLL_LIMIT_DEG": 45.0}
    made = make_data_sheet_folder(tmp_path / "mine", FOAM, file)
    assert math.degrees(made.max_bank) == pytest.approx(45.0)
    assert "bank_guessed" not in (made.folder / "uncertainty.toml").read_text()
    assert "From the parameter file: ROLL_LIMIT_DEG 45.\n" in (made.folder / "README.md").read_text()


def test_a_parameter_file_of_no_aeroplane_is_refused(tmp_path: Path) -> None:
    for text in ("MPC_XY_CRUISE 5\nMC_ROLL_P 6\n", "FOO 1\nBAR 2\n"):
        file = tmp_path / "other.params"
        file.write_text(text, encoding="ascii")
        with pytest.raises(ParameterError, match=r"^[^\n]+$"):
            read_aircraft_parameters(file)


def test_what_the_sheet_states_applies_instead_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.parm"
    file.write_text("AIRSPEED_CRUISE 19\nROLL_LIMIT_DEG 50\nAIRSPEED_MIN 13\n", encoding="ascii")
    made = make_data_sheet_folder(tmp_path / "mine", replace(FOAM, cruise=18.0, stall=10.0), file)
    readme, parameters = (made.folder / "README.md").read_text(), (made.folder / "ardupilot.parm").read_text()
    assert made.airspeed == 18.0
    assert "AIRSPEED_CRUISE 18\n" in parameters
    # The autopilot's own minimum stays, above the stall that the sheet states.
    assert "AIRSPEED_MIN 13\n" in parameters
    assert "From the parameter file: ROLL_LIMIT_DEG 50.\n" in readme
    assert "because the data sheet states these values: AIRSPEED_CRUISE 19 (cruise 18 m/s), AIRSPEED_MIN 13" in readme
    assert ", AIRSPEED_MIN 13 (stall 10 m/s).\n" in readme


def test_a_value_that_the_sheet_states_too_is_not_overridden() -> None:
    """AIRSPEED_MIN 12 is 1.2 times a stall speed of 10 m/s."""
    values = {"AIRSPEED_CRUISE": 16.0, "AIRSPEED_MIN": 12.0, "ROLL_LIMIT_DEG": 40.0}
    parameters = AircraftParameters(values, {name: f"{name} {value:g}" for name, value in values.items()})
    assert overridden_texts({"cruise": 16.0, "stall": 10.0, "bank": 40.0}, parameters) == []
    others = overridden_texts({"cruise": 17.0, "stall": 10.5, "bank": 41.0}, parameters)
    assert [text.split(" (")[1] for text in others] == ["cruise 17 m/s)", "stall 10.5 m/s)", "bank 41 degrees)"]


def test_a_sink_rate_out_of_range_says_that_its_line_may_be_left_out(tmp_path: Path) -> None:
    file = tmp_path / "mine.parm"
    file.write_text("TECS_SINK_MIN 4.5\n")
    told = r"^\S+mine\.parm: TECS_SINK_MIN 4\.5 m/s: allowed [\d.]+\.\.[\d.]+ m/s for .*; without this line of the"
    with pytest.raises(FlightError, match=told):
        make_data_sheet_folder(tmp_path / "mine", FOAM, file)


def test_the_climb_of_a_parameter_file_is_that_at_its_throttle_limit(tmp_path: Path) -> None:
    """ArduPlane's reference: TECS_CLMB_MAX is the best climb rate with the throttle at THR_MAX, at cruise speed."""
    file = tmp_path / "mine.parm"
    file.write_text("AIRSPEED_CRUISE 16\nAIRSPEED_MIN 12\nTECS_CLMB_MAX 3\nTHR_MAX 75\n")
    assert read_aircraft_parameters(file).values["THR_MAX"] == 75.0
    made = make_data_sheet_folder(tmp_path / "mine", DataSheet(2.1, 1.6, 0.0, 0.0), file)
    fdm = Fdm(made, is_tested=True)
    # 3 m/s at 16 m/s take three quarters of the throttle.
    climbing = steady_flight(fdm, 16.0, 500.0, climb=math.asin(3.0 / 16.0))
    assert climbing is not None
    assert climbing.throttle == pytest.approx(0.75, abs=0.02)
    steepest = full_throttle_climb(fdm, 16.0, 500.0)
    assert steepest is not None
    assert math.degrees(steepest.climb) > 15.0
    assert "THR_MAX 75\n" in (made.folder / "ardupilot.parm").read_text()
    assert "TECS_CLMB_MAX is the climb rate with the throttle at THR_MAX" in (made.folder / "README.md").read_text()


def test_a_climb_derived_from_less_throttle_stays_within_the_models_limit_and_is_less_certain(tmp_path: Path) -> None:
    """4 m/s at 14 m/s are 16.6 degrees; by the square of the throttle, 60 % of it implies more than 35 degrees."""
    sheets = {}
    for throttle in (60.0, 100.0):
        file = tmp_path / f"{throttle:.0f}.parm"
        file.write_text(f"TECS_CLMB_MAX 4\nTHR_MAX {throttle:g}\n")
        sheet = with_parameters(DataSheet(1.3, 1.4, 14.0, 8.3), read_aircraft_parameters(file).values)
        sheets[throttle] = size_aircraft(check_sheet(sheet))
    assert math.degrees(sheets[60.0].sheet.climb) == pytest.approx(35.0, abs=0.1)
    assert math.degrees(sheets[60.0].partial_climb) == pytest.approx(math.degrees(math.asin(4.0 / 14.0)))
    assert math.isnan(sheets[100.0].partial_climb)
    # 1.5 degrees as stated; a fifth of the further 18.4 degrees in addition.
    assert math.degrees(climb_deviation(sheets[100.0])) == pytest.approx(1.5)
    assert math.degrees(climb_deviation(sheets[60.0])) == pytest.approx(math.hypot(1.5, 0.2 * 18.4), abs=0.03)
    made = make_data_sheet_folder(tmp_path / "mine", DataSheet(1.3, 1.4, 14.0, 8.3), tmp_path / "60.parm")
    source = "derived from TECS_CLMB_MAX and THR_MAX, limited to the greatest climb of a model"
    assert f"| steepest climb at cruise | 35 degrees | {source} |" in (made.folder / "README.md").read_text()


@pytest.mark.parametrize("stated", [30.0, 0.0])
def test_another_trim_throttle_than_the_models_is_explained(tmp_path: Path, stated: float) -> None:
    file = tmp_path / "mine.parm"
    file.write_text(
        "AIRSPEED_CRUISE 16\nAIRSPEED_MIN 12\nTECS_CLMB_MAX 4\n" + (f"TRIM_THROTTLE {stated:g}\n" if stated else "")
    )
    made = make_data_sheet_folder(tmp_path / "mine", DataSheet(2.1, 1.6, 0.0, 0.0), file)
    readme, parameters = (made.folder / "README.md").read_text(), (made.folder / "ardupilot.parm").read_text()
    model, kept = re.search(r"with (\d+) % throttle", readme), re.search(r"TRIM_THROTTLE (\d+)\n", parameters)
    assert model is not None
    assert kept is not None
    is_explained = f"does not meet the file's TRIM_THROTTLE {kept[1]}: it needs {model[1]} %" in readme
    assert is_explained is (model[1] != kept[1])
    assert is_explained or not stated


def test_an_angle_that_is_not_flown_is_no_small_change() -> None:
    nan = math.nan
    more, less = np.array([0.3, nan, 0.3, nan]), np.array([0.1, 0.05, nan, nan])
    found = factor_effect(more, less, np.array([0.2, 0.2, 0.2, -0.2]))
    # Half of what is between them; to the one; to the other; the whole angle.
    assert found == pytest.approx([0.1, 0.15, 0.1, 0.2])


def test_a_sheet_comes_before_parameters() -> None:
    filled = with_parameters(FOAM, {"AIRSPEED_CRUISE": 30.0, "ROLL_LIMIT_DEG": 20.0})
    assert (filled.cruise, round(math.degrees(filled.bank))) == (15.0, 20)


@pytest.mark.parametrize(
    ("sheet", "told"),
    [
        (DataSheet(2.1, 1.6, 15.0, 0.0), "stall: missing; a data sheet needs it (5..35 m/s)"),
        (replace(FOAM, mass=30.0), "mass 30 kg: allowed 0.5..25 kg"),
    ],
)
def test_nothing_is_left_of_what_is_refused(tmp_path: Path, sheet: DataSheet, told: str) -> None:
    with pytest.raises(FlightError, match=re.escape(told)):
        make_data_sheet_folder(tmp_path / "mine", sheet)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    with pytest.raises(FlightError, match="exists"):
        make_data_sheet_folder(tmp_path / "mine", FOAM)


def test_fuel_and_a_tail(tmp_path: Path) -> None:
    made = make_data_sheet_folder(tmp_path / "petrol", DataSheet(12.0, 2.8, 24.0, 16.0, fuel=1.5))
    assert made.battery_voltage == 0.0
    assert made.battery_energy == pytest.approx(1.5 * 43.5e6)
    fdm = Fdm(made, is_tested=True)
    level = steady_flight(fdm, 24.0, 500.0)
    assert level is not None
    fdm.apply_trim(level.vector())
    state = fdm.read()
    # Heat is work by 0.15; thrust x airspeed is a part of the work that a propeller gives.
    work = 0.15 * float(state.power)
    drag = fdm.properties.getter("motor/thrust-n")() * 24.0
    assert 0.4 < drag / work < 0.9
