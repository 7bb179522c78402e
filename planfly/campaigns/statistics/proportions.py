"""Compare the shares of flyable flights of two campaigns.

They are compared by pairs of flights or as independent samples.
"""

import math
from typing import NamedTuple

from planfly.campaigns.statistics.decision import Interval, wilson

# Number of bisection steps of an interval's bound.
_BISECTIONS = 60


class ProportionDifference(NamedTuple):
    """Difference of two probabilities of success.

    value: second minus first.
    interval: two-sided interval.
    p_value: probability of outcomes at least as different if both probabilities are equal, two-sided.
    """

    value: float
    interval: Interval
    p_value: float


def paired_difference(only_first: int, only_second: int, pairs: int, confidence: float = 0.95) -> ProportionDifference:
    """Return the difference of two success probabilities, second minus first, from paired trials.

    The interval is Tango's score interval (Statistics in Medicine 17, 1998).  The p-value is from McNemar's exact test.

    only_first, only_second: number of pairs in which only the first trial, or only the second, succeeded.
    pairs: number of all pairs, at least 1.
    confidence: confidence of the interval.

    >>> difference = paired_difference(2, 12, 50)
    >>> difference.value, round(difference.p_value, 4)
    (0.2, 0.0129)
    """
    from scipy.stats import binomtest, norm

    quantile = float(norm.ppf(0.5 + 0.5 * confidence))
    value = (only_second - only_first) / pairs

    def is_excluded(candidate: float) -> bool:
        """Return True if the score test rejects a candidate for the difference."""
        # The probability that only the first trial succeeds is estimated by maximum likelihood for this difference: it
        # is the larger root of Tango's quadratic equation.
        a = 2.0 * pairs
        b = -only_second - only_first + (2.0 * pairs - only_second + only_first) * candidate
        c = -only_first * candidate * (1.0 - candidate)
        probability = (math.sqrt(max(0.0, b * b - 4.0 * a * c)) - b) / (2.0 * a)
        # The standard deviation of `only_second` - `only_first` if the candidate is the true difference.
        deviation = math.sqrt(max(0.0, pairs * (2.0 * probability + candidate * (1.0 - candidate))))
        return abs(only_second - only_first - pairs * candidate) > quantile * deviation

    def find_bound(excluded: float) -> float:
        """Return the bound of the interval that lies between the estimate and an excluded difference."""
        if not is_excluded(excluded):
            return excluded
        included = value
        for _ in range(_BISECTIONS):
            candidate = 0.5 * (excluded + included)
            excluded, included = (candidate, included) if is_excluded(candidate) else (excluded, candidate)
        return included

    discordant = only_first + only_second
    p_value = float(binomtest(only_first, discordant).pvalue) if discordant else 1.0
    return ProportionDifference(value, Interval(find_bound(-1.0), find_bound(1.0)), p_value)


def independent_difference(
    first: tuple[int, int], second: tuple[int, int], confidence: float = 0.95
) -> ProportionDifference:
    """Return the difference of two success probabilities, second minus first, from independent samples.

    The interval is Newcombe's hybrid of two score intervals (Statistics in Medicine 17, 1998, method 10).  The p-value
    is from Fisher's exact test.

    first, second: number of successes, and number of trials, at least 1.
    confidence: confidence of the interval.

    >>> low, high = independent_difference((48, 80), (56, 70)).interval
    >>> round(low, 4), round(high, 4)
    (0.0524, 0.3339)
    """
    from scipy.stats import fisher_exact

    shares = [successes / trials for successes, trials in (first, second)]
    intervals = [wilson(successes, trials, confidence) for successes, trials in (first, second)]
    value = shares[1] - shares[0]
    low = value - math.hypot(shares[1] - intervals[1].low, intervals[0].high - shares[0])
    high = value + math.hypot(intervals[1].high - shares[1], shares[0] - intervals[0].low)
    counts = [[successes, trials - successes] for successes, trials in (first, second)]
    return ProportionDifference(value, Interval(low, high), float(fisher_exact(counts).pvalue))
