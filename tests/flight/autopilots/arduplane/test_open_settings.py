"""ArduPlane's settings that leave the verdict open: where each matters, and which values change nothing."""

import pytest

from aircraft.catalog import aircraft_names, load_aircraft
from flight.autopilots.arduplane.open_settings import OPEN_SETTINGS, describe_open_settings
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.process import load_aircraft_parameters
from flight.autopilots.autopilot import StoredParameters
from flight.autopilots.parts import MissionParts

EVERYTHING = MissionParts(returns=True, has_return_path=True, takes_off=True, lands=True, enables_fence=True, wind=12.0)
IN_THE_AIR = MissionParts(wind=12.0)
FROM_GROUND = IN_THE_AIR._replace(takes_off=True)
TO_GROUND = IN_THE_AIR._replace(lands=True)
# Defaults of ArduPlane 4.6.3 and 4.7, in its parameter reference and in its sources.
DEFAULTS = """KFF_THR2PTCH 0
BATT_WATT_MAX 0
FWD_BAT_THR_CUT 0
TECS_OPTIONS 0
AFS_ENABLE 0
CHUTE_CRT_SINK 0
ICE_IDLE_PCT 0
ICE_IDLE_RPM -1
TKOFF_OPTIONS 0
TKOFF_ACCEL_CNT 1
TKOFF_ALT 50
TKOFF_TDRAG_ELEV 0
TKOFF_FLAP_PCNT 0
TKOFF_THR_IDLE 0
TECS_TKOFF_IGAIN 0
LAND_TYPE 0
LAND_PF_ARSPD 0
LAND_OPTIONS 0
LAND_THR_SLEW 0
LAND_FLAP_PERCNT 0
RNGFND_LANDING 0
TECS_APPR_SMAX 0
TECS_LAND_DAMP 0.5
TECS_LAND_TDAMP 0
TECS_LAND_IGAIN 0
TECS_LAND_PDAMP 0
FLAP_1_PERCNT 0
FLAP_1_SPEED 0
FLAP_2_PERCNT 0
FLAP_2_SPEED 0
AHRS_WIND_MAX 0
ARSPD_WIND_MAX 0
MIS_OPTIONS 0
USE_REV_THRUST 2
AIRSPEED_STALL 0
RLL2SRV_RMAX 0
RLL2SRV_TCONST 0.5
PTCH2SRV_RMAX_UP 0
PTCH2SRV_RMAX_DN 0
PTCH2SRV_TCONST 0.5
PTCH2SRV_RLL 1
RLL_RATE_FF 0.345
RLL_RATE_P 0.08
RLL_RATE_I 0.15
RLL_RATE_D 0
RLL_RATE_IMAX 0.666
RLL_RATE_FLTT 3
RLL_RATE_FLTE 0
PTCH_RATE_FF 0.345
PTCH_RATE_P 0.04
PTCH_RATE_I 0.15
PTCH_RATE_D 0
PTCH_RATE_IMAX 0.666
PTCH_RATE_FLTT 3
PTCH_RATE_FLTE 0
SCALING_SPEED 15
ARSPD_ENABLE 1
ARSPD_TYPE 1
ARSPD_PRIMARY 0
ARSPD_USE 1
ARSPD_RATIO 2
ARSPD2_TYPE 0
ARSPD2_USE 0
AHRS_EKF_TYPE 3
AHRS_GPS_USE 1
EK3_ENABLE 1
EK3_IMU_MASK 3
EK3_SRC1_POSXY 3
EK3_SRC1_POSZ 1
EAHRS_TYPE 0
GPS1_TYPE 1
GPS2_TYPE 0
GPS_AUTO_SWITCH 1
GPS_PRIMARY 0
INS_ENABLE_MASK 127
COMPASS_ENABLE 1
ARMING_CHECK 1
ARMING_MIS_ITEMS 0
MIXING_GAIN 0.5
MIXING_OFFSET 0
SERVO1_FUNCTION 4
SERVO2_FUNCTION 19
SERVO3_FUNCTION 70
SERVO4_FUNCTION 21
SERVO5_FUNCTION 0
"""


def said(text: str, mission: MissionParts, *, by_program: bool = False) -> list[str]:
    return describe_open_settings(ArduPilotParameters.from_text(text, "mine.param"), mission, by_program=by_program)


def test_arduplanes_defaults_leave_nothing_open_stated_or_not() -> None:
    assert said(DEFAULTS, EVERYTHING) == said("WP_RADIUS 60", EVERYTHING) == []


