"""A circle as wide as the aircraft needs, and two centimetres narrower; room for the circles at a mission's end."""

import math
from dataclasses import replace

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import of
from tests.logs.verdict.unsure_aircraft import with_guessed_bank
from tests.mission_lines import setup_of, wp
from tests.synthetic import bank_radius


@pytest.mark.parametrize(("short", "ok"), [(0.018, True), (0.022, False)])
def test_a_circle_may_be_two_centimetres_narrower_than_the_bank_limits(short: float, ok: bool) -> None:
    radius = bank_radius() - short
    setup = setup_of(wp(0, 0), wp(0, 2000, command=18, p=f"2 0 {radius:.6f} 0"), wp(0, 4000))
    item = of(judge_geometry(setup), "loiter")
    assert item.limit == pytest.approx(bank_radius(), abs=1e-4)
    assert item.ok is ok


@pytest.mark.parametrize(("short", "ok"), [(0.005, None), (0.022, False)])
def test_a_guessed_bank_limit_leaves_circles_open_that_60_degrees_hold(short: float, ok: bool | None) -> None:
    radius = bank_radius(bank_deg=60.0) - short
    setup = with_guessed_bank(setup_of(wp(0, 0), wp(0, 2000, command=18, p=f"2 0 {radius:.6f} 0"), wp(0, 4000)))
    verdict = judge_geometry(setup)
    item = of(verdict, "loiter")
    assert (item.ok, item.check) == (ok, "unknown aircraft" if ok is None else "")
    assert "and the aircraft's bank limit of 30° (a guess: state --bank) the aircraft needs 110 m" in item.reason
    if ok is None:
        assert verdict.undecided
        assert [change.what for one in item.suggestions for change in one] == ["stated bank"]
        assert "because its 30° is a guess: planfly aircraft --new ... --bank DEGREES" in item.suggestion
        assert "loiter at 1 waypoint is too close to the limit" in verdict.headline


@pytest.mark.parametrize(("limit_deg", "ok"), [(40.0, None), (30.0, False)])
def test_an_autopilot_that_banks_less_than_the_guess_decides(limit_deg: float, ok: bool | None) -> None:
    """A circle of 80 m takes 38.6 degrees at 25 m/s: more than 30, less than 40."""
    made = setup_of(wp(0, 0), wp(0, 2000, command=18, p="2 0 80 0"), wp(0, 4000))
    law = Px4(Px4Parameters.load(load_aircraft("aerosonde"))).with_parameters(FW_R_LIM=limit_deg)
    assert of(judge_geometry(replace(with_guessed_bank(made), autopilot=law)), "loiter").ok is ok


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
