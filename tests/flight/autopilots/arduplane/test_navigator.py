"""ArduPlane's legs: when it turns to the next, how it closes in on them, and its loiters, by plain sums and flights."""

import math
from typing import Any

import numpy as np
import pytest

from flight.autopilots.arduplane.navigator import (
    _is_heading_lined_up,
    is_past_finish_line,
    keep_turn_side,
    navigate_legs,
    turn_distance,
)
from tests.flight.autopilots.arduplane.laws import flying, memory, parameters, waypoints

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


@pytest.mark.parametrize(
    ("acceptance", "north", "leg"),
    [
        (0.0, 1149.0, 0),  # no turn distance: to the line across the point 150 m beyond the waypoint
        (0.0, 1151.0, 1),
        (0.9, 1149.0, 0),  # less than a metre is none
        (20.0, 1129.0, 0),  # a stated acceptance applies to that point
        (20.0, 1131.0, 1),
    ],
)
def test_it_flies_on_beyond_a_waypoint_by_its_pass_by_distance(acceptance: float, north: float, leg: int) -> None:
    """`Plane::verify_nav_wp` moves the waypoint on along the leg, and the next leg still begins at the waypoint."""
    way = waypoints((0, 0, 500), (0, 1000, 500), (1000, 1000, 500), turn=RIGHT_ANGLE, acceptance=acceptance)
    way["pass_by"] = 150.0
    own = memory()
    navigate_legs(flying(0.0, north), way, parameters(), own, 1.0, 0.1)
    assert (own.leg, own.from_north) == (leg, 1000.0 * leg)


def test_a_pass_by_beyond_the_greatest_radius_is_flown_on_along_the_leg() -> None:
    # WP_MAX_RADIUS applies to the waypoint: 160 m beyond it the leg goes on, and its line stays.
    way = waypoints((0, 0, 500), (0, 1000, 500), (1000, 1000, 500), turn=RIGHT_ANGLE, pass_by=150.0)
    own = memory()
    navigate_legs(flying(0.0, 1160.0), way, parameters(WP_MAX_RADIUS=100.0), own, 1.0, 0.1)
    assert (own.leg, own.from_north) == (0, 0.0)


def test_past_the_line_across_a_waypoint_the_leg_is_over() -> None:
    way = waypoints((0, 0, 500), (0, 1000, 500), (1000, 1000, 500), turn=RIGHT_ANGLE)
    assert is_past_finish_line(flying(300.0, 1000.1), 0.0, 0.0, 0.0, 1000.0)
    assert not is_past_finish_line(flying(300.0, 999.9), 0.0, 0.0, 0.0, 1000.0)
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


@pytest.mark.parametrize(
    ("east", "north", "reached", "leg"),
    [
        # Flying north: the bearing between identical positions is east, so that the first is passed 90 m before it.
        (0.0, 1000.0, (0.0, 909.0), 0),
        (0.0, 1000.0, (0.0, 911.0), 1),
        # Flying east: no turn, so that the first is passed at the line across it, and the second at once behind it.
        (1000.0, 0.0, (999.0, 0.0), 0),
        (1000.0, 0.0, (1002.0, 0.0), 2),
    ],
)
def test_a_repeated_position_is_passed_without_turning_back(
    east: float, north: float, reached: tuple[float, float], leg: int
) -> None:
    """`Plane::set_next_WP` draws a leg without length from the aircraft; `setup_turn_angle` then measures its turn."""
    way = waypoints((0, 0, 500), (east, north, 500), (east + 0.01, north, 540), (2 * east, 2 * north, 540))
    own = memory()
    for _ in range(2):
        navigate_legs(flying(*reached), way, parameters(), own, 1.0, 0.1)
    assert own.leg == leg


