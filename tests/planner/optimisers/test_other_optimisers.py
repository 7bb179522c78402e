"""The other optimisers on functions that are no paths, and what each one's model can hold."""

import numpy as np
import pytest

from planner.optimisers.differential_evolution import Differential
from planner.optimisers.emna import Emna, _factor
from planner.optimisers.markov_chain import Chain
from planner.optimisers.markov_chain import _draw as draw_chain
from planner.optimisers.markov_chain import _fit as fit_chain
from planner.optimisers.preference import Level, ranks
from planner.optimisers.umda import Umda

BY_VALUE = (Level((0,), (-np.inf,)),)


def run(search: Umda | Differential, target: np.ndarray, generations: int) -> float:
    """Least value of a narrow, turned valley after some generations."""
    for _ in range(generations):
        asked = search.ask()
        assert (asked >= search.lower).all()
        assert (asked <= search.upper).all()
        off = asked - target
        steps = np.diff(off, axis=1)
        search.tell(((off**2).sum(axis=1) + 50.0 * (steps**2).sum(axis=1))[:, None])
    assert search.scores is not None
    return float(search.scores[:, 0].min())


@pytest.mark.parametrize("kind", [Emna, Chain, Differential])
def test_finds_the_bottom_of_a_turned_valley(kind: type[Umda] | type[Differential]) -> None:
    lower, upper = np.full(6, -3.0), np.full(6, 5.0)
    target = np.linspace(-1.0, 2.0, 6)
    search = kind(lower, upper, lambda scores: ranks(scores, BY_VALUE), 120, np.random.default_rng(4))
    # Samples at random lie some hundred above it.
    assert run(search, target, 150) < 0.05


@pytest.mark.parametrize("kind", [Emna, Chain, Differential])
def test_same_seed_same_samples(kind: type[Umda] | type[Differential]) -> None:
    ends = []
    for _ in range(2):
        rank = np.random.default_rng(5)
        search = kind(np.zeros(6), np.ones(6), lambda scores: ranks(scores, BY_VALUE), 20, rank)
        run(search, np.full(6, 0.3), 5)
        ends.append(search.samples)
    np.testing.assert_array_equal(*ends)


def test_first_asks_for_all_then_for_half() -> None:
    search = Differential(np.zeros(3), np.ones(3), lambda s: ranks(s, BY_VALUE), 10, np.random.default_rng(0))
    assert search.ask().shape == (10, 3)
    search.tell(search.ask().sum(axis=1)[:, None])
    assert search.ask().shape == (5, 3)


def test_differential_never_loses_its_best() -> None:
    search = Differential(np.zeros(4), np.ones(4), lambda s: ranks(s, BY_VALUE), 20, np.random.default_rng(1))
    best = np.inf
    for _ in range(20):
        search.tell((search.ask() ** 2).sum(axis=1)[:, None])
        assert search.scores is not None
        assert search.scores[:, 0].min() <= best
        best = float(search.scores[:, 0].min())


def test_emna_factor_is_that_of_the_covariance() -> None:
    rows = np.random.default_rng(2).normal(size=(400, 5)) @ np.random.default_rng(3).normal(size=(5, 5))
    rows -= rows.mean(axis=0)
    factor = _factor(rows, 0.0)
    np.testing.assert_allclose(factor @ factor.T, np.cov(rows.T, bias=True), rtol=1e-9)


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
