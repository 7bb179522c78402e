"""Judge the gains of an autopilot's rate controllers, which no simulated flight uses.

The simulated autopilots follow an attitude with the lag of a tuned aircraft. An attitude error e demands the rate
e / T, with T the attitude's time constant. The controller's output is F r + P (r - p) + I times the integral of r - p,
for a demanded rate r and a rate p, and an output u gives the rate u / N in the end. N is therefore the feed-forward of
a tuned aircraft. The fraction (F + P) / (N + P) of a demanded rate is reached at once; the rest is reached with the
time constant (N + P) / I.
"""

import math
from typing import NamedTuple

# Smallest fraction of a demanded rate that a usable controller reaches within `_RESPONSE_TIME_S`.
_MIN_RESPONSE = 0.5
# Smallest fraction that follows at once: with less, the integrator swings the attitude, damped by less than half of the
# critical damping.
_MIN_IMMEDIATE_RESPONSE = 0.25
# About twice the lag of an attitude of a tuned aircraft, s.
_RESPONSE_TIME_S = 1.0
# Highest bandwidth of the attitude loop, rad/s: servo, roll mode and filter, with lags of 0.05 to 0.15 s, oscillate at
# 13 to 18 rad/s. The fastest setting of ArduPlane's automatic tuning has 10 rad/s.
_MAX_BANDWIDTH_RADPS = 12.0
# Highest ratio of P to the feed-forward: a rate loop of two lags of 0.05 s and 0.02 s of delay oscillates at 5.7.
_MAX_P_RATIO = 5.0
# Highest ratio of I to the feed-forward, 1/s: a quarter of what the same lags allow.
_MAX_I_RATIO_PER_S = 10.0
# Highest ratio of D to the feed-forward, s: a gain of 5 on a lag of 0.05 s.
_MAX_D_RATIO_S = 0.25


class RateGains(NamedTuple):
    """Gains of a rate controller.

    Feed-forward and P are in output per rate, I in output per angle, D in output per angular acceleration.
    """

    feed_forward: float
    p: float
    i: float
    d: float


def judge_rate_gains(gains: RateGains, feed_forward_range: tuple[float, float], time_constant: float) -> str:
    """Judge if the gains of a rate controller can control the attitude.

    The answer is "too low", "too high", or "" for usable gains.

    feed_forward_range: lowest and highest feed-forward gain that suits the aircraft; both are positive.
    time_constant: time constant of the attitude, s.

    >>> judge_rate_gains(RateGains(0.345, 0.08, 0.15, 0.0), (0.345, 0.345), 0.5)
    ''
    >>> judge_rate_gains(RateGains(1e-4, 1e-4, 1e-4, 0.0), (0.345, 0.345), 0.5)
    'too low'
    >>> judge_rate_gains(RateGains(6.0, 0.08, 0.15, 0.0), (0.345, 0.345), 0.5)
    'too high'
    """
    min_feed_forward, max_feed_forward = feed_forward_range
    immediate_response = (gains.feed_forward + gains.p) / (min_feed_forward + gains.p)
    decay = math.exp(-_RESPONSE_TIME_S * gains.i / (min_feed_forward + gains.p))
    if immediate_response < _MIN_IMMEDIATE_RESPONSE or (1.0 - immediate_response) * decay > 1.0 - _MIN_RESPONSE:
        return "too low"
    bandwidth = (gains.feed_forward + gains.p) / (max_feed_forward + gains.p) / time_constant
    is_unstable = (
        bandwidth > _MAX_BANDWIDTH_RADPS
        or gains.p > _MAX_P_RATIO * max_feed_forward
        or gains.i > _MAX_I_RATIO_PER_S * max_feed_forward
        or gains.d > _MAX_D_RATIO_S * max_feed_forward
    )
    return "too high" if is_unstable else ""
