"""The ways in which flights fail, one after another: a binary regression each on the wind and on what was drawn.

A flight that fails does so in some way, such as by the slope of leg 12.  What was drawn for it (drag, mass, ...) is
known, and often decides: a slippery aircraft is too fast down one leg, a draggy one strays on another.  The probability
of each way is a link's function of a + b * wind + c . draws.  The ways are put in order, and each is fitted to the
flights that did not fail in one before it, so that the probability to fly is the product of their complements whether
or not ways come together: the chain rule.
"""

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.failure_mode import FailureMode, fit_mode
from planfly.campaigns.statistics.links import BinaryLink

Floats = NDArray[np.float64]

# Winds are counted from here, m/s, where the constant's prior is meant.
ORIGIN = 10.0


def regressors(speeds: Floats | float, draws: Floats) -> Floats:
    """(n, 2 + d): one, the wind, and what was drawn.

    speeds: (n,) or one for all, m/s.  draws: (n, d) in standard deviations from their means.
    """
    out = np.empty((len(draws), 2 + draws.shape[1]))
    out[:, 0] = 1.0
    out[:, 1] = np.asarray(speeds) - ORIGIN
    out[:, 2:] = draws
    return out


def fit_modes(
    terms: Floats,
    failed: Sequence[frozenset[Hashable]],
    link: BinaryLink,
    room: Sequence[Mapping[Hashable, float] | None] = (),
) -> tuple[FailureMode, ...]:
    """The ways of failing of n flights, in order: the one in which most failed, then in which most of the others did.

    terms: (n, 2 + d), of `regressors`.
    failed: the ways in which each failed; none where it was flyable.
    room: the ways that each passed narrowly, and by what share of a scale, 0 to 1, or 0 where it passed all the same;
    others were passed by a scale or more.  None of a flight of which that is not known.

    >>> from planfly.campaigns.statistics.links import PROBIT
    >>> speeds = np.linspace(0.0, 20.0, 200)
    >>> ways = [frozenset({"slope"}) if speed > 12.0 else frozenset() for speed in speeds]
    >>> (mode,) = fit_modes(regressors(speeds, np.empty((200, 0))), ways, PROBIT)
    >>> round(float(10.0 - mode.mean[0] / mode.mean[1]), 1)
    12.0
    """
    found: list[FailureMode] = []
    rooms = room or [None] * len(failed)
    left = np.ones(len(failed), dtype=bool)
    while counts := Counter(way for here, ways in zip(left, failed, strict=True) if here for way in ways):
        # By name where as many failed, as the order of a set is not the same in every process.
        common = min(counts, key=lambda way: (-counts[way], repr(way)))
        so = np.array([common in ways for ways in failed])
        passed_by = np.array([0.0 if some is None else some.get(common, 1.0) for some in rooms])
        found.append(fit_mode(terms[left], so[left], passed_by[left], link))
        left &= ~so
    return tuple(found)


def fail_shares(modes: Sequence[FailureMode], terms: Floats) -> Floats:
    """(n,) probability to fail, in any way, of flights (n, 2 + d), by the modes' means."""
    flies: Floats = np.ones(len(terms))
    for mode in modes:
        flies *= mode.link.survival(terms @ mode.mean)
    return 1.0 - flies


def boundary_speed(modes: Sequence[FailureMode], draws: Floats, share: float, most: float) -> float:
    """The wind from 0 to ``most`` in which this share of draws (m, d) is expected to fail, m/s, found by bisection."""
    still = [(mode.link, regressors(ORIGIN, draws) @ mode.mean, float(mode.mean[1])) for mode in modes]

    def fails(speed: float) -> bool:
        flies: Floats = np.ones(len(draws))
        for link, x, by_wind in still:
            flies *= link.survival(x + by_wind * (speed - ORIGIN))
        return bool(1.0 - flies.mean() >= share)

    if not fails(most):
        return most
    low, high = 0.0, most
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return 0.5 * (low + high)


@dataclass(frozen=True)
class FailingShare:
    """The share of flights that fail in a wind, and its derivatives.

    slopes: (2 + d,) by each mode's coefficients.  by_wind: 1/(m/s).
    """

    share: float
    slopes: list[Floats]
    by_wind: float


def failing_share(modes: Sequence[FailureMode], draws: Floats, speed: float) -> FailingShare:
    """The share of draws (m, d) that is expected to fail in a wind, m/s."""
    terms = regressors(speed, draws)
    predictors = [terms @ mode.mean for mode in modes]
    flies = [mode.link.survival(x) for mode, x in zip(modes, predictors, strict=True)]
    slopes, by_wind = [], 0.0
    for k, mode in enumerate(modes):
        others = np.prod(flies[:k] + flies[k + 1 :], axis=0)
        slopes.append(terms.T @ (mode.link.density(predictors[k]) * others) / len(draws))
        by_wind += float(slopes[-1][0] * mode.mean[1])
    return FailingShare(1.0 - float(np.prod(flies, axis=0).mean()), slopes, by_wind)


def boundary_slopes(modes: Sequence[FailureMode], draws: Floats, speed: float) -> list[Floats]:
    """(2 + d,) the boundary's derivatives by each mode's coefficients, m/s: the implicit function theorem.

    draws: (m, d).  speed: the boundary, m/s.
    """
    at = failing_share(modes, draws, speed)
    # Where no more fail in more wind, nothing is known of the boundary.
    return [-one / max(at.by_wind, 1e-9) for one in at.slopes]
