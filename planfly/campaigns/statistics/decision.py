"""Decide from a campaign's flights if its target is reached.

Also find which drawn quantity explains a margin.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from world.arrays import Floats

# ----------------------------------------------------------------------
# Intervals and one-sided bounds of the probability of success for a fixed number of flights.
#
# They are valid for a number of flights fixed beforehand; if the results decide when flying stops, the bounds of
# `StoppingBound` apply.


class Interval(NamedTuple):
    """Interval of a probability, from 0 to 1."""

    low: float
    high: float


class Tally(NamedTuple):
    """Number of flights with each outcome.

    lost: flights that could not be simulated.
    undecided: flights without a failure in which some rule is not judged, so that they are not known to be flyable.
    """

    flyable: int
    failed: int
    lost: int = 0
    undecided: int = 0

    @property
    def unknown(self) -> int:
        """Number of lost and undecided flights: failures in a lower bound, successes in an upper bound."""
        return self.lost + self.undecided

    @property
    def flown(self) -> int:
        """Number of all flights, including lost flights."""
        return self.flyable + self.failed + self.unknown

    @property
    def share(self) -> float:
        """Fraction of flyable flights, with lost and undecided flights as not flyable; NaN without a flight."""
        return self.flyable / self.flown if self.flown else math.nan


def clopper_pearson(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Return the exact two-sided interval of a success probability.

    By Clopper and Pearson (Biometrika 26, 1934).

    Its coverage is at least ``confidence``.  It is 0 to 1 without trials.

    >>> [round(bound, 4) for bound in clopper_pearson(299, 299)]
    [0.9877, 1.0]
    """
    return _binomial_interval(successes, trials, confidence, "exact")


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Return Wilson's two-sided score interval of a success probability, for use in pictures.

    Source: JASA 22, 1927.

    Its mean coverage is near ``confidence``.  It is 0 to 1 without trials.

    >>> [round(bound, 4) for bound in wilson(8, 10)]
    [0.4902, 0.9433]
    """
    return _binomial_interval(successes, trials, confidence, "wilson")


def lower_bound(tally: Tally, confidence: float = 0.95) -> float:
    """Return Clopper and Pearson's one-sided lower bound of the probability of success; 0 without flights.

    Lost and undecided flights are treated as failures.

    299 flights without a failure give P >= 0.99 at 95 %.

    >>> round(lower_bound(Tally(299, 0)), 4), round(lower_bound(Tally(298, 0)), 4)
    (0.99, 0.99)
    >>> lower_bound(Tally(299, 0)) >= 0.99 > lower_bound(Tally(298, 0))
    True
    """
    # A one-sided bound is an end of the two-sided interval that excludes as much on the other side.
    return clopper_pearson(tally.flyable, tally.flown, 2.0 * confidence - 1.0).low if tally.flown else 0.0


def upper_bound(tally: Tally, confidence: float = 0.95) -> float:
    """Return Clopper and Pearson's one-sided upper bound of the probability of success; 1 without flights.

    Lost and undecided flights are treated as successes.

    >>> round(upper_bound(Tally(0, 10)), 4)
    0.2589
    """
    if not tally.flown:
        return 1.0
    return clopper_pearson(tally.flyable + tally.unknown, tally.flown, 2.0 * confidence - 1.0).high


def _binomial_interval(successes: int, trials: int, confidence: float, method: str) -> Interval:
    """Return a two-sided interval of a success probability; 0 to 1 without trials.

    method: method of the interval, as in scipy's binomtest.
    """
    from scipy.stats import binomtest

    if not trials:
        return Interval(0.0, 1.0)
    interval = binomtest(successes, trials).proportion_ci(confidence, method=method)
    return Interval(float(interval.low), float(interval.high))


# ----------------------------------------------------------------------
# Bounds of a probability that are valid at every number of flights: the beta-binomial mixture of Robbins.
#
# For s successes and f failures the set of p with
#
#     E(p) = sum_i w_i B(s + a_i, f + b_i) / B(a_i, b_i) / (p^s (1 - p)^f) < 1 / alpha
#
# contains the true p at all times at once, with probability 1 - alpha: E is a martingale that begins at 1 (Robbins,
# "Statistical methods related to the law of the iterated logarithm", Ann. Math. Stat. 41, 1970; Ville's inequality).
# Stopping as soon as the bound suffices is therefore valid, unlike with an interval for a fixed number of flights.
#
# The mixture has two components.  One, of nearly all the weight, is so near to 1 that without a failure a target is
# reached after as many flights as with a fixed number (299 for 0.99); the other, Jeffreys' Beta(1/2, 1/2), covers
# probabilities far from the target.

# Weight of the component far from the target.
_JEFFREYS_WEIGHT = 0.001
# Evidence that the mixture loses if no flight fails, as a logarithm; it costs one more flight at P = 0.99.
_MIXTURE_LOSS = 0.009
# Number of bisection steps.
_BISECTIONS = 60


@dataclass(frozen=True)
class StoppingBound:
    """Bound that is valid at every number of flights, for a target probability (0 to 1) and a confidence.

    >>> bound = StoppingBound(0.99)
    >>> bound.min_flights, bound.interval(299, 0).low >= 0.99, bound.interval(298, 0).low >= 0.99
    (299, True, False)
    """

    target: float
    confidence: float = 0.95

    @property
    def min_flights(self) -> int:
        """Smallest number of flights that prove the target if none of them fails."""
        return math.ceil((self._required_evidence + _MIXTURE_LOSS) / -math.log(self.target))

    @property
    def _required_evidence(self) -> float:
        """Logarithm of E(p) at and above which p is excluded."""
        return -math.log1p(-self.confidence)

    @cached_property
    def components(self) -> tuple[tuple[float, float, float], ...]:
        """Weight, a and b of the beta distribution of each mixture component.

        The a of the first component is `min_flights`.  Its b is found by bisection: the largest value with which
        `min_flights` flights without a failure still reach the target.
        """
        scale, min_failures, max_failures = float(self.min_flights), 0.0, 1.0
        for _ in range(_BISECTIONS):
            failures = 0.5 * (min_failures + max_failures)
            evidence = _log_mixture(
                self._mixture_components(scale, failures), self.min_flights, 0
            ) - self.min_flights * math.log(self.target)
            min_failures, max_failures = (
                (failures, max_failures) if evidence >= self._required_evidence else (min_failures, failures)
            )
        # Use slightly less than the solution, to cover rounding.
        return self._mixture_components(scale, 0.999 * min_failures)

    @staticmethod
    def _mixture_components(scale: float, failures: float) -> tuple[tuple[float, float, float], ...]:
        """Return weight, a and b of the two mixture components.

        They are a beta distribution near 1, and Jeffreys' prior.

        scale, failures: a and b of the first component.
        """
        return (1.0 - _JEFFREYS_WEIGHT, scale, max(failures, 1e-9)), (_JEFFREYS_WEIGHT, 0.5, 0.5)

    def evidence(self, successes: int, failures: int, p: float) -> float:
        """Return the logarithm of E(p), the evidence against the success probability p.

        E(p) is the ratio of the mixture's likelihood to the likelihood of p.  p is excluded if the logarithm is at
        least ``-log(1 - confidence)``.

        successes, failures: numbers of flights.
        """
        likelihood = _times_log(successes, p) + _times_log(failures, 1.0 - p)
        return _log_mixture(self.components, successes, failures) - likelihood

    def excludes(self, successes: int, failures: int, p: float, *, above: bool) -> bool:
        """Return True if the success probability is proven to be above p, or below p if `above` is False.

        p: tested success probability, 0 to 1.
        successes, failures: numbers of flights.
        """
        fraction = successes / max(1, successes + failures)
        is_beyond = fraction > p if above else fraction < p
        return is_beyond and self.evidence(successes, failures, p) >= self._required_evidence

    def interval(self, successes: int, failures: int) -> Interval:
        """Return the interval of the success probabilities p that the flights do not exclude.

        It contains the fraction of successes, and is 0 to 1 without flights.

        successes, failures: numbers of flights.
        """
        trials = successes + failures
        if not trials:
            return Interval(0.0, 1.0)
        fraction = successes / trials
        lower = 0.0 if not successes else self._find_edge(successes, failures, 0.0, fraction)
        upper = 1.0 if not failures else self._find_edge(successes, failures, 1.0, fraction)
        return Interval(lower, upper)

    def _find_edge(self, successes: int, failures: int, excluded: float, included: float) -> float:
        """Find by bisection the probability p at which exclusion ends; return the excluded side.

        excluded, included: an excluded p, and a p that is not excluded.
        successes, failures: numbers of flights.
        """
        for _ in range(_BISECTIONS):
            candidate = 0.5 * (excluded + included)
            if self.evidence(successes, failures, candidate) >= self._required_evidence:
                excluded = candidate
            else:
                included = candidate
        return excluded

    def bounds(self, tally: Tally) -> Interval:
        """Return the interval for a tally; lost and undecided flights widen it.

        Lost and undecided flights are failures for the lower bound, and successes for the upper bound.
        """
        lower = self.interval(tally.flyable, tally.failed + tally.unknown).low
        upper = self.interval(tally.flyable + tally.unknown, tally.failed).high
        return Interval(lower, upper)


def _times_log(count: int, p: float) -> float:
    """Return count * log(p); 0 for a count of 0 even if p is 0."""
    if not count:
        return 0.0
    return count * math.log(p) if p > 0.0 else -math.inf


def _log_mixture(components: tuple[tuple[float, float, float], ...], successes: int, failures: int) -> float:
    """Return the log-likelihood of a sequence of outcomes under a mixture of beta priors.

    The priors are those of the success probability.

    components: weight, a and b of each distribution.
    successes, failures: numbers of flights.
    """
    from scipy.special import betaln

    terms = [math.log(w) + float(betaln(successes + a, failures + b) - betaln(a, b)) for w, a, b in components]
    return float(np.logaddexp.reduce(terms))


Answer = Literal["reached", "missed", "undecided", "no target"]

# Default confidence of a bound.
DEFAULT_CONFIDENCE = 0.95
# Largest number of flights that is named as deciding a target.
MAX_DECIDING_FLIGHTS = 1_000_000


@dataclass(frozen=True)
class Goal:
    """Goal of a campaign.

    target: the probability to reach; None to estimate the probability only.
    stops: True to stop flying as soon as the answer is known (`--prove`); otherwise the number of flights is fixed.
    flights: fixed number of flights, or the maximum number if `stops`.
    changed: True if a resumed campaign changed the number of flights or `stops`.
    """

    target: float | None
    stops: bool
    flights: int
    confidence: float = DEFAULT_CONFIDENCE
    changed: bool = False

    @property
    def bound_method(self) -> str:
        """Text for reports: method of the probability's bounds, and the condition under which they are valid."""
        if self.stops:
            return "beta-binomial mixture, valid whenever the flights are stopped"
        if self.changed:
            return (
                "Clopper-Pearson, one-sided, but the number of flights was changed during the campaign: "
                "the true confidence is lower"
            )
        return "Clopper-Pearson, one-sided, for a number of flights fixed in advance"


