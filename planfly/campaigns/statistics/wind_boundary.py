"""The largest wind in which a mission flies with a given probability, from flights in winds chosen as one goes.

Where some flights flew and some failed, the share of flights that fail in a wind is the mean of `failure_modes` over
what may be drawn, and the boundary the wind in which that share is 1 - P (`boundary_posterior`).  Each of the `links`
is as likely as the other before the first flight, and weighs by its evidence then.  Where all flew, or all failed, one
law of `failure_laws` has to do.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.censored_regression import LINKS
from planfly.campaigns.statistics.failure_modes import (
    ORIGIN,
    FailureLaws,
    FailureMode,
    boundary_slopes,
    boundary_speed,
    fit_modes,
    regressors,
)

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# Where the boundary lies: the wind in which 1 - P of flights fail, of each sample of what the failure modes may be.
#
# The share that fails in a wind is the mean of the failure modes over what may be drawn.  More wind never has fewer
# fail,
# in no sample (`censored_regression`), so that each has one boundary.


# Each sample's boundary is first found over so few of what may be drawn, to so many m/s; the logarithm of the share
# that fails, over all of it, is then nearly straight in the wind: so many steps of the secant method follow.
_FEW, _NEAR, _SECANTS = 256, 0.1, 2
# Of a share, what is told from none.
_MIN_PROBABILITY = 1e-12


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

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
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
        out: Floats = np.log(np.maximum(1.0 - flies.mean(axis=0), _MIN_PROBABILITY))
        return out


@dataclass
class DrawnNumbers:
    """What varies from flight to flight but the wind that is asked about, in standard deviations from the means.

    population: (m, d) spread evenly over what may be drawn; each stands for the same share of flights.
    drawn: gives (stop - start, d) of the draws from one index to before another, as they are flown.
    """

    population: Floats
    drawn: Callable[[int, int], Floats]
    _known: list[Floats] = field(default_factory=list)

    def first(self, count: int) -> Floats:
        """(count, d) of the draws from 0 on; computed once."""
        have = sum(len(block) for block in self._known)
        if have < count:
            self._known.append(self.drawn(have, max(count, have + 500)))
        if len(self._known) > 1:
            self._known[:] = [np.concatenate(self._known)]
        return self._known[0][:count] if self._known else self.population[:0]


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


@dataclass(frozen=True)
class FailureFit(WeighedModes):
    """What the flights of a direction tell of its boundary by one link.

    speed: of the boundary, m/s, up to the largest wind that is looked at.
    slopes: its derivatives by each mode's coefficients.
    """

    speed: float
    slopes: list[Floats]


class Direction:
    """Flights in wind from one direction.

    most: wind up to which is looked, m/s.  target, confidence: above 0 and below 1.
    speeds: m/s, in which they were flown.  draws: index of each one's draw.  failed: the ways in which each failed.
    room: the ways that each passed narrowly, and by what share of a scale, 0 to 1; None where that is not known.
    """

    def __init__(self, most: float, target: float, numbers: DrawnNumbers, confidence: float = 0.95) -> None:
        self.most, self.target, self.numbers, self.confidence = most, target, numbers, confidence
        self.speeds: list[float] = []
        self.draws: list[int] = []
        self.failed: list[frozenset[Hashable]] = []
        self.room: list[Mapping[Hashable, float] | None] = []
        self._fits: tuple[int, tuple[FailureFit, ...]] | None = None

    def add(
        self, speed: float, draw: int, failed: frozenset[Hashable], room: Mapping[Hashable, float] | None = None
    ) -> None:
        """Take a flight in, of a wind from 0 to `most`, m/s; failed: none for one that was flyable.

        room: None where nothing is known of how narrowly it passed.  Raises ValueError for another wind.
        """
        if not 0.0 <= speed <= self.most:
            raise ValueError(f"speed: {speed}: 0 to {self.most:g} m/s is expected")
        self.speeds.append(speed)
        self.draws.append(draw)
        self.failed.append(failed)
        self.room.append(room)

    @property
    def all_flew(self) -> bool:
        """Whether no flight failed."""
        return not any(self.failed)

    @property
    def all_failed(self) -> bool:
        """Whether every flight did."""
        return all(self.failed)

    def fits(self) -> tuple[FailureFit, ...]:
        """The ways of failing by each link; for a direction in which some flew and some did not."""
        if self._fits is None or self._fits[0] != len(self.speeds):
            terms = regressors(np.array(self.speeds), self.numbers.first(max(self.draws) + 1)[self.draws])
            every = [fit_modes(terms, self.failed, link, self.room) for link in LINKS]
            evidence = np.array([sum(mode.log_evidence for mode in modes) for modes in every])
            weights = np.exp(evidence - evidence.max())
            weights /= weights.sum()
            self._fits = (
                len(self.speeds),
                tuple(self._fit(modes, float(weight)) for modes, weight in zip(every, weights, strict=True)),
            )
        return self._fits[1]

    def _fit(self, modes: tuple[FailureMode, ...], weight: float) -> FailureFit:
        draws = self.numbers.population
        speed = boundary_speed(modes, draws, 1.0 - self.target, self.most)
        return FailureFit(modes, weight, speed, boundary_slopes(modes, draws, speed))

    def boundary(self) -> WindBoundary:
        """What is known of the boundary.

        >>> numbers = DrawnNumbers(np.zeros((8, 0)), lambda start, stop: np.zeros((stop - start, 0)))
        >>> direction = Direction(20.0, 0.99, numbers)
        >>> for k in range(200):
        ...     direction.add(8.0 + 0.02 * k, k, frozenset() if 8.0 + 0.02 * k < 10.0 else frozenset({"slope"}))
        >>> found = direction.boundary()
        >>> 9.0 < found.low < found.estimate < found.high < 10.0
        True
        """
        tail, share = 0.5 * (1.0 - self.confidence), 1.0 - self.target
        parts = (tail, 0.5, 1.0 - tail)
        if self.all_flew or self.all_failed:
            flew = np.full(len(self.speeds), self.all_flew)
            low, middle, high = self._laws.quantile_at(share, np.array(self.speeds), flew, np.array(parts))
        else:
            low, middle, high = boundary_quantiles(self.fits(), self.numbers.population, share, self.most, parts)
        low, middle, high = (float(min(self.most, max(0.0, one))) for one in (low, middle, high))
        return WindBoundary(middle, low, high, middle >= self.most - 1e-9)

    @cached_property
    def _laws(self) -> FailureLaws:
        return FailureLaws.up_to(self.most)


def needs_more(found: WindBoundary, flights: int, accuracy: float, fewest: int) -> bool:
    """Whether a direction is to be flown in further: too few flights, or an interval wider than twice the accuracy.

    >>> needs_more(WindBoundary(9.0, 8.8, 9.2, False), 40, 0.5, 30)
    False
    """
    return flights < fewest or found.width > 2.0 * accuracy
