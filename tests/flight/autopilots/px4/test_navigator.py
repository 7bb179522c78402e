"""When PX4 turns to the next waypoint, the circle at one that is too high or too low, and heights along a leg."""

import math
from typing import Any

import numpy as np
import pytest

from flight.autopilots.px4.navigator import SWITCH_DELAY_S, acceptance_radius_at, foh_altitude, is_past_corner, navigate
from tests.flight.autopilots.px4.laws import flying, memory, parameters, waypoints
from world.kernels import Record
from world.scenario_tables import Px4Version

DT = 0.02
LEGS = ((0.0, 0.0, 500.0), (0.0, 1000.0, 500.0), (1000.0, 1000.0, 500.0))


def after(
    at: Record, own: Record | None = None, route: Any = LEGS, version: Px4Version = "1.16", **values: float
) -> Record:
    """The memory after the navigator has seen the aircraft at a place for longer than its delay."""
    own = memory() if own is None else own
    for _ in range(round(SWITCH_DELAY_S / DT) + 2):
        navigate(at, waypoints(*route), 0.0, 0.0, 25.0, parameters(version, **values), own, DT)
        if own.leg:
            break
    return own


@pytest.mark.parametrize(
    ("version", "values", "radius"),
    [
        ("1.16", {}, 56.0),
        ("1.16", {"NAV_ACC_RAD": 70.0}, 70.0),
        ("1.17", {}, 10.0),
        ("1.17", {"NAV_ACC_RAD": 70.0}, 70.0),
    ],
)
def test_a_waypoint_is_reached_within_its_radius(version: Px4Version, values: dict[str, float], radius: float) -> None:
    assert acceptance_radius_at(25.0, parameters(version, **values)) == pytest.approx(radius)
    assert after(flying(0.0, 1000.0 - radius - 0.1), version=version, **values).leg == 0
    assert after(flying(0.0, 1000.0 - radius + 0.1), version=version, **values).leg == 1


def test_an_items_own_radius_is_not_read() -> None:
    own, route = memory(), waypoints(*LEGS, acceptance=120.0)
    for _ in range(20):
        navigate(flying(0.0, 930.0), route, 0.0, 0.0, 25.0, parameters(), own, DT)
    assert own.leg == 0


def test_the_turn_comes_after_the_delay() -> None:
    own, route, made = memory(), waypoints(*LEGS), parameters()
    ticks = 0
    while not own.leg:
        navigate(flying(0.0, 950.0), route, 0.0, 0.0, 25.0, made, own, DT)
        ticks += 1
    assert SWITCH_DELAY_S < ticks * DT <= SWITCH_DELAY_S + 2.5 * DT


def test_past_the_plane_across_the_leg_it_is_reached_from_afar() -> None:
    assert after(flying(400.0, 999.0), version="1.17").leg == 0
    assert after(flying(400.0, 1001.0), version="1.17").leg == 1


@pytest.mark.parametrize(("up", "leg"), [(509.9, 1), (510.1, 0), (490.1, 1), (489.9, 0)])
def test_only_near_its_height_is_it_reached(up: float, leg: int) -> None:
    assert after(flying(0.0, 960.0, up)).leg == leg
    assert after(flying(0.0, 960.0, up), NAV_FW_ALT_RAD=20.0).leg == 1


def test_near_it_and_too_high_it_circles_and_further_away_it_does_not() -> None:
    near = after(flying(0.0, 945.0, 520.0))
    assert (near.leg, bool(near.is_loitering), near.altitude_setpoint) == (0, True, 500.0)
    assert not after(flying(0.0, 943.0, 520.0)).is_loitering
    assert not after(flying(0.0, 945.0, 509.0)).is_loitering
    # South of its middle, a circle to the right goes west, and one to the left east.
    assert after(flying(0.0, 990.0, 520.0), NAV_LOITER_RAD=80.0).lateral_acceleration < -5.0
    assert after(flying(0.0, 990.0, 520.0), NAV_LOITER_RAD=-80.0).lateral_acceleration > 5.0


def test_the_next_legs_line_goes_through_both_waypoints() -> None:
    own = after(flying(5.0, 960.0))
    assert (own.from_east, own.from_north, own.from_up, own.time_since_reached) == (0.0, 1000.0, 500.0, 0.0)
    assert own.min_distance_to_end == math.inf


def test_the_last_waypoint_is_not_left() -> None:
    assert after(flying(0.0, 999.0), route=LEGS[:2]).leg == 0