@pytest.mark.parametrize(
    ("line", "mission"),
    [
        ("KFF_THR2PTCH -0.1", IN_THE_AIR),
        ("BATT_WATT_MAX 300", IN_THE_AIR),
        ("FWD_BAT_THR_CUT 13.2", IN_THE_AIR),
        ("TECS_OPTIONS 2", IN_THE_AIR),
        ("AFS_ENABLE 1", IN_THE_AIR),
        ("CHUTE_CRT_SINK 8", IN_THE_AIR),
        ("ICE_IDLE_PCT 12", IN_THE_AIR),
        ("ICE_IDLE_RPM 0", IN_THE_AIR),
        ("GROUND_STEER_ALT 120", IN_THE_AIR),
        ("TKOFF_OPTIONS 1", FROM_GROUND),
        ("TKOFF_ACCEL_CNT 2", FROM_GROUND),
        ("TKOFF_TDRAG_ELEV 20", FROM_GROUND),
        ("TKOFF_FLAP_PCNT 30", FROM_GROUND),
        ("TKOFF_THR_IDLE 10", FROM_GROUND),
        ("TECS_TKOFF_IGAIN 0.2", FROM_GROUND),
        ("LAND_TYPE 1", TO_GROUND),
        ("LAND_PF_ARSPD 11", TO_GROUND),
        ("LAND_OPTIONS 1", TO_GROUND),
        ("LAND_THR_SLEW 50", TO_GROUND),
        ("LAND_FLAP_PERCNT 40", TO_GROUND),
        ("RNGFND_LANDING 1", TO_GROUND),
        ("TECS_APPR_SMAX 6", TO_GROUND),
        ("TECS_LAND_TDAMP 0.1", TO_GROUND),
        ("TECS_LAND_IGAIN 0.1", TO_GROUND),
        ("TECS_LAND_PDAMP 0.1", TO_GROUND),
    ],
)
def test_a_setting_leaves_the_verdict_open_where_its_part_is_flown(line: str, mission: MissionParts) -> None:
    (text,) = said(line, mission)
    assert text.startswith(line)
    assert text.endswith("but is not simulated")
    # A take-off's or a landing's setting changes no flight that begins and ends in the air.
    assert (said(line, IN_THE_AIR) == []) == (mission is not IN_THE_AIR)
    assert line.split()[0] in OPEN_SETTINGS


