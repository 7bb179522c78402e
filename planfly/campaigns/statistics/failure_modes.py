"""The ways in which flights fail, one after another: a binary regression each on the wind and on what was drawn.

A flight that fails does so in some way, such as by the slope of leg 12.  What was drawn for it (drag, mass, ...) is
known, and often decides: a slippery aircraft is too fast down one leg, a draggy one strays on another.  The probability
of each way is a link's function of a + b * wind + c . draws.  The ways are put in order, and each is fitted to the
flights that did not fail in one before it, so that the probability to fly is the product of their complements whether
or not ways come together: the chain rule.

A flight that passed narrowly tells more than that it did not fail: by how much.  The predictor is taken to fall in
proportion to that room, k of it to a scale's length, so that the room has the link's law and its scale is 1/k.  Of a
failed flight only that it failed counts, of one that passed by a scale or more only that, so that no law is asked to
hold far from failing: a regression censored on both sides (Tobin, "Estimation of relationships for limited dependent
variables", Econometrica 26, 1958; Rosett and Nelson, "Estimation of the two-limit probit regression model",
Econometrica 43, 1975).

The posterior of (a, b, c) is taken as normal about its mode, under a weak normal prior (Gelman et al., Bayesian Data
Analysis, 3rd edition, 2013, chapters 4.1 and 16.3); the evidence for a link, and for how wide a prior the draws'
coefficients have, follows from it (section 7.4; MacKay, "Bayesian Interpolation", Neural Computation 4, 1992).
"""

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.links import BinaryLink

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Winds are counted from here, m/s, where the constant's prior is meant.
_ORIGIN = 10.0
# Standard deviations of the prior: of the constant, and of the wind's coefficient, 1/(m/s).
_CONSTANT, _WIND = 20.0, 1.5
# Of the draws' coefficients, a draw being in units of its own standard deviation: of these the one that flights are
# most evidence for.  Where draws decide little, much room for them would have chance look like knowledge.
_DRAWS = (0.1, 0.4, 1.5)
# Standard deviation of the room's coefficient's prior, in a scale, of which only what is above 0 is meant.
_ROOM = 10.0
# Where Newton's method begins: few fail, and more in more wind; and of the room's coefficient.
_START, _ROOM_START = (-3.0, 0.3), 1.0
_STEPS, _CONVERGED, _LEAST_SHARE = 100, 1e-8, 1e-9


@dataclass(frozen=True, slots=True)
class FailureMode:
    """One way of failing.

    mean, covariance: (2 + d,) and (2 + d, 2 + d) of its coefficients, as `regressors` has them.
    log_evidence: of what came out, by this link.
    by_room: by how much the predictor falls over a scale of room; 0 where no flight told of its room.
    """

    link: BinaryLink
    mean: Floats
    covariance: Floats
    log_evidence: float
    by_room: float = 0.0


def regressors(speeds: Floats | float, draws: Floats) -> Floats:
    """(n, 2 + d): one, the wind, and what was drawn.

    speeds: (n,) or one for all, m/s.  draws: (n, d) in standard deviations from their means.
    """
    out = np.empty((len(draws), 2 + draws.shape[1]))
    out[:, 0] = 1.0
    out[:, 1] = np.asarray(speeds) - _ORIGIN
    out[:, 2:] = draws
    return out


def fit_modes(
    terms: Floats,
    failed: Sequence[frozenset[Hashable]],
    link: BinaryLink,
    room: Sequence[Mapping[Hashable, float]] = (),
) -> tuple[FailureMode, ...]:
    """The ways of failing of n flights, in order: the one in which most failed, then in which most of the others did.

    terms: (n, 2 + d), of `regressors`.
    failed: the ways in which each failed; none where it was flyable.
    room: the ways that each passed narrowly, and by what share of a scale, 0 to 1; 0 where it passed all the same.

    >>> from planfly.campaigns.statistics.links import PROBIT
    >>> speeds = np.linspace(0.0, 20.0, 200)
    >>> ways = [frozenset({"slope"}) if speed > 12.0 else frozenset() for speed in speeds]
    >>> (mode,) = fit_modes(regressors(speeds, np.empty((200, 0))), ways, PROBIT)
    >>> round(float(10.0 - mode.mean[0] / mode.mean[1]), 1)
    12.0
    """
    found: list[FailureMode] = []
    # Where nothing is known of what is drawn, its coefficients' prior is none's.
    priors = _DRAWS if terms.shape[1] > 2 else _DRAWS[:1]
    rooms = room or [{}] * len(failed)
    left = np.ones(len(failed), dtype=bool)
    while counts := Counter(way for here, ways in zip(left, failed, strict=True) if here for way in ways):
        # By name where as many failed, as the order of a set is not the same in every process.
        common = min(counts, key=lambda way: (-counts[way], repr(way)))
        so = np.array([common in ways for ways in failed])
        passed_by = np.array([0.0 if fails else some.get(common, 1.0) for fails, some in zip(so, rooms, strict=True)])
        came = _Came(so[left], passed_by[left])
        fits = (_fit(terms[left], came, link, deviation) for deviation in priors)
        found.append(max(fits, key=lambda mode: mode.log_evidence))
        left &= ~so
    return tuple(found)


