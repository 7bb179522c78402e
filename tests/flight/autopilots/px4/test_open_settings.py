"""PX4's settings that leave no position, no control or no arming, and gains that hold no attitude."""

import math

import pytest

from aircraft.catalog import aircraft_names, load_aircraft
from flight.autopilots.parts import MissionParts
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.open_settings import rate_gains
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4_sitl.autopilot import Px4Sitl

# Defaults of PX4 1.17, in its parameter reference, and the allocation of an aircraft with ailerons.
DEFAULTS = """FW_RR_FF 0.5
FW_RR_P 0.05
FW_RR_I 0.1
FW_RR_D 0
FW_PR_FF 0.5
FW_PR_P 0.08
FW_PR_I 0.1
FW_PR_D 0
FW_R_TC 0.4
FW_P_TC 0.4
FW_R_RMAX 70
FW_P_RMAX_POS 60
FW_P_RMAX_NEG 60
FW_Y_RMAX 50
COM_ARMABLE 1
EKF2_EN 1
EKF2_GPS_CTRL 7
EKF2_BARO_CTRL 1
EKF2_HGT_REF 1
SYS_HAS_GPS 1
SYS_HAS_BARO 1
SYS_HITL 0
GPS_1_CONFIG 201
GPS_2_CONFIG 0
UAVCAN_ENABLE 0
CA_AIRFRAME 1
CA_ROTOR_COUNT 1
CA_SV_CS_COUNT 4
CA_SV_CS0_TYPE 1
CA_SV_CS1_TYPE 2
CA_SV_CS2_TYPE 3
CA_SV_CS3_TYPE 4
"""


def said(text: str, aircraft: str = "aerosonde") -> list[str]:
    made = Px4(Px4Parameters.from_text(text, "mine.params"))
    return made.checks.describe_unsimulated_settings(MissionParts(aircraft=load_aircraft(aircraft)))


@pytest.mark.parametrize("name", aircraft_names())
def test_px4s_defaults_leave_nothing_open_stated_or_not(name: str) -> None:
    assert said(DEFAULTS, name) == said("NAV_ACC_RAD 30", name) == []


@pytest.mark.parametrize(
    ("text", "name"),
    [
        # `RollController::control_roll` limits the rate to 0, too.
        ("FW_R_RMAX 0", "FW_R_RMAX 0"),
        ("FW_R_RMAX 2", ""),  # flown
        ("FW_P_RMAX_POS 2", "FW_P_RMAX_POS 2"),
        ("FW_Y_RMAX 0", "FW_Y_RMAX 0"),
        ("EKF2_EN 0", "EKF2_EN 0"),
        ("SYS_HAS_GPS 0", "SYS_HAS_GPS 0"),
        ("SYS_HITL 1", "SYS_HITL 1"),
        ("COM_ARMABLE 0", "COM_ARMABLE 0"),
        ("EKF2_HGT_REF 2", "EKF2_HGT_REF 2"),
        ("EKF2_GPS_CTRL 0", "EKF2_GPS_CTRL 0 takes no position"),
        ("EKF2_GPS_CTRL 6", "EKF2_GPS_CTRL 6 takes no position"),
        ("EKF2_GPS_CTRL 1", ""),
        ("EKF2_GPS_CTRL 5\nSYS_HAS_BARO 0", "EKF2_GPS_CTRL 5 without a barometer"),
        ("EKF2_GPS_CTRL 5\nEKF2_BARO_CTRL 0", "EKF2_GPS_CTRL 5 without a barometer"),
        ("SYS_HAS_BARO 0", ""),
        ("SYS_HAS_MAG 0", ""),
        ("GPS_1_CONFIG 0", "GPS_1_CONFIG 0 connects no GPS"),
        ("GPS_1_CONFIG 0\nUAVCAN_ENABLE 2", ""),
        ("GPS_1_CONFIG 0\nSIM_GZ_EN 1", ""),
        ("CA_AIRFRAME 1\nCA_ROTOR_COUNT 0", "CA_ROTOR_COUNT 0 leaves no motor"),
        ("CA_AIRFRAME 1\nCA_SV_CS_COUNT 2\nCA_SV_CS0_TYPE 3\nCA_SV_CS1_TYPE 4", "CA_SV_CS_COUNT 2"),
        ("CA_AIRFRAME 1\nCA_SV_CS_COUNT 2\nCA_SV_CS0_TYPE 5\nCA_SV_CS1_TYPE 6", ""),
        (
            "CA_AIRFRAME 1\nCA_SV_CS_COUNT 2\nCA_SV_CS0_TYPE 1\nCA_SV_CS1_TYPE 3\nCA_SV_CS1_TRQ_P 0",
            "CA_SV_CS_COUNT 2 and CA_SV_CS*_TYPE leave no elevator",
        ),
        ("CA_AIRFRAME 1\nCA_SV_CS_COUNT 2\nCA_SV_CS0_TYPE 1\nCA_SV_CS1_TYPE 3\nCA_SV_CS1_TRQ_R 0", ""),
        # `ControlAllocation::applySlewRateLimit`.
        ("CA_SV1_SLEW 0.5", "CA_SV1_SLEW 0.5 s slows an actuator"),
        ("CA_R0_SLEW 10", "CA_R0_SLEW 10 s slows an actuator"),
        ("CA_SV1_SLEW 0\nCA_R0_SLEW 0", ""),
        # Functions of outputs: motors from 101, surfaces from 201.
        ("PWM_MAIN_FUNC1 101\nPWM_MAIN_FUNC2 0", "the output functions (PWM_MAIN_FUNC1 and others) connect no surface"),
        ("PWM_AUX_FUNC1 201\nPWM_AUX_FUNC2 202", "the output functions (PWM_MAIN_FUNC1 and others) connect no motor"),
        ("PWM_MAIN_FUNC1 201\nUAVCAN_EC_FUNC1 101", ""),
        ("CA_AIRFRAME 0\nCA_ROTOR_COUNT 0", "CA_AIRFRAME 0 is not a fixed wing"),
        ("CA_AIRFRAME 9", "CA_AIRFRAME 9 is not a fixed wing"),
        ("CA_AIRFRAME 0\nSYS_CTRL_ALLOC 0", ""),  # of a release before control allocation
        ("COM_ARM_AUTH_REQ 1", "COM_ARM_AUTH_REQ 1"),
        ("COM_ARM_AUTH_REQ 0", ""),
    ],
)
def test_what_leaves_no_position_or_control(text: str, name: str) -> None:
    assert len(said(text)) == bool(name)
    assert all(one.startswith(name) for one in said(text))


