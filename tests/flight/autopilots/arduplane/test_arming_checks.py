"""ArduPlane's checks before arming: which values fail them, by the conditions in its sources."""

import math

import pytest

from flight.autopilots.arduplane.open_settings import describe_open_settings
from flight.autopilots.arduplane.parameters import OTHER_BATTERY_MONITORS, ArduPilotParameters
from flight.autopilots.parts import MissionParts
from world.scenario_tables import ArduPlaneVersion

IN_THE_AIR = MissionParts()
FENCED = MissionParts(has_fence=True)


def said(text: str, mission: MissionParts = IN_THE_AIR, version: ArduPlaneVersion = "4.7") -> list[str]:
    return describe_open_settings(ArduPilotParameters.from_text(text, "mine.param", version), mission, by_program=False)


def holds(text: str, mission: MissionParts, words: str, version: ArduPlaneVersion = "4.7") -> None:
    """One text begins with the words, or there is none; without the checks there is none either."""
    texts = said(text, mission, version)
    assert len(texts) == bool(words)
    assert all(one.startswith(words) for one in texts)
    for switched_off in ("ARMING_CHECK 0", "ARMING_SKIPCHK -1", "ARMING_REQUIRE 0"):
        assert said(f"{text}\n{switched_off}", mission, version) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        # `servo_checks`: MIN above TRIM, or MAX below it; by default 1100, 1500, 1900.
        ("SERVO3_TRIM 1099", "SERVO3_TRIM 1099 prevents arming: ArduPlane requires SERVO3_MIN 1100 to SERVO3_MAX 1900"),
        ("SERVO3_TRIM 1100", ""),
        ("SERVO3_MIN 1501", "SERVO3_TRIM 1500 prevents arming: ArduPlane requires SERVO3_MIN 1501 to"),
        ("SERVO3_MAX 1499", "SERVO3_TRIM 1500 prevents arming: ArduPlane requires SERVO3_MIN 1100 to SERVO3_MAX 1499"),
        ("SERVO3_MAX 1500", ""),
        # An output without a function is not checked.
        ("SERVO5_TRIM 900", ""),
        ("SERVO5_FUNCTION 21\nSERVO5_TRIM 900", "SERVO5_TRIM 900 prevents arming"),
        ("SERVO32_FUNCTION 21\nSERVO32_TRIM 900", "SERVO32_TRIM 900 prevents arming"),
        # `rc_calibration_checks`: the same of each radio channel.
        ("RC1_MIN 1501", "RC1_TRIM 1500 prevents arming: ArduPlane requires RC1_MIN 1501 to RC1_MAX 1900"),
        ("RC16_MAX 1499", "RC16_TRIM 1500 prevents arming: ArduPlane requires RC16_MIN 1100 to RC16_MAX 1499"),
        ("RC1_MIN 1500\nRC1_MAX 1500", ""),
        # `rc_failsafe_active`: radio failsafe up to THR_FS_VALUE, and the stick is at idle.
        ("THR_FS_VALUE 1100", "THR_FS_VALUE 1100 prevents arming: ArduPlane requires a value below RC3_MIN 1100"),
        ("THR_FS_VALUE 1099", ""),
        ("RC3_MIN 950", "THR_FS_VALUE 950 prevents arming: ArduPlane requires a value below RC3_MIN 950"),
        ("THR_FS_VALUE 2000\nTHR_FAILSAFE 0", ""),
        ("THR_FS_VALUE 2000\nTHR_FAILSAFE 2", ""),
        ("THR_FS_VALUE 1150\nRCMAP_THROTTLE 4\nRC4_MIN 1200", ""),
        ("RC3_REVERSED 1", "THR_FS_VALUE 950 prevents arming: ArduPlane requires a value above RC3_MAX 1900"),
        ("RC3_REVERSED 1\nTHR_FS_VALUE 1901", ""),
    ],
)
def test_pulses_and_the_radio_failsafe(text: str, words: str) -> None:
    holds(text, IN_THE_AIR, words)


def test_an_output_of_one_pulse_moves_nothing() -> None:
    flat = "SERVO1_FUNCTION to SERVO16_FUNCTION with SERVOn_MIN below SERVOn_MAX move no motor"
    assert [text.startswith(flat) for text in said("SERVO3_MIN 1500\nSERVO3_MAX 1500")] == [True]
    assert said("SERVO5_MIN 1500\nSERVO5_MAX 1500") == []


