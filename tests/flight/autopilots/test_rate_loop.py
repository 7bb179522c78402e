"""Gains of rate controllers: which hold an attitude, by the response of the closed loop."""

import math

import numpy as np
import pytest

from flight.autopilots.rate_loop import RateGains, judge_rate_gains

NEEDED = 0.345
TIME_CONSTANT_S = 0.5


def flown_fraction(gains: RateGains, seconds: float) -> float:
    """Return the fraction of a demanded rate that an aircraft without roll inertia has after a time.

    The aircraft's rate is its control output over `NEEDED`.
    """
    step, integral, rate = 1e-3, 0.0, 0.0
    for _ in np.arange(0.0, seconds, step):
        rate = (gains.feed_forward + gains.p + gains.i * integral) / (NEEDED + gains.p)
        integral += (1.0 - rate) * step
    return rate


@pytest.mark.parametrize("feed_forward", [0.0, 0.05, 0.1, 0.15, 0.2, 0.3])
@pytest.mark.parametrize("p", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("i", [0.0, 0.1, 0.3])
def test_gains_are_too_low_where_a_quarter_does_not_follow_at_once_and_half_within_a_second(
    feed_forward: float, p: float, i: float
) -> None:
    gains = RateGains(feed_forward, p, i, 0.0)
    fraction = flown_fraction(gains, 1.0)
    is_too_low = flown_fraction(gains, 1e-3) < 0.25 or fraction < 0.5
    assert abs(fraction - 0.5) > 2e-3
    assert (judge_rate_gains(gains, (NEEDED, NEEDED), TIME_CONSTANT_S) == "too low") is is_too_low


@pytest.mark.parametrize(("feed_forward", "expected"), [(0.0, "too low"), (0.25, "")])
def test_an_integrator_alone_swings_the_attitude(feed_forward: float, expected: str) -> None:
    """The poles of t s^2 + (1 + g t / T) s + 1 / T, with the integrator's time constant t and the immediate part g."""
    gains = RateGains(feed_forward * NEEDED, 0.0, NEEDED, 0.0)
    assert judge_rate_gains(gains, (NEEDED, NEEDED), TIME_CONSTANT_S) == expected
    poles = np.roots([1.0, 1.0 + feed_forward / TIME_CONSTANT_S, 1.0 / TIME_CONSTANT_S])
    damping_ratio = float(-poles[0].real / abs(poles[0]))
    assert (damping_ratio < 0.5) is bool(expected)


def attitude_is_stable(feed_forward: float, time_constant: float) -> bool:
    """Return True if an attitude loop by feed-forward alone is stable, with three lags of 0.05 s.

    The Hurwitz criterion of s (1 + 0.05 s)^3 + F / (N T).
    """
    gain, lag = feed_forward / NEEDED / time_constant, 0.05
    poles = np.roots([lag**3, 3.0 * lag**2, 3.0 * lag, 1.0, gain])
    return bool(np.all(poles.real < 0.0))


@pytest.mark.parametrize("time_constant", [0.05, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("ratio", [0.8, 1.0, 1.5, 3.0, 10.0, 30.0])
def test_no_gains_pass_that_make_the_attitude_oscillate(time_constant: float, ratio: float) -> None:
    gains = RateGains(ratio * NEEDED, 0.0, 0.0, 0.0)
    fault = judge_rate_gains(gains, (NEEDED, NEEDED), time_constant)
    assert fault == ("too high" if ratio / time_constant > 12.0 else "")
    assert fault or attitude_is_stable(ratio * NEEDED, time_constant)


@pytest.mark.parametrize(
    ("gains", "limit"),
    [
        (RateGains(NEEDED, NEEDED, 0.0, 0.0), 5.0),
        (RateGains(NEEDED, 0.0, NEEDED, 0.0), 10.0),
        (RateGains(NEEDED, 0.0, 0.0, NEEDED), 0.25),
    ],
)
def test_each_gain_has_its_limit_by_the_feed_forward_that_is_needed(gains: RateGains, limit: float) -> None:
    for factor, expected in ((0.99 * limit, ""), (1.01 * limit, "too high")):
        scaled = RateGains(NEEDED, *(factor * value for value in gains[1:]))
        assert judge_rate_gains(scaled, (NEEDED, NEEDED), TIME_CONSTANT_S) == expected


def test_an_aircraft_that_needs_less_is_flown_by_lower_gains() -> None:
    low = RateGains(0.06, 0.01, 0.02, 0.0)
    assert judge_rate_gains(low, (NEEDED, NEEDED), TIME_CONSTANT_S) == "too low"
    assert judge_rate_gains(low, (0.06, NEEDED), TIME_CONSTANT_S) == ""
    assert math.isclose(flown_fraction(low, 0.0011), 0.07 / (NEEDED + 0.01), rel_tol=1e-3)
