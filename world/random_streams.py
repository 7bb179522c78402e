"""One seed, several independent streams of random numbers."""

import numpy as np

PLANNER, TURBULENCE, NAVIGATION = 0, 1, 2
_STREAMS = 3


def stream(seed: int, number: int) -> np.random.Generator:
    """Random numbers of one stream, `PLANNER`, `TURBULENCE` or `NAVIGATION`, all spawned from one seed.

    >>> stream(1, PLANNER).integers(100, size=3).tolist()
    [1, 69, 82]
    >>> stream(1, TURBULENCE).integers(100, size=3).tolist()
    [94, 47, 14]
    """
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(_STREAMS)[number])
