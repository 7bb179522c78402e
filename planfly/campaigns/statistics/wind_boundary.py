"""Estimate the largest wind in which a mission is flyable with a given probability.

The estimate is made from flights in chosen winds.

If some flights were flyable and some failed, the fraction of flights that fail in a wind is the mean of the failure
modes over the possible draws, and the boundary is the wind in which this fraction is 1 - P (`boundary_quantiles`).  The
links are equally likely a priori, and are weighted by their evidence.  If all flights were flyable, or all failed,
`FailureWindDistributions` are used.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from planfly.campaigns.statistics.censored_regression import LINKS
from planfly.campaigns.statistics.failure_modes import (
    WIND_ORIGIN_MPS,
    FailureMode,
    FailureWindDistributions,
    boundary_slopes,
    boundary_speed,
    failure_probabilities,
    fit_modes,
    make_regressors,
)
from world.arrays import Floats

# ----------------------------------------------------------------------
# The boundary: the wind in which a fraction 1 - P of flights fails, for each sample of the failure modes' coefficients.
#
# The fraction that fails in a wind is the mean of the failure modes over the possible draws.  In every sample more wind
# never causes fewer failures (`censored_regression`), so that each sample has one boundary.


# Number of draws with which each sample's boundary is first bracketed.
_BRACKET_DRAWS = 256
# Width of this bracket, m/s; within it the logarithm of the failing fraction is nearly linear in the wind.
_BRACKET_WIDTH_MPS = 0.1
# Number of secant steps that follow, with all draws.
_SECANT_STEPS = 2
# Lower limit of probabilities whose logarithm is taken.
_MIN_PROBABILITY = 1e-12


@dataclass(frozen=True)
class WeightedModes:
    """Failure modes for one link, and the link's weight."""

    modes: tuple[FailureMode, ...]
    weight: float


def boundary_quantiles(
    fits: Sequence[WeightedModes],
    draws: Floats,
    failing_fraction: float,
    max_speed: float,
    probabilities: Sequence[float],
) -> list[float]:
    """Return quantiles of the boundary's posterior, m/s, in the order of `probabilities`.

    They lie between 0 and ``max_speed``.

    Each posterior sample of the coefficients gives one boundary, with the weight of its link; the quantiles are taken
    over these boundaries.

    fits: failure modes fitted with each link, and the link's weight.
    draws: possible draws, (m, d); any first few of them must be spread evenly, too.
    failing_fraction: fraction of flights that fail at the boundary, above 0 and below 1.
    probabilities: probability of each quantile, 0 to 1.

    >>> from planfly.campaigns.statistics.censored_regression import PROBIT
    >>> sample = np.column_stack((np.linspace(-0.1, 0.1, 101), np.full(101, 0.5)))
    >>> mode = FailureMode(PROBIT, sample.mean(axis=0), np.cov(sample.T), lambda: sample, 0.0)
    >>> modes = [WeightedModes((mode,), 1.0)]
    >>> [round(one, 1) for one in boundary_quantiles(modes, np.zeros((1, 0)), 0.5, 20.0, (0.5,))]
    [10.0]
    """
    speeds = [_boundary_speeds(fit.modes, draws, failing_fraction, max_speed) for fit in fits]
    weights = np.concatenate(
        [np.full(fit_speeds.size, fit.weight / fit_speeds.size) for fit, fit_speeds in zip(fits, speeds, strict=True)]
    )
    all_speeds = np.concatenate(speeds)
    order = np.argsort(all_speeds, kind="stable")
    cumulative = np.cumsum(weights[order]) / weights.sum()
    return [
        float(all_speeds[order][min(int(np.searchsorted(cumulative, probability)), all_speeds.size - 1)])
        for probability in probabilities
    ]


