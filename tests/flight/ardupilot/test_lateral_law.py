"""ArduPlane's legs: when it turns to the next, how it closes in on them, its loiters and its bank, by plain sums."""

import math

import pytest

from aircraft.envelope import GRAVITY
from flight.ardupilot.lateral_law import navigate_legs, past_line, roll_demand, turn_distance
from tests.flight.ardupilot.laws import flying, memory, parameters, waypoints

RIGHT_ANGLE = math.pi / 2
# L1's length at 25 m/s with its defaults: period x damping x speed / pi.
LENGTH = 17.0 * 0.75 * 25.0 / math.pi


@pytest.mark.parametrize(
    ("acceptance", "turn", "factor", "expected"),
    [
        (0.0, RIGHT_ANGLE, 1.0, 90.0),  # WP_RADIUS at a right angle, and beyond
        (0.0, math.radians(120.0), 1.0, 90.0),
        (0.0, math.radians(30.0), 1.0, 30.0),  # a third of it at a third of a right angle
        (0.0, math.radians(30.0), 1.05, 30.0 * 1.05**2),  # with height, by true over equivalent airspeed squared
        (0.0, RIGHT_ANGLE, 1.2, LENGTH),  # 129.6 m: but no further than L1 looks
        (25.0, math.radians(30.0), 1.05, 25.0),  # a stated acceptance is taken as it is
        (25.9, math.radians(30.0), 1.0, 25.0),  # in whole metres
        (0.9, math.radians(30.0), 1.0, 30.0),  # which leaves nothing of less than one
        (300.0, math.radians(30.0), 1.0, 255.0),  # and no more than a byte
    ],
)
def test_turn_distance(acceptance: float, turn: float, factor: float, expected: float) -> None:
    assert turn_distance(acceptance, turn, 90.0, LENGTH, factor) == pytest.approx(expected)


@pytest.mark.parametrize(("north", "leg"), [(969.0, 0), (971.0, 1)])
def test_it_turns_within_its_distance_of_a_waypoint(north: float, leg: int) -> None:
    way = waypoints((0, 0, 500), (0, 1000, 500), (500, 1866, 500), turn=math.radians(30.0))
    own = memory()
    navigate_legs(flying(0.0, north), way, parameters(), own, 1.0, 0.1)
    assert own.leg == leg
    assert (own.from_north, own.from_up) == (1000.0 * leg, 500.0)


@pytest.mark.parametrize(("north", "leg"), [(989.0, 0), (991.0, 1)])
def test_it_turns_within_a_stated_acceptance(north: float, leg: int) -> None:
    way = waypoints((0, 0, 500), (0, 1000, 500), (1000, 1000, 500), turn=RIGHT_ANGLE, acceptance=10.0)
    own = memory()
    navigate_legs(flying(0.0, north), way, parameters(), own, 1.1, 0.1)
    assert own.leg == leg


def test_past_the_line_across_a_waypoint_the_leg_is_over() -> None:
    way = waypoints((0, 0, 500), (0, 1000, 500), (1000, 1000, 500), turn=RIGHT_ANGLE)
    assert past_line(flying(300.0, 1000.1), 0.0, 0.0, way[1])
    assert not past_line(flying(300.0, 999.9), 0.0, 0.0, way[1])
    for north, leg in ((999.9, 0), (1000.1, 1)):
        own = memory()
        navigate_legs(flying(300.0, north), way, parameters(), own, 1.0, 0.1)
        assert own.leg == leg


def test_beyond_a_greatest_radius_it_turns_back() -> None:
    way = waypoints((0, 0, 500), (0, 1000, 500), (1000, 1000, 500), turn=RIGHT_ANGLE)
    for radius, leg in ((301.0, 1), (299.0, 0)):
        own = memory()
        navigate_legs(flying(300.0, 1000.1), way, parameters(WP_MAX_RADIUS=radius), own, 1.0, 0.1)
        assert own.leg == leg


