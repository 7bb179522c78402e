"""Moves of a path: they join, they lie on legs and arcs by plain geometry, and their heights are the profile's."""

import math
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from flight.guidance.path import profile_at
from logs.verdict.measures.path_moves import BLOCK_MOVES, MOVE, flown_moves, move_blocks, move_point, planned_moves
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from tests.logs.verdict.measures.test_zone_visits import move
from tests.synthetic import bank_radius, fly_path, make_setup
from world.kernels import Records, read_only
from world.terrain import Terrain, make_gridded_terrain

# North for 2 km and up, a right angle, east and level.
CORNER = [[0.0, 0.0, 300.0], [0.0, 2000.0, 400.0], [2000.0, 2000.0, 400.0]]


def test_a_paths_moves_join() -> None:
    requirements = route_requirements(make_setup(CORNER))
    moves = planned_moves(requirements)
    for before, after in pairwise(moves):
        np.testing.assert_allclose(move_point(before, 1.0), (after.east, after.north, after.up), atol=1e-6)
        assert before.time + before.lasts == pytest.approx(after.time, abs=1e-9)
    np.testing.assert_allclose(move_point(moves[0], 0.0), CORNER[0], atol=1e-9)
    np.testing.assert_allclose(move_point(moves[-1], 1.0), CORNER[-1], atol=1e-6)
    assert set(moves["leg"]) == {0, 1}
    # In still air at 25 m/s.
    np.testing.assert_allclose(moves["length"], 25.0 * moves["lasts"], rtol=1e-9)
    assert float(moves["length"].sum()) == pytest.approx(requirements.setup.path.length)


def test_a_corners_moves_lie_on_its_arc() -> None:
    setup = make_setup(CORNER)
    moves = planned_moves(route_requirements(setup))
    radius = 1.0 / float(moves["curvature"].max())
    # The arc is a little wider than at the first waypoint's height: the air is thinner there, or not at all.
    assert radius == pytest.approx(bank_radius(), rel=0.02)
    centre, curved = (radius, 2000.0 - radius), [piece for piece in moves if piece.curvature]
    assert len(curved) >= 2
    for piece in curved:
        for share in (0.0, 0.3, 0.7, 1.0):
            east, north, _ = move_point(piece, share)
            assert math.hypot(east - centre[0], north - centre[1]) == pytest.approx(radius, abs=1e-6)
    # It changes legs at its middle.
    last, first = [piece for piece in curved if piece.leg == 0][-1], next(piece for piece in curved if piece.leg == 1)
    half = radius * (1.0 - math.sqrt(0.5))
    np.testing.assert_allclose(move_point(last, 1.0)[:2], (half, 2000.0 - half), atol=1e-6)
    np.testing.assert_allclose(move_point(first, 0.0)[:2], (half, 2000.0 - half), atol=1e-6)


def test_heights_are_the_profiles() -> None:
    setup = make_setup([[0.0, 0.0, 300.0], [0.0, 1500.0, 400.0], [0.0, 3000.0, 330.0], [900.0, 4500.0, 330.0]])
    at = 0.0
    for piece in planned_moves(route_requirements(setup)):
        for share in (0.01, 0.4, 0.99):
            assert move_point(piece, share)[2] == pytest.approx(
                profile_at(setup.path.nodes, at + share * piece.length)[0]
            )
        at += float(piece.length)


def test_a_flights_moves_lead_from_row_to_row() -> None:
    setup = make_setup(CORNER)
    track, requirements = fly_path(setup, rate=10.0), route_requirements(setup)
    aligned = align_track(requirements, track)
    assert aligned is not None
    moves = flown_moves(aligned)
    assert len(moves) == len(track) - 1
    for k in (0, 100, len(moves) - 1):
        np.testing.assert_allclose(move_point(moves[k], 0.0), track.position[k], atol=1e-9)
        np.testing.assert_allclose(move_point(moves[k], 1.0), track.position[k + 1], atol=1e-9)
        assert moves[k].time + moves[k].lasts == pytest.approx(track.time[k + 1])
    np.testing.assert_array_equal(moves["leg"], np.arange(len(moves)) >= aligned.rows[1])
    for leg in (0, 1):
        np.testing.assert_array_equal(flown_moves(aligned, leg, leg), moves[moves["leg"] == leg])


