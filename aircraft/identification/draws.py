"""Draw whole aircraft from an estimate, with the correlations of their parameters."""

import numpy as np

from aircraft.identification.estimate import Estimate
from aircraft.identification.parameters import PARAMETERS
from world.arrays import Floats

# Number of draws.
COUNT = 512
# Seed of the draws.
SEED = 1
# Draws per aircraft that is kept, of which those within the bounds are used.
_DRAWS_PER_AIRCRAFT = 20


def draw_aircraft(estimate: Estimate, count: int = COUNT, seed: int = SEED) -> Floats:
    """Draw `aircraft.identification.parameters.PARAMETERS` jointly within their bounds, (count, n)."""
    generator = np.random.default_rng(seed)
    lower, upper = np.array([parameter.bounds for parameter in PARAMETERS]).T
    samples = generator.multivariate_normal(
        estimate.values, estimate.covariance, _DRAWS_PER_AIRCRAFT * count, method="eigh"
    )
    within_bounds = samples[((samples >= lower) & (samples <= upper)).all(axis=1)]
    # For an estimate close to its bounds too few draws are within; clipped draws follow them.
    chosen = np.concatenate([within_bounds, np.clip(samples, lower, upper)])[:count]
    return np.asarray(chosen)
