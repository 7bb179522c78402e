"""The probability of success behind a fixed number of flights: intervals and one-sided bounds.

They hold for a number of flights that was fixed beforehand; where flying stops by what came out,
`planfly.campaigns.statistics.stopping_bound` holds.
"""

import math
from typing import NamedTuple


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
