"""Which airspeeds ArduPlane takes up, and what it flies instead."""

import numpy as np
import pytest

from flight.ardupilot.parameters import default_parameters
from flight.ardupilot.speed_commands import speeds_flown, takes_speed

PARAMETERS = default_parameters().changed(AIRSPEED_MIN=18.0, AIRSPEED_MAX=31.0)


@pytest.mark.parametrize(("airspeed", "taken"), [(17.99, False), (18.0, True), (31.0, True), (31.01, False)])
def test_speeds_within_the_limits_are_taken(airspeed: float, taken: bool) -> None:
    assert takes_speed(airspeed, PARAMETERS) is taken


def test_a_speed_that_is_not_taken_leaves_the_one_before() -> None:
    commanded = np.array([17.0, 17.0, 20.0, 35.0, 31.0])
    assert speeds_flown(commanded, 25.0, PARAMETERS).tolist() == [25.0, 25.0, 20.0, 20.0, 31.0]