@pytest.mark.parametrize(
    ("text", "mission", "expected"),
    [
        ("FLAP_1_PERCNT 30\nFLAP_1_SPEED 15", IN_THE_AIR, "FLAP_1_PERCNT 30 moves the flaps below FLAP_1_SPEED 15 m/s"),
        # No airspeed below AIRSPEED_MIN is demanded in the air, and the demand counts in whole m/s.
        (
            "FLAP_1_PERCNT 30\nFLAP_1_SPEED 15\nAIRSPEED_MIN 15.9",
            IN_THE_AIR,
            "FLAP_1_PERCNT 30 moves the flaps below FLAP_1_SPEED 15 m/s",
        ),
        ("FLAP_1_PERCNT 30\nFLAP_1_SPEED 15\nAIRSPEED_MIN 16", IN_THE_AIR, ""),
        (
            "FLAP_1_PERCNT 30\nFLAP_1_SPEED 15\nAIRSPEED_MIN 16",
            TO_GROUND,
            "FLAP_1_PERCNT 30 moves the flaps below FLAP_1_SPEED 15 m/s",
        ),
        ("FLAP_1_PERCNT 30", IN_THE_AIR, ""),
        ("FLAP_2_SPEED 15", IN_THE_AIR, ""),
        # 12 m/s of wind: that much can lie between the airspeed and the ground speed.
        ("AHRS_WIND_MAX 11.9", IN_THE_AIR, "AHRS_WIND_MAX 11.9 in 12 m/s wind"),
        ("AHRS_WIND_MAX 12", IN_THE_AIR, ""),
        ("ARSPD_WIND_MAX 11.9", IN_THE_AIR, "ARSPD_WIND_MAX 11.9 in 12 m/s wind"),
        ("MIS_OPTIONS 4", TO_GROUND, "MIS_OPTIONS 4 continues"),
        ("MIS_OPTIONS 4", IN_THE_AIR, ""),
        ("MIS_OPTIONS 3", TO_GROUND, ""),
        ("TRIM_THROTTLE 1", IN_THE_AIR, "TRIM_THROTTLE 1 stops the motor"),
        ("TRIM_THROTTLE 2", IN_THE_AIR, ""),
        # By default thrust is reversed on a landing's approach alone, and only with a THR_MIN below 0.
        ("THR_MIN -100", TO_GROUND, "THR_MIN -100 and USE_REV_THRUST 2"),
        ("THR_MIN -100", IN_THE_AIR, ""),
        ("THR_MIN -100\nUSE_REV_THRUST 1", IN_THE_AIR, "THR_MIN -100 and USE_REV_THRUST 1"),
        ("THR_MIN -100\nUSE_REV_THRUST 64", IN_THE_AIR, ""),
        ("THR_MIN -100\nUSE_REV_THRUST 64", IN_THE_AIR._replace(returns=True), "THR_MIN -100 and USE_REV_THRUST 64"),
        ("USE_REV_THRUST 1", EVERYTHING, ""),
        # A take-off banks freely from three times TKOFF_LVL_ALT, 30 m, or from TKOFF_ALT.
        ("TKOFF_ALT 29", FROM_GROUND, "TKOFF_ALT 29 removes the bank limit of the take-off below 30 m"),
        ("TKOFF_ALT 30", FROM_GROUND, ""),
        ("TKOFF_ALT 29", IN_THE_AIR, ""),
    ],
)
def test_settings_that_depend_on_others(text: str, mission: MissionParts, expected: str) -> None:
    assert len(said(text, mission)) == bool(expected)
    assert all(one.startswith(expected) for one in said(text, mission))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("PTCH2SRV_RLL 0", "PTCH2SRV_RLL 0"),
        ("RLL_RATE_FLTT 0.2", "RLL_RATE_FLTT 0.2"),
        ("PTCH_RATE_FLTE 0.2", "PTCH_RATE_FLTE 0.2"),
        ("PTCH_RATE_IMAX 0", "PTCH_RATE_IMAX 0"),
        ("MIXING_GAIN 0", "MIXING_GAIN 0"),
        ("ARSPD_RATIO 0", "ARSPD_RATIO 0"),
        # Airspeed sensors: the primary one, or else the first that there is.
        (
            "ARSPD_TYPE 0",
            "ARSPD_TYPE 0 leaves no airspeed sensor, which is not simulated; set ARSPD_TYPE 1, and ARSPD_USE 1"
            " to simulate the flight with the sensor, or ARSPD_USE 0 to fly ArduPlane's own program (--sitl) without",
        ),
        ("ARSPD_ENABLE 0", "ARSPD_ENABLE 0 leaves no airspeed sensor"),
        ("ARSPD_TYPE 0\nARSPD2_TYPE 8\nARSPD2_USE 0", "ARSPD2_USE 0"),
        ("ARSPD2_TYPE 8\nARSPD_PRIMARY 1\nARSPD2_USE 2", "ARSPD2_USE 2"),
        ("ARSPD_PRIMARY 1\nARSPD_USE 0", "ARSPD_USE 0 affects the flight, but is not simulated; set ARSPD_USE 1 to"),
        ("ARSPD_TYPE 0\nARSPD2_TYPE 8\nARSPD2_USE 1", ""),
        ("ARSPD_USE 0\nARSPD2_TYPE 8\nARSPD_PRIMARY 1\nARSPD2_USE 1", ""),
        ("ARSPD2_TYPE 0\nARSPD_PRIMARY 1", ""),
        # Position.
        ("GPS1_TYPE 0", "GPS1_TYPE and GPS2_TYPE 0 leave no GPS"),
        ("GPS_TYPE 0", "GPS1_TYPE and GPS2_TYPE 0 leave no GPS"),
        ("GPS_TYPE 0\nGPS_TYPE2 9", ""),
        ("GPS1_TYPE 0\nGPS2_TYPE 9", ""),
        ("GPS1_TYPE 0\nGPS2_TYPE 9\nGPS_AUTO_SWITCH 0", "GPS1_TYPE 0 leaves no GPS"),
        ("GPS1_TYPE 0\nGPS2_TYPE 9\nGPS_AUTO_SWITCH 0\nGPS_PRIMARY 1", ""),
        ("AHRS_GPS_USE 0", "AHRS_GPS_USE 0"),
        ("AHRS_EKF_TYPE 0", "AHRS_EKF_TYPE 0 estimates the position without EKF3"),
        ("AHRS_EKF_TYPE 2\nEK3_ENABLE 0", ""),
        ("EK3_ENABLE 0", "EK3_ENABLE 0 with AHRS_EKF_TYPE 3 leaves no position"),
        ("AHRS_EKF_TYPE 11", "EAHRS_TYPE 0 with AHRS_EKF_TYPE 11 leaves no position"),
        ("AHRS_EKF_TYPE 11\nEAHRS_TYPE 1\nEK3_ENABLE 0", ""),
        ("EK3_SRC1_POSXY 0", "EK3_SRC1_POSXY 0"),
        ("EK3_SRC1_POSZ 0", "EK3_SRC1_POSZ 0 uses neither"),
        ("EK3_SRC1_POSZ 3", ""),
        ("EK3_IMU_MASK 0", "EK3_IMU_MASK 0"),
        ("INS_ENABLE_MASK 0", "INS_ENABLE_MASK 0"),
        # A fixed wing takes its heading from its course where it has no compass.
        ("COMPASS_ENABLE 0", ""),
        # Arming: bits 3 and 6 require a take-off and a return.
        ("ARMING_MIS_ITEMS 8", "ARMING_MIS_ITEMS 8 prevents arming, because the mission has no NAV_TAKEOFF"),
        ("ARMING_MIS_ITEMS 64", ""),
        ("ARMING_MIS_ITEMS 8\nARMING_CHECK 0", ""),
        ("ARMING_MIS_ITEMS 8\nARMING_SKIPCHK -1", ""),
        ("ARMING_MIS_ITEMS 8\nARMING_REQUIRE 0", ""),
        # `AP_Arming_Plane::pre_arm_checks`.
        ("PTCH_LIM_MIN_DEG -2.9", "PTCH_LIM_MIN_DEG -2.9 prevents arming: ArduPlane requires at most -3"),
        ("PTCH_LIM_MIN_DEG -3", ""),
        ("PTCH_LIM_MAX_DEG 2.9", "PTCH_LIM_MAX_DEG 2.9 prevents arming: ArduPlane requires at least 3"),
        ("PTCH_LIM_MAX_DEG 3", ""),
        ("AIRSPEED_MIN 4.9", "AIRSPEED_MIN 4.9 prevents arming: ArduPlane requires at least 5"),
        ("AIRSPEED_MIN 5", ""),
        ("AIRSPEED_MIN 4.9\nARMING_CHECK 0", ""),
        # Outputs: elevons on 77 and 78, a V-tail on 79 and 80, two motors on 73 and 74.
        ("SERVO1_FUNCTION 0", "SERVO1_FUNCTION to SERVO16_FUNCTION move no ailerons"),
        ("SERVO2_FUNCTION 0", "SERVO1_FUNCTION to SERVO16_FUNCTION move no elevator"),
        ("SERVO3_FUNCTION 0", "SERVO1_FUNCTION to SERVO16_FUNCTION move no motor"),
        # Outputs above 16 need SERVO_32_ENABLE; a bit of SERVO_GPIO_MASK makes output 3 a pin.
        ("SERVO1_FUNCTION 0\nSERVO17_FUNCTION 4", "SERVO1_FUNCTION to SERVO16_FUNCTION move no ailerons"),
        ("SERVO1_FUNCTION 0\nSERVO17_FUNCTION 4\nSERVO_32_ENABLE 1", ""),
        ("SERVO_GPIO_MASK 4", "SERVO1_FUNCTION to SERVO16_FUNCTION without SERVO_GPIO_MASK 4 move no motor"),
        ("SERVO_GPIO_MASK 16", ""),
        ("SERVO1_FUNCTION 77\nSERVO2_FUNCTION 78\nSERVO4_FUNCTION 0", ""),
        ("SERVO2_FUNCTION 79\nSERVO4_FUNCTION 80", ""),
        ("SERVO1_FUNCTION 0\nSERVO3_FUNCTION 73\nSERVO5_FUNCTION 74\nSERVO9_FUNCTION 4", ""),
    ],
)
def test_what_leaves_no_airspeed_position_or_control(text: str, name: str) -> None:
    mission = IN_THE_AIR._replace(commands=frozenset({16, 20}))
    assert len(said(text, mission)) == bool(name)
    assert all(one.startswith(name) for one in said(text, mission))


