"""One seed, several independent streams of random numbers."""

import numpy as np

PLANNER, TURBULENCE = 0, 1
_STREAMS = 2


def stream(seed: int, number: int) -> np.random.Generator:
    """Generator of one of a run's streams: `PLANNER` or `TURBULENCE`, spawned from the run's seed."""
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(_STREAMS)[number])
