"""Where the boundary is said to lie, against plain sums over coefficients that are drawn from the same posterior."""

import numpy as np
import pytest
from scipy.stats import norm

from planfly.campaigns.statistics.boundary_posterior import WeighedModes, boundary_quantiles
from planfly.campaigns.statistics.failure_mode import FailureMode
from planfly.campaigns.statistics.links import LEAST_OF_MANY, LINKS, PROBIT, BinaryLink

NOTHING = np.zeros((1, 0))
PARTS = (0.025, 0.5, 0.975)


def one_mode(mean: list[float], deviations: list[float], link: BinaryLink = PROBIT) -> WeighedModes:
    return WeighedModes((FailureMode(link, np.array(mean), np.diag(deviations) ** 2, 0.0),), 1.0)


@pytest.mark.parametrize("link", LINKS)
def test_quantiles_are_those_of_boundaries_that_are_drawn(link: BinaryLink) -> None:
    """Of a constant and a wind's coefficient, from 10 m/s on: boundary = 10 + (limit - a) / b."""
    limit = norm.ppf(0.01) if link is PROBIT else np.log(-np.log(0.99))
    random = np.random.default_rng(1)
    a, b = random.normal(-4.0, 0.4, 200_000), random.normal(0.6, 0.08, 200_000)
    expected = np.quantile(10.0 + (limit - a) / b, PARTS)
    found = boundary_quantiles([one_mode([-4.0, 0.6], [0.4, 0.08], link)], NOTHING, 0.01, 20.0, PARTS)
    assert found == pytest.approx(expected, abs=0.03)


def test_links_weigh_as_they_do() -> None:
    sure, other = one_mode([-4.0, 1.0], [1e-3, 1e-3]), one_mode([-2.0, 1.0], [1e-3, 1e-3], LEAST_OF_MANY)
    first, second = 14.0 + norm.ppf(0.01), 12.0 + np.log(-np.log(0.99))
    for weight, expected in ((0.6, first), (0.4, second)):
        mixed = [WeighedModes(sure.modes, weight), WeighedModes(other.modes, 1.0 - weight)]
        assert boundary_quantiles(mixed, NOTHING, 0.01, 20.0, (0.5,)) == pytest.approx([expected], abs=0.01)


def test_draws_spread_the_share_that_fails() -> None:
    draws = norm.ppf((np.arange(4096)[:, None] + 0.5) / 4096)
    found = boundary_quantiles([one_mode([-1.0, 0.5, 1.0], [1e-3] * 3)], draws, 0.01, 20.0, (0.5,))
    assert found == pytest.approx([12.0 + np.sqrt(2.0) * norm.ppf(0.01) / 0.5], abs=0.02)


def test_what_lies_beyond_is_the_largest_wind_and_what_never_flies_none() -> None:
    assert boundary_quantiles([one_mode([-9.0, 0.3], [0.1, 0.01])], NOTHING, 0.01, 20.0, PARTS) == [20.0] * 3
    assert boundary_quantiles([one_mode([9.0, 0.3], [0.1, 0.01])], NOTHING, 0.01, 20.0, PARTS) == [0.0] * 3


def test_in_more_wind_no_fewer_fail() -> None:
    """Of a coefficient that may be of either sign: what is known of 8 m/s is not forgotten in less.

    More than one in a hundred fail with probability Phi((at - limit) / deviation), by plain sums: in no wind in one of
    nine cases, in 8 m/s in none.
    """
    limit = norm.ppf(0.01)
    assert norm.cdf((-6.0 - limit) / np.hypot(0.3, 3.0)) > 0.1
    assert norm.cdf((-5.2 - limit) / np.hypot(0.3, 0.6)) < 1e-4
    mode = [one_mode([-5.0, 0.1], [0.3, 0.3])]
    assert boundary_quantiles(mode, NOTHING, 0.01, 8.0, (0.02, 0.05, 0.1)) == [8.0] * 3


def test_nor_does_more_wind_bring_doubt() -> None:
    """In 12 m/s more than one in a hundred fail for sure; of 20 m/s a line that may fall is not as sure."""
    limit = norm.ppf(0.01)
    assert norm.cdf((-1.4 - limit) / np.hypot(0.1, 0.2)) > 0.9999
    assert norm.cdf((-1.0 - limit) / np.hypot(0.1, 1.0)) < 0.92
    mode = [one_mode([-1.5, 0.05], [0.1, 0.1])]
    (high,) = boundary_quantiles(mode, NOTHING, 0.01, 40.0, (0.99,))
    assert high < 12.0
