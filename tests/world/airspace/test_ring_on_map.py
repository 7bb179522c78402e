"""Rings of degrees on a map: every corner in its place, and long edges as straight in degrees as they are drawn."""

import numpy as np
import pytest

from world.airspace.ring_on_map import EDGE_BEND, ring_on_map
from world.frames import GeoOrigin, to_map

ORIGIN = GeoOrigin(46.0, 8.0)


def beside(points: list[tuple[float, float]], east: float, north: float) -> float:
    """Least distance from a place to the edges of a ring, by plain sums."""
    least = np.inf
    for (e0, n0), (e1, n1) in zip(points, [*points[1:], points[0]], strict=True):
        step, off = np.array([e1 - e0, n1 - n0]), np.array([east - e0, north - n0])
        share = np.clip(step @ off / max(float(step @ step), 1e-12), 0.0, 1.0)
        least = min(least, float(np.hypot(*(off - share * step))))
    return least


@pytest.mark.parametrize("size", [0.001, 0.05, 1.0])
def test_an_edge_along_a_parallel_stays_on_it(size: float) -> None:
    corners = [(46.3, 8.1), (46.3, 8.1 + size), (46.3 + size, 8.1)]
    ring = ring_on_map(ORIGIN, corners)
    for lat, lon in corners:
        east, north = to_map(ORIGIN, lat, lon)
        assert min(np.hypot(e - east, n - north) for e, n in ring) < 1e-6
    for share in np.linspace(0.0, 1.0, 97):
        east, north = to_map(ORIGIN, 46.3, 8.1 + share * size)
        assert beside(ring, float(east), float(north)) <= EDGE_BEND
    assert (len(ring) == 3) == (size < 0.01)


def test_a_ring_across_the_date_line_is_small() -> None:
    ring = np.array(ring_on_map(GeoOrigin(-17.0, 180.0), [(-17.0, 179.99), (-17.0, -179.99), (-17.01, -179.99)]))
    assert np.abs(ring).max() < 1_200.0


def test_a_ring_without_corners_has_none() -> None:
    assert ring_on_map(ORIGIN, []) == []
