"""A way of failing as a regression on the wind and what was drawn: of who failed, and by how little others passed.

The probability to fail is a link's function of a + b * wind + c . draws.  A flight that passed narrowly tells more than
that it did not fail: the share of flights that pass by less than some room is the same function with k * room added, k
of it to a scale's length, so that the room has the link's law and 1/k is its scale.  Of a failed flight only that it
failed counts, of one that passed by a scale or more only that, so that no law is asked to hold far from failing: a
regression censored on both sides (Tobin, "Estimation of relationships for limited dependent variables", Econometrica
26, 1958; Rosett and Nelson, "Estimation of the two-limit probit regression model", Econometrica 43, 1975).

The posterior of (a, b, c, k) is taken as normal about its mode, under a weak normal prior (Gelman et al., Bayesian Data
Analysis, 3rd edition, 2013, chapters 4.1 and 16.3); the evidence for a link, and for how wide a prior the draws'
coefficients have, follows from it (section 7.4; MacKay, "Bayesian Interpolation", Neural Computation 4, 1992).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.links import BinaryLink

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Standard deviations of the prior: of the constant, and of the wind's coefficient, 1/(m/s).
_CONSTANT, _WIND = 20.0, 1.5
# Of the draws' coefficients, a draw being in units of its own standard deviation: of these the one that flights are
# most evidence for.  Where draws decide little, much room for them would have chance look like knowledge.
_DRAWS = (0.1, 0.4, 1.5)
# Of the room's coefficient, 1/scale, of which only what is above 0 is meant.
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


def fit_mode(terms: Floats, failed: Bools, room: Floats, link: BinaryLink) -> FailureMode:
    """One way of failing of n flights, by the prior of the draws' coefficients that has the most evidence.

    terms: (n, 2 + d) of each flight: one, the wind from some origin, and what was drawn.
    failed: (n,).  room: (n,) by what share of a scale each passed that did: 1 for a scale or more, 0 for not known.

    >>> from planfly.campaigns.statistics.links import PROBIT
    >>> wind = np.linspace(-5.0, 5.0, 200)
    >>> terms, by_how_much = np.column_stack((np.ones(200), wind)), 2.0 - wind
    >>> mode = fit_mode(terms, by_how_much < 0.0, by_how_much.clip(0.0, 1.0), PROBIT)
    >>> round(float(-mode.mean[0] / mode.mean[1]), 1)
    2.0
    """
    # Where nothing is known of what is drawn, its coefficients' prior is none's.
    priors = _DRAWS if terms.shape[1] > 2 else _DRAWS[:1]
    outcomes = _Outcomes(failed, np.where(failed, 0.0, room))
    fits = (_fit(terms, outcomes, link, deviation) for deviation in priors)
    return max(fits, key=lambda mode: mode.log_evidence)


class _Outcomes:
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


def _fit(terms: Floats, outcomes: _Outcomes, link: BinaryLink, deviation: float) -> FailureMode:
    """The posterior's mode, by Newton's method with halved steps, and the inverse of its curvature there.

    deviation: of the prior of the draws' coefficients.
    """
    coefficients = terms.shape[1]
    deviations = np.full(coefficients, deviation)
    deviations[:2] = _CONSTANT, _WIND
    beta = np.zeros(coefficients)
    beta[:2] = _START
    if outcomes.tells:
        # The room is a regressor of what passed: F(terms . beta + k * room) is the share that passes by less.
        terms = np.column_stack((terms, outcomes.room))
        deviations, beta = np.append(deviations, _ROOM), np.append(beta, _ROOM_START)
    precision, told = deviations**-2, int(outcomes.told.sum())

    def by_room(beta: Floats) -> float:
        return float(beta[coefficients]) if outcomes.tells else 0.0

    def loss(beta: Floats) -> float:
        return float(0.5 * (precision * beta * beta).sum()) - outcomes.log_likelihood(link, terms @ beta, by_room(beta))

    def slope_and_curvature(beta: Floats) -> tuple[Floats, Floats]:
        first, second = outcomes.derivatives(link, terms @ beta)
        slope, curvature = precision * beta - terms.T @ first, np.diag(precision) - (terms * second[:, None]).T @ terms
        if outcomes.tells:
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
