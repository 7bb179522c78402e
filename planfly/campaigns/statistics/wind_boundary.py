"""The largest wind in which a mission flies with a given probability, from flights in winds chosen as one goes.

Where some flights flew and some failed, the share of flights that fail in a wind is the mean of `failure_modes` over
what may be drawn, and the boundary the wind in which that share is 1 - P (`boundary_posterior`).  Each of the `links`
is as likely as the other before the first flight, and weighs by its evidence then.  Where all flew, or all failed, one
law of `failure_laws` has to do.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
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
    fail_shares,
    fit_modes,
    regressors,
)

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# Where the boundary lies: the wind in which 1 - P of flights fail, of each sample of what the failure modes may be.
#
# The share that fails in a wind is the mean of the failure modes over what may be drawn.  More wind never has fewer
# fail, in no sample (`censored_regression`), so that each has one boundary.


# Each sample's boundary is first found over so few of what may be drawn, to so many m/s; the logarithm of the share
# that fails, over all of it, is then nearly straight in the wind: so many steps of the secant method follow.
_FEW, _NEAR, _SECANTS = 256, 0.1, 2
# The smallest probability that counts as more than zero.
_MIN_PROBABILITY = 1e-12


@dataclass(frozen=True)
class WeightedModes:
    """The modes by one link, and its weight among all."""

    modes: tuple[FailureMode, ...]
    weight: float


def boundary_quantiles(
    fits: Sequence[WeightedModes], draws: Floats, share: float, most: float, probabilities: Sequence[float]
) -> list[float]:
    """The wind, from 0 to most, m/s, that the boundary lies below with each of these probabilities, 0 to 1.

    draws: (m, d) of what may be drawn, spread evenly however few of the first are taken.
    share: of flights that fail at the boundary, above 0 and below 1.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> sample = np.column_stack((np.linspace(-0.1, 0.1, 101), np.full(101, 0.5)))
    >>> mode = FailureMode(PROBIT, sample.mean(axis=0), np.cov(sample.T), lambda: sample, 0.0)
    >>> modes = [WeightedModes((mode,), 1.0)]
    >>> [round(one, 1) for one in boundary_quantiles(modes, np.zeros((1, 0)), 0.5, 20.0, (0.5,))]
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
        np.random.default_rng(number).permutation(mode.sample()) if number else mode.sample()
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
class FailureFit(WeightedModes):
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
    margin: the ways that each passed narrowly, and by what share of a scale, 0 to 1; None where that is not known.
    """

    def __init__(self, most: float, target: float, numbers: DrawnNumbers, confidence: float = 0.95) -> None:
        self.most, self.target, self.numbers, self.confidence = most, target, numbers, confidence
        self.speeds: list[float] = []
        self.draws: list[int] = []
        self.failed: list[frozenset[Hashable]] = []
        self.margin: list[Mapping[Hashable, float] | None] = []
        self._fits: tuple[int, tuple[FailureFit, ...]] | None = None

    def add(
        self, speed: float, draw: int, failed: frozenset[Hashable], margin: Mapping[Hashable, float] | None = None
    ) -> None:
        """Take a flight in, of a wind from 0 to `most`, m/s; failed: none for one that was flyable.

        margin: None where nothing is known of how narrowly it passed.  Raises ValueError for another wind.
        """
        if not 0.0 <= speed <= self.most:
            raise ValueError(f"speed: {speed}: 0 to {self.most:g} m/s is expected")
        self.speeds.append(speed)
        self.draws.append(draw)
        self.failed.append(failed)
        self.margin.append(margin)

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
            every = [fit_modes(terms, self.failed, link, self.margin) for link in LINKS]
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


# ----------------------------------------------------------------------
# Which flights of a direction tell most of its boundary: their winds, and which draws.
#
# First by bisection, until some flew and some failed.  Then each flight is the one after which the boundary's variance
# is expected to be least: the look one step ahead of adaptive psychometric testing (King-Smith et al., Vision Research
# 34, 1994), by the information that a binary regression has of a flight (Chaloner and Verdinelli, "Bayesian
# Experimental Design", Statistical Science 10(3), 1995, section 4).  What is drawn for a flight is known before it is
# flown, so the draw is chosen too; every third is the next that has not been flown, whatever it is, so that a way of
# failing that has not been seen is not avoided.  Only the likelihood of what was flown enters the fit: the choice does
# not bias it.

# Winds are flown in steps of this, m/s.
GRID = 0.1
# The share of all that may be drawn that is expected to fail in the winds that are compared, and how many winds.  What
# holds about the middle of a law need not hold in its tail, where the boundary is.
_MIN_SHARE, _MAX_SHARE, _WINDS = 1e-3, 0.2, 10
# Draws that are compared, of those not flown; of how many the extreme ones are sought.
_COMPARED, _SOUGHT = 1000, 2000
# Every so many flights takes the next draw.
_PLAIN = 3
# Nearer to the largest wind that is looked at than this, by bisection, it is that wind, m/s.
_END = 0.3


def next_flights(direction: Direction, count: int) -> list[tuple[float, int]]:
    """Wind, m/s, and draw of the flights that tell most, so many."""
    if direction.all_flew or direction.all_failed:
        speed = _by_bisection(direction)
        draws = _extreme_draws(direction) if speed == direction.most else []
        return [(speed, draw) for draw in (draws + _next_draws(direction, count, draws))[:count]]
    return _most_telling(direction, count)


def _by_bisection(direction: Direction) -> float:
    most = direction.most
    if not direction.speeds:
        return _rounded(0.5 * most, most)
    if direction.all_failed:
        return _rounded(0.5 * min(direction.speeds), most)
    top = max(direction.speeds)
    return _rounded(0.5 * (top + most), most) if top < most - _END else most


def _next_draws(direction: Direction, count: int, others: list[int]) -> list[int]:
    """The draws of least index that are neither flown nor among others."""
    taken = {*direction.draws, *others}
    out: list[int] = []
    index = 0
    while len(out) < count:
        if index not in taken:
            out.append(index)
        index += 1
    return out


def _extreme_draws(direction: Direction) -> list[int]:
    """Of each quantity the draw with the most of it and the one with the least, but for those that were flown."""
    numbers = direction.numbers.first(_SOUGHT)
    wanted = [int(pick(numbers[:, k])) for k in range(numbers.shape[1]) for pick in (np.argmax, np.argmin)]
    return [draw for draw in dict.fromkeys(wanted) if draw not in set(direction.draws)]


def _most_telling(direction: Direction, count: int) -> list[tuple[float, int]]:
    fits, most, flown = direction.fits(), direction.most, len(direction.draws)
    least, largest = (
        [boundary_speed(fit.modes, direction.numbers.population, share, most) for fit in fits]
        for share in (_MIN_SHARE, _MAX_SHARE)
    )
    speeds = np.unique([_rounded(wind, most) for wind in np.linspace(min(least), max(largest), _WINDS)])
    beliefs = [_Belief(fit) for fit in fits]
    # Where nothing is known of what is drawn, one draw is as good as any.
    compared = _COMPARED if direction.numbers.population.shape[1] else 1
    out: list[tuple[float, int]] = []
    for number in range(flown, flown + count):
        taken = [draw for _, draw in out]
        draws = _next_draws(direction, 1 if number % _PLAIN == 0 else compared, taken)
        drawn = direction.numbers.first(max(draws) + 1)[draws]
        terms = regressors(np.repeat(speeds, len(draws)), np.tile(drawn, (speeds.size, 1)))
        best = int(np.argmax(sum(belief.gains(terms) for belief in beliefs) + _gains_between(fits, terms)))
        out.append((float(speeds[best // len(draws)]), draws[best % len(draws)]))
        for belief in beliefs:
            belief.expect(terms[best])
    return out


def _gains_between(fits: tuple[FailureFit, ...], terms: Floats) -> Floats:
    """(n,) by how much each of these flights is expected to lessen the variance of the boundary between fits, m2/s2.

    Which fit is right shows in what comes out: the boundary's expected square less that of its two conditional means.
    """
    weights, speeds = (np.array(column) for column in zip(*((fit.weight, fit.speed) for fit in fits), strict=True))
    off = speeds - weights @ speeds
    fails = np.array([fail_shares(fit.modes, terms) for fit in fits])
    failing = np.clip(weights @ fails, 1e-300, 1.0 - 1e-16)
    # The mean of what is left over where one fails; where one flies, it is the opposite.
    failed = (weights * off) @ fails
    out: Floats = failed**2 / failing + failed**2 / (1.0 - failing)
    return out


class _Belief:
    """What a fit will know once flights that are chosen have been flown."""

    def __init__(self, fit: FailureFit) -> None:
        self._fit = fit
        self._covariances = [mode.covariance for mode in fit.modes]

    def gains(self, terms: Floats) -> Floats:
        """(n,) by how much each of these flights (n, 2 + d) is expected to lessen the boundary's variance, m2/s2."""
        out: Floats = np.zeros(len(terms))
        for k, info in enumerate(self._informations(terms)):
            known, slope = terms @ self._covariances[k], self._fit.slopes[k]
            out += (known @ slope) ** 2 * info / (1.0 + info * (known * terms).sum(axis=1))
        return self._fit.weight * out

    def expect(self, row: Floats) -> None:
        """Count a flight (2 + d,) as flown, whatever comes of it."""
        for k, info in enumerate(self._informations(row[None])):
            known = self._covariances[k] @ row
            self._covariances[k] = self._covariances[k] - info * np.outer(known, known) / (1.0 + info * (row @ known))

    def _informations(self, terms: Floats) -> Iterator[Floats]:
        """(n,) of each mode: a flight tells of one if it does not fail by those before."""
        reaches: Floats = np.ones(len(terms))
        for mode in self._fit.modes:
            x = terms @ mode.mean
            yield reaches * mode.link.information(x, mode.by_margin)
            reaches = reaches * mode.link.survival(x)


def _rounded(speed: float, most: float) -> float:
    return min(most, max(0.0, round(speed / GRID) * GRID))
