"""Compute Dryden turbulence by height above ground (MIL-F-8785C, low-altitude model).

JSBSim's own model uses the height above sea level, and leaves a pure east wind unrotated. Above 300 m (1,000 ft) the
low-altitude scales are used, which are isotropic there. Rotational gusts are omitted, because an 11 kg aircraft is
small relative to the scales.
"""

import math

from flight.dynamics.jsbsim_properties import FOOT
from world.arrays import Floats
from world.kernels import Record, inner, record_dtype

# State of the five first-order filters of unit variance: one along the wind, two in series across and down.
GUST_FILTERS = record_dtype("along", "across_first", "across_second", "down_first", "down_second")


@inner
def dryden_scales(height: float) -> tuple[float, float, float]:
    """Return Dryden's length scales L_u = L_v and L_w, m, and the ratio sigma_u / sigma_w of gusts.

    height: height above ground, m.

    MIL-F-8785C 3.7.3.4 with heights in feet: L_w = h, L_u = h / (0.177 + 0.000823 h)^1.2, sigma_u / sigma_w = 1 /
    (0.177 + 0.000823 h)^0.4, 10 ft <= h <= 1,000 ft.
    """
    h = min(1000.0, max(10.0, height / FOOT))
    base = 0.177 + 0.000823 * h
    # Compute one power for both: base^1.2 = base * root, base^-0.4 = root^-2.
    root = base**0.2
    return h / (base * root) * FOOT, h * FOOT, 1.0 / (root * root)


def start_gusts(noise: Floats, filters: Record) -> None:
    """Draw the initial state of the gust filters, with the same statistics as later in the flight.

    noise: random numbers from the standard normal distribution, (5,).
    filters: a record of `GUST_FILTERS`, which is set.
    """
    filters.along, filters.across_first, across_noise, filters.down_first, down_noise = noise.tolist()
    # In the stationary state the second of two filters has variance 1/2, and covariance 1/2 with the first.
    filters.across_second = 0.5 * filters.across_first + 0.5 * across_noise
    filters.down_second = 0.5 * filters.down_first + 0.5 * down_noise


@inner
def step_gusts(
    filters: Record, noise: Floats, w20: float, height: float, airspeed: float, dt: float
) -> tuple[float, float, float]:
    """Advance the gust filters by a tick.

    Return the gust, m/s: along the mean wind, to its right, and down.

    filters: a record of `GUST_FILTERS`.
    noise: random numbers from the standard normal distribution, (3,).
    w20: wind at 20 ft, m/s; sigma_w = 0.1 w20.
    height: height above ground, m.
    airspeed: m/s.
    dt: duration of the tick, s.

    Longitudinal: sigma / (1 + T s); transverse: sigma (1 + sqrt(3) T s) / (1 + T s)^2, as the sum of the outputs of two
    equal lags in series.
    """
    length_u, length_w, ratio = dryden_scales(height)
    sigma_w = 0.1 * w20
    sigma_u = sigma_w * ratio
    speed = max(airspeed, 5.0)
    decay = math.exp(-dt * speed / length_u)
    filters.along = decay * filters.along + math.sqrt(1.0 - decay * decay) * noise[0]
    filters.across_first, filters.across_second, across = _step_transverse(
        filters.across_first, filters.across_second, noise[1], decay
    )
    filters.down_first, filters.down_second, down = _step_transverse(
        filters.down_first, filters.down_second, noise[2], math.exp(-dt * speed / length_w)
    )
    return sigma_u * filters.along, sigma_u * across, sigma_w * down


@inner
def _step_transverse(first: float, second: float, noise: float, decay: float) -> tuple[float, float, float]:
    """Advance the two first-order lags of a transverse gust by a tick; return both lags and the gust.

    first, second: states of the lags.
    noise: random number from the standard normal distribution.
    decay: factor by which a lag decays in a tick.

    The gust has unit variance.
    """
    previous = first
    first = decay * previous + math.sqrt(1.0 - decay * decay) * noise
    second = decay * second + (1.0 - decay) * 0.5 * (previous + first)
    root = math.sqrt(3.0)
    # var(sqrt(3) first + (1 - sqrt(3)) second) = 2.
    return first, second, (root * first + (1.0 - root) * second) / math.sqrt(2.0)
