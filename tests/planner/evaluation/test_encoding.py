"""Frames along a route: each waypoint in that of its own straight piece, and the straight line as the special case."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.evaluation.encoding import (
    ENCODINGS,
    Space,
    bearing_encoding,
    polar_45_encoding,
    polar_encoding,
    rotated_encoding,
    rotated_frame,
    rotated_vectors,
    route_frames,
    sample_route,
    straight_frames,
)
from world.geometry import leg_slopes, path_length, turning_angles

# East, then north, then back to the west: pieces of 100, 50 and 200 m.
ROUTE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 50.0], [-100.0, 50.0]])


def test_along_is_the_length_of_the_route_and_across_is_to_its_left() -> None:
    frames = route_frames(ROUTE)
    np.testing.assert_allclose(frames.edges, [0.0, 100.0, 150.0, 350.0])
    world = frames.to_world([[40.0, 7.0, 1.0], [120.0, 7.0, 2.0], [250.0, 7.0, 3.0]])
    np.testing.assert_allclose(world, [[40.0, 7.0, 1.0], [93.0, 20.0, 2.0], [0.0, 43.0, 3.0]], atol=1e-9)


def test_positions_come_back_from_their_frames() -> None:
    frames = route_frames(ROUTE)
    points = np.random.default_rng(1).uniform(-500.0, 500.0, (5, 3, 3))
    np.testing.assert_allclose(frames.to_frame(frames.to_world(points)), points, atol=1e-9)


def test_frames_of_a_straight_route_are_the_rotated_frame() -> None:
    start, destination = np.array([100.0, 200.0, 0.0]), np.array([-800.0, 1400.0, 0.0])
    frame = rotated_frame(start, destination)
    edges = np.linspace(0.0, frame.length, 6)
    points = np.random.default_rng(2).uniform(-500.0, 500.0, (5, 3))
    along = route_frames(np.linspace(start[:2], destination[:2], 6))
    straight = straight_frames(*frame[:4], edges)
    np.testing.assert_array_equal(straight.to_world(points), frame.to_world(points))
    np.testing.assert_array_equal(straight.to_frame(points), frame.to_frame(points))
    np.testing.assert_allclose(along.to_world(points), frame.to_world(points), atol=1e-9)
    np.testing.assert_allclose(along.edges, edges)


def test_a_piece_without_length_has_the_course_of_the_piece_before_it() -> None:
    frames = route_frames(np.array([[0.0, 0.0], [0.0, 80.0], [0.0, 80.0], [60.0, 80.0]]))
    np.testing.assert_allclose(frames.sine, [1.0, 1.0, 0.0], atol=1e-12)
    first = route_frames(np.array([[5.0, 5.0], [5.0, 5.0], [5.0, 85.0]]))
    np.testing.assert_allclose(first.sine, [1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("count", [2, 7])
def test_points_are_spread_at_even_steps_on_the_map(count: int) -> None:
    climbing = np.column_stack([ROUTE, [0.0, 900.0, 0.0, 200.0]])
    points, along = sample_route(climbing, count)
    np.testing.assert_allclose(along, np.linspace(0.0, 350.0, count))
    np.testing.assert_allclose(points[[0, -1]], climbing[[0, -1]])
    if count == 7:
        # 116.7 m along: 16.7 m up the second piece, a third of the way down from 900 m.
        np.testing.assert_allclose(points[2], [100.0, 50.0 / 3.0, 600.0], atol=1e-9)
    assert math.isclose(along[-1], 350.0)


# ----------------------------------------------------------------------
# Encodings: the rotation against a rotation matrix, boxes, intervals and round trips.

coordinate = st.floats(-20_000, 20_000)
points = st.tuples(coordinate, coordinate, st.floats(0, 3000)).map(np.array)


def space(across: float | None = None) -> Space:
    bounds = np.array([[-1000.0, 9000.0], [-2000.0, 7000.0]])
    return Space(np.array([0.0, 0.0, 200.0]), np.array([8000.0, 6000.0, 300.0]), bounds, (100.0, 900.0), across)


@settings(max_examples=50)
@given(points, points, st.lists(points, min_size=3, max_size=6).map(np.array))
def test_frame_round_trip_and_criteria_survive(start: np.ndarray, end: np.ndarray, path: np.ndarray) -> None:
    if math.dist(start[:2], end[:2]) < 1.0:
        return
    frame = rotated_frame(start, end)
    turned = frame.to_frame(path)
    np.testing.assert_allclose(frame.to_world(turned), path, atol=1e-7)
    assert path_length(turned) == pytest.approx(float(path_length(path)), abs=1e-6)
    np.testing.assert_allclose(frame.to_frame(start)[:2], 0.0, atol=1e-9)
    np.testing.assert_allclose(frame.to_frame(end)[:2], [math.dist(start[:2], end[:2]), 0.0], atol=1e-7)


def test_rotation_is_the_papers_matrix() -> None:
    start, end = np.array([500.0, 500.0, 0.0]), np.array([9600.0, 9600.0, 0.0])
    angle = math.atan2(end[1] - start[1], end[0] - start[0])
    matrix = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    point = np.array([3000.0, 7000.0, 120.0])
    np.testing.assert_allclose(rotated_frame(start, end).to_frame(point)[:2], matrix @ (point - start)[:2], atol=1e-9)


def test_turns_and_slopes_survive_rotation() -> None:
    path = np.random.default_rng(3).uniform(0, 5000, (9, 3))
    turned = rotated_frame(path[0], path[-1]).to_frame(path)
    np.testing.assert_allclose(turning_angles(turned), turning_angles(path), atol=1e-9)
    np.testing.assert_allclose(leg_slopes(turned), leg_slopes(path), atol=1e-9)


@pytest.mark.parametrize("name", ENCODINGS)
@pytest.mark.parametrize("count", [3, 10])
def test_decoded_paths_keep_their_ends(name: str, count: int) -> None:
    encoding = ENCODINGS[name](space(), count)
    vectors = np.random.default_rng(1).uniform(encoding.lower, encoding.upper, (20, encoding.lower.size))
    paths = encoding.decode(vectors)
    assert paths.shape == (20, count, 3)
    np.testing.assert_array_equal(paths[:, 0], np.tile(space().start, (20, 1)))
    np.testing.assert_array_equal(paths[:, -1], np.tile(space().destination, (20, 1)))
    assert paths[..., 2].min() >= 100.0
    assert paths[..., 2].max() <= 900.0


def test_rotated_waypoints_lie_each_in_its_interval() -> None:
    encoding = rotated_encoding(space(), 7)
    vectors = np.random.default_rng(2).uniform(encoding.lower, encoding.upper, (200, 15))
    along = rotated_frame(space().start, space().destination).to_frame(encoding.decode(vectors))[:, 1:-1, 0]
    interval = np.floor(along / 2000.0 - 1e-12)
    np.testing.assert_array_equal(interval, np.tile(np.arange(5), (200, 1)))
    np.testing.assert_allclose(rotated_vectors(space(), encoding, encoding.decode(vectors)), vectors, atol=1e-6)


def test_box_across_covers_the_map_and_no_more() -> None:
    encoding = rotated_encoding(space(), 4)
    frame = rotated_frame(space().start, space().destination)
    for side in (encoding.lower, encoding.upper):
        for i in range(2):
            # Some place at the box's edge within the interval is on the map's edge.
            along = np.linspace(5000.0 * i, 5000.0 * (i + 1), 9)
            edge = frame.to_world(np.column_stack([along, np.full(9, side[3 * i + 1]), np.zeros(9)]))
            inside = (np.abs(edge[:, 0] - 4000.0) <= 5000.0 + 1e-6) & (np.abs(edge[:, 1] - 2500.0) <= 4500.0 + 1e-6)
            assert inside.any()
    narrow = rotated_encoding(space(1500.0), 4)
    assert narrow.lower[1] == -1500.0
    assert narrow.upper[4] == 1500.0


def test_polar_step_of_the_straight_line() -> None:
    encoding = polar_encoding(space(), 6)
    path = encoding.decode(np.tile([2000.0, 0.0, 500.0], 4)[None])[0]
    np.testing.assert_allclose(path[1:5, :2], np.outer(np.arange(1, 5), [1600.0, 1200.0]), atol=1e-9)


def test_polar_angles_turn_from_the_leg_before_and_bearings_from_the_line() -> None:
    turns = np.radians([10.0, 20.0, -40.0, 15.0])
    vector = np.column_stack([np.full(4, 1000.0), turns, np.full(4, 500.0)]).ravel()[None]
    line = np.arctan2(space().destination[1], space().destination[0])
    for make, courses in (
        (polar_encoding, [10.0, 30.0, -10.0, 5.0]),
        (polar_45_encoding, [10.0, 30.0, -10.0, 5.0]),
        (bearing_encoding, [10.0, 20.0, -40.0, 15.0]),
    ):
        steps = np.diff(make(space(), 6).decode(vector)[0, :5, :2], axis=0)
        np.testing.assert_allclose(np.degrees(np.arctan2(steps[:, 1], steps[:, 0]) - line), courses, atol=1e-9)
        np.testing.assert_allclose(np.hypot(*steps.T), 1000.0, atol=1e-9)


def test_the_range_of_the_angle_is_in_the_box() -> None:
    for make, widest in ((polar_encoding, 180.0), (polar_45_encoding, 45.0), (bearing_encoding, 180.0)):
        encoding = make(space(), 6)
        np.testing.assert_allclose(np.degrees(encoding.lower[1::3]), -widest)
        np.testing.assert_allclose(np.degrees(encoding.upper[1::3]), widest)
        assert ENCODINGS[encoding.name] is make


def test_no_direction_without_distance() -> None:
    with pytest.raises(ValueError, match="same place"):
        rotated_frame(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 9.0]))
