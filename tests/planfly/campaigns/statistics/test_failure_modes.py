"""The laws of one wind at which flights begin to fail, against scipy's, and what they say of few flights."""

from collections.abc import Hashable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.censored_regression import LINKS, PROBIT, BinaryLink, Outcomes, fit_regression
from planfly.campaigns.statistics.failure_modes import (
    FailureMode,
    FailureWindDistributions,
    boundary_slopes,
    boundary_speed,
    failure_fraction,
    fit_mode,
    fit_modes,
    make_regressors,
)
from world.arrays import Floats

PARTS = np.array([0.025, 0.5, 0.975])


@pytest.mark.parametrize("speed", [6.0, 12.0, 19.0])
def test_the_laws_are_scipys(speed: float) -> None:
    """Means, spreads, probabilities and quantiles of both."""
    laws = FailureWindDistributions.on_grid(20.0)
    fails, flies = laws.log_probabilities(speed)
    assert laws.location.size == 2 * laws.normal_count
    for k in range(0, laws.normal_count, 997):
        mean, spread = laws.location[k], laws.scale[k]
        assert fails[k] == pytest.approx(norm(mean, spread).logcdf(speed), rel=1e-9)
        assert laws.quantile(0.01)[k] == pytest.approx(norm(mean, spread).ppf(0.01))
        gumbel = gumbel_l(laws.location[k + laws.normal_count], laws.scale[k + laws.normal_count])
        assert gumbel.stats() == pytest.approx((mean, spread**2))
        assert flies[k + laws.normal_count] == pytest.approx(gumbel.logsf(speed), rel=1e-9)
        assert laws.quantile(0.01)[k + laws.normal_count] == pytest.approx(gumbel.ppf(0.01))


def test_a_law_that_flights_follow_is_found() -> None:
    law = norm(9.0, 1.0)
    speeds = np.repeat(np.arange(4.0, 14.0, 0.5), 100)
    flew = speeds < law.rvs(speeds.size, random_state=np.random.default_rng(2))
    low, middle, high = FailureWindDistributions.on_grid(20.0).posterior_quantiles(0.1, speeds, flew, PARTS)
    assert low < law.ppf(0.1) < high
    assert middle == pytest.approx(law.ppf(0.1), abs=0.25)


def test_the_more_flew_the_further_the_boundary() -> None:
    laws = FailureWindDistributions.on_grid(20.0)
    few, many = (laws.posterior_quantiles(0.01, np.full(n, 20.0), np.full(n, True), PARTS) for n in (10, 300))
    assert (many > few).all()
    # 299 of 299 show a share of 1 % with 95 % confidence: by any law the boundary is beyond, or as good as.
    assert many[0] > 19.5


# ----------------------------------------------------------------------
# Whether by how little flights passed is taken to tell of failing.


def made(count: int, seed: int, *, one_law: bool) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Terms, who failed and by how much the others passed.

    One law: a flight fails where its margin is below 0.  Two: it fails by its first draw, in a wind that suffices, and
    the others' margin is what gusts leave of it, which no failing follows from.
    """
    random = np.random.default_rng(seed)
    terms = np.column_stack((np.ones(count), random.uniform(-4.0, 4.0, count), random.normal(size=(count, 2))))
    wind, first, gust = terms[:, 1], terms[:, 2], random.normal(size=count)
    if one_law:
        margin = 0.6 * (2.0 - 0.4 * wind - 0.8 * first + gust)
        return terms, margin < 0.0, margin.clip(0.0, 1.0)
    margin = np.abs(0.8 + 0.2 * gust)
    return terms, first + 0.2 * gust > 2.0 - 0.2 * wind, margin.clip(0.0, 1.0)


@pytest.mark.parametrize("seed", range(5))
def test_margins_count_where_failing_is_of_its_law(seed: int) -> None:
    """By a normal law as the flights were made: 1/0.6 of the margin, and 0.4 and 0.8 of the wind and the first draw."""
    mode = fit_mode(*made(400, seed, one_law=True), PROBIT)
    assert mode.margin_coefficient == pytest.approx(1.0 / 0.6, rel=0.25)
    assert mode.mean == pytest.approx([-2.0, 0.4, 0.8, 0.0], abs=0.4)


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("seed", range(5))
def test_margins_count_for_nothing_where_failing_is_of_another(link: BinaryLink, seed: int) -> None:
    """One law would have the first draw, which alone decides, as of little account: it leaves the margin as it is."""
    terms, failed, margin = made(400, seed, one_law=False)
    mode, bare = fit_mode(terms, failed, margin, link), fit_mode(terms, failed, np.zeros(400), link)
    assert mode.margin_coefficient == 0.0
    assert mode.mean == pytest.approx(bare.mean)
    assert mode.mean[2] > 2.0


def test_the_margins_own_law_says_nothing_for_a_link() -> None:
    """The links differ in evidence by as much as without the margin: to each comes that of the margin's own law."""
    terms, failed, margin = made(400, 1, one_law=False)
    told, bare = (
        [fit_mode(terms, failed, some, link).log_evidence for link in LINKS] for some in (margin, np.zeros(400))
    )
    assert told[0] - told[1] == pytest.approx(bare[0] - bare[1])
    passes = Outcomes(terms, failed, np.where(failed, 0.0, margin)).margins_given_pass()
    by_itself = max(fit_regression(passes, link).log_evidence for link in LINKS)
    assert told[0] == pytest.approx(bare[0] + by_itself)


