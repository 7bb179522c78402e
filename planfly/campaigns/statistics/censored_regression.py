"""Regressions of failures, and of the margins of passed flights, on the wind and the drawn quantities.

The probability of failure is a link function of a + b * wind + c . draws.  Three likelihoods are available:

- of only the failures, a binary regression;
- of the failures and the margins of passed flights, with one distribution: the share of flights that pass by less than
  a given margin is the same function with k * margin added, so that the margin has the link's distribution with scale
  1/k, in units of the margin's scale.  A failed flight only contributes that it failed, and a flight that passed by a
  scale or more only that it did, so that the distribution need not hold far from failure: a regression censored on both
  sides (Tobin, "Estimation of relationships for limited dependent variables", Econometrica 26, 1958; Rosett and Nelson,
  "Estimation of the two-limit probit regression model", Econometrica 43, 1975);
- of only the margin, given that a flight passed: the same regression truncated at zero margin.

Priors are weak and normal, on the logarithm of b and on the other coefficients themselves.  The most informative
flight, and the evidence for a link and for the prior width of the draws' coefficients, follow from a normal
approximation of the posterior about its mode (Gelman et al., Bayesian Data Analysis, 3rd edition, 2013, chapters 4.1,
7.4 and 16.3; MacKay, "Bayesian Interpolation", Neural Computation 4, 1992).  With few failures the posterior is far
from normal: the boundary is computed from a sample of the posterior itself (`importance_sample`).

statsmodels 0.15 has no regression censored on both sides and no priors: its Probit needs 1.6 to 1.7 times the flights
for the same error of the boundary (64 instead of 40, 139 instead of 80), and gives no result for 20 flights in one case
of nine.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats

Bools = NDArray[np.bool_]


# ----------------------------------------------------------------------
# Links of a binary regression: the probability of failure as a function of a linear predictor.
#
# `PROBIT` corresponds to a normally distributed threshold; `CLOGLOG` (complementary log-log) to the smallest of many
# thresholds, the Gumbel distribution for minima, with its longer tail towards low wind (McCullagh and Nelder,
# Generalized Linear Models, 2nd edition, 1989, section 4.3).


# Largest exponent for which exp does not overflow.
_MAX_EXPONENT = 700.0
# Lower limit of probabilities in a denominator.
_MIN_PROBABILITY = 1e-300


class BinaryLink(Protocol):
    """Link function from the linear predictor of a flight to the probability that the flight fails.

    All methods take predictors in an array of any shape and return arrays of the same shape.
    """

    def log_cdf(self, x: Floats) -> Floats:
        """Return the logarithm of the probability of failure at the linear predictor x."""

    def log_survival(self, x: Floats) -> Floats:
        """Return the logarithm of the probability of success at the linear predictor x."""

    def survival(self, x: Floats) -> Floats:
        """Return the probability of success at the linear predictor x."""

    def density(self, x: Floats) -> Floats:
        """Return the derivative of the probability of failure by the linear predictor x."""

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        """Return the Fisher information of a flight about its predictor.

        width: range of predictors above ``x`` in which a passed flight reports its margin; 0 if flights report only
            pass or fail.
        """

    def derivatives(self, x: Floats, has_failed: Bools) -> tuple[Floats, Floats]:
        """Return first and second derivative of the log-probability of the outcome by the linear predictor x."""

    def log_density(self, x: Floats) -> Floats:
        """Return the logarithm of `density`."""

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        """Return first and second derivative of `log_density` by the linear predictor x."""


class _Probit:
    """Link of a normally distributed threshold."""

    def log_cdf(self, x: Floats) -> Floats:
        """Return the logarithm of the normal probability of failure at the linear predictor x."""
        from scipy.special import log_ndtr

        return log_ndtr(x)

    def log_survival(self, x: Floats) -> Floats:
        """Return the logarithm of the normal probability of success at the linear predictor x."""
        return self.log_cdf(-x)

    def survival(self, x: Floats) -> Floats:
        """Return the probability of success at the linear predictor x: the standard normal survival function."""
        from scipy.special import ndtr

        return ndtr(-x)

    def density(self, x: Floats) -> Floats:
        """Return the standard normal density at the linear predictor x."""
        return np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        """Return the Fisher information of a flight about its predictor x, as `BinaryLink.information`."""
        from scipy.special import ndtr

        upper_predictor = x + width
        # Information of a failure and of a pass by more than the width, then of a pass between them (mean square
        # score).
        end_information = self.density(x) ** 2 / np.maximum(ndtr(x), _MIN_PROBABILITY) + self.density(
            upper_predictor
        ) ** 2 / np.maximum(ndtr(-upper_predictor), _MIN_PROBABILITY)
        pass_information = (
            ndtr(upper_predictor) - ndtr(x) - upper_predictor * self.density(upper_predictor) + x * self.density(x)
        )
        return end_information + np.maximum(pass_information, 0.0)

    def derivatives(self, x: Floats, has_failed: Bools) -> tuple[Floats, Floats]:
        """Return first and second derivative of the log-probability of each outcome by the linear predictor x."""
        from scipy.special import log_ndtr

        sign = np.where(has_failed, 1.0, -1.0)
        z = sign * x
        # Use logarithms, because Phi underflows to 0 long before the derivative of its logarithm does.
        ratio = np.exp(-0.5 * z * z - 0.5 * np.log(2.0 * np.pi) - log_ndtr(z))
        return sign * ratio, -ratio * (z + ratio)

    def log_density(self, x: Floats) -> Floats:
        """Return the logarithm of the standard normal density at the linear predictor x."""
        return -0.5 * x * x - 0.5 * np.log(2.0 * np.pi)

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        """Return first and second derivative of `log_density` by the linear predictor x."""
        return -x, np.full_like(x, -1.0)


class _ComplementaryLogLog:
    """Complementary log-log link, of a threshold with Gumbel's distribution for minima."""

    def log_cdf(self, x: Floats) -> Floats:
        """Return the logarithm of the probability of failure, 1 - exp(-exp(x))."""
        with np.errstate(divide="ignore"):
            # For a tiny rate the probability equals the rate.
            logarithms: Floats = np.where(x < -30.0, x, np.log(-np.expm1(self.log_survival(x))))
        return logarithms

    def log_survival(self, x: Floats) -> Floats:
        """Return the logarithm of the probability of success, exp(-exp(x))."""
        return -np.exp(np.minimum(x, _MAX_EXPONENT))

    def survival(self, x: Floats) -> Floats:
        """Return the probability of success at the linear predictor x, exp(-exp(x))."""
        return np.exp(self.log_survival(x))

    def density(self, x: Floats) -> Floats:
        """Return the derivative of the probability of failure by the linear predictor x."""
        return np.exp(x - np.exp(np.minimum(x, _MAX_EXPONENT)))

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        """Return the Fisher information of a flight about its predictor x, as `BinaryLink.information`."""
        rate, upper_rate = (
            np.exp(np.clip(predictor, -_MAX_EXPONENT, 0.5 * _MAX_EXPONENT)) for predictor in (x, x + width)
        )
        # As for the probit: rate * ratio * exp(-rate) for failures, integrals over the rate for passes.
        failure_information = rate * _rate_ratio(rate) * np.exp(-rate)
        pass_information = np.maximum(_square_integral_above(rate) - _square_integral_above(upper_rate), 0.0)
        return failure_information + pass_information + upper_rate * upper_rate * np.exp(-upper_rate)

    def derivatives(self, x: Floats, has_failed: Bools) -> tuple[Floats, Floats]:
        """Return first and second derivative of the log-probability of each outcome by the linear predictor x."""
        rate = np.exp(np.clip(x, -_MAX_EXPONENT, 0.5 * _MAX_EXPONENT))
        first = _rate_ratio(rate)
        second = first * (1.0 - rate - first)
        return np.where(has_failed, first, -rate), np.where(has_failed, np.minimum(second, 0.0), -rate)

    def log_density(self, x: Floats) -> Floats:
        """Return the logarithm of `density`."""
        return x - np.exp(np.minimum(x, _MAX_EXPONENT))

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        """Return first and second derivative of `log_density` by the linear predictor x."""
        rate = np.exp(np.minimum(x, 0.5 * _MAX_EXPONENT))
        return 1.0 - rate, -rate


