"""Draw samples of all parameters of an aircraft from an estimate, with their correlations."""

import numpy as np

from aircraft.identification.estimate import Estimate
from aircraft.identification.parameters import PARAMETERS
from aircraft.power_prior import EFFICIENCY_LOG_SD
from world.arrays import Floats

# Number of draws.
COUNT = 512
# Seed of the draws.
SEED = 1
# Property of the factor on the battery's power in the model of an identified aircraft; 1 is the estimate.
DRIVE_POWER = "ident/drive-power"
# Number of samples that are drawn for each sample that is returned, because samples beyond the bounds are discarded.
_DRAWS_PER_AIRCRAFT = 20


def draw_aircraft(estimate: Estimate, count: int = COUNT, seed: int = SEED) -> Floats:
    """Sample all parameters jointly, within the bounds of the parameters, (count, n).

    If too few samples are within the bounds, they are completed by samples that are clipped to the bounds. The n
    columns are `aircraft.identification.parameters.PARAMETERS`.
    """
    generator = np.random.default_rng(seed)
    lower, upper = np.array([parameter.bounds for parameter in PARAMETERS]).T
    samples = generator.multivariate_normal(
        estimate.values, estimate.covariance, _DRAWS_PER_AIRCRAFT * count, method="eigh"
    )
    within_bounds = samples[((samples >= lower) & (samples <= upper)).all(axis=1)]
    returned_samples = np.concatenate([within_bounds, np.clip(samples, lower, upper)])[:count]
    return np.asarray(returned_samples)


def sample_power_factors(estimate: Estimate, count: int = COUNT, seed: int = SEED) -> Floats:
    """Sample factors on the drive's battery power, (count,); all are 1 if the battery current was logged.

    If it was not logged, no signal shows the propulsive efficiency, which varies by `EFFICIENCY_LOG_SD` among real
    aircraft.
    """
    if estimate.with_current:
        return np.ones(count)
    # `draw_aircraft` uses the generator of the seed itself.
    normals = np.random.default_rng([seed, 1]).standard_normal(count)
    return np.asarray(np.exp(EFFICIENCY_LOG_SD * normals))
