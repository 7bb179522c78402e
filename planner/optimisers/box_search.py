"""Define the ask-and-tell interface of all optimisers: a population-based search in a box."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from world.arrays import Floats, Ints


class BoxSearch(ABC):
    """Population-based search in a box: `ask` returns samples to score, `tell` takes their scores.

    The first `ask` returns the whole population, later calls return half of it.

    lower, upper: (d,) lowest and highest value of each variable.
    rank: function of scores (n, c) that returns their ranks (n,); smaller is better.
    population: even number of samples.
    initial: (population, d) first samples; None for uniform ones.
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
        """Clip the first samples to the box, or draw them uniformly.

        lower, upper: (d,) box.
        rank: function of scores (n, c) that returns their ranks (n,); smaller is better.
        population: even number of samples.
        rng: generator of random numbers.
        initial: (population, d) first samples; None for uniform ones.
        """
        self.lower, self.upper = lower, upper
        self._rank = rank
        self._rng = rng
        self._half = population // 2
        if initial is None:
            initial = rng.uniform(lower, upper, (population, lower.size))
        self._pending_samples = np.clip(initial, lower, upper)
        self.samples: Floats = np.empty((0, lower.size))
        self.scores: Floats = np.empty((0, 0))

    def ask(self) -> Floats:
        """Return the samples to score, (n, d); they are inside the box."""
        return self._pending_samples

    @abstractmethod
    def tell(self, scores: Floats) -> None:
        """Process the scores (n, c) of the samples that `ask` returned last, and make the next samples."""