def _square_integral_above(rate: Floats) -> Floats:
    """Return the integral of (1 - r)^2 exp(-r) from a rate to infinity."""
    return (rate * rate + 1.0) * np.exp(-rate)


def _rate_ratio(rate: Floats) -> Floats:
    """Return rate / (exp(rate) - 1), which is near 1 for a small rate and near 0 for a large rate."""
    with np.errstate(over="ignore"):
        ratio: Floats = rate / np.expm1(rate)
    return ratio


PROBIT: BinaryLink = _Probit()
CLOGLOG: BinaryLink = _ComplementaryLogLog()
LINKS = (PROBIT, CLOGLOG)


# ----------------------------------------------------------------------
# Sample of a distribution of which only the log-density is known, up to a constant.
#
# Importance sampling (Robert and Casella, Monte Carlo Statistical Methods, 2nd edition, 2004, chapters 3.3 and 14.3):
# the points are drawn from a multivariate t distribution about the mode, with longer tails than a posterior, evenly
# spread by Sobol's sequence; the weight of each point is the ratio of the two densities.  The points are then resampled
# by their weights, so that the remaining points have equal weights: systematically in the order of the first coordinate
# (Kitagawa, "Monte Carlo filter and smoother for non-Gaussian nonlinear state space models", Journal of Computational
# and Graphical Statistics 5, 1996), because in the order of the sequence, which repeats itself, every second point may
# be on one side.