@dataclass(frozen=True)
class Estimate:
    """Estimate of the probability of a flyable flight.

    tally: the flights from which it is estimated.
    lower, upper: bounds of the probability, each with the goal's confidence.  If the goal stops the campaign, both
    bounds hold together at every number of flights.
    interval: two-sided interval, with the goal's confidence.
    """

    tally: Tally
    lower: float
    upper: float
    interval: Interval
    answer: Answer


class Estimator:
    """Estimator of the probability of a flyable flight, for one goal."""

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._bound = StoppingBound(goal.target, goal.confidence) if goal.stops and goal.target is not None else None

    @property
    def min_flights(self) -> int:
        """Smallest number of flights that can prove the target, or the fixed number of flights."""
        return self._bound.min_flights if self._bound is not None else self._goal.flights

    def decides(self, tally: Tally) -> bool:
        """Return True if a tally proves or disproves the target, so that the campaign stops.

        Always False for a fixed number of flights, and without a target.
        """
        target, bound = self._goal.target, self._bound
        if bound is None or target is None:
            return False
        is_reached = bound.excludes(tally.flyable, tally.failed + tally.unknown, target, above=True)
        return is_reached or bound.excludes(tally.flyable + tally.unknown, tally.failed, target, above=False)

    def deciding_flights(self, tally: Tally) -> int | None:
        """Return the number of flights that would decide the target with the present fractions of outcomes.

        Return None for more than `MAX_DECIDING_FLIGHTS`.
        tally: at least one flight, with which the target is undecided.

        >>> Estimator(Goal(0.95, False, 20)).deciding_flights(Tally(20, 0))
        59
        """
        target, share = self._goal.target, tally.share
        too_few, enough = tally.flown, 2 * tally.flown

        def decides(flights: int) -> bool:
            """Return True if this number of flights decides the target; numbers are rounded against a decision."""
            is_above = target is not None and share >= target
            flyable = math.floor(share * flights + 1e-9) if is_above else math.ceil(share * flights - 1e-9)
            undecided = min(flights - flyable, math.ceil(flights * tally.undecided / tally.flown))
            scaled_tally = Tally(flyable, flights - flyable - undecided, undecided=undecided)
            return self.estimate(scaled_tally).answer != "undecided"

        while not decides(enough):
            too_few, enough = enough, 2 * enough
            if too_few > MAX_DECIDING_FLIGHTS:
                return None
        while enough - too_few > 1:
            middle = (too_few + enough) // 2
            too_few, enough = (too_few, middle) if decides(middle) else (middle, enough)
        return enough

    def estimate(self, tally: Tally) -> Estimate:
        """Estimate the probability from a tally, and answer whether it reaches the target.

        The bounds come from the stopping bound if the goal stops the campaign, otherwise from the number of flights.
        """
        confidence = self._goal.confidence
        if self._bound is not None:
            interval = self._bound.bounds(tally)
            lower, upper = interval
        else:
            lower, upper = lower_bound(tally, confidence), upper_bound(tally, confidence)
            interval_low = clopper_pearson(tally.flyable, tally.flown, confidence).low
            interval = Interval(
                interval_low, clopper_pearson(tally.flyable + tally.unknown, tally.flown, confidence).high
            )
        target = self._goal.target
        answer: Answer = "no target"
        if target is not None:
            answer = "reached" if lower >= target else ("missed" if upper < target else "undecided")
        return Estimate(tally, lower, upper, interval, answer)


