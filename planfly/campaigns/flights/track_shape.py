"""What the pictures keep of a flight: its clearance along the way, and where it crossed each waypoint."""

import numpy as np
from numpy.typing import NDArray

from flight.mission.route import Route
from flight.simulation.track import Track

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

# Equal pieces of the route's length, of each of which the least clearance is kept.
STATIONS = 150


def clearance_profile(route: Route, track: Track) -> Singles:
    """(STATIONS,) the least height above ground on each equal piece of the route's length, m; NaN where none was flown.

    The place on the route is that beside the track, on the leg that was flown then.
    """
    starts, ends = route.waypoints[:-1, :2], route.waypoints[1:, :2]
    lengths = np.hypot(*(ends - starts).T)
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    leg = np.clip(track.leg, 0, len(lengths) - 1)
    along = (ends - starts)[leg] / np.maximum(lengths[leg], 1e-9)[:, None]
    covered = np.einsum("ij,ij->i", track.position[:, :2] - starts[leg], along)
    distance = before[leg] + np.clip(covered, 0.0, lengths[leg])
    piece = np.minimum((distance / before[-1] * STATIONS).astype(int), STATIONS - 1)
    least = np.full(STATIONS, np.inf, dtype=np.float32)
    np.fmin.at(least, piece, track.clearance)
    return np.where(np.isfinite(least), least, np.float32(np.nan)).astype(np.float32)


def waypoint_crossings(route: Route, track: Track) -> Singles:
    """(w, 2) how far right of and above each waypoint the track was at its nearest, m; NaN where it did not get there.

    Right is seen along the mean of the courses in and out.
    """
    points = route.waypoints
    out = np.full((len(points), 2), np.nan, dtype=np.float32)
    steps = np.diff(points[:, :2], axis=0)
    courses = np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))
    middle = np.concatenate([courses[:1], 0.5 * (courses[:-1] + courses[1:]), courses[-1:]])
    for k, point in enumerate(points):
        near = np.flatnonzero((track.leg == k) | (track.leg == k - 1))
        passed = len(track) and (track.leg.max() >= k or k == len(points) - 1)
        if not near.size or not passed:
            continue
        off = track.position[near] - point
        nearest = off[np.argmin(off[:, 0] ** 2 + off[:, 1] ** 2)]
        out[k] = nearest[0] * np.cos(middle[k]) - nearest[1] * np.sin(middle[k]), nearest[2]
    return out
