from dataclasses import replace

import numpy as np

from flight.simulation.field_source import MissionStretch
from logs.recording.example_log import example_log
from logs.verdict.field.flown_legs import flown_legs, part_of_route
from logs.verdict.tolerances import PARTLY_FLOWN
from tests.synthetic import fly_path, make_setup

LOG = example_log()
# The turn is passed at 20 s, the end at 36.5 s.
TURN = 20.0


def legs(start: float, end: float) -> tuple[int, int, bool] | None:
    found = flown_legs(LOG.setup, LOG.track, MissionStretch(start, end, "AUTO", "log"))
    return None if found is None else (found.first, found.last, found.partial)


def test_the_whole_route() -> None:
    assert legs(0.0, 36.5) == (0, 2, False)


def test_a_stretch_that_goes_on_has_flown_a_part_of_the_next_leg() -> None:
    assert legs(0.0, TURN + PARTLY_FLOWN - 0.2) == (0, 1, False)
    assert legs(0.0, TURN + PARTLY_FLOWN + 0.2) == (0, 2, True)


def test_what_was_flown_to_the_first_waypoint_is_no_leg() -> None:
    assert legs(10.0, 36.5) == (1, 2, False)


def test_a_stretch_between_waypoints_has_no_leg() -> None:
    assert legs(5.0, 12.0) is None
    assert legs(5.0, 5.05) is None


def test_a_part_of_a_route_keeps_what_belongs_to_its_waypoints() -> None:
    route = LOG.setup.route
    part = part_of_route(route, 1, 2)
    assert part.waypoints.tolist() == route.waypoints[1:].tolist()
    assert (part.legs, part.items.tolist()) == (1, route.items[1:].tolist())
    assert part_of_route(route, 0, 2) is route


def test_a_flight_that_ends_in_its_first_lap_has_flown_none_of_the_second() -> None:
    """Three corners of a triangle, twice: what was near to a corner once was near to it on every lap."""
    corners = [(0.0, 0.0, 300.0), (0.0, 1500.0, 300.0), (1500.0, 1500.0, 300.0)]
    setup = make_setup([*corners, *corners, *corners])
    laps = replace(setup, route=replace(setup.route, items=np.array([1, 2, 3] * 3)))
    # To the last corner, and ten seconds on along the same course.
    track = fly_path(make_setup([*corners, (4000.0, 1500.0, 300.0)]), stop=3400.0)
    found = flown_legs(laps, track, MissionStretch(0.0, 1e4, "AUTO", "log"))
    assert found is not None
    assert (found.first, found.last, found.partial) == (0, 3, True)
