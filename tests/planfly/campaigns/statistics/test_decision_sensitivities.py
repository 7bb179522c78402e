"""The given-data sensitivities, against functions whose indices are known."""

import numpy as np
import pytest

from planfly.campaigns.statistics.decision import (
    MIN_FLIGHTS_FOR_INDEX,
    dependence_p_value,
    first_order_index,
    rank_slope,
)


def ishigami(x: np.ndarray) -> np.ndarray:
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def exact_first_order() -> tuple[float, float, float]:
    """Ishigami and Homma (1990), a = 7, b = 0.1: from the integrals, by hand."""
    a, b, pi = 7.0, 0.1, np.pi
    first = 0.5 * (1.0 + b * pi**4 / 5.0) ** 2
    second = a**2 / 8.0
    both = b**2 * pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = first + second + both
    return first / whole, second / whole, 0.0


# Largest probability by chance with which one of eight quantities is named: 5 % for the campaign.
MOST_OF_EIGHT = 0.05 / 8


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [1000, 8000])
def test_ishigami_within_a_twentieth(seed: int, count: int) -> None:
    x = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 3))
    y = ishigami(x)
    # Of a thousand the estimate itself scatters: its standard error is a fiftieth.
    most = 0.05 if count == 8000 else 0.08
    for k, exact in enumerate(exact_first_order()):
        assert first_order_index(x[:, k], y) == pytest.approx(exact, abs=most)


def test_what_does_nothing_comes_to_nothing() -> None:
    random = np.random.default_rng(3)
    found = [first_order_index(random.random(300), random.random(300)) for _ in range(200)]
    # Without the correction it would be groups / flights, 13 / 300.
    assert np.mean(found) < 0.02


def test_too_few_or_nothing_that_varies_says_nothing() -> None:
    x = np.linspace(0.0, 1.0, MIN_FLIGHTS_FOR_INDEX)
    assert first_order_index(x, x) > 0.9
    assert first_order_index(x[1:], x[1:]) == 0.0
    assert first_order_index(x, np.ones(x.size)) == 0.0
    assert first_order_index(np.ones(x.size), x) == 0.0


def test_rank_slope_says_which_way() -> None:
    x = np.linspace(0.0, 1.0, 50)
    assert rank_slope(x, np.exp(x)) == 1.0
    assert rank_slope(x, -x) == -1.0
    assert rank_slope(x, np.ones(50)) == 0.0


def test_chance_is_as_rare_as_it_says() -> None:
    """Of 500 pairs that do not depend on each other 5 % are below 0.05, at most; the deviation is 1 %."""
    random = np.random.default_rng(4)
    found = np.array([dependence_p_value(*random.random((2, 40))) for _ in range(500)])
    assert 0.02 < np.mean(found < 0.05) < 0.08


@pytest.mark.parametrize("has_ties", [False, True])
def test_the_fewest_flights_name_nothing_that_has_no_effect(has_ties: bool) -> None:
    """Of 100 campaigns of eight quantities without effect 5 name one, at most; the deviation is 2.2.

    Half of the margins are equal if flights failed by an unknown margin.
    """
    random = np.random.default_rng(5)
    alarms = 0
    for _ in range(100):
        margins = random.standard_normal(MIN_FLIGHTS_FOR_INDEX)
        margins = np.maximum(margins, 0.0) if has_ties else margins
        quantities = random.random((8, MIN_FLIGHTS_FOR_INDEX))
        alarms += min(dependence_p_value(values, margins) for values in quantities) <= MOST_OF_EIGHT
    assert alarms <= 11


def test_the_fewest_flights_name_what_explains_most_of_a_margin() -> None:
    """20 flights suffice to name a quantity that explains 70 % of the variance, in 9 of 10 campaigns."""
    assert MIN_FLIGHTS_FOR_INDEX == 20
    random = np.random.default_rng(6)
    named = 0
    for _ in range(200):
        values, others = random.standard_normal((2, MIN_FLIGHTS_FOR_INDEX))
        named += dependence_p_value(values, np.sqrt(0.7) * values + np.sqrt(0.3) * others) <= MOST_OF_EIGHT
    assert named >= 180


def test_a_rise_and_a_valley_are_no_chance() -> None:
    """Spearman finds the rise in 40 values, and the groups find the valley, whose rank correlation is 0."""
    x = np.linspace(-1.0, 1.0, 40)
    assert dependence_p_value(x, x) < 1e-6
    assert dependence_p_value(x, x**2) < 1e-3
    assert dependence_p_value(x[:19], x[:19]) == 1.0
    assert dependence_p_value(x, np.ones(40)) == 1.0
