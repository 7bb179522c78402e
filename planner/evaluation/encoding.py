"""Encode the waypoints of a path as a vector in a box, and decode them.

`rotated` is the encoding proposed by Yang, Tang and Lozano (CEC 2014, section III, eq. 12): an axis along the direction
of the path is divided into one interval per waypoint, and each waypoint deviates across the axis. `cartesian` and
`polar` are the encodings that they compare it with; `bearing` is a polar encoding that the paper does not have.

Lengths, angles and slopes do not change under the rotation, so only encodings and the grids that seed a search work in
rotated axes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from world.arrays import Floats
from world.by_reference import by_reference

# --- Frames of the inner waypoints ---

# In the paper the axis is the line from start to destination, and no path can turn back along it. Where the axis is a
# route instead, a chain of straight pieces, each waypoint has the frame of its own piece, and `along` is the length of
# the route.


# A piece of a route shorter than this (m) takes the course of the piece before it.
_MIN_PIECE_LENGTH_M = 1.0


class WaypointFrames(NamedTuple):
    """Axes for each of n inner waypoints: along its piece of a route, across it to the left, and up.

    east, north: (n,) position where along and across are 0, m.
    cosine, sine: (n,) cosine and sine of the angle from east to along, counter-clockwise.
    edges: (n + 1,) limits of the waypoints' intervals, m: waypoint i lies between edges[i] and edges[i + 1] along.
    """

    east: Floats
    north: Floats
    cosine: Floats
    sine: Floats
    edges: Floats

    def to_world(self, points: ArrayLike) -> Floats:
        """Convert points (along, across, up) to world positions, both (..., n, 3): point i is in frame i.

        >>> frames = route_frames(np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 50.0]]))
        >>> frames.to_world([[60.0, 5.0, 9.0], [120.0, 5.0, 9.0]]).round(6).tolist()
        [[60.0, 5.0, 9.0], [95.0, 20.0, 9.0]]
        """
        points = np.asarray(points, dtype=np.float64)
        along, across = points[..., 0], points[..., 1]
        out = np.empty(points.shape)
        out[..., 0] = self.east + self.cosine * along - self.sine * across
        out[..., 1] = self.north + self.sine * along + self.cosine * across
        out[..., 2] = points[..., 2]
        return out

    def to_frame(self, points: ArrayLike) -> Floats:
        """Convert world positions (..., n, 3) to (along, across, up) in the waypoints' frames.

        This inverts `to_world`.
        """
        points = np.asarray(points, dtype=np.float64)
        east, north = points[..., 0] - self.east, points[..., 1] - self.north
        return np.stack(
            [self.cosine * east + self.sine * north, self.cosine * north - self.sine * east, points[..., 2]], axis=-1
        )


def route_frames(route: Floats) -> WaypointFrames:
    """Make the frames of n waypoints along a route (n + 1, 2) on the map, one for each straight piece.

    A piece that is too short to have a course gets the course of the piece before it. If there is none, it gets the
    course of the first piece that has one.
    """
    steps = np.diff(route, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    angles = np.arctan2(steps[:, 1], steps[:, 0])
    rows_with_course = np.flatnonzero(lengths >= _MIN_PIECE_LENGTH_M)
    if rows_with_course.size:
        source_rows = np.maximum.accumulate(
            np.where(lengths >= _MIN_PIECE_LENGTH_M, np.arange(len(lengths)), rows_with_course[0])
        )
        angles = angles[source_rows]
    cosine, sine = np.cos(angles), np.sin(angles)
    east, north = route[:-1, 0] - cosine * edges[:-1], route[:-1, 1] - sine * edges[:-1]
    return WaypointFrames(east, north, cosine, sine, edges)


def straight_frames(east: float, north: float, cosine: float, sine: float, edges: Floats) -> WaypointFrames:
    """Return the frames of n waypoints that all have the same origin and axes.

    east, north: origin, m.
    cosine, sine: cosine and sine of the angle from east to the axis.
    edges: (n + 1,) limits of the waypoints' intervals along the axis, m.
    """
    count = edges.size - 1
    ones = np.ones(count)
    return WaypointFrames(east * ones, north * ones, cosine * ones, sine * ones, edges)


def sample_route(route: Floats, count: int) -> tuple[Floats, Floats]:
    """Return points (count, 3) at equal horizontal distances along a route (k, 3), and these distances, m.

    >>> points, along = sample_route(np.array([[0.0, 0.0, 10.0], [30.0, 0.0, 10.0], [30.0, 10.0, 10.0]]), 5)
    >>> along.tolist(), points[:, 0].tolist(), points[:, 1].tolist()
    ([0.0, 10.0, 20.0, 30.0, 40.0], [0.0, 10.0, 20.0, 30.0, 30.0], [0.0, 0.0, 0.0, 0.0, 10.0])
    """
    steps = np.diff(route, axis=0)
    distances = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    along = np.linspace(0.0, distances[-1], count)
    return np.column_stack([np.interp(along, distances, route[:, axis]) for axis in range(3)]), along


# --- Encodings ---

# Shortest polar step, as a fraction of the mean leg, because a step of 0 has no direction.
_MIN_POLAR_STEP = 0.05
# Half-width of the box along a route, in lengths of its pieces.
HALF_WIDTH = 2.0


@by_reference
class RotatedFrame(NamedTuple):
    """Frame with `along` from start to destination, `across` to the left and `up` unchanged (eq. 12).

    east, north: origin, at the start, m.
    cosine, sine: cosine and sine of the angle from east to the destination, counter-clockwise.
    length: horizontal distance D from start to destination, m.
    """

    east: float
    north: float
    cosine: float
    sine: float
    length: float

    def to_frame(self, points: ArrayLike) -> Floats:
        """Convert world positions (..., 3) to (along, across, up) in this frame (eq. 12)."""
        points = np.asarray(points, dtype=np.float64)
        east, north = points[..., 0] - self.east, points[..., 1] - self.north
        c, s = self.cosine, self.sine
        return np.stack([c * east + s * north, c * north - s * east, points[..., 2]], axis=-1)

    def to_world(self, points: ArrayLike) -> Floats:
        """Convert points (along, across, up) in this frame, (..., 3), to world positions.

        This inverts `to_frame`.
        """
        points = np.asarray(points, dtype=np.float64)
        along, across = points[..., 0], points[..., 1]
        c, s = self.cosine, self.sine
        out = np.empty(points.shape)
        out[..., 0] = self.east + c * along - s * across
        out[..., 1] = self.north + s * along + c * across
        out[..., 2] = points[..., 2]
        return out


def rotated_frame(start: Floats, destination: Floats) -> RotatedFrame:
    """Return the frame along the line from start to destination, both (3,) m.

    Raises ValueError if start and destination coincide on the map.
    """
    step = destination[:2] - start[:2]
    length = math.hypot(step[0], step[1])
    if length == 0.0:
        raise ValueError("start and destination are at the same place, so the path has no direction")
    east, north = step / length
    return RotatedFrame(float(start[0]), float(start[1]), float(east), float(north), length)


@dataclass(frozen=True, slots=True)
class Encoding:
    """A box and the mapping from its vectors to paths.

    name: name of the encoding in scenarios and commands.
    waypoints: number w of waypoints of a path, including start and destination.
    lower, upper: (d,) box, d = 3(w - 2), three numbers per waypoint in flying order.
    decode: (n, d) -> (n, w, 3) world m, start and destination included.
    frames: frames in which vectors are along, across and up of each inner waypoint; None for other encodings.

    >>> space = Space(np.zeros(3), np.array([3000.0, 4000.0, 0.0]), np.array([[0, 3000], [0, 4000]]), (0.0, 500.0))
    >>> encoding = rotated_encoding(space, 4)
    >>> encoding.lower[0::3].tolist(), encoding.upper[0::3].tolist()  # interval of each waypoint along the axis
    ([0.0, 2500.0], [2500.0, 5000.0])
    >>> encoding.decode(np.array([[1000.0, 0.0, 100.0, 4000.0, 0.0, 100.0]])).round(6).tolist()
    [[[0.0, 0.0, 0.0], [600.0, 800.0, 100.0], [2400.0, 3200.0, 100.0], [3000.0, 4000.0, 0.0]]]
    """

    name: str
    waypoints: int
    lower: Floats
    upper: Floats
    decode: Callable[[Floats], Floats]
    frames: WaypointFrames | None = None

    def __post_init__(self) -> None:
        """Make the limits of the box read-only."""
        for name in ("lower", "upper"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)


@dataclass(frozen=True, slots=True)
class Space:
    """Search space of a path; lengths in m.

    start, destination: (3,) fixed ends.
    bounds: (2, 2) map: west and east, then south and north.
    up: lowest and highest altitude of a waypoint.
    across: half-width of the box on either side of the straight line, or None for the width of the map.
    """

    start: Floats
    destination: Floats
    bounds: Floats
    up: tuple[float, float]
    across: float | None = None


def _add_ends(space: Space, inner_waypoints: Floats) -> Floats:
    """Return paths (n, w, 3) made of inner waypoints (n, w - 2, 3) and the start and destination."""
    out = np.empty((len(inner_waypoints), inner_waypoints.shape[1] + 2, 3))
    out[:, 0], out[:, 1:-1], out[:, -1] = space.start, inner_waypoints, space.destination
    return out


def rotated_encoding(space: Space, waypoints: int) -> Encoding:
    """Make the rotated encoding of section III of the paper (Yang, Tang, Lozano, CEC 2014).

    The axis from start to destination is divided into w - 2 intervals, and each inner waypoint lies in its interval.

    waypoints: number w of waypoints, including both ends.
    """
    frame = rotated_frame(space.start, space.destination)
    edges = np.linspace(0.0, frame.length, waypoints - 1)
    if space.across is not None:
        min_across, max_across = np.full(waypoints - 2, -space.across), np.full(waypoints - 2, space.across)
    else:
        # The limits across are the edges of the map; in an interval that is almost off the map they are -1 and 1.
        c, s = frame.cosine, frame.sine
        along = np.linspace(edges[:-1], edges[1:], 9, axis=1)
        nearest, furthest = np.full(along.shape, -math.inf), np.full(along.shape, math.inf)
        for (west, east), origin, along_factor, across_factor in zip(
            space.bounds, frame[:2], (c, s), (-s, c), strict=True
        ):
            west_end, east_end = west - origin - along_factor * along, east - origin - along_factor * along
            if abs(across_factor) > 1e-12:
                nearest = np.maximum(nearest, np.minimum(west_end / across_factor, east_end / across_factor))
                furthest = np.minimum(furthest, np.maximum(west_end / across_factor, east_end / across_factor))
        min_across, max_across = nearest.min(axis=1), furthest.max(axis=1)
        is_narrow = ~(max_across - min_across >= 1.0)
        min_across, max_across = np.where(is_narrow, -1.0, min_across), np.where(is_narrow, 1.0, max_across)
    lower = np.column_stack([edges[:-1], min_across, np.full(waypoints - 2, space.up[0])])
    upper = np.column_stack([edges[1:], max_across, np.full(waypoints - 2, space.up[1])])

    def decode(vectors: Floats) -> Floats:
        """Convert vectors (n, d) to paths (n, w, 3)."""
        return _add_ends(space, frame.to_world(vectors.reshape(len(vectors), waypoints - 2, 3)))

    frames = straight_frames(*frame[:4], edges)
    return Encoding("rotated", waypoints, lower.ravel(), upper.ravel(), decode, frames)


def route_encoding(space: Space, route: Floats) -> Encoding:
    """Make an encoding like `rotated_encoding` whose axis is a route (w - 1, 2), which may turn back.

    Inner waypoint i lies along the i-th piece of the route. Across the route it lies within `HALF_WIDTH` times the
    length of a piece.
    """
    frames = route_frames(route)
    waypoints = len(route) + 1
    half_width = HALF_WIDTH * float(frames.edges[-1]) / (waypoints - 2)
    lower = np.column_stack(
        [frames.edges[:-1], np.full(waypoints - 2, -half_width), np.full(waypoints - 2, space.up[0])]
    )
    upper = np.column_stack([frames.edges[1:], np.full(waypoints - 2, half_width), np.full(waypoints - 2, space.up[1])])

    def decode(vectors: Floats) -> Floats:
        """Convert vectors (n, d) to paths (n, w, 3)."""
        return _add_ends(space, frames.to_world(vectors.reshape(len(vectors), waypoints - 2, 3)))

    return Encoding("route", waypoints, lower.ravel(), upper.ravel(), decode, frames)


def require_frames(encoding: Encoding) -> WaypointFrames:
    """Return the frames of an encoding's waypoints. Raises ValueError for an encoding without frames."""
    if encoding.frames is None:
        raise ValueError(f"the encoding {encoding.name} has no frames along a route")
    return encoding.frames


