"""Courses and slopes of flown legs, by least squares and, on short legs, without."""

import math

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures import slopes
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.slopes import (
    Ability,
    SlopeMeasure,
    fit_line,
    leg_course,
    leg_slope,
    measure_slope,
    straight_span,
)
from logs.verdict.measures.track_alignment import AlignedTrack, airspeed_gain_in_rising_air, align_track
from logs.verdict.tolerances import ROUGH_COURSE_ERROR_RAD, SLOPE_ERROR_FLOOR_RAD
from tests.synthetic import Profile, edited, fly_path, make_setup


def aligned_with(setup: FlightSetup, track: Track) -> AlignedTrack:
    aligned = align_track(route_requirements(setup), track)
    assert aligned is not None
    return aligned


def test_a_line_is_fitted_with_the_rms_of_what_it_leaves() -> None:
    x = np.arange(100.0)
    slope, rest = fit_line(x, 0.3 * x + np.where(x % 2 == 0, 1.0, -1.0))
    assert slope == pytest.approx(0.3, abs=1e-3)
    assert rest == pytest.approx(1.0, abs=1e-3)


def test_long_legs_have_the_planned_course_and_slope(setup: FlightSetup, track: Track) -> None:
    requirements, aligned = route_requirements(setup), aligned_with(setup, track)
    for leg in range(requirements.legs):
        course, slope = leg_course(requirements, aligned, leg), leg_slope(requirements, aligned, leg)
        assert course is not None
        assert slope is not None
        assert course.is_fitted
        assert slope.is_fitted
        assert np.cos(course.value - requirements.courses[leg]) == pytest.approx(1.0, abs=1e-8)
        assert slope.value == pytest.approx(requirements.slopes[leg], abs=1e-3)
        assert slope.tolerance >= SLOPE_ERROR_FLOOR_RAD


def test_a_short_leg_is_rough() -> None:
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [100, 1150, 300], [100, 2500, 300]])
    course = leg_course(route_requirements(setup), aligned_with(setup, fly_path(setup)), 1)
    assert course is not None
    assert not course.is_fitted
    assert course.tolerance == ROUGH_COURSE_ERROR_RAD


def test_a_leg_that_was_not_flown_has_neither(setup: FlightSetup) -> None:
    requirements, aligned = route_requirements(setup), aligned_with(setup, fly_path(setup, stop=2500.0))
    assert leg_course(requirements, aligned, 3) is None
    assert leg_slope(requirements, aligned, 3) is None


def test_the_straight_span_lies_between_the_turns(setup: FlightSetup) -> None:
    requirements = route_requirements(setup)
    low, high = straight_span(requirements, 1, 0.0)
    assert (low, high) == (requirements.length_after[1], requirements.runs[1] - requirements.length_before[2])
    inner = straight_span(requirements, 1, 100.0, excludes_blends=True)
    assert inner[0] >= low + 100.0
    assert inner[1] <= high - 100.0


# ----------------------------------------------------------------------
# Legs as climbed: height, throttle, and the steepest flight that the aircraft showed at its limit.

CLIMB = [[0, 0, 300], [0, 1000, 300], [0, 3000, 510], [0, 4500, 510]]


def measured(
    throttle: Profile | None = None, airspeed: Profile | None = None, up: Profile | None = None
) -> SlopeMeasure:
    setup = make_setup(CLIMB)
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, throttle=throttle, airspeed=airspeed, up=up))
    assert aligned is not None
    return measure_slope(requirements, aligned, 1)


def test_a_clean_climb_has_its_slope_and_no_time_at_a_limit() -> None:
    measure = measured()
    assert measure.is_finished
    assert measure.slope is not None
    assert measure.slope.value == pytest.approx(math.atan(0.105), abs=1e-3)
    assert measure.height_error == pytest.approx(0.0, abs=0.5)
    assert (measure.full_throttle_time, measure.idle_throttle_time, measure.speed_loss, measure.speed_gain) == (
        0.0,
        0.0,
        0.0,
        0.0,
    )
    assert measure.ability is None


