"""Moves of a path: they join, they lie on legs and arcs by plain geometry, and their heights are the profile's."""

import math
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from flight.guidance.path_kernels import profile
from logs.verdict.measures.path_moves import flown_moves, move_point, planned_moves
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track
from tests.synthetic import bank_radius, fly_path, make_setup

# North for 2 km and up, a right angle, east and level.
CORNER = [[0.0, 0.0, 300.0], [0.0, 2000.0, 400.0], [2000.0, 2000.0, 400.0]]


def test_a_paths_moves_join() -> None:
    demands = route_demands(make_setup(CORNER))
    moves = planned_moves(demands)
    for before, after in pairwise(moves):
        np.testing.assert_allclose(move_point(before, 1.0), (after.east, after.north, after.up), atol=1e-6)
        assert before.time + before.lasts == pytest.approx(after.time, abs=1e-9)
    np.testing.assert_allclose(move_point(moves[0], 0.0), CORNER[0], atol=1e-9)
    np.testing.assert_allclose(move_point(moves[-1], 1.0), CORNER[-1], atol=1e-6)
    assert set(moves["leg"]) == {0, 1}
    # In still air at 25 m/s.
    np.testing.assert_allclose(moves["length"], 25.0 * moves["lasts"], rtol=1e-9)
    assert float(moves["length"].sum()) == pytest.approx(demands.setup.path.length)


def test_a_corners_moves_lie_on_its_arc() -> None:
    setup = make_setup(CORNER)
    moves = planned_moves(route_demands(setup))
    radius = 1.0 / float(moves["curvature"].max())
    # The arc is a little wider than at the first waypoint's height: the air is thinner there, or not at all.
    assert radius == pytest.approx(bank_radius(), rel=0.02)
    centre, curved = (radius, 2000.0 - radius), [move for move in moves if move.curvature]
    assert len(curved) >= 2
    for move in curved:
        for share in (0.0, 0.3, 0.7, 1.0):
            east, north, _ = move_point(move, share)
            assert math.hypot(east - centre[0], north - centre[1]) == pytest.approx(radius, abs=1e-6)
    # It changes legs at its middle.
    last, first = [move for move in curved if move.leg == 0][-1], next(move for move in curved if move.leg == 1)
    half = radius * (1.0 - math.sqrt(0.5))
    np.testing.assert_allclose(move_point(last, 1.0)[:2], (half, 2000.0 - half), atol=1e-6)
    np.testing.assert_allclose(move_point(first, 0.0)[:2], (half, 2000.0 - half), atol=1e-6)


def test_heights_are_the_profiles() -> None:
    setup = make_setup([[0.0, 0.0, 300.0], [0.0, 1500.0, 400.0], [0.0, 3000.0, 330.0], [900.0, 4500.0, 330.0]])
    at = 0.0
    for move in planned_moves(route_demands(setup)):
        for share in (0.01, 0.4, 0.99):
            assert move_point(move, share)[2] == pytest.approx(profile(setup.path.nodes, at + share * move.length)[0])
        at += float(move.length)


def test_a_flights_moves_lead_from_row_to_row() -> None:
    setup = make_setup(CORNER)
    track, demands = fly_path(setup, rate=10.0), route_demands(setup)
    aligned = lay_track(demands, track)
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
    aligned = lay_track(route_demands(setup), track)
    assert aligned is not None
    longer = replace(
        aligned,
        track=replace(
            track,
            **{
                name: np.concatenate([column, np.repeat(column[-1:], count, axis=0)])
                for name, column in ((field.name, getattr(track, field.name)) for field in fields(track))
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
    demands = route_demands(setup)
    every = planned_moves(demands)
    for first, last in ((0, 0), (1, 1), (1, 2), (2, 2)):
        some = planned_moves(demands, first, last)
        wanted = every[(every["leg"] >= first) & (every["leg"] <= last)]
        for name in ("east", "north", "up", "length", "curvature", "climb", "bend", "lasts", "leg"):
            np.testing.assert_array_equal(some[name], wanted[name])