# ----------------------------------------------------------------------
# Fraction of a result's variance that each drawn quantity explains, from the campaign's own flights.
#
# First-order variance index, Var(E[y | x]) / Var(y), estimated from given data: flights are sorted into groups of equal
# size by x, and the variance between the groups' means is compared with the total variance (Plischke, Borgonovo, Smith,
# "Global sensitivity measures from given data", EJOR 226, 2013).  The chance difference of small groups is subtracted,
# as in Kelley's epsilon squared (PNAS 21, 1935), so that a quantity without effect has an index of 0.

# Minimum number of flights for an index.  In seeded draws, a quantity that explains 70 % of the variance was named in
# 97 % of campaigns with 20 flights, in 80 % with 15, and in 44 % with 10.  Without any effect, campaigns with eight
# quantities and 8 to 30 flights name a quantity in 2 to 4 % of the draws.
MIN_FLIGHTS_FOR_INDEX = 20
# Maximum number of groups.
_MAX_GROUPS = 64


def first_order_index(x: Floats, y: Floats) -> float:
    """Return the first-order sensitivity index: the fraction of y's variance that x explains, 0 to 1.

    Returns 0 for fewer than `MIN_FLIGHTS_FOR_INDEX` values, or if x or y does not vary.

    x, y: (n,).

    >>> random = np.random.default_rng(1)
    >>> x = random.random((4000, 2))
    >>> [round(first_order_index(x[:, k], 3.0 * x[:, 0] + x[:, 1]), 1) for k in range(2)]
    [0.9, 0.1]
    """
    count = x.size
    total = float(((y - y.mean()) ** 2).sum()) if count else 0.0
    if count < MIN_FLIGHTS_FOR_INDEX or total <= 1e-12 * count or np.ptp(x) == 0.0:
        return 0.0
    groups = _split_into_groups(x, y)
    between_variance = sum(group.size * float(group.mean() - y.mean()) ** 2 for group in groups)
    within_variance = (total - between_variance) / (count - len(groups))
    return float(np.clip((between_variance - (len(groups) - 1) * within_variance) / total, 0.0, 1.0))