# Degrees of freedom of the t distribution.
_DEGREES_OF_FREEDOM = 6.0
# Number of weighted points for each resampled point.
_POINTS_PER_SAMPLE = 2
# Seed of the sequence and of the final order.
_SEED = 1


def importance_sample(log_density: Callable[[Floats], Floats], mean: Floats, covariance: Floats, count: int) -> Floats:
    """Return equally likely samples of a distribution with a known log-density, (count, k).

    They are in random order.

    The points are spread more evenly in the first coordinate than in the others.
    log_density: log-density (n,) of points (n, k), up to a constant; -inf for zero density.
    mean, covariance: approximate mean (k,) and covariance (k, k) of the distribution.
    count: a power of two.
    Raises LinAlgError if the covariance is not positive definite.

    >>> sample = importance_sample(lambda x: -0.5 * x[:, 0] ** 2, np.ones(1), np.eye(1), 256)
    >>> round(float(sample.std()), 1)
    1.0
    """
    standard, log_proposal = _t_points(mean.size, _POINTS_PER_SAMPLE * count)
    points = mean + standard @ np.linalg.cholesky(covariance).T
    log_weights = log_density(points) - log_proposal
    order = np.argsort(points[:, 0], kind="stable")
    cumulative_weights = np.cumsum(np.exp(log_weights - log_weights.max())[order])
    steps = (np.arange(count) + 0.5) / count
    selected = order[np.searchsorted(cumulative_weights / cumulative_weights[-1], steps).clip(0, order.size - 1)]
    return np.random.default_rng(_SEED).permutation(points[selected])


@lru_cache
def _t_points(size: int, count: int) -> tuple[Floats, Floats]:
    """Return points of the standard t distribution, (count, size), and their log-density, (count,).

    The log-density is known up to a constant.
    """
    from scipy.stats import chi2, norm, qmc

    # With a power of two points, Sobol's sequence is balanced.
    sobol_points = qmc.Sobol(size + 1, seed=_SEED).random(count).clip(1e-12, 1.0 - 1e-12)
    points = norm.ppf(sobol_points[:, :size]) / np.sqrt(
        chi2.ppf(sobol_points[:, size:], _DEGREES_OF_FREEDOM) / _DEGREES_OF_FREEDOM
    )
    return points, -0.5 * (_DEGREES_OF_FREEDOM + size) * np.log1p((points * points).sum(axis=1) / _DEGREES_OF_FREEDOM)