def test_its_side_acceleration_is_l1s() -> None:
    # 10 m right of its line: 4 damping^2 V^2 / L sin(asin(10 / L)) to the left.
    way = waypoints((0, 0, 500), (0, 5000, 500), (1000, 5000, 500))
    own = memory()
    navigate_legs(flying(10.0, 500.0), way, parameters(NAVL1_XTRACK_I=0.0), own, 1.0, 0.1)
    assert own.lateral_acceleration == pytest.approx(-4.0 * 0.75**2 * 25.0**2 / LENGTH * 10.0 / LENGTH)
    assert own.cross_track_integrator == 0.0
    # Within five degrees its integral grows by gain x angle x time, and not beyond.
    for right, grows in ((8.0, True), (9.0, False)):
        own = memory()
        navigate_legs(flying(right, 500.0), way, parameters(), own, 1.0, 0.1)
        expected = 0.02 * math.asin(right / LENGTH) * 0.1
        assert own.cross_track_integrator == pytest.approx(expected if grows else 0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_around_a_loiter_it_turns_with_its_radius(side: float) -> None:
    # On the circle, in its direction: V^2 / R towards the centre.
    way = waypoints((0, 0, 500), (0, 1000, 500), (100, 1100, 500), loiter_radius=side * 120.0, centre_east=side * 120.0)
    way["centre_north"], way["up"] = 900.0, 0.0
    own = memory()
    navigate_legs(flying(0.0, 900.0), way, parameters(), own, 1.0, 0.1)
    assert own.reached_loiter_target
    assert own.lateral_acceleration == pytest.approx(side * 25.0**2 / 120.0)


def test_a_circle_that_was_reached_stays_reached_outside_it() -> None:
    """`AP_L1_Control::update_loiter` since 4.6.0: a gust or a radius that cannot be flown does not end it."""
    way = circle_route()
    # 300 m outside, flying outwards: the center is aimed at.
    seen = flying(0.0, -500.0, 0.0, math.pi)
    for reached in (True, False):
        own = memory(from_north=-5000.0, loiter_started=True, reached_loiter_target=reached)
        navigate_legs(seen, way, parameters(), own, 1.0, 0.1)
        assert bool(own.reached_loiter_target) == reached


def test_far_from_a_loiter_it_flies_to_its_centre() -> None:
    way = waypoints(
        (0, 0, 500), (0, 1000, 500), (100, 1100, 500), loiter_radius=120.0, centre_east=0.0, centre_north=1000.0
    )
    own = memory()
    navigate_legs(flying(0.0, 0.0), way, parameters(), own, 1.0, 0.1)
    assert not own.reached_loiter_target
    assert own.lateral_acceleration == pytest.approx(0.0)
    assert own.leg == 0


# A circle of 200 m about the origin, left for a place 5 km north of it.
CIRCLE = {"loiter_radius": 200.0, "stop": 1, "loiter_time": math.nan, "loiter_turns": 1.0}


def circle_route(**fields: Any) -> np.ndarray:
    """From 5 km south to a loiter at sea level, and on."""
    way = waypoints((0, -5000, 0), (0, 200, 0), (0, 5000, 0))
    way["stop"] = (0, 1, 2)
    for name, value in (CIRCLE | fields).items():
        way[name][1] = value
    return way


def go_around(way: np.ndarray, seconds: float, **how: float) -> tuple[Any, float | None]:
    """The memory, and how far around (degrees from the south, to the right) it left the circle at 25 m/s; None: not.

    how: the height (up), and how far the course always is off that to what follows (off, rad), not along the circle.
    """
    own = memory(from_north=-5000.0)
    step, angle = 25.0 / 200.0 * 0.1, 0.0
    for _ in range(round(seconds / 0.1)):
        east, north = -199.9 * math.sin(angle), -199.9 * math.cos(angle)
        course = math.atan2(-east, 5000.0 - north) + how["off"] if "off" in how else angle - RIGHT_ANGLE
        seen = flying(east, north, how.get("up", 0.0), course)
        navigate_legs(seen, way, parameters(), own, 1.0, 0.1)
        if own.leg:
            return own, math.degrees(angle)
        angle += step
    return own, None


def test_the_line_to_a_loiters_middle_is_followed_to_three_of_its_radii() -> None:
    for away, follows in ((601.0, True), (599.0, False)):
        own = memory(from_north=-5000.0)
        navigate_legs(flying(30.0, -away), circle_route(), parameters(NAVL1_XTRACK_I=0.0), own, 1.0, 0.1)
        # To the line as from any leg; or to the middle, from where the course leads 30 m beside it.
        angle = math.asin(30.0 / LENGTH) if follows else math.atan2(30.0, away)
        assert own.lateral_acceleration == pytest.approx(-4.0 * 0.75**2 * 25.0**2 / LENGTH * math.sin(angle), rel=1e-3)


@pytest.mark.parametrize("turns", [1.0, 2.0])
def test_a_loiter_is_left_after_its_turns_where_what_follows_lies_ahead(turns: float) -> None:
    own, left = go_around(circle_route(loiter_turns=turns), 300.0)
    # The tangent to 5 km north is 90 degrees from the south but for asin(200 / 5000); 10 degrees before it will do.
    tangent = 90.0 + math.degrees(math.asin(200.0 / 5000.0))
    assert left == pytest.approx(360.0 * turns + tangent - 10.0, abs=1.0)
    # The next leg's line begins in the middle.
    assert (own.leg, own.from_east, own.from_north, own.from_up) == (1, 0.0, 0.0, 0.0)


def test_a_loiter_is_left_after_its_time() -> None:
    # A circle takes 50.3 s: after 60 s it has gone around 1.19 times, and heads north 0.04 of a circle later.
    for seconds, circles in ((60.0, 1), (70.0, 2)):
        _, left = go_around(circle_route(loiter_turns=0.0, loiter_time=seconds), 300.0)
        assert left == pytest.approx(360.0 * circles + 82.3, abs=1.0)
    assert go_around(circle_route(loiter_turns=0.0, loiter_time=math.inf), 300.0)[1] is None


@pytest.mark.parametrize(("up", "circles"), [(-4.9, 0), (-5.1, 3)])
def test_a_loiter_to_a_height_is_left_at_it_or_where_that_stays_out_of_reach(up: float, circles: int) -> None:
    way = circle_route(loiter_turns=0.0, loiter_time=0.0, loiters_to_altitude=True)
    _, left = go_around(way, 300.0, up=up)
    assert left == pytest.approx(360.0 * circles + 82.3, abs=1.0)


def is_lined_up(
    place: float, target: tuple[float, float], *, side: float = 1.0, laps: int = 0, away: float = 200.0, to: float = 0.0
) -> bool:
    """Return the answer on a circle of 200 m about the origin, at a bearing (degrees) and distance from its center.

    to: exit bearing, rad.
    """
    way = circle_route(loiter_radius=side * 200.0, exit_bearing=to)
    way["east"][2], way["north"][2] = target
    angle = math.radians(place)
    # The course does not count: it is always 100 degrees off.
    here = flying(away * math.sin(angle), away * math.cos(angle), 0.0, angle + 100.0)
    own = memory(exit_wait_angle=2.0 * math.pi * laps)
    return bool(_is_heading_lined_up(here, way[2], way[1], 200.0, own))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("away", [150.0, 200.0, 300.0])
def test_a_loiter_is_left_where_its_tangent_leads_to_what_follows(side: float, away: float) -> None:
    """`ModeLoiter::isHeadingLinedUp` since 4.6.0: within 10 degrees, 10 more for each circle, wherever it is off it."""
    # 2 km north: from the circle's point at a bearing the target is seen at a bearing, and the tangent leads at 90
    # degrees to the first.  Where both agree, the point is at acos(200 / 2000) from the target.
    tangent_place = -side * math.degrees(math.acos(200.0 / 2000.0))
    for degrees, laps, expected in (
        (0.0, 0, True),
        (8.0, 0, True),
        (12.0, 0, False),
        (-12.0, 0, False),
        (12.0, 1, True),
        (-22.0, 1, False),
        (-22.0, 2, True),
    ):
        place = math.radians(tangent_place + degrees)
        seen = math.atan2(-200.0 * math.sin(place), 2000.0 - 200.0 * math.cos(place))
        error = math.degrees(abs((seen - place - side * RIGHT_ANGLE + math.pi) % (2.0 * math.pi) - math.pi))
        assert (error <= 10.0 + 10.0 * laps) == expected, "the arithmetic of the case"
        assert is_lined_up(math.degrees(place), (0.0, 2000.0), side=side, laps=laps, away=away) == expected


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("north", "segment"), [(200.0, 0.0), (100.0, 28.955), (0.1, 59.97)])
def test_for_a_target_within_the_circle_it_leaves_at_the_tangent_next_to_it(
    side: float, north: float, segment: float
) -> None:
    """`ModeLoiter::isHeadingLinedUp`: ahead of the target by twice asin((r - d) / 2 r), at most 60 degrees."""
    for off, expected in ((0.0, True), (9.0, True), (-9.0, True), (11.0, False), (-11.0, False)):
        assert is_lined_up(-side * segment + off, (0.0, north - 1e-6), side=side) == expected
    # An item at the same place, as after a jump back, has no bearing.
    for place in (0.0, 120.0, 240.0):
        assert is_lined_up(place, (0.0, 1e-9), side=side)


