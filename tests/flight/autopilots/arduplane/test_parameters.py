"""ArduPlane's parameters in SI: old and new names, units, ranges, and who states each."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft, load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import (
    ARDUPILOT_PARAMETERS,
    DEFINITIONS,
    ArduPilotParameters,
)
from flight.autopilots.autopilot import ParameterValue, StoredParameters
from world.errors import ParameterError
from world.kernels import field_names

NEW = """AIRSPEED_CRUISE 25
AIRSPEED_MIN 18
AIRSPEED_MAX 31
ROLL_LIMIT_DEG 35
PTCH_LIM_MAX_DEG 22
PTCH_LIM_MIN_DEG -18
PTCH_TRIM_DEG 3.5
RTL_ALTITUDE 120
"""
# The same as ArduPlane 4.4 and before had it: cm/s, centidegrees and centimetres.
OLD = """TRIM_ARSPD_CM 2500
ARSPD_FBW_MIN 18
ARSPD_FBW_MAX 31
LIM_ROLL_CD 3500
LIM_PITCH_MAX 2200
LIM_PITCH_MIN -1800
TRIM_PITCH_CD 350
ALT_HOLD_RTL 12000
"""


def test_the_defaults_are_arduplanes() -> None:
    plain = ArduPilotParameters.defaults()
    # ardupilot.org, Plane, complete parameter list of 4.7.
    assert (plain.wp_radius, plain.wp_max_radius, plain.wp_loiter_rad) == (90.0, 0.0, 60.0)
    assert (plain.navl1_period, plain.navl1_damping, plain.navl1_xtrack_i) == (17.0, 0.75, 0.02)
    assert (plain.tecs_climb_max, plain.tecs_sink_min, plain.tecs_sink_max) == (5.0, 2.0, 5.0)
    assert (plain.tecs_time, plain.tecs_height_demand_time, plain.tecs_pitch_damping) == (5.0, 3.0, 0.3)
    assert (plain.altitude_slope_min, plain.altitude_slope_threshold, plain.roll_time) == (15.0, 5.0, 0.5)
    assert (plain.climb_slope_height, plain.takeoff_level_height, plain.airspeed_stall) == (25.0, 10.0, 0.0)
    assert (plain.rtl_climb_min, plain.ground_speed_min, plain.flare_damping) == (0.0, 0.0, 0.5)
    assert plain.roll_limit == pytest.approx(math.radians(45.0))
    assert plain.tecs_pitch_max == pytest.approx(math.radians(15.0))
    assert (plain.throttle_min, plain.throttle_cruise) == pytest.approx((0.0, 0.45))
    assert {parameter.origin for parameter in plain.values} == {"default"}


@pytest.mark.parametrize("text", [NEW, OLD])
def test_old_and_new_names_mean_the_same(text: str) -> None:
    found = ArduPilotParameters.from_text(text, "mine.parm")
    assert (found.airspeed_cruise, found.airspeed_min, found.airspeed_max) == (25.0, 18.0, 31.0)
    degrees = [found.roll_limit, found.pitch_limit_max, found.pitch_limit_min, found.pitch_trim]
    assert [math.degrees(angle) for angle in degrees] == pytest.approx([35.0, 22.0, -18.0, 3.5])
    assert found.rtl_altitude == 120.0
    assert found.unused == ()
    assert found.by_origin("file")["ROLL_LIMIT_DEG"] == 35.0


def test_one_parameter_under_both_names_must_agree() -> None:
    assert ArduPilotParameters.from_text("LIM_ROLL_CD 3500\nROLL_LIMIT_DEG 35\n", "a").roll_limit == pytest.approx(
        math.radians(35.0)
    )
    # 3530 times 0.01 is not exactly 35.3 in floating point.
    assert ArduPilotParameters.from_text("LIM_ROLL_CD 3530\nROLL_LIMIT_DEG 35.3\n", "a").roll_limit < math.radians(
        35.31
    )
    for text, said in (
        ("LIM_ROLL_CD 3500\nROLL_LIMIT_DEG 36", "ROLL_LIMIT_DEG: 36: expected 35, because LIM_ROLL_CD 3500 on line 1"),
        (
            "ROLL_LIMIT_DEG 36\nLIM_ROLL_CD 3500",
            "LIM_ROLL_CD: 3500: expected 3600, because ROLL_LIMIT_DEG 36 on line 1",
        ),
    ):
        with pytest.raises(ParameterError, match=f"^a:2: {said} is the same parameter under its other name$"):
            ArduPilotParameters.from_text(text, "a")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("WP_RADIUS -1", "a:1: WP_RADIUS: -1: allowed 0..32767"),
        ("NAVL1_PERIOD 0.9", "a:1: NAVL1_PERIOD: 0.9: allowed 1..60"),
        ("LIM_ROLL_CD 400", "a:1: LIM_ROLL_CD: 400: allowed 500..9000"),
        ("TECS_TIME_CONST 0", "a:1: TECS_TIME_CONST: 0: allowed 1..20"),
        ("THR_MIN 80\nTHR_MAX 75", "a: THR_MIN 80: must be below THR_MAX 75"),
        ("AIRSPEED_MIN 30\nAIRSPEED_MAX 25", "a: AIRSPEED_MIN 30: must be below AIRSPEED_MAX 25"),
    ],
)
def test_values_out_of_range_are_refused(text: str, said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        ArduPilotParameters.from_text(text, "a")
    assert str(refused.value) == said


def test_the_edges_of_a_range_are_taken() -> None:
    for definition in DEFINITIONS.values():
        for value in (definition.low, definition.high):
            if definition.name.startswith(("THR_M", "AIRSPEED_M")):
                continue
            found = ArduPilotParameters.from_text(f"{definition.name} {value}", "a")
            assert found.by_origin("file") == {definition.name: value}


def test_a_file_comes_before_the_aircraft_and_that_before_the_defaults(tmp_path: Path) -> None:
    aircraft: Aircraft = replace(load_aircraft("aerosonde"), folder=tmp_path)
    assert ArduPilotParameters.load(aircraft) == ArduPilotParameters.defaults()
    (tmp_path / "ardupilot.parm").write_text(
        "WP_RADIUS 70\nROLL_LIMIT_DEG 30\nSERVO1_TRIM 1500\nSERIAL2_BAUD 57\n", encoding="utf-8"
    )
    mine = tmp_path / "mine.param"
    mine.write_text("WP_RADIUS 50\nSERIAL1_BAUD 57\n", encoding="utf-8")
    found = ArduPilotParameters.load(aircraft, mine)
    assert found.by_origin("file") == {"WP_RADIUS": 50.0}
    assert found.by_origin("aircraft") == {"ROLL_LIMIT_DEG": 30.0, "SERVO1_TRIM": 1500.0}
    assert found.by_origin("default")["NAVL1_PERIOD"] == 17.0
    # Of the file that a person gave; the aircraft's own holds what its servos need, too.
    assert (found.unused, found.source) == (("SERIAL1_BAUD",), str(mine))


def test_the_record_holds_every_field() -> None:
    found = ArduPilotParameters.from_text(NEW, "a")
    record = found.record()
    assert field_names(ARDUPILOT_PARAMETERS) == (*DEFINITIONS, "roll_rate_max", "is_4_7")
    assert all(record[name] == getattr(found, name) for name in DEFINITIONS)
    assert record.dtype == ARDUPILOT_PARAMETERS
    assert np.isfinite([record[name] for name in DEFINITIONS]).all()


def test_what_was_stored_comes_back_bit_for_bit() -> None:
    found = ArduPilotParameters.from_text(OLD + "NAVL1_PERIOD 16.3\nFOO 1\n", "mine.parm")
    again = ArduPilotParameters.restore(StoredParameters(found.values, found.unused, found.source))
    assert again == found
    assert again.record().tolist() == found.record().tolist()
    with pytest.raises(ParameterError, match=r"WP_RADIUS: -5: allowed"):
        ArduPilotParameters.restore(StoredParameters((ParameterValue("WP_RADIUS", -5.0, "file"),), (), ""))


def test_one_value_can_be_changed() -> None:
    slow = ArduPilotParameters.defaults().changed(TECS_HDEM_TCONST=1.0)
    assert (slow.tecs_height_demand_time, slow.wp_radius) == (1.0, 90.0)
    with pytest.raises(ValueError, match="TECS_FOO: not a parameter"):
        ArduPilotParameters.defaults().changed(TECS_FOO=1.0)


# ----------------------------------------------------------------------
# Which airspeeds ArduPlane takes up, and what it flies instead.

PARAMETERS = ArduPilotParameters.defaults().changed(AIRSPEED_MIN=18.0, AIRSPEED_MAX=31.0)


@pytest.mark.parametrize(("airspeed", "taken"), [(17.99, False), (18.0, True), (31.0, True), (31.01, False)])
def test_speeds_within_the_limits_are_taken(airspeed: float, taken: bool) -> None:
    assert ArduPlane(PARAMETERS).speeds.flown_airspeeds(np.array([airspeed]), 25.0).tolist() == [
        airspeed if taken else 25.0
    ]


def test_a_speed_that_is_not_taken_leaves_the_one_before() -> None:
    commanded = np.array([17.0, 17.0, 20.0, 35.0, 31.0])
    assert ArduPlane(PARAMETERS).speeds.flown_airspeeds(commanded, 25.0).tolist() == [25.0, 25.0, 20.0, 20.0, 31.0]


def parameters(**values: float) -> tuple[ArduPilotParameters, tuple[str, ...]]:
    return ArduPilotParameters.from_log(values, "a.BIN")


def test_older_names_and_units_are_taken() -> None:
    found, notes = parameters(TRIM_ARSPD_CM=1800.0, LIM_ROLL_CD=4500.0)
    assert (found.airspeed_cruise, found.by_origin("file")["ROLL_LIMIT_DEG"], notes) == (18.0, 45.0, ())


def test_what_is_not_allowed_is_told_and_the_default_taken() -> None:
    found, notes = parameters(WP_RADIUS=-5.0, NAVL1_PERIOD=20.0)
    assert (found.wp_radius, found.navl1_period) == (90.0, 20.0)
    assert notes == ("WP_RADIUS -5 in the log is outside 0..32767: the default is used",)


def test_a_least_beyond_its_most_gives_way() -> None:
    found, notes = parameters(AIRSPEED_MIN=30.0, AIRSPEED_MAX=20.0)
    assert (found.airspeed_min, found.airspeed_max) == (9.0, 22.0)
    assert notes[0].startswith("AIRSPEED_MIN 30 is not below AIRSPEED_MAX 20")


def test_a_log_without_parameters_says_that_defaults_are_taken() -> None:
    _, notes = parameters()
    assert notes == ("the log contains no parameters: ArduPlane's defaults are used",)
