"""Which flights of a direction tell most of its boundary: their winds, and which draws.

First by bisection, until some flew and some failed.  Then each flight is the one after which the boundary's variance is
expected to be least: the look one step ahead of adaptive psychometric testing (King-Smith et al., Vision Research 34,
1994), by the information that a binary regression has of a flight (Chaloner and Verdinelli, "Bayesian Experimental
Design", Statistical Science 10(3), 1995, section 4).  What is drawn for a flight is known before it is flown, so the
draw is chosen too; every third is the next one that has not been flown, whatever it is, lest a way of failing that has
not been seen be avoided.  Only the likelihood of what was flown enters the fit: the choice does not bias it.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.failure_modes import boundary_speed, fail_shares, regressors
from planfly.campaigns.statistics.wind_boundary import Direction, FailureFit

Floats = NDArray[np.float64]

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
_NEAR = 0.3


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
    return _rounded(0.5 * (top + most), most) if top < most - _NEAR else most


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
        for k, told in enumerate(self._informations(terms)):
            known, slope = terms @ self._covariances[k], self._fit.slopes[k]
            out += (known @ slope) ** 2 * told / (1.0 + told * (known * terms).sum(axis=1))
        return self._fit.weight * out

    def expect(self, row: Floats) -> None:
        """Count a flight (2 + d,) as flown, whatever comes of it."""
        for k, told in enumerate(self._informations(row[None])):
            known = self._covariances[k] @ row
            self._covariances[k] = self._covariances[k] - told * np.outer(known, known) / (1.0 + told * (row @ known))

    def _informations(self, terms: Floats) -> Iterator[Floats]:
        """(n,) of each mode: a flight tells of one if it does not fail by those before."""
        reaches: Floats = np.ones(len(terms))
        for mode in self._fit.modes:
            x = terms @ mode.mean
            yield reaches * mode.link.information(x, mode.by_room)
            reaches = reaches * mode.link.survival(x)


def _rounded(speed: float, most: float) -> float:
    return min(most, max(0.0, round(speed / GRID) * GRID))
