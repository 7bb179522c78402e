"""The estimation of a front: it keeps what none dominates, meets constraints, and covers fronts that are known."""

import numpy as np

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
    better[:, 0] = 1.0
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