@pytest.mark.parametrize(
    ("nearest", "expected"),
    [(1000.0, 500.0), (1200.0, 500.0), (540.0, 550.0), (80.0, 600.0), (0.0, 600.0)],
)
def test_a_legs_slope_is_done_a_loiters_radius_before_its_end(nearest: float, expected: float) -> None:
    assert foh_altitude(0.0, 1000.0, 600.0, 80.0, memory(min_distance_to_end=nearest)) == pytest.approx(expected)


def test_a_leg_shorter_than_that_is_a_step() -> None:
    assert foh_altitude(0.0, 80.0, 600.0, 80.0, memory(min_distance_to_end=79.0)) == 600.0
    assert foh_altitude(0.0, 80.2, 600.0, 80.0, memory(min_distance_to_end=80.1)) == pytest.approx(550.0)


def test_the_slope_never_goes_back() -> None:
    own, route, made = memory(), waypoints((0.0, 0.0, 500.0), (0.0, 1000.0, 600.0), LEGS[2]), parameters()
    navigate(flying(0.0, 460.0, 540.0), route, 0.0, 0.0, 25.0, made, own, DT)
    assert own.altitude_setpoint == pytest.approx(550.0)
    navigate(flying(0.0, 300.0, 540.0), route, 0.0, 0.0, 25.0, made, own, DT)
    assert own.altitude_setpoint == pytest.approx(550.0)


def test_a_circle_at_the_gate_is_not_left_for_being_wider_than_the_switch_distance() -> None:
    own = after(flying(0.0, 945.0, 520.0), NAV_LOITER_RAD=150.0)
    assert own.is_loitering
    # 150 m off, which is more than 56 m; further away none is begun.
    assert after(flying(0.0, 850.0, 520.0), own, NAV_LOITER_RAD=150.0).is_loitering
    assert not after(flying(0.0, 850.0, 520.0), NAV_LOITER_RAD=150.0).is_loitering
    assert not after(flying(0.0, 850.0, 505.0), own, NAV_LOITER_RAD=150.0).is_loitering
    # Nor is it kept for the next waypoint.
    next_one = after(flying(0.0, 960.0, 505.0), after(flying(0.0, 945.0, 520.0)))
    assert (next_one.leg, bool(next_one.is_loitering)) == (1, False)


CIRCLE = {"loiter_radius": 100.0, "centre_east": 0.0, "centre_north": 1000.0, "stop": 1}


def to_a_loiter(**fields: Any) -> np.ndarray:
    """A leg of 1 km to a circle of 100 m at 600 m, drawn with two corners, and one of 1 km to the east after it."""
    made = waypoints((0.0, 0.0, 500.0), (-100.0, 1000.0, 600.0), (0.0, 1100.0, 600.0), (1000.0, 1000.0, 600.0))
    for name, value in (CIRCLE | fields).items():
        made[name][1:3] = value
    return made


def fly_on(at: Record, route: np.ndarray, own: Record, seconds: float, **values: float) -> None:
    """Have the navigator of 1.17 see the aircraft at a place for so long."""
    made = parameters("1.17", **values)
    for _ in range(round(seconds / DT)):
        navigate(at, route, 0.0, 0.0, 25.0, made, own, DT)


def test_a_loiter_of_turns_is_flown_until_its_corner_is_passed() -> None:
    route = waypoints((0.0, 0.0, 500.0), (100.0, 1000.0, 500.0), (1000.0, 1000.0, 500.0))
    route["loiter_radius"][1], route["centre_east"][1], route["centre_north"][1] = 100.0, 0.0, 1000.0
    own, made = memory(), parameters()
    # The corner is east of the middle; a circle to the right comes to it from the north.
    assert not is_past_corner(flying(70.0, 1070.0), route[1])
    navigate(flying(70.0, 1070.0), route, 0.0, 0.0, 25.0, made, own, DT)
    assert own.leg == 0
    navigate(flying(70.0, 930.0), route, 0.0, 0.0, 25.0, made, own, DT)
    assert (own.leg, bool(own.is_loitering), own.from_east) == (1, False, 70.0)


