"""The links of a binary regression, against scipy's laws."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize
from scipy.stats import gamma, gumbel_l, lognorm, norm

from planfly.campaigns.statistics.censored_regression import (
    CLOGLOG,
    LINKS,
    PROBIT,
    BinaryLink,
    Outcomes,
    _Posterior,
    fit_regression,
    importance_sample,
)
from world.arrays import Floats

CASES = [(PROBIT, norm), (CLOGLOG, gumbel_l)]
X = np.linspace(-6.0, 3.0, 37)


@pytest.mark.parametrize(("link", "law"), CASES)
def test_shares_and_density_are_the_laws(link: BinaryLink, law: Any) -> None:
    assert link.log_cdf(X) == pytest.approx(law.logcdf(X), rel=1e-9)
    assert link.log_survival(X) == pytest.approx(law.logsf(X), rel=1e-9)
    assert link.survival(X) == pytest.approx(law.sf(X), rel=1e-9)
    assert link.density(X) == pytest.approx(law.pdf(X), rel=1e-9)
    assert link.log_density(X) == pytest.approx(law.logpdf(X), rel=1e-9)
    assert link.information(X) == pytest.approx(law.pdf(X) ** 2 / (law.cdf(X) * law.sf(X)), rel=1e-8)


@pytest.mark.parametrize(("link", "law"), CASES)
@pytest.mark.parametrize("failed", [True, False])
def test_derivatives_are_those_of_the_law(link: BinaryLink, law: Any, failed: bool) -> None:
    logs, h = (law.logcdf if failed else law.logsf), 1e-4
    first, second = link.derivatives(X, np.full(X.size, failed))
    assert first == pytest.approx((logs(X + h) - logs(X - h)) / (2.0 * h), rel=1e-5, abs=1e-7)
    assert second == pytest.approx((logs(X + h) - 2.0 * logs(X) + logs(X - h)) / h**2, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize(("link", "law"), CASES)
def test_derivatives_of_the_density_are_the_laws(link: BinaryLink, law: Any) -> None:
    h, logs = 1e-4, law.logpdf
    first, second = link.density_derivatives(X)
    assert first == pytest.approx((logs(X + h) - logs(X - h)) / (2.0 * h), rel=1e-5, abs=1e-7)
    assert second == pytest.approx((logs(X + h) - 2.0 * logs(X) + logs(X - h)) / h**2, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize(("link", "law"), CASES)
@pytest.mark.parametrize("width", [0.5, 3.0])
def test_information_is_the_mean_square_of_the_score(link: BinaryLink, law: Any, width: float) -> None:
    """Of one that fails, one whose margin is told, and one that passes by more: by quadrature."""
    h = 1e-5

    def score(logs: Any, z: float) -> float:
        return float(logs(z + h) - logs(z - h)) / (2.0 * h)

    for x in (-4.0, -1.0, 0.0, 1.5):
        more = x + width
        ends = law.cdf(x) * score(law.logcdf, x) ** 2 + law.sf(more) * score(law.logsf, more) ** 2
        between = quad(lambda z: score(law.logpdf, z) ** 2 * law.pdf(z), x, more)[0]
        assert link.information(np.array([x]), width)[0] == pytest.approx(ends + between, rel=1e-6)


@pytest.mark.parametrize("link", LINKS)
def test_far_from_all_flights_numbers_stay_finite(link: BinaryLink) -> None:
    """A search may look at winds and draws that its fit has at no chance whatever."""
    far = np.array([-300.0, -60.0, -35.0, 35.0, 300.0])
    for failed in (True, False):
        for values in link.derivatives(far, np.full(far.size, failed)):
            assert np.isfinite(values).all()
        assert (link.derivatives(far, np.full(far.size, failed))[1] <= 0.0).all()
    for width in (0.0, 2.0):
        assert np.isfinite(link.information(far, width)).all()
        assert (link.information(far, width) >= 0.0).all()
    assert np.isfinite(link.log_density(far[:-1])).all()
    assert np.isfinite(link.density_derivatives(far)).all()
    assert np.isfinite(link.density(far)).all()


# ----------------------------------------------------------------------
# The sample of a distribution that is known by its density alone, against scipy's distributions.

PARTS = (0.05, 0.16, 0.5, 0.84, 0.95)


@pytest.mark.parametrize(("law", "mode"), [(norm(3.0, 2.0), 3.0), (gamma(3.0), 2.0), (gumbel_l(1.0, 2.0), 1.0)])
@pytest.mark.parametrize("wide", [0.5, 1.0, 2.0])
def test_quantiles_are_the_laws_wherever_it_was_looked_for(law: Any, mode: float, wide: float) -> None:
    """About the mode, with half, all or twice the deviation: skewed laws, too, and one that is none below 0."""
    sample = importance_sample(lambda x: law.logpdf(x[:, 0]), np.array([mode]), wide * law.var() * np.eye(1), 512)
    assert sample.shape == (512, 1)
    assert np.quantile(sample[:, 0], PARTS) == pytest.approx(law.ppf(PARTS), abs=0.15 * law.std())


def test_a_quantity_that_bends_with_another_is_followed() -> None:
    """x normal, y normal about x^2: looked for along a straight line."""

    def log_density(points: Floats) -> Floats:
        x, y = points.T
        out: Floats = -0.5 * x * x - 2.0 * (y - x * x) ** 2
        return out

    x, y = importance_sample(log_density, np.zeros(2), np.diag([1.0, 2.0]), 512).T
    assert np.corrcoef(x * x, y)[0, 1] > 0.85
    assert [x.mean(), y.mean()] == pytest.approx([0.0, 1.0], abs=0.15)


def test_eleven_dimensions_are_as_good() -> None:
    """Of the t distribution's points few are near the middle there; quantiles hold all the same, and correlations."""
    size = 11
    root = np.tril(np.random.default_rng(5).normal(size=(size, size)), -1) / 3.0 + np.eye(size)
    covariance = root @ root.T
    inverse = np.linalg.inv(covariance)
    sample = importance_sample(
        lambda x: -0.5 * np.einsum("ni,ij,nj->n", x, inverse, x), np.zeros(size), 1.2 * covariance, 512
    )
    deviations = np.sqrt(np.diag(covariance))
    assert sample.mean(axis=0) / deviations == pytest.approx(np.zeros(size), abs=0.15)
    assert sample.std(axis=0) / deviations == pytest.approx(np.ones(size), abs=0.15)
    assert np.corrcoef(sample.T)[0] == pytest.approx(covariance[0] / deviations[0] / deviations, abs=0.12)


