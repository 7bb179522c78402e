"""Where the boundary lies: the wind in which 1 - P of flights fail, of each sample of what the failure modes may be.

The share that fails in a wind is the mean of the failure modes over what may be drawn.  More wind never has fewer fail,
in no sample (`censored_regression`), so that each has one boundary.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.failure_mode import FailureMode
from planfly.campaigns.statistics.failure_modes import ORIGIN, regressors

Floats = NDArray[np.float64]

# Each sample's boundary is first found over so few of what may be drawn, to so many m/s; the logarithm of the share
# that fails, over all of it, is then nearly straight in the wind: so many steps of the secant method follow.
_FEW, _NEAR, _SECANTS = 256, 0.1, 2
# Of a share, what is told from none.
_LEAST = 1e-12


@dataclass(frozen=True)
class WeighedModes:
    """The modes by one link, and its weight among all."""

    modes: tuple[FailureMode, ...]
    weight: float


def boundary_quantiles(
    fits: Sequence[WeighedModes], draws: Floats, share: float, most: float, probabilities: Sequence[float]
) -> list[float]:
    """The wind, from 0 to most, m/s, that the boundary lies below with each of these probabilities, 0 to 1.

    draws: (m, d) of what may be drawn, spread evenly however few of the first are taken.
    share: of flights that fail at the boundary, above 0 and below 1.

    >>> from planfly.campaigns.statistics.links import PROBIT
    >>> sample = np.column_stack((np.linspace(-0.1, 0.1, 101), np.full(101, 0.5)))
    >>> mode = FailureMode(PROBIT, sample.mean(axis=0), np.cov(sample.T), sample, 0.0)
    >>> [round(one, 1) for one in boundary_quantiles([WeighedModes((mode,), 1.0)], np.zeros((1, 0)), 0.5, 20.0, (0.5,))]
    [10.0]
    """
    speeds = [_boundaries(fit.modes, draws, share, most) for fit in fits]
    weights = np.concatenate(
        [np.full(some.size, fit.weight / some.size) for fit, some in zip(fits, speeds, strict=True)]
    )
    every = np.concatenate(speeds)
    order = np.argsort(every, kind="stable")
    summed = np.cumsum(weights[order]) / weights.sum()
    return [float(every[order][min(int(np.searchsorted(summed, part)), every.size - 1)]) for part in probabilities]


def _boundaries(modes: Sequence[FailureMode], draws: Floats, share: float, most: float) -> Floats:
    """(n,) of each sample, m/s."""
    # The modes are known apart from each other: any one's samples go with any of another's.
    samples = [
        np.random.default_rng(number).permutation(mode.sample) if number else mode.sample
        for number, mode in enumerate(modes)
    ]
    few, every = (_Shares(modes, samples, some) for some in (draws[:_FEW], draws))
    low, high = np.zeros(len(samples[0])), np.full(len(samples[0]), most)
    while (high - low).max() > _NEAR:
        middle = 0.5 * (low + high)
        fails = few.logarithms(middle) > np.log(share)
        low, high = np.where(fails, low, middle), np.where(fails, middle, high)
    speed: Floats = 0.5 * (low + high)
    before = speed - _NEAR
    off_before = every.logarithms(before) - np.log(share)
    for _ in range(_SECANTS):
        off = every.logarithms(speed) - np.log(share)
        by_wind = np.maximum((off - off_before) / np.where(speed == before, 1.0, speed - before), 1e-9)
        before, off_before, speed = speed, off, np.clip(speed - off / by_wind, 0.0, most)
    return speed


class _Shares:
    """The share that fails, of each sample; draws: (m, d)."""

    def __init__(self, modes: Sequence[FailureMode], samples: list[Floats], draws: Floats) -> None:
        self._modes, self._samples = modes, samples
        self._at_origin = [regressors(ORIGIN, draws) @ sample.T for sample in samples]

    def logarithms(self, speeds: Floats) -> Floats:
        """(n,) of the shares, each at its own wind, m/s."""
        flies = np.ones_like(self._at_origin[0])
        for mode, sample, x in zip(self._modes, self._samples, self._at_origin, strict=True):
            flies *= mode.link.survival(x + sample[:, 1] * (speeds - ORIGIN))
        out: Floats = np.log(np.maximum(1.0 - flies.mean(axis=0), _LEAST))
        return out