def test_before_a_return_a_loiter_is_left_towards_0_north_0_east() -> None:
    """The return's item has no position (`Plane::verify_loiter_heading`): its bearing counts, wherever home is."""
    for place, expected in ((90.0, True), (99.0, True), (101.0, False), (-90.0, False)):
        assert is_lined_up(place, (0.0, 1000.0), to=math.pi) == expected


@pytest.mark.parametrize(
    ("last", "angle", "target_north", "kept"),
    [
        (170.0, -175.0, -1000.0, 170.0),  # straight behind, and the side would change
        (170.0, 175.0, -1000.0, 175.0),
        (160.0, -175.0, -1000.0, -175.0),  # 162 degrees: only while both are beyond
        (170.0, -160.0, -1000.0, -160.0),
        (170.0, -175.0, 1000.0, -175.0),  # the target is not behind
        (0.0, -175.0, -1000.0, -175.0),
    ],
)
def test_a_turn_by_almost_180_degrees_keeps_its_side(
    last: float, angle: float, target_north: float, kept: float
) -> None:
    """`AP_L1_Control::_prevent_indecision`."""
    own = memory(l1_angle=math.radians(last))
    for _ in range(2):
        found = keep_turn_side(flying(), math.radians(angle), 0.0, target_north, own)
        assert math.degrees(found) == pytest.approx(kept)
        assert math.degrees(own.l1_angle) == pytest.approx(kept)