def test_a_loiter_is_flown_to_at_its_own_height_straight_at_its_middle() -> None:
    own = memory()
    fly_on(flying(300.0, 0.0), to_a_loiter(loiter_time=60.0), own, DT)
    assert own.altitude_setpoint == 600.0
    # The middle lies to the left of a course north from 300 m east of the leg.
    assert own.lateral_acceleration < -1.0
    own = memory()
    fly_on(flying(300.0, 0.0, course=math.atan2(-300.0, 1000.0)), to_a_loiter(loiter_time=60.0), own, DT)
    assert own.lateral_acceleration == pytest.approx(0.0, abs=1e-6)


def test_a_loiter_to_a_height_holds_that_of_its_legs_begin_until_its_rim() -> None:
    own, route = memory(), to_a_loiter(loiters_to_altitude=True, loiter_time=0.0)
    fly_on(flying(0.0, 889.0), route, own, 1.0)
    assert own.altitude_setpoint == 500.0
    # Within 10 m of a circle of 100 m, but not at the height that it holds.
    fly_on(flying(0.0, 891.0, 511.0), route, own, 1.0)
    assert own.altitude_setpoint == 500.0
    fly_on(flying(0.0, 891.0, 509.0), route, own, 2.5 * DT)
    assert own.altitude_setpoint == 600.0
    fly_on(flying(0.0, 891.0, 589.0), route, own, 1.0)
    assert own.leg == 0
    fly_on(flying(0.0, 891.0, 591.0), route, own, 1.0)
    assert (own.leg, bool(own.is_loitering), own.rim_reached, own.leg_start_altitude) == (2, False, False, 591.0)


def test_a_loiter_once_reached_counts_its_time_wherever_the_aircraft_is() -> None:
    own, route = memory(), to_a_loiter(loiter_time=60.0)
    fly_on(flying(0.0, 891.0, 589.0), route, own, 100.0)
    fly_on(flying(0.0, 885.0, 600.0), route, own, 100.0)
    assert (own.leg, own.time_since_reached) == (0, 0.0)
    fly_on(flying(0.0, 891.0, 600.0), route, own, 1.0)
    # What banks to 30 degrees flies a circle of 119 m: it never comes to the rim again.
    fly_on(flying(0.0, 881.0, 620.0), route, own, 58.5)
    assert own.leg == 0
    fly_on(flying(0.0, 881.0, 620.0), route, own, 1.0)
    # For the line from the middle, on the leg that leads to what comes after all of its corners.
    assert (own.leg, own.from_east, own.from_north, own.from_up) == (2, 0.0, 1000.0, 600.0)


def test_a_loiter_without_end_is_not_left() -> None:
    own = memory()
    fly_on(flying(0.0, 900.0, 600.0), to_a_loiter(loiter_time=math.inf), own, 200.0)
    assert own.leg == 0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_line_after_a_loiter_begins_on_its_rim_where_the_item_asks_for_it(side: float) -> None:
    own, route = memory(), to_a_loiter(loiter_time=0.0, exits_on_tangent=True, loiter_radius=100.0 * side)
    fly_on(flying(0.0, 900.0, 600.0), route, own, 1.0)
    # 1 km from the middle the tangent touches at cos^-1(0.1) from the way there: 10 m on it and 99.5 m beside it.
    assert (own.leg, own.from_east) == (2, pytest.approx(10.0))
    assert own.from_north == pytest.approx(1000.0 + side * 99.4987, abs=1e-3)


def test_a_loiter_is_left_on_the_course_to_what_follows_where_the_item_asks_for_it() -> None:
    route = to_a_loiter(loiter_time=0.0, exits_on_course=True)
    own = memory()
    # From above the middle the next waypoint lies 95.7 degrees east of north; the course is to be within 5 degrees.
    fly_on(flying(0.0, 1100.0, 600.0, course=math.radians(90.6)), route, own, 5.0)
    assert own.leg == 0
    fly_on(flying(0.0, 1100.0, 600.0, course=math.radians(90.8)), route, own, 5.0)
    assert own.leg == 2
    # Within 1.05 radii of the middle no course leads there.
    route["east"][3], own = 104.0, memory()
    fly_on(flying(0.0, 900.0, 600.0, course=math.pi), route, own, 1.0)
    assert own.leg == 2


