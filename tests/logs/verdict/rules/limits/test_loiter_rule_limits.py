"""A circle as wide as the aircraft needs, and two centimetres narrower; room for the circles at a mission's end."""

import math
from dataclasses import replace

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import of
from tests.mission_lines import setup_of, wp
from tests.synthetic import bank_radius


@pytest.mark.parametrize(("short", "ok"), [(0.018, True), (0.022, False)])
def test_a_circle_may_be_two_centimetres_narrower_than_the_bank_limits(short: float, ok: bool) -> None:
    radius = bank_radius() - short
    setup = setup_of(wp(0, 0), wp(0, 2000, command=18, p=f"2 0 {radius:.6f} 0"), wp(0, 4000))
    item = of(judge_geometry(setup), "loiter")
    assert item.limit == pytest.approx(bank_radius(), abs=1e-4)
    assert item.ok is ok


@pytest.mark.parametrize(("room", "ok"), [(1.0, True), (-1.0, None)])
def test_circles_at_the_end_have_their_room_of_the_area(room: float, ok: bool | None) -> None:
    # 25 m/s of equivalent airspeed at 400 m of the standard atmosphere, and 2.25 radii of a bank of 30 degrees.
    speed = 25.0 / math.sqrt((1.0 - 0.0065 * 400.0 / 288.15) ** 4.2559)
    reach = 2.25 * speed**2 / (9.80665 * math.tan(math.radians(30.0)))
    made = setup_of(wp(0, 0), wp(6000.0 - reach - room, 0))
    law = Px4(Px4Parameters.load(load_aircraft("aerosonde")))
    setup = replace(made, scenario=replace(made.scenario, external=False), autopilot=law)
    verdict = judge_geometry(setup)
    item = of(verdict, "loiter")
    assert (item.ok, "the area's edge is in reach" in item.reason) == (ok, ok is None)
    assert f"up to {reach:.0f} m from this waypoint" in item.reason
    assert bool(verdict.unjudged) is (ok is None)
