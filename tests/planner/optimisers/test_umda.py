"""UMDA finds what it should on functions that are no paths."""

import numpy as np
import pytest

from planner.optimisers.umda import Umda
from planner.seeding.first_samples import bridge_basis


def by_value(scores: np.ndarray) -> np.ndarray:
    return np.argsort(np.argsort(scores[:, 0], kind="stable"), kind="stable")


def least_after(umda: Umda, target: np.ndarray, generations: int) -> float:
    for _ in range(generations):
        asked = umda.ask()
        assert (asked >= umda.lower).all()
        assert (asked <= umda.upper).all()
        umda.tell(((asked - target) ** 2).sum(axis=1)[:, None])
    assert len(umda.scores)
    return float(umda.scores[:, 0].min())


@pytest.mark.parametrize("basis", [None, bridge_basis(2)])
def test_finds_the_bottom_of_a_bowl(basis: np.ndarray | None) -> None:
    lower, upper = np.full(6, -3.0), np.full(6, 5.0)
    target = np.linspace(-1.0, 2.0, 6)
    umda = Umda(lower, upper, by_value, 100, np.random.default_rng(4), basis=basis)
    assert least_after(umda, target, 60) < 1e-4


def test_optimum_in_a_corner_of_the_box_is_reached() -> None:
    lower, upper = np.zeros(4), np.ones(4)
    umda = Umda(lower, upper, by_value, 80, np.random.default_rng(4))
    assert least_after(umda, np.array([2.0, -1.0, 2.0, -1.0]), 60) == pytest.approx(4.0, abs=1e-2)


def test_the_better_half_is_kept() -> None:
    umda = Umda(np.zeros(3), np.ones(3), by_value, 10, np.random.default_rng(0))
    first = umda.ask()
    assert first.shape == (10, 3)
    values = first.sum(axis=1)
    umda.tell(values[:, None])
    assert umda.ask().shape == (5, 3)
    np.testing.assert_array_equal(np.sort(umda.samples.sum(axis=1)), np.sort(values)[:5])


def test_marginals_are_maximum_likelihood() -> None:
    """The deviation divides by N: two kept rows 0 and 1 give 1/2, not 1/sqrt(2)."""
    umda = Umda(
        np.full(1, -50.0),
        np.full(1, 50.0),
        by_value,
        4,
        np.random.default_rng(0),
        initial=np.array([[0.0], [1.0], [9.0], [9.0]]),
    )
    umda.tell(umda.ask())
    drawn = np.concatenate([umda._sample(20_000)])
    assert drawn.mean() == pytest.approx(0.5, abs=0.02)
    assert drawn.std() == pytest.approx(0.5, abs=0.02)
