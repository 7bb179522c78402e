"""Blocks of moves: no place of a move lies outside its block, and no ground below it is steeper than is noted."""

import numpy as np
import pytest

from logs.verdict.measures.path_blocks import BLOCK_MOVES, move_blocks
from logs.verdict.measures.path_moves import MOVE, move_point
from tests.logs.verdict.measures.test_zone_visits import move
from world.kernels import Records
from world.terrain import Terrain, gridded


def ridge() -> Terrain:
    """Level ground with a step of 30 m over 100 m at east 1,000 m, and one of 80 m at east -1,500 m."""
    axis = np.arange(-2000.0, 2001.0, 100.0)
    heights = np.where(axis >= 1000.0, 30.0, 0.0) + np.where(axis >= -1500.0, 80.0, 0.0)
    return gridded(np.tile(heights, (41, 1)), axis, axis, source="", sha256="", datum="")


def test_a_block_holds_its_moves() -> None:
    rng = np.random.default_rng(8)
    rows = [
        move(
            *rng.uniform(-500.0, 500.0, 3).tolist(),
            course=float(rng.uniform(0.0, 360.0)),
            length=float(rng.uniform(1.0, 400.0)),
            curvature=float(rng.uniform(-0.01, 0.01)),
            climb=float(rng.uniform(-50.0, 50.0)),
            bend=float(rng.uniform(-80.0, 80.0)),
        )
        for _ in range(2 * BLOCK_MOVES + 5)
    ]
    moves: Records = np.array(rows, MOVE)
    blocks = move_blocks(moves, np.zeros((2, 2), np.float32), ridge().to_pixel.record, 100.0, False)
    assert len(blocks) == 3
    for k, one in enumerate(moves):
        block = blocks[k // BLOCK_MOVES]
        for share in np.linspace(0.0, 1.0, 21):
            east, north, up = move_point(one, share)
            assert block["west"] <= east <= block["east"]
            assert block["south"] <= north <= block["north"]
            assert block["low"] <= up <= block["high"]
    assert (blocks["steepest"] == 0.0).all()


@pytest.mark.parametrize(("count", "blocks"), [(63, 1), (64, 1), (65, 2), (128, 2)])
def test_a_block_is_full_before_the_next_begins(count: int, blocks: int) -> None:
    moves: Records = np.array([move(0.0, 0.0, 0.0, length=10.0)] * count, MOVE)
    assert BLOCK_MOVES == 64
    assert len(move_blocks(moves, np.zeros((2, 2), np.float32), ridge().to_pixel.record, 100.0, False)) == blocks


def test_a_move_alone_has_the_box_about_its_middle() -> None:
    """A way of 40 m and a rise of 30 m that bends by 8 m, by plain sums."""
    moves: Records = np.array([move(100.0, 50.0, 300.0, length=40.0, climb=30.0, bend=8.0)], MOVE)
    block = move_blocks(moves, np.zeros((2, 2), np.float32), ridge().to_pixel.record, 100.0, False)[0]
    assert (block["west"], block["east"]) == pytest.approx((100.0, 140.0))
    assert (block["south"], block["north"]) == pytest.approx((30.0, 70.0))
    middle, lift = 300.0 + 15.0 + 2.0, 15.0 + 10.0
    assert (block["low"], block["high"]) == pytest.approx((middle - lift, middle + lift))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("begin", "slope"), [(-1900.0, 0.8), (-1000.0, 0.3)])
def test_all_the_ground_below_a_long_block_counts(turned: bool, begin: float, slope: float) -> None:
    """2.1 km on, with the steep step at its beginning, or at its end; and with the ground's axes changed over."""
    ground = ridge()
    axis = np.arange(-2000.0, 2001.0, 100.0)
    if turned:
        ground = gridded(ground.heights[::1].T[::1].copy(), axis, axis, source="", sha256="", datum="")
    east, north, course = (0.0, begin, 0.0) if turned else (begin, 0.0, 90.0)
    way: Records = np.array([move(east, north, 500.0, course=course, length=2100.0)], MOVE)
    block = move_blocks(way, ground.heights, ground.to_pixel.record, ground.spacing, True)[0]
    assert block["steepest"] >= slope


def test_a_single_peak_is_as_steep_as_both_its_sides_together() -> None:
    axis = np.arange(-500.0, 501.0, 100.0)
    heights = np.zeros((11, 11))
    heights[5, 5] = 50.0
    ground = gridded(heights, axis, axis, source="", sha256="", datum="")
    way: Records = np.array([move(-20.0, -20.0, 500.0, length=10.0)], MOVE)
    block = move_blocks(way, ground.heights, ground.to_pixel.record, ground.spacing, True)[0]
    # 0.5 to either side, and a hair for single precision.
    assert 1.0 < block["steepest"] / (0.5 * np.sqrt(2.0)) < 1.0 + 1.2e-6


@pytest.mark.parametrize(("east", "slope"), [(-200.0, 0.0), (920.0, 0.3), (-1580.0, 0.8), (-3500.0, 0.0)])
def test_the_steepest_ground_below_a_block(east: float, slope: float) -> None:
    ground = ridge()
    way: Records = np.array([move(east, 0.0, 500.0, length=40.0)], MOVE)
    block = move_blocks(way, ground.heights, ground.to_pixel.record, ground.spacing, True)[0]
    assert block["steepest"] == pytest.approx(slope, rel=1e-5)