def test_the_same_comes_again_and_in_no_order() -> None:
    one, other = (importance_sample(lambda x: -0.5 * x[:, 0] ** 2, np.zeros(1), np.eye(1), 256)[:, 0] for _ in range(2))
    assert (one == other).all()
    assert abs(np.corrcoef(one, np.arange(256))[0, 1]) < 0.2


# ----------------------------------------------------------------------
# The regressions, against made flights whose coefficients are known.

# Of the constant, of the wind from 10 m/s on, and of two draws.
TRUTH = np.array([-1.0, 0.6, 1.5, 0.0])
# Of a flight's margin, in scales: one over the margin's coefficient.
SPREAD = 0.8


def made(count: int, seed: int, law: Any = norm) -> Outcomes:
    """Flights that pass by SPREAD * (e - TRUTH . terms), e of a law: they fail where that is below 0."""
    random = np.random.default_rng(seed)
    terms = np.column_stack((np.ones(count), random.uniform(-8.0, 4.0, count), random.normal(size=(count, 2))))
    margin = SPREAD * (law.rvs(size=count, random_state=random) - terms @ TRUTH)
    return Outcomes(terms, margin < 0.0, margin.clip(0.0, 1.0))


@pytest.mark.parametrize(("link", "law"), [(PROBIT, norm), (CLOGLOG, gumbel_l)])
@pytest.mark.parametrize("known", [True, False])
def test_coefficients_are_found(link: BinaryLink, law: Any, known: bool) -> None:
    flights = made(20_000, 2, law)
    fit = fit_regression(flights if known else flights.as_pass_or_fail(), link)
    deviations = np.sqrt(np.diag(fit.covariance))
    assert fit.mean == pytest.approx(TRUTH, abs=0.1)
    assert (np.abs(fit.mean - TRUTH) < 4.0 * deviations).all()
    assert deviations.max() < 0.06
    assert fit.margin_coefficient == (pytest.approx(1.0 / SPREAD, rel=0.03) if known else 0.0)


@pytest.mark.parametrize("known", [True, False])
def test_the_covariance_is_that_of_repeated_flights(known: bool) -> None:
    sets = [made(500, seed) if known else made(500, seed).as_pass_or_fail() for seed in range(60)]
    means = np.array([fit_regression(flights, PROBIT).mean for flights in sets])
    told = np.sqrt(np.diag(fit_regression(sets[1], PROBIT).covariance))
    assert means.std(axis=0) == pytest.approx(told, rel=0.4)


