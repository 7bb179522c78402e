"""Which flights are chosen: by bisection first, then in the tail, by draws that tell."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from planfly.campaigns.statistics.censored_regression import PROBIT
from planfly.campaigns.statistics.failure_modes import FailureMode
from planfly.campaigns.statistics.wind_boundary import (
    Direction,
    FailureFit,
    _expected_between_fit_reductions,
    _ExpectedPosterior,
    next_flights,
)
from tests.planfly.campaigns.statistics.made_directions import above, fly, no_numbers, normal_numbers
from tests.soak import scaled


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
    numbers = direction.numbers.first_draws(2000)
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

    fly(direction, 240, outcome, together=12)
    numbers = np.abs(direction.numbers.first_draws(5000)[direction.draws])
    chosen, plain = numbers[[k for k in range(60, 240) if k % 3]], numbers[60::3]
    assert chosen[:, 0].mean() > 1.1
    assert plain[:, 0].mean() == pytest.approx(0.8, abs=0.2)
    assert len(set(direction.draws)) == 240
    # The next of all that were not flown.
    assert sorted(direction.draws)[:60] == list(range(60))


def fit_of(*betas: list[float], weight: float = 1.0, speed: float = 12.0) -> FailureFit:
    """A fit of modes by probit, each with its own covariance and slopes."""
    random = np.random.default_rng(7)
    modes, slopes = [], []
    for beta in betas:
        root = 0.3 * random.normal(size=(len(beta), len(beta)))
        mean = np.array(beta)
        modes.append(FailureMode(PROBIT, mean, root @ root.T + 0.05 * np.eye(len(beta)), mean[None].copy, 0.0))
        slopes.append(random.normal(size=len(beta)))
    return FailureFit(tuple(modes), weight, speed, slopes)


ROWS = np.array([[1.0, 2.0, 0.5], [1.0, -3.0, 2.0], [1.0, 4.0, -1.0]])


def told_of(fit: FailureFit, row: np.ndarray) -> list[float]:
    """Fisher's information of each mode, of a flight that tells of it if it did not fail by those before."""
    out, reaches = [], 1.0
    for mode in fit.modes:
        x = float(row @ mode.mean)
        out.append(reaches * norm.pdf(x) ** 2 / (norm.cdf(x) * norm.sf(x)))
        reaches *= norm.sf(x)
    return out


def test_a_flight_gains_what_it_takes_from_the_boundarys_variance() -> None:
    """By the posterior's precision with the flight's information added, inverted: of three modes, one after another."""
    fit = fit_of([-1.0, 0.4, 0.8], [-2.0, 0.3, -0.5], [-0.5, 0.2, 0.1], weight=0.7)
    belief, known = _ExpectedPosterior(fit), [mode.covariance for mode in fit.modes]
    for _ in range(2):
        gains, after = belief.expected_gains(ROWS), []
        for k, row in enumerate(ROWS):
            changed = [
                np.linalg.inv(np.linalg.inv(one) + told * np.outer(row, row))
                for one, told in zip(known, told_of(fit, row), strict=True)
            ]
            lost = sum(s @ (one - new) @ s for s, one, new in zip(fit.slopes, known, changed, strict=True))
            assert gains[k] == pytest.approx(0.7 * lost, rel=1e-6)
            after.append(changed)
        # The same once more, after the second was flown.
        belief.include_flight(ROWS[1])
        known = after[1]


def test_a_flight_that_surely_fails_by_one_way_tells_nothing_of_the_next() -> None:
    alone, behind = fit_of([-1.0, 0.4, 0.8]), fit_of([9.0, 0.0, 0.0], [-1.0, 0.4, 0.8])
    behind = replace(behind, modes=(behind.modes[0], alone.modes[0]), slopes=[np.zeros(3), alone.slopes[0]])
    assert (_ExpectedPosterior(alone).expected_gains(ROWS) > 1e-3).all()
    assert (_ExpectedPosterior(behind).expected_gains(ROWS) < 1e-12).all()


def test_what_tells_between_fits_is_what_their_boundaries_are_apart() -> None:
    """By enumeration: the boundary's variance between fits, less what is expected of it once the outcome is known."""
    fits = (fit_of([-1.0, 0.4, 0.8], weight=0.3, speed=11.0), fit_of([-2.0, 0.9, 0.1], weight=0.7, speed=13.0))
    weights, speeds = np.array([0.3, 0.7]), np.array([11.0, 13.0])

    def variance(of: np.ndarray) -> float:
        return float(of @ speeds**2 - (of @ speeds) ** 2)

    for row, gain in zip(ROWS, _expected_between_fit_reductions(fits, ROWS), strict=True):
        fails = np.array([norm.cdf(row @ fit.modes[0].mean) for fit in fits])
        expected = variance(weights)
        for chance in (fails, 1.0 - fails):
            evidence = float(weights @ chance)
            expected -= evidence * variance(weights * chance / evidence)
        assert gain == pytest.approx(expected, rel=1e-6)
        assert gain > 1e-4


def test_what_is_chosen_tells_more_than_what_comes() -> None:
    """As many flights at and above the boundary, with whatever is drawn, leave its interval half as wide again."""
    random = np.random.default_rng(4)

    def outcome(speed: float, drawn: np.ndarray) -> frozenset[str]:
        return frozenset({"slope"}) if random.normal() < -4.0 + 0.5 * (speed - 10.0) + 2.0 * drawn[0] else frozenset()

    chosen, plain = (Direction(20.0, 0.99, normal_numbers(4, 3)) for _ in range(2))
    flights = scaled(300, 150)
    fly(chosen, flights, outcome, together=10)
    # 10 + (4 + 2.236 z) / 0.5, where Phi(z) is 0.01.
    truth = 10.0 + (4.0 + np.sqrt(5.0) * norm.ppf(0.01)) / 0.5
    for draw in range(flights):
        plain.add(truth + (draw % 3), draw, outcome(truth + (draw % 3), plain.numbers.first_draws(draw + 1)[draw]))
    assert chosen.boundary().low < truth < chosen.boundary().high
    assert chosen.boundary().estimate == pytest.approx(truth, abs=0.6)
    assert plain.boundary().width > 1.5 * chosen.boundary().width
