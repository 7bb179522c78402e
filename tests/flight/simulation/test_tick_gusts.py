"""Gusts from the filters to JSBSim and to the track: which way each blows, up and down too."""

import math

import pytest

from flight.autopilots.planfly.law import planfly_tick
from flight.simulation.tick import READ_FIELDS, Workspace
from tests.flight.simulation.hand_made import HEIGHT, RADIUS, level_ground, make_workspace


def two_ticks(**readings: float) -> Workspace:
    """After two ticks north at 25 m/s in wind and in gusts that the filters hold already, without new noise.

    The wind blows 5 m/s to the map course with cosine 0.6 and sine 0.8.  400 m above the ground the scales are those of
    1,000 feet, where both standard deviations are a tenth of the wind at 20 feet (MIL-F-8785C): 1 m/s.  Two deviations
    along; filters at one across give (root 3 + 1 - root 3) / root 2; at three downwards, three times that.
    """
    space = make_workspace()
    space.record.wind = (5.0, 0.6, 0.8, 0.0, 0.0, 10.0, 0.0)
    filters = space.record.gusts
    filters.along = 2.0
    filters.across_first = filters.across_second = 1.0
    filters.down_first = filters.down_second = 3.0
    values = dict.fromkeys(READ_FIELDS, 0.0) | {
        "latitude": 1000.0 / RADIUS,
        "amsl": HEIGHT,
        "velocity_north": 25.0,
        "airspeed": 25.0,
        "load_factor": 1.0,
    }
    for _ in range(2):
        space.readings[:] = list((values | readings).values())
        assert planfly_tick(space.block, level_ground()) == 0
    return space


ALONG, ACROSS, DOWN = 2.0, math.sqrt(0.5), 3.0 * math.sqrt(0.5)
# To the right of the wind's course lies minus its sine to the north, its cosine to the east.
NORTH, EAST = 0.6 * (5.0 + ALONG) - 0.8 * ACROSS, 0.8 * (5.0 + ALONG) + 0.6 * ACROSS


def test_gusts_are_set_in_jsbsim_along_across_and_down() -> None:
    output = two_ticks().record.output
    # Two ticks of a thirtieth of a second take less than 2 % off the filters.
    assert (output.gust_north, output.gust_east) == pytest.approx((NORTH, EAST), rel=0.01)
    assert output.gust_down == pytest.approx(DOWN, rel=0.02)


def test_the_next_row_shows_them_upwards() -> None:
    space = two_ticks()
    assert space.rows[0].wind.tolist() == [0.0, 0.0, 0.0]
    assert space.rows[1].wind.tolist() == pytest.approx([EAST, NORTH, -DOWN], rel=0.02)


def test_an_aircraft_that_sinks_has_a_velocity_downwards() -> None:
    assert two_ticks(velocity_down=2.0).rows[0].velocity[2] == pytest.approx(-2.0)
