"""Differences of two probabilities: of the literature, and with the confidence that they state."""

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import binom, multinomial

from planfly.campaigns.statistics.proportions import independent_difference, paired_difference


def test_the_paired_interval_is_that_of_agresti_and_min() -> None:
    """Approval of 1,600 persons, of whom 150 changed from yes to no and 86 from no to yes: 0.021 to 0.059.

    Agresti and Min, "Simple improved confidence intervals for comparing matched proportions", Statistics in Medicine
    24, 2005.
    """
    value, (low, high), p_value = paired_difference(86, 150, 1600)
    assert value == pytest.approx(0.04)
    assert (round(low, 3), round(high, 3)) == (0.021, 0.059)
    # Exact McNemar: twice the tail of 236 fair throws.
    assert p_value == pytest.approx(2.0 * binom.cdf(86, 236, 0.5))


@pytest.mark.parametrize("edge", [0, 1])
def test_the_score_test_rejects_just_beyond_the_bound(edge: int) -> None:
    """The bound is where the constrained maximum of the likelihood makes the score 1.96."""
    only_first, only_second, pairs = 2, 12, 50
    bound = paired_difference(only_first, only_second, pairs).interval[edge]

    def loss(probability: float) -> float:
        terms = (only_first, probability), (only_second, probability + bound)
        rest = pairs - only_first - only_second, 1.0 - 2.0 * probability - bound
        return -sum(count * np.log(max(share, 1e-300)) for count, share in (*terms, rest))

    found = minimize_scalar(loss, bounds=(max(0.0, -bound), 0.5 * (1.0 - bound)), options={"xatol": 1e-12}).x
    deviation = np.sqrt(pairs * (2.0 * found + bound * (1.0 - bound)))
    assert abs(only_second - only_first - pairs * bound) / deviation == pytest.approx(1.959964, abs=1e-4)


def test_paired_intervals_hold_as_often_as_they_say() -> None:
    """Of all outcomes of 30 pairs, weighted by their probability: 95 % within 2 %, for some true differences."""
    pairs = 30
    for first_only, second_only in ((0.1, 0.1), (0.05, 0.2), (0.02, 0.1), (0.3, 0.1)):
        coverage = 0.0
        for b, c in itertools.product(range(pairs + 1), repeat=2):
            if b + c <= pairs:
                shares = [first_only, second_only, 1.0 - first_only - second_only]
                chance = multinomial.pmf([b, c, pairs - b - c], pairs, shares)
                if chance > 1e-7:
                    low, high = paired_difference(b, c, pairs).interval
                    coverage += chance * (low <= second_only - first_only <= high)
        assert 0.93 < coverage < 0.98


def test_a_difference_of_equal_outcomes_is_none() -> None:
    value, (low, high), p_value = paired_difference(0, 0, 300)
    assert (value, p_value) == (0.0, 1.0)
    assert -0.02 < low < 0.0 < high < 0.02
    assert paired_difference(0, 5, 5).interval.high == 1.0


def test_the_interval_of_two_samples_is_that_of_newcombe() -> None:
    """56 of 70 and 48 of 80: 0.0524 to 0.3339 (Newcombe, Statistics in Medicine 17, 1998, table II, method 10)."""
    value, (low, high), p_value = independent_difference((48, 80), (56, 70))
    assert value == pytest.approx(0.2)
    assert (round(low, 4), round(high, 4)) == (0.0524, 0.3339)
    assert 0.005 < p_value < 0.02