class _Came:
    """What came of n flights by one way: failed, or passed by so much of a scale, of which 0 and 1 are censored."""

    def __init__(self, failed: Bools, room: Floats) -> None:
        self.failed, self.room = failed, room
        self.told = ~failed & (room > 0.0) & (room < 1.0)
        self.tells = bool(self.told.any())

    def log_likelihood(self, link: BinaryLink, x: Floats, by_room: float) -> float:
        """Of predictors (n,) less what room takes from them."""
        if self.tells and by_room <= 0.0:
            return -np.inf
        fails, flies = link.log_shares(x)
        logs = np.where(self.failed, fails, flies)
        if self.tells:
            logs = np.where(self.told, link.log_density(x) + np.log(by_room), logs)
        return float(logs.sum())

    def derivatives(self, link: BinaryLink, x: Floats) -> tuple[Floats, Floats]:
        """First and second of each flight's by its predictor."""
        first, second = link.derivatives(x, self.failed)
        if self.tells:
            slope, curvature = link.density_derivatives(x)
            first, second = np.where(self.told, slope, first), np.where(self.told, curvature, second)
        return first, second


def _fit(terms: Floats, came: _Came, link: BinaryLink, deviation: float) -> FailureMode:
    """The posterior's mode, by Newton's method with halved steps, and the inverse of its curvature there.

    deviation: of the prior of the draws' coefficients.
    """
    coefficients = terms.shape[1]
    deviations = np.full(coefficients, deviation)
    deviations[:2] = _CONSTANT, _WIND
    beta = np.zeros(coefficients)
    beta[:2] = _START
    if came.tells:
        # A passed flight's threshold lies above: as many predictors as its room, at least, keep it from failing.
        terms = np.column_stack((terms, came.room))
        deviations, beta = np.append(deviations, _ROOM), np.append(beta, _ROOM_START)
    precision, told = deviations**-2, int(came.told.sum())

    def by_room(beta: Floats) -> float:
        return float(beta[coefficients]) if came.tells else 0.0

    def loss(beta: Floats) -> float:
        return float(0.5 * (precision * beta * beta).sum()) - came.log_likelihood(link, terms @ beta, by_room(beta))

    def slope_and_curvature(beta: Floats) -> tuple[Floats, Floats]:
        first, second = came.derivatives(link, terms @ beta)
        slope, curvature = precision * beta - terms.T @ first, np.diag(precision) - (terms * second[:, None]).T @ terms
        if came.tells:
            slope[-1] -= told / beta[-1]
            curvature[-1, -1] += told / beta[-1] ** 2
        return slope, curvature

    value = loss(beta)
    for _ in range(_STEPS):
        slope, curvature = slope_and_curvature(beta)
        step, share = np.linalg.solve(curvature, slope), 1.0
        while not (tried := loss(beta - share * step)) <= value and share > _LEAST_SHARE:
            share *= 0.5
        beta, value = beta - share * step, tried
        if float(np.abs(share * step).max()) < _CONVERGED:
            break
    curvature = slope_and_curvature(beta)[1]
    evidence = -value - np.log(deviations).sum() - 0.5 * float(np.linalg.slogdet(curvature)[1])
    covariance: Floats = np.linalg.inv(curvature).astype(np.float64)[:coefficients, :coefficients]
    return FailureMode(link, beta[:coefficients], covariance, float(evidence), by_room(beta))


def fail_shares(modes: Sequence[FailureMode], terms: Floats) -> Floats:
    """(n,) probability to fail, in any way, of flights (n, 2 + d), by the modes' means."""
    flies: Floats = np.ones(len(terms))
    for mode in modes:
        flies *= mode.link.fly_shares(terms @ mode.mean)
    return 1.0 - flies


def boundary_speed(modes: Sequence[FailureMode], draws: Floats, share: float, most: float) -> float:
    """The wind from 0 to ``most`` in which this share of draws (m, d) is expected to fail, m/s, found by halves."""
    still = [(mode.link, regressors(_ORIGIN, draws) @ mode.mean, float(mode.mean[1])) for mode in modes]

    def fails(speed: float) -> bool:
        flies: Floats = np.ones(len(draws))
        for link, x, by_wind in still:
            flies *= link.fly_shares(x + by_wind * (speed - _ORIGIN))
        return bool(1.0 - flies.mean() >= share)

    if not fails(most):
        return most
    low, high = 0.0, most
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return 0.5 * (low + high)


def boundary_slopes(modes: Sequence[FailureMode], draws: Floats, speed: float) -> list[Floats]:
    """(2 + d,) the boundary's derivatives by each mode's coefficients, m/s: the implicit function theorem.

    draws: (m, d).  speed: the boundary, m/s.
    """
    terms = regressors(speed, draws)
    predictors = [terms @ mode.mean for mode in modes]
    flies = [mode.link.fly_shares(x) for mode, x in zip(modes, predictors, strict=True)]
    shares, by_wind = [], 0.0
    for k, mode in enumerate(modes):
        others = np.prod(flies[:k] + flies[k + 1 :], axis=0)
        shares.append(((mode.link.density(predictors[k]) * others)[:, None] * terms).mean(axis=0))
        by_wind += float(shares[-1][0] * mode.mean[1])
    # Where no more fail in more wind, nothing is known of the boundary.
    return [-one / max(by_wind, 1e-9) for one in shares]
