"""Make independent streams of random numbers from one seed."""

import numpy as np

# Stream of the planner.
PLANNER = 0
# Stream of the turbulence.
TURBULENCE = 1
# Stream of the navigation errors.
NAVIGATION = 2
# Number of streams.
_STREAM_COUNT = 3


def stream(seed: int, number: int) -> np.random.Generator:
    """Make the random generator of one of a seed's independent streams; each call starts the stream again.

    number: `PLANNER`, `TURBULENCE` or `NAVIGATION`.

    >>> stream(1, PLANNER).integers(100, size=3).tolist()
    [1, 69, 82]
    >>> stream(1, TURBULENCE).integers(100, size=3).tolist()
    [94, 47, 14]
    """
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(_STREAM_COUNT)[number])
