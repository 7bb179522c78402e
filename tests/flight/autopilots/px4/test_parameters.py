"""PX4's parameters in SI: files, ranges, who states each, what an aircraft says, and a log's round trip."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import StoredParameters
from flight.autopilots.px4.parameters import (
    DEFINITIONS,
    NOT_SIMULATED,
    PX4_PARAMETERS,
    Px4Parameters,
    speed_filter_gains,
)
from world.errors import ParameterError
from world.kernels import field_names

# As QGroundControl saves them.
QGC = """# Onboard parameters for Vehicle 1
#
# Stack: PX4 Pro
# Vehicle: Fixed Wing Aircraft
#
# Vehicle-Id Component-Id Name Value Type
1\t1\tBAT1_N_CELLS\t3\t6
1\t1\tFW_R_LIM\t30.000000000000000000\t9
1\t1\tFW_T_F_ALT_ERR\t-1.000000000000000000\t9
1\t1\tNAV_ACC_RAD\t25.000000000000000000\t9
"""


def test_every_field_is_in_the_record_in_si() -> None:
    fields = set(field_names(PX4_PARAMETERS))
    assert set(DEFINITIONS) <= fields
    record = Px4Parameters.from_text("FW_R_LIM 45\nFW_THR_TRIM 0.5\nFW_PSP_OFF -3\n", "a.params", "1.16").record()
    assert (record.roll_limit, record.throttle_trim) == pytest.approx((math.radians(45.0), 0.5))
    assert record.pitch_trim == pytest.approx(-math.radians(3.0))
    assert record.uses_switch_distance
    assert not Px4Parameters.defaults("1.17").record().uses_switch_distance


def test_every_default_is_allowed() -> None:
    assert all(one.low <= one.default <= one.high for one in DEFINITIONS.values())


def test_a_stations_file_goes_before_the_aircraft_and_that_before_px4(aerosonde: Aircraft, tmp_path: Path) -> None:
    file = tmp_path / "mine.params"
    file.write_text(QGC, encoding="utf-8")
    made = Px4Parameters.load(aerosonde, file, "1.16")
    assert made.by_origin("file") == {"FW_R_LIM": 30.0, "NAV_ACC_RAD": 25.0}
    assert (made.unused, made.source, made.version) == (("BAT1_N_CELLS", "FW_T_F_ALT_ERR"), str(file), "1.16")
    assert made.by_origin("default")["NPFG_PERIOD"] == 10.0
    # What the aircraft's folder states for ArduPlane: 25 m/s, 77 and 55 % of throttle, 5.6 and 3.3 m/s.
    assert made.by_origin("aircraft") == {
        "FW_AIRSPD_TRIM": 25.0,
        "FW_AIRSPD_MIN": 18.0,
        "FW_AIRSPD_MAX": 31.0,
        "FW_P_LIM_MAX": 25.0,
        "FW_P_LIM_MIN": -20.0,
        "FW_PSP_OFF": 3.3,
        "FW_THR_TRIM": 0.77,
        "FW_THR_MIN": 0.55,
        "FW_THR_MAX": 1.0,
        "FW_T_CLMB_MAX": 5.6,
        "FW_T_SINK_MIN": 3.3,
        "FW_T_SINK_MAX": 5.6,
    }


def test_one_that_is_not_flown_counts_where_it_is_not_px4s_own() -> None:
    made = Px4Parameters.from_text("FW_T_F_ALT_ERR -1\nRTL_LAND_DELAY 5\n", "a.params")
    assert set(made.by_origin("file")) == {"RTL_LAND_DELAY"}
    # Each name of the file is used or named as not used.
    assert made.unused == ("FW_T_F_ALT_ERR",)
    assert {"FW_T_F_ALT_ERR", "RTL_LAND_DELAY"} <= set(NOT_SIMULATED)
    assert NOT_SIMULATED[0] == "FW_USE_AIRSPD"


def test_what_a_person_states_otherwise_and_is_not_flown_is_named() -> None:
    made = Px4Parameters.from_text("FW_USE_AIRSPD 0\nNPFG_EN_MIN_GSP 0\nNAV_FW_ALTL_RAD 8\nFW_LND_ANG 7\n", "a.params")
    assert {"FW_USE_AIRSPD", "NPFG_EN_MIN_GSP", "NAV_FW_ALTL_RAD"} <= set(made.by_origin("file")) & set(NOT_SIMULATED)
    assert made.by_origin("file")["FW_LND_ANG"] == 7.0
    assert made.unused == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# x\nFW_R_LIM 86", "a.params:2: FW_R_LIM: 86: allowed 5..85"),
        ("NAV_ACC_RAD 0", "a.params:1: NAV_ACC_RAD: 0: allowed 0.05..10000"),
        ("FW_THR_TRIM 1.01", "a.params:1: FW_THR_TRIM: 1.01: allowed 0..1"),
        ("FW_AIRSPD_MIN 20", "a.params: FW_AIRSPD_MIN 20: must be below FW_AIRSPD_MAX 20"),
        ("FW_THR_MIN 1", "a.params: FW_THR_MIN 1: must be below FW_THR_MAX 1"),
    ],
)
def test_faults_are_one_line(text: str, said: str) -> None:
    with pytest.raises(ParameterError) as refused:
        Px4Parameters.from_text(text, "a.params")
    assert str(refused.value) == said


def test_what_is_stored_is_restored_and_another_version_is_not() -> None:
    made = Px4Parameters.from_text("NAV_ACC_RAD 50\nFOO 1\n", "mine.params", "1.16")
    stored = StoredParameters(made.values, made.unused, made.source)
    assert Px4Parameters.restore(stored, "1.16") == made
    assert Px4Parameters.restore(stored, "1.17") == replace(made, version="1.17")
    with pytest.raises(ParameterError, match=r"^px4_version: '1.9': expected 1.16 or 1.17$"):
        Px4Parameters.restore(stored, "1.9")
    bad = StoredParameters(tuple(one._replace(value=1e9) for one in made.values), (), "mine.params")
    with pytest.raises(ParameterError, match="allowed"):
        Px4Parameters.restore(bad, "1.16")


def test_only_parameters_of_the_law_are_changed() -> None:
    assert Px4Parameters.defaults().changed(FW_R_LIM=40.0).by_origin("file") == {"FW_R_LIM": 40.0}
    with pytest.raises(ValueError, match=r"^WP_RADIUS: not a parameter of the simulated autopilot$"):
        Px4Parameters.defaults().changed(WP_RADIUS=40.0)


def test_a_logs_parameters_are_read_to_single_precision() -> None:
    made, notes = Px4Parameters.from_log({"NPFG_SW_DST_MLT": float(np.float32(0.32)), "X": 1.0}, "a.ulg", "1.16")
    assert (made["NPFG_SW_DST_MLT"], notes) == (0.32, ())
    for logged in ({}, {"FW_AIRSPD_MIN": 9.0, "FW_AIRSPD_MAX": 8.0}):
        _, notes = Px4Parameters.from_log(logged, "a.ulg", "1.16")
        assert notes[-1] == "the log contains no parameters: PX4's defaults are used"
    made, notes = Px4Parameters.from_log({"FW_AIRSPD_MIN": 25.0}, "a.ulg", "1.16")
    assert made == Px4Parameters.defaults("1.16")
    assert "must be below FW_AIRSPD_MAX 20: PX4's defaults are used" in notes[0]


@pytest.mark.parametrize("deviations", [(0.07, 0.2, 0.2), (1.0, 0.5, 0.1)])
def test_the_airspeed_filter_is_the_steady_kalman_filter(deviations: tuple[float, float, float]) -> None:
    """Its covariance, run forward in small steps, comes to these gains."""
    speed, rate, process = deviations
    chain, noise = np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([speed**-2, rate**-2])
    spread, dt = np.eye(2) * 0.01, 4e-3
    for _ in range(8_000):
        spread = spread + dt * (
            chain @ spread + spread @ chain.T + np.diag([0.0, process**2]) - spread @ noise @ spread
        )
    assert np.array(speed_filter_gains(*deviations)) == pytest.approx((spread @ noise).ravel(), rel=1e-3)


def test_parameters_are_equal_by_value() -> None:
    assert Px4Parameters.defaults() == Px4Parameters(Px4Parameters.defaults().values)


def test_what_lies_beyond_the_documented_range_is_flown_and_said() -> None:
    text = "FW_R_LIM 30\nFW_P_LIM_MAX 70\nNPFG_PERIOD_SF 10\nFW_T_CLMB_R_SP 0.1\nFW_T_SINK_R_SP 40\nFW_T_SEB_R_FF 3\n"
    made = Px4Parameters.from_text(text, "a.params")
    assert made.by_origin("file")["FW_T_SINK_R_SP"] == 40.0
    assert [said.split(" (")[0] for said in made.outside_documented_ranges] == [
        "FW_R_LIM 30",
        "FW_T_CLMB_R_SP 0.1",
        "FW_T_SINK_R_SP 40",
        "FW_T_SEB_R_FF 3",
        "FW_P_LIM_MAX 70",
    ]
    assert made.outside_documented_ranges[0] == "FW_R_LIM 30 (35..75)"
    assert Px4Parameters.from_text("FW_R_LIM 35\nNAV_ACC_RAD 200", "a.params").outside_documented_ranges == ()


def test_a_documented_range_holds_the_default_and_is_within_what_is_taken() -> None:
    for one in DEFINITIONS.values():
        if one.documented is not None:
            assert one.low <= one.documented[0] <= one.default <= one.documented[1] <= one.high
