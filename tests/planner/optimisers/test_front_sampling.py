"""The estimation of a front: it keeps what none dominates, meets constraints, and covers fronts that are known."""

import numpy as np
import pytest

from planner.optimisers.front_sampling import FrontSampling
from planner.optimisers.hypervolume import hypervolume

Floats = np.ndarray


def search(seed: int = 1, size: int = 40) -> FrontSampling:
    start = np.array([[0.5, 0.1, 0.1, 0.1, 0.1, 0.1]])
    made = FrontSampling(np.zeros(6), np.ones(6), np.eye(6), np.full(2, 2.0), 1, size, 60, np.random.default_rng(seed))
    made.tell(start, two_goals(start), np.zeros((1, 1)))
    return made


def two_goals(x: Floats) -> Floats:
    """ZDT2's front f2 = 1 - f1^2, which is hollow, where all other variables are 0."""
    rest = 1.0 + x[:, 1:].sum(axis=1)
    return np.column_stack([x[:, 0], rest - x[:, 0] ** 2 / rest])


def test_a_hollow_front_is_covered_whole() -> None:
    made = search()
    for _ in range(60):
        x = made.ask()
        made.tell(x, two_goals(x), np.zeros((len(x), 1)))
    # Below (2, 2) the front covers 2 x 1 + its area above the curve from 0 to 1: 2 + 1 + 1/3.
    assert hypervolume(made.objectives, np.full(2, 2.0)) > 0.99 * (3.0 + 1.0 / 3.0)
    assert len(made.vectors) == 40
    below = (made.objectives[:, None] <= made.objectives[None]).all(axis=2)
    assert below.sum() == len(below)


def test_what_breaks_a_constraint_or_lies_beyond_the_reference_is_not_kept() -> None:
    made = search()
    before = made.vectors.copy()
    better = np.zeros((2, 6))
    better[:, 0] = 1.0, 0.9
    made.tell(better, two_goals(better), np.array([[0.0], [1e-9]]))
    assert len(made.vectors) == 2
    made.tell(0.9 * better, np.array([[-9.0, 2.5], [-9.0, -9.0]]), np.array([[0.0], [1.0]]))
    assert len(made.vectors) == 2
    assert (made.vectors == before[0]).all(axis=1).any()


def test_the_same_seed_samples_the_same_and_all_within_the_box() -> None:
    one, two, other = search(1), search(1), search(2)
    for _ in range(3):
        samples = [made.ask() for made in (one, two, other)]
        np.testing.assert_array_equal(samples[0], samples[1])
        assert not np.array_equal(samples[0], samples[2])
        assert samples[0].min() >= 0.0
        assert samples[0].max() <= 1.0
        for made, x in zip((one, two, other), samples, strict=True):
            made.tell(x, two_goals(x), np.zeros((len(x), 1)))


def still(seeds: Floats, axes: int, population: int) -> FrontSampling:
    """A search without noise, from seeds (n, d) none of which dominates another."""
    size = seeds.shape[1]
    box = np.full(size, -9.0), np.full(size, 9.0)
    rng = np.random.default_rng(2)
    made = FrontSampling(*box, np.zeros((1, size)), np.full(2, 99.0), axes, 40, population, rng)
    steps = np.arange(float(len(seeds)))
    made.tell(seeds, np.column_stack([steps, -steps]), np.zeros((len(seeds), 1)))
    return made


def test_a_block_is_a_run_of_points_on_the_way_to_another_solution() -> None:
    made = still(np.repeat([[0.0], [1.0]], 15, axis=1), 3, 4000)
    inner, all_the_way, part = np.zeros(5), 0, 0
    for row in made.ask().reshape(-1, 5, 3):
        # Away from either mean, where the same coordinates of points in a row have moved by the same share.
        runs = [(away, places) for away in (row, 1.0 - row) if (places := run_of(away)) is not None]
        assert runs
        away, places = runs[0]
        if 0 < places.sum() < 5:
            assert 0.0 < away.max() <= 1.2
            inner += places
            part += 1
            all_the_way += int(away.max() == 1.0)
    assert inner.min() > 0.85 * inner.max()
    assert part > 900
    assert 0.4 < all_the_way / part < 0.6


def run_of(away: Floats) -> Floats | None:
    """The points (p,) of a block whose coordinates (p, axes) have moved, None where it is no such block."""
    moved = np.abs(away) > 1e-12
    places, axes = moved.any(axis=1), moved.any(axis=0)
    begins = np.diff(np.concatenate([[0], places.astype(int)])).clip(0).sum()
    alike = len(np.unique(away[moved].round(9))) <= 1
    return places if alike and begins <= 1 and np.array_equal(moved, places[:, None] & axes) else None


def test_blocks_join_what_each_of_two_solutions_has_right() -> None:
    seeds = np.repeat(np.eye(2), 4, axis=1)
    made = still(seeds, 1, 400)
    for _ in range(6):
        x = made.ask()
        first, second = np.abs(x[:, :4] - 1.0).sum(axis=1), np.abs(x[:, 4:] - 1.0).sum(axis=1)
        made.tell(x, np.column_stack([2.0 * first + second, first + 2.0 * second]) - 10.0, np.zeros((400, 1)))
    np.testing.assert_array_equal(made.vectors[made.objectives[:, 0].argmin()], np.ones(8))


@pytest.mark.parametrize(("succeed", "factor"), [(0.0, 0.9), (0.01, 0.9), (0.04, 1.15)])
def test_noise_widens_while_more_than_one_in_fifty_succeed_and_narrows_otherwise(succeed: float, factor: float) -> None:
    def width(told: int) -> float:
        rng = np.random.default_rng(5)
        made = FrontSampling(np.full(3, -9.0), np.full(3, 9.0), np.eye(3), np.full(2, 9.0), 1, 4000, 2000, rng)
        made.tell(np.zeros((1, 3)), np.zeros((1, 2)), np.zeros((1, 1)))
        for _ in range(told):
            asked = made.ask()
            steps = np.linspace(0.1, 1.0, len(asked))
            # None dominates another; what is told twice was not asked for, and changes no scale.
            kept = (np.arange(len(asked)) % 100 < 100 * succeed).astype(float)
            fresh = np.column_stack([steps, -steps])
            made.tell(np.zeros_like(asked), fresh, 1.0 - kept[:, None])
            made.tell(np.zeros_like(asked), fresh, np.ones((len(asked), 1)))
        return float(np.abs(made.ask()).mean())

    assert width(1) / width(0) == pytest.approx(factor, rel=0.06)