def test_margins_make_each_coefficient_surer() -> None:
    some, none = (
        np.diag(fit_regression(flights, PROBIT).covariance)
        for flights in (made(300, 1), made(300, 1).as_pass_or_fail())
    )
    assert (some < 0.8 * none).all()


def test_where_all_pass_by_a_scale_who_failed_is_all_there_is() -> None:
    flights = made(300, 4)
    far = replace(flights, margin=np.where(flights.failed, 0.0, 1.0))
    assert fit_regression(far, PROBIT).mean == pytest.approx(fit_regression(flights.as_pass_or_fail(), PROBIT).mean)


@pytest.mark.parametrize(("link", "law"), [(PROBIT, norm), (CLOGLOG, gumbel_l)])
def test_margins_alone_give_the_coefficients_of_the_law_it_has(link: BinaryLink, law: Any) -> None:
    """Whoever failed is left out, and what is left is no longer the law itself but the law cut off at no margin."""
    fit = fit_regression(made(20_000, 8, law).margins_given_pass(), link)
    assert (np.abs(fit.mean - TRUTH) < 4.0 * np.sqrt(np.diag(fit.covariance))).all()
    assert np.sqrt(np.diag(fit.covariance)).max() < 0.1
    assert fit.margin_coefficient == pytest.approx(1.0 / SPREAD, rel=0.1)


def battery_flights(seed: int) -> Outcomes:
    """Few that fail, all near the largest wind and by their draws: least of many thresholds, in steep regression."""
    random = np.random.default_rng(seed)
    wind = np.concatenate((np.repeat([0.0, 5.0, 7.5, 8.8, 9.4, 9.7], 3), np.full(120, 10.0)))
    terms = np.column_stack((np.ones(wind.size), wind, random.normal(size=(wind.size, 2))))
    x = terms @ np.array([-76.0, 6.7, 5.0, 2.0])
    margin = (gumbel_l.rvs(size=wind.size, random_state=random) - x) / 3.5
    return Outcomes(terms, margin < 0.0, margin.clip(0.0, 1.0))


def test_the_law_of_margins_alone_is_looked_for_from_where_the_one_law_is_too() -> None:
    """Its posterior may have a second mode, of exponential margin whatever the wind: from afar that may be found."""
    found = []
    for seed in range(6):
        flights = battery_flights(seed)
        one_law = fit_regression(flights, CLOGLOG)
        near, afar = (fit_regression(flights.margins_given_pass(), CLOGLOG, start) for start in (one_law, None))
        found.append(near.log_evidence - afar.log_evidence)
        # Whichever: it is no less than what any simplex finds that starts from the one law.
        highest = minimize(
            lambda at, fit=near: -float(fit._posterior.log_density(at[None])[0]), one_law._mode, tol=1e-6
        )
        assert near._posterior.log_density(near._mode[None])[0] >= -highest.fun - 0.01
    assert min(found) >= 0.0
    assert max(found) > 3.0


def test_what_could_as_good_as_never_have_flown_is_impossible_not_certain() -> None:
    """Where a rate is beyond all numbers, its differences with others are none."""
    posterior = _Posterior(battery_flights(1).margins_given_pass(), CLOGLOG, 1.5)
    points = np.array([[800.0, 0.0, 0.0, 0.0, 1.0], [40.0, -3.0, 0.0, 0.0, 1.0], [-10.0, -1.0, 0.0, 0.0, 1.0]])
    found = posterior.log_density(points)
    assert (found[:2] == -np.inf).all()
    assert np.isfinite(found[2])


def test_more_wind_never_has_fewer_fail() -> None:
    """Flights that fail in little wind only, by chance: nothing is made of that."""
    wind = np.linspace(-5.0, 5.0, 40)
    fit = fit_regression(Outcomes(np.column_stack((np.ones(40), wind)), wind < -4.0, np.zeros(40)), PROBIT)
    assert 0.0 < fit.mean[1] < 0.2


