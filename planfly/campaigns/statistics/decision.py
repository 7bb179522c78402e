"""What a campaign's flights say: whether its target is reached, and which drawn quantity explains a margin."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

# ----------------------------------------------------------------------
# The probability of success behind a fixed number of flights: intervals and one-sided bounds.
#
# They hold for a number of flights that was fixed beforehand; where flying stops by what came out,
# the bounds of `StoppingBound` hold.


class Interval(NamedTuple):
    """Of a probability."""

    low: float
    high: float


class Tally(NamedTuple):
    """How many flights came out how.

    lost: could not be flown; they count as failures where a lower bound is stated, and as successes in an upper one.
    """

    flyable: int
    failed: int
    lost: int = 0

    @property
    def flown(self) -> int:
        """All flights, the lost among them."""
        return self.flyable + self.failed + self.lost

    @property
    def share(self) -> float:
        """Share of flyable flights, the lost not counted as such; NaN for no flight."""
        return self.flyable / self.flown if self.flown else math.nan


def clopper_pearson(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """The exact two-sided interval of Clopper and Pearson (Biometrika 26, 1934); it covers at least ``confidence``.

    >>> [round(bound, 4) for bound in clopper_pearson(299, 299)]
    [0.9877, 1.0]
    """
    return _interval(successes, trials, confidence, "exact")


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Wilson's score interval (JASA 22, 1927), for pictures: its mean coverage is near ``confidence``.

    >>> [round(bound, 4) for bound in wilson(8, 10)]
    [0.4902, 0.9433]
    """
    return _interval(successes, trials, confidence, "wilson")


def lower_bound(tally: Tally, confidence: float = 0.95) -> float:
    """Clopper and Pearson's one-sided lower bound: with 299 flights and no failure P is 0.99 at least, at 95 %.

    >>> round(lower_bound(Tally(299, 0)), 4), round(lower_bound(Tally(298, 0)), 4)
    (0.99, 0.99)
    >>> lower_bound(Tally(299, 0)) >= 0.99 > lower_bound(Tally(298, 0))
    True
    """
    return clopper_pearson(tally.flyable, tally.flown, 2.0 * confidence - 1.0).low if tally.flown else 0.0


def upper_bound(tally: Tally, confidence: float = 0.95) -> float:
    """Clopper and Pearson's one-sided upper bound.

    >>> round(upper_bound(Tally(0, 10)), 4)
    0.2589
    """
    if not tally.flown:
        return 1.0
    return clopper_pearson(tally.flyable + tally.lost, tally.flown, 2.0 * confidence - 1.0).high


def _interval(successes: int, trials: int, confidence: float, method: str) -> Interval:
    from scipy.stats import binomtest

    if not trials:
        return Interval(0.0, 1.0)
    found = binomtest(successes, trials).proportion_ci(confidence, method=method)
    return Interval(float(found.low), float(found.high))


# ----------------------------------------------------------------------
# Bounds of a probability that hold however long one looks: the beta-binomial mixture of Robbins.
#
# For s successes and f failures the set of p with
#
#     E(p) = sum_i w_i B(s + a_i, f + b_i) / B(a_i, b_i) / (p^s (1 - p)^f) < 1 / alpha
#
# contains the true p at all times at once, with probability 1 - alpha: E is a martingale that begins at 1 (Robbins,
# "Statistical methods related to the law of the iterated logarithm", Ann. Math. Stat. 41, 1970; Ville's inequality).
# Whoever stops when it says enough is therefore not led astray, as with an interval for a fixed number of flights.
#
# The mixture has two parts.  One, of nearly all the weight, lies so near to 1 that without a failure a target is
# reached after as many flights as with a fixed number (299 for 0.99); the other, Jeffreys' Beta(1/2, 1/2), finds out
# about probabilities far from the target.

# Weight of the part that is far from the target.
_FAR = 0.001
# What the mixture may cost where nothing fails, in the logarithm of 1 / alpha: a flight at P = 0.99.
_COST = 0.009
_BISECTIONS = 60


