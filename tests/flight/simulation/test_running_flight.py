"""An aircraft in the air: where its route has it start, and how long it may take."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.guidance.gains import load_gains
from flight.mission.items import Mission
from flight.mission.return_path import ReturnCircle
from flight.simulation.running_flight import TIME_LIMIT_BASE_S, TIME_LIMIT_FACTOR, RunningFlight
from tests.logs.verdict.rules.test_loiter_rule_own_radius import SPEED, loiter, radius_at
from tests.mission_lines import setup_of, wp
from tests.setups import setup_maker
from world.errors import FlightError

AEROSONDE = load_aircraft("aerosonde")
MAKE = setup_maker(AEROSONDE)
NOTHING = Mission(None, ())


class Gliding(RunningFlight):
    """Nobody steers it."""

    def _fly_ticks(self, count: int) -> int:
        return 0


def airborne(points: object, **keywords: object) -> Gliding:
    setup = MAKE(points, **keywords)
    return Gliding(setup, AEROSONDE, load_gains(AEROSONDE))


def test_a_route_starts_at_its_first_waypoint_on_its_first_leg() -> None:
    points = [[0.0, 0.0, 500.0], [1000.0, 1000.0, 600.0]]
    setup = MAKE(points, wind=(6.0, 270.0))
    start = Gliding(setup, AEROSONDE, load_gains(AEROSONDE))._find_start(setup)
    assert (start.amsl, start.ground, start.airspeed) == (500.0, 100.0, 25.0)
    assert start.course == pytest.approx(math.pi / 4.0, abs=1e-6)
    assert start.slope == pytest.approx(math.atan2(100.0, math.hypot(1000.0, 1000.0)))
    # From the west: the air moves east.
    assert start.wind == pytest.approx((0.0, 6.0, 0.0), abs=1e-6)


def test_a_start_in_the_ground_is_refused() -> None:
    setup = MAKE([[0.0, 0.0, 150.0], [1000.0, 0.0, 200.0]])
    low = setup.route.positions - [0.0, 0.0, 51.0]
    setup = replace(setup, route=setup.route.with_fields(position=low))
    with pytest.raises(FlightError, match="start at 99 m AMSL: not above the terrain, which is at 100 m"):
        Gliding(setup, AEROSONDE, load_gains(AEROSONDE))._find_start(setup)


def test_a_flight_may_take_its_length_at_its_slowest_ground_speed_and_more() -> None:
    flight = airborne([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]], wind=(5.0, 0.0))
    seconds = TIME_LIMIT_FACTOR * 3000.0 / 20.0 + TIME_LIMIT_BASE_S
    assert flight.max_ticks == pytest.approx(seconds / flight.dt, abs=60)


def test_a_return_may_take_five_minutes_more_for_its_circles() -> None:
    setup = MAKE([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]])
    back = replace(setup, route=replace(setup.route, rtl_start=0, rtl_loiter=ReturnCircle(0.0, 3000.0, 500.0, 80.0)))
    plain, longer = (Gliding(one, AEROSONDE, load_gains(AEROSONDE)) for one in (setup, back))
    assert (longer.max_ticks - plain.max_ticks) * plain.dt == pytest.approx(300.0, abs=1.0)


def test_a_returns_circles_are_as_wide_as_its_height_makes_them() -> None:
    """3,000 m up they grow by the standard atmosphere's density, 1.225 / 0.9091 kg/m3, and take as much longer."""
    setup, gains = MAKE([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]]), load_gains(AEROSONDE)
    plain = Gliding(setup, AEROSONDE, gains).max_ticks
    low, high = (
        Gliding(replace(setup, route=replace(setup.route, rtl_start=0, rtl_loiter=circle)), AEROSONDE, gains).max_ticks
        for circle in (ReturnCircle(0.0, 3000.0, up, 2000.0) for up in (0.0, 3000.0))
    )
    assert (high - plain) / (low - plain) == pytest.approx(1.225 / 0.9091, rel=1e-3)


def test_turns_too_tight_for_the_bank_may_take_as_long_as_it_makes_them() -> None:
    """40 turns and one to line up, of 116 m by 30 degrees; 60 m, 63 m at 500 m, are drawn, and held by 60 degrees."""
    setup, gains = loiter("18 40 0 0 0", {"WP_LOITER_RAD": 60.0}), load_gains(AEROSONDE)
    steep = replace(setup, limits=replace(setup.limits, max_bank=math.radians(60.0)))
    wide, plain = (Gliding(one, AEROSONDE, gains) for one in (setup, steep))
    held, drawn = radius_at(30.0), 60.0 * (SPEED / 25.0) ** 2
    longer = TIME_LIMIT_FACTOR * 2.0 * math.pi * (40.0 * (held - drawn) + held) / 25.0
    assert (wide.max_ticks - plain.max_ticks) * plain.dt == pytest.approx(longer, rel=0.003)
    tangents = replace(setup, autopilot=MAKE([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]]).autopilot)
    assert Gliding(tangents, AEROSONDE, gains).max_ticks == pytest.approx(plain.max_ticks, rel=0.01)


def test_a_loiter_may_take_as_long_as_its_item_says() -> None:
    lines = wp(0, -1500), wp(0, 0, 100, 19, p="120 0 150 0"), wp(1500, 1500)
    setup = setup_of(*lines)
    waits, plain = (Gliding(one, AEROSONDE, load_gains(AEROSONDE)) for one in (setup, replace(setup, mission=NOTHING)))
    assert (waits.max_ticks - plain.max_ticks) * plain.dt == pytest.approx(120.0, abs=1.0)


def test_a_flight_that_still_circles_when_its_time_is_over_says_so() -> None:
    setup = setup_of(wp(0, -1500), wp(0, 0, 100, 18, p="3 0 150 0"), wp(1500, 1500))
    for leg, place in ((0, " in the loiter of item 2"), (setup.route.legs - 1, "")):
        flight = Gliding(setup, AEROSONDE, load_gains(AEROSONDE))
        flight._start_disturbances(setup)
        flight.max_ticks, flight.guidance_memory.leg = 0, leg
        assert flight.fly_block(10)[1] == f"time limit of 0 s reached{place}"


def test_a_block_ends_with_the_time() -> None:
    flight = airborne([[0.0, 0.0, 500.0], [0.0, 300.0, 500.0]])
    flight._start_disturbances(MAKE(np.array([[0.0, 0.0, 500.0], [0.0, 300.0, 500.0]])))
    flight.max_ticks = 0
    rows, ended = flight.fly_block(10)
    assert len(rows) == 0
    assert ended == "time limit of 0 s reached"
