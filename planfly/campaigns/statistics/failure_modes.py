"""The ways in which flights fail, one after another: a binary regression each on the wind and on what was drawn.

A flight that fails does so in some way, such as by the slope of leg 12.  What was drawn for it (drag, mass, ...) is
known, and often decides: a slippery aircraft is too fast down one leg, a draggy one strays on another.  The probability
of each way is a link's function of a + b * wind + c . draws.  The ways are put in order, and each is fitted to the
flights that did not fail in one before it, so that the probability to fly is the product of their complements whether
or not ways come together: the chain rule.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.censored_regression import LINKS, BinaryLink, Outcomes, RegressionFit, fit_regression

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


# ----------------------------------------------------------------------
# The wind at which flights begin to fail, as one law: for flights that tell no more than whether they were flyable.
#
# Each flight has a wind of its own above which it fails.  Over flights that wind is taken to be distributed normally or
# as the least of many (Gumbel's law for minima, whose tail is the longer one), each of mean and standard deviation
# unknown and as likely as the other before the first flight.  The posterior is summed on a grid over law, mean and
# standard deviation, so that it holds for few flights, too, and for none that failed.


# Of the standard deviation of the wind at which flights begin to fail, m/s: from a quarter of the accuracy wanted to
# what would leave no boundary; each factor as likely as any other.
_SPREADS = np.geomspace(0.1, 5.0, 30)
# Grid of the mean, m/s, and how far it goes beyond the winds that are looked at.
_STEP, _BELOW, _ABOVE = 0.1, 5.0, 10.0


@dataclass(frozen=True)
class FailureLaws:
    """The laws on the grid: (n,) arrays, normal ones first.

    location, scale: m/s; of the normal law its mean and standard deviation.
    normals: how many are normal; the others are Gumbel's of the same means and standard deviations.
    """

    location: Floats
    scale: Floats
    normals: int

    @classmethod
    def up_to(cls, most: float) -> "FailureLaws":
        """For winds up to this, m/s."""
        means = np.arange(-_BELOW, most + _ABOVE, _STEP)
        mean, spread = (grid.ravel() for grid in np.meshgrid(means, _SPREADS, indexing="ij"))
        # Of Gumbel's law for minima: mean = location - gamma * scale, variance = (pi * scale)^2 / 6.
        scale = spread * np.sqrt(6.0) / np.pi
        location = mean + np.euler_gamma * scale
        return cls(np.concatenate((mean, location)), np.concatenate((spread, scale)), mean.size)

    def log_shares(self, speed: float) -> tuple[Floats, Floats]:
        """(n,) logarithms of the probability to fail at a wind, m/s, and to fly."""
        from scipy.special import log_ndtr
        from scipy.stats import gumbel_l

        x = (speed - self.location) / self.scale
        normal, gumbel = x[: self.normals], x[self.normals :]
        fails = np.concatenate((log_ndtr(normal), gumbel_l.logcdf(gumbel)))
        return fails, np.concatenate((log_ndtr(-normal), gumbel_l.logsf(gumbel)))

    def quantile(self, share: float) -> Floats:
        """(n,) the wind at which this share of flights fails, m/s."""
        from scipy.special import ndtri
        from scipy.stats import gumbel_l

        standard = np.full(self.scale.size, float(gumbel_l.ppf(share)))
        standard[: self.normals] = float(ndtri(share))
        out: Floats = self.location + standard * self.scale
        return out

    def quantile_at(self, share: float, speeds: Floats, flyable: NDArray[np.bool_], parts: Floats) -> Floats:
        """(k,) the wind at which this share of flights fails, at these parts of its posterior, m/s.

        speeds, flyable: (m,) of the flights that were flown.  parts: (k,) 0 to 1.
        """
        logs = np.zeros(self.location.size)
        for speed, counts in _counted(speeds, flyable).items():
            fails, flies = self.log_shares(speed)
            logs += counts[0] * fails + counts[1] * flies
        weights = np.exp(logs - logs.max())
        values = self.quantile(share)
        order = np.argsort(values, kind="stable")
        summed = np.cumsum(weights[order] / weights.sum())
        out: Floats = values[order][np.minimum(np.searchsorted(summed, parts), values.size - 1)]
        return out


def _counted(speeds: Floats, flyable: NDArray[np.bool_]) -> dict[float, tuple[int, int]]:
    """How many failed and how many flew, by wind."""
    return {
        float(speed): (int((~flyable[speeds == speed]).sum()), int(flyable[speeds == speed].sum()))
        for speed in np.unique(speeds)
    }


# ----------------------------------------------------------------------
# One way of failing as a regression on the wind and what was drawn.
#
# By how little flights passed tells of failing only where both are of one kind: an aircraft that is too fast down a leg
# fails by degrees, whatever the gusts took of the slope of those that were not.  So of two hypotheses the one with more
# evidence is taken: one law for failing and for the margin of those that passed (Tobin's), or one for each, where the
# margin says nothing of failing (Cragg, "Some statistical models for limited dependent variables with application to
# the demand for durable goods", Econometrica 39, 1971, of which the first is a special case).


@dataclass(frozen=True, slots=True)
class FailureMode:
    """One way of failing.

    mean, covariance: (2 + d,) and (2 + d, 2 + d) of its coefficients, as those of the terms it was fitted to.
    sample: gives (s, 2 + d) of what the coefficients may be, each as likely as the other; rarely needed.
    log_evidence: of what came out, by this link.
    by_margin: by how much the predictor falls for a scale of margin; 0 where margins say nothing of failing.
    """

    link: BinaryLink
    mean: Floats
    covariance: Floats
    sample: Callable[[], Floats]
    log_evidence: float
    by_margin: float = 0.0


def fit_mode(terms: Floats, failed: Bools, margin: Floats, link: BinaryLink) -> FailureMode:
    """One way of failing of n flights, by one law with their margin or by its own, whichever has more evidence.

    terms: (n, 2 + d) of each flight: one, the wind from some origin, and what was drawn.
    failed: (n,).  margin: (n,) by what share of a scale each passed that did: 1 for a scale or more, 0 for not known.

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
        return _mode(link, one_law, one_law.log_evidence)
    alone, passes = fit_regression(outcomes.without_margin(), link), outcomes.only_margin()
    # The margin's own law, of whichever link, says nothing of failing's.
    two_laws = alone.log_evidence + max(fit_regression(passes, any_link, one_law).log_evidence for any_link in LINKS)
    if two_laws > one_law.log_evidence:
        return _mode(link, alone, two_laws)
    return _mode(link, one_law, one_law.log_evidence)


