"""Whole aircraft drawn from an estimate: parameters together, correlated as they are."""

import numpy as np
from numpy.typing import NDArray

from aircraft.identification.estimate import Estimate
from aircraft.identification.parameters import PARAMETERS

Floats = NDArray[np.float64]

COUNT, SEED = 512, 1
# Draws tried for one that is within the bounds.
_TRIES = 20


def draw_aircraft(estimate: Estimate, count: int = COUNT, seed: int = SEED) -> Floats:
    """(count, n) joint draws of `aircraft.identification.parameters.PARAMETERS`, within their bounds."""
    generator = np.random.default_rng(seed)
    low, high = np.array([parameter.bounds for parameter in PARAMETERS]).T
    many = generator.multivariate_normal(estimate.values, estimate.covariance, _TRIES * count, method="eigh")
    inside = many[((many >= low) & (many <= high)).all(axis=1)]
    # Of an estimate close to its bounds too few are within: the rest is held at them.
    made = np.concatenate([inside, np.clip(many, low, high)])[:count]
    return np.asarray(made)
