"""The links of a binary regression: the probability to fail as a function of a linear predictor.

`PROBIT` is that of a threshold which is distributed normally; `CLOGLOG` (complementary log-log) that of the least of
many thresholds, Gumbel's law for minima, whose tail towards little wind is the longer one (McCullagh and Nelder,
Generalized Linear Models, 2nd edition, 1989, section 4.3).
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# exp of more than this is more than any number; and the least number that is not taken as none.
_MOST, _LEAST = 700.0, 1e-300


class BinaryLink(Protocol):
    """All of predictors in an array of any shape, and each of the same shape."""

    def log_cdf(self, x: Floats) -> Floats:
        """Logarithm of the probability to fail."""

    def log_survival(self, x: Floats) -> Floats:
        """Logarithm of the probability to fly."""

    def survival(self, x: Floats) -> Floats:
        """Probability to fly."""

    def density(self, x: Floats) -> Floats:
        """Derivative of the probability to fail."""

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        """Fisher's, of a flight about its predictor.

        width: of predictors above its own; by how much a flight passed is told where that is less, so that 0 is for
        one that tells no more than whether it failed.
        """

    def derivatives(self, x: Floats, failed: Bools) -> tuple[Floats, Floats]:
        """First and second derivative of the logarithm of the probability of what came out."""

    def log_density(self, x: Floats) -> Floats:
        """Logarithm of `density`."""

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        """First and second derivative of `log_density`."""


class _Probit:
    def log_cdf(self, x: Floats) -> Floats:
        from scipy.special import log_ndtr

        out: Floats = log_ndtr(x)
        return out

    def log_survival(self, x: Floats) -> Floats:
        return self.log_cdf(-x)

    def survival(self, x: Floats) -> Floats:
        from scipy.special import ndtr

        out: Floats = ndtr(-x)
        return out

    def density(self, x: Floats) -> Floats:
        out: Floats = np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)
        return out

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        from scipy.special import ndtr

        more = x + width
        # Of one that fails and of one that passes by more, and between them the law's mean square there.
        ends = self.density(x) ** 2 / np.maximum(ndtr(x), _LEAST) + self.density(more) ** 2 / np.maximum(
            ndtr(-more), _LEAST
        )
        between = ndtr(more) - ndtr(x) - more * self.density(more) + x * self.density(x)
        out: Floats = ends + np.maximum(between, 0.0)
        return out

    def derivatives(self, x: Floats, failed: Bools) -> tuple[Floats, Floats]:
        from scipy.special import log_ndtr

        sign = np.where(failed, 1.0, -1.0)
        z = sign * x
        # By logarithms, for Phi is 0 long before its logarithm's derivative is.
        ratio = np.exp(-0.5 * z * z - 0.5 * np.log(2.0 * np.pi) - log_ndtr(z))
        return sign * ratio, -ratio * (z + ratio)

    def log_density(self, x: Floats) -> Floats:
        out: Floats = -0.5 * x * x - 0.5 * np.log(2.0 * np.pi)
        return out

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        return -x, np.full_like(x, -1.0)


class _ComplementaryLogLog:
    def log_cdf(self, x: Floats) -> Floats:
        with np.errstate(divide="ignore"):
            # Where the rate is 0, the probability is the rate.
            out: Floats = np.where(x < -30.0, x, np.log(-np.expm1(self.log_survival(x))))
        return out

    def log_survival(self, x: Floats) -> Floats:
        out: Floats = -np.exp(np.minimum(x, _MOST))
        return out

    def survival(self, x: Floats) -> Floats:
        out: Floats = np.exp(self.log_survival(x))
        return out

    def density(self, x: Floats) -> Floats:
        out: Floats = np.exp(x - np.exp(np.minimum(x, _MOST)))
        return out

    def information(self, x: Floats, width: float = 0.0) -> Floats:
        rate, more = (np.exp(np.clip(at, -_MOST, 0.5 * _MOST)) for at in (x, x + width))
        # As the probit's: of those that fail rate * ratio * exp(-rate), of the others by integrals over the rate.
        fails = rate * _rate_ratio(rate) * np.exp(-rate)
        between = np.maximum(_square_above(rate) - _square_above(more), 0.0)
        out: Floats = fails + between + more * more * np.exp(-more)
        return out

    def derivatives(self, x: Floats, failed: Bools) -> tuple[Floats, Floats]:
        rate = np.exp(np.clip(x, -_MOST, 0.5 * _MOST))
        first = _rate_ratio(rate)
        second = first * (1.0 - rate - first)
        return np.where(failed, first, -rate), np.where(failed, np.minimum(second, 0.0), -rate)

    def log_density(self, x: Floats) -> Floats:
        out: Floats = x - np.exp(np.minimum(x, _MOST))
        return out

    def density_derivatives(self, x: Floats) -> tuple[Floats, Floats]:
        rate = np.exp(np.minimum(x, 0.5 * _MOST))
        return 1.0 - rate, -rate


def _square_above(rate: Floats) -> Floats:
    """Integral of (1 - r)^2 exp(-r) from a rate on."""
    out: Floats = (rate * rate + 1.0) * np.exp(-rate)
    return out


def _rate_ratio(rate: Floats) -> Floats:
    """Rate / (exp(rate) - 1): near 1 for a small rate, 0 for a large one."""
    with np.errstate(over="ignore"):
        out: Floats = rate / np.expm1(rate)
    return out


PROBIT: BinaryLink = _Probit()
CLOGLOG: BinaryLink = _ComplementaryLogLog()
LINKS = (PROBIT, CLOGLOG)