def test_a_coarse_grid_of_the_ground_matters_above_terrain() -> None:
    over_terrain = IN_THE_AIR._replace(follows_terrain=True)
    assert said("TERRAIN_SPACING 101", over_terrain)[0].startswith("TERRAIN_SPACING 101 m makes ArduPlane's terrain")
    assert said("TERRAIN_SPACING 100", over_terrain) == said("TERRAIN_SPACING 2000", IN_THE_AIR) == []


@pytest.mark.parametrize("mark", [189, 188])
def test_landing_marks_without_a_landing_prevent_arming(mark: int) -> None:
    """`AP_Arming_Plane::mission_checks`: DO_LAND_START (189) and DO_RETURN_PATH_START (188) need RTL_AUTOLAND."""
    marked = IN_THE_AIR._replace(commands=frozenset({16, mark}))
    (text,) = said("RTL_AUTOLAND 0", marked)
    assert text.startswith("RTL_AUTOLAND 0 prevents arming, because the mission has DO_")
    assert said("RTL_AUTOLAND 1", marked) == said("RTL_AUTOLAND 0", IN_THE_AIR) == said("WP_RADIUS 60", marked) == []
    assert said("RTL_AUTOLAND 0\nARMING_CHECK 0", marked) == []


@pytest.mark.parametrize(
    ("text", "opens"),
    [
        # 45 degrees at 12 m/s turn with 9.80665 / 12 rad/s, of which sin 45 is pitch: 33.1 deg/s, and 10 more.
        ("PTCH2SRV_RMAX_UP 43", True),
        ("PTCH2SRV_RMAX_UP 44", False),
        ("PTCH2SRV_RMAX_UP 43\nROLL_LIMIT_DEG 30", False),
        ("PTCH2SRV_RMAX_DN 2", True),
        ("PTCH2SRV_RMAX_DN 10", False),
        ("RLL2SRV_RMAX 2", False),  # flown
    ],
)
def test_a_pitch_rate_that_no_turn_can_have_leaves_the_verdict_open(text: str, opens: bool) -> None:
    assert [one.startswith(text.splitlines()[0]) for one in said(text, IN_THE_AIR)] == [True] * opens
    assert said(text, IN_THE_AIR, by_program=True) == []


