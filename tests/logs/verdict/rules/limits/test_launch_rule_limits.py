"""How gently a launch may push, how much runway and height it may take, how near the ground it may climb."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_flight
from logs.verdict.places import Place
from tests.flight.autopilots.arduplane.flown_grounds import circuit, make_ground_setup
from tests.logs.verdict.judging import of
from tests.logs.verdict.rules.flown_circuits import RAIL, STRIP, flown_circuit, found, moved
from world.airfield import Launch


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


@pytest.mark.parametrize(("left", "ok"), [(10.05, True), (9.95, False)])
def test_ten_metres_of_a_runway_are_left_where_the_aircraft_leaves_it(left: float, ok: bool) -> None:
    """It stands 0.2 m high as far as 100 m to the east, and climbs from there on."""
    flown = flown_circuit()
    position = np.array(flown.track.position)
    row = int(np.argmax(position[:, 0] > 100.0))
    position[: row + 1, 2] = 0.2
    away = math.dist(position[row, :2], (0.0, 0.0))
    runway = Launch("runway", math.radians(90.0), length=away + left)
    one = found(circuit(runway, STRIP), replace(flown.track, position=position), "launch")
    assert one.ok is ok, one.reason
    if not ok:
        assert one.brief == f"leaves the ground {away:.0f} m from home"


def test_the_height_over_a_runway_counts_from_the_height_that_a_climb_out_needs() -> None:
    """It stands 0.2 m high, and 2.5 m more than the 2 m needed are beyond doubt: 4.7 m."""
    flown = flown_circuit()
    position = np.array(flown.track.position)
    row = int(np.argmax(position[:, 0] > 100.0))
    position[:row, 2] = 0.2
    position[row : row + 200, 2] = np.linspace(0.2, float(position[row + 200, 2]), 200)
    runway = Launch("runway", math.radians(90.0), length=1000.0)
    one = found(circuit(runway, STRIP), replace(flown.track, position=position), "launch")
    assert one.flown == pytest.approx(4.7, abs=0.2)


@pytest.mark.parametrize(("up", "ok"), [(4.52, True), (4.48, None), (2.02, None), (1.98, False)])
def test_beyond_fifty_metres_of_way_two_metres_are_left_and_two_and_a_half_more_to_be_sure(
    up: float, ok: bool | None
) -> None:
    flown = flown_circuit()
    position = flown.track.position
    run = np.hypot(position[:, 0] - position[0, 0], position[:, 1] - position[0, 1])
    row = int(np.argmax(run > 60.0))
    # Without a loss of height that counts: the first row is a little above.
    low = moved(flown.track, slice(row, row + 1), up=up - float(position[row, 2]))
    low = moved(low, slice(0, row), up=up - float(position[0, 2]) + 0.5)
    assert found(flown.setup, low, "launch").ok is ok


@pytest.mark.parametrize(("below", "ok"), [(0.08, True), (0.12, False)])
@pytest.mark.parametrize(("leg", "limit"), [(0, 20.0), (2, 30.0)])
def test_the_leg_after_a_take_off_needs_twenty_metres(leg: int, limit: float, below: float, ok: bool) -> None:
    """Of a scenario that asks for 30 m, which one to a landing needs, too, between waypoints that are higher."""
    flown = flown_circuit()
    track = flown.track
    ends = judge_flight(flown.setup, track, "completed").leg_ends
    when = {0: ends[0] - 8.0, 2: ends[1] + 6.0}[leg]
    row = int(np.searchsorted(track.time, when))
    low = moved(track, slice(row, row + 1), up=limit - below - float(track.position[row, 2]))
    verdict = judge_flight(flown.setup, low, "completed")
    assert of(verdict, "clearance", Place("leg", leg)).ok is ok


@pytest.mark.parametrize(("away", "ok"), [(1990.0, True), (2010.0, False)])
def test_within_two_kilometres_of_home_a_leg_is_near_the_ground(away: float, ok: bool) -> None:
    """Of a circuit whose way east is half as long again: 25 m above ground, where the scenario asks for 60 m."""
    flown = flown_circuit()
    mission, position = flown.setup.mission, np.array(flown.track.position)
    assert mission.home is not None
    west = mission.home.lon_deg
    items = tuple(replace(one, lon_deg=west + 1.5 * (one.lon_deg - west)) for one in mission.items)
    position[:, 0] *= 1.5
    row = int(np.argmax(position[:, 0] > away))
    position[row : row + 2, 2] = 25.0
    setup = make_ground_setup(flown.setup.scenario, replace(mission, items=items), TKOFF_THR_MINACC=15.0)
    verdict = judge_flight(setup, replace(flown.track, position=position), "completed")
    assert of(verdict, "clearance", Place("leg", 0)).ok is ok
