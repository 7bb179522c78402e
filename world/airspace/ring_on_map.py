"""Rings of latitudes and longitudes on a map: their edges, straight in degrees, with more corners where they bend."""

from collections.abc import Sequence

import numpy as np

from world.frames import GeoOrigin, to_map

# m.  An edge that is straight in degrees leaves the straight line between its corners on the map by this at most: one
# along a parallel at 46 degrees bends by so much over 2.2 km.
EDGE_BEND = 0.1
# Pieces that an edge is cut into at most.
_MOST_PIECES = 2_000


def ring_on_map(origin: GeoOrigin, corners: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """Corners (east, north) m of a ring of (latitude, longitude) degrees.

    Between two corners a ring is straight in degrees, as GeoJSON has it (RFC 7946, 3.1.1) and as autopilots take their
    fences; where that is not straight on the map, corners are put between.  A longitude goes the short way round.

    >>> origin = GeoOrigin(46.0, 8.0)
    >>> len(ring_on_map(origin, [(46.0, 8.0), (46.0, 8.01), (46.01, 8.0)]))
    3
    >>> len(ring_on_map(origin, [(46.0, 8.0), (46.0, 8.1), (46.01, 8.0)]))
    9
    """
    if not corners:
        return []
    lat, lon = np.array(corners, dtype=np.float64).T
    step_lat = np.roll(lat, -1) - lat
    step_lon = (np.roll(lon, -1) - lon + 180.0) % 360.0 - 180.0
    east, north = to_map(origin, lat, lon)
    middle = to_map(origin, lat + 0.5 * step_lat, lon + 0.5 * step_lon)
    off = np.hypot(middle[0] - 0.5 * (east + np.roll(east, -1)), middle[1] - 0.5 * (north + np.roll(north, -1)))
    # The bend of a piece falls with the square of its length.
    pieces = np.clip(np.ceil(np.sqrt(off / EDGE_BEND)), 1, _MOST_PIECES).astype(int)
    lats, lons = [], []
    for k, count in enumerate(pieces.tolist()):
        shares = np.arange(count) / count
        lats.append(lat[k] + shares * step_lat[k])
        lons.append(lon[k] + shares * step_lon[k])
    east, north = to_map(origin, np.concatenate(lats), np.concatenate(lons))
    return list(zip(east.tolist(), north.tolist(), strict=True))