def _boundary_speeds(modes: Sequence[FailureMode], draws: Floats, failing_fraction: float, max_speed: float) -> Floats:
    """Return the boundary for each posterior sample of the modes' coefficients, m/s, (n,).

    Bisection with the first `_BRACKET_DRAWS` draws brackets each boundary; secant steps with all draws then refine it.

    draws: possible draws, (m, d).
    modes: fitted failure modes for one link.
    failing_fraction: fraction of the flights that fail at the boundary, 0 to 1.
    max_speed: strongest wind of the search, m/s.
    """
    # The posteriors of the modes are independent: samples of different modes can be combined in any order.
    samples = [
        np.random.default_rng(number).permutation(mode.sample()) if number else mode.sample()
        for number, mode in enumerate(modes)
    ]
    bracket_fractions, all_fractions = (
        _FailureFractions(modes, samples, some_draws) for some_draws in (draws[:_BRACKET_DRAWS], draws)
    )
    lower, upper = np.zeros(len(samples[0])), np.full(len(samples[0]), max_speed)
    while (upper - lower).max() > _BRACKET_WIDTH_MPS:
        speed_between = 0.5 * (lower + upper)
        is_above = bracket_fractions.log_fractions(speed_between) > np.log(failing_fraction)
        lower = np.where(is_above, lower, speed_between)
        upper = np.where(is_above, speed_between, upper)
    speed: Floats = 0.5 * (lower + upper)
    previous_speed = speed - _BRACKET_WIDTH_MPS
    previous_error = all_fractions.log_fractions(previous_speed) - np.log(failing_fraction)
    for _ in range(_SECANT_STEPS):
        error = all_fractions.log_fractions(speed) - np.log(failing_fraction)
        wind_slope = np.maximum(
            (error - previous_error) / np.where(speed == previous_speed, 1.0, speed - previous_speed), 1e-9
        )
        previous_speed, previous_error, speed = speed, error, np.clip(speed - error / wind_slope, 0.0, max_speed)
    return speed


class _FailureFractions:
    """Fraction of flights that fail, for each posterior sample of the modes' coefficients.

    samples: sampled coefficients of each mode, (n, 2 + d).
    draws: possible draws, (m, d), over which the fraction is averaged.
    """

    def __init__(self, modes: Sequence[FailureMode], samples: list[Floats], draws: Floats) -> None:
        self._modes, self._samples = modes, samples
        self._predictors_at_origin = [make_regressors(WIND_ORIGIN_MPS, draws) @ sample.T for sample in samples]

    def log_fractions(self, speeds: Floats) -> Floats:
        """Return the logarithm of each sample's failing fraction, (n,).

        speeds: wind for each sample, m/s, (n,).
        """
        success = np.ones_like(self._predictors_at_origin[0])
        for mode, sample, predictor in zip(self._modes, self._samples, self._predictors_at_origin, strict=True):
            success *= mode.link.survival(predictor + sample[:, 1] * (speeds - WIND_ORIGIN_MPS))
        return np.log(np.maximum(1.0 - success.mean(axis=0), _MIN_PROBABILITY))


@dataclass
class DrawnNumbers:
    """Draws of the quantities that vary between flights, other than the wind.

    They are in standard deviations from the means.

    population: (m, d) evenly spread possible draws; each represents the same share of flights.
    draw: function of start and stop index that returns the draws of these flights, (stop - start, d).
    """

    population: Floats
    draw: Callable[[int, int], Floats]
    _known: list[Floats] = field(default_factory=list)

    def first_draws(self, count: int) -> Floats:
        """Return the first `count` draws, (count, d); each draw is computed only once."""
        known_count = sum(len(block) for block in self._known)
        if known_count < count:
            self._known.append(self.draw(known_count, max(count, known_count + 500)))
        if len(self._known) > 1:
            self._known[:] = [np.concatenate(self._known)]
        return self._known[0][:count] if self._known else self.population[:0]


@dataclass(frozen=True)
class WindBoundary:
    """Posterior of the boundary, m/s.

    The boundary is the largest wind in which the mission is flyable with the target probability.

    estimate: median of the posterior.
    low, high: two-sided interval of the posterior.
    is_beyond_search: True if the boundary is not below the largest wind of the search, to which `estimate` is limited.
    """

    estimate: float
    low: float
    high: float
    is_beyond_search: bool

    @property
    def width(self) -> float:
        """Width of the interval, m/s."""
        return self.high - self.low


@dataclass(frozen=True)
class FailureFit(WeightedModes):
    """Failure modes fitted for one link to the flights of a direction, and their boundary.

    speed: the boundary, m/s, at most the largest wind of the search.
    slopes: derivatives of the boundary by each mode's coefficients, as from `boundary_slopes`.
    """

    speed: float
    slopes: list[Floats]


