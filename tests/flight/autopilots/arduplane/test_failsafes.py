"""What ArduPlane does in AUTO when something fails, as ArduPlane/events.cpp and fence.cpp have it."""

import pytest

from flight.autopilots.arduplane.failsafes import failsafe_causes, link_loss_reactions
from flight.autopilots.arduplane.parameters import ArduPilotParameters

# A battery that is watched, with both thresholds.
WATCHED = {"BATT_MONITOR": 4.0, "BATT_LOW_VOLT": 14.0, "BATT_CRT_MAH": 500.0}


def does(
    name: str,
    *,
    has_fence: bool = False,
    has_landing_sequence: bool = False,
    ends_with_landing: bool = False,
    **values: float,
) -> str:
    """What it does on this cause; "" where the cause is none."""
    made = ArduPilotParameters.defaults().changed(**values)
    causes = failsafe_causes(
        made, has_fence=has_fence, has_landing_sequence=has_landing_sequence, ends_with_landing=ends_with_landing
    )
    return next((cause.action for cause in causes if cause.name == name), "")


@pytest.mark.parametrize(
    ("short", "long", "first", "then"),
    [
        (0, 0, "", "on"),
        (3, 0, "", "on"),
        (0, 1, "", "return"),
        (0, 2, "", "glide"),
        (0, 4, "", "on"),
        (0, 5, "", "autoland"),
        # From CIRCLE, FBWA or FBWB "continue" is a return; from AUTO alone it is not.
        (1, 0, "circle", "return"),
        # FBWA holds wings and nose level with the throttle at its minimum: a glide.  FBWB holds its height.
        (2, 0, "glide", "return"),
        (4, 0, "level", "return"),
        (1, 2, "circle", "glide"),
        (1, 4, "circle", "on"),
    ],
)
def test_a_lost_transmitter(short: int, long: int, first: str, then: str) -> None:
    values = {"FS_SHORT_ACTN": float(short), "FS_LONG_ACTN": float(long)}
    assert (does("RC lost for 1.5 s", **values), does("RC lost", **values)) == (first, then)
    # Without the failsafe nobody notices; with THR_FAILSAFE 2 the loss is noticed, and no failsafe begins.
    for unset in (0.0, 2.0):
        told = does("RC lost for 1.5 s", **values, THR_FAILSAFE=unset), does("RC lost", **values, THR_FAILSAFE=unset)
        assert told == ("", "on")


@pytest.mark.parametrize(
    ("action", "done", "without"),
    [
        (0, "on", "on"),
        (1, "return", "return"),
        (2, "land", "return"),
        (3, "terminate", "terminate"),
        (4, "land", "return"),
        (5, "parachute", "parachute"),
        (6, "land", "return"),
        (7, "autoland", "autoland"),
    ],
)
def test_a_low_battery(action: int, done: str, without: str) -> None:
    """Landing on rotors falls through to a landing, for an aeroplane without them; that to a return without one."""
    values = {"BATT_FS_LOW_ACT": float(action), "BATT_FS_CRT_ACT": float(action), **WATCHED}
    for name in ("battery low", "battery critical"):
        assert does(name, **values, has_landing_sequence=True) == done
        assert does(name, **values) == without


@pytest.mark.parametrize(
    ("values", "low", "critical"),
    [
        ({"BATT_MONITOR": 0.0}, "never", "never"),
        ({"BATT_LOW_VOLT": 0.0}, "never", "return"),
        ({"BATT_LOW_VOLT": 0.0, "BATT_LOW_MAH": 800.0}, "return", "return"),
        ({"BATT_CRT_MAH": 0.0}, "return", "never"),
        ({"BATT_CRT_MAH": 0.0, "BATT_CRT_VOLT": 13.0}, "return", "return"),
        ({"BATT_MONITOR": 0.0, "BATT_FS_LOW_ACT": 0.0}, "on", "never"),
    ],
)
def test_a_battery_without_monitor_or_threshold_triggers_nothing(
    values: dict[str, float], low: str, critical: str
) -> None:
    made = {"BATT_FS_LOW_ACT": 1.0, "BATT_FS_CRT_ACT": 1.0, **WATCHED, **values}
    assert (does("battery low", **made), does("battery critical", **made)) == (low, critical)


