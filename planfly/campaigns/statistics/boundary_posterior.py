"""Where the boundary lies: below a wind with the probability that more than 1 - P of flights fail in that wind.

The share that fails in a wind is the mean of the failure modes over what may be drawn.  Its posterior is taken as
normal on the link's scale, with the variance that the coefficients give it (the delta method): of a single mode that no
draw has a part in exactly Fieller's solution ("Some problems in interval estimation", Journal of the Royal Statistical
Society B 16, 1954), which holds, too, where more wind changes little.  In more wind no fewer flights fail: what is
known near the boundary holds farther from it, too, where a line through few flights would know less.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.statistics.failure_mode import FailureMode
from planfly.campaigns.statistics.failure_modes import failing_share

Floats = NDArray[np.float64]

# Winds in which the probability is had, m/s apart, and how exactly a wind is found between two of them.
_STEP, _PRECISION = 0.25, 1e-3
# Of a share that fails, what is told from none; and of a standard deviation on a link's scale.
_LEAST, _LEAST_DEVIATION = 1e-12, 1e-9


@dataclass(frozen=True)
class WeighedModes:
    """The modes by one link, and its weight among all."""

    modes: tuple[FailureMode, ...]
    weight: float


def boundary_quantiles(
    fits: Sequence[WeighedModes], draws: Floats, share: float, most: float, parts: Sequence[float]
) -> list[float]:
    """The wind, from 0 to most, m/s, that the boundary lies below with each of these probabilities.

    draws: (m, d) of what may be drawn.  share: of flights that fail at the boundary.

    >>> from planfly.campaigns.statistics.links import PROBIT
    >>> mode = FailureMode(PROBIT, np.array([0.0, 0.5]), np.diag([0.04, 0.0]), 0.0)
    >>> [round(one, 2) for one in boundary_quantiles([WeighedModes((mode,), 1.0)], np.zeros((1, 0)), 0.5, 20.0, (0.5,))]
    [10.0]
    """

    def below(speed: float) -> float:
        return sum(fit.weight * _probability_of_more(fit.modes, draws, speed, share) for fit in fits)

    winds = np.linspace(0.0, most, max(2, round(most / _STEP) + 1))
    probabilities = np.array([below(float(wind)) for wind in winds])
    likely = int(np.argmax(np.append(probabilities, 1.0) >= 0.5))
    # From the middle outwards, the least and the greatest so far.
    probabilities[:likely] = np.minimum.accumulate(probabilities[:likely][::-1])[::-1]
    probabilities[likely:] = np.maximum.accumulate(probabilities[likely:])
    return [_crossing(below, winds, probabilities, part) for part in parts]


def _crossing(below: Callable[[float], float], winds: Floats, probabilities: Floats, part: float) -> float:
    """Where the probability reaches a part, found by halves between two winds."""
    after = int(np.searchsorted(probabilities, part))
    if after in (0, winds.size):
        return float(winds[min(after, winds.size - 1)])
    low, high = float(winds[after - 1]), float(winds[after])
    while high - low > _PRECISION:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) < part else (low, middle)
    return 0.5 * (low + high)


def _probability_of_more(modes: Sequence[FailureMode], draws: Floats, speed: float, share: float) -> float:
    """That more than a share of flights fail in a wind, m/s."""
    from scipy.special import ndtr

    link, failing = modes[0].link, failing_share(modes, draws, speed)
    variance = sum(float(one @ mode.covariance @ one) for one, mode in zip(failing.slopes, modes, strict=True))
    at, limit = link.predictor(min(max(failing.share, _LEAST), 1.0 - _LEAST)), link.predictor(share)
    deviation = np.sqrt(variance) / max(float(link.density(np.array([at]))[0]), 1e-300)
    return float(ndtr((at - limit) / max(deviation, _LEAST_DEVIATION)))
