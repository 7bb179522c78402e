"""Arming and modes: what is refused, and that the flight starts once the vehicle is armed, in AUTO and judged."""

import pytest

from flight.live.arming import ACCEPTED, DENIED, IN_PROGRESS, ArmingState
from flight.live.flight_process import LoiterCenter, MissionJudged
from flight.live.telemetry import (
    ACTIVE,
    AUTO,
    COMPLETE,
    GUIDED,
    LOITER,
    MANUAL,
    NO_MISSION,
    NOT_STARTED,
    PAUSED,
    RTL,
)

FORCED = 21196.0


def judged(*, possible: bool = True, flyable: bool = True) -> ArmingState:
    """A vehicle whose mission has this verdict."""
    state = ArmingState()
    state.on_mission_uploaded()
    state.on_mission_judged(MissionJudged(1, possible, flyable, ()))
    return state


def test_armed_in_auto_with_a_verdict_starts() -> None:
    state = judged()
    assert state.arm(True, 0.0).result == ACCEPTED
    assert not state.should_start
    assert state.set_mode(AUTO).result == ACCEPTED
    assert state.should_start
    state.on_flight_started()
    assert (state.should_start, state.flying, state.mission_state) == (False, True, ACTIVE)
    state.on_flight_ended(True)
    assert (state.armed, state.mode, state.mission_state) == (False, MANUAL, COMPLETE)


def test_only_a_mission_is_said_to_start() -> None:
    assert judged().arm(True, 0.0).text == "armed: AUTO starts the mission"
    assert ArmingState().arm(True, 0.0).text == "armed: no mission yet"


def test_an_arm_command_waits_for_the_verdict() -> None:
    state = ArmingState()
    state.on_mission_uploaded()
    assert state.arm(True, 0.0).result == IN_PROGRESS
    assert not state.can_arm


@pytest.mark.parametrize(
    ("possible", "flyable", "param2", "result"),
    [
        (True, True, 0.0, ACCEPTED),
        (True, False, 0.0, DENIED),
        (True, False, FORCED, ACCEPTED),
        (False, False, 0.0, DENIED),
        (False, False, FORCED, DENIED),
    ],
)
def test_only_what_is_flyable_is_armed_unless_forced(possible: bool, flyable: bool, param2: float, result: int) -> None:
    assert judged(possible=possible, flyable=flyable).arm(True, param2).result == result


def test_a_verdict_against_an_armed_vehicle_disarms_it() -> None:
    state = judged()
    state.arm(True, 0.0)
    state.on_mission_uploaded()
    text = state.on_mission_judged(MissionJudged(2, True, False, ()))
    assert text.startswith("disarmed: ")
    assert not state.armed


def flying() -> ArmingState:
    """A vehicle on its mission."""
    state = judged()
    state.arm(True, 0.0)
    state.set_mode(AUTO)
    state.on_flight_started()
    return state


def test_in_flight_only_a_forced_disarm_ends_it() -> None:
    state = flying()
    assert state.arm(False, 0.0).result == DENIED
    assert state.set_mode(MANUAL).result == DENIED
    assert (state.mode, state.end_requested) == (AUTO, False)
    assert state.arm(False, FORCED).result == ACCEPTED
    assert state.end_requested


@pytest.mark.parametrize("mode", [LOITER, RTL, GUIDED])
def test_in_flight_a_mode_sends_it_another_way_once(mode: int) -> None:
    state = flying()
    assert state.set_mode(mode).result == ACCEPTED
    assert (state.mode, state.loiter_center, state.mission_state) == (mode, LoiterCenter(), PAUSED)
    state.loiter_center = None
    assert state.set_mode(mode).result == ACCEPTED
    assert state.loiter_center is None, "it is on that way already"
    assert state.set_mode(AUTO).result == ACCEPTED
    assert (state.loiter_center, state.mission_state) == (LoiterCenter(), ACTIVE)
    assert judged().set_mode(RTL).result == judged().set_mode(GUIDED).result == DENIED, "on the ground"


def test_a_pause_circles_and_a_go_to_needs_a_flight() -> None:
    state, there = flying(), LoiterCenter(46.0, 8.0, 150.0)
    assert (state.pause_or_continue(False).result, state.mode) == (ACCEPTED, LOITER)
    assert (state.pause_or_continue(True).result, state.mode) == (ACCEPTED, AUTO)
    assert (state.go_to(there).result, state.mode, state.loiter_center) == (ACCEPTED, GUIDED, there)
    assert judged().go_to(there).result == judged().pause_or_continue(False).result == DENIED
    # What ends beside the mission completes nothing of it.
    state.on_flight_ended(True)
    assert (state.mode, state.loiter_center, state.mission_state) == (MANUAL, None, NOT_STARTED)


def test_auto_needs_a_mission_and_goes_with_it() -> None:
    state = ArmingState()
    assert state.set_mode(AUTO).result == DENIED
    assert state.set_mode(5).text.startswith("FLY_BY_WIRE_A denied")
    state = judged()
    assert state.mission_state == NOT_STARTED
    state.set_mode(AUTO)
    state.on_mission_cleared()
    assert (state.mode, state.mission_state) == (MANUAL, NO_MISSION)