@dataclass(frozen=True)
class StoppingBound:
    """The bound for a target probability (0 to 1) and a confidence.

    >>> bound = StoppingBound(0.99)
    >>> bound.fewest, bound.interval(299, 0).low >= 0.99, bound.interval(298, 0).low >= 0.99
    (299, True, False)
    """

    target: float
    confidence: float = 0.95

    @property
    def fewest(self) -> int:
        """Flights that reach the target where none fails."""
        return math.ceil((self._enough + _COST) / -math.log(self.target))

    @property
    def _enough(self) -> float:
        return -math.log1p(-self.confidence)

    @cached_property
    def parts(self) -> tuple[tuple[float, float, float], ...]:
        """Weight, a and b of each part of the mixture."""
        scale, low, high = float(self.fewest), 0.0, 1.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            evidence = _log_mixture(self._parts(scale, middle), self.fewest, 0) - self.fewest * math.log(self.target)
            low, high = (middle, high) if evidence >= self._enough else (low, middle)
        # A hair less, for what rounding takes.
        return self._parts(scale, 0.999 * low)

    @staticmethod
    def _parts(scale: float, failures: float) -> tuple[tuple[float, float, float], ...]:
        return (1.0 - _FAR, scale, max(failures, 1e-9)), (_FAR, 0.5, 0.5)

    def evidence(self, successes: int, failures: int, p: float) -> float:
        """Logarithm of E(p): p is excluded where it is ``-log(1 - confidence)`` or more."""
        likelihood = _times_log(successes, p) + _times_log(failures, 1.0 - p)
        return _log_mixture(self.parts, successes, failures) - likelihood

    def excludes(self, successes: int, failures: int, p: float, *, above: bool) -> bool:
        """Whether p is excluded, and the flights' own share lies above it (or, where that is asked, below)."""
        share = successes / max(1, successes + failures)
        beyond = share > p if above else share < p
        return beyond and self.evidence(successes, failures, p) >= self._enough

    def interval(self, successes: int, failures: int) -> Interval:
        """All p that are not excluded: they lie about the share of successes, where E is least."""
        trials = successes + failures
        if not trials:
            return Interval(0.0, 1.0)
        share = successes / trials
        low = 0.0 if not successes else self._edge(successes, failures, 0.0, share)
        high = 1.0 if not failures else self._edge(successes, failures, 1.0, share)
        return Interval(low, high)

    def _edge(self, successes: int, failures: int, outside: float, inside: float) -> float:
        """Where between p that is excluded and p that is not the border lies: the excluded side of it."""
        for _ in range(_BISECTIONS):
            middle = 0.5 * (outside + inside)
            if self.evidence(successes, failures, middle) >= self._enough:
                outside = middle
            else:
                inside = middle
        return outside

    def bounds(self, tally: Tally) -> Interval:
        """The interval of a tally: lost flights are failures for its low end, successes for its high one."""
        low = self.interval(tally.flyable, tally.failed + tally.lost).low
        high = self.interval(tally.flyable + tally.lost, tally.failed).high
        return Interval(low, high)


def _times_log(count: int, p: float) -> float:
    if not count:
        return 0.0
    return count * math.log(p) if p > 0.0 else -math.inf


def _log_mixture(parts: tuple[tuple[float, float, float], ...], successes: int, failures: int) -> float:
    from scipy.special import betaln

    terms = [math.log(w) + float(betaln(successes + a, failures + b) - betaln(a, b)) for w, a, b in parts]
    return float(np.logaddexp.reduce(terms))


Answer = Literal["reached", "missed", "undecided", "none asked"]

# Of a bound that nobody asked another of.
USUAL_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Goal:
    """What is asked of a campaign.

    target: the probability to reach; None where it is only to be estimated.
    stops: whether flying stops as soon as the answer is known (`--prove`); otherwise the number of flights is fixed.
    flights: fixed number, or the most where it stops.
    changed: whether another number was to be fixed first, and some of its flights were flown.
    """

    target: float | None
    stops: bool
    flights: int
    confidence: float = USUAL_CONFIDENCE
    changed: bool = False

    @property
    def method(self) -> str:
        """By which the bounds are had, for a person."""
        if self.stops:
            return "beta-binomial mixture, valid at every number of flights"
        if self.changed:
            return "Clopper-Pearson, one-sided, but the number of flights was changed after some: it holds less often"
        return "Clopper-Pearson, one-sided, for the number of flights fixed beforehand"


