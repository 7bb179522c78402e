"""Fit the failure modes of flights, each by a binary regression on the wind and the drawn quantities.

A flight fails in some mode, such as the slope of leg 12.  Its drawn quantities (drag, mass, ...) are known and often
decisive: an aircraft of low drag is too fast down one leg, an aircraft of high drag strays on another.  The probability
of each mode is a link function of a + b * wind + c . draws.  The modes are ordered, and each is fitted to the flights
that did not fail in an earlier mode.  Then, by the chain rule, the probability of success is the product of the modes'
probabilities of not failing, even if the modes are correlated.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.censored_regression import LINKS, BinaryLink, Outcomes, RegressionFit, fit_regression
from world.arrays import Floats

Bools = NDArray[np.bool_]


# ----------------------------------------------------------------------
# Distribution of the wind at which flights begin to fail, for flights of which only pass or fail is known.
#
# Each flight has its own wind above which it fails.  The distribution of this wind over flights is assumed to be
# normal, or Gumbel's distribution for minima with its longer tail, both equally likely a priori, with unknown mean and
# standard deviation.  The posterior is summed on a grid over distribution, mean and standard deviation, so that it is
# also valid for few flights, and for flights without a failure.


# Grid of the standard deviation of this wind, m/s, log-uniform: from a quarter of the required accuracy to a value that
# would leave no boundary.
_SIGMAS_MPS = np.geomspace(0.1, 5.0, 30)
# Step of the grid of the mean, m/s.
_MEAN_STEP_MPS = 0.1
# Extent of the grid below zero wind, m/s.
_GRID_BELOW_MPS = 5.0
# Extent of the grid above the largest wind of the search, m/s.
_GRID_ABOVE_MPS = 10.0


@dataclass(frozen=True)
class FailureWindDistributions:
    """Possible distributions of the wind above which a flight fails.

    There is one for each point of a grid of parameters.

    location, scale: parameters of the n distributions, m/s, (n,); mean and standard deviation of a normal distribution.
    normal_count: number of normal distributions, which come first; the others are Gumbel distributions with the same
        means and standard deviations.
    """

    location: Floats
    scale: Floats
    normal_count: int

    @classmethod
    def on_grid(cls, max_speed: float) -> "FailureWindDistributions":
        """Return normal and Gumbel distributions on a grid of mean and standard deviation.

        max_speed: strongest wind of the search, m/s.
        """
        means = np.arange(-_GRID_BELOW_MPS, max_speed + _GRID_ABOVE_MPS, _MEAN_STEP_MPS)
        mean, deviation = (grid.ravel() for grid in np.meshgrid(means, _SIGMAS_MPS, indexing="ij"))
        # Gumbel's distribution for minima: mean = location - gamma * scale, variance = (pi * scale)^2 / 6.
        scale = deviation * np.sqrt(6.0) / np.pi
        location = mean + np.euler_gamma * scale
        return cls(np.concatenate((mean, location)), np.concatenate((deviation, scale)), mean.size)

    def log_probabilities(self, speed: float) -> tuple[Floats, Floats]:
        """Return the log-probabilities that a flight fails in a wind, and that it succeeds.

        There is one of each for each distribution.

        Both are arrays (n,).

        speed: wind speed, m/s.
        """
        from scipy.special import log_ndtr
        from scipy.stats import gumbel_l

        standard = (speed - self.location) / self.scale
        normal, gumbel = standard[: self.normal_count], standard[self.normal_count :]
        log_failure = np.concatenate((log_ndtr(normal), gumbel_l.logcdf(gumbel)))
        return log_failure, np.concatenate((log_ndtr(-normal), gumbel_l.logsf(gumbel)))

    def quantile(self, fraction: float) -> Floats:
        """Return for each distribution the wind in which a fraction of the flights fails, m/s, (n,)."""
        from scipy.special import ndtri
        from scipy.stats import gumbel_l

        standard = np.full(self.scale.size, float(gumbel_l.ppf(fraction)))
        standard[: self.normal_count] = float(ndtri(fraction))
        return self.location + standard * self.scale

    def posterior_quantiles(
        self, fraction: float, speeds: Floats, flyable: NDArray[np.bool_], probabilities: Floats
    ) -> Floats:
        """Return posterior quantiles of the wind in which a fraction of the flights fails, m/s, (k,).

        fraction: the fraction of the flights that fail, above 0 and below 1.
        speeds: wind of each flight, m/s, (m,).
        flyable: True for a flyable flight, (m,).
        probabilities: probabilities of the quantiles, 0 to 1, (k,).
        """
        log_weights = np.zeros(self.location.size)
        # Numbers of failed and of flyable flights at each wind speed.
        counts_by_speed = {
            float(speed): (int((~flyable[speeds == speed]).sum()), int(flyable[speeds == speed].sum()))
            for speed in np.unique(speeds)
        }
        for speed, counts in counts_by_speed.items():
            log_failure, log_success = self.log_probabilities(speed)
            log_weights += counts[0] * log_failure + counts[1] * log_success
        weights = np.exp(log_weights - log_weights.max())
        values = self.quantile(fraction)
        order = np.argsort(values, kind="stable")
        cumulative = np.cumsum(weights[order] / weights.sum())
        return values[order][np.minimum(np.searchsorted(cumulative, probabilities), values.size - 1)]


# ----------------------------------------------------------------------
# One failure mode as a regression on the wind and the draws.
#
# The margins of passed flights are informative about failure only if both have the same cause.  For example, a flight
# that is too fast down a leg may fail by degrees, while gusts determine the slope margin of the flights that pass.  So
# the hypothesis with more evidence is chosen: one distribution for failures and margins (Tobin), or separate ones, in
# which margins say nothing about failure (Cragg, "Some statistical models for limited dependent variables with
# application to the demand for durable goods", Econometrica 39, 1971, of which the first is a special case).


@dataclass(frozen=True, slots=True)
class FailureMode:
    """Failure mode, such as the slope of leg 12, as a fitted regression.

    link: link function between the predictor and the probability of failure.
    mean, covariance: mean (2 + d,) and covariance (2 + d, 2 + d) of the coefficients of the mode's terms.
    sample: function that returns s equally likely sets of coefficients, (s, 2 + d).
    log_evidence: logarithm of the evidence of the outcomes, for this link.
    margin_coefficient: decrease of the predictor per scale of margin; 0 if margins say nothing about failure.
    """

    link: BinaryLink
    mean: Floats
    covariance: Floats
    sample: Callable[[], Floats]
    log_evidence: float
    margin_coefficient: float = 0.0


def fit_mode(terms: Floats, has_failed: Bools, margin: Floats, link: BinaryLink) -> FailureMode:
    """Fit the regression of one failure mode to n flights.

    The margins of passed flights are used if the joint model of failures and margins has more evidence than separate
    models.
    terms: regressors of each flight, see `make_regressors`, (n, 2 + d).
    has_failed: True for each flight that failed in this mode, (n,).
    margin: margin of each passed flight as a fraction of the rule's scale, (n,): 1 for the scale or more, 0 if unknown.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> wind = np.linspace(-5.0, 5.0, 200)
    >>> terms, failed, chance = np.column_stack((np.ones(200), wind)), wind > 2.0, np.random.default_rng(1).random(200)
    >>> fit_mode(terms, failed, (2.0 - wind).clip(0.0, 1.0), PROBIT).margin_coefficient > 0.0
    True
    >>> fit_mode(terms, failed, chance, PROBIT).margin_coefficient
    0.0
    """
    outcomes = Outcomes(terms, has_failed, np.where(has_failed, 0.0, margin))
    joint_fit = fit_regression(outcomes, link)
    if not outcomes.marginal.any():
        return _make_mode(link, joint_fit, joint_fit.log_evidence)
    failure_fit = fit_regression(outcomes.as_pass_or_fail(), link)
    passed_outcomes = outcomes.margins_given_pass()
    # The separate distribution of the margins may have either link.
    separate_evidence = failure_fit.log_evidence + max(
        fit_regression(passed_outcomes, margin_link, joint_fit).log_evidence for margin_link in LINKS
    )
    if separate_evidence > joint_fit.log_evidence:
        return _make_mode(link, failure_fit, separate_evidence)
    return _make_mode(link, joint_fit, joint_fit.log_evidence)


def _make_mode(link: BinaryLink, fit: RegressionFit, log_evidence: float) -> FailureMode:
    """Return the failure mode of a fit.

    log_evidence: logarithm of the evidence of failures and margins together, which may differ from the fit's.
    """
    return FailureMode(link, fit.mean, fit.covariance, fit.sample, log_evidence, fit.margin_coefficient)


# Origin of the wind in the regressors, m/s; the prior of the constant applies at this wind.
WIND_ORIGIN_MPS = 10.0


def make_regressors(speeds: Floats | float, draws: Floats) -> Floats:
    """Return the regressors of n flights, (n, 2 + d).

    The regressors are a constant 1, the wind speed minus `WIND_ORIGIN_MPS`, and the draws.

    speeds: wind speeds, m/s, (n,) or a single value for all flights.
    draws: drawn quantities, in standard deviations from their means, (n, d).
    """
    terms = np.empty((len(draws), 2 + draws.shape[1]))
    terms[:, 0] = 1.0
    terms[:, 1] = np.asarray(speeds) - WIND_ORIGIN_MPS
    terms[:, 2:] = draws
    return terms


def fit_modes(
    terms: Floats,
    failed_modes: Sequence[frozenset[Hashable]],
    link: BinaryLink,
    margin: Sequence[Mapping[Hashable, float] | None] = (),
) -> tuple[FailureMode, ...]:
    """Fit the failure modes of n flights one after another, the most frequent mode first.

    A flight that failed in a fitted mode is left out when the other modes are fitted.
    terms: regressors of each flight, see `make_regressors`, (n, 2 + d).
    failed_modes: modes in which each flight failed; empty for a flyable flight.
    margin: for each flight, the modes that it passed with a small margin, and the margin as a fraction of the rule's
        scale, 0 to 1, or 0 for an unknown margin.  All other modes were passed with at least the full scale.  None for
        a flight without known margins.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> speeds = np.linspace(0.0, 20.0, 200)
    >>> failed_modes = [frozenset({"slope"}) if speed > 12.0 else frozenset() for speed in speeds]
    >>> (mode,) = fit_modes(make_regressors(speeds, np.empty((200, 0))), failed_modes, PROBIT)
    >>> round(float(10.0 - mode.mean[0] / mode.mean[1]), 1)
    12.0
    """
    modes: list[FailureMode] = []
    margins = margin or [None] * len(failed_modes)
    is_remaining = np.ones(len(failed_modes), dtype=bool)
    while counts := Counter(
        mode
        for remains, flight_modes in zip(is_remaining, failed_modes, strict=True)
        if remains
        for mode in flight_modes
    ):
        # Ties are broken by name, as the order of a set differs between processes.
        most_common = min(counts, key=lambda mode: (-counts[mode], repr(mode)))
        has_failed = np.array([most_common in flight_modes for flight_modes in failed_modes])
        passed_margins = np.array(
            [
                0.0 if margins_of_flight is None else margins_of_flight.get(most_common, 1.0)
                for margins_of_flight in margins
            ]
        )
        modes.append(fit_mode(terms[is_remaining], has_failed[is_remaining], passed_margins[is_remaining], link))
        is_remaining &= ~has_failed
    return tuple(modes)


def failure_probabilities(modes: Sequence[FailureMode], terms: Floats) -> Floats:
    """Return each flight's probability of failing in at least one mode, (n,).

    It follows from the modes' mean coefficients.

    terms: regressors of each flight, see `make_regressors`, (n, 2 + d).
    """
    success: Floats = np.ones(len(terms))
    for mode in modes:
        success *= mode.link.survival(terms @ mode.mean)
    return 1.0 - success


def boundary_speed(modes: Sequence[FailureMode], draws: Floats, failing_fraction: float, max_speed: float) -> float:
    """Find by bisection the wind in which a fraction of the draws is expected to fail, m/s.

    Returns `max_speed` if a smaller fraction is expected to fail at that wind.

    draws: the drawn quantities, (m, d).
    failing_fraction: the fraction of the draws, 0 to 1.
    modes: fitted failure modes for one link; a flight succeeds if it fails in none of them.
    max_speed: strongest wind of the search, m/s.
    """
    mode_predictors = [
        (mode.link, make_regressors(WIND_ORIGIN_MPS, draws) @ mode.mean, float(mode.mean[1])) for mode in modes
    ]

    def reaches_fraction(speed: float) -> bool:
        """Return True if at least the failing fraction is expected to fail in a wind, m/s."""
        success: Floats = np.ones(len(draws))
        for link, predictor, wind_slope in mode_predictors:
            success *= link.survival(predictor + wind_slope * (speed - WIND_ORIGIN_MPS))
        return bool(1.0 - success.mean() >= failing_fraction)

    if not reaches_fraction(max_speed):
        return max_speed
    lower, upper = 0.0, max_speed
    while upper - lower > 1e-3:
        speed_between = 0.5 * (lower + upper)
        lower, upper = (lower, speed_between) if reaches_fraction(speed_between) else (speed_between, upper)
    return 0.5 * (lower + upper)


@dataclass(frozen=True)
class FailureFraction:
    """Fraction of flights that fail in a wind, and the derivatives of this fraction.

    share: the fraction, 0 to 1.
    slopes: derivatives with respect to the coefficients of each mode, arrays (2 + d,).
    wind_slope: derivative with respect to the wind, 1/(m/s).
    """

    share: float
    slopes: list[Floats]
    wind_slope: float


def failure_fraction(modes: Sequence[FailureMode], draws: Floats, speed: float) -> FailureFraction:
    """Return the expected fraction of failing flights in a wind, and its derivatives.

    draws: drawn quantities, (m, d).
    speed: wind speed, m/s.
    modes: fitted failure modes for one link.
    """
    terms = make_regressors(speed, draws)
    predictors = [terms @ mode.mean for mode in modes]
    success = [mode.link.survival(predictor) for mode, predictor in zip(modes, predictors, strict=True)]
    slopes, wind_slope = [], 0.0
    for number, mode in enumerate(modes):
        success_in_other_modes = np.prod(success[:number] + success[number + 1 :], axis=0)
        slopes.append(terms.T @ (mode.link.density(predictors[number]) * success_in_other_modes) / len(draws))
        wind_slope += float(slopes[-1][0] * mode.mean[1])
    return FailureFraction(1.0 - float(np.prod(success, axis=0).mean()), slopes, wind_slope)


def boundary_slopes(modes: Sequence[FailureMode], draws: Floats, speed: float) -> list[Floats]:
    """Return the derivatives of the boundary's wind speed by each mode's coefficients.

    There is one array (2 + d,) per mode.

    They are in m/s per unit of the coefficient, and follow from the implicit function theorem.

    modes: fitted failure modes for one link.
    draws: drawn quantities, (m, d).
    speed: wind speed at the boundary, m/s.
    """
    failing = failure_fraction(modes, draws, speed)
    # If more wind does not cause more failures, the boundary is unknown, and its derivatives become very large.
    return [-slope / max(failing.wind_slope, 1e-9) for slope in failing.slopes]