def test_a_monitor_that_nobody_stated_is_the_boards() -> None:
    assert does("battery low", BATT_FS_LOW_ACT=1.0, BATT_LOW_VOLT=14.0) == "return"


@pytest.mark.parametrize(("action", "done"), [(0, "on"), (1, "return"), (6, "guided"), (7, "guided"), (8, "autoland")])
def test_a_broken_fence(action: int, done: str) -> None:
    for enabled in ({"FENCE_ENABLE": 1.0}, {"FENCE_AUTOENABLE": 1.0}, {"FENCE_AUTOENABLE": 3.0}):
        assert does("fence broken", has_fence=True, FENCE_ACTION=float(action), **enabled) == done
        assert does("fence broken", FENCE_ACTION=float(action), **enabled) == ""
    assert does("fence broken", has_fence=True, FENCE_ENABLE=0.0, FENCE_ACTION=float(action)) == "on"


def test_a_mission_that_ends_on_the_ground_does_not_return() -> None:
    assert (does("the mission's end"), does("the mission's end", ends_with_landing=True)) == ("return", "landed")


def test_a_lost_station() -> None:
    assert does("station lost", FS_LONG_ACTN=1.0) == "on"
    assert does("station lost", FS_GCS_ENABL=1.0, FS_LONG_ACTN=1.0) == "return"


@pytest.mark.parametrize(
    ("values", "reactions"),
    [
        ({}, []),
        ({"FS_LONG_ACTN": 1.0}, []),
        ({"FS_GCS_ENABL": 1.0}, []),
        ({"FS_GCS_ENABL": 1.0, "FS_LONG_ACTN": 1.0}, [("return", 5.0)]),
        ({"FS_GCS_ENABL": 3.0, "FS_LONG_ACTN": 2.0, "FS_LONG_TIMEOUT": 20.0}, [("glide", 20.0)]),
    ],
)
def test_the_time_until_a_lost_station_is_noticed(values: dict[str, float], reactions: list[tuple[str, float]]) -> None:
    """`Plane::check_long_failsafe`: FS_LONG_TIMEOUT after the last heartbeat."""
    found = link_loss_reactions(ArduPilotParameters.defaults().changed(**values), "telemetry")
    leaving = [(reaction.action, reaction.delay) for reaction in found if reaction.action != "on"]
    assert (leaving, len(found)) == (reactions, max(1, len(reactions)))


@pytest.mark.parametrize(
    ("values", "reactions"),
    [
        ({}, []),
        # The long failsafe counts from the short one, which changes nothing in AUTO.
        ({"FS_LONG_ACTN": 1.0}, [("return", 6.5)]),
        # There is no short failsafe.
        ({"FS_SHORT_ACTN": 3.0, "FS_LONG_ACTN": 1.0}, [("return", 5.0)]),
        ({"FS_SHORT_ACTN": 2.0, "FS_LONG_TIMEOUT": 30.0}, [("glide", 1.5), ("return", 31.5)]),
        ({"FS_SHORT_ACTN": 1.0, "FS_SHORT_TIMEOUT": 4.0, "FS_LONG_ACTN": 4.0}, [("circle", 4.0)]),
        ({"FS_SHORT_ACTN": 1.0, "FS_LONG_ACTN": 1.0, "THR_FAILSAFE": 0.0}, []),
        ({"FS_SHORT_ACTN": 1.0, "FS_LONG_ACTN": 1.0, "THR_FAILSAFE": 2.0}, []),
    ],
)
def test_the_time_until_a_lost_transmitter_is_noticed(
    values: dict[str, float], reactions: list[tuple[str, float]]
) -> None:
    found = link_loss_reactions(ArduPilotParameters.defaults().changed(**values), "control")
    leaving = [(reaction.action, reaction.delay) for reaction in found if reaction.action != "on"]
    assert (leaving, len(found)) == (reactions, max(1, len(reactions)))


def test_the_name_of_the_short_failsafe_states_its_timeout() -> None:
    assert does("RC lost for 4 s", FS_SHORT_ACTN=1.0, FS_SHORT_TIMEOUT=4.0) == "circle"
