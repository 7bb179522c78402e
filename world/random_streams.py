"""One seed, several independent streams of random numbers."""

import numpy as np

PLANNER, TURBULENCE, NAVIGATION = 0, 1, 2
_STREAMS = 3


def stream(seed: int, number: int) -> np.random.Generator:
    """Generator of one of a run's streams: `PLANNER`, `TURBULENCE` or `NAVIGATION`, spawned from the run's seed."""
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(_STREAMS)[number])
