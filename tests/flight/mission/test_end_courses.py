"""End courses: a lead-in and a lead-out leg give a route the courses its scenario asks for, and only then."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.mission.end_courses import END_LEG_LENGTH, with_end_courses
from flight.mission.route import Route
from tests.mission_lines import setup_of, wp
from world.geometry import leg_courses
from world.scenario import Scenario

SETUP = setup_of(wp(0, 0), wp(0, 2000))


def ends(**courses: float) -> tuple[Route, Scenario]:
    """The route north, and a scenario with its ends and these courses."""
    route = SETUP.route
    start, destination = route.waypoints[0], route.waypoints[-1]
    return route, replace(SETUP.scenario, start=start, destination=destination, **courses)


@pytest.mark.parametrize("turn_deg", [-90.0, 30.0, 90.0, 135.0])
def test_the_route_starts_on_the_course_far_enough_for_the_turn(turn_deg: float) -> None:
    course = math.radians(turn_deg)
    route, scenario = ends(start_course=course)
    longer = with_end_courses(route, scenario, SETUP.limits)
    assert longer.legs == route.legs + 1
    assert float(leg_courses(longer.waypoints)[0]) == pytest.approx(course, abs=1e-4)
    assert longer.waypoints[0, 2] == route.waypoints[0, 2]
    # R = 625 / (9.80665 tan 30) = 110.39 m; the tangent of a sharp turn counts as two radii at most.
    length = 110.39 * min(math.tan(abs(course) / 2.0), 2.0) + END_LEG_LENGTH
    assert math.dist(longer.waypoints[0], longer.waypoints[1]) == pytest.approx(length, abs=0.1)
    assert longer.items.tolist() == [-1, *route.items.tolist()]
    assert f"from a lead-in leg of {length:.0f} m" in longer.started


def test_the_route_ends_on_the_course() -> None:
    route, scenario = ends(destination_course=math.pi / 2.0)
    longer = with_end_courses(route, scenario, SETUP.limits)
    assert float(leg_courses(longer.waypoints)[-1]) == pytest.approx(math.pi / 2.0, abs=1e-4)
    assert longer.items.tolist() == [*route.items.tolist(), -1]
    assert longer.started == route.started


def test_other_routes_stay_as_they_are() -> None:
    route, scenario = ends(start_course=0.0)
    assert with_end_courses(route, scenario, SETUP.limits) is route, "no turn"
    route, scenario = ends()
    assert with_end_courses(route, scenario, SETUP.limits) is route, "no course"
    away = replace(scenario, start=scenario.start + np.array([50.0, 0.0, 0.0]), start_course=1.0)
    assert with_end_courses(route, away, SETUP.limits) is route, "another start"
