"""Volumes of known sets, and the choice of points that cover most."""

import numpy as np
import pytest

from planner.optimisers.hypervolume import PROBE_COUNT, SEED, covering_order, hypervolume


@pytest.mark.parametrize(
    ("points", "reference", "volume"),
    [
        # One box, and one on or beyond the reference.
        ([[1.0, 2.0, 3.0, 4.0]], [2.0, 4.0, 6.0, 8.0], 1.0 * 2.0 * 3.0 * 4.0),
        ([[2.0, 0.0]], [2.0, 2.0], 0.0),
        ([[3.0, 0.0], [0.0, 3.0]], [2.0, 2.0], 0.0),
        # Stairs: 3 x 1 + 2 x 1 + 1 x 1; what another dominates adds nothing.
        ([[0.0, 2.0], [1.0, 1.0], [2.0, 0.0]], [3.0, 3.0], 6.0),
        ([[0.0, 2.0], [1.0, 1.0], [2.0, 0.0], [2.5, 2.5], [1.0, 1.0]], [3.0, 3.0], 6.0),
        # Three slabs of 1 x 2 x 2 through a cube of 2 share its corner: 4 + 4 + 4 - 3 x 2 + 1.
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [2.0, 2.0, 2.0], 7.0),
        # 4 of them in four dimensions: 16 less the one corner that none reaches.
        ((1.0 - np.eye(4) < 0.5).astype(float).tolist(), [2.0] * 4, 15.0),
        (np.zeros((0, 2)).tolist(), [1.0, 1.0], 0.0),
    ],
)
def test_the_hypervolume_of_a_known_set(points: list[list[float]], reference: list[float], volume: float) -> None:
    table = np.array(points).reshape(-1, len(reference))
    assert hypervolume(table, np.array(reference)) == pytest.approx(volume, abs=1e-12)


def test_the_hypervolume_of_random_points_is_what_random_probes_say() -> None:
    rng = np.random.default_rng(3)
    points = rng.random((15, 4))
    probes = rng.random((200_000, 4))
    covered = (points[:, None] <= probes[None]).all(axis=2).any(axis=0).mean()
    assert hypervolume(points, np.ones(4)) == pytest.approx(covered, abs=0.004)


def test_the_best_of_each_objective_comes_first_then_what_adds_most() -> None:
    front = np.array([[0.5, 0.5], [0.0, 0.9], [0.52, 0.48], [0.9, 0.0], [0.2, 0.8], [2.0, -1.0]])
    order = covering_order(front, np.ones(2), 4).tolist()
    assert order[:2] == [1, 3]
    # The middle adds 0.4 x 0.4; the last lies beyond the reference.
    assert order[2] in (0, 2)
    assert order[3] == 4
    assert 5 not in covering_order(front, np.ones(2), 9)
    assert covering_order(front, np.full(2, -1.0), 3).size == 0


@pytest.mark.parametrize("axes", [2, 4])
def test_each_choice_adds_most_probes_as_counted_anew_for_all(axes: int) -> None:
    points = np.random.default_rng(axes).random((60, axes))
    # Equal ones, of which the first is taken.
    points[30:40] = points[20:30]
    inside = np.flatnonzero((points < 0.9).all(axis=1))
    best = points[inside].min(axis=0)
    probes = best + np.random.default_rng(SEED).random((PROBE_COUNT, axes)) * (0.9 - best)
    covered = (points[inside][:, None] <= probes[None]).all(axis=2)
    order = [int(np.argmin(points[inside, k])) for k in range(axes)]
    while len(order) < 20:
        adds = (covered & ~covered[order].any(axis=0)).sum(axis=1)
        adds[order] = -1
        order.append(int(np.argmax(adds)))
    assert covering_order(points, np.full(axes, 0.9), 20).tolist() == inside[order].tolist()


def test_probes_are_drawn_anew_from_a_stream_that_is_given() -> None:
    points, rng = np.random.default_rng(1).random((80, 4)), np.random.default_rng(SEED)
    first, second = (covering_order(points, np.ones(4), 30, rng).tolist() for _ in range(2))
    assert first == covering_order(points, np.ones(4), 30).tolist()
    assert first != second
    assert first[:4] == second[:4]