def test_height_off_the_leg_has_its_sign() -> None:
    measure = measured(up=lambda s: -12.0 * np.exp(-0.5 * ((s - 2000.0) / 200.0) ** 2))
    assert measure.height_error == pytest.approx(-12.0, abs=0.5)


def test_throttle_at_its_limit_is_timed_with_the_speed_that_was_lost_meanwhile() -> None:
    measure = measured(throttle=lambda s: 0.0 * s + 0.5, airspeed=lambda s: -2.0 * (s > 1000.0))
    assert measure.full_throttle_time > 60.0
    assert measure.speed_loss == pytest.approx(2.0, abs=0.1)


def test_an_ability_covers_what_it_exceeds_beyond_its_error() -> None:
    ability = Ability(slope=0.10, error=0.01, duration=20.0)
    assert [ability.exceeds(slope) for slope in (0.06, -0.06, 0.08)] == [True, True, False]


def test_rising_air_lends_speed_that_fades() -> None:
    time = np.arange(0.0, 60.0, 0.1)
    rising = np.where(time < 5.0, 1.0, 0.0).astype(np.float32)
    speed = np.full(time.size, 25.0, dtype=np.float32)
    gained = airspeed_gain_in_rising_air(time, speed, rising)
    assert gained.max() == pytest.approx(9.81 / 25.0 * 5.0, rel=0.25)
    assert gained[-1] < 0.05 * gained.max()


@pytest.mark.parametrize(("run", "short"), [(190.0, True), (210.0, False)])
def test_a_leg_within_a_hundred_metres_of_both_its_turns_is_short(run: float, short: bool) -> None:
    """And a level leg's height is measured between its turns all the same."""
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [0, 1000 + run, 300], [0, 2500, 300]])
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, up=lambda s: 0.0 * s + 4.0))
    assert aligned is not None
    measure = measure_slope(requirements, aligned, 1)
    assert measure.is_short is short
    assert measure.height_error == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize(("throttle", "off"), [(0.5, -3.0), (-0.7, 3.0)])
def test_speed_that_a_gust_along_the_track_took_is_not_lost(throttle: float, off: float) -> None:
    """The airspeed is 3 m/s off and the speed over the ground 1 m/s: the lesser counts."""
    setup = make_setup(CLIMB)
    requirements = route_requirements(setup)

    def measure(airspeed: float, ground: float) -> SlopeMeasure:
        track = fly_path(setup, throttle=lambda s: 0.0 * s + throttle, airspeed=lambda s: 0.0 * s + ground)
        aligned = align_track(requirements, edited(track, airspeed=np.full_like(track.airspeed, 25.0 + airspeed)))
        assert aligned is not None
        return measure_slope(requirements, aligned, 1)

    for airspeed, ground, lost in ((off, off / 3.0, 1.0), (off / 3.0, off, 1.0), (off, 0.0, 0.0), (off, off, 3.0)):
        found = measure(airspeed, ground)
        assert (found.speed_loss if off < 0.0 else found.speed_gain) == pytest.approx(lost, abs=0.02)
        assert (found.speed_gain if off < 0.0 else found.speed_loss) == 0.0


@pytest.mark.parametrize(("span", "value"), [(0.9e-3, 2.0 - 0.5 * 0.09), (1.15e-3, 2.0)])
def test_heights_within_a_decimetre_are_one(span: float, value: float) -> None:
    """A rate of 2 at the top that falls below it; heights are in hundreds of metres."""
    x, y = np.tile([-1.0, 1.0], 500), np.linspace(-span, 0.0, 1000)
    found = slopes._fit_plane_at_origin(2.0 + 100.0 * y, x, y, 10.0)
    assert found is not None
    assert found[0] == pytest.approx(value, abs=1e-3)