@pytest.mark.parametrize("name", aircraft_names())
@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("FW_RR_FF 0\nFW_RR_P 0\nFW_RR_I 0\nFW_PR_FF 0\nFW_PR_P 0\nFW_PR_I 0", ["FW_RR too low", "FW_PR too low"]),
        ("FW_RR_FF 0.0001\nFW_RR_P 0.0001\nFW_RR_I 0.0001", ["FW_RR too low"]),
        ("FW_PR_P 20", ["FW_PR too high"]),
        ("FW_R_TC 0.02", ["FW_RR too high"]),
        ("FW_R_TC 0.2\nFW_P_TC 1", []),
        # Airframes of PX4: 4003 rc_cessna, and a flying wing.
        ("FW_PR_P 0.9\nFW_PR_FF 0.5\nFW_PR_I 0.5\nFW_RR_FF 0.5\nFW_RR_P 0.3\nFW_RR_I 0.5", []),
        ("FW_PR_FF 0.35\nFW_RR_FF 0.6\nFW_RR_P 0.04", []),
    ],
)
def test_gains_that_hold_no_attitude_leave_the_verdict_open(name: str, text: str, faults: list[str]) -> None:
    assert [one[:5] + one.split("gains are")[1].split(" to ")[0] for one in said(text, name)] == faults


@pytest.mark.parametrize("name", aircraft_names())
def test_gains_of_the_aircraft_leave_nothing_open(name: str) -> None:
    gains = rate_gains(load_aircraft(name))
    assert said("\n".join(f"{key} {value:.4f}" for key, value in gains.items()), name) == []


def test_px4s_own_program_flies_the_gains_but_has_a_gps() -> None:
    made = Px4Sitl(Px4Parameters.from_text("FW_RR_FF 0\nFW_RR_P 0\nFW_RR_I 0\nEKF2_GPS_CTRL 0", "mine.params"))
    assert [text.split()[0] for text in made.checks.describe_unsimulated_settings(MissionParts())] == ["EKF2_GPS_CTRL"]


@pytest.mark.parametrize(
    ("text", "mission", "name"),
    [
        # `RTL::findRtlDestination`: 1 leaves out home where there is a landing, 3 takes the nearest of all.
        ("RTL_TYPE 1", MissionParts(returns=True, commands=frozenset({16, 20, 21})), "RTL_TYPE 1 may return to the"),
        ("RTL_TYPE 3", MissionParts(returns=True, commands=frozenset({16, 20, 189})), "RTL_TYPE 3 may return to the"),
        ("RTL_TYPE 0", MissionParts(returns=True, commands=frozenset({16, 20, 21})), ""),
        ("RTL_TYPE 1", MissionParts(returns=True, commands=frozenset({16, 20})), ""),
        ("RTL_TYPE 1", MissionParts(commands=frozenset({16, 21})), ""),
        ("RTL_TYPE 5", MissionParts(returns=True), "RTL_TYPE 5 without a rally point loiters"),
        ("RTL_TYPE 5", MissionParts(returns=True, rally_distance=10.0), ""),
        ("RTL_TYPE 0", MissionParts(returns=True, rally_distance=10.0), "PX4 ignores a rally point"),
        ("RTL_TYPE 0", MissionParts(returns=True, rally_distance=10.1), ""),
        ("RTL_TYPE 5", MissionParts(returns=True, rally_distance=math.nan), ""),
    ],
)
def test_returns_to_other_places_than_the_simulated_one(text: str, mission: MissionParts, name: str) -> None:
    made = Px4(
        Px4Parameters.from_text(f"{text}\nRTL_DESCEND_ALT 100\nRTL_RETURN_ALT 100\nRTL_LAND_DELAY -1", "mine.params")
    )
    texts = made.checks.describe_unsimulated_settings(mission)
    assert len(texts) == bool(name)
    assert all(one.startswith(name) for one in texts)