def test_a_return_straight_behind_turns_to_the_side_that_it_has_begun_to() -> None:
    """A roll that lags may carry the course across 180 degrees: the demanded side remains."""
    way = waypoints((0, 0, 500), (0, 1000, 500), (0, -5000, 500))
    way["is_rtl"][1:], way["loiter_radius"][1:], way["centre_north"][1:] = True, 60.0, -5000.0
    own = memory()
    for course in (-0.05, 0.05):
        navigate_legs(flying(0.0, 1000.0, course=course), way, parameters(), own, 1.0, 0.1)
        assert own.lateral_acceleration < 0.0


def test_the_next_legs_line_begins_where_the_loiter_is_left_if_its_item_asks_for_that() -> None:
    own, left = go_around(circle_route(exits_on_tangent=True), 300.0)
    assert left is not None
    assert math.hypot(own.from_east, own.from_north) == pytest.approx(199.9)


def test_above_its_height_a_circle_is_wider() -> None:
    # 1.1 times the equivalent airspeed: 1.21 times the radius, which is held with that circle's acceleration.
    own = memory(from_north=-5000.0)
    way = circle_route()
    way["up"] = 0.0
    navigate_legs(flying(-242.0, 0.0), way, parameters(), own, 1.1, 0.1)
    assert own.reached_loiter_target
    assert own.lateral_acceleration == pytest.approx(25.0**2 / 242.0)


def test_beside_a_loiter_the_turn_is_that_from_or_to_its_middle() -> None:
    """A right angle to the middle, though the route goes on by the tangent with half of that: it turns 90 m before."""
    for north, leg in ((-1091.0, 0), (-1089.0, 1)):
        way = waypoints((0, -3000, 500), (0, -1000, 500), (200, -800, 500), (5000, -1000, 500), turn=RIGHT_ANGLE / 2)
        way["loiter_radius"][2], way["centre_east"][2], way["centre_north"][2], way["stop"] = (
            200.0,
            900.0,
            -1000.0,
            range(4),
        )
        own = memory(from_north=-3000.0)
        navigate_legs(flying(0.0, north), way, parameters(), own, 1.0, 0.1)
        assert own.leg == leg


@pytest.mark.parametrize(("up", "joins"), [(490.1, True), (489.9, False), (509.9, True), (510.1, False)])
def test_a_return_goes_on_to_the_landing_sequence_within_10_m_of_its_circles_height(up: float, joins: bool) -> None:
    """On its circle; the leg to the sequence's first place begins where it is."""
    way = waypoints((0, 0, 500), (0, 900, 500), (60, 1000, 500), (3000, 2000, 400), (3000, 3000, 400))
    back = way[1:3]
    back["is_rtl"], back["loiter_radius"], back["centre_east"], back["centre_north"] = True, 120.0, 120.0, 900.0
    own = memory()
    navigate_legs(flying(0.0, 900.0, up), way, parameters(), own, 1.0, 0.1)
    assert (own.leg, bool(own.is_in_rtl)) == ((2, False) if joins else (0, True))
    if joins:
        assert (own.from_east, own.from_north, own.from_up) == (0.0, 900.0, up)
    # Not yet on it, or with nothing behind it, it goes on returning.
    for north, route in ((-2000.0, way), (900.0, way[:3])):
        own = memory()
        navigate_legs(flying(0.0, north, up), route, parameters(), own, 1.0, 0.1)
        assert own.leg == 0