class Direction:
    """Flights in winds from one direction, from which the direction's boundary is estimated.

    max_speed: largest wind of the search, m/s.
    target: required probability of success, above 0 and below 1.
    confidence: probability of the boundary's interval, above 0 and below 1.
    numbers: drawn quantities of the flights.
    speeds: wind of each flight, m/s.
    draws: index of each flight's draw.
    failed_modes: failure modes of each flight.
    margin: for each flight, the modes that it passed narrowly, with the margin as a fraction of a scale, 0 to 1; None
        if unknown.
    """

    def __init__(self, max_speed: float, target: float, numbers: DrawnNumbers, confidence: float = 0.95) -> None:
        self.max_speed, self.target, self.numbers, self.confidence = max_speed, target, numbers, confidence
        self.speeds: list[float] = []
        self.draws: list[int] = []
        self.failed_modes: list[frozenset[Hashable]] = []
        self.margin: list[Mapping[Hashable, float] | None] = []
        self._fits: tuple[int, tuple[FailureFit, ...]] | None = None

    def add(
        self, speed: float, draw: int, failed_modes: frozenset[Hashable], margin: Mapping[Hashable, float] | None = None
    ) -> None:
        """Add the result of a flight.

        speed: wind speed, m/s, from 0 to `max_speed`; otherwise ValueError is raised.
        draw: index of the flight's draw.
        failed_modes: modes in which the flight failed; empty for a flyable flight.
        margin: margins of modes that the flight passed, see `fit_modes`; None if the margins are unknown.
        """
        if not 0.0 <= speed <= self.max_speed:
            raise ValueError(f"speed: {speed}: expected 0 to {self.max_speed:g} m/s")
        self.speeds.append(speed)
        self.draws.append(draw)
        self.failed_modes.append(failed_modes)
        self.margin.append(margin)

    @property
    def all_flyable(self) -> bool:
        """True if no flight failed."""
        return not any(self.failed_modes)

    @property
    def all_failed(self) -> bool:
        """True if every flight failed."""
        return all(self.failed_modes)

    def fits(self) -> tuple[FailureFit, ...]:
        """Return the failure modes fitted with each link function, cached until a flight is added.

        The direction must have both failed and flyable flights.
        """
        if self._fits is None or self._fits[0] != len(self.speeds):
            terms = make_regressors(np.array(self.speeds), self.numbers.first_draws(max(self.draws) + 1)[self.draws])
            modes_by_link = [fit_modes(terms, self.failed_modes, link, self.margin) for link in LINKS]
            evidence = np.array([sum(mode.log_evidence for mode in modes) for modes in modes_by_link])
            weights = np.exp(evidence - evidence.max())
            weights /= weights.sum()
            draws, fits = self.numbers.population, []
            for modes, weight in zip(modes_by_link, weights.tolist(), strict=True):
                speed = boundary_speed(modes, draws, 1.0 - self.target, self.max_speed)
                fits.append(FailureFit(modes, weight, speed, boundary_slopes(modes, draws, speed)))
            self._fits = (len(self.speeds), tuple(fits))
        return self._fits[1]

    def boundary(self) -> WindBoundary:
        """Return the estimate and the interval of the boundary, limited to 0 to `max_speed`.

        >>> numbers = DrawnNumbers(np.zeros((8, 0)), lambda start, stop: np.zeros((stop - start, 0)))
        >>> direction = Direction(20.0, 0.99, numbers)
        >>> for k in range(200):
        ...     direction.add(8.0 + 0.02 * k, k, frozenset() if 8.0 + 0.02 * k < 10.0 else frozenset({"slope"}))
        >>> found = direction.boundary()
        >>> 9.0 < found.low < found.estimate < found.high < 10.0
        True
        """
        tail, failing_fraction = 0.5 * (1.0 - self.confidence), 1.0 - self.target
        probabilities = (tail, 0.5, 1.0 - tail)
        if self.all_flyable or self.all_failed:
            is_flyable = np.full(len(self.speeds), self.all_flyable)
            lower, median, upper = self._failure_distributions.posterior_quantiles(
                failing_fraction, np.array(self.speeds), is_flyable, np.array(probabilities)
            )
        else:
            lower, median, upper = boundary_quantiles(
                self.fits(), self.numbers.population, failing_fraction, self.max_speed, probabilities
            )
        lower, median, upper = (float(min(self.max_speed, max(0.0, speed))) for speed in (lower, median, upper))
        return WindBoundary(median, lower, upper, median >= self.max_speed - 1e-9)

    @cached_property
    def _failure_distributions(self) -> FailureWindDistributions:
        """Distributions used instead of the regression while all flights have the same outcome."""
        return FailureWindDistributions.on_grid(self.max_speed)


