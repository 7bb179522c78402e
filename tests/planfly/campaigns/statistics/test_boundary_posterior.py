"""Where the boundary is said to lie, against plain sums over the samples of what the coefficients may be."""

import numpy as np
import pytest
from scipy.stats import norm

from planfly.campaigns.statistics.boundary_posterior import WeighedModes, boundary_quantiles
from planfly.campaigns.statistics.failure_mode import FailureMode
from planfly.campaigns.statistics.links import CLOGLOG, LINKS, PROBIT, BinaryLink

NOTHING = np.zeros((1, 0))
PARTS = (0.025, 0.5, 0.975)


def one_mode(mean: list[float], deviations: list[float], link: BinaryLink = PROBIT, count: int = 4096) -> FailureMode:
    """Coefficients that are normal and independent; the wind's from 10 m/s on."""
    sample = np.random.default_rng(1).normal(mean, deviations, size=(count, len(mean)))
    return FailureMode(link, np.array(mean), np.diag(deviations) ** 2, sample, 0.0)


def alone(mode: FailureMode) -> list[WeighedModes]:
    return [WeighedModes((mode,), 1.0)]


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize(("share", "most"), [(0.01, 20.0), (0.2, 40.0), (1e-4, 10.0)])
def test_quantiles_are_those_of_the_samples_boundaries(link: BinaryLink, share: float, most: float) -> None:
    """Of a constant and a wind's coefficient, from 10 m/s on: boundary = 10 + (limit - a) / b."""
    limit = norm.ppf(share) if link is PROBIT else np.log(-np.log(1.0 - share))
    mode = one_mode([-4.0, 0.6], [0.4, 0.08], link)
    a, b = mode.sample.T
    expected = np.quantile(np.clip(10.0 + (limit - a) / b, 0.0, most), PARTS)
    assert boundary_quantiles(alone(mode), NOTHING, share, most, PARTS) == pytest.approx(expected, abs=0.02)


def test_links_weigh_as_they_do() -> None:
    sure, other = one_mode([-4.0, 1.0], [1e-3, 1e-3]), one_mode([-2.0, 1.0], [1e-3, 1e-3], CLOGLOG, 64)
    first, second = 14.0 + norm.ppf(0.01), 12.0 + np.log(-np.log(0.99))
    for weight, expected in ((0.6, first), (0.4, second)):
        mixed = [WeighedModes((sure,), weight), WeighedModes((other,), 1.0 - weight)]
        assert boundary_quantiles(mixed, NOTHING, 0.01, 20.0, (0.5,)) == pytest.approx([expected], abs=0.01)


@pytest.mark.parametrize(("at_10", "by_wind", "by_draw"), [(-4.0, 0.5, 1.0), (-20.0, 3.0, 8.0), (-3.0, 0.1, 0.5)])
def test_draws_spread_the_share_that_fails(at_10: float, by_wind: float, by_draw: float) -> None:
    """By a normal draw on a normal law: both together are normal.  Also where draws decide nearly all of it."""
    draws = norm.ppf((np.random.default_rng(2).permutation(4096)[:, None] + 0.5) / 4096)
    mode = one_mode([at_10, by_wind, by_draw], [1e-6] * 3, count=64)
    found = boundary_quantiles(alone(mode), draws, 0.01, 20.0, (0.5,))
    expected = 10.0 + (np.hypot(1.0, by_draw) * norm.ppf(0.01) - at_10) / by_wind
    assert 5.0 < expected < 20.0
    assert found == pytest.approx([expected], abs=0.01)


def test_modes_are_known_apart_from_each_other() -> None:
    """Two ways that are alike, each as little known: what the least is known of, by plain sums over both samples.

    Samples that went together would have both ways' luck at once, and the interval wider by a fifth.
    """
    mode = one_mode([-4.0, 0.6], [0.4, 1e-6])
    two = [WeighedModes((mode, mode), 1.0)]
    random = np.random.default_rng(3)
    one, other = random.normal(-4.0, 0.4, (2, 4096))
    winds = np.arange(4.0, 20.0, 0.02)[:, None]
    fails = 1.0 - norm.sf(one + 0.6 * (winds - 10.0)) * norm.sf(other + 0.6 * (winds - 10.0))
    expected = np.quantile(winds[(fails < 0.01).sum(axis=0), 0], PARTS)
    assert boundary_quantiles(two, NOTHING, 0.01, 20.0, PARTS) == pytest.approx(expected, abs=0.08)


def test_what_lies_beyond_is_the_largest_wind_and_what_never_flies_none() -> None:
    assert boundary_quantiles(alone(one_mode([-9.0, 0.3], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [20.0] * 3
    assert boundary_quantiles(alone(one_mode([9.0, 0.3], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [0.0] * 3
    # In no wind that can be told from none; and in all, however steep.
    assert boundary_quantiles(alone(one_mode([-900.0, 0.3], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [20.0] * 3
    assert boundary_quantiles(alone(one_mode([900.0, 40.0], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [0.0] * 3


@pytest.mark.parametrize("by_wind", [0.02, 20.0, 60.0])
def test_flat_and_steep_laws_are_met_where_they_are(by_wind: float) -> None:
    """Laws that go from few to most within a few metres a second that are far apart, or within a tenth."""
    found = boundary_quantiles(alone(one_mode([-2.4, by_wind], [1e-6, 1e-6])), NOTHING, 0.01, 20.0, (0.5,))
    assert found == pytest.approx([10.0 + (2.4 + norm.ppf(0.01)) / by_wind], abs=0.02)