# Standard deviation of the normal prior of the constant.
_CONSTANT_SIGMA = 20.0
# Median of the prior of the wind's coefficient, 1/(m/s).  More wind never causes fewer failures: the coefficient is
# positive, with a normal prior of its logarithm; it changes a probit by one within 0.3 to 14 m/s at 95 %.
_WIND_MEDIAN = 0.5
# Standard deviation of the prior of the coefficient's logarithm.
_WIND_LOG_SIGMA = 1.0
# Standard deviations of the prior of the draws' coefficients, for draws in units of their own standard deviations; the
# one with the most evidence is used.  If draws have little effect, a wide prior would mistake chance for knowledge.
_DRAW_SIGMAS = (0.1, 0.4, 1.5)
# Standard deviation of the prior of the margin's coefficient, 1/scale, which is truncated to positive values.
_MARGIN_SIGMA = 10.0
# Start of Newton's method, constant and log of the wind's coefficient: few failures, and more in more wind.
_START_COEFFICIENTS = (-3.0, np.log(0.3))
# Start of the margin's coefficient.
_MARGIN_START = 1.0
# Maximum number of Newton steps.
_MAX_STEPS = 100
# Largest component of a step at convergence.
_STEP_TOLERANCE = 1e-8
# Smallest fraction of a Newton step.
_MIN_STEP_FRACTION = 1e-9
# Lower limit of the absolute eigenvalues of the curvature.
_MIN_CURVATURE = 1e-9
# Upper limit of the logarithm of the wind's coefficient.
_MAX_LOGARITHM = 5.0
# Largest step of the margin's coefficient towards 0, as a fraction of its value.
_MAX_MARGIN_STEP_FRACTION = 0.9
# Largest predictor of a passed flight, for both links; beyond it a pass is practically impossible.
_MAX_PREDICTOR = 30.0
# Number of points in a sample of a posterior.
_SAMPLE_SIZE = 512


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Outcomes of n flights for one failure mode.

    terms: (n, 2 + d) terms of each flight: one, the wind relative to some origin, and the draws.
    failed: (n,) True for each flight that failed in this mode.
    margin: (n,) margin of each passed flight as a fraction of a scale: 1 for a scale or more, 0 for unknown or failed.
    given_passed: True to condition on a pass, so that only the margin is informative.
    """

    terms: Floats
    failed: Bools
    margin: Floats
    given_passed: bool = False

    @property
    def marginal(self) -> Bools:
        """Mask (n,): True for each flight that passed with a known margin below the rule's scale."""
        return (self.margin > 0.0) & (self.margin < 1.0)

    def as_pass_or_fail(self) -> "Outcomes":
        """Return the outcomes of all flights without their margins."""
        return Outcomes(self.terms, self.failed, np.zeros_like(self.margin))

    def margins_given_pass(self) -> "Outcomes":
        """Return only the passed flights with a known margin, conditional on having passed."""
        has_margin = self.margin > 0.0
        return Outcomes(self.terms[has_margin], self.failed[has_margin], self.margin[has_margin], given_passed=True)


@dataclass(frozen=True)
class RegressionFit:
    """Posterior of the coefficients of a regression, fitted to the outcomes of flights.

    mean, covariance: mean (2 + d,) and covariance (2 + d, 2 + d) of the terms' coefficients, from a normal
        approximation about the mode.
    log_evidence: logarithm of the evidence of the outcomes.
    margin_coefficient: decrease of the predictor per scale of margin; 0 if no margin is known.
    """

    mean: Floats
    covariance: Floats
    log_evidence: float
    margin_coefficient: float
    _posterior: "_Posterior"
    _mode: Floats

    def sample(self) -> Floats:
        """Return s equally likely sets of coefficients from the posterior, (s, 2 + d).

        The coefficient of the wind is positive.
        """
        return self._posterior.sample(self._mode)


def fit_regression(outcomes: Outcomes, link: BinaryLink, nearby_fit: RegressionFit | None = None) -> RegressionFit:
    """Fit the regression of flight outcomes, and return the fit with the most evidence.

    One fit is made for each prior of the draws' coefficients, and from each start point.

    link: link function between the predictor and the probability of failure.
    nearby_fit: a fit of the same coefficients, whose mode is used as an additional start point, because a posterior
        from margins alone may have two modes.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> wind = np.linspace(-5.0, 5.0, 200)
    >>> margin = 2.0 - wind
    >>> outcomes = Outcomes(np.column_stack((np.ones(200), wind)), margin < 0.0, margin.clip(0.0, 1.0))
    >>> fit = fit_regression(outcomes, PROBIT)
    >>> round(float(-fit.mean[0] / fit.mean[1]), 1)
    2.0
    """
    # Without drawn quantities there are no coefficients to put a prior on: fit once.
    priors = _DRAW_SIGMAS if outcomes.terms.shape[1] > 2 else _DRAW_SIGMAS[:1]
    fits = []
    for deviation in priors:
        posterior = _Posterior(outcomes, link, deviation)
        start_points = [posterior.start_point()] if nearby_fit is None else [posterior.start_point(), nearby_fit._mode]
        fits += [_find_mode(posterior, point) for point in start_points]
    return max(fits, key=lambda fit: fit.log_evidence)