def needs_more_flights(boundary: WindBoundary, flights: int, accuracy: float, min_flights: int) -> bool:
    """Return True if a direction has too few flights, or a boundary whose interval is too wide.

    flights: number of flights of the direction; at least `min_flights` are needed.
    accuracy: largest half-width of the interval, m/s.

    >>> needs_more_flights(WindBoundary(9.0, 8.8, 9.2, False), 40, 0.5, 30)
    False
    """
    return flights < min_flights or boundary.width > 2.0 * accuracy


# ----------------------------------------------------------------------
# Choice of the most informative flights of a direction: their winds and their draws.
#
# First bisection, until there are both flyable and failed flights.  Then each flight is the one that minimises the
# expected variance of the boundary: the one-step look-ahead of adaptive psychometric testing (King-Smith et al., Vision
# Research 34, 1994), by the information of a flight in a binary regression (Chaloner and Verdinelli, "Bayesian
# Experimental Design", Statistical Science 10(3), 1995, section 4).  The draw of a flight is known before the flight,
# so that the draw is chosen, too; every third flight takes the next draw in order, so that an unseen failure mode is
# not avoided.  Only the likelihood of the flights enters the fit: the choice does not bias it.

# Step of the winds that are flown, m/s.
WIND_GRID_MPS = 0.1
# Smallest expected failing fraction of the compared winds.  A fit near the centre of a distribution need not be valid
# in its tail, where the boundary is.
_MIN_FAILING_FRACTION = 1e-3
# Largest expected failing fraction of the compared winds.
_MAX_FAILING_FRACTION = 0.2
# Number of compared winds.
_WIND_COUNT = 10
# Number of compared draws that have not been flown.
_COMPARED_DRAWS = 1000
# Number of draws among which the extreme ones are selected.
_EXTREME_DRAW_POOL = 2000
# Every n-th flight takes the next draw in order.
_NEXT_DRAW_INTERVAL = 3
# Distance from the largest wind of the search within which bisection takes the largest wind, m/s.
_LARGEST_WIND_TOLERANCE_MPS = 0.3


def next_flights(direction: Direction, count: int) -> list[tuple[float, int]]:
    """Choose the next `count` flights of a direction; return wind, m/s, and index of the draw of each.

    While all flights have the same outcome, the wind is chosen by bisection.  After that, those flights are chosen
    that are expected to reduce the variance of the boundary most.
    """
    if direction.all_flyable or direction.all_failed:
        # While all flights had the same result, the wind is half of the weakest one if all failed, and between the
        # strongest and the maximum if all were flyable.
        max_speed = direction.max_speed
        if not direction.speeds:
            speed = _round_to_grid(0.5 * max_speed, max_speed)
        elif direction.all_failed:
            speed = _round_to_grid(0.5 * min(direction.speeds), max_speed)
        else:
            max_flown = max(direction.speeds)
            speed = (
                _round_to_grid(0.5 * (max_flown + max_speed), max_speed)
                if max_flown < max_speed - _LARGEST_WIND_TOLERANCE_MPS
                else max_speed
            )
        # In the maximum wind, the draws with extreme values come first, because they are the most likely to fail.
        draws = []
        if speed == direction.max_speed:
            numbers = direction.numbers.first_draws(_EXTREME_DRAW_POOL)
            extreme_draws = [
                int(select(numbers[:, k])) for k in range(numbers.shape[1]) for select in (np.argmax, np.argmin)
            ]
            draws = [draw for draw in dict.fromkeys(extreme_draws) if draw not in set(direction.draws)]
        return [(speed, draw) for draw in (draws + _next_draws(direction, count, draws))[:count]]
    return _choose_most_informative(direction, count)


def _next_draws(direction: Direction, count: int, other_draws: list[int]) -> list[int]:
    """Return the first `count` indices of draws that are neither flown nor in `other_draws`."""
    used_draws = {*direction.draws, *other_draws}
    draws: list[int] = []
    index = 0
    while len(draws) < count:
        if index not in used_draws:
            draws.append(index)
        index += 1
    return draws


