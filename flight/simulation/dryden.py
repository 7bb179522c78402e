"""Dryden turbulence on height above ground (MIL-F-8785C, low-altitude model).

JSBSim's own counts height from sea level, and leaves a pure east wind unrotated.  Above 300 m (1,000 ft) the
low-altitude scales are held: there they are isotropic.  Rotational gusts are left out: an 11 kg aircraft is
small against the scales.
"""

import math

import numpy as np
from numpy.typing import NDArray

from world.kernels import compiled

Floats = NDArray[np.float64]

_FOOT = 0.3048
# State of the five first-order filters: u, then two each for v and w.
GUST_STATES = 5


@compiled
def dryden_scales(height: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Length scales L_u = L_v and L_w (m), and sigma_u / sigma_w, at a height above ground (m).

    MIL-F-8785C 3.7.3.4 with heights in feet: L_w = h, L_u = h / (0.177 + 0.000823 h)^1.2,
    sigma_u / sigma_w = 1 / (0.177 + 0.000823 h)^0.4, 10 ft <= h <= 1,000 ft.
    """
    h = min(1000.0, max(10.0, height / _FOOT))
    base = 0.177 + 0.000823 * h
    # One power for both: base^1.2 = base root, base^-0.4 = root^-2.
    root = base**0.2
    return h / (base * root) * _FOOT, h * _FOOT, 1.0 / (root * root)


@compiled
def start_gusts(noise: Floats, gusts: Floats) -> None:  # pragma: no cover - compiled
    """Draw the filters' stationary state from (5,) unit normals into (5,) ``gusts``."""
    gusts[0] = noise[0]
    for axis in range(2):
        y1 = noise[1 + 2 * axis]
        gusts[1 + 2 * axis] = y1
        # Stationary: var y1 = 1, var y2 = cov(y1, y2) = 1/2.
        gusts[2 + 2 * axis] = 0.5 * y1 + 0.5 * noise[2 + 2 * axis]


@compiled
def step_gusts(
    gusts: Floats, noise: Floats, w20: float, height: float, airspeed: float, dt: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Advance by dt and return the gust along the mean wind, across it to the right, and down, m/s.

    noise: (3,) unit normals.  w20: wind at 20 ft, m/s; sigma_w = 0.1 w20.  Longitudinal: sigma / (1 + T s);
    transverse: sigma (1 + sqrt(3) T s) / (1 + T s)^2, as the sum of the outputs of two equal lags in a row.
    """
    length_u, length_w, ratio = dryden_scales(height)
    sigma_w = 0.1 * w20
    sigma_u = sigma_w * ratio
    speed = max(airspeed, 5.0)
    decay = math.exp(-dt * speed / length_u)
    gusts[0] = decay * gusts[0] + math.sqrt(1.0 - decay * decay) * noise[0]
    out_v = _transverse(gusts, 1, noise[1], decay)
    out_w = _transverse(gusts, 3, noise[2], math.exp(-dt * speed / length_w))
    return sigma_u * gusts[0], sigma_u * out_v, sigma_w * out_w


@compiled
def _transverse(gusts: Floats, k: int, noise: float, decay: float) -> float:  # pragma: no cover - compiled
    before = gusts[k]
    gusts[k] = decay * before + math.sqrt(1.0 - decay * decay) * noise
    gusts[k + 1] = decay * gusts[k + 1] + (1.0 - decay) * 0.5 * (before + gusts[k])
    root = math.sqrt(3.0)
    # var(sqrt(3) y1 + (1 - sqrt(3)) y2) = 2.
    gust: float = (root * gusts[k] + (1.0 - root) * gusts[k + 1]) / math.sqrt(2.0)
    return gust