def test_what_came_after_the_last_waypoint_belongs_to_the_last_leg() -> None:
    setup = make_setup(CORNER)
    track = fly_path(setup, rate=10.0)
    count = 30
    beyond = track.position[-1] + np.arange(1, count + 1)[:, None] * np.array([2.5, 0.0, 0.0])
    later = track.time[-1] + 0.1 * np.arange(1, count + 1)
    aligned = align_track(route_requirements(setup), track)
    assert aligned is not None
    longer = replace(
        aligned,
        track=replace(
            aligned.track,
            **{
                name: np.concatenate([column, np.repeat(column[-1:], count, axis=0)])
                for name, column in ((field.name, getattr(aligned.track, field.name)) for field in fields(track))
                if isinstance(column, np.ndarray) and len(column) == len(track)
            },
        ),
    )
    longer = replace(
        longer,
        track=replace(
            longer.track,
            position=np.concatenate([track.position, beyond]),
            time=np.concatenate([track.time, later]),
        ),
    )
    for moves in (flown_moves(longer), flown_moves(longer, 1, 1)):
        np.testing.assert_allclose(move_point(moves[-1], 1.0), beyond[-1], atol=1e-9)
        assert moves[-1].leg == 1
    before = flown_moves(longer, 0, 0)
    np.testing.assert_allclose(move_point(before[-1], 1.0), track.position[aligned.rows[1]], atol=1e-9)


def test_the_moves_of_some_legs_are_those_of_all_that_are_on_them() -> None:
    setup = make_setup([[0.0, 0.0, 300.0], [0.0, 2000.0, 400.0], [2000.0, 2000.0, 400.0], [2000.0, 4000.0, 400.0]])
    requirements = route_requirements(setup)
    every = planned_moves(requirements)
    for first, last in ((0, 0), (1, 1), (1, 2), (2, 2)):
        some = planned_moves(requirements, first, last)
        wanted = every[(every["leg"] >= first) & (every["leg"] <= last)]
        for name in ("east", "north", "up", "length", "curvature", "climb", "bend", "lasts", "leg"):
            np.testing.assert_array_equal(some[name], wanted[name])


# ----------------------------------------------------------------------
# Blocks of moves: no place of a move lies outside its block, and no ground below it is steeper than is noted.


def ridge() -> Terrain:
    """Level ground with a step of 30 m over 100 m at east 1,000 m, and one of 80 m at east -1,500 m."""
    axis = np.arange(-2000.0, 2001.0, 100.0)
    heights = np.where(axis >= 1000.0, 30.0, 0.0) + np.where(axis >= -1500.0, 80.0, 0.0)
    return make_gridded_terrain(np.tile(heights, (41, 1)), axis, axis, source="", sha256="", datum="")


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
    blocks = move_blocks(moves, read_only(np.zeros((2, 2), np.float32)), ridge().to_pixel.record, 100.0, False)
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
    assert (
        len(move_blocks(moves, read_only(np.zeros((2, 2), np.float32)), ridge().to_pixel.record, 100.0, False))
        == blocks
    )


def test_a_move_alone_has_the_box_about_its_middle() -> None:
    """A way of 40 m and a rise of 30 m that bends by 8 m, by plain sums."""
    moves: Records = np.array([move(100.0, 50.0, 300.0, length=40.0, climb=30.0, bend=8.0)], MOVE)
    block = move_blocks(moves, read_only(np.zeros((2, 2), np.float32)), ridge().to_pixel.record, 100.0, False)[0]
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
        ground = make_gridded_terrain(ground.heights[::1].T[::1].copy(), axis, axis, source="", sha256="", datum="")
    east, north, course = (0.0, begin, 0.0) if turned else (begin, 0.0, 90.0)
    way: Records = np.array([move(east, north, 500.0, course=course, length=2100.0)], MOVE)
    block = move_blocks(way, ground.heights, ground.to_pixel.record, ground.spacing, True)[0]
    assert block["steepest"] >= slope


def test_a_single_peak_is_as_steep_as_both_its_sides_together() -> None:
    axis = np.arange(-500.0, 501.0, 100.0)
    heights = np.zeros((11, 11))
    heights[5, 5] = 50.0
    ground = make_gridded_terrain(heights, axis, axis, source="", sha256="", datum="")
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