def _choose_most_informative(direction: Direction, count: int) -> list[tuple[float, int]]:
    """Choose the `count` most informative flights of a direction: wind, m/s, and index of the draw.

    Each flight is chosen as if the previous ones had been flown.
    """
    fits = direction.fits()
    max_speed = direction.max_speed
    flown_count = len(direction.draws)
    min_speeds, max_speeds = (
        [boundary_speed(fit.modes, direction.numbers.population, failing_fraction, max_speed) for fit in fits]
        for failing_fraction in (_MIN_FAILING_FRACTION, _MAX_FAILING_FRACTION)
    )
    speeds = np.unique(
        [_round_to_grid(wind, max_speed) for wind in np.linspace(min(min_speeds), max(max_speeds), _WIND_COUNT)]
    )
    posteriors = [_ExpectedPosterior(fit) for fit in fits]
    # Without drawn quantities all draws are equivalent.
    draw_count = _COMPARED_DRAWS if direction.numbers.population.shape[1] else 1
    flights: list[tuple[float, int]] = []
    for number in range(flown_count, flown_count + count):
        used_draws = [draw for _, draw in flights]
        draws = _next_draws(direction, 1 if number % _NEXT_DRAW_INTERVAL == 0 else draw_count, used_draws)
        draw_values = direction.numbers.first_draws(max(draws) + 1)[draws]
        terms = make_regressors(np.repeat(speeds, len(draws)), np.tile(draw_values, (speeds.size, 1)))
        best_index = int(
            np.argmax(
                sum(posterior.expected_gains(terms) for posterior in posteriors)
                + _expected_between_fit_reductions(fits, terms)
            )
        )
        flights.append((float(speeds[best_index // len(draws)]), draws[best_index % len(draws)]))
        for posterior in posteriors:
            posterior.include_flight(terms[best_index])
    return flights


def _expected_between_fit_reductions(fits: tuple[FailureFit, ...], terms: Floats) -> Floats:
    """Return each flight's expected reduction of the boundary's variance between fits, (m/s)^2, (n,).

    The fits are alternative models, and the outcome of a flight makes one of them more likely.  The reduction is the
    variance, over the two outcomes of a flight, of the mean boundary given the outcome.

    terms: regressors of each flight, see `make_regressors`, (n, 2 + d).
    """
    weights, speeds = (np.array(column) for column in zip(*((fit.weight, fit.speed) for fit in fits), strict=True))
    deviations = speeds - weights @ speeds
    failure = np.array([failure_probabilities(fit.modes, terms) for fit in fits])
    mean_failure = np.clip(weights @ failure, 1e-300, 1.0 - 1e-16)
    # Mean deviation of the boundary, weighted by failure; for success it has the opposite sign.
    weighted_deviation = (weights * deviations) @ failure
    return weighted_deviation**2 / mean_failure + weighted_deviation**2 / (1.0 - mean_failure)


class _ExpectedPosterior:
    """Posterior that a fit is expected to have after the flights chosen so far."""

    def __init__(self, fit: FailureFit) -> None:
        self._fit = fit
        self._covariances = [mode.covariance for mode in fit.modes]

    def expected_gains(self, terms: Floats) -> Floats:
        """Return each flight's expected reduction of the boundary's variance in this fit, (m/s)^2, (n,).

        The reduction is multiplied by the weight of the fit.

        terms: regressors of each flight, (n, 2 + d).
        """
        expected_gains: Floats = np.zeros(len(terms))
        for k, information in enumerate(self._mode_information(terms)):
            projected, slope = terms @ self._covariances[k], self._fit.slopes[k]
            expected_gains += (
                (projected @ slope) ** 2 * information / (1.0 + information * (projected * terms).sum(axis=1))
            )
        return self._fit.weight * expected_gains

    def include_flight(self, row: Floats) -> None:
        """Update the covariances as if a flight with its expected information had been flown.

        row: terms of the flight, (2 + d,).
        """
        for k, information in enumerate(self._mode_information(row[None])):
            projected = self._covariances[k] @ row
            self._covariances[k] = self._covariances[k] - information * np.outer(projected, projected) / (
                1.0 + information * (row @ projected)
            )

    def _mode_information(self, terms: Floats) -> Iterator[Floats]:
        """Yield for each mode the expected Fisher information of each flight about the mode's predictor, (n,).

        A flight that fails in an earlier mode has no information about a later mode.

        terms: regressors of each flight, (n, 2 + d).
        """
        reach_probability: Floats = np.ones(len(terms))
        for mode in self._fit.modes:
            predictor = terms @ mode.mean
            yield reach_probability * mode.link.information(predictor, mode.margin_coefficient)
            reach_probability = reach_probability * mode.link.survival(predictor)


def _round_to_grid(speed: float, max_speed: float) -> float:
    """Return a wind speed rounded to the grid of winds, from 0 to `max_speed`, m/s."""
    return min(max_speed, max(0.0, round(speed / WIND_GRID_MPS) * WIND_GRID_MPS))
