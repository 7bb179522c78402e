"""The wind at which flights begin to fail, as one law: for flights that tell no more than whether they were flyable.

Each flight has a wind of its own above which it fails.  Over flights that wind is taken to be distributed normally or
as the least of many (Gumbel's law for minima, whose tail is the longer one), each of mean and standard deviation
unknown and as likely as the other before the first flight.  The posterior is summed on a grid over law, mean and
standard deviation, so that it holds for few flights, too, and for none that failed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Of the standard deviation of the wind at which flights begin to fail, m/s: from a quarter of the accuracy wanted to
# what would leave no boundary; each factor as likely as any other.
_SPREADS = np.geomspace(0.1, 5.0, 30)
# Grid of the mean, m/s, and how far it goes beyond the winds that are looked at.
_STEP, _BELOW, _ABOVE = 0.1, 5.0, 10.0


@dataclass(frozen=True)
class FailureLaws:
    """The laws on the grid: (n,) arrays, normal ones first.

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

    def quantile_at(self, share: float, speeds: Floats, flyable: NDArray[np.bool_], parts: Floats) -> Floats:
        """(k,) the wind at which this share of flights fails, at these parts of its posterior, m/s.

        speeds, flyable: (m,) of the flights that were flown.  parts: (k,) 0 to 1.
        """
        logs = np.zeros(self.location.size)
        for speed, counts in _counted(speeds, flyable).items():
            fails, flies = self.log_shares(speed)
            logs += counts[0] * fails + counts[1] * flies
        weights = np.exp(logs - logs.max())
        values = self.quantile(share)
        order = np.argsort(values, kind="stable")
        summed = np.cumsum(weights[order] / weights.sum())
        out: Floats = values[order][np.minimum(np.searchsorted(summed, parts), values.size - 1)]
        return out


def _counted(speeds: Floats, flyable: NDArray[np.bool_]) -> dict[float, tuple[int, int]]:
    """How many failed and how many flew, by wind."""
    return {
        float(speed): (int((~flyable[speeds == speed]).sum()), int(flyable[speeds == speed].sum()))
        for speed in np.unique(speeds)
    }
