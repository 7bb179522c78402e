"""Points along a fly-by path, by its pieces and nodes alone."""

import numpy as np
from numpy.typing import NDArray

from flight.guidance.path import FlyByPath, point_on_piece, profile_at


def sample_path(path: FlyByPath, step: float) -> NDArray[np.float64]:
    """Points on the path about every ``step`` m, (n, 3) with its end."""
    distances = np.append(np.arange(0.0, path.length, step), path.length)
    numbers = np.maximum(0, np.searchsorted(path.pieces["start"], distances, side="right") - 1)
    points = np.empty((distances.size, 3))
    for k, (number, distance) in enumerate(zip(numbers, distances, strict=True)):
        piece = path.pieces[number]
        points[k, :2] = point_on_piece(piece, distance - piece.start)
        points[k, 2] = profile_at(path.nodes, distance)[0]
    return points