@pytest.mark.parametrize("monitor", ["BATT", *OTHER_BATTERY_MONITORS])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        # `AP_BattMonitor_Backend::arming_checks`; 0 switches a threshold off.
        ("LOW_VOLT 9\n{}_CRT_VOLT 10", "LOW_VOLT 9 prevents arming: ArduPlane requires at least {}_CRT_VOLT 10"),
        ("LOW_VOLT 10\n{}_CRT_VOLT 10", ""),
        ("LOW_VOLT 0\n{}_CRT_VOLT 10", ""),
        ("LOW_MAH 1000\n{}_CRT_MAH 2000", "LOW_MAH 1000 prevents arming: ArduPlane requires at least {}_CRT_MAH 2000"),
        ("LOW_MAH 2000\n{}_CRT_MAH 1000", ""),
        # A full battery has its capacity, 3300 mAh by default, and here 16.8 V.
        ("ARM_MAH 3301", "ARM_MAH 3301 prevents arming: ArduPlane requires at most {}_CAPACITY 3300"),
        ("ARM_MAH 3300", ""),
        ("LOW_MAH 1200\n{}_CAPACITY 1000", "LOW_MAH 1200 prevents arming: ArduPlane requires at most {}_CAPACITY 1000"),
        ("CRT_MAH 1200\n{}_CAPACITY 1000", "CRT_MAH 1200 prevents arming: ArduPlane requires at most {}_CAPACITY 1000"),
        ("ARM_VOLT 16.9", "ARM_VOLT 16.9 prevents arming: ArduPlane requires at most the 16.8 V of a full battery"),
        ("ARM_VOLT 16.8", ""),
        ("LOW_VOLT 16.9", "LOW_VOLT 16.9 prevents arming"),
        ("CRT_VOLT 16.9", "CRT_VOLT 16.9 prevents arming"),
        # Monitors 3 and 6 measure no current, so that their charge has no threshold in flight; 0 is no monitor.
        ("LOW_MAH 4000\n{}_MONITOR 3", ""),
        ("ARM_MAH 4000\n{}_MONITOR 3", "ARM_MAH 4000 prevents arming"),
        ("ARM_MAH 4000\n{}_MONITOR 0", ""),
    ],
)
def test_batteries(monitor: str, text: str, words: str) -> None:
    monitored = "" if "_MONITOR" in text else f"\n{monitor}_MONITOR 4"
    stated = f"{monitor}_{text.format(monitor)}{monitored}"
    holds(stated, IN_THE_AIR._replace(full_voltage=16.8), f"{monitor}_{words.format(monitor)}" if words else "")


def test_a_battery_of_unknown_voltage_has_no_limit() -> None:
    assert said("BATT_MONITOR 4\nBATT_ARM_VOLT 60") == []


@pytest.mark.parametrize(
    ("text", "version", "words"),
    [
        ("FS_LONG_TIMEOUT 1", "4.6", "FS_LONG_TIMEOUT 1 prevents arming: ArduPlane 4.6 requires at least"),
        ("FS_LONG_TIMEOUT 1.5", "4.6", ""),
        ("FS_LONG_TIMEOUT 1\nFS_SHORT_ACTN 3", "4.6", ""),
        # 4.7 has no FS_SHORT_TIMEOUT: a file that states it is of an earlier release.
        ("FS_LONG_TIMEOUT 1", "4.7", ""),
        ("FS_LONG_TIMEOUT 1\nFS_SHORT_TIMEOUT 5", "4.7", "FS_LONG_TIMEOUT 1 prevents arming: ArduPlane 4.6"),
    ],
)
def test_timeouts(text: str, version: ArduPlaneVersion, words: str) -> None:
    holds(text, IN_THE_AIR, words, version)


@pytest.mark.parametrize(
    ("text", "mission", "words"),
    [
        # `AP_Arming::mission_checks`: 2 and 16 are VTOL items, 84 and 85, and 32 is a rally point.
        (
            "ARMING_MIS_ITEMS 2",
            IN_THE_AIR,
            "ARMING_MIS_ITEMS 2 prevents arming, because the mission has no NAV_VTOL_LAND",
        ),
        (
            "ARMING_MIS_ITEMS 16",
            IN_THE_AIR,
            "ARMING_MIS_ITEMS 16 prevents arming, because the mission has no NAV_VTOL_TAKEOFF",
        ),
        ("ARMING_MIS_ITEMS 18", MissionParts(commands=frozenset({84, 85})), ""),
        ("ARMING_MIS_ITEMS 32", IN_THE_AIR, "ARMING_MIS_ITEMS 32 prevents arming, because no rally point is"),
        (
            "ARMING_MIS_ITEMS 32\nRALLY_LIMIT_KM 0",
            IN_THE_AIR,
            "ARMING_MIS_ITEMS 32 prevents arming, because there is no",
        ),
        # RALLY_LIMIT_KM is 5 by default.
        ("ARMING_MIS_ITEMS 32", MissionParts(rally_distance=5000.0), ""),
        (
            "ARMING_MIS_ITEMS 32",
            MissionParts(rally_distance=5001.0),
            "ARMING_MIS_ITEMS 32 prevents arming, because no rally point",
        ),
        ("ARMING_MIS_ITEMS 32\nRALLY_LIMIT_KM 0", MissionParts(rally_distance=5001.0), ""),
        ("ARMING_MIS_ITEMS 32", MissionParts(rally_distance=math.nan), ""),
    ],
)
def test_required_items(text: str, mission: MissionParts, words: str) -> None:
    holds(text, mission, words)


