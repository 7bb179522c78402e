"""Bounds of a probability that hold however long one looks: the beta-binomial mixture of Robbins.

For s successes and f failures the set of p with

    E(p) = sum_i w_i B(s + a_i, f + b_i) / B(a_i, b_i) / (p^s (1 - p)^f) < 1 / alpha

contains the true p at all times at once, with probability 1 - alpha: E is a martingale that begins at 1 (Robbins,
"Statistical methods related to the law of the iterated logarithm", Ann. Math. Stat. 41, 1970; Ville's inequality).
Whoever stops when it says enough is therefore not led astray, as with an interval for a fixed number of flights.

The mixture has two parts.  One, of nearly all the weight, lies so near to 1 that without a failure a target is reached
after as many flights as with a fixed number (299 for 0.99); the other, Jeffreys' Beta(1/2, 1/2), finds out about
probabilities far from the target.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planfly.campaigns.statistics.proportions import Interval, Tally

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
