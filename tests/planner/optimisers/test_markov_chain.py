"""A Markov chain keeps the covariance of neighbours, and finds the bottom of a turned valley."""

import numpy as np

from planner.optimisers.markov_chain import MarkovChain, draw_chain, fit_chain
from tests.planner.optimisers.valley import check_finds_the_bottom, check_same_seed_same_samples


def test_finds_the_bottom_of_a_turned_valley() -> None:
    check_finds_the_bottom(MarkovChain)


def test_same_seed_same_samples() -> None:
    check_same_seed_same_samples(MarkovChain)


def test_chain_keeps_the_covariance_of_neighbours_but_not_of_others() -> None:
    """A first-order chain reproduces each group's and each neighbouring pair's covariance of its own data."""
    rng = np.random.default_rng(6)
    rows = np.cumsum(rng.normal(size=(3000, 4, 3)), axis=1).reshape(3000, 12)
    rows -= rows.mean(axis=0)
    slope, spread = fit_chain(rows, 3, 0.0)
    drawn = draw_chain(rng.normal(size=(200_000, 12)), slope, spread)
    wanted, got = np.cov(rows.T, bias=True), np.cov(drawn.T, bias=True)
    for g in range(3):
        block = slice(3 * g, 3 * g + 6)
        np.testing.assert_allclose(got[block, block], wanted[block, block], atol=0.05)
