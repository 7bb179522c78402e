"""One way of failing as a regression on the wind and what was drawn.

By how little flights passed tells of failing only where both are of one kind: an aircraft that is too fast down a leg
fails by degrees, whatever the gusts took of the slope of those that were not.  So of two hypotheses the one with more
evidence is taken: one law for failing and for the room of those that passed (Tobin's), or one for each, where the room
tells nothing of failing (Cragg, "Some statistical models for limited dependent variables with application to the demand
for durable goods", Econometrica 39, 1971, of which the first is a special case).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.censored_regression import Outcomes, RegressionFit, fit_regression
from planfly.campaigns.statistics.links import LINKS, BinaryLink

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class FailureMode:
    """One way of failing.

    mean, covariance: (2 + d,) and (2 + d, 2 + d) of its coefficients, as those of the terms it was fitted to.
    sample: (s, 2 + d) of what the coefficients may be, each as likely as the other.
    log_evidence: of what came out, by this link.
    by_room: by how much the predictor falls over a scale of room; 0 where room tells nothing of failing.
    """

    link: BinaryLink
    mean: Floats
    covariance: Floats
    sample: Floats
    log_evidence: float
    by_room: float = 0.0


def fit_mode(terms: Floats, failed: Bools, room: Floats, link: BinaryLink) -> FailureMode:
    """One way of failing of n flights, by one law with their room or by its own, whichever has more evidence.

    terms: (n, 2 + d) of each flight: one, the wind from some origin, and what was drawn.
    failed: (n,).  room: (n,) by what share of a scale each passed that did: 1 for a scale or more, 0 for not known.

    >>> from planfly.campaigns.statistics.links import PROBIT
    >>> wind = np.linspace(-5.0, 5.0, 200)
    >>> terms, failed, chance = np.column_stack((np.ones(200), wind)), wind > 2.0, np.random.default_rng(1).random(200)
    >>> fit_mode(terms, failed, (2.0 - wind).clip(0.0, 1.0), PROBIT).by_room > 0.0
    True
    >>> fit_mode(terms, failed, chance, PROBIT).by_room
    0.0
    """
    outcomes = Outcomes(terms, failed, np.where(failed, 0.0, room))
    one_law = fit_regression(outcomes, link)
    if not outcomes.told.any():
        return _mode(link, one_law, one_law.log_evidence)
    alone, passes = fit_regression(outcomes.without_room(), link), outcomes.only_room()
    # The room's own law, of whichever link, says nothing of failing's.
    two_laws = alone.log_evidence + max(fit_regression(passes, any_link, one_law).log_evidence for any_link in LINKS)
    if two_laws > one_law.log_evidence:
        return _mode(link, alone, two_laws)
    return _mode(link, one_law, one_law.log_evidence)


def _mode(link: BinaryLink, fit: RegressionFit, log_evidence: float) -> FailureMode:
    return FailureMode(link, fit.mean, fit.covariance, fit.sample(), log_evidence, fit.by_room)
