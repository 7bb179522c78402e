"""Courses and slopes of flown legs, by least squares and, on short legs, without."""

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.leg_fits import fit_line, leg_course, leg_slope, straight_span
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import AlignedTrack, lay_track
from logs.verdict.tolerances import ROUGH_COURSE, SLOPE_FLOOR
from tests.synthetic import fly_path, make_setup


def aligned_with(setup: FlightSetup, track: Track) -> AlignedTrack:
    aligned = lay_track(route_demands(setup), track)
    assert aligned is not None
    return aligned


def test_a_line_is_fitted_with_the_rms_of_what_it_leaves() -> None:
    x = np.arange(100.0)
    slope, rest = fit_line(x, 0.3 * x + np.where(x % 2 == 0, 1.0, -1.0))
    assert slope == pytest.approx(0.3, abs=1e-3)
    assert rest == pytest.approx(1.0, abs=1e-3)


def test_long_legs_have_the_planned_course_and_slope(setup: FlightSetup, track: Track) -> None:
    demands, aligned = route_demands(setup), aligned_with(setup, track)
    for leg in range(demands.legs):
        course, slope = leg_course(demands, aligned, leg), leg_slope(demands, aligned, leg)
        assert course is not None
        assert slope is not None
        assert course.fitted
        assert slope.fitted
        assert np.cos(course.value - demands.courses[leg]) == pytest.approx(1.0, abs=1e-8)
        assert slope.value == pytest.approx(demands.slopes[leg], abs=1e-3)
        assert slope.tolerance >= SLOPE_FLOOR


def test_a_short_leg_is_rough() -> None:
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [100, 1150, 300], [100, 2500, 300]])
    course = leg_course(route_demands(setup), aligned_with(setup, fly_path(setup)), 1)
    assert course is not None
    assert not course.fitted
    assert course.tolerance == ROUGH_COURSE


def test_a_leg_that_was_not_flown_has_neither(setup: FlightSetup) -> None:
    demands, aligned = route_demands(setup), aligned_with(setup, fly_path(setup, stop=2500.0))
    assert leg_course(demands, aligned, 3) is None
    assert leg_slope(demands, aligned, 3) is None


def test_the_straight_span_lies_between_the_turns(setup: FlightSetup) -> None:
    demands = route_demands(setup)
    low, high = straight_span(demands, 1, 0.0)
    assert (low, high) == (demands.after[1], demands.runs[1] - demands.before[2])
    inner = straight_span(demands, 1, 100.0, level=True)
    assert inner[0] >= low + 100.0
    assert inner[1] <= high - 100.0
