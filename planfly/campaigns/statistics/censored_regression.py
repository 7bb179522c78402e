"""Regressions on the wind and what was drawn: of who failed, and by how little others passed.

The probability to fail is a link's function of a + b * wind + c . draws.  Three likelihoods are had of it:

- of who failed alone, a binary regression;
- of who failed and by how little others passed, by one law: the share of flights that pass by less than some margin is
  the same function with k * margin added, k of it to a scale's length, so that the margin has the link's law and 1/k is
  its scale.  Of a failed flight only that it failed counts, of one that passed by a scale or more only that, so that no
  law is asked to hold far from failing: a regression censored on both sides (Tobin, "Estimation of relationships for
  limited dependent variables", Econometrica 26, 1958; Rosett and Nelson, "Estimation of the two-limit probit regression
  model", Econometrica 43, 1975);
- of the margin alone, given that a flight passed: the same regression truncated at no margin.

Priors are weak and normal, of b's logarithm and of the others themselves.  Which flight tells most, and the evidence
for a link and for how wide a prior the draws' coefficients have, follow from the posterior as normal about its mode
(Gelman et al., Bayesian Data Analysis, 3rd edition, 2013, chapters 4.1, 7.4 and 16.3; MacKay, "Bayesian Interpolation",
Neural Computation 4, 1992).  Where few flights failed it is far from that: the boundary rests on a sample of the
posterior itself (`importance_sampling`).

statsmodels 0.15 has no regression censored on both sides and no priors: its Probit needs 1.6 to 1.7 times the flights
for the same error of the boundary (64 for 40, 139 for 80), and of 20 flights gives none in one case of nine.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


# ----------------------------------------------------------------------
# The links of a binary regression: the probability to fail as a function of a linear predictor.
#
# `PROBIT` is that of a threshold which is distributed normally; `CLOGLOG` (complementary log-log) that of the least of
# many thresholds, Gumbel's law for minima, whose tail towards little wind is the longer one (McCullagh and Nelder,
# Generalized Linear Models, 2nd edition, 1989, section 4.3).


# exp of more than this is more than any number; and the least number that is not taken as none.
_MAX_EXPONENT, _MIN_PROBABILITY = 700.0, 1e-300


class BinaryLink(Protocol):
    """All of predictors in an array of any shape, and each of the same shape."""

    def log_cdf(self, x: Floats) -> Floats:
        """Logarithm of the probability to fail."""

    def log_survival(self, x: Floats) -> Floats:
        """Logarithm of the probability to fly."""

    def survival(self, x: Floats) -> Floats:
        """Probability to fly."""

    def density(self, x: Floats) -> Floats:
        """Derivative of the probability to fail."""

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        """Fisher's, of a flight about its predictor.

        width: of predictors above its own; a flight that passed by less than this states its margin, so that 0 is
        for one that states only whether it failed.
        """

    def derivatives(self, x: Floats, failed: Bools) -> tuple[Floats, Floats]:
        """First and second derivative of the logarithm of the probability of what came out."""

    def log_density(self, x: Floats) -> Floats:
        """Logarithm of `density`."""

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        """First and second derivative of `log_density`."""


class _Probit:
    def log_cdf(self, x: Floats) -> Floats:
        from scipy.special import log_ndtr

        out: Floats = log_ndtr(x)
        return out

    def log_survival(self, x: Floats) -> Floats:
        return self.log_cdf(-x)

    def survival(self, x: Floats) -> Floats:
        from scipy.special import ndtr

        out: Floats = ndtr(-x)
        return out

    def density(self, x: Floats) -> Floats:
        out: Floats = np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)
        return out

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        from scipy.special import ndtr

        more = x + width
        # Of one that fails and of one that passes by more, and between them the law's mean square there.
        ends = self.density(x) ** 2 / np.maximum(ndtr(x), _MIN_PROBABILITY) + self.density(more) ** 2 / np.maximum(
            ndtr(-more), _MIN_PROBABILITY
        )
        between = ndtr(more) - ndtr(x) - more * self.density(more) + x * self.density(x)
        out: Floats = ends + np.maximum(between, 0.0)
        return out

    def derivatives(self, x: Floats, failed: Bools) -> tuple[Floats, Floats]:
        from scipy.special import log_ndtr

        sign = np.where(failed, 1.0, -1.0)
        z = sign * x
        # By logarithms, for Phi is 0 long before its logarithm's derivative is.
        ratio = np.exp(-0.5 * z * z - 0.5 * np.log(2.0 * np.pi) - log_ndtr(z))
        return sign * ratio, -ratio * (z + ratio)

    def log_density(self, x: Floats) -> Floats:
        out: Floats = -0.5 * x * x - 0.5 * np.log(2.0 * np.pi)
        return out

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        return -x, np.full_like(x, -1.0)


class _ComplementaryLogLog:
    def log_cdf(self, x: Floats) -> Floats:
        with np.errstate(divide="ignore"):
            # Where the rate is 0, the probability is the rate.
            out: Floats = np.where(x < -30.0, x, np.log(-np.expm1(self.log_survival(x))))
        return out

    def log_survival(self, x: Floats) -> Floats:
        out: Floats = -np.exp(np.minimum(x, _MAX_EXPONENT))
        return out

    def survival(self, x: Floats) -> Floats:
        out: Floats = np.exp(self.log_survival(x))
        return out

    def density(self, x: Floats) -> Floats:
        out: Floats = np.exp(x - np.exp(np.minimum(x, _MAX_EXPONENT)))
        return out

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        rate, more = (np.exp(np.clip(at, -_MAX_EXPONENT, 0.5 * _MAX_EXPONENT)) for at in (x, x + width))
        # As the probit's: of those that fail rate * ratio * exp(-rate), of the others by integrals over the rate.
        fails = rate * _rate_ratio(rate) * np.exp(-rate)
        between = np.maximum(_square_above(rate) - _square_above(more), 0.0)
        out: Floats = fails + between + more * more * np.exp(-more)
        return out

    def derivatives(self, x: Floats, failed: Bools) -> tuple[Floats, Floats]:
        rate = np.exp(np.clip(x, -_MAX_EXPONENT, 0.5 * _MAX_EXPONENT))
        first = _rate_ratio(rate)
        second = first * (1.0 - rate - first)
        return np.where(failed, first, -rate), np.where(failed, np.minimum(second, 0.0), -rate)

    def log_density(self, x: Floats) -> Floats:
        out: Floats = x - np.exp(np.minimum(x, _MAX_EXPONENT))
        return out

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        rate = np.exp(np.minimum(x, 0.5 * _MAX_EXPONENT))
        return 1.0 - rate, -rate


def _square_above(rate: Floats) -> Floats:
    """Integral of (1 - r)^2 exp(-r) from a rate on."""
    out: Floats = (rate * rate + 1.0) * np.exp(-rate)
    return out


def _rate_ratio(rate: Floats) -> Floats:
    """Rate / (exp(rate) - 1): near 1 for a small rate, 0 for a large one."""
    with np.errstate(over="ignore"):
        out: Floats = rate / np.expm1(rate)
    return out


PROBIT: BinaryLink = _Probit()
CLOGLOG: BinaryLink = _ComplementaryLogLog()
LINKS = (PROBIT, CLOGLOG)


# ----------------------------------------------------------------------
# A sample of a distribution of which only the density's logarithm, up to a constant, can be had.
#
# Importance sampling (Robert and Casella, Monte Carlo Statistical Methods, 2nd edition, 2004, chapters 3.3 and 14.3):
# the
# points are those of a multivariate t distribution about the mode, whose tails are longer than a posterior's, evenly
# spread by Sobol's sequence; each weighs by how much likelier it is than t has it.  They are then drawn again by their
# weights, so that all that are left weigh the same: systematically in the order of the first coordinate (Kitagawa,
# "Monte
# Carlo filter and smoother for non-Gaussian nonlinear state space models", Journal of Computational and Graphical
# Statistics 5, 1996), for in the order of the sequence, which repeats itself, every second point may be on one side.

# Degrees of freedom of the t distribution, and how many of its points are weighed for each that is left.
_FREEDOM, _WEIGHED = 6.0, 2
_SEED = 1


def importance_sample(
    log_density: Callable[[Floats], Floats], middle: Floats, covariance: Floats, count: int
) -> Floats:
    """(count, k) points of a distribution, each as likely as the other, in no order; most even in the first coordinate.

    log_density: of (n, k) points (n,), up to a constant; -inf where there is none.
    middle, covariance: (k,) and (k, k), about those of the distribution.  count: a power of two.
    Raises LinAlgError where the covariance is not positive definite.

    >>> sample = importance_sample(lambda x: -0.5 * x[:, 0] ** 2, np.ones(1), np.eye(1), 256)
    >>> round(float(sample.std()), 1)
    1.0
    """
    standard, log_proposal = _t_points(middle.size, _WEIGHED * count)
    points = middle + standard @ np.linalg.cholesky(covariance).T
    logs = log_density(points) - log_proposal
    order = np.argsort(points[:, 0], kind="stable")
    summed = np.cumsum(np.exp(logs - logs.max())[order])
    steps = (np.arange(count) + 0.5) / count
    kept = order[np.searchsorted(summed / summed[-1], steps).clip(0, order.size - 1)]
    out: Floats = np.random.default_rng(_SEED).permutation(points[kept])
    return out


@lru_cache
def _t_points(size: int, count: int) -> tuple[Floats, Floats]:
    """(count, size) points of the standard t distribution, and (count,) the logarithm of its density there."""
    from scipy.stats import chi2, norm, qmc

    # A power of two: the points of Sobol's sequence are balanced then.
    shares = qmc.Sobol(size + 1, seed=_SEED).random(count).clip(1e-12, 1.0 - 1e-12)
    points = norm.ppf(shares[:, :size]) / np.sqrt(chi2.ppf(shares[:, size:], _FREEDOM) / _FREEDOM)
    return points, -0.5 * (_FREEDOM + size) * np.log1p((points * points).sum(axis=1) / _FREEDOM)


# Standard deviation of the prior of the constant.  More wind never has fewer fail: the wind's coefficient, 1/(m/s), is
# above 0, and its logarithm normal; it changes a probit by one within 0.3 to 14 m/s at 95 %.
_CONSTANT, _WIND, _WIND_FACTOR = 20.0, 0.5, 1.0
# Of the draws' coefficients, a draw being in units of its own standard deviation: of these the one that flights are
# most evidence for.  Where draws decide little, a wide prior for them would have chance look like knowledge.
_DRAWS = (0.1, 0.4, 1.5)
# Of the margin's coefficient, 1/scale, of which only what is above 0 is meant.
_MARGIN = 10.0
# Where Newton's method begins: few fail, and more in more wind; and of the margin's coefficient.
_START, _MARGIN_START = (-3.0, np.log(0.3)), 1.0
_STEPS, _CONVERGED, _MIN_SHARE, _MIN_CURVATURE, _MAX_LOGARITHM = 100, 1e-8, 1e-9, 1e-9, 5.0
_OF_THE_WAY = 0.9
# Of a flight that passed, on either link's scale.
_MAX_PREDICTOR = 30.0
# Points of a posterior's sample.
_SAMPLE = 512


@dataclass(frozen=True, slots=True)
class Outcomes:
    """What came of n flights by one way.

    terms: (n, 2 + d) of each flight: one, the wind from some origin, and what was drawn.
    failed: (n,).
    margin: (n,) by what share of a scale each passed: 1 for a scale or more, 0 for not known or failed.
    given_passed: whether that a flight passed is given, and only by how much counts.
    """

    terms: Floats
    failed: Bools
    margin: Floats
    given_passed: bool = False

    @property
    def narrow(self) -> Bools:
        """(n,) which passed by less than a scale, and by how much."""
        return (self.margin > 0.0) & (self.margin < 1.0)

    def without_margin(self) -> "Outcomes":
        """Who failed alone."""
        return Outcomes(self.terms, self.failed, np.zeros_like(self.margin))

    def only_margin(self) -> "Outcomes":
        """Of those that passed with a margin that is known, by how much alone."""
        known = self.margin > 0.0
        return Outcomes(self.terms[known], self.failed[known], self.margin[known], given_passed=True)


@dataclass(frozen=True)
class RegressionFit:
    """A posterior.

    mean, covariance: (2 + d,) and (2 + d, 2 + d) of the coefficients of the terms, as of a normal law about the mode.
    log_evidence: of what came out.
    by_margin: by how much the predictor falls for a scale of margin; 0 where no margin is known.
    """

    mean: Floats
    covariance: Floats
    log_evidence: float
    by_margin: float
    _posterior: "_Posterior"
    _mode: Floats

    def sample(self) -> Floats:
        """(s, 2 + d) coefficients of the terms, each as likely as the other, the wind's above 0."""
        return self._posterior.sample(self._mode)


