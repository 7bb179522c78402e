"""Limit corners, near edges and crossings of a zone's outline before it is checked or repaired.

A repair stores every crossing: a star of 2,000 corners, 80 kB in a file, has 2,000,000 crossings and took 1.7 GB.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from world.arrays import Floats
from world.scenario_tables import MAX_CORNERS

# Maximum number of pairs of edges of a zone whose bounding boxes meet; a coast of 100,000 corners has a fifth of it.
MAX_EDGE_PAIRS = 2_000_000
# Maximum number of crossings of edges in the outlines of a file that are repaired; each takes about 1 kB.
MAX_CROSSINGS = 50_000


def check_edges(rings: Sequence[Sequence[Sequence[float]]], *, closed: bool = True) -> None:
    """Raise ValueError for an outline with too many corners, or too many edges at the same place.

    closed: False for a line whose last corner is not joined to its first.

    >>> check_edges([[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]])
    """
    count = sum(map(len, rings))
    if count > MAX_CORNERS:
        raise ValueError(f"{count:,} corners: at most {MAX_CORNERS:,} are allowed in one zone")
    if count**2 <= MAX_EDGE_PAIRS:
        return
    edges, _ = _edges(rings, closed)
    tree, step, pair_count = shapely.STRtree(edges), max(1, MAX_EDGE_PAIRS // count), 0
    for begin in range(0, count, step):
        pair_count += tree.query(edges[begin : begin + step]).shape[1]
        if pair_count > MAX_EDGE_PAIRS:
            raise ValueError(f"too many edges at the same place: at most {MAX_EDGE_PAIRS:,} pairs are allowed")


def count_crossings(rings: Sequence[Sequence[Sequence[float]]], max_count: int, *, closed: bool = True) -> int:
    """Return the number of pairs of edges that meet outside a shared corner; stop counting above ``max_count``.

    >>> count_crossings([[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]], 9)  # a bow tie
    1
    """
    edges, following = _edges(rings, closed)
    tree, step, crossing_count = shapely.STRtree(edges), max(1, MAX_EDGE_PAIRS // len(edges)), 0
    for begin in range(0, len(edges), step):
        first, second = tree.query(edges[begin : begin + step], predicate="intersects")
        first += begin
        is_crossing = (first < second) & (following[first] != second) & (following[second] != first)
        crossing_count += int(is_crossing.sum())
        if crossing_count > max_count:
            break
    return crossing_count


def _edges(rings: Sequence[Sequence[Sequence[float]]], closed: bool) -> tuple[Any, Any]:
    """Return the edges of rings as lines, and for each edge the index of the next edge of its ring."""
    corners: list[Floats] = [np.asarray(ring, dtype=np.float64).reshape(-1, 2) for ring in rings]
    starts, ends = np.concatenate(corners), np.concatenate([np.roll(ring, -1, axis=0) for ring in corners])
    sizes = np.cumsum([0, *map(len, corners)])
    pairs = zip(sizes[:-1].tolist(), sizes[1:].tolist(), strict=True)
    following = np.concatenate([np.roll(np.arange(begin, end), -1) for begin, end in pairs])
    if not closed:
        starts, ends, following = starts[:-1], ends[:-1], following[:-1]
    return shapely.linestrings(np.stack([starts, ends], axis=1)), following