def test_the_covariance_is_the_inverse_of_the_curvature_at_the_mode() -> None:
    """Of a handful of flights, where the prior counts, by its own formula and differences of it."""
    wind, failed = np.array([-4.0, -2.0, 0.0, 1.0, 2.0, 3.0, 4.0]), np.array([0, 0, 1, 0, 0, 1, 0], dtype=bool)

    def loss(at: Floats) -> float:
        x = at[0] + np.exp(at[1]) * wind
        prior = norm.logpdf(at[0], scale=20.0) + norm.logpdf(at[1], loc=np.log(0.5))
        return -float(prior + norm.logcdf(np.where(failed, x, -x)).sum())

    mode, step = minimize(loss, np.zeros(2), tol=1e-12).x, 1e-3
    curvature = np.empty((2, 2))
    for i, j in product(range(2), range(2)):
        one, other = step * np.eye(2)[i], step * np.eye(2)[j]
        corners = loss(mode + one + other) - loss(mode + one - other) - loss(mode - one + other)
        curvature[i, j] = (corners + loss(mode - one - other)) / (4.0 * step * step)
    scale = np.array([1.0, np.exp(mode[1])])
    fit = fit_regression(Outcomes(np.column_stack((np.ones(7), wind)), failed, np.zeros(7)), PROBIT)
    assert fit.mean == pytest.approx([mode[0], np.exp(mode[1])], rel=1e-3)
    assert fit.covariance == pytest.approx(np.linalg.inv(curvature) * np.outer(scale, scale), rel=0.01)


@pytest.mark.parametrize("known", [True, False])
def test_the_evidence_is_for_the_link_that_flights_follow(known: bool) -> None:
    for law, right, wrong in ((norm, PROBIT, CLOGLOG), (gumbel_l, CLOGLOG, PROBIT)):
        flights = made(6000, 3, law)
        by_right, by_wrong = (
            fit_regression(flights if known else flights.as_pass_or_fail(), link).log_evidence
            for link in (right, wrong)
        )
        assert by_right > by_wrong + 3.0


def test_the_evidence_is_the_integral_over_the_prior() -> None:
    """Of the constant, normal (20), and the wind's coefficient, log-normal about 0.5 per m/s, by a sum over a grid."""
    random = np.random.default_rng(6)
    wind = random.uniform(-5.0, 5.0, 300)
    failed = random.normal(size=300) < -0.5 + 0.4 * wind
    fit = fit_regression(Outcomes(np.column_stack((np.ones(300), wind)), failed, np.zeros(300)), PROBIT)
    a, b = np.meshgrid(np.arange(-1.5, 0.5, 0.01), np.arange(0.1, 0.8, 0.005), indexing="ij")
    logs = norm.logpdf(a, scale=20.0) + lognorm.logpdf(b, 1.0, scale=0.5)
    for sign, speed in zip(np.where(failed, 1.0, -1.0), wind, strict=True):
        logs += norm.logcdf(sign * (a + b * speed))
    assert fit.log_evidence == pytest.approx(logs_sum(logs, 0.01 * 0.005), abs=0.1)


def test_the_evidence_of_margins_is_the_integral_over_the_prior() -> None:
    """Of the constant and the margin's coefficient (normal, 10 in 1/scale), the wind having none; of margins alone."""
    random = np.random.default_rng(7)
    margin = 0.5 * (random.normal(size=200) + 1.0)
    failed = margin < 0.0
    terms = np.column_stack((np.ones(200), np.zeros(200)))
    outcomes = Outcomes(terms, failed, margin.clip(0.0, 1.0))
    a, k = np.meshgrid(np.arange(-2.0, 0.0, 0.01), np.arange(1.0, 3.5, 0.01), indexing="ij")
    # The wind's coefficient integrates to 1 over its prior.
    fails, passes = (norm.logpdf(a, scale=20.0) + norm.logpdf(k, scale=10.0) for _ in range(2))
    for one in margin:
        by_so_much = norm.logsf(a + k) if one >= 1.0 else norm.logpdf(a + k * one) + np.log(k)
        fails += norm.logcdf(a) if one < 0.0 else by_so_much
        passes += 0.0 if one < 0.0 else by_so_much - norm.logsf(a)
    fit = fit_regression(outcomes, PROBIT)
    assert fit.margin_coefficient == pytest.approx(2.0, rel=0.15)
    assert fit.log_evidence == pytest.approx(logs_sum(fails, 0.01 * 0.01), abs=0.1)
    alone = fit_regression(outcomes.margins_given_pass(), PROBIT)
    assert alone.log_evidence == pytest.approx(logs_sum(passes, 0.01 * 0.01), abs=0.3)


def logs_sum(logs: Floats, cell: float) -> float:
    """Logarithm of an integral, of logarithms on a grid of cells."""
    return float(np.log(np.exp(logs - logs.max()).sum() * cell) + logs.max())