class _Posterior:
    """Posterior density of the coefficients of a regression, as a function of points.

    A point (k,) holds the constant, the logarithm of the wind's coefficient, the coefficients of the draws, and, if any
    margin is known, the margin's coefficient.

    draw_deviation: standard deviation of the prior of the draws' coefficients.
    """

    def __init__(self, outcomes: Outcomes, link: BinaryLink, draw_deviation: float) -> None:
        self._outcomes, self._link, self._marginal_passes = outcomes, link, outcomes.marginal
        self.margin_coefficient = bool(self._marginal_passes.any())
        self.size = outcomes.terms.shape[1]
        deviations = np.full(self.size, draw_deviation)
        deviations[:2] = _CONSTANT_SIGMA, _WIND_LOG_SIGMA
        # The margin is a regressor of passed flights: F(terms . beta + k * margin) is the share that passes by less.
        self._terms = np.column_stack((outcomes.terms, outcomes.margin)) if self.margin_coefficient else outcomes.terms
        self.deviations = np.append(deviations, _MARGIN_SIGMA) if self.margin_coefficient else deviations
        self._precision = self.deviations**-2
        self._prior_mean = np.zeros(self.deviations.size)
        self._prior_mean[1] = np.log(_WIND_MEDIAN)

    def start_point(self) -> Floats:
        """Return the start point of Newton's method, (k,)."""
        point = np.zeros(self.deviations.size)
        point[:2] = _START_COEFFICIENTS
        if self.margin_coefficient:
            point[-1] = _MARGIN_START
        return point

    def coefficients(self, points: Floats) -> Floats:
        """Return the coefficients of the terms at points (..., k).

        In a point, the wind's coefficient is replaced by its logarithm.
        """
        beta = points.copy()
        beta[..., 1] = np.exp(np.minimum(points[..., 1], _MAX_LOGARITHM))
        return beta

    def log_density(self, points: Floats) -> Floats:
        """Return the logarithm of the posterior density at points (n, k), up to a constant, (n,).

        It is the sum of the logarithms of the prior and of the probability of each outcome. It is -inf where a flight
        that passed has a practically impossible predictor, or where the margin's coefficient is not positive.
        """
        beta = self.coefficients(points)
        deviations = points - self._prior_mean
        has_failed = self._outcomes.failed
        predictor = self._terms @ beta.T
        predictor_without_margin = (
            self._outcomes.terms @ beta[:, : self.size].T if self.margin_coefficient else predictor
        )
        # Points with a larger predictor are practically impossible; their logarithm is so large that the other terms
        # would be lost to rounding.
        is_possible = (predictor_without_margin[~has_failed] < _MAX_PREDICTOR).all(axis=0)
        predictor = np.where(is_possible, predictor, 0.0)
        predictor_without_margin = np.where(is_possible, predictor_without_margin, 0.0)
        log_densities: Floats = -0.5 * (deviations * deviations) @ self._precision
        log_densities += self._link.log_cdf(predictor[has_failed]).sum(axis=0)
        log_densities += self._link.log_survival(predictor[~has_failed & ~self._marginal_passes]).sum(axis=0)
        if self.margin_coefficient:
            is_possible &= beta[:, -1] > 0.0
            log_densities += self._link.log_density(predictor[self._marginal_passes]).sum(axis=0)
            log_densities += self._marginal_passes.sum() * np.log(np.where(is_possible, beta[:, -1], 1.0))
        if self._outcomes.given_passed:
            log_densities -= self._link.log_survival(predictor_without_margin).sum(axis=0)
        return np.where(is_possible, log_densities, -np.inf)

    def sample(self, mode: Floats) -> Floats:
        """Draw s equally likely sets of coefficients, (s, size), by importance sampling around the mode.

        With few failures, the wind's coefficient is uncertain by factors, and the constant depends strongly on it.
        Therefore the constant is not drawn itself: the value of the predictor is drawn at the wind speed at which it is
        known best, and the constant is computed from it.
        """
        eigenvalues, axes = np.linalg.eigh(self.slope_and_curvature(mode)[1])
        covariance = axes / np.maximum(np.abs(eigenvalues), _MIN_CURVATURE) @ axes.T
        best_known_wind = -covariance[0, 1] / (covariance[1, 1] * np.exp(mode[1]))
        # The change of variables from the constant to that predictor leaves the density unchanged.
        change_of_variables = np.eye(mode.size)
        change_of_variables[0, 1] = best_known_wind * np.exp(mode[1])
        mean = mode.copy()
        mean[0] += best_known_wind * np.exp(mode[1])

        def with_constants(points: Floats) -> Floats:
            """Replace the first coordinate of points, the predictor at the best-known wind, by the constant."""
            changed_points = points.copy()
            changed_points[:, 0] -= best_known_wind * self.coefficients(points)[:, 1]
            return changed_points

        points = importance_sample(
            lambda points: self.log_density(with_constants(points)),
            mean,
            change_of_variables @ covariance @ change_of_variables.T,
            _SAMPLE_SIZE,
        )
        return self.coefficients(with_constants(points))[:, : self.size]

    def slope_and_curvature(self, point: Floats) -> tuple[Floats, Floats]:
        """Return the gradient (k,) and Hessian (k, k) of the negative log-density at a point (k,)."""
        beta, scale = self.coefficients(point), np.ones(point.size)
        predictor, terms = self._terms @ beta, self._terms
        first, second = self._link.derivatives(predictor, self._outcomes.failed)
        if self.margin_coefficient:
            marginal_first, marginal_second = self._link.density_derivatives(predictor)
            first = np.where(self._marginal_passes, marginal_first, first)
            second = np.where(self._marginal_passes, marginal_second, second)
        slope, curvature = -terms.T @ first, -(terms * second[:, None]).T @ terms
        if self._outcomes.given_passed:
            terms_without_margin = self._outcomes.terms
            predictor = terms_without_margin @ beta[: self.size]
            first, second = self._link.derivatives(predictor, self._outcomes.failed)
            slope[: self.size] += terms_without_margin.T @ first
            curvature[: self.size, : self.size] += (terms_without_margin * second[:, None]).T @ terms_without_margin
        if self.margin_coefficient:
            count = int(self._marginal_passes.sum())
            slope[-1] -= count / beta[-1]
            curvature[-1, -1] += count / beta[-1] ** 2
        # Chain rule for the logarithm of the wind's coefficient.
        scale[1] = beta[1]
        slope, curvature = scale * slope, scale[:, None] * curvature * scale
        curvature[1, 1] += slope[1]
        return slope + self._precision * (point - self._prior_mean), curvature + np.diag(self._precision)