def _split_into_groups(x: Floats, y: Floats) -> list[Floats]:
    """Sort y by x, and split it into consecutive groups of equal size; return the groups."""
    groups = int(min(_MAX_GROUPS, max(4, round(2.0 * x.size ** (1.0 / 3.0)))))
    return np.array_split(y[np.argsort(x, kind="stable")], groups)


def dependence_p_value(x: Floats, y: Floats) -> float:
    """Return the p-value of a dependence of y on x, 0 to 1.

    It is the probability of a dependence at least as strong by chance.

    It is twice the smaller p-value of two tests.  One is the test of Kruskal and Wallis on the groups of
    `first_order_index` (Journal of the American Statistical Association 47, 1952).  The other is Spearman's test, which
    finds a rise or fall with fewer values.

    Returns 1 for fewer than `MIN_FLIGHTS_FOR_INDEX` values, or if x or y does not vary.

    >>> random = np.random.default_rng(1)
    >>> x = random.random((40, 2))
    >>> [dependence_p_value(x[:, k], x[:, 0] + 0.5 * random.random(40)) < 0.001 for k in range(2)]
    [True, False]
    """
    from scipy.stats import kruskal, spearmanr

    if x.size < MIN_FLIGHTS_FOR_INDEX or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 1.0
    p_values = kruskal(*_split_into_groups(x, y)).pvalue, spearmanr(x, y).pvalue
    return min(1.0, 2.0 * float(min(p_values)))


def rank_slope(x: Floats, y: Floats) -> float:
    """Return Spearman's rank correlation of x and y, -1 to 1.

    Return 0 for fewer than three values, or if x or y is constant.

    >>> rank_slope(np.arange(5.0), -np.arange(5.0) ** 3)
    -1.0
    """
    from scipy.stats import spearmanr

    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0
    return round(float(spearmanr(x, y).statistic), 12)
