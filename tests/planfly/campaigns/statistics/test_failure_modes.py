"""The ways of failing that are fitted, against made flights whose coefficients are known."""

from collections.abc import Hashable

import numpy as np
import pytest
from scipy.stats import norm

from planfly.campaigns.statistics.failure_mode import FailureMode
from planfly.campaigns.statistics.failure_modes import (
    boundary_slopes,
    boundary_speed,
    failing_share,
    fit_modes,
    regressors,
)
from planfly.campaigns.statistics.links import LINKS, PROBIT, BinaryLink

FIRST, SECOND = np.array([-1.0, 0.6, 1.5, 0.0]), np.array([-1.5, 0.3, -1.0, 0.5])


def made_flights(count: int, seed: int, link: BinaryLink = PROBIT) -> tuple[np.ndarray, list[frozenset[Hashable]]]:
    """Flights that fail by slope, by threat, by both or not at all, whatever the other does."""
    random = np.random.default_rng(seed)
    terms = regressors(random.uniform(2.0, 18.0, count), random.normal(size=(count, 2)))
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


def test_each_way_has_the_room_that_flights_had_of_it() -> None:
    """Room of the slope, of the slope's law, sharpens the slope's fit and leaves the threat's; another's, neither."""
    random = np.random.default_rng(2)
    terms = regressors(random.uniform(2.0, 18.0, 600), random.normal(size=(600, 2)))
    slope, threat = (random.normal(size=600) - terms @ beta for beta in (FIRST, SECOND))
    ways: list[frozenset[Hashable]] = [
        frozenset(name for name, room in (("slope", one), ("threat", other)) if room < 0.0)
        for one, other in zip(slope, threat, strict=True)
    ]
    shares: list[dict[Hashable, float]] = [{} if room < 0.0 else {"slope": min(1.0, room)} for room in slope]
    bare, known = fit_modes(terms, ways, PROBIT), fit_modes(terms, ways, PROBIT, shares)
    assert [mode.by_room > 0.0 for mode in known] == [True, False]
    assert np.diag(known[0].covariance).sum() < 0.8 * np.diag(bare[0].covariance).sum()
    assert known[1].mean == pytest.approx(bare[1].mean)
    other: list[dict[Hashable, float]] = [{"bounds": 0.5}] * len(ways)
    for one, same in zip(fit_modes(terms, ways, PROBIT), fit_modes(terms, ways, PROBIT, other), strict=True):
        assert one.mean == pytest.approx(same.mean)


def test_room_that_is_not_known_is_not_taken_for_much() -> None:
    """A flight that passed by a scale or more tells that; one of which it is not known, that it passed."""
    random = np.random.default_rng(4)
    terms = regressors(random.uniform(2.0, 18.0, 1500), random.normal(size=(1500, 2)))
    slope = 0.5 * (random.normal(size=1500) - terms @ FIRST)
    ways: list[frozenset[Hashable]] = [frozenset({"slope"} if room < 0.0 else ()) for room in slope]
    shares: list[dict[Hashable, float] | None] = [{"slope": room} if 0.0 <= room < 1.0 else {} for room in slope]
    half: list[dict[Hashable, float] | None] = [some if k % 2 else None for k, some in enumerate(shares)]
    for known in (shares, half):
        (mode,) = fit_modes(terms, ways, PROBIT, known)
        assert mode.by_room == pytest.approx(2.0, rel=0.15)
        assert mode.mean == pytest.approx(FIRST, abs=0.2)


def test_the_way_in_which_most_failed_comes_first() -> None:
    """One that came only with another has no flights left to be fitted to."""
    terms, _ = made_flights(60, 5)
    ways: list[frozenset[Hashable]] = [frozenset()] * 30 + [frozenset({"a", "b"})] * 20 + [frozenset({"c"})] * 10
    assert len(fit_modes(terms, ways, PROBIT)) == 2
    assert fit_modes(terms, ways[:30] + [frozenset()] * 30, PROBIT) == ()


def mode_of(beta: np.ndarray, link: BinaryLink = PROBIT) -> FailureMode:
    return FailureMode(link, beta, np.eye(beta.size), beta[None], 0.0)


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
    found = failing_share([mode_of(beta, link) for beta in betas], draws, 11.0)
    flies = np.prod([link.survival(regressors(11.0, draws) @ beta) for beta in betas], axis=0)
    assert found.share == pytest.approx(1.0 - flies.mean())
    assert 0.3 < found.share < 0.9
    for which in (0, 1):
        for k in range(4):
            moved = []
            for by in (-1e-3, 1e-3):
                changed = [beta.copy() for beta in betas]
                changed[which][k] += by
                moved.append(failing_share([mode_of(beta, link) for beta in changed], draws, 11.0).share)
            assert found.slopes[which][k] == pytest.approx((moved[1] - moved[0]) / 2e-3, rel=1e-3, abs=1e-6)
    low, high = (failing_share([mode_of(beta, link) for beta in betas], draws, 11.0 + by).share for by in (-1e-3, 1e-3))
    assert found.by_wind == pytest.approx((high - low) / 2e-3, rel=1e-3)