def fit_regression(outcomes: Outcomes, link: BinaryLink, near: RegressionFit | None = None) -> RegressionFit:
    """The regression by the prior of the draws' coefficients that has the most evidence.

    near: another, of the same coefficients, whose mode is a place to look from, too; that of margin alone may have two.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> wind = np.linspace(-5.0, 5.0, 200)
    >>> margin = 2.0 - wind
    >>> outcomes = Outcomes(np.column_stack((np.ones(200), wind)), margin < 0.0, margin.clip(0.0, 1.0))
    >>> fit = fit_regression(outcomes, PROBIT)
    >>> round(float(-fit.mean[0] / fit.mean[1]), 1)
    2.0
    """
    # Where nothing is known of what is drawn, its coefficients' prior is none's.
    priors = _DRAWS if outcomes.terms.shape[1] > 2 else _DRAWS[:1]
    fits = []
    for deviation in priors:
        posterior = _Posterior(outcomes, link, deviation)
        fits += [
            _fit(posterior, at) for at in ([posterior.start()] if near is None else [posterior.start(), near._mode])
        ]
    return max(fits, key=lambda fit: fit.log_evidence)


class _Posterior:
    """Of coefficients, but that the wind's is its logarithm; the margin's is the last where some margin is known.

    deviation: of the prior of the draws' coefficients.
    """

    def __init__(self, outcomes: Outcomes, link: BinaryLink, deviation: float) -> None:
        self._outcomes, self._link, self._narrow = outcomes, link, outcomes.narrow
        self.by_margin = bool(self._narrow.any())
        self.size = outcomes.terms.shape[1]
        deviations = np.full(self.size, deviation)
        deviations[:2] = _CONSTANT, _WIND_FACTOR
        # The margin is a regressor of what passed: F(terms . beta + k * margin) is the share that passes by less.
        self._terms = np.column_stack((outcomes.terms, outcomes.margin)) if self.by_margin else outcomes.terms
        self.deviations = np.append(deviations, _MARGIN) if self.by_margin else deviations
        self._precision = self.deviations**-2
        self._middle = np.zeros(self.deviations.size)
        self._middle[1] = np.log(_WIND)

    def start(self) -> Floats:
        """Where to look first."""
        at = np.zeros(self.deviations.size)
        at[:2] = _START
        if self.by_margin:
            at[-1] = _MARGIN_START
        return at

    def coefficients(self, points: Floats) -> Floats:
        """What terms are multiplied by, at any number of points."""
        beta = points.copy()
        beta[..., 1] = np.exp(np.minimum(points[..., 1], _MAX_LOGARITHM))
        return beta

    def log_density(self, points: Floats) -> Floats:
        """(n,) at n points, but for what no coefficient changes."""
        beta, off, failed = self.coefficients(points), points - self._middle, self._outcomes.failed
        x = self._terms @ beta.T
        bare = self._outcomes.terms @ beta[:, : self.size].T if self.by_margin else x
        # As good as impossible, and of its logarithm's own size nothing is left of what is added to it.
        possible = (bare[~failed] < _MAX_PREDICTOR).all(axis=0)
        x, bare = np.where(possible, x, 0.0), np.where(possible, bare, 0.0)
        logs: Floats = -0.5 * (off * off) @ self._precision
        logs += self._link.log_cdf(x[failed]).sum(axis=0)
        logs += self._link.log_survival(x[~failed & ~self._narrow]).sum(axis=0)
        if self.by_margin:
            possible &= beta[:, -1] > 0.0
            logs += self._link.log_density(x[self._narrow]).sum(axis=0)
            logs += self._narrow.sum() * np.log(np.where(possible, beta[:, -1], 1.0))
        if self._outcomes.given_passed:
            logs -= self._link.log_survival(bare).sum(axis=0)
        return np.where(possible, logs, -np.inf)

    def sample(self, mode: Floats) -> Floats:
        """(s, size) coefficients of the terms, each as likely as the other.

        Of few failures the wind's coefficient is known within factors, and the constant follows from it: points are
        spread over the predictor in the wind in which it is best known, where it does not.
        """
        eigenvalues, axes = np.linalg.eigh(self.slope_and_curvature(mode)[1])
        covariance = axes / np.maximum(np.abs(eigenvalues), _MIN_CURVATURE) @ axes.T
        best_known = -covariance[0, 1] / (covariance[1, 1] * np.exp(mode[1]))
        # By the predictor there, or by the constant: the one's density is the other's.
        turn = np.eye(mode.size)
        turn[0, 1] = best_known * np.exp(mode[1])
        middle = mode.copy()
        middle[0] += best_known * np.exp(mode[1])

        def constants(points: Floats) -> Floats:
            out = points.copy()
            out[:, 0] -= best_known * self.coefficients(points)[:, 1]
            return out

        points = importance_sample(
            lambda points: self.log_density(constants(points)), middle, turn @ covariance @ turn.T, _SAMPLE
        )
        return self.coefficients(constants(points))[:, : self.size]

    def slope_and_curvature(self, at: Floats) -> tuple[Floats, Floats]:
        """First and second derivatives of the negative logarithm of the density."""
        beta, scale = self.coefficients(at), np.ones(at.size)
        x, terms = self._terms @ beta, self._terms
        first, second = self._link.derivatives(x, self._outcomes.failed)
        if self.by_margin:
            of_first, of_second = self._link.density_derivatives(x)
            first, second = np.where(self._narrow, of_first, first), np.where(self._narrow, of_second, second)
        slope, curvature = -terms.T @ first, -(terms * second[:, None]).T @ terms
        if self._outcomes.given_passed:
            bare = self._outcomes.terms
            first, second = self._link.derivatives(self._at_no_margin(beta), self._outcomes.failed)
            slope[: self.size] += bare.T @ first
            curvature[: self.size, : self.size] += (bare * second[:, None]).T @ bare
        if self.by_margin:
            count = int(self._narrow.sum())
            slope[-1] -= count / beta[-1]
            curvature[-1, -1] += count / beta[-1] ** 2
        # By the logarithm of the wind's coefficient.
        scale[1] = beta[1]
        slope, curvature = scale * slope, scale[:, None] * curvature * scale
        curvature[1, 1] += slope[1]
        return slope + self._precision * (at - self._middle), curvature + np.diag(self._precision)

    def _at_no_margin(self, beta: Floats) -> Floats:
        return self._outcomes.terms @ beta[: self.size]


