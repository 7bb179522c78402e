"""The ways of failing that are fitted, against made flights whose coefficients are known."""

from collections.abc import Hashable
from typing import Any

import numpy as np
import pytest
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.failure_modes import (
    FailureMode,
    boundary_slopes,
    boundary_speed,
    fit_modes,
    regressors,
)
from planfly.campaigns.statistics.links import LEAST_OF_MANY, LINKS, PROBIT, BinaryLink

FIRST, SECOND = np.array([-1.0, 0.6, 1.5, 0.0]), np.array([-1.5, 0.3, -1.0, 0.5])


def made_flights(count: int, seed: int, link: BinaryLink = PROBIT) -> tuple[np.ndarray, list[frozenset[Hashable]]]:
    """Flights that fail by slope, by threat, by both or not at all, whatever the other does."""
    random = np.random.default_rng(seed)
    terms = regressors(random.uniform(2.0, 18.0, count), random.normal(size=(count, 2)))
    ways: list[set[Hashable]] = [set() for _ in range(count)]
    for name, beta in (("slope", FIRST), ("threat", SECOND)):
        for k in np.flatnonzero(np.log(random.random(count)) < link.log_shares(terms @ beta)[0]):
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


def flights_with_room(
    count: int, seed: int, *, scale: float = 0.8, law: Any = norm
) -> tuple[np.ndarray, list[frozenset[Hashable]], list[dict[Hashable, float]]]:
    """Flights that pass by scale * (e - FIRST . terms), e of a law: they fail where that is below 0."""
    random = np.random.default_rng(seed)
    terms = regressors(random.uniform(2.0, 14.0, count), random.normal(size=(count, 2)))
    room = scale * (law.rvs(size=count, random_state=random) - terms @ FIRST)
    ways: list[frozenset[Hashable]] = [frozenset({"slope"}) if one < 0.0 else frozenset() for one in room]
    return terms, ways, [{"slope": float(one)} if 0.0 <= one < 1.0 else {} for one in room]


@pytest.mark.parametrize(("link", "law"), [(PROBIT, norm), (LEAST_OF_MANY, gumbel_l)])
def test_room_is_fitted_by_the_same_coefficients(link: BinaryLink, law: Any) -> None:
    """Each coefficient, and by how much the predictor falls over a scale of room: one over the scale of the law."""
    (mode,) = fit_modes(*interleaved(flights_with_room(20_000, 2, law=law), link))
    deviations = np.sqrt(np.diag(mode.covariance))
    assert mode.mean == pytest.approx(FIRST, abs=0.1)
    assert (np.abs(mode.mean - FIRST) < 4.0 * deviations).all()
    assert mode.by_room == pytest.approx(1.0 / 0.8, rel=0.03)


def interleaved(made: tuple[Any, Any, Any], link: BinaryLink) -> tuple[Any, Any, BinaryLink, Any]:
    terms, ways, room = made
    return terms, ways, link, room


def test_room_tells_more_than_failing_alone_as_repeated_flights_show() -> None:
    """A coefficient's spread over repeated sets of flights is less with room, and is what the covariance says."""
    sets = [flights_with_room(300, seed) for seed in range(40)]
    with_room = np.array([fit_modes(terms, ways, PROBIT, room)[0].mean for terms, ways, room in sets])
    without = np.array([fit_modes(terms, ways, PROBIT)[0].mean for terms, ways, _ in sets])
    told = np.sqrt(np.diag(fit_modes(*interleaved(sets[0], PROBIT))[0].covariance))
    assert with_room.std(axis=0) == pytest.approx(told, rel=0.5)
    assert (with_room.std(axis=0)[:3] < 0.9 * without.std(axis=0)[:3]).all()


def test_a_flight_that_passed_by_a_scale_or_more_tells_no_more_than_that() -> None:
    terms, ways, room = flights_with_room(300, 4)
    far = [{"slope": 1.0} if not some and not way else some for some, way in zip(room, ways, strict=True)]
    (plain,), (said) = fit_modes(terms, ways, PROBIT, room), fit_modes(terms, ways, PROBIT, far)
    assert said[0].mean == pytest.approx(plain.mean)
    # And 0, that it did not fail: where all have that, nothing is told but who failed.
    none = [{} if way else {"slope": 0.0} for way in ways]
    (bare,), (only,) = fit_modes(terms, ways, PROBIT), fit_modes(terms, ways, PROBIT, none)
    assert only.mean == pytest.approx(bare.mean)
    assert only.by_room == bare.by_room == 0.0


def test_the_covariance_is_that_of_repeated_flights() -> None:
    means = np.array([fit_modes(*made_flights(600, seed), PROBIT)[0].mean for seed in range(60)])
    told = np.sqrt(np.diag(fit_modes(*made_flights(600, 1), PROBIT)[0].covariance))
    assert means.std(axis=0) == pytest.approx(told, rel=0.4)


def test_the_evidence_is_for_the_link_that_flights_follow() -> None:
    for right, wrong in ((PROBIT, LEAST_OF_MANY), (LEAST_OF_MANY, PROBIT)):
        terms, ways = made_flights(4000, 3, right)
        by_right, by_wrong = (
            sum(mode.log_evidence for mode in fit_modes(terms, ways, link)) for link in (right, wrong)
        )
        assert by_right > by_wrong + 3.0


def test_the_evidence_is_the_integral_over_the_prior() -> None:
    """Of constant and wind's coefficient, whose prior is normal (20; 1.5 in 1/(m/s)), by a sum over a fine grid."""
    random = np.random.default_rng(6)
    speeds = random.uniform(5.0, 15.0, 300)
    failed = random.normal(size=300) < -0.5 + 0.4 * (speeds - 10.0)
    (mode,) = fit_modes(
        regressors(speeds, np.empty((300, 0))), [frozenset({"slope"}) if one else frozenset() for one in failed], PROBIT
    )
    a, b = np.meshgrid(np.arange(-1.5, 0.5, 0.01), np.arange(0.1, 0.8, 0.005), indexing="ij")
    sign = np.where(failed, 1.0, -1.0)
    logs = norm.logpdf(a, scale=20.0) + norm.logpdf(b, scale=1.5)
    for one, speed in zip(sign, speeds, strict=True):
        logs += norm.logcdf(one * (a + b * (speed - 10.0)))
    integral = np.log(np.exp(logs - logs.max()).sum() * 0.01 * 0.005) + logs.max()
    assert mode.log_evidence == pytest.approx(integral, abs=0.1)


def test_the_way_in_which_most_failed_comes_first() -> None:
    """One that came only with another has no flights left to be fitted to."""
    terms, _ = made_flights(60, 5)
    ways: list[frozenset[Hashable]] = [frozenset()] * 30 + [frozenset({"a", "b"})] * 20 + [frozenset({"c"})] * 10
    assert len(fit_modes(terms, ways, PROBIT)) == 2
    assert fit_modes(terms, ways[:30] + [frozenset()] * 30, PROBIT) == ()


def mode_of(beta: np.ndarray, link: BinaryLink = PROBIT) -> FailureMode:
    return FailureMode(link, beta, np.eye(beta.size), 0.0)


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
