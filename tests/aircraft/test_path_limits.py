"""Slopes and turn radii in wind, against hand calculation and dense sampling."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from aircraft.envelope import Envelope
from aircraft.path_limits import (
    Limits,
    aircraft_slopes,
    ground_speed_on,
    turn_radius_between,
    turn_tangents,
    wind_speed_at,
)
from aircraft.tracking import SPEED_RATIOS, TURNS, TrackingError, air_density_factor
from tests.setups import falling_envelope
from world.wind import Wind

G = 9.80665
BANK = math.radians(30.0)
UP, DOWN = math.radians(13.7), math.radians(7.8)
EAST, NORTH, WEST, SOUTH = math.pi / 2, 0.0, -math.pi / 2, math.pi


def _limits(wind: Wind | None = None, climb: float = UP, descent: float = DOWN) -> Limits:
    """An envelope of one climb and one descent angle at 25 m/s, a degree less climb each 500 m."""
    heights = np.array([0.0, 500.0, 1000.0])
    climbs = np.array([climb + math.radians(1.0), climb, climb - math.radians(1.0)])
    envelope = Envelope(
        aircraft="paper",
        model_hash="",
        motor_braking=False,
        airspeed=np.array([20.0, 25.0, 30.0]),
        amsl=heights,
        climb=np.array([climbs + 0.05, climbs, climbs - 0.05]),
        descent=np.full((3, 3), descent),
        level_speed_min=np.full(3, 17.0),
        level_speed_max=np.full(3, 32.0),
        max_bank=BANK,
    )
    return Limits(None, None, None, 30.0, envelope, 25.0, BANK, wind or Wind())


def _from(degrees: float, speed: float = 10.0, **more: float) -> Wind:
    return Wind(speed, math.radians(degrees), **more)


def test_still_air_is_the_envelope() -> None:
    assert _limits().slopes(1.234, 500.0) == pytest.approx((UP, DOWN))
    assert _limits().slopes(1.234, 250.0) == pytest.approx((UP + math.radians(0.5), DOWN))
    # Beyond the table's heights its edge counts.
    assert _limits().slopes(0.0, 5000.0) == pytest.approx((UP - math.radians(1.0), DOWN))
    assert _limits().slopes(0.0, 500.0, airspeed=27.5) == pytest.approx((UP - 0.025, DOWN))


def test_rates_are_those_of_still_air_in_any_wind() -> None:
    climb = 25.0 * math.sin(UP + math.radians(0.5))
    assert _limits(_from(30.0)).max_climb_and_sink_rates(250.0) == pytest.approx((climb, 25.0 * math.sin(DOWN)))


@pytest.mark.parametrize(
    ("course", "up_deg", "down_deg"),
    [
        # Rise 25 sin 13.7 = 5.921 m/s on 25 cos 13.7 = 24.289 m/s of air; 3.393 on 24.769 down.
        (EAST, math.degrees(math.atan(5.9210 / 34.2887)), math.degrees(math.atan(3.3929 / 34.7687))),  # 9.8
        (WEST, math.degrees(math.atan(5.9210 / 14.2887)), math.degrees(math.atan(3.3929 / 14.7687))),  # 22.5
        # Across: the air's horizontal speed is what is left beside 10 m/s of crab.
        (NORTH, math.degrees(math.atan(5.9210 / 22.1351)), math.degrees(math.atan(3.3929 / 22.6603))),
        (SOUTH, math.degrees(math.atan(5.9210 / 22.1351)), math.degrees(math.atan(3.3929 / 22.6603))),
    ],
)
def test_slopes_over_the_ground_in_a_west_wind(course: float, up_deg: float, down_deg: float) -> None:
    up, down = _limits(_from(270.0)).slopes(course, 500.0)
    assert math.degrees(up) == pytest.approx(up_deg, abs=1e-3)
    assert math.degrees(down) == pytest.approx(down_deg, abs=1e-3)


def test_design_figures() -> None:
    # flight.md, measured with a prototype: climb 10.0 degrees in 10 m/s from behind, 22.5 from ahead.
    limits = _limits(_from(270.0))
    assert math.degrees(limits.slopes(EAST, 500.0)[0]) == pytest.approx(10.0, abs=0.25)
    assert math.degrees(limits.slopes(WEST, 500.0)[0]) == pytest.approx(22.5, abs=0.1)
    # (V + W)^2 / (g tan bank), and theta from 131 m and 265 m legs: 61 and 100 degrees in still air.
    assert _limits().turn_radius(0.0, 1.0, 500.0) == pytest.approx(110.4, abs=0.1)
    for leg, theta in ((131.0, 61.0), (265.0, 100.0)):
        assert math.degrees(2 * math.atan(leg / 2 / 110.4)) == pytest.approx(theta, abs=0.6)


def test_no_way_is_no_slope_and_no_radius() -> None:
    limits = _limits(_from(270.0, 26.0))
    assert limits.slopes(WEST, 500.0) == (0.0, 0.0)
    assert limits.slopes(NORTH, 500.0) == (0.0, 0.0)
    assert limits.slopes(EAST, 500.0)[0] > 0.0
    for courses in ((EAST, WEST), (WEST, EAST), (NORTH, SOUTH)):
        assert limits.turn_radius(*courses, 500.0) == math.inf


def test_a_speed_outside_the_envelope_has_no_slope() -> None:
    assert _limits().slopes(0.0, 500.0, airspeed=31.0) == (0.0, 0.0)


def test_gradient_moves_the_limits_with_height() -> None:
    limits = _limits(Wind(4.0, math.radians(270.0), gradient=0.01, reference_amsl=200.0))
    assert wind_speed_at(limits.performance(), 800.0) == pytest.approx(10.0)
    assert wind_speed_at(limits.performance(), -500.0) == 0.0
    assert ground_speed_on(limits.performance(), EAST, 800.0) == pytest.approx(35.0)
    assert ground_speed_on(limits.performance(), WEST, 800.0) == pytest.approx(15.0)
    assert ground_speed_on(limits.performance(), NORTH, 800.0) == pytest.approx(math.sqrt(525.0))


@given(st.floats(0.0, 24.0), st.floats(-6.3, 6.3), st.floats(-math.pi, math.pi), st.floats(-3.1, 3.1))
def test_radius_is_for_the_highest_ground_speed_on_the_arc(
    speed: float, source: float, course: float, turn: float
) -> None:
    assume(abs(turn) > 1e-3)
    wind = Wind(speed, source)
    radius = turn_radius_between(_limits(wind).performance(), course, course + turn, 500.0)
    courses = course + turn * np.linspace(0.0, 1.0, 2001)
    # The ground speed on each course, by the triangle of speeds.
    east, north = wind.velocity_at(500.0)
    tail = east * np.sin(courses) + north * np.cos(courses)
    across = east * np.cos(courses) - north * np.sin(courses)
    fastest = (np.sqrt(25.0**2 - across**2) + tail).max()
    assert radius == pytest.approx(fastest**2 / (G * math.tan(BANK)), rel=1e-5)
    assert radius >= fastest**2 / (G * math.tan(BANK)) * (1 - 1e-12)


def test_a_u_turn_takes_the_wind_from_either_side() -> None:
    radius = (35.0**2) / (G * math.tan(BANK))
    for course in (NORTH, SOUTH):
        assert _limits(_from(270.0)).turn_radius(course, course + math.pi, 500.0) == pytest.approx(radius)


def test_turbulence_widens_turns() -> None:
    gusty = Wind(10.0, math.radians(270.0), turbulence="moderate")
    assert _limits(gusty).turn_radius(EAST, EAST + 0.5, 500.0) == pytest.approx(36.54**2 / (G * math.tan(BANK)))


def test_tangents_of_a_path() -> None:
    table = _limits().performance()
    way = np.array(
        [[0, 0, 500], [0, 1000, 500], [1000, 1000, 500], [2000, 1000, 500], [2000, 1000, 600], [1000, 1000, 500.0]]
    )
    radius = 25.0**2 / (G * math.tan(BANK))
    tangents = turn_tangents(table, way)
    assert tangents[:3] == pytest.approx([0.0, radius, 0.0])  # a right angle, then straight on
    assert tangents[3:].tolist() == [0.0, 0.0, 0.0]  # legs without length have no course
    out_and_back = np.array([[0, 0, 500], [0, 1000, 500], [0, 0, 500.0]])
    assert turn_tangents(table, out_and_back)[1] == math.inf


@given(st.floats(0.0, 20.0), st.floats(-6.3, 6.3), st.floats(-6.3, 6.3))
def test_turning_the_world_turns_nothing(speed: float, source: float, angle: float) -> None:
    # Wind and courses turned alike leave slopes and radii as they are.
    here, there = _limits(Wind(speed, source)).performance(), _limits(Wind(speed, source + angle)).performance()
    assert aircraft_slopes(there, 0.3 + angle, 400.0) == pytest.approx(aircraft_slopes(here, 0.3, 400.0), abs=1e-9)
    assert turn_radius_between(there, 0.3 + angle, 1.7 + angle, 400.0) == pytest.approx(
        turn_radius_between(here, 0.3, 1.7, 400.0), rel=1e-7
    )


def test_plans_leave_nothing_open_at_the_airspeeds_that_are_flown() -> None:
    # At 1,000 m: 12.5 degrees at 25 m/s and 3.6 at 30, known to 2 degrees; ArduPlane flies 25 m/s as 26.24 there.
    known = falling_envelope()
    unsure = replace(known, source="a data sheet", climb_sd=math.radians(2.0), descent_sd=math.radians(1.0))
    flat = np.zeros((TURNS.size, SPEED_RATIOS.size))
    tracking = TrackingError(25.0, flat, flat, flat, flat, across=1.0, up=1.0, lag=0.0, step=0.0)
    limits = Limits(None, None, None, 30.0, unsure, 25.0, 0.5, Wind(), tracking)
    climb, descent = (math.degrees(angle) for angle in limits.with_margin().slopes(0.0, 1000.0))
    factor = air_density_factor(1000.0)
    assert climb == pytest.approx(12.5 - 8.9 * 25.0 * (factor - 1.0) / 5.0 - 1.645 * 2.0, abs=1e-6)
    assert descent == pytest.approx(7.8 + 2.2 * 25.0 * (factor - 1.0) / 5.0 - 1.645, abs=1e-6)
    # Over the ground the headwind counts less, the faster it is flown: tan = v sin(a) / (v cos(a) - w).
    sure, fast, wind = math.radians(climb), 25.0 * factor, 8.0
    against = replace(limits, wind=Wind(wind, 0.0)).with_margin().slopes(0.0, 1000.0)[0]
    assert math.tan(against) == pytest.approx(fast * math.sin(sure) / (fast * math.cos(sure) - wind), rel=1e-6)
    # A turn's radius is that of its true airspeed: v^2 / (g tan(bank)).
    assert limits.turn_radius(0.0, 1.0, 1000.0) == pytest.approx(fast**2 / (9.80665 * math.tan(0.5)))
    # What is certain at the airspeed itself, without an autopilot's; and an aircraft that is known stays as it is.
    exact = replace(limits, tracking=None).with_margin()
    assert math.degrees(exact.slopes(0.0, 1000.0)[0]) == pytest.approx(12.5 - 1.645 * 2.0, abs=1e-6)
    assert replace(limits, envelope=known).with_margin().envelope is known


def test_no_leg_may_lead_where_the_air_is_too_thin_to_fly_level() -> None:
    # 25.5 m/s are 28.1 true at 2,000 m, where it climbs 10.1 degrees at 25 m/s and 1.2 at 30; at 3,000 m they are 29.6,
    # where it climbs 7.7 and -1.2.
    flat = np.zeros((TURNS.size, SPEED_RATIOS.size))
    tracking = TrackingError(25.5, flat, flat, flat, flat, across=1.0, up=1.0, lag=0.0, step=0.0)
    limits = Limits(None, None, None, 30.0, falling_envelope(), 25.5, 0.5, Wind(), tracking)
    low, high = limits.slopes(0.0, 2000.0), limits.slopes(0.0, 3000.0)
    assert min(low) > 0.0
    assert high[0] < 0.0
    assert high[1] == 0.0
    # At a stated true airspeed it may glide there.
    assert limits.slopes(0.0, 3000.0, airspeed=29.6)[1] > 0.0