def _fit(posterior: _Posterior, at: Floats) -> RegressionFit:
    """The posterior's mode, looked for from a point, and the inverse of its curvature there.

    By Newton's method with halved steps; where the loss is not convex, which that of margin alone need not be, by the
    curvature's absolute eigenvalues (Nocedal and Wright, Numerical Optimization, 2nd edition, 2006, sections 3.4 and
    19.2).
    """
    size = posterior.size

    def loss(point: Floats) -> float:
        return -float(posterior.log_density(point[None])[0])

    value = loss(at)
    for _ in range(_STEPS):
        slope, curvature = posterior.slope_and_curvature(at)
        eigenvalues, axes = np.linalg.eigh(curvature)
        step = axes @ (axes.T @ slope / np.maximum(np.abs(eigenvalues), _MIN_CURVATURE))
        # The margin's coefficient is above 0: towards it only so much of the way, where halves would end at it.
        towards = step[-1] if posterior.by_margin else 0.0
        share = min(1.0, _OF_THE_WAY * at[-1] / towards) if towards > 0.0 else 1.0
        while not (tried := loss(at - share * step)) <= value and share > _MIN_SHARE:
            share *= 0.5
        at, value = at - share * step, tried
        if float(np.abs(share * step).max()) < _CONVERGED:
            break
    curvature, beta = posterior.slope_and_curvature(at)[1], posterior.coefficients(at)
    evidence = -value - np.log(posterior.deviations).sum() - 0.5 * float(np.linalg.slogdet(curvature)[1])
    covariance: Floats = np.linalg.inv(curvature)[:size, :size].astype(np.float64)
    covariance[1] *= beta[1]
    covariance[:, 1] *= beta[1]
    by_margin = float(beta[-1]) if posterior.by_margin else 0.0
    return RegressionFit(beta[:size], covariance, float(evidence), by_margin, posterior, at)
