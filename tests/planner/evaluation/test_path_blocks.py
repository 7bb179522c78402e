"""Paths side by side: what is done to a block is done to each path of it, and to no other."""

from typing import Any

import numpy as np
import pytest

from planner.evaluation.path_blocks import (
    BLOCK,
    BLOCK_SCRATCH,
    clear_sums,
    copy_place,
    divide_legs,
    load_waypoints,
    subtract_places,
)
from world.frames import fit_polymap

PLACE = ("east", "north", "up", "column", "row")
SIZE = 5


@pytest.fixture
def block() -> Any:
    """Scratch whose places hold random numbers."""
    scratch: Any = np.zeros(1, BLOCK_SCRATCH)
    rng = np.random.default_rng(4)
    for place in ("begin", "end", "step", "point"):
        for name in PLACE:
            scratch[place][name][0] = rng.uniform(-9.0, 9.0, BLOCK)
    for name in BLOCK_SCRATCH["sums"].names or ():
        scratch["sums"][name][0] = rng.uniform(1.0, 9.0, BLOCK)
    return scratch.view(np.recarray)[0]


def columns(place: Any) -> np.ndarray:
    """(5, BLOCK) copy of a place's numbers."""
    return np.array([place[name] for name in PLACE])


def test_all_sums_begin_with_nothing(block: Any) -> None:
    assert all((block.sums[name] > 0.0).all() for name in block.sums.dtype.names)
    clear_sums(block.sums)
    assert not any(block.sums[name].any() for name in block.sums.dtype.names)


def test_places_are_copied_for_the_paths_that_there_are(block: Any) -> None:
    begin, end = columns(block.begin), columns(block.end)
    copy_place(block.end, block.begin, SIZE)
    np.testing.assert_array_equal(columns(block.begin)[:, :SIZE], end[:, :SIZE])
    np.testing.assert_array_equal(columns(block.begin)[:, SIZE:], begin[:, SIZE:])


def test_a_step_leads_from_begin_to_end(block: Any) -> None:
    wanted, kept = columns(block.end) - columns(block.begin), columns(block.step)
    subtract_places(block.end, block.begin, SIZE, block.step)
    np.testing.assert_array_equal(columns(block.step)[:, :SIZE], wanted[:, :SIZE])
    np.testing.assert_array_equal(columns(block.step)[:, SIZE:], kept[:, SIZE:])


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_leg_is_divided_by_its_share(block: Any, share: float) -> None:
    wanted, kept = columns(block.begin) + share * columns(block.step), columns(block.point)
    divide_legs(block.begin, block.step, share, SIZE, block.point)
    np.testing.assert_allclose(columns(block.point)[:, :SIZE], wanted[:, :SIZE])
    np.testing.assert_array_equal(columns(block.point)[:, SIZE:], kept[:, SIZE:])


def test_waypoints_come_with_their_pixels(block: Any) -> None:
    # A map with every power up to three, which a polynomial of that degree holds exactly.
    def curved(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 3.0 + x - 2.0 * y + 0.01 * x * y, 5.0 - y + 0.002 * x**2 * y - 0.001 * y**3

    to_pixel = fit_polymap(curved, [[-20.0, 30.0], [-40.0, 10.0]], 1e-9)
    rng = np.random.default_rng(5)
    paths = np.stack([rng.uniform(-20.0, 30.0, (9, 4)), rng.uniform(-40.0, 10.0, (9, 4)), rng.uniform(0, 9, (9, 4))], 2)
    kept = columns(block.end)
    # Waypoint 2 of paths 3 to 7.
    load_waypoints(to_pixel.record, paths, 3, 2, SIZE, block)
    got = columns(block.end)
    np.testing.assert_array_equal(got[:3, :SIZE], paths[3:8, 2].T)
    np.testing.assert_allclose(got[3:, :SIZE], curved(*paths[3:8, 2, :2].T), atol=1e-9)
    np.testing.assert_array_equal(got[:, SIZE:], kept[:, SIZE:])
