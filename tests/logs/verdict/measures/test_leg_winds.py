"""Each leg is judged in the forecast's wind at its middle when the aircraft is there."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.measures.route_requirements import route_requirements
from tests.synthetic import make_setup
from world.forecast.wind_field import WindField
from world.wind import Wind

# Two legs to the north of 2.5 km each, at 25 m/s.
WAY = [[0, 0, 300], [0, 2500, 300], [0, 5000, 300]]


def rising_wind() -> WindField:
    """Return a wind from the south that rises evenly from 0 to 10 m/s in 200 s, the same at all places."""
    altitudes = np.broadcast_to([0.0, 1000.0], (2, 2, 2, 2)).copy()
    velocities = np.zeros((2, 2, 2, 2, 2))
    velocities[1, ..., 1] = 10.0
    return WindField(np.array([0.0, 200.0]), np.array([45.0, 47.0]), np.array([7.0, 9.0]), altitudes, velocities)


def test_a_leg_has_the_wind_of_its_time() -> None:
    setup = make_setup(WAY)
    still = route_requirements(setup)
    assert still.winds == ()
    assert still.wind_on(1) is setup.scenario.wind
    windy = replace(setup, scenario=replace(setup.scenario, wind=Wind(field=rising_wind())))
    requirements = route_requirements(windy)
    # In calm air, the middle of the first leg is passed at 50 s: 2.5 m/s.  At 27.5 m/s the leg takes 90.9 s, and the
    # middle of the second leg is passed 50 s later: 7.05 m/s.
    assert [wind.speed for wind in requirements.winds] == pytest.approx([2.5, 7.045], abs=0.01)
    assert [math.degrees(wind.from_course) for wind in requirements.winds] == pytest.approx([180.0, 180.0])
    # A tailwind makes slopes over the ground flatter, on the second leg more than on the first.
    assert still.climb[0] > requirements.climb[0] > requirements.climb[1]
    assert requirements.ground_speed == pytest.approx([27.5, 32.05], abs=0.2)
