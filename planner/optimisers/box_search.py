"""A search within a box by ask and tell: what every optimiser here begins with.

It knows a box, samples and a ranking, and nothing of what they stand for.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class BoxSearch(ABC):
    """A population in a box: `ask` gives rows that want scores, `tell` takes the scores and makes the next rows.

    lower, upper: (d,) box.
    rank: (n, c) scores -> (n,) ranks, smaller is better.
    population: even number of rows.
    initial: (population, d) first samples; None for uniform.

    The whole population is asked for first, then half of it at a time.
    """

    def __init__(
        self,
        lower: Floats,
        upper: Floats,
        rank: Callable[[Floats], Ints],
        population: int,
        rng: np.random.Generator,
        *,
        initial: Floats | None = None,
    ) -> None:
        self.lower, self.upper = lower, upper
        self._rank = rank
        self._rng = rng
        self._half = population // 2
        if initial is None:
            initial = rng.uniform(lower, upper, (population, lower.size))
        self._asked = np.clip(initial, lower, upper)
        self.samples: Floats = np.empty((0, lower.size))
        self.scores: Floats = np.empty((0, 0))

    def ask(self) -> Floats:
        """Rows (n, d) inside the box that want scores."""
        return self._asked

    @abstractmethod
    def tell(self, scores: Floats) -> None:
        """Take the scores (n, c) of what was asked, and make the next rows."""
