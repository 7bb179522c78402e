"""Which flights are chosen: by halves first, then in the tail, by draws that tell."""

import numpy as np
import pytest
from scipy.stats import norm

from planfly.campaigns.statistics.flight_choice import next_flights
from planfly.campaigns.statistics.wind_boundary import Direction
from tests.planfly.campaigns.statistics.made_directions import above, fly, no_numbers, normal_numbers


def test_halves_come_first() -> None:
    """Upwards while all fly, to the largest wind and not beyond; downwards while none does."""
    up, down = (Direction(20.0, 0.99, normal_numbers(2, 1)) for _ in range(2))
    for direction, failed in ((up, frozenset()), (down, frozenset({"slope"}))):
        for _ in range(10):
            for speed, draw in next_flights(direction, 3):
                direction.add(speed, draw, failed)
    assert up.speeds[::3] == pytest.approx([10.0, 15.0, 17.5, 18.8, 19.4, 19.7, *[20.0] * 4], abs=0.06)
    assert max(up.speeds) == 20.0
    assert down.speeds[::3][:5] == pytest.approx([10.0, 5.0, 2.5, 1.2, 0.6], abs=0.06)
    assert min(down.speeds) >= 0.0


def test_draws_are_the_next_ones_and_none_twice() -> None:
    """At the largest wind the most and the least of each quantity come first: what fails at all fails there."""
    direction = Direction(20.0, 0.99, normal_numbers(2, 1))
    fly(direction, 45, lambda *_: frozenset())
    assert direction.draws[:18] == list(range(18))
    numbers = direction.numbers.first(2000)
    extreme = {int(pick(numbers[:, k])) for k in (0, 1) for pick in (np.argmin, np.argmax)}
    assert set(direction.draws[18:22]) == extreme
    assert direction.draws[22:] == [k for k in range(18, 60) if k not in extreme][:23]


def test_flights_are_put_in_the_tail() -> None:
    """About the boundary, where few are expected to fail, and not above what is looked at."""
    direction, random = Direction(14.0, 0.99, no_numbers()), np.random.default_rng(1)
    fly(direction, 300, above(lambda: random.normal(12.0, 1.0)))
    assert min(direction.speeds) >= 0.0
    assert max(direction.speeds) <= 14.0
    late = np.array(direction.speeds[-150:])
    assert 0.0005 < norm(12.0, 1.0).cdf(np.median(late)) < 0.1


def test_draws_that_tell_are_chosen_and_every_third_is_not() -> None:
    """Of two quantities the first decides: flights are flown with much of it, in wind that only they fail in."""
    direction, random = Direction(20.0, 0.99, normal_numbers(2, 3)), np.random.default_rng(2)

    def outcome(speed: float, drawn: np.ndarray) -> frozenset[str]:
        return frozenset({"slope"}) if random.normal() < -4.0 + 0.5 * (speed - 10.0) + 2.0 * drawn[0] else frozenset()

    fly(direction, 240, outcome)
    numbers = np.abs(direction.numbers.first(5000)[direction.draws])
    chosen, plain = numbers[[k for k in range(60, 240) if k % 3]], numbers[60::3]
    assert chosen[:, 0].mean() > 1.1
    assert plain[:, 0].mean() == pytest.approx(0.8, abs=0.2)
    assert len(set(direction.draws)) == 240
    # The next of all that were not flown.
    assert sorted(direction.draws)[:60] == list(range(60))


def test_what_is_chosen_tells_more_than_what_comes() -> None:
    """As many flights at the boundary itself, with whatever is drawn, leave its interval twice as wide."""
    random = np.random.default_rng(4)

    def outcome(speed: float, drawn: np.ndarray) -> frozenset[str]:
        return frozenset({"slope"}) if random.normal() < -4.0 + 0.5 * (speed - 10.0) + 2.0 * drawn[0] else frozenset()

    chosen, plain = (Direction(20.0, 0.99, normal_numbers(4, 3)) for _ in range(2))
    fly(chosen, 300, outcome)
    # 10 + (4 + 2.236 z) / 0.5, where Phi(z) is 0.01.
    truth = 10.0 + (4.0 + np.sqrt(5.0) * norm.ppf(0.01)) / 0.5
    for draw in range(300):
        plain.add(truth + (draw % 3), draw, outcome(truth + (draw % 3), plain.numbers.first(draw + 1)[draw]))
    assert chosen.boundary().low < truth < chosen.boundary().high
    assert chosen.boundary().estimate == pytest.approx(truth, abs=0.6)
    assert plain.boundary().width > 1.5 * chosen.boundary().width
