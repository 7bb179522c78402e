"""Failure modes of flights: for each a binary regression on the wind and the drawn quantities.

A flight fails in some mode, such as the slope of leg 12.  Its drawn quantities (drag, mass, ...) are known and often
decisive: an aircraft of low drag is too fast down one leg, an aircraft of high drag strays on another.  The probability
of each mode is a link function of a + b * wind + c . draws.  The modes are ordered, and each is fitted to the flights
that did not fail in an earlier mode, so that by the chain rule the probability of success is the product of their
complements, even if modes are correlated.
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
# Distribution of the wind at which flights begin to fail, for flights with nothing known but pass or fail.
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
class FailureLaws:
    """Distributions on the grid: (n,) arrays, normal ones first.

    location, scale: m/s; mean and standard deviation of a normal distribution.
    normals: number of normal distributions; the others are Gumbel distributions of the same means and deviations.
    """

    location: Floats
    scale: Floats
    normals: int

    @classmethod
    def up_to(cls, most: float) -> "FailureLaws":
        """Make the grid for winds up to ``most``, m/s."""
        means = np.arange(-_GRID_BELOW_MPS, most + _GRID_ABOVE_MPS, _MEAN_STEP_MPS)
        mean, spread = (grid.ravel() for grid in np.meshgrid(means, _SIGMAS_MPS, indexing="ij"))
        # Gumbel's distribution for minima: mean = location - gamma * scale, variance = (pi * scale)^2 / 6.
        scale = spread * np.sqrt(6.0) / np.pi
        location = mean + np.euler_gamma * scale
        return cls(np.concatenate((mean, location)), np.concatenate((spread, scale)), mean.size)

    def log_shares(self, speed: float) -> tuple[Floats, Floats]:
        """Return the logarithms (n,) of the probabilities of failure and of success at a wind, m/s."""
        from scipy.special import log_ndtr
        from scipy.stats import gumbel_l

        x = (speed - self.location) / self.scale
        normal, gumbel = x[: self.normals], x[self.normals :]
        fails = np.concatenate((log_ndtr(normal), gumbel_l.logcdf(gumbel)))
        return fails, np.concatenate((log_ndtr(-normal), gumbel_l.logsf(gumbel)))

    def quantile(self, share: float) -> Floats:
        """Return the wind (n,) at which this share of flights fails, m/s."""
        from scipy.special import ndtri
        from scipy.stats import gumbel_l

        standard = np.full(self.scale.size, float(gumbel_l.ppf(share)))
        standard[: self.normals] = float(ndtri(share))
        return self.location + standard * self.scale

    def quantile_at(self, share: float, speeds: Floats, flyable: NDArray[np.bool_], parts: Floats) -> Floats:
        """Return quantiles (k,) of the posterior of the wind at which this share of flights fails, m/s.

        speeds, flyable: (m,) winds and outcomes of the flights.  parts: (k,) probabilities of the quantiles, 0 to 1.
        """
        logs = np.zeros(self.location.size)
        for speed, counts in _counts_by_wind(speeds, flyable).items():
            fails, flies = self.log_shares(speed)
            logs += counts[0] * fails + counts[1] * flies
        weights = np.exp(logs - logs.max())
        values = self.quantile(share)
        order = np.argsort(values, kind="stable")
        summed = np.cumsum(weights[order] / weights.sum())
        return values[order][np.minimum(np.searchsorted(summed, parts), values.size - 1)]


def _counts_by_wind(speeds: Floats, flyable: NDArray[np.bool_]) -> dict[float, tuple[int, int]]:
    """Return the numbers of failed and of flyable flights, by wind."""
    return {
        float(speed): (int((~flyable[speeds == speed]).sum()), int(flyable[speeds == speed].sum()))
        for speed in np.unique(speeds)
    }


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
    """One failure mode.

    mean, covariance: (2 + d,) and (2 + d, 2 + d) of the coefficients of its terms.
    sample: returns (s, 2 + d) equally likely coefficients; rarely needed.
    log_evidence: logarithm of the evidence of the outcomes, for this link.
    by_margin: decrease of the predictor per scale of margin; 0 if margins say nothing about failure.
    """

    link: BinaryLink
    mean: Floats
    covariance: Floats
    sample: Callable[[], Floats]
    log_evidence: float
    by_margin: float = 0.0


def fit_mode(terms: Floats, failed: Bools, margin: Floats, link: BinaryLink) -> FailureMode:
    """Fit a failure mode of n flights, jointly with their margins or alone, whichever has more evidence.

    terms: (n, 2 + d) terms of each flight: one, the wind relative to some origin, and the draws.
    failed: (n,).  margin: (n,) margin of each passed flight as a fraction of a scale: 1 for a scale or more, 0 for
    unknown.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> wind = np.linspace(-5.0, 5.0, 200)
    >>> terms, failed, chance = np.column_stack((np.ones(200), wind)), wind > 2.0, np.random.default_rng(1).random(200)
    >>> fit_mode(terms, failed, (2.0 - wind).clip(0.0, 1.0), PROBIT).by_margin > 0.0
    True
    >>> fit_mode(terms, failed, chance, PROBIT).by_margin
    0.0
    """
    outcomes = Outcomes(terms, failed, np.where(failed, 0.0, margin))
    one_law = fit_regression(outcomes, link)
    if not outcomes.narrow.any():
        return _make_mode(link, one_law, one_law.log_evidence)
    alone, passes = fit_regression(outcomes.without_margin(), link), outcomes.only_margin()
    # The separate distribution of the margins may have either link.
    two_laws = alone.log_evidence + max(fit_regression(passes, any_link, one_law).log_evidence for any_link in LINKS)
    if two_laws > one_law.log_evidence:
        return _make_mode(link, alone, two_laws)
    return _make_mode(link, one_law, one_law.log_evidence)


def _make_mode(link: BinaryLink, fit: RegressionFit, log_evidence: float) -> FailureMode:
    return FailureMode(link, fit.mean, fit.covariance, fit.sample, log_evidence, fit.by_margin)


# Origin of the wind in the terms, m/s, to which the prior of the constant applies.
ORIGIN = 10.0


def regressors(speeds: Floats | float, draws: Floats) -> Floats:
    """Return the terms (n, 2 + d) of flights: one, the wind relative to `ORIGIN`, and the draws.

    speeds: (n,) or one for all, m/s.  draws: (n, d) in standard deviations from their means.
    """
    out = np.empty((len(draws), 2 + draws.shape[1]))
    out[:, 0] = 1.0
    out[:, 1] = np.asarray(speeds) - ORIGIN
    out[:, 2:] = draws
    return out


def fit_modes(
    terms: Floats,
    failed: Sequence[frozenset[Hashable]],
    link: BinaryLink,
    margin: Sequence[Mapping[Hashable, float] | None] = (),
) -> tuple[FailureMode, ...]:
    """Fit the failure modes of n flights, the most frequent first, then the most frequent among the other flights.

    terms: (n, 2 + d), of `regressors`.
    failed: modes in which each flight failed; empty if it was flyable.
    margin: modes that each flight passed narrowly, with the margin as a fraction of a scale, 0 to 1, or 0 for a pass of
    unknown margin; other modes were passed by a scale or more.  None for a flight without known margins.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> speeds = np.linspace(0.0, 20.0, 200)
    >>> ways = [frozenset({"slope"}) if speed > 12.0 else frozenset() for speed in speeds]
    >>> (mode,) = fit_modes(regressors(speeds, np.empty((200, 0))), ways, PROBIT)
    >>> round(float(10.0 - mode.mean[0] / mode.mean[1]), 1)
    12.0
    """
    found: list[FailureMode] = []
    margins = margin or [None] * len(failed)
    left = np.ones(len(failed), dtype=bool)
    while counts := Counter(way for here, ways in zip(left, failed, strict=True) if here for way in ways):
        # Ties are broken by name, as the order of a set differs between processes.
        common = min(counts, key=lambda way: (-counts[way], repr(way)))
        so = np.array([common in ways for ways in failed])
        passed_by = np.array([0.0 if some is None else some.get(common, 1.0) for some in margins])
        found.append(fit_mode(terms[left], so[left], passed_by[left], link))
        left &= ~so
    return tuple(found)


def fail_shares(modes: Sequence[FailureMode], terms: Floats) -> Floats:
    """Return the failure probability (n,), in any mode, of flights (n, 2 + d), by the means of the modes."""
    flies: Floats = np.ones(len(terms))
    for mode in modes:
        flies *= mode.link.survival(terms @ mode.mean)
    return 1.0 - flies


def boundary_speed(modes: Sequence[FailureMode], draws: Floats, share: float, most: float) -> float:
    """Find the wind from 0 to ``most`` in which this share of draws (m, d) is expected to fail, m/s, by bisection."""
    still = [(mode.link, regressors(ORIGIN, draws) @ mode.mean, float(mode.mean[1])) for mode in modes]

    def fails(speed: float) -> bool:
        flies: Floats = np.ones(len(draws))
        for link, x, by_wind in still:
            flies *= link.survival(x + by_wind * (speed - ORIGIN))
        return bool(1.0 - flies.mean() >= share)

    if not fails(most):
        return most
    low, high = 0.0, most
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return 0.5 * (low + high)


@dataclass(frozen=True)
class FailingShare:
    """Share of flights that fail in a wind, and its derivatives.

    slopes: (2 + d,) derivatives by the coefficients of each mode.  by_wind: derivative by the wind, 1/(m/s).
    """

    share: float
    slopes: list[Floats]
    by_wind: float


def failing_share(modes: Sequence[FailureMode], draws: Floats, speed: float) -> FailingShare:
    """Return the share of draws (m, d) that is expected to fail in a wind, m/s."""
    terms = regressors(speed, draws)
    predictors = [terms @ mode.mean for mode in modes]
    flies = [mode.link.survival(x) for mode, x in zip(modes, predictors, strict=True)]
    slopes, by_wind = [], 0.0
    for k, mode in enumerate(modes):
        others = np.prod(flies[:k] + flies[k + 1 :], axis=0)
        slopes.append(terms.T @ (mode.link.density(predictors[k]) * others) / len(draws))
        by_wind += float(slopes[-1][0] * mode.mean[1])
    return FailingShare(1.0 - float(np.prod(flies, axis=0).mean()), slopes, by_wind)


def boundary_slopes(modes: Sequence[FailureMode], draws: Floats, speed: float) -> list[Floats]:
    """Return the boundary's derivatives (2 + d,) by each mode's coefficients, m/s, by the implicit function theorem.

    draws: (m, d).  speed: the boundary, m/s.
    """
    at = failing_share(modes, draws, speed)
    # If more wind does not cause more failures, nothing is known about the boundary.
    return [-one / max(at.by_wind, 1e-9) for one in at.slopes]