def rotated_vectors(space: Space, encoding: Encoding, paths: Floats) -> Floats:
    """Return the vectors (n, d) of paths (n, w, 3) in the rotated encoding, clipped to the encoding's box."""
    inner_points = rotated_frame(space.start, space.destination).to_frame(paths[:, 1:-1])
    return np.clip(inner_points.reshape(len(paths), -1), encoding.lower, encoding.upper)


def cartesian_encoding(space: Space, waypoints: int) -> Encoding:
    """Make an encoding of each inner waypoint as east, north and up, anywhere on the map."""
    lower = np.array([space.bounds[0, 0], space.bounds[1, 0], space.up[0]])
    upper = np.array([space.bounds[0, 1], space.bounds[1, 1], space.up[1]])

    def decode(vectors: Floats) -> Floats:
        """Convert vectors (n, d) to paths (n, w, 3)."""
        return _add_ends(space, vectors.reshape(len(vectors), waypoints - 2, 3))

    return Encoding("cartesian", waypoints, np.tile(lower, waypoints - 2), np.tile(upper, waypoints - 2), decode)


def polar_encoding(space: Space, waypoints: int) -> Encoding:
    """Make an encoding of each inner waypoint as a step (r, theta, up) from the last one (section III.A).

    theta is "the turning angle at each waypoint", within +-180 degrees, positive to the left. It is relative to the
    previous leg, and at the first waypoint to the direction from start to destination. r is 5 % to 200 % of the
    straight distance divided by the number of legs. The paper states neither of the two ranges; `polar_45_encoding`
    allows no turn beyond the paper's limit.
    """
    return _step_encoding("polar", space, waypoints, math.pi, turning=True)


