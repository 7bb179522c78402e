"""Parameter files are told apart by header and names: ArduPilot's and PX4's parameter references."""

from pathlib import Path

import pytest

import flight.autopilots.arduplane.parameters as arduplane
import flight.autopilots.px4.parameters as px4
from flight.autopilots.parameter_files import parse_parameters
from flight.autopilots.parameter_origin import (
    ParameterOrigin,
    parameter_origin,
    read_parameters_for,
    refuse_unknown_parameters,
)
from world.errors import ParameterError

COPTER = "a multicopter or helicopter"
QGC_HEAD = "# Onboard parameters for Vehicle 1\n#\n# Stack: {}\n# Vehicle: {}\n# Version: 1.12.3\n#\n"
FIXED_WING_NAMES = "".join(f"1\t1\tFW_{name}\t1\t9\n" for name in ("R_LIM", "P_LIM_MAX", "THR_TRIM", "T_ALT_TC"))


def origin(text: str) -> ParameterOrigin:
    return parameter_origin(text, parse_parameters(text, "a.params"))


@pytest.mark.parametrize(
    ("text", "autopilot", "vehicle"),
    [
        # As ground stations write them: QGroundControl, MAVProxy, Mission Planner.
        (QGC_HEAD.format("PX4 Pro", "Fixed wing aircraft") + "1\t1\tBAT_N_CELLS\t2\t6\n", "px4", ""),
        (QGC_HEAD.format("PX4 Pro", "Fixed Wing").replace("\n", "\r\n") + "1\t1\tFOO\t2\t6\r\n", "px4", ""),
        (QGC_HEAD.format("ArduPilot", "Fixed Wing") + "1\t1\tFOO\t2\t6\n", "ardupilot", ""),
        ("FW_AIRSPD_TRIM   15.000000\nNAV_ACC_RAD      30.0\n", "px4", ""),
        ("#NOTE: 1/1/2020 plane\r\nTECS_CLMB_MAX,5\r\nWP_RADIUS,40\r\n", "ardupilot", ""),
        ("# stack: px4 pro\nFOO 1\n", "px4", ""),
        # One name is enough where there is no other.
        ("SDLOG_MODE 1\n", "px4", ""),
        ("COMPASS_ORIENT 0\n", "ardupilot", ""),
        ("MY_OWN 1\nYOUR_OWN 2\n", "", ""),
        # A few names of the other do not make it the other's: TRIM_ROLL and RC1_MIN are named alike.
        ("TECS_CLMB_MAX 5\nTHR_MAX 80\nWP_RADIUS 30\nRTL_ALTITUDE 80\nRC_MAP_ROLL 1\n", "ardupilot", ""),
        # Other vehicles, by header and by names.
        (QGC_HEAD.format("PX4 Pro", "Multi-Rotor") + "1\t1\tNAV_ACC_RAD\t2\t9\n", "px4", COPTER),
        (QGC_HEAD.format("PX4 Pro", "VTOL Standard") + "1\t1\tFW_AIRSPD_TRIM\t15\t9\n", "px4", "a VTOL aircraft"),
        (QGC_HEAD.format("ArduPilot", "Rover") + "1\t1\tWP_RADIUS\t2\t9\n", "ardupilot", "a rover or boat"),
        # The header of PX4's own type decides, whatever number of fixed-wing parameters follows.
        *(
            (QGC_HEAD.format("PX4 Pro", name) + FIXED_WING_NAMES, "px4", vehicle)
            for name, vehicle in (
                ("Quadrotor", COPTER),
                ("Hexarotor", COPTER),
                ("Ground rover", "a rover or boat"),
                ("Fixed Wing", ""),
            )
        ),
        ("MC_ROLLRATE_P 0.1\nMPC_XY_VEL_MAX 12\nNAV_ACC_RAD 2\n", "px4", COPTER),
        ("FW_AIRSPD_TRIM 15\nVT_TYPE 2\nMC_ROLL_P 6\n", "px4", "a VTOL aircraft"),
        ("MAV_TYPE 2\nNAV_ACC_RAD 2\n", "px4", COPTER),
        ("CA_AIRFRAME 4\nFW_AIRSPD_TRIM 15\n", "px4", "a VTOL aircraft"),
        # PX4's navigator asks for these in every vehicle.
        ("FW_AIRSPD_TRIM 15\nMAV_TYPE 1\nVT_B_DEC_MSS 2\nMPC_ACC_HOR 3\n", "px4", ""),
        ("ATC_RAT_RLL_P,0.135\nWPNAV_SPEED,500\nFRAME_CLASS,1\n", "ardupilot", COPTER),
        ("FRAME_CLASS 1\nFENCE_ENABLE 1\nBATT_CAPACITY 5000\n", "ardupilot", COPTER),
        ("CRUISE_SPEED 3\nCRUISE_THROTTLE 40\nATC_STR_RAT_P 0.2\n", "ardupilot", "a rover or boat"),
        ("JS_GAIN_DEFAULT 0.5\nSURFACE_DEPTH -10\n", "ardupilot", "a submarine"),
        ("# ArduCopter V4.5.7\nBATT_CAPACITY 5000\n", "ardupilot", COPTER),
        # A quadplane is an ArduPlane: its own controllers begin with Q_.
        ("Q_ENABLE 1\nQ_FRAME_CLASS 1\nQ_A_RAT_RLL_P 0.1\nTECS_CLMB_MAX 5\n", "ardupilot", ""),
    ],
)
def test_a_file_says_whose_it_is(text: str, autopilot: str, vehicle: str) -> None:
    found = origin(text)
    assert (found.autopilot, found.vehicle, found.mixed) == (autopilot, vehicle, False)


