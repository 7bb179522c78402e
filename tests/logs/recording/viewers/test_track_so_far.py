"""The track so far stays small, begins and ends where it does, and keeps to what was flown."""

import itertools

import numpy as np
import pytest
from shapely import LineString, Point

from logs.recording.viewers.track_so_far import EVERY, MOST_POINTS, THINNED, TrackSoFar, thinned


def test_a_long_winding_flight_keeps_its_shape() -> None:
    """Two hours along a wide zigzag of 40 corners: within 60 m of every corner, in at most 96 points."""
    corners = np.array([[3000.0 * k, 4000.0 * (k % 2), 100.0] for k in range(41)])
    along = np.linspace(0.0, 40.0, 7200 // EVERY)
    flown = np.stack([np.interp(along, range(41), corners[:, k]) for k in range(3)], axis=1)
    track, longest = TrackSoFar(), 0
    for k, position in enumerate(flown):
        points = track.add(position)
        longest = max(longest, len(points))
        assert len(points) <= min(k + 1, MOST_POINTS)
        assert (points[0] == flown[0]).all()
        assert (points[-1] == position).all()
    line = LineString(points[:, :2])
    assert max(line.distance(Point(*corner[:2])) for corner in corners) < 60.0
    assert (longest, THINNED) == (96, 64)


@pytest.mark.parametrize("wanted", [2, 5, 30])
def test_thinning_keeps_ends_and_the_count(wanted: int) -> None:
    points = np.random.default_rng(wanted).normal(size=(60, 3))
    left = thinned(points, wanted)
    assert len(left) == wanted
    assert (left[[0, -1]] == points[[0, -1]]).all()


def test_points_on_straight_ways_go_first() -> None:
    square = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]])
    way = np.concatenate([np.linspace(a, b, 10, endpoint=False) for a, b in itertools.pairwise(square)])
    points = np.column_stack([np.vstack([way, square[-1:]]), np.zeros(31)])
    assert thinned(points, 4)[:, :2].tolist() == square.tolist()
