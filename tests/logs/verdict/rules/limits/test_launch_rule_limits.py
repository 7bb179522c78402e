"""How gently a launch may push, how much height it may lose, how near the ground it may climb."""

from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_flight
from logs.verdict.places import Place
from tests.logs.verdict.judging import of
from tests.logs.verdict.rules.flown_circuits import RAIL, flown_circuit, found, moved


@pytest.mark.parametrize(("speed", "ok"), [(13.42, True), (13.41, False)])
def test_the_motor_starts_from_minacc_on(speed: float, ok: bool) -> None:
    """v^2 / 2 L over 6 m: 15 m/s^2 at 13.4164 m/s; the flight itself went well."""
    flown = flown_circuit()
    setup = flown.setup.in_scenario(replace(flown.setup.scenario, launch=replace(RAIL, speed=speed)))
    assert found(setup, flown.track, "launch").ok is ok


@pytest.mark.parametrize(("lost", "ok"), [(0.98, True), (1.02, False)])
def test_a_metre_of_height_may_be_lost(lost: float, ok: bool) -> None:
    flown = flown_circuit()
    first = float(flown.track.position[0, 2])
    row = 30
    sunk = moved(flown.track, slice(row, row + 1), up=first - lost - float(flown.track.position[row, 2]))
    assert found(flown.setup, sunk, "launch").ok is ok


@pytest.mark.parametrize(("up", "ok"), [(2.02, True), (1.98, False)])
def test_beyond_fifty_metres_of_way_two_metres_are_left_over_the_ground(up: float, ok: bool) -> None:
    flown = flown_circuit()
    position = flown.track.position
    run = np.hypot(position[:, 0] - position[0, 0], position[:, 1] - position[0, 1])
    row = int(np.argmax(run > 60.0))
    # Without a loss of height that counts: the first row is a little above.
    low = moved(flown.track, slice(row, row + 1), up=up - float(position[row, 2]))
    low = moved(low, slice(0, 30), up=up - float(position[0, 2]) + 0.5)
    assert found(flown.setup, low, "launch").ok is ok


@pytest.mark.parametrize(("up", "ok"), [(20.0 - 0.08, True), (20.0 - 0.12, False)])
@pytest.mark.parametrize("leg", [0, 2])
def test_the_legs_near_the_ground_need_twenty_metres(leg: int, up: float, ok: bool) -> None:
    """Of a scenario that asks for 60 m: the leg after the take-off, and the last two of a landing."""
    flown = flown_circuit()
    track = flown.track
    ends = judge_flight(flown.setup, track, "completed").leg_ends
    when = {0: ends[0] - 8.0, 2: ends[1] + 6.0}[leg]
    row = int(np.searchsorted(track.time, when))
    low = moved(track, slice(row, row + 1), up=up - float(track.position[row, 2]))
    verdict = judge_flight(flown.setup, low, "completed")
    assert of(verdict, "clearance", Place("leg", leg)).ok is ok
