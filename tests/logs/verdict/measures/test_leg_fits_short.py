"""Legs too short for a fit: the four seconds about their middle, and the course between their turns."""

import math

import numpy as np
import pytest

from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.slopes import LegFit, leg_course, leg_slope
from logs.verdict.measures.track_alignment import align_track
from tests.synthetic import Profile, bank_radius, fly_path, make_setup


def straight(run: float) -> list[list[float]]:
    return [[0, 0, 300], [0, 1000, 300], [0, 1000 + run, 300], [0, 2000 + run, 300]]


def slope(run: float, airspeed: Profile | None = None, up: Profile | None = None) -> LegFit | None:
    setup = make_setup(straight(run))
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, airspeed=airspeed, up=up))
    assert aligned is not None
    return leg_slope(requirements, aligned, 1)


@pytest.mark.parametrize("off", [0.0, 10.0, -10.0])
def test_a_short_legs_slope_is_that_about_its_middle(off: float) -> None:
    """A parabola of 1 mm per square metre has the slope 2 mm a metre from its foot: here ``off`` before the middle."""
    found = slope(180.0, up=lambda s: 0.001 * (s - 1090.0 + off) ** 2)
    assert found is not None
    assert math.tan(found.value) == pytest.approx(0.002 * off, abs=5e-4)
    assert found.length == pytest.approx(100.0, abs=1.0)


@pytest.mark.parametrize(("first", "second"), [(15.0, 34.0), (34.0, 15.0)])
def test_four_seconds_begin_and_end_within_the_leg(first: float, second: float) -> None:
    """Half of 120 m takes 4 s at 15 m/s or 1.76 s at 34: of the fast half all, of the slow one what is left of 4 s."""
    found = slope(120.0, airspeed=lambda s: np.where(s < 1060.0, first, second) - 25.0)
    assert found is not None
    assert found.length == pytest.approx(60.0 + 15.0 * (4.0 - 60.0 / 34.0), abs=1.2)


def test_less_than_four_seconds_are_all_that_there_is() -> None:
    found = slope(80.0)
    assert found is not None
    assert found.length == pytest.approx(80.0, abs=1.0)


@pytest.mark.parametrize(("run", "known"), [(24.0, False), (26.5, True)])
def test_a_slope_takes_a_second(run: float, known: bool) -> None:
    assert (slope(run) is not None) is known


@pytest.mark.parametrize(("creep", "known"), [(0.2, False), (0.3, True)])
def test_a_slope_takes_a_metre_of_way(creep: float, known: bool) -> None:
    """Over the middle 3 m of the leg the aircraft nearly stands: 0.8 or 1.2 m in four seconds."""
    found = slope(120.0, airspeed=lambda s: np.where(np.abs(s - 1060.0) < 1.5, creep - 25.0, 0.0))
    assert (found is not None) is known


def zigzag(turn_deg: float, run: float) -> list[list[float]]:
    """A leg of this length between a turn to the right and one to the left."""
    turn = math.radians(turn_deg)
    east, north = run * math.sin(turn), 1000.0 + run * math.cos(turn)
    return [[0, 0, 300], [0, 1000, 300], [east, north, 300], [east, north + 1000.0, 300]]


@pytest.mark.parametrize("turn", [40.0, -40.0, 75.0])
def test_a_short_legs_course_is_that_between_its_turns(turn: float) -> None:
    """30 m longer, 1.2 s, than what the turns take of it."""
    tangents = 2.0 * bank_radius() * math.tan(0.5 * math.radians(abs(turn)))
    setup = make_setup(zigzag(turn, tangents + 30.0))
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup))
    assert aligned is not None
    found = leg_course(requirements, aligned, 1)
    assert found is not None
    assert not found.is_fitted
    assert math.degrees(found.value) == pytest.approx(turn, abs=0.2)


def test_where_the_turns_leave_nothing_it_is_that_where_they_meet() -> None:
    """Arcs of half the radius meet in the middle of a leg that has room for no more."""
    turn = math.radians(60.0)
    setup = make_setup(zigzag(60.0, bank_radius() * math.tan(0.5 * turn) + 1.0))
    requirements = route_requirements(setup)
    assert requirements.length_after[1] + requirements.length_before[2] > requirements.runs[1]
    aligned = align_track(requirements, fly_path(setup, radius=0.5 * bank_radius()))
    assert aligned is not None
    found = leg_course(requirements, aligned, 1)
    assert found is not None
    # A second's mean about the middle, half of it turning on either side by v / R: a quarter second of it in the mean.
    turned = math.degrees(0.25 * 25.0 / (0.5 * bank_radius()))
    assert math.degrees(found.value) == pytest.approx(60.0 - turned, abs=2.0)
