"""The flown track as a line that keeps up: every 2 s all of it so far, in a bounded number of points.

A viewer that seeks gets the newest message alone, so that each holds the whole track; for a file that stays small,
older parts lose the points that lie nearest to the straight way between their neighbours.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# s between messages.
EVERY = 2
# Points of one message: when there are so many, they are thinned to so few.
MOST_POINTS, THINNED = 96, 64


class TrackSoFar:
    """Points of the track so far, the oldest first."""

    def __init__(self) -> None:
        self._points = np.zeros((MOST_POINTS + 1, 3))
        self._count = 0

    def add(self, position: Floats) -> Floats:
        """Take a position (3,), `EVERY` s after the one before, and give (n, 3) of the track, until the next call.

        >>> track = TrackSoFar()
        >>> for k in range(500):
        ...     points = track.add(np.array([float(k), 0.0, 100.0]))
        >>> len(points) <= MOST_POINTS, points[0].tolist(), points[-1].tolist()
        (True, [0.0, 0.0, 100.0], [499.0, 0.0, 100.0])
        """
        self._points[self._count] = position
        self._count += 1
        if self._count > MOST_POINTS:
            self._points[:THINNED] = thinned(self._points, THINNED)
            self._count = THINNED
        return self._points[: self._count]


def thinned(points: Floats, wanted: int) -> Floats:
    """Points (n, 3) without those that a line loses least by, its ends kept: ``wanted`` of them.

    >>> corner = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 9.0, 0.0]])
    >>> thinned(corner, 3)[:, :2].tolist()
    [[0.0, 0.0], [10.0, 0.0], [10.0, 9.0]]
    """
    while len(points) > wanted:
        before, here, after = points[:-2], points[1:-1], points[2:]
        way = after - before
        share = np.clip(((here - before) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-9), 0.0, 1.0)
        off = ((before + share[:, None] * way - here) ** 2).sum(axis=1)
        going = np.zeros(len(points), dtype=bool)
        for k in np.argsort(off, kind="stable")[: len(points) - wanted].tolist():
            # Of neighbours one at a time: the other's distance is then from another way.
            going[k + 1] = not (going[k] or going[k + 2])
        points = points[~going]
    return points