@dataclass(frozen=True)
class Estimate:
    """What is known of the probability.

    lower, upper: each holds with the goal's confidence; of a goal that stops, both at once and at all times.
    interval: two-sided, with the goal's confidence.
    """

    tally: Tally
    lower: float
    upper: float
    interval: Interval
    answer: Answer


class Estimator:
    """Estimates of one goal, as flights come in."""

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._bound = StoppingBound(goal.target, goal.confidence) if goal.stops and goal.target is not None else None

    @property
    def fewest(self) -> int:
        """Flights that may answer, at the least."""
        return self._bound.fewest if self._bound is not None else self._goal.flights

    def decides(self, tally: Tally) -> bool:
        """Whether this many flights answer a goal that stops."""
        target, bound = self._goal.target, self._bound
        if bound is None or target is None:
            return False
        reached = bound.excludes(tally.flyable, tally.failed + tally.lost, target, above=True)
        return reached or bound.excludes(tally.flyable + tally.lost, tally.failed, target, above=False)

    def estimate(self, tally: Tally) -> Estimate:
        """What this many flights say."""
        confidence = self._goal.confidence
        if self._bound is not None:
            interval = self._bound.bounds(tally)
            lower, upper = interval
        else:
            lower, upper = lower_bound(tally, confidence), upper_bound(tally, confidence)
            low = clopper_pearson(tally.flyable, tally.flown, confidence).low
            interval = Interval(low, clopper_pearson(tally.flyable + tally.lost, tally.flown, confidence).high)
        return Estimate(tally, lower, upper, interval, self._answer(lower, upper))

    def _answer(self, lower: float, upper: float) -> Answer:
        target = self._goal.target
        if target is None:
            return "none asked"
        if lower >= target:
            return "reached"
        return "missed" if upper < target else "undecided"


Floats = NDArray[np.float64]

# ----------------------------------------------------------------------
# How much of a result's variance each drawn quantity explains, from the flights that were flown anyway.
#
# First-order index of variance, Var(E[y | x]) / Var(y), estimated from given data: flights are sorted into groups of
# equal size by x, and the variance between the groups' means is compared with that of all (Plischke, Borgonovo, Smith,
# "Global sensitivity measures from given data", EJOR 226, 2013).  What groups of a few differ by chance is subtracted,
# as in Kelley's epsilon squared (PNAS 21, 1935), so that a quantity without effect comes to 0.

MIN_FLIGHTS = 30
_MAX_GROUPS = 64


def first_order(x: Floats, y: Floats) -> float:
    """First-order index of y (n,) to x (n,), 0 to 1; 0 for fewer than `MIN_FLIGHTS`, or where y does not vary.

    >>> random = np.random.default_rng(1)
    >>> x = random.random((4000, 2))
    >>> [round(first_order(x[:, k], 3.0 * x[:, 0] + x[:, 1]), 1) for k in range(2)]
    [0.9, 0.1]
    """
    count = x.size
    total = float(((y - y.mean()) ** 2).sum()) if count else 0.0
    if count < MIN_FLIGHTS or total <= 1e-12 * count or np.ptp(x) == 0.0:
        return 0.0
    groups = int(min(_MAX_GROUPS, max(4, round(2.0 * count ** (1.0 / 3.0)))))
    parts = np.array_split(y[np.argsort(x, kind="stable")], groups)
    between = sum(part.size * float(part.mean() - y.mean()) ** 2 for part in parts)
    within = (total - between) / (count - groups)
    return float(np.clip((between - (groups - 1) * within) / total, 0.0, 1.0))


def rank_slope(x: Floats, y: Floats) -> float:
    """Spearman's rank correlation, -1 to 1: which way y goes with x; 0 where either does not vary.

    >>> rank_slope(np.arange(5.0), -np.arange(5.0) ** 3)
    -1.0
    """
    from scipy.stats import spearmanr

    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0
    return round(float(spearmanr(x, y).statistic), 12)
