"""Frames of a path's inner waypoints: one straight frame for all of them, or one for each along a route.

The idea of Yang, Tang and Lozano (CEC 2014, section III) is a frame whose axis leads where the path leads: each
waypoint has its own interval along it, and deviates across it.  Their axis is the line from start to destination, and
no path turns back along that.  Where the axis is a route instead, a chain of straight pieces, each waypoint has the
frame of its own piece, and along is the length of the route.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

# A piece of a route shorter than this (m) has the course of the piece before it.
_SHORTEST = 1.0


class WaypointFrames(NamedTuple):
    """One rotated frame for each of n inner waypoints.

    east, north: (n,) of the place where along and across are 0, m.
    cosine, sine: (n,) of the angle from east to along, counter-clockwise.
    edges: (n + 1,) along, between which each waypoint lies, m.
    """

    east: Floats
    north: Floats
    cosine: Floats
    sine: Floats
    edges: Floats

    def restore(self, points: ArrayLike) -> Floats:
        """Along, across, up (..., n, 3) to world.

        >>> frames = frames_along(np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 50.0]]))
        >>> frames.restore([[60.0, 5.0, 9.0], [120.0, 5.0, 9.0]]).round(6).tolist()
        [[60.0, 5.0, 9.0], [95.0, 20.0, 9.0]]
        """
        points = np.asarray(points, dtype=np.float64)
        along, across = points[..., 0], points[..., 1]
        out = np.empty(points.shape)
        out[..., 0] = self.east + self.cosine * along - self.sine * across
        out[..., 1] = self.north + self.sine * along + self.cosine * across
        out[..., 2] = points[..., 2]
        return out

    def rotate(self, points: ArrayLike) -> Floats:
        """World (..., n, 3) to along, across, up: the inverse of `restore`."""
        points = np.asarray(points, dtype=np.float64)
        east, north = points[..., 0] - self.east, points[..., 1] - self.north
        return np.stack(
            [self.cosine * east + self.sine * north, self.cosine * north - self.sine * east, points[..., 2]], axis=-1
        )


def frames_along(route: Floats) -> WaypointFrames:
    """Frames along a route (n + 1, 2) on the map, one for each of its straight pieces.

    A piece without a course takes that of the piece before it, the first that of the next that has one.
    """
    steps = np.diff(route, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    angles = np.arctan2(steps[:, 1], steps[:, 0])
    some = np.flatnonzero(lengths >= _SHORTEST)
    if some.size:
        before = np.maximum.accumulate(np.where(lengths >= _SHORTEST, np.arange(len(lengths)), some[0]))
        angles = angles[before]
    cosine, sine = np.cos(angles), np.sin(angles)
    east, north = route[:-1, 0] - cosine * edges[:-1], route[:-1, 1] - sine * edges[:-1]
    return WaypointFrames(east, north, cosine, sine, edges)


def straight_frames(east: float, north: float, cosine: float, sine: float, edges: Floats) -> WaypointFrames:
    """The same frame for all of the waypoints: its origin (m), its angle from east, and n + 1 edges along (m)."""
    count = edges.size - 1
    one = np.ones(count)
    return WaypointFrames(east * one, north * one, cosine * one, sine * one, edges)


def spread_over(route: Floats, count: int) -> tuple[Floats, Floats]:
    """So many points (count, 3) at even steps along a route (k, 3), and where they are along it (count,), m on the map.

    >>> points, along = spread_over(np.array([[0.0, 0.0, 10.0], [30.0, 0.0, 10.0], [30.0, 10.0, 10.0]]), 5)
    >>> along.tolist(), points[:, 0].tolist(), points[:, 1].tolist()
    ([0.0, 10.0, 20.0, 30.0, 40.0], [0.0, 10.0, 20.0, 30.0, 30.0], [0.0, 0.0, 0.0, 0.0, 10.0])
    """
    steps = np.diff(route, axis=0)
    runs = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    along = np.linspace(0.0, runs[-1], count)
    return np.column_stack([np.interp(along, runs, route[:, axis]) for axis in range(3)]), along
