"""Limit the corners of a zone's outline, its edges in one place and its crossings.

The limits apply before a check or a repair.

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
    """Raise ValueError for outlines with too many corners, or with too many edges in one place.

    Edges are in one place if their bounding boxes meet; the number of such pairs is limited.

    rings: corners (east, north) of each outline.
    closed: True for rings; False for lines, in which the last corner is not joined to the first.

    >>> check_edges([[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]])
    """
    corner_count = sum(map(len, rings))
    if corner_count > MAX_CORNERS:
        raise ValueError(f"{corner_count:,} corners: at most {MAX_CORNERS:,} are allowed in one zone")
    if corner_count**2 <= MAX_EDGE_PAIRS:
        return
    edges, _ = _make_edges(rings, closed)
    tree, batch_size, pair_count = shapely.STRtree(edges), max(1, MAX_EDGE_PAIRS // corner_count), 0
    for first_row in range(0, corner_count, batch_size):
        pair_count += tree.query(edges[first_row : first_row + batch_size]).shape[1]
        if pair_count > MAX_EDGE_PAIRS:
            raise ValueError(
                f"too many edges at the same place: at most {MAX_EDGE_PAIRS:,} pairs of neighbouring edges are allowed"
            )


def count_crossings(rings: Sequence[Sequence[Sequence[float]]], max_count: int, *, closed: bool = True) -> int:
    """Return the number of pairs of edges that cross or touch.

    A number above ``max_count`` may be incomplete.

    rings, closed: as for `check_edges`.

    Successive edges of a ring, which share a corner, are not counted.

    >>> count_crossings([[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]], 9)  # a bow tie
    1
    """
    edges, next_edge = _make_edges(rings, closed)
    tree, batch_size, crossing_count = shapely.STRtree(edges), max(1, MAX_EDGE_PAIRS // len(edges)), 0
    for first_row in range(0, len(edges), batch_size):
        first, second = tree.query(edges[first_row : first_row + batch_size], predicate="intersects")
        first += first_row
        is_crossing = (first < second) & (next_edge[first] != second) & (next_edge[second] != first)
        crossing_count += int(is_crossing.sum())
        if crossing_count > max_count:
            break
    return crossing_count


def _make_edges(rings: Sequence[Sequence[Sequence[float]]], closed: bool) -> tuple[Any, Any]:
    """Return the edges of rings as shapely lines, and the index of each edge's next edge in its ring.

    closed: False for a single open line, which has no edge from its last corner to its first.
    """
    corners: list[Floats] = [np.asarray(ring, dtype=np.float64).reshape(-1, 2) for ring in rings]
    starts, ends = np.concatenate(corners), np.concatenate([np.roll(ring, -1, axis=0) for ring in corners])
    sizes = np.cumsum([0, *map(len, corners)])
    pairs = zip(sizes[:-1].tolist(), sizes[1:].tolist(), strict=True)
    next_edge = np.concatenate([np.roll(np.arange(start, end), -1) for start, end in pairs])
    if not closed:
        starts, ends, next_edge = starts[:-1], ends[:-1], next_edge[:-1]
    return shapely.linestrings(np.stack([starts, ends], axis=1)), next_edge