def test_a_file_with_names_of_both_is_neithers() -> None:
    found = origin("FW_AIRSPD_TRIM 15\nNAV_ACC_RAD 30\nTECS_CLMB_MAX 5\n")
    assert (found.autopilot, found.mixed) == ("", True)
    assert found.evidence == "FW_AIRSPD_TRIM is PX4's and TECS_CLMB_MAX is ArduPilot's"


@pytest.mark.parametrize(
    ("text", "autopilot", "says"),
    [
        ("FW_R_TC 0.3\n", "ardupilot", "written for PX4 (FW_R_TC), but ArduPlane is to fly; --autopilot px4"),
        (
            "TECS_CLMB_MAX 3\n",
            "px4",
            "written for ArduPilot (TECS_CLMB_MAX), but PX4 is to fly; --autopilot ardupilot",
        ),
        (
            "WPNAV_SPEED 500\n",
            "ardupilot",
            "the parameters are for a multicopter or helicopter (ArduPilot): planfly simulates only fixed-",
        ),
        (
            "MPC_XY_P 1\n",
            "px4",
            "the parameters are for a multicopter or helicopter (PX4): planfly simulates only fixed-wing",
        ),
    ],
)
def test_a_file_of_another_autopilot_or_vehicle_is_refused(
    text: str, autopilot: str, says: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.param"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError) as caught:
        read_parameters_for(path, autopilot)
    assert str(caught.value).startswith(f"{path}: {says}")


def test_a_file_without_a_known_name_is_refused_unless_it_is_the_autopilots_own() -> None:
    for text, refused in (("FOO 1\nBAR 2\n", True), ("BATT_CAPACITY 5000\n", False)):
        entries = parse_parameters(text, "a.param")
        if refused:
            with pytest.raises(ParameterError, match=r"a\.param: FOO, BAR: not used by the simulated ArduPlane"):
                refuse_unknown_parameters(Path("a.param"), "ardupilot", entries, {})
        else:
            refuse_unknown_parameters(Path("a.param"), "ardupilot", entries, {})


def test_every_parameter_of_a_law_is_recognised_as_its_own() -> None:
    # PX4 has these of each radio channel, too (parameter reference, RC1_MIN to RC18_TRIM).
    shared = {f"RC{channel}_{end}" for channel in range(1, 19) for end in ("MIN", "TRIM", "MAX")}
    for autopilot, names in (("ardupilot", arduplane.TABLE.by_name), ("px4", px4.TABLE.by_name)):
        assert {name for name in names.keys() - shared if origin(f"{name} 1").autopilot != autopilot} == set()
