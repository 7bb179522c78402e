"""The largest wind in which a mission flies with a given probability, from flights in winds chosen as one goes.

Each flight has a wind of its own above which it fails.  Over flights that wind is taken to be normally distributed, so
that the probability to fly at a wind v is a normal distribution's share above v (probit regression), and the boundary
for a probability P is that distribution's quantile 1 - P.  The posterior is summed on a grid over mean and standard
deviation, so that it holds for few flights, too, for none that failed, and however the winds were chosen: only the
likelihood of what was flown enters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Of the standard deviation of the wind at which flights begin to fail, m/s: from a quarter of the accuracy wanted to
# what would leave no boundary; each factor as likely as any other.
_SPREADS = np.geomspace(0.1, 5.0, 30)
# Grid of the mean, m/s.
_STEP = 0.1


class Direction:
    """Flights in wind from one direction.

    most: wind up to which is looked, m/s.
    speeds: m/s, in which they were flown.  flyable: whether each was.
    """

    def __init__(self, most: float, target: float, confidence: float = 0.95) -> None:
        self.most, self.target, self.confidence = most, target, confidence
        self.speeds: list[float] = []
        self.flyable: list[bool] = []
        self._means = np.arange(-5.0, most + 10.0, _STEP)
        self._logs = np.zeros((self._means.size, _SPREADS.size))

    def add(self, speed: float, flyable: bool) -> None:
        """Take a flight in."""
        from scipy.special import log_ndtr

        self.speeds.append(speed)
        self.flyable.append(flyable)
        z = (self._means[:, None] - speed) / _SPREADS[None, :]
        self._logs += log_ndtr(z if flyable else -z)

    def boundary(self) -> "WindBoundary":
        """What is known of the boundary.

        >>> direction = Direction(20.0, 0.99)
        >>> for k in range(200):
        ...     direction.add(8.0 + 0.02 * k, 8.0 + 0.02 * k < 10.0)
        >>> found = direction.boundary()
        >>> 9.5 < found.low < found.estimate <= found.high < 10.1
        True
        """
        from scipy.special import ndtri

        weights = self._posterior()
        quantile = self._means[:, None] + float(ndtri(1.0 - self.target)) * _SPREADS[None, :]
        order = np.argsort(quantile, axis=None)
        values, share = quantile.ravel()[order], np.cumsum(weights.ravel()[order])
        tail = 0.5 * (1.0 - self.confidence)
        low, middle, high = (
            float(np.clip(values[min(int(np.searchsorted(share, part)), values.size - 1)], 0.0, self.most))
            for part in (tail, 0.5, 1.0 - tail)
        )
        return WindBoundary(middle, low, high, middle >= self.most - 1e-9)

    def _posterior(self) -> Floats:
        """(m, s) weights over mean and standard deviation, summing to 1."""
        weights: Floats = np.exp(self._logs - self._logs.max())
        weights /= weights.sum()
        return weights

    def next_speeds(self) -> list[float]:
        """The `BATCH` winds that tell most, m/s.

        By halves until some flights flew and some failed; then about the boundary.
        Flights are put where from one in fifty to one in three of them is expected to fail: the boundary's estimate
        rests on those, and flights that cannot fail say little of where they would.
        """
        if not self.speeds:
            return [_rounded(0.5 * self.most, self.most)] * BATCH
        speeds, flyable = np.array(self.speeds), np.array(self.flyable, dtype=bool)
        if flyable.all():
            top = float(speeds.max())
            return [_rounded(0.5 * (top + self.most), self.most) if top < self.most - 0.3 else self.most] * BATCH
        if not flyable.any():
            return [_rounded(0.5 * float(speeds.min()), self.most)] * BATCH
        weights = self._posterior()
        mean = float((weights.sum(axis=1) * self._means).sum())
        spread = float((weights.sum(axis=0) * _SPREADS).sum())
        return [_rounded(mean - share * spread, self.most) for share in _SHARES]


# Standard deviations below the mean at which the flights of a batch are put: 2 %, 10 % and 31 % of them fail.
_SHARES = (2.0, 1.3, 0.5)
# Flights that are put at a time.
BATCH = len(_SHARES)
# Winds are flown in steps of this, m/s, so that flights at one wind come together.
GRID = 0.1


def _rounded(speed: float, most: float) -> float:
    return min(most, max(0.0, round(speed / GRID) * GRID))


@dataclass(frozen=True)
class WindBoundary:
    """The largest wind with the probability asked for, m/s.

    estimate: the posterior's median.  low, high: its two-sided interval.
    beyond: whether the estimate lies beyond all that was looked at.
    """

    estimate: float
    low: float
    high: float
    beyond: bool

    @property
    def width(self) -> float:
        """Of the interval, m/s."""
        return self.high - self.low


def needs_more(found: WindBoundary, flights: int, accuracy: float, fewest: int) -> bool:
    """Whether a direction is to be flown in further: too few flights, or an interval wider than twice the accuracy.

    >>> needs_more(WindBoundary(9.0, 8.8, 9.2, False), 40, 0.5, 30)
    False
    """
    return flights < fewest or found.width > 2.0 * accuracy