@pytest.mark.parametrize("name", aircraft_names())
@pytest.mark.parametrize(
    ("text", "faults"),
    [
        # The gains of the file over those that the aircraft's own file states.
        ("", []),
        ("RLL_RATE_FF {RLL_RATE_FF}\nRLL_RATE_P {RLL_RATE_P}\nRLL_RATE_I {RLL_RATE_I}", []),
        ("RLL_RATE_FF 0.0001\nRLL_RATE_P 0.0001\nRLL_RATE_I 0.0001", ["RLL too low"]),
        ("PTCH_RATE_FF 0.0001\nPTCH_RATE_P 0.0001\nPTCH_RATE_I 0.0001", ["PTCH too low"]),
        ("RLL_RATE_FF 0\nRLL_RATE_P 0", ["RLL too low"]),
        ("SCALING_SPEED 1", ["RLL too low", "PTCH too low"]),
        ("RLL_RATE_P 20", ["RLL too high"]),
        ("PTCH_RATE_I 50", ["PTCH too high"]),
        ("PTCH_RATE_D 2", ["PTCH too high"]),
        ("RLL2SRV_TCONST 0.05\nRLL_RATE_FF 0.5", ["RLL too high"]),
        # The extremes of ArduPlane's automatic tuning.
        ("RLL2SRV_TCONST 0.1\nPTCH2SRV_TCONST 0.1", []),
        ("RLL2SRV_TCONST 1\nPTCH2SRV_TCONST 1", []),
    ],
)
def test_gains_that_hold_no_attitude_leave_the_verdict_open(name: str, text: str, faults: list[str]) -> None:
    aircraft = load_aircraft(name)
    own = load_aircraft_parameters(aircraft)
    made = ArduPilotParameters.from_text(text.format(**own) + "\nWP_RADIUS 60", "mine.param")
    texts = describe_open_settings(made, MissionParts(aircraft=aircraft), by_program=False)
    assert [one.split("_")[0] + one.split("gains are")[1].split(" to ")[0] for one in texts] == faults


def test_a_program_flies_its_own_settings_but_what_the_physics_lacks() -> None:
    text = "LAND_PF_ARSPD 11\nTRIM_THROTTLE 1\nAHRS_WIND_MAX 5\nLAND_FLAP_PERCNT 40\nBATT_WATT_MAX 300\n"
    left = [one.split()[0] for one in said(text, TO_GROUND, by_program=True)]
    assert left == ["BATT_WATT_MAX", "LAND_FLAP_PERCNT"]


def test_a_set_holds_these_settings_only_where_they_are_stated() -> None:
    made = ArduPilotParameters.from_text("LAND_TYPE 1\nWP_RADIUS 60\nSERIAL1_BAUD 57\n", "mine.param")
    assert made.by_origin("file") == {"WP_RADIUS": 60.0, "LAND_TYPE": 1.0}
    assert made.unused == ("SERIAL1_BAUD",)
    assert len(made.values) == len(ArduPilotParameters.defaults().values) + 1
    again = ArduPilotParameters.restore(StoredParameters(made.values, made.unused, made.source))
    assert again == made
    assert ArduPilotParameters.defaults().changed(LAND_TYPE=1.0).by_origin("file") == {"LAND_TYPE": 1.0}