def polar_45_encoding(space: Space, waypoints: int) -> Encoding:
    """Make an encoding like `polar_encoding` with theta within the paper's turn limit of +-45 degrees."""
    return _step_encoding("polar-45", space, waypoints, math.pi / 4.0, turning=True)


def bearing_encoding(space: Space, waypoints: int) -> Encoding:
    """Make an encoding like `polar_encoding` with theta relative to the straight line to the destination.

    This encoding is not in the paper. Errors do not accumulate, because a change of one waypoint shifts the following
    waypoints but does not turn them.
    """
    return _step_encoding("bearing", space, waypoints, math.pi, turning=False)


def _step_encoding(name: str, space: Space, waypoints: int, max_angle: float, *, turning: bool) -> Encoding:
    """Make an encoding of each inner waypoint as a step (r, theta, up) from the previous one.

    r is the horizontal length of the step, theta its course, and up the altitude of the waypoint.

    waypoints: number w of waypoints of a path, both ends included.
    max_angle: limit of theta to either side, rad.
    turning: True if theta is relative to the previous step, False if relative to the direct line.
    """
    frame = rotated_frame(space.start, space.destination)
    mean_leg = frame.length / (waypoints - 1)
    lower = np.array([_MIN_POLAR_STEP * mean_leg, -max_angle, space.up[0]])
    upper = np.array([2.0 * mean_leg, max_angle, space.up[1]])

    def decode(vectors: Floats) -> Floats:
        """Convert vectors (n, d) to paths (n, w, 3)."""
        steps = vectors.reshape(len(vectors), waypoints - 2, 3)
        course = np.cumsum(steps[..., 1], axis=1) if turning else steps[..., 1]
        along = np.cumsum(steps[..., 0] * np.cos(course), axis=1)
        across = np.cumsum(steps[..., 0] * np.sin(course), axis=1)
        return _add_ends(space, frame.to_world(np.stack([along, across, steps[..., 2]], axis=-1)))

    return Encoding(name, waypoints, np.tile(lower, waypoints - 2), np.tile(upper, waypoints - 2), decode)


ENCODINGS: dict[str, Callable[[Space, int], Encoding]] = {
    "rotated": rotated_encoding,
    "cartesian": cartesian_encoding,
    "polar": polar_encoding,
    "polar-45": polar_45_encoding,
    "bearing": bearing_encoding,
}
