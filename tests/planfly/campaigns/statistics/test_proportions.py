"""Intervals of a fixed number of flights: against sums of binomial terms, and the table that go/no-go rests on."""

import math

import numpy as np
import pytest
from scipy.stats import beta, binom

from planfly.campaigns.statistics.proportions import Tally, clopper_pearson, lower_bound, upper_bound, wilson


@pytest.mark.parametrize(("target", "flights"), [(0.95, 59), (0.99, 299), (0.999, 2995)])
def test_flights_without_failure_that_reach_a_target(target: float, flights: int) -> None:
    # P^n = 0.05, by hand.
    assert flights == math.ceil(math.log(0.05) / math.log(target))
    assert lower_bound(Tally(flights, 0)) >= target > lower_bound(Tally(flights - 1, 0))


@pytest.mark.parametrize(("failures", "flights"), [(1, 473), (3, 773), (5, 1049), (10, 1693)])
def test_flights_with_failures_that_reach_99_percent(failures: int, flights: int) -> None:
    assert lower_bound(Tally(flights - failures, failures)) >= 0.99
    assert lower_bound(Tally(flights - 1 - failures, failures)) < 0.99
    # At P = 0.99 so few failures happen with a probability of 5 % or less.
    assert binom.cdf(failures, flights, 0.01) <= 0.05 < binom.cdf(failures, flights - 1, 0.01)


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (3, 10), (10, 10), (297, 299)])
def test_clopper_pearson_and_wilson_equal_their_formulas(successes: int, trials: int) -> None:
    low, high = clopper_pearson(successes, trials)
    assert low == pytest.approx(beta.ppf(0.025, successes, trials - successes + 1) if successes else 0.0)
    assert high == pytest.approx(beta.ppf(0.975, successes + 1, trials - successes) if successes < trials else 1.0)
    z, share = 1.959963984540054, successes / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials**2))
    assert wilson(successes, trials) == pytest.approx((middle - half, middle + half), abs=1e-12)


@pytest.mark.parametrize(("p", "flights"), [(0.5, 200), (0.9, 400), (0.99, 3000), (0.999, 30000)])
def test_the_interval_covers_as_it_says(p: float, flights: int) -> None:
    """1,000 campaigns, and exactly: the sum of the binomial terms whose interval contains p."""
    drawn = np.random.default_rng(1).binomial(flights, p, 1000)
    inside = {k: low <= p <= high for k in set(drawn.tolist()) for low, high in [clopper_pearson(k, flights)]}
    covered = np.mean([inside[k] for k in drawn.tolist()])
    assert 0.95 <= covered <= 0.99
    spread = 8.0 * math.sqrt(flights * p * (1.0 - p))
    terms = range(max(0, int(flights * p - spread)), min(flights, int(flights * p + spread)) + 1)
    exact = sum(binom.pmf(k, flights, p) for k in terms if (ends := clopper_pearson(k, flights)).low <= p <= ends.high)
    assert 0.95 <= exact <= 0.99


def test_lost_flights_count_against_both_ways() -> None:
    tally = Tally(90, 4, 6)
    assert tally.flown == 100
    assert lower_bound(tally) == lower_bound(Tally(90, 10))
    assert upper_bound(tally) == upper_bound(Tally(96, 4))


def test_nothing_flown_says_nothing() -> None:
    assert (lower_bound(Tally(0, 0)), upper_bound(Tally(0, 0))) == (0.0, 1.0)
    assert clopper_pearson(0, 0) == (0.0, 1.0)
    assert math.isnan(Tally(0, 0).share)