def test_the_depth_of_failing_counts_for_nothing() -> None:
    terms, failed, margin = made(400, 1, one_law=True)
    deep = np.where(failed, 0.5, margin)
    assert fit_mode(terms, failed, deep, PROBIT).mean == pytest.approx(fit_mode(terms, failed, margin, PROBIT).mean)


# ----------------------------------------------------------------------
# The ways of failing that are fitted, against made flights whose coefficients are known.

FIRST, SECOND = np.array([-1.0, 0.6, 1.5, 0.0]), np.array([-1.5, 0.3, -1.0, 0.5])


def made_flights(count: int, seed: int, link: BinaryLink = PROBIT) -> tuple[np.ndarray, list[frozenset[Hashable]]]:
    """Flights that fail by slope, by threat, by both or not at all, whatever the other does."""
    random = np.random.default_rng(seed)
    terms = make_regressors(random.uniform(2.0, 18.0, count), random.normal(size=(count, 2)))
    ways: list[set[Hashable]] = [set() for _ in range(count)]
    for name, beta in (("slope", FIRST), ("threat", SECOND)):
        for k in np.flatnonzero(np.log(random.random(count)) < link.log_cdf(terms @ beta)):
            ways[k].add(name)
    return terms, [frozenset(some) for some in ways]


@pytest.mark.parametrize("link", LINKS)
def test_coefficients_are_found(link: BinaryLink) -> None:
    """Ways that do not depend on each other: the second's are the same among those that did not fail by the first."""
    terms, ways = made_flights(20_000, 1, link)
    modes = fit_modes(terms, ways, link)
    assert len(modes) == 2
    for mode, beta in zip(modes, (FIRST, SECOND), strict=True):
        deviations = np.sqrt(np.diag(mode.covariance))
        assert mode.mean == pytest.approx(beta, abs=0.15)
        assert (np.abs(mode.mean - beta) < 4.0 * deviations).all()
        assert deviations.max() < 0.1


def test_each_way_has_the_margin_that_flights_had_of_it() -> None:
    """Room of the slope, of the slope's law, sharpens the slope's fit and leaves the threat's; another's, neither."""
    random = np.random.default_rng(2)
    terms = make_regressors(random.uniform(2.0, 18.0, 600), random.normal(size=(600, 2)))
    slope, threat = (random.normal(size=600) - terms @ beta for beta in (FIRST, SECOND))
    ways: list[frozenset[Hashable]] = [
        frozenset(name for name, margin in (("slope", one), ("threat", other)) if margin < 0.0)
        for one, other in zip(slope, threat, strict=True)
    ]
    shares: list[dict[Hashable, float]] = [{} if margin < 0.0 else {"slope": min(1.0, margin)} for margin in slope]
    bare, known = fit_modes(terms, ways, PROBIT), fit_modes(terms, ways, PROBIT, shares)
    assert [mode.margin_coefficient > 0.0 for mode in known] == [True, False]
    assert np.diag(known[0].covariance).sum() < 0.8 * np.diag(bare[0].covariance).sum()
    assert known[1].mean == pytest.approx(bare[1].mean)
    other: list[dict[Hashable, float]] = [{"bounds": 0.5}] * len(ways)
    for one, same in zip(fit_modes(terms, ways, PROBIT), fit_modes(terms, ways, PROBIT, other), strict=True):
        assert one.mean == pytest.approx(same.mean)


