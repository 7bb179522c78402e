"""Every optimiser: samples in its box, the bottom of a turned valley, the same samples from the same seed."""

import numpy as np
import pytest

from planner.optimisers.box_search import BoxSearch
from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.emna import Emna
from planner.optimisers.markov_chain import MarkovChain, draw_chain, fit_chain
from planner.optimisers.multistart import Multistart, reflect_into_box
from planner.optimisers.partial_resampling import MAX_STALLED_GENERATIONS, PartialResampling
from planner.optimisers.preference import Level, ranks
from planner.optimisers.umda import Umda

BY_VALUE = (Level((0,), (-np.inf,)),)
LOWER, UPPER = np.array([-1.0, 10.0]), np.array([1.0, 40.0])
Optimiser = type[Umda] | type[DifferentialEvolution] | type[Multistart] | type[PartialResampling]
# UMDA knows no two variables together, and partial resampling moves few at once: a turned valley is not for them.
OPTIMISERS = (DifferentialEvolution, Emna, MarkovChain)


def rank(scores: np.ndarray) -> np.ndarray:
    """Ranks (n,) by the only score."""
    return ranks(scores, BY_VALUE)


def least_after(search: BoxSearch, target: np.ndarray, generations: int) -> float:
    """Least value of a narrow, turned valley after some generations; every sample is in the box."""
    for _ in range(generations):
        asked = search.ask()
        assert (asked >= search.lower).all()
        assert (asked <= search.upper).all()
        off = asked - target
        steps = np.diff(off, axis=1)
        search.tell(((off**2).sum(axis=1) + 50.0 * (steps**2).sum(axis=1))[:, None])
    assert len(search.scores)
    return float(search.scores[:, 0].min())


@pytest.mark.parametrize("kind", OPTIMISERS)
def test_finds_the_bottom_of_a_turned_valley(kind: Optimiser) -> None:
    """Within 150 generations of 120 samples, where samples at random lie some hundred above it."""
    lower, upper = np.full(6, -3.0), np.full(6, 5.0)
    search = kind(lower, upper, rank, 120, np.random.default_rng(4))
    assert least_after(search, np.linspace(-1.0, 2.0, 6), 150) < 0.05


@pytest.mark.parametrize("kind", [Umda, Multistart, PartialResampling, *OPTIMISERS])
def test_same_seed_same_samples(kind: Optimiser) -> None:
    """The samples after five generations, bit by bit."""
    ends = []
    for _ in range(2):
        search = kind(np.zeros(6), np.ones(6), rank, 20, np.random.default_rng(5))
        least_after(search, np.full(6, 0.3), 5)
        ends.append(search.samples)
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize("kind", [Umda, DifferentialEvolution])
def test_the_first_samples_fill_the_box_evenly(kind: Optimiser) -> None:
    search = kind(LOWER, UPPER, rank, 400, np.random.default_rng(3))
    asked = search.ask()
    assert asked.shape == (400, 2)
    assert len(search.samples) == len(search.scores) == 0
    shares = (asked - LOWER) / (UPPER - LOWER)
    assert (shares >= 0.0).all()
    assert (shares <= 1.0).all()
    # A uniform share has mean 1/2 and standard deviation 0.289; of 400, within four standard errors.
    assert shares.mean(axis=0) == pytest.approx([0.5, 0.5], abs=4 * 0.289 / 20)


@pytest.mark.parametrize("kind", [Umda, DifferentialEvolution])
def test_given_samples_are_asked_for_as_they_are_or_cut_at_the_wall(kind: Optimiser) -> None:
    given = np.array([[0.5, 20.0], [3.0, 5.0]])
    asked = kind(LOWER, UPPER, rank, 400, np.random.default_rng(3), initial=given).ask()
    assert asked.tolist() == [[0.5, 20.0], [1.0, 10.0]]


@pytest.mark.parametrize("kind", [Umda, DifferentialEvolution])
def test_all_are_asked_for_first_and_then_half(kind: Optimiser) -> None:
    search = kind(np.zeros(3), np.ones(3), rank, 10, np.random.default_rng(0))
    assert search.ask().shape == (10, 3)
    search.tell(search.ask().sum(axis=1)[:, None])
    assert search.ask().shape == (5, 3)


