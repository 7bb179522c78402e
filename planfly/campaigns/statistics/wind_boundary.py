"""The largest wind in which a mission flies with a given probability, from flights in winds chosen as one goes.

Each flight has a wind of its own above which it fails.  Over flights that wind is taken to be distributed normally
(probit regression) or as the least of many (Gumbel's law for minima: complementary log-log regression, whose tail is
the longer one), each of mean and standard deviation unknown and as likely as the other before the first flight.  The
boundary for a probability P is the quantile 1 - P.  The posterior is summed on a grid over law, mean and standard
deviation, so that it holds for few flights, too, for none that failed, and however the winds were chosen: only the
likelihood of what was flown enters.

The next wind is the one after which the boundary's variance is expected to be least, whatever comes of the flight: the
look one step ahead of adaptive psychometric testing (King-Smith et al., Vision Research 34, 1994; Watson, "QUEST+",
Journal of Vision 17(3):10, 2017).  Only winds are asked where few flights are expected to fail, for the boundary is in
the tail, and what holds about the middle of a law need not hold there.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Of the standard deviation of the wind at which flights begin to fail, m/s: from a quarter of the accuracy wanted to
# what would leave no boundary; each factor as likely as any other.
_SPREADS = np.geomspace(0.1, 5.0, 30)
# Grid of the mean, m/s, and how far it goes beyond the winds that are looked at.
_STEP, _BELOW, _ABOVE = 0.1, 5.0, 10.0
# Weights that are less than this of the largest are left out where the next wind is looked for.
_NEGLIGIBLE = 1e-8
# The share of flights that is expected to fail where they are put: at the least, and at most.
_LEAST_SHARE, _MOST_SHARE = 1e-3, 0.2
# Winds that are compared for the next flights.
_CANDIDATES = 24
# Winds are flown in steps of this, m/s, so that flights at one wind come together.
GRID = 0.1
# Flights that are put at a time.
BATCH = 3


@dataclass(frozen=True)
class FailureLaws:
    """The laws of the wind at which flights begin to fail, on a grid: (n,) arrays, normal ones first.

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

    def picked(self, mask: NDArray[np.bool_]) -> "FailureLaws":
        """Those of a mask (n,)."""
        return FailureLaws(self.location[mask], self.scale[mask], int(mask[: self.normals].sum()))

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


class Direction:
    """Flights in wind from one direction.

    most: wind up to which is looked, m/s.
    speeds: m/s, in which they were flown.  flyable: whether each was.
    """

    def __init__(self, most: float, target: float, confidence: float = 0.95) -> None:
        self.most, self.target, self.confidence = most, target, confidence
        self.speeds: list[float] = []
        self.flyable: list[bool] = []
        self._laws = FailureLaws.up_to(most)
        self._logs = np.zeros(self._laws.location.size)

    def add(self, speed: float, flyable: bool) -> None:
        """Take a flight in."""
        self.speeds.append(speed)
        self.flyable.append(flyable)
        fails, flies = self._laws.log_shares(speed)
        self._logs += flies if flyable else fails

    def boundary(self) -> "WindBoundary":
        """What is known of the boundary.

        >>> direction = Direction(20.0, 0.99)
        >>> for k in range(200):
        ...     direction.add(8.0 + 0.02 * k, 8.0 + 0.02 * k < 10.0)
        >>> found = direction.boundary()
        >>> 9.3 < found.low < found.estimate <= found.high < 10.1
        True
        """
        order = np.argsort(self._quantiles, kind="stable")
        values, share = self._quantiles[order], np.cumsum(self._weights()[order])
        tail = 0.5 * (1.0 - self.confidence)
        low, middle, high = (
            float(values[min(int(np.searchsorted(share, part)), values.size - 1)]) for part in (tail, 0.5, 1.0 - tail)
        )
        return WindBoundary(middle, low, high, middle >= self.most - 1e-9)

    @cached_property
    def _quantiles(self) -> Floats:
        """(n,) the boundary by each law, within the winds that are looked at, m/s."""
        return np.clip(self._laws.quantile(1.0 - self.target), 0.0, self.most)

    def _weights(self) -> Floats:
        """(n,) of the laws, summing to 1."""
        weights: Floats = np.exp(self._logs - self._logs.max())
        weights /= weights.sum()
        return weights

    def next_speed(self) -> float:
        """The wind that tells most, m/s: by halves until some flights flew and some failed, then by looking ahead."""
        if not self.speeds:
            return _rounded(0.5 * self.most, self.most)
        if all(self.flyable):
            top = max(self.speeds)
            return _rounded(0.5 * (top + self.most), self.most) if top < self.most - 0.3 else self.most
        if not any(self.flyable):
            return _rounded(0.5 * min(self.speeds), self.most)
        return self._looked_ahead()

    def _looked_ahead(self) -> float:
        """The wind after whose flight the boundary's expected variance is least, m/s."""
        weights = self._weights()
        mask = weights > _NEGLIGIBLE * weights.max()
        laws, weights, edge = self._laws.picked(mask), weights[mask] / weights[mask].sum(), self._quantiles[mask]
        low, high = (self._where_share_fails(laws, weights, share) for share in (_LEAST_SHARE, _MOST_SHARE))
        speeds = sorted({_rounded(speed, self.most) for speed in np.linspace(low, high, _CANDIDATES)})
        fails = np.exp([laws.log_shares(speed)[0] for speed in speeds])
        # (speeds,) the probability to fail, and the sum of boundaries of the laws by which it fails; the variance
        # left after either outcome is the mean square of the boundary less that of its two conditional means.
        failing, failed = fails @ weights, fails @ (weights * edge)
        explained = failed**2 / failing + (weights @ edge - failed) ** 2 / (1.0 - failing)
        return speeds[int(np.argmax(explained))]

    def _where_share_fails(self, laws: FailureLaws, weights: Floats, share: float) -> float:
        """The wind in which this share of flights is expected to fail, m/s, found by halves."""
        low, high = 0.0, self.most
        while high - low > 0.5 * GRID:
            middle = 0.5 * (low + high)
            fails = float(np.exp(laws.log_shares(middle)[0]) @ weights)
            low, high = (middle, high) if fails < share else (low, middle)
        return high


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
