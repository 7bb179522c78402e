"""Differential evolution never loses its best, and finds the bottom of a turned valley."""

import numpy as np

from planner.optimisers.differential_evolution import DifferentialEvolution
from tests.planner.optimisers.valley import check_finds_the_bottom, check_same_seed_same_samples, rank


def test_finds_the_bottom_of_a_turned_valley() -> None:
    check_finds_the_bottom(DifferentialEvolution)


def test_same_seed_same_samples() -> None:
    check_same_seed_same_samples(DifferentialEvolution)


def test_first_asks_for_all_then_for_half() -> None:
    search = DifferentialEvolution(np.zeros(3), np.ones(3), rank, 10, np.random.default_rng(0))
    assert search.ask().shape == (10, 3)
    search.tell(search.ask().sum(axis=1)[:, None])
    assert search.ask().shape == (5, 3)


def test_never_loses_its_best() -> None:
    search = DifferentialEvolution(np.zeros(4), np.ones(4), rank, 20, np.random.default_rng(1))
    best = np.inf
    for _ in range(20):
        search.tell((search.ask() ** 2).sum(axis=1)[:, None])
        assert search.scores[:, 0].min() <= best
        best = float(search.scores[:, 0].min())