def _mode(link: BinaryLink, fit: RegressionFit, log_evidence: float) -> FailureMode:
    return FailureMode(link, fit.mean, fit.covariance, fit.sample, log_evidence, fit.by_margin)


# Winds are counted from here, m/s, where the constant's prior is meant.
ORIGIN = 10.0


def regressors(speeds: Floats | float, draws: Floats) -> Floats:
    """(n, 2 + d): one, the wind, and what was drawn.

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
    """The ways of failing of n flights, in order: the one in which most failed, then in which most of the others did.

    terms: (n, 2 + d), of `regressors`.
    failed: the ways in which each failed; none where it was flyable.
    margin: the ways that each passed narrowly, and by what share of a scale, 0 to 1, or 0 where it passed all the same;
    others were passed by a scale or more.  None of a flight of which that is not known.

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
        # By name where as many failed, as the order of a set is not the same in every process.
        common = min(counts, key=lambda way: (-counts[way], repr(way)))
        so = np.array([common in ways for ways in failed])
        passed_by = np.array([0.0 if some is None else some.get(common, 1.0) for some in margins])
        found.append(fit_mode(terms[left], so[left], passed_by[left], link))
        left &= ~so
    return tuple(found)


def fail_shares(modes: Sequence[FailureMode], terms: Floats) -> Floats:
    """(n,) probability to fail, in any way, of flights (n, 2 + d), by the modes' means."""
    flies: Floats = np.ones(len(terms))
    for mode in modes:
        flies *= mode.link.survival(terms @ mode.mean)
    return 1.0 - flies


def boundary_speed(modes: Sequence[FailureMode], draws: Floats, share: float, most: float) -> float:
    """The wind from 0 to ``most`` in which this share of draws (m, d) is expected to fail, m/s, found by bisection."""
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
    """The share of flights that fail in a wind, and its derivatives.

    slopes: (2 + d,) by each mode's coefficients.  by_wind: 1/(m/s).
    """

    share: float
    slopes: list[Floats]
    by_wind: float


def failing_share(modes: Sequence[FailureMode], draws: Floats, speed: float) -> FailingShare:
    """The share of draws (m, d) that is expected to fail in a wind, m/s."""
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
    """(2 + d,) the boundary's derivatives by each mode's coefficients, m/s: the implicit function theorem.

    draws: (m, d).  speed: the boundary, m/s.
    """
    at = failing_share(modes, draws, speed)
    # Where no more fail in more wind, nothing is known of the boundary.
    return [-one / max(at.by_wind, 1e-9) for one in at.slopes]
