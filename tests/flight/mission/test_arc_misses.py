"""A waypoint whose fly-by arc would pass beyond its acceptance radius is flown over; by how much is a plain sum."""

import math

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.path_limits import Limits
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.arc_misses import arc_misses
from flight.mission.routing import make_route
from flight.simulation.flight_setup import make_limits
from tests.mission_lines import ORIGIN, mission, wp
from tests.setups import small_scenario

RADIUS = 25.0**2 / (9.80665 * math.tan(math.radians(30.0)))


@pytest.fixture(scope="module")
def limits() -> Limits:
    return make_limits(small_scenario(), load_envelope(load_aircraft("aerosonde")), 25.0, math.radians(30.0))


def corner(turn: float) -> np.ndarray:
    return np.array([[0, 0, 500], [0, 5000, 500], [5000 * math.sin(turn), 5000 + 5000 * math.cos(turn), 500]], float)


@pytest.mark.parametrize("turn_deg", [30.0, 90.0, 120.0, 150.0, 170.0])
def test_an_acceptance_just_below_and_just_above_where_the_arc_passes(turn_deg: float, limits: Limits) -> None:
    turn = math.radians(turn_deg)
    passes = RADIUS / math.cos(turn / 2.0) - RADIUS
    for acceptance, misses in ((passes - 0.01, True), (passes + 0.01, False), (0.0, False)):
        radii = np.array([1.0, acceptance, 1.0])
        found = arc_misses(corner(turn), np.full(2, 25.0), radii, limits)
        assert found.tolist() == [False, misses, False]


def test_the_faster_leg_draws_the_arc_and_without_limits_there_is_none(limits: Limits) -> None:
    turn, speeds = math.radians(90.0), np.array([20.0, 30.0])
    passes = 30.0**2 / 25.0**2 * RADIUS * (math.sqrt(2.0) - 1.0)
    for acceptance, misses in ((passes - 0.01, True), (passes + 0.01, False)):
        assert arc_misses(corner(turn), speeds, np.array([0.0, acceptance, 0.0]), limits)[1] == misses
    assert not arc_misses(corner(turn), speeds, np.full(3, 1.0), None).any()


def test_a_route_flies_over_what_its_arc_would_miss(limits: Limits) -> None:
    places = (wp(0, 0), wp(0, 3000, p="0 {} 0 0"), wp(3000, 3000))
    for acceptance, over in ((10.0, True), (60.0, False), (0.0, False)):
        lines = [line.format(acceptance) for line in places]
        route = make_route(mission(*lines), ORIGIN, None, 25.0, False, limits)
        assert route.fly_over.tolist() == [False, over, False]