@pytest.mark.parametrize(
    ("text", "mission", "words"),
    [
        # `AC_Fence::pre_arm_check`: on, and none is there.
        ("FENCE_ENABLE 1", IN_THE_AIR, "FENCE_ENABLE 1 prevents arming, because no fence of FENCE_TYPE 4"),
        ("FENCE_ENABLE 1", FENCED, ""),
        ("FENCE_ENABLE 1\nFENCE_TYPE 0", FENCED, "FENCE_ENABLE 1 prevents arming, because no fence of FENCE_TYPE 0"),
        ("FENCE_ENABLE 1\nFENCE_TYPE 1\nFENCE_ACTION 0", IN_THE_AIR, ""),
        ("FENCE_TYPE 0", FENCED, ""),
        ("FENCE_AUTOENABLE 1", IN_THE_AIR, ""),
        # `check_inclusion_circle_margin`: the radius of a circle below the margin.
        ("FENCE_ENABLE 1\nFENCE_MARGIN 50", FENCED._replace(smallest_inclusion=49.0), "FENCE_MARGIN 50 prevents"),
        ("FENCE_ENABLE 1\nFENCE_MARGIN 50", FENCED._replace(smallest_inclusion=50.0), ""),
        ("FENCE_MARGIN 50", FENCED._replace(smallest_inclusion=49.0), ""),
        ("FENCE_AUTOENABLE 3\nFENCE_MARGIN 50", FENCED._replace(smallest_inclusion=49.0), "FENCE_MARGIN 50 prevents"),
        ("FENCE_ENABLE 1\nFENCE_MARGIN_XY 50", FENCED._replace(smallest_inclusion=49.0), "FENCE_MARGIN_XY 50 prevents"),
        # `pre_arm_check_circle`, whatever the type; FENCE_RADIUS is 300 by default.
        (
            "FENCE_ENABLE 1\nFENCE_MARGIN_XY 301",
            FENCED,
            "FENCE_MARGIN_XY 301 prevents arming: ArduPlane requires at most",
        ),
        ("FENCE_ENABLE 1\nFENCE_MARGIN_XY 300", FENCED, ""),
        (
            "FENCE_ENABLE 1\nFENCE_RADIUS 1",
            FENCED,
            "FENCE_MARGIN 2 prevents arming: ArduPlane requires at most FENCE_RADIUS",
        ),
        # From -10 to 100 m there are 110, which must be more than two margins.
        ("FENCE_ENABLE 1\nFENCE_MARGIN 55", FENCED, "FENCE_ALT_MIN -10 and FENCE_ALT_MAX 100 prevent arming"),
        ("FENCE_ENABLE 1\nFENCE_MARGIN 54", FENCED, ""),
        ("FENCE_ENABLE 1\nFENCE_ALT_MIN -101", FENCED, "FENCE_ALT_MIN -101 and FENCE_ALT_MAX 100 prevent arming"),
        ("FENCE_ENABLE 1\nFENCE_ALT_MAX -1", FENCED, "FENCE_ALT_MIN -10 and FENCE_ALT_MAX -1 prevent arming"),
        ("FENCE_ENABLE 1\nFENCE_MARGIN -1", FENCED, "FENCE_MARGIN -1 prevents arming: ArduPlane requires at least 0"),
        # Breached where the aircraft is armed; FENCE_AUTOENABLE 1 and 2 wait for a take-off.
        ("FENCE_ENABLE 1", FENCED._replace(fence_at_home="outside"), "FENCE_ENABLE 1 prevents arming, because home"),
        (
            "FENCE_AUTOENABLE 3",
            FENCED._replace(fence_at_home="outside"),
            "FENCE_AUTOENABLE 3 prevents arming, because",
        ),
        ("FENCE_AUTOENABLE 1", FENCED._replace(fence_at_home="outside"), ""),
        ("FENCE_ENABLE 1\nFENCE_TYPE 1\nFENCE_ACTION 0", FENCED._replace(fence_at_home="outside"), ""),
        ("WP_RADIUS 60", FENCED._replace(fence_at_home="outside"), ""),
    ],
)
def test_fences(text: str, mission: MissionParts, words: str) -> None:
    holds(text, mission, words)


def test_4_6_has_no_horizontal_margin_of_its_own() -> None:
    assert said("FENCE_ENABLE 1\nFENCE_MARGIN_XY 301", FENCED, "4.6") == []
