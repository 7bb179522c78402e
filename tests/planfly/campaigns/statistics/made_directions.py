"""Directions of made flights, flown as a search does."""

from collections.abc import Callable, Hashable

import numpy as np

from planfly.campaigns.statistics.wind_boundary import Direction, DrawnNumbers, next_flights
from world.arrays import Floats

# The ways in which a flight of this wind, m/s, and these numbers (d,) fails.
Fly = Callable[[float, Floats], frozenset[Hashable]]


def no_numbers() -> DrawnNumbers:
    """Nothing is known of what is drawn."""
    return DrawnNumbers(np.zeros((1, 0)), lambda start, stop: np.zeros((stop - start, 0)))


def normal_numbers(quantities: int, seed: int) -> DrawnNumbers:
    """So many quantities, each distributed normally."""
    random = np.random.default_rng(seed)
    draws = random.normal(size=(5000, quantities))
    return DrawnNumbers(random.normal(size=(4096, quantities)), lambda start, stop: draws[start:stop])


def fly(direction: Direction, flights: int, outcome: Fly, together: int = 3) -> None:
    """Fly so many more, a few at a time."""
    for _ in range(flights // together):
        for speed, draw in next_flights(direction, together):
            direction.add(speed, draw, outcome(speed, direction.numbers.first_draws(draw + 1)[draw]))


def above(limit: Callable[[], float]) -> Fly:
    """Flights that fail above a wind, m/s, that is drawn for each."""
    return lambda speed, _: frozenset() if speed < limit() else frozenset({"slope"})