def _find_mode(posterior: _Posterior, point: Floats) -> RegressionFit:
    """Find the mode of a posterior from a start point; return the fit with mode, covariance and evidence.

    The search is Newton's method with halved steps.  Where the loss is not convex, which happens only with margins
    alone, the absolute eigenvalues of the curvature are used (Nocedal and Wright, Numerical Optimization, 2nd edition,
    2006, sections 3.4 and 19.2).
    """
    size = posterior.size

    def loss(point: Floats) -> float:
        """Return the negative log-density of the posterior at a point."""
        return -float(posterior.log_density(point[None])[0])

    value = loss(point)
    # Each step is halved until the loss does not increase.
    for _ in range(_MAX_STEPS):
        slope, curvature = posterior.slope_and_curvature(point)
        eigenvalues, axes = np.linalg.eigh(curvature)
        step = axes @ (axes.T @ slope / np.maximum(np.abs(eigenvalues), _MIN_CURVATURE))
        # The margin's coefficient stays positive: limit the step towards 0, where halved steps would end otherwise.
        margin_step = step[-1] if posterior.margin_coefficient else 0.0
        fraction = min(1.0, _MAX_MARGIN_STEP_FRACTION * point[-1] / margin_step) if margin_step > 0.0 else 1.0
        while not (new_value := loss(point - fraction * step)) <= value and fraction > _MIN_STEP_FRACTION:
            fraction *= 0.5
        point, value = point - fraction * step, new_value
        if float(np.abs(fraction * step).max()) < _STEP_TOLERANCE:
            break
    curvature, beta = posterior.slope_and_curvature(point)[1], posterior.coefficients(point)
    evidence = -value - np.log(posterior.deviations).sum() - 0.5 * float(np.linalg.slogdet(curvature)[1])
    covariance: Floats = np.linalg.inv(curvature)[:size, :size].astype(np.float64)
    covariance[1] *= beta[1]
    covariance[:, 1] *= beta[1]
    margin_coefficient = float(beta[-1]) if posterior.margin_coefficient else 0.0
    return RegressionFit(beta[:size], covariance, float(evidence), margin_coefficient, posterior, point)
