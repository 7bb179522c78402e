"""NPFG by plain sums: course and side acceleration beside a leg and around a circle, in still air and in wind."""

import math

import pytest

from flight.autopilots.px4.lateral import (
    adapted_period,
    bearing_feasibility,
    follow_leg,
    follow_loiter,
    reference_air_velocity,
    roll_setpoint,
    switch_distance,
)
from tests.flight.autopilots.px4.laws import flying, memory, parameters
from world.scenario_tables import Px4Version

# 4 pi damping / period, and NPFG_PERIOD x NPFG_DAMPING at 25 m/s.
GAIN, BOUND = 4.0 * math.pi * 0.7 / 10.0, 175.0


def beside(east: float, course: float = 0.0, version: Px4Version = "1.16", **values: float) -> float:
    """Side acceleration at an offset east of a leg north, far from its ends."""
    own = memory()
    follow_leg(flying(east, 1000.0, course=course), 0.0, 5000.0, 0.0, 0.0, 25.0, parameters(version, **values), own)
    return float(own.lateral_acceleration)


@pytest.mark.parametrize("east", [0.0, 40.0, 100.0, 174.0, 176.0, 900.0, -40.0, -900.0])
def test_it_closes_in_by_the_square_of_what_is_left_of_the_bound(east: float) -> None:
    look = 0.5 * math.pi * (1.0 - min(1.0, abs(east) / BOUND)) ** 2
    # The course that is flown is the complement of the look-ahead angle, towards the leg.
    turn = -math.copysign(0.5 * math.pi - look, east) if east else 0.0
    assert beside(east) == pytest.approx(GAIN * 25.0 * math.sin(turn), abs=1e-9)


def test_beyond_a_right_angle_it_turns_as_hard_as_at_one() -> None:
    assert beside(0.0, math.radians(100.0)) == pytest.approx(-GAIN * 25.0)
    assert beside(0.0, math.radians(89.9)) == pytest.approx(-GAIN * 25.0, rel=1e-4)
    assert beside(0.0, math.radians(30.0)) == pytest.approx(-GAIN * 25.0 * 0.5)


def test_the_period_counts_in_1_16_and_the_gain_is_fixed_in_1_17() -> None:
    turned = math.radians(30.0)
    assert beside(0.0, turned, NPFG_PERIOD=20.0) == pytest.approx(-0.5 * GAIN * 25.0 * 0.5)
    for period in (10.0, 20.0):
        assert beside(0.0, turned, "1.17", NPFG_PERIOD=period) == pytest.approx(-0.8885 * 25.0 * 0.5)


def test_a_period_too_short_for_the_roll_is_lengthened_unless_that_is_off() -> None:
    # pi x 0.5 s / 0.7, by the safety factor 1.5: 3.37 s.
    least = math.pi * 0.5 / 0.7 * 1.5
    for wanted, on, period in ((2.0, 1.0, least), (2.0, 0.0, 2.0), (5.0, 1.0, 5.0)):
        made = parameters(NPFG_PERIOD=wanted, NPFG_LB_PERIOD=on)
        assert switch_distance(25.0, made) == pytest.approx(0.32 * 25.0 * period * 0.7)


@pytest.mark.parametrize(
    ("speed", "expected"), [(25.0, 56.0), (33.0, 73.92), (1.0, 0.32 * 7.0), (0.5, 0.32 * 3.5 * 1.25), (900.0, 500.0)]
)
def test_the_switch_distance_goes_with_the_ground_speed(speed: float, expected: float) -> None:
    assert switch_distance(speed, parameters()) == pytest.approx(expected)


