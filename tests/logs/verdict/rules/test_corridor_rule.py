"""The corridor: how far from the legs a flight may get, on tracks moved aside by a known number of metres."""

import math

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import corridor_line
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import ROUTE, failing, judge, leg, of
from tests.synthetic import bank_radius, bump, edited, fly_path, make_setup, waypoint_stations

STRAIGHT = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]


def corner(turn_deg: float) -> list[list[float]]:
    """Two legs of 3 km with one right turn between them."""
    turn = math.radians(turn_deg)
    return [[0, 0, 300], [0, 3000, 300], [3000 * math.sin(turn), 3000 + 3000 * math.cos(turn), 300]]


@pytest.mark.parametrize(
    ("stated", "aside", "ok"),
    [
        (None, 29.9, True),
        (None, -29.9, True),
        (None, 30.1, False),
        (None, -30.1, False),
        (12.0, 11.9, True),
        (12.0, 12.1, False),
        (55.0, 54.9, True),
        (55.0, -55.1, False),
    ],
)
def test_half_width(stated: float | None, aside: float, ok: bool) -> None:
    setup = make_setup(STRAIGHT, limits={} if stated is None else {"corridor_m": stated})
    verdict = judge(setup, fly_path(setup, across=bump(4500.0, aside, 200.0)))
    item = of(verdict, "corridor", leg(1))
    assert (item.ok, item.limit, item.limit_source) == (ok, stated or 30.0, "scenario" if stated else "default")
    assert item.flown == pytest.approx(abs(aside), abs=0.01)
    assert item.margin == pytest.approx((stated or 30.0) - abs(aside), abs=0.01)
    assert of(verdict, "corridor", leg(0)).ok
    assert "north 4500 m" in item.reason


def test_a_track_beside_its_legs_all_along_is_as_far_off_everywhere() -> None:
    setup = make_setup(STRAIGHT)
    track = fly_path(setup)
    for aside, ok in ((29.9, True), (30.1, False)):
        verdict = judge(setup, edited(track, position=track.position + np.array([aside, 0.0, 0.0])))
        assert [of(verdict, "corridor", leg(k)).ok for k in range(2)] == [ok, ok]


def test_a_leg_that_comes_back_beside_it_is_no_part_of_a_legs_corridor() -> None:
    """600 m to the right of the first leg it is 400 m from the third, which goes back 1,000 m beside it."""
    setup = make_setup([[0, 0, 300], [0, 3000, 300], [1000, 3000, 300], [1000, 0, 300]])
    item = of(judge(setup, fly_path(setup, across=bump(1500.0, 600.0, 400.0))), "corridor", leg(0))
    assert item.ok is False
    assert item.flown == pytest.approx(600.0, abs=1.0)


@pytest.mark.parametrize(("stated", "ok"), [(32.4, True), (32.2, False)])
def test_turns_count_where_the_scenario_says_how_wide(stated: float, ok: bool) -> None:
    """The arc of a right angle passes R (1 - cos 45) = 32.33 m inside its legs at 25 m/s and 30 degrees of bank."""
    depth = bank_radius() * (1.0 - math.sqrt(0.5))
    assert depth == pytest.approx(32.33, abs=0.01)
    setup = make_setup(corner(90.0), limits={"corridor_m": stated})
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        item = of(verdict, "corridor", leg(0))
        assert item.ok is ok
        assert item.planned == pytest.approx(depth, abs=0.01)


def test_a_corridor_that_nobody_stated_has_room_for_the_turns() -> None:
    """A 120 degree corner leads R / 2 = 55.2 m inside, and 10 m more are its corridor: 20 m more along its bisector."""
    setup = make_setup(corner(120.0))
    middle = float(waypoint_stations(setup)[1])
    for aside, ok in ((19.2, True), (20.8, False)):
        verdict = judge(setup, fly_path(setup, across=bump(middle, aside, 40.0)))
        item = of(verdict, "corridor", leg(0))
        assert (item.ok, item.limit_source) == (ok, "fly-by path")
        assert item.limit == pytest.approx(bank_radius() / 2 + 10.0, abs=0.01)
        assert item.flown == pytest.approx(bank_radius() / 2 + aside / 2, abs=0.1)
    assert judge_geometry(setup).flyable


def test_a_turn_that_starts_at_its_waypoint_swings_out_by_its_own_arc() -> None:
    """Flown over, a corner of 60 degrees leads R (1 - cos 60) = R / 2 beyond the next leg."""
    setup = make_setup(corner(60.0), fly_over=(1,))
    assert of(judge_geometry(setup), "corridor", leg(1)).planned == pytest.approx(bank_radius() / 2, abs=0.01)


def test_the_line_on_the_corridor_states_where_it_is_wider() -> None:
    """Flown over, a corner of 60 degrees needs R / 2 + 10 m = 65.2 m, on both legs beside it; 30 m are the rest's."""
    points = [*corner(60.0), [6000 * math.sin(math.pi / 3), 3000 + 6000 * math.cos(math.pi / 3), 300]]
    setup = make_setup(points, fly_over=(1,))
    verdict = judge(setup, fly_path(setup))
    [line] = [one for one in verdict.lines if one.startswith("Corridor: ")]
    assert line == (
        "Corridor: 30 m to either side of the legs, planfly's default. Along 2 legs it is up to 65 m, because turns or"
        " loiters need more. To change it, set [limits] corridor_m"
    )
    straight = make_setup(STRAIGHT)
    assert "up to" not in corridor_line(straight, judge(straight, fly_path(straight)).findings)


def test_the_leg_that_is_flown_counts_not_one_that_happens_to_be_near() -> None:
    """A lawn mower with lines 100 m apart: 60 m off the first line is 40 m off the third."""
    points = [[0, 0, 300], [0, 3000, 300], [50, 3000, 300], [50, 2990, 300], [100, 2990, 300], [100, 0, 300]]
    setup = make_setup(points)
    straight = make_setup([points[0], points[1]])
    track = fly_path(straight, across=bump(1500.0, 60.0, 200.0))
    item = of(judge(setup, track), "corridor", leg(0))
    assert (item.ok, item.flown) == (False, pytest.approx(60.0, abs=0.1))


def test_a_leg_that_was_not_flown_is_not_judged(setup: FlightSetup) -> None:
    verdict = judge(setup, fly_path(setup, stop=3000.0))
    assert [of(verdict, "corridor", leg(k)).ok for k in range(4)] == [True, True, None, None]
    assert failing(judge(make_setup(ROUTE), fly_path(make_setup(ROUTE)))) == set()
