"""What a leg's fit leaves out at its ends, what is too short for one, and how sure each is."""

import math

import numpy as np
import pytest

from aircraft.path_limits import BLEND_ACCELERATION
from logs.verdict.measures.leg_fits import LegFit, leg_course, leg_slope
from logs.verdict.measures.route_demands import RouteDemands, route_demands
from logs.verdict.measures.track_alignment import AlignedTrack, lay_track
from tests.synthetic import Profile, fly_path, make_setup

# Metres between two rows at 25 m/s.
ROW = 25.0 / 60.0


def straight(*runs: float) -> list[list[float]]:
    """Level legs of these lengths, due north."""
    return [[0.0, sum(runs[:k]), 300.0] for k in range(len(runs) + 1)]


def flown(points: list[list[float]], across: Profile | None = None, **how: float) -> tuple[RouteDemands, AlignedTrack]:
    setup = make_setup(points, **how)
    demands = route_demands(setup)
    aligned = lay_track(demands, fly_path(setup, across=across))
    assert aligned is not None
    return demands, aligned


def course_of(points: list[list[float]], leg: int, across: Profile | None = None) -> LegFit:
    found = leg_course(*flown(points, across), leg)
    assert found is not None
    return found


def slope_of(points: list[list[float]], leg: int, **how: float) -> LegFit:
    found = leg_slope(*flown(points, **how), leg)
    assert found is not None
    return found


@pytest.mark.parametrize(("leg", "left_out"), [(0, 20.0 + 100.0), (1, 100.0 + 100.0), (2, 100.0)])
def test_a_fit_leaves_out_what_is_near_a_turn_and_near_the_start(leg: int, left_out: float) -> None:
    points = straight(2000.0, 2000.0, 2000.0)
    assert course_of(points, leg).run == pytest.approx(2000.0 - left_out, abs=2 * ROW)
    assert slope_of(points, leg).run == pytest.approx(2000.0 - left_out, abs=2 * ROW)


def test_a_slopes_fit_leaves_out_the_blend_and_twenty_metres_more() -> None:
    # From level to 1 in 5 at 35 m/s: a parabola of 0.2 v^2 / (2 a) on either side of the waypoint.
    blend = 0.2 * 35.0**2 / (2.0 * BLEND_ACCELERATION)
    assert blend > 90.0
    found = slope_of([[0, 0, 300], [0, 3000, 300], [0, 6000, 900]], 0, airspeed=35.0)
    assert found.run == pytest.approx(3000.0 - 20.0 - (blend + 20.0), abs=2.0)


@pytest.mark.parametrize(("run", "fitted"), [(258.0, False), (262.0, True)])
def test_a_course_is_fitted_to_sixty_metres(run: float, fitted: bool) -> None:
    """Between two turns, a hundred metres from each."""
    assert course_of(straight(1000.0, run, 1000.0), 1).fitted is fitted


@pytest.mark.parametrize(("run", "fitted"), [(298.0, False), (302.0, True)])
def test_a_slope_is_fitted_to_a_hundred_metres(run: float, fitted: bool) -> None:
    assert slope_of(straight(1000.0, run, 1000.0), 1).fitted is fitted


def test_a_shorter_slope_is_measured_over_four_seconds() -> None:
    found = slope_of(straight(1000.0, 180.0, 1000.0), 1)
    assert found.run == pytest.approx(4.0 * 25.0, abs=2 * ROW)
    assert math.degrees(found.tolerance) == pytest.approx(0.5)


def test_a_shorter_course_is_known_to_three_quarters_of_a_degree() -> None:
    assert math.degrees(course_of(straight(1000.0, 180.0, 1000.0), 1).tolerance) == pytest.approx(0.75)


def test_a_straight_and_steady_legs_fit_has_the_tolerance_of_calm_air() -> None:
    points = straight(2000.0, 2000.0)
    assert math.degrees(course_of(points, 1).tolerance) == pytest.approx(0.02, abs=1e-4)
    assert math.degrees(slope_of(points, 1).tolerance) == pytest.approx(0.1, abs=1e-4)


def test_what_swings_about_the_line_widens_its_tolerance_up_to_half_a_degree() -> None:
    """A swing of amplitude a leaves an RMS of a over root 2; twice that at the ends of the run turns the line."""

    def swing(s: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * math.pi * s / 20.0)

    long = course_of(straight(2000.0, 2000.0), 1, swing)
    added = math.degrees(math.atan2(2.0 * math.sqrt(0.5), long.run))
    assert math.degrees(long.tolerance) == pytest.approx(0.02 + added, abs=0.003)
    # Over 102 m it would be 0.8 degrees.
    assert math.degrees(course_of(straight(1000.0, 302.0, 1000.0), 1, swing).tolerance) == pytest.approx(0.5)
