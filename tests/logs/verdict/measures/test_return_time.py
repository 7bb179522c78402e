"""Bounds of the time of a return and of the time for which the battery lasts, by hand."""

import math
from dataclasses import replace

import pytest

from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.return_time import longest_return_time, remaining_battery_time
from logs.verdict.measures.route_requirements import predicted_energy, route_requirements
from tests.logs.verdict.judging import of
from tests.mission_lines import setup_of, wp
from world.wind import Wind

# At 15 m/s; climbs at 3 m/s and sinks at 2 m/s.
VALUES = {
    "COM_FLTT_LOW_ACT": 3.0,
    "BAT1_CAPACITY": 20_000.0,
    "BAT_AVRG_CURRENT": 100.0,
    "RTL_RETURN_ALT": 100.0,
    "FW_AIRSPD_TRIM": 15.0,
    "FW_T_CLMB_R_SP": 3.0,
    "FW_T_SINK_R_SP": 2.0,
}
OUT = (wp(0, 0), wp(0, 3000))
# 3000 m at 15 - 6 m/s; 100 m up from the waypoints, 400 m AMSL; down from there, 500 m AMSL, to home at 300 m AMSL.
LONGEST_S = 3000.0 / 9.0 + 100.0 / 3.0 + 200.0 / 2.0


def windy(*lines: str, speed: float = 6.0, **values: float) -> FlightSetup:
    setup = setup_of(*lines)
    scenario = replace(setup.scenario, wind=Wind(speed, 0.0))
    return replace(setup, scenario=scenario, autopilot=Px4(Px4Parameters.defaults().changed(**(VALUES | values))))


def time_of(setup: FlightSetup) -> float:
    failsafe = setup.autopilot.checks.return_time_failsafe
    assert failsafe is not None
    return longest_return_time(route_requirements(setup), failsafe)


def test_the_longest_return_is_from_the_farthest_place_against_the_wind() -> None:
    assert time_of(windy(*OUT)) == pytest.approx(LONGEST_S, abs=0.1)
    assert time_of(windy(*OUT, RTL_LAND_DELAY=30.0)) == pytest.approx(LONGEST_S + 30.0, abs=0.1)
    # Along the mission: 3000 m more.
    assert time_of(windy(*OUT, RTL_TYPE=2.0)) == pytest.approx(LONGEST_S + 3000.0 / 9.0, abs=0.1)
    assert time_of(windy(*OUT, speed=15.0)) == math.inf


def test_a_landing_sequence_lengthens_the_return() -> None:
    """Its 500 m are flown after the way to its start, which is nearer than home."""
    sequence = (wp(0, 500), wp(0, 0, command=21))
    marked = time_of(windy(*OUT, "2 189 0 0 0 0 0 0 0", *sequence))
    assert marked - time_of(windy(*OUT, *sequence)) == pytest.approx(500.0 / 9.0, abs=0.1)


def test_the_remaining_time_is_by_the_higher_of_the_initial_and_the_level_current() -> None:
    setup = windy(*OUT)
    requirements, failsafe = route_requirements(setup), setup.autopilot.checks.return_time_failsafe
    assert failsafe is not None
    # 10 of 20 Ah at 100 A.
    energy = 10.0 * setup.envelope.volts
    assert remaining_battery_time(requirements, failsafe, energy, 1.0) == pytest.approx(360.0)
    level = 2.0 * setup.envelope.power(float(requirements.route.leg_airspeeds[0]), 400.0, 0.0) / setup.envelope.volts
    low = failsafe._replace(initial_current=0.0)
    assert remaining_battery_time(requirements, low, energy, 2.0) == pytest.approx(36_000.0 / level, rel=1e-6)
    limits = replace(setup.limits, envelope=replace(setup.envelope, volts=0.0))
    fuel = replace(setup, limits=limits)
    assert math.isnan(remaining_battery_time(route_requirements(fuel), failsafe, energy, 1.0))


@pytest.mark.parametrize(("share", "ok"), [(1.01, True), (0.99, None)])
def test_a_battery_that_lasts_longer_than_the_longest_return_leaves_nothing_open(share: float, ok: bool | None) -> None:
    """RTL_TIME_FACTOR is 1.1 and RTL_TIME_MARGIN 100 s by default."""
    setup = replace(windy(*OUT), battery=2000.0)
    energy = predicted_energy(route_requirements(setup))[0] * math.exp(1.645 * setup.envelope.power_sd)
    charge = (1.1 * LONGEST_S + 100.0) / 3600.0 * 100.0
    capacity = 1000.0 * (energy / setup.envelope.volts + share * charge)
    item = of(judge_geometry(replace(setup, autopilot=windy(*OUT, BAT1_CAPACITY=capacity).autopilot)), "energy")
    assert item.ok is ok
    assert ("COM_FLTT_LOW_ACT 3 may start a return before the mission ends" in item.reason) is (ok is None)
    assert ("COM_FLTT_LOW_ACT 0, or a larger battery (BAT1_CAPACITY), avoids it" in item.reason) is (ok is None)
