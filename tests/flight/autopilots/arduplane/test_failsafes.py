"""What ArduPlane does in AUTO when something fails, as ArduPlane/events.cpp and fence.cpp have it."""

import pytest

from flight.autopilots.arduplane.failsafes import failsafe_causes
from flight.autopilots.arduplane.parameters import default_parameters


def does(name: str, *, has_fence: bool = False, **values: float) -> str:
    """What it does on this cause; "" where the cause is none."""
    causes = failsafe_causes(default_parameters().changed(**values), has_fence=has_fence)
    return next((cause.does for cause in causes if cause.name == name), "")


@pytest.mark.parametrize(
    ("short", "long", "first", "then"),
    [
        (0, 0, "", "on"),
        (3, 0, "", "on"),
        (0, 1, "", "return"),
        (0, 2, "", "glide"),
        (0, 4, "", "on"),
        (0, 5, "", "land"),
        # From CIRCLE, FBWA or FBWB "continue" is a return; from AUTO alone it is not.
        (1, 0, "circle", "return"),
        (2, 0, "level", "return"),
        (4, 0, "level", "return"),
        (1, 2, "circle", "glide"),
        (1, 4, "circle", "on"),
    ],
)
def test_a_lost_transmitter(short: int, long: int, first: str, then: str) -> None:
    values = {"FS_SHORT_ACTN": float(short), "FS_LONG_ACTN": float(long)}
    assert (does("RC lost for 1.5 s", **values), does("RC lost", **values)) == (first, then)
    # Without the failsafe nobody notices.
    assert (does("RC lost for 1.5 s", **values, THR_FAILSAFE=0.0), does("RC lost", **values, THR_FAILSAFE=0.0)) == (
        "",
        "on",
    )


@pytest.mark.parametrize(
    ("action", "done"),
    [(0, "on"), (1, "return"), (2, "land"), (3, "terminate"), (4, "land"), (5, "parachute"), (6, "land")],
)
def test_a_low_battery(action: int, done: str) -> None:
    """Landing on rotors falls through to a landing, for an aeroplane without them."""
    assert does("battery low", BATT_FS_LOW_ACT=float(action)) == done
    assert does("battery critical", BATT_FS_CRT_ACT=float(action)) == done


@pytest.mark.parametrize(("action", "done"), [(0, "on"), (1, "return"), (6, "guided"), (7, "guided"), (8, "land")])
def test_a_broken_fence(action: int, done: str) -> None:
    assert does("fence broken", has_fence=True, FENCE_ENABLE=1.0, FENCE_ACTION=float(action)) == done
    assert does("fence broken", has_fence=True, FENCE_ENABLE=0.0, FENCE_ACTION=float(action)) == "on"
    assert does("fence broken", FENCE_ENABLE=1.0, FENCE_ACTION=float(action)) == ""


def test_a_lost_station() -> None:
    assert does("station lost", FS_LONG_ACTN=1.0) == "on"
    assert does("station lost", FS_GCS_ENABL=1.0, FS_LONG_ACTN=1.0) == "return"
