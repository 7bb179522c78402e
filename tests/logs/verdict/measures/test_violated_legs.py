"""Legs that enter a missile's sphere or leave the area, and legs that pass a sphere closely, by plain sums."""

import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.violated_legs import legs_near_missiles, violated_legs
from tests.logs.verdict.judging import missile, of
from tests.synthetic import make_scenario, make_setup

STRAIGHT = [[0.0, 3000.0 * k, 300.0] for k in range(4)]


def beside(distance: float) -> FlightSetup:
    """The middle leg passes a sphere of 500 m at a distance, m; the sphere is at 2 km from both ends of the others."""
    threat = {"name": "m", "north_m": 4500.0, "amsl_m": 300.0, "kill_radius_m": 500.0, "kill_scale_m": 100.0}
    return make_setup(STRAIGHT, scenario=make_scenario(STRAIGHT, threats=[threat | {"east_m": 500.0 + distance}]))


@pytest.mark.parametrize(("distance", "is_near"), [(49.0, True), (51.0, False), (-30.0, True)])
def test_a_leg_is_near_a_missile_within_the_distance(distance: float, is_near: bool) -> None:
    nearest = legs_near_missiles(route_requirements(beside(distance)), 50.0)
    assert nearest == ({1: (pytest.approx(distance), 0)} if is_near else {})


def test_the_leg_that_enters_a_sphere_violates_it() -> None:
    setup = beside(-30.0)
    finding = of(judge_geometry(setup), "threat", missile("m"))
    assert violated_legs(route_requirements(setup), finding) == (1,)
