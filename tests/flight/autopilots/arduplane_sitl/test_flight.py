"""Where on the path an aircraft is that another program steers, and when its flight is complete."""

import math

import numpy as np
import pytest

from flight.autopilots.sitl.flight import distances_from_route_end, place_on_path
from flight.guidance.inner_loops import GUIDANCE_MEMORY
from flight.guidance.lateral_reference_laws import strided_waypoints
from flight.guidance.navigation_error import MOTION
from flight.guidance.path import NODE, PIECE

# North for 1,000 m, then east for 1,000 m, climbing by 5 % on the second leg.
FIRST = (0.0, 1000.0, 0.0, 0.0, 0.0, 0.0, 0, math.inf)
SECOND = (1000.0, 1000.0, 0.0, 1000.0, math.pi / 2, 0.0, 1, math.inf)
PIECES = np.array([FIRST, SECOND], PIECE)
NODES = np.array([(0.0, 500.0, 0.0, 0.0), (1000.0, 500.0, 0.05, 0.0), (2000.0, 550.0, 0.05, 0.0)], NODE)
WAYPOINTS = strided_waypoints(3)
WAYPOINTS["east"], WAYPOINTS["north"] = (0.0, 0.0, 1000.0), (0.0, 1000.0, 1000.0)


def at(east: float, north: float, up: float = 500.0) -> np.record:
    true = np.zeros(1, MOTION)[0]
    true.east, true.north, true.up = east, north, up
    return true


def placed(*places: tuple[float, float, float]) -> np.record:
    """The memory after these places, in order."""
    memory = np.zeros(1, GUIDANCE_MEMORY)[0]
    for place in places:
        place_on_path(at(*place), PIECES, NODES, memory)
    return memory


def test_an_aircraft_beside_a_leg_is_on_it() -> None:
    memory = placed((12.0, 400.0, 503.0))
    assert (memory.leg, memory.distance, memory.cross_track, memory.height_error) == (0, 400.0, 12.0, 3.0)


def test_before_the_first_waypoint_the_distance_is_negative() -> None:
    assert placed((0.0, -500.0, 500.0)).distance == -500.0


def test_the_nearest_leg_is_its_own_with_the_height_there() -> None:
    memory = placed((0.0, 900.0, 500.0), (200.0, 1030.0, 515.0))
    assert (memory.leg, memory.distance, memory.cross_track) == (1, 1200.0, pytest.approx(-30.0))
    assert memory.height_error == pytest.approx(15.0 - 0.05 * 200.0)


def test_a_leg_that_was_left_is_not_entered_again() -> None:
    memory = placed((200.0, 1000.0, 500.0), (5.0, 500.0, 500.0))
    assert memory.leg == 1


def test_an_aircraft_that_cuts_the_corner_goes_over_to_the_next_leg() -> None:
    assert placed((0.0, 500.0, 500.0), (400.0, 900.0, 500.0)).leg == 1


def test_the_end_is_passed_at_its_plane_wherever_that_is() -> None:
    # 40 m left of the last leg, then past its end by 7 m.
    assert distances_from_route_end(at(990.0, 1040.0), WAYPOINTS) == pytest.approx((-40.0, -10.0))
    assert distances_from_route_end(at(1007.0, 930.0), WAYPOINTS) == pytest.approx((70.0, 7.0))
