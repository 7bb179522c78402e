"""A narrow, turned valley: a function of several variables on which optimisers are tried."""

import numpy as np

from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.preference import Level, ranks
from planner.optimisers.umda import Umda

BY_VALUE = (Level((0,), (-np.inf,)),)
Optimiser = type[Umda] | type[DifferentialEvolution]


def rank(scores: np.ndarray) -> np.ndarray:
    """Ranks (n,) by the only score."""
    return ranks(scores, BY_VALUE)


def least_after(search: Umda | DifferentialEvolution, target: np.ndarray, generations: int) -> float:
    """Least value of the valley after some generations; every sample is in the box."""
    for _ in range(generations):
        asked = search.ask()
        assert (asked >= search.lower).all()
        assert (asked <= search.upper).all()
        off = asked - target
        steps = np.diff(off, axis=1)
        search.tell(((off**2).sum(axis=1) + 50.0 * (steps**2).sum(axis=1))[:, None])
    assert len(search.scores)
    return float(search.scores[:, 0].min())


def check_finds_the_bottom(kind: Optimiser) -> None:
    """Within 150 generations of 120 samples, where samples at random lie some hundred above it."""
    lower, upper = np.full(6, -3.0), np.full(6, 5.0)
    search = kind(lower, upper, rank, 120, np.random.default_rng(4))
    assert least_after(search, np.linspace(-1.0, 2.0, 6), 150) < 0.05


def check_same_seed_same_samples(kind: Optimiser) -> None:
    """The samples after five generations, bit by bit."""
    ends = []
    for _ in range(2):
        search = kind(np.zeros(6), np.ones(6), rank, 20, np.random.default_rng(5))
        least_after(search, np.full(6, 0.3), 5)
        ends.append(search.samples)
    np.testing.assert_array_equal(*ends)