def test_a_leg_that_is_passed_when_it_begins_is_drawn_from_where_it_is() -> None:
    # The next leg goes back: from 50 m short of the corner its end is passed already.
    way = waypoints((0, 0, 500), (0, 1000, 500), (0, 980, 500), turn=math.pi)
    own = memory()
    navigate_legs(flying(0.0, 950.0, 498.0), way, parameters(), own, 1.0, 0.1)
    assert own.leg == 1
    assert (own.from_north, own.from_up) == (950.0, 498.0)


def test_its_side_acceleration_is_l1s() -> None:
    # 10 m right of its line: 4 damping^2 V^2 / L sin(asin(10 / L)) to the left.
    way = waypoints((0, 0, 500), (0, 5000, 500), (1000, 5000, 500))
    own = memory()
    navigate_legs(flying(10.0, 500.0), way, parameters(NAVL1_XTRACK_I=0.0), own, 1.0, 0.1)
    assert own.side_acceleration == pytest.approx(-4.0 * 0.75**2 * 25.0**2 / LENGTH * 10.0 / LENGTH)
    assert own.cross_track_sum == 0.0
    # Within five degrees its integral grows by gain x angle x time, and not beyond.
    for right, grows in ((8.0, True), (9.0, False)):
        own = memory()
        navigate_legs(flying(right, 500.0), way, parameters(), own, 1.0, 0.1)
        expected = 0.02 * math.asin(right / LENGTH) * 0.1
        assert own.cross_track_sum == pytest.approx(expected if grows else 0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_around_a_loiter_it_turns_with_its_radius(side: float) -> None:
    # On the circle, in its direction: V^2 / R towards the centre.
    way = waypoints((0, 0, 500), (0, 1000, 500), (100, 1100, 500), circle=side * 120.0, centre_east=side * 120.0)
    way["centre_north"] = 900.0
    own = memory()
    navigate_legs(flying(0.0, 900.0), way, parameters(), own, 1.0, 0.1)
    assert own.on_circle
    assert own.side_acceleration == pytest.approx(side * 25.0**2 / 120.0)


def test_far_from_a_loiter_it_flies_to_its_centre() -> None:
    way = waypoints((0, 0, 500), (0, 1000, 500), (100, 1100, 500), circle=120.0, centre_east=0.0, centre_north=1000.0)
    own = memory()
    navigate_legs(flying(0.0, 0.0), way, parameters(), own, 1.0, 0.1)
    assert not own.on_circle
    assert own.side_acceleration == pytest.approx(0.0)
    assert own.leg == 0


def test_bank_is_that_of_the_acceleration_within_the_limit() -> None:
    wide = parameters(ROLL_LIMIT_DEG=60.0, AIRSPEED_MIN=9.0)
    assert roll_demand(5.0, 0.0, 25.0, wide) == pytest.approx(math.atan(5.0 / GRAVITY))
    # Pitched up, the lift's share across is less.
    assert roll_demand(5.0, 0.3, 25.0, wide) == pytest.approx(math.atan(5.0 / (GRAVITY * math.cos(0.3))))
    limited = parameters(ROLL_LIMIT_DEG=30.0)
    for wanted, degrees in ((100.0, 30.0), (-100.0, -30.0)):
        assert math.degrees(roll_demand(wanted, 0.0, 25.0, limited)) == pytest.approx(degrees)


def test_slow_flight_narrows_the_bank() -> None:
    # At 1.2 times the least airspeed 1 / 1.2^2 of the lift must stay upright: 46 degrees; at 1.1, 34.3; at 1.0, 25.
    limits = parameters(ROLL_LIMIT_DEG=60.0, AIRSPEED_MIN=20.0)
    for airspeed, degrees in ((24.0, math.degrees(math.acos(1 / 1.44))), (22.0, 34.2654), (20.0, 25.0)):
        assert math.degrees(roll_demand(100.0, 0.0, airspeed, limits)) == pytest.approx(degrees, abs=1e-3)