def test_differential_evolution_never_loses_its_best() -> None:
    search = DifferentialEvolution(np.zeros(4), np.ones(4), rank, 20, np.random.default_rng(1))
    best = np.inf
    for _ in range(20):
        search.tell((search.ask() ** 2).sum(axis=1)[:, None])
        assert search.scores[:, 0].min() <= best
        best = float(search.scores[:, 0].min())


def test_a_chain_keeps_the_covariance_of_neighbours_but_not_of_others() -> None:
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


def test_points_beyond_the_box_are_reflected_at_its_sides() -> None:
    np.testing.assert_allclose(
        reflect_into_box(np.array([0.3, -0.3, 1.2, 2.4, -1.7])), [0.3, 0.3, 0.8, 0.4, 0.3], atol=1e-12
    )


def test_many_starts_leave_what_is_worth_nothing_and_share_their_evaluations() -> None:
    """Half of the evaluations go to the best search, and starts that see no difference end within 100 evaluations."""

    def far_corner(points: np.ndarray) -> np.ndarray:
        return np.where((points > 0.4).all(axis=1), (points**2).sum(axis=1), np.inf)[:, None]

    search = Multistart(np.zeros(6), np.ones(6), rank, 40, np.random.default_rng(5))
    asked = 0
    while asked < 20_000:
        samples = search.ask()
        search.tell(far_corner(samples))
        asked += len(samples)
    assert search.scores.min() == pytest.approx(6 * 0.4**2, abs=0.05)


def test_partial_resampling_replaces_samples_only_by_better_ones() -> None:
    """Each sample of the population stays, or gives way to a better one: the sorted values never rise."""
    search = PartialResampling(np.full(8, -2.0), np.full(8, 6.0), rank, 40, np.random.default_rng(2))
    values = None
    for _ in range(20):
        search.tell((search.ask() ** 2).sum(axis=1)[:, None])
        after = search.scores[1:, 0]
        assert values is None or (after <= values).all()
        values = after


def test_partial_resampling_keeps_variables_of_the_parent() -> None:
    """One of four variables at least is drawn, and at the start half of them on average."""
    search = PartialResampling(np.full(4, -2.0), np.full(4, 6.0), rank, 2000, np.random.default_rng(2))
    search.tell((search.ask() ** 2).sum(axis=1)[:, None])
    changed = (np.abs(search.ask() - search.samples[1:]) > 1e-9).sum(axis=1)
    assert changed.min() >= 1
    assert 1.5 < changed.mean() < 3.0


def test_partial_resampling_starts_again_with_twice_the_population() -> None:
    """Without any better sample, after generations of 10 around the best; at most 200; the best of all is kept."""
    search = PartialResampling(np.zeros(10), np.ones(10), rank, 200, np.random.default_rng(2))
    counts = []
    for generation in range(5 * MAX_STALLED_GENERATIONS):
        asked = search.ask()
        counts.append(len(asked))
        search.tell(np.full((len(asked), 1), 1.0 if generation == 0 else 2.0))
    assert list(dict.fromkeys(counts)) == [60, 10, 120, 200]
    assert counts.count(60) == MAX_STALLED_GENERATIONS + 2
    assert search.scores[0, 0] == 1.0


def test_partial_resampling_refines_its_best_sample_along_a_curved_valley() -> None:
    """Rosenbrock's function has its minimum of 0 at (1, ..., 1), at the end of a curved valley."""
    search = PartialResampling(np.full(8, -2.0), np.full(8, 2.0), rank, 100, np.random.default_rng(3))
    evaluations = 0
    while evaluations < 30_000:
        x = search.ask()
        search.tell((100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2).sum(axis=1)[:, None])
        evaluations += len(x)
    assert search.scores[0, 0] < 1e-8
    assert search.samples[0] == pytest.approx(np.ones(8), abs=1e-3)


def test_partial_resampling_redraws_neighbouring_variables_in_half_of_the_samples() -> None:
    """Of 2,000 samples about 1,000 change one run of neighbours, where the last variable is followed by the first."""
    search = PartialResampling(np.full(16, -2.0), np.full(16, 6.0), rank, 2000, np.random.default_rng(2))
    search.tell((search.ask() ** 2).sum(axis=1)[:, None])
    changed = np.abs(search.ask() - search.samples[1:]) > 1e-9
    runs = (changed != np.roll(changed, 1, axis=1)).sum(axis=1) // 2
    # A random half of 16 variables forms one run with a probability below 1 %.
    assert 0.4 < (runs <= 1).mean() < 0.6
