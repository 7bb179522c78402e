"""Frames along a route: each waypoint in that of its own straight piece, and the straight line as the special case."""

import math

import numpy as np
import pytest

from planner.evaluation.encoding import rotated_frame
from planner.frames.waypoint_frames import frames_along, spread_over, straight_frames

# East, then north, then back to the west: pieces of 100, 50 and 200 m.
ROUTE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 50.0], [-100.0, 50.0]])


def test_along_is_the_length_of_the_route_and_across_is_to_its_left() -> None:
    frames = frames_along(ROUTE)
    np.testing.assert_allclose(frames.edges, [0.0, 100.0, 150.0, 350.0])
    world = frames.restore([[40.0, 7.0, 1.0], [120.0, 7.0, 2.0], [250.0, 7.0, 3.0]])
    np.testing.assert_allclose(world, [[40.0, 7.0, 1.0], [93.0, 20.0, 2.0], [0.0, 43.0, 3.0]], atol=1e-9)


def test_positions_come_back_from_their_frames() -> None:
    frames = frames_along(ROUTE)
    points = np.random.default_rng(1).uniform(-500.0, 500.0, (5, 3, 3))
    np.testing.assert_allclose(frames.rotate(frames.restore(points)), points, atol=1e-9)


def test_frames_of_a_straight_route_are_the_rotated_frame() -> None:
    start, destination = np.array([100.0, 200.0, 0.0]), np.array([-800.0, 1400.0, 0.0])
    frame = rotated_frame(start, destination)
    edges = np.linspace(0.0, frame.length, 6)
    points = np.random.default_rng(2).uniform(-500.0, 500.0, (5, 3))
    along = frames_along(np.linspace(start[:2], destination[:2], 6))
    straight = straight_frames(*frame[:4], edges)
    np.testing.assert_array_equal(straight.restore(points), frame.restore(points))
    np.testing.assert_array_equal(straight.rotate(points), frame.rotate(points))
    np.testing.assert_allclose(along.restore(points), frame.restore(points), atol=1e-9)
    np.testing.assert_allclose(along.edges, edges)


def test_a_piece_without_length_has_the_course_of_the_piece_before_it() -> None:
    frames = frames_along(np.array([[0.0, 0.0], [0.0, 80.0], [0.0, 80.0], [60.0, 80.0]]))
    np.testing.assert_allclose(frames.sine, [1.0, 1.0, 0.0], atol=1e-12)
    first = frames_along(np.array([[5.0, 5.0], [5.0, 5.0], [5.0, 85.0]]))
    np.testing.assert_allclose(first.sine, [1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("count", [2, 7])
def test_points_are_spread_at_even_steps_on_the_map(count: int) -> None:
    climbing = np.column_stack([ROUTE, [0.0, 900.0, 0.0, 200.0]])
    points, along = spread_over(climbing, count)
    np.testing.assert_allclose(along, np.linspace(0.0, 350.0, count))
    np.testing.assert_allclose(points[[0, -1]], climbing[[0, -1]])
    if count == 7:
        # 116.7 m along: 16.7 m up the second piece, a third of the way down from 900 m.
        np.testing.assert_allclose(points[2], [100.0, 50.0 / 3.0, 600.0], atol=1e-9)
    assert math.isclose(along[-1], 350.0)