def test_before_the_leg_it_flies_to_its_begin_and_past_it_back_to_its_end() -> None:
    def side(east: float, north: float, course: float) -> float:
        own = memory()
        follow_leg(flying(east, north, course=course), 0.0, 1000.0, 0.0, 0.0, 25.0, parameters(), own)
        return float(own.lateral_acceleration)

    # 60 m before the begin (more than 56 m away) and 60 m right of the line: the begin bears 45 degrees left of north.
    assert side(60.0, -60.0, -math.radians(45.0)) == pytest.approx(0.0, abs=1e-9)
    assert side(30.0, -30.0, -math.radians(45.0)) != pytest.approx(0.0, abs=0.1)
    assert side(0.0, 1100.0, 0.0) == pytest.approx(GAIN * 25.0 * math.copysign(1.0, side(0.0, 1100.0, 0.0)))
    assert side(100.0, 1100.0, -math.radians(135.0)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("radius", [200.0, -200.0])
def test_on_a_circle_it_demands_what_the_circle_takes(radius: float) -> None:
    own = memory()
    # North of the middle, eastwards around it to the right.
    course = math.copysign(0.5 * math.pi, radius)
    follow_loiter(flying(0.0, 200.0, course=course), 0.0, 0.0, radius, 0.0, 0.0, 25.0, parameters(), own)
    assert own.lateral_acceleration == pytest.approx(math.copysign(25.0 * 25.0 / 200.0, radius))


def test_far_from_a_circle_it_flies_at_its_middle() -> None:
    own = memory()
    follow_loiter(flying(0.0, -900.0), 0.0, 0.0, 80.0, 0.0, 0.0, 25.0, parameters(), own)
    assert own.lateral_acceleration == pytest.approx(0.0, abs=1e-9)


def test_the_heading_holds_the_course_in_wind() -> None:
    # 7 m/s from the west on a course north at 25 m/s: sqrt(25^2 - 7^2) = 24 m/s of the air velocity is northwards.
    assert reference_air_velocity(0.0, 1.0, 7.0, 0.0, 25.0) == pytest.approx((-7.0, 24.0))
    # 30 m/s from ahead cannot be flown against: straight into it.
    east, north = reference_air_velocity(0.0, 1.0, 0.0, -30.0, 25.0)
    assert (east, north) == pytest.approx((0.0, 25.0))


@pytest.mark.parametrize(
    ("across", "along", "expected"),
    [(0.0, 20.0, 1.0), (23.5, 1.0, 1.0), (25.0, 1.0, 0.0), (24.25, 1.0, 0.5), (0.0, -24.25, 0.5), (18.0, -24.0, 0.0)],
)
def test_a_course_can_be_flown_with_airspeed_to_spare(across: float, along: float, expected: float) -> None:
    assert bearing_feasibility(25.0, across, along) == pytest.approx(expected)


def test_a_slow_ground_speed_raises_the_airspeed() -> None:
    own = memory()
    # Against 22 m/s at 25 m/s of airspeed: 3 m/s over the ground, where 5 are wanted.
    follow_leg(flying(speed=3.0), 0.0, 5000.0, 0.0, -22.0, 25.0, parameters(), own)
    assert own.min_airspeed == pytest.approx(27.0)
    follow_leg(flying(speed=6.0), 0.0, 5000.0, 0.0, -19.0, 25.0, parameters(), own)
    assert own.min_airspeed == 0.0


def test_in_wind_a_curve_shortens_the_period_and_a_straight_leg_does_not() -> None:
    made = parameters()
    assert adapted_period(25.0, 8.0, 0.0, 1.0, 1.0, made) == 10.0
    # wf = 2 (1 - sqrt(1 - 8 / 25)), r = 25 / 80: at most 4 pi 0.7 / (r wf).
    factor = 2.0 * (1.0 - math.sqrt(1.0 - 8.0 / 25.0))
    most = 4.0 * math.pi * 0.7 / (25.0 / 80.0 * factor)
    least = 4.0 * math.pi * 0.5 * 0.7 * 1.5
    assert adapted_period(25.0, 8.0, 1.0 / 80.0, 1.0, 1.0, made) == pytest.approx(max(least, min(10.0, most)))
    assert adapted_period(25.0, 0.0, 1.0 / 80.0, 1.0, 1.0, made) == 10.0


def test_the_bank_is_that_of_a_level_turn_within_the_limit() -> None:
    made = parameters(FW_R_LIM=30.0)
    assert roll_setpoint(9.80665 * math.tan(math.radians(20.0)), made) == pytest.approx(math.radians(20.0))
    assert roll_setpoint(-20.0, made) == pytest.approx(-math.radians(30.0))