def test_a_margin_that_is_not_known_is_not_taken_for_much() -> None:
    """A flight that passed by a scale or more tells that; one of which it is not known, that it passed."""
    random = np.random.default_rng(4)
    terms = make_regressors(random.uniform(2.0, 18.0, 1500), random.normal(size=(1500, 2)))
    slope = 0.5 * (random.normal(size=1500) - terms @ FIRST)
    ways: list[frozenset[Hashable]] = [frozenset({"slope"} if margin < 0.0 else ()) for margin in slope]
    shares: list[dict[Hashable, float] | None] = [{"slope": margin} if 0.0 <= margin < 1.0 else {} for margin in slope]
    half: list[dict[Hashable, float] | None] = [some if k % 2 else None for k, some in enumerate(shares)]
    for known in (shares, half):
        (mode,) = fit_modes(terms, ways, PROBIT, known)
        assert mode.margin_coefficient == pytest.approx(2.0, rel=0.15)
        assert mode.mean == pytest.approx(FIRST, abs=0.2)


def test_the_way_in_which_most_failed_comes_first() -> None:
    """One that came only with another has no flights left to be fitted to."""
    terms, _ = made_flights(60, 5)
    ways: list[frozenset[Hashable]] = [frozenset()] * 30 + [frozenset({"a", "b"})] * 20 + [frozenset({"c"})] * 10
    assert len(fit_modes(terms, ways, PROBIT)) == 2
    assert fit_modes(terms, ways[:30] + [frozenset()] * 30, PROBIT) == ()


def mode_of(beta: np.ndarray, link: BinaryLink = PROBIT) -> FailureMode:
    return FailureMode(link, beta, np.eye(beta.size), lambda: beta[None], 0.0)


def test_the_boundary_is_where_that_share_fails() -> None:
    """Of one way that draws have no part in, and of one in which a normal draw adds to the spread: plain quantiles."""
    draws = norm.ppf((np.arange(4096)[:, None] + 0.5) / 4096)
    alone = boundary_speed([mode_of(np.array([-1.0, 0.5, 0.0]))], draws, 0.01, 30.0)
    assert alone == pytest.approx(12.0 + norm.ppf(0.01) / 0.5, abs=2e-3)
    spread = boundary_speed([mode_of(np.array([-1.0, 0.5, 1.0]))], draws, 0.01, 30.0)
    assert spread == pytest.approx(12.0 + np.sqrt(2.0) * norm.ppf(0.01) / 0.5, abs=0.02)
    # Two ways: what neither fails.
    two = [mode_of(np.array([-1.0, 0.5, 0.0])), mode_of(np.array([-1.0, 0.5, 0.0]))]
    assert boundary_speed(two, draws, 0.01, 30.0) == pytest.approx(12.0 + norm.ppf(1.0 - 0.99**0.5) / 0.5, abs=2e-3)
    assert boundary_speed(two, draws, 0.01, 5.0) == 5.0


@pytest.mark.parametrize("link", LINKS)
def test_slopes_are_the_boundarys_derivatives(link: BinaryLink) -> None:
    draws = np.random.default_rng(1).normal(size=(4096, 2))
    betas = [FIRST, SECOND]
    speed = boundary_speed([mode_of(beta, link) for beta in betas], draws, 0.05, 40.0)
    slopes = boundary_slopes([mode_of(beta, link) for beta in betas], draws, speed)
    for which in (0, 1):
        for k in range(4):
            moved = []
            for by in (-0.02, 0.02):
                changed = [beta.copy() for beta in betas]
                changed[which][k] += by
                moved.append(boundary_speed([mode_of(beta, link) for beta in changed], draws, 0.05, 40.0))
            assert slopes[which][k] == pytest.approx((moved[1] - moved[0]) / 0.04, rel=0.03, abs=0.05)


@pytest.mark.parametrize("link", LINKS)
def test_the_share_that_fails_and_its_derivatives(link: BinaryLink) -> None:
    """Of two ways of which either often comes: against the share itself, a little moved."""
    draws, betas = np.random.default_rng(1).normal(size=(4096, 2)), [FIRST, SECOND]
    found = failure_fraction([mode_of(beta, link) for beta in betas], draws, 11.0)
    flies = np.prod([link.survival(make_regressors(11.0, draws) @ beta) for beta in betas], axis=0)
    assert found.share == pytest.approx(1.0 - flies.mean())
    assert 0.3 < found.share < 0.9
    for which in (0, 1):
        for k in range(4):
            moved = []
            for by in (-1e-3, 1e-3):
                changed = [beta.copy() for beta in betas]
                changed[which][k] += by
                moved.append(failure_fraction([mode_of(beta, link) for beta in changed], draws, 11.0).share)
            assert found.slopes[which][k] == pytest.approx((moved[1] - moved[0]) / 2e-3, rel=1e-3, abs=1e-6)
    low, high = (
        failure_fraction([mode_of(beta, link) for beta in betas], draws, 11.0 + by).share for by in (-1e-3, 1e-3)
    )
    assert found.wind_slope == pytest.approx((high - low) / 2e-3, rel=1e-3)