def test_a_return_climbs_on_the_spot_flies_straight_and_comes_down_at_its_target() -> None:
    route = waypoints((0.0, 0.0, 500.0), (0.0, 5000.0, 600.0), is_rtl=True, loiter_radius=80.0, centre_north=5000.0)
    own, made = memory(), parameters()

    def seen(north: float, up: float) -> None:
        navigate(flying(0.0, north, up), route, 0.0, 0.0, 25.0, made, own, DT)

    seen(100.0, 500.0)
    assert (bool(own.is_in_rtl), bool(own.rtl_climb_complete), own.from_north, own.altitude_setpoint) == (
        True,
        False,
        100.0,
        600.0,
    )
    seen(150.0, 591.0)
    assert (bool(own.rtl_climb_complete), own.from_north) == (True, 150.0)
    seen(4000.0, 700.0)
    assert (own.altitude_setpoint, own.lateral_acceleration) == (600.0, pytest.approx(0.0, abs=1e-9))
    own = memory()
    seen(100.0, 800.0)
    assert own.rtl_climb_complete
    seen(4000.0, 800.0)
    assert own.altitude_setpoint == 800.0
    seen(4900.0, 800.0)
    assert own.altitude_setpoint == 600.0


@pytest.mark.parametrize(("loiters", "returns"), [(150.0, 60.0), (60.0, 150.0)])
def test_a_return_climbs_with_the_radius_of_loiters(loiters: float, returns: float) -> None:
    route = waypoints((0.0, 0.0, 500.0), (0.0, 5000.0, 600.0), is_rtl=True, loiter_radius=returns, centre_north=5000.0)
    made = parameters("1.17", NAV_LOITER_RAD=loiters, RTL_LOITER_RAD=returns)
    own = memory(is_in_rtl=True, from_up=500.0)
    # Around the place where it began, to the right: on the circle's east it flies south, with V^2 / r to the west.
    navigate(flying(loiters, 0.0, 500.0, course=math.pi), route, 0.0, 0.0, 25.0, made, own, DT)
    assert own.lateral_acceleration == pytest.approx(25.0**2 / loiters, rel=1e-6)


def test_a_return_is_flown_straight_to_its_target_from_wherever_its_climb_ends() -> None:
    """`RtlDirect::set_rtl_item` flies a loiter from the start: there is no line to come back to."""
    route = waypoints((0.0, 0.0, 500.0), (0.0, 5000.0, 500.0), is_rtl=True, loiter_radius=80.0, centre_north=5000.0)
    own, made = memory(), parameters()
    navigate(flying(0.0, 0.0, 600.0), route, 0.0, 0.0, 25.0, made, own, DT)
    assert own.rtl_climb_complete
    # 300 m beside the line from where it began.
    course = math.atan2(-300.0, 4000.0)
    navigate(flying(300.0, 1000.0, 600.0, course=course), route, 0.0, 0.0, 25.0, made, own, DT)
    assert own.lateral_acceleration == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("up", "fields", "leg", "loiters"),
    [
        (505.1, {}, 1, False),
        # NAV_FW_ALTL_RAD, 5 m, before a landing; a circle is still begun at NAV_FW_ALT_RAD, 10 m, only.
        (505.1, {"precedes_landing": True}, 0, False),
        (504.9, {"precedes_landing": True}, 1, False),
        (510.1, {"precedes_landing": True}, 0, True),
        # A waypoint of a mission's landing is accepted at any height, and never circled.
        (560.0, {"ignores_altitude": True}, 1, False),
        (560.0, {"ignores_altitude": True, "precedes_landing": True}, 1, False),
    ],
)
def test_before_a_landing_a_waypoint_is_accepted_at_other_heights(
    up: float, fields: dict[str, bool], leg: int, loiters: bool
) -> None:
    """`Navigator::get_altitude_acceptance_radius`, `Mission::setActiveMissionItems`, `handle_setpoint_type`."""
    own, route = memory(), waypoints(*LEGS, **fields)
    for _ in range(round(SWITCH_DELAY_S / DT) + 2):
        navigate(flying(0.0, 991.0, up), route, 0.0, 0.0, 25.0, parameters("1.17"), own, DT)
        if own.leg:
            break
    assert (own.leg, bool(own.is_loitering)) == (leg, loiters)


@pytest.mark.parametrize(("up", "leg"), [(605.1, 0), (604.9, 2)])
def test_a_loiter_before_a_landing_is_left_within_the_tighter_height(up: float, leg: int) -> None:
    own, route = memory(rim_reached=True), to_a_loiter(loiters_to_altitude=True, loiter_time=0.0, precedes_landing=True)
    fly_on(flying(0.0, 891.0, up), route, own, 1.0)
    assert own.leg == leg
