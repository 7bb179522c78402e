"""One seed gives the same streams each time, and each stream its own numbers."""

import numpy as np

from world.random_streams import NAVIGATION, PLANNER, TURBULENCE, stream

STREAMS = (PLANNER, TURBULENCE, NAVIGATION)


def test_the_same_seed_gives_the_same_numbers() -> None:
    for number in STREAMS:
        assert np.array_equal(stream(5, number).random(50), stream(5, number).random(50))
        assert not np.array_equal(stream(5, number).random(50), stream(6, number).random(50))


def test_streams_of_one_seed_are_independent() -> None:
    drawn = np.array([stream(5, number).standard_normal(20_000) for number in STREAMS])
    # Four standard errors.
    assert np.abs(np.corrcoef(drawn) - np.eye(len(STREAMS))).max() < 4.0 / np.sqrt(20_000)
