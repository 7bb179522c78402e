"""Outlines of zones to be drawn: closed rings on the map, and the heights of floor and ceiling along them."""

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_kernels import edge_distance, zone_records
from world.airspace.zones import Cylinder, Polygon, Ring, Zone, ZoneLevel, is_hole
from world.terrain import Terrain

Floats = NDArray[np.float64]

# Corners that a circle is drawn with.
CIRCLE_CORNERS = 72


def zone_rings(zone: Zone) -> tuple[Floats, ...]:
    """Rings (k, 2) of a zone, east and north in m, the last corner as the first; holes run the other way round.

    >>> square = zone_rings(Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0)))[0]
    >>> square.shape, square[0].tolist()
    ((73, 2), [200.0, 500.0])
    """
    shape = zone.shape
    if isinstance(shape, Cylinder):
        turn = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS + 1)
        ring = np.column_stack([shape.east + shape.radius * np.cos(turn), shape.north + shape.radius * np.sin(turn)])
        ring[-1] = ring[0]
        return (ring,)
    return tuple(np.array([*ring, ring[0]]) for ring in shape.rings)


def zone_parts(zone: Zone) -> list[tuple[Floats, ...]]:
    """Parts of a zone: rings as `zone_rings` has them, each part's outline and then its holes.

    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> [len(part) for part in zone_parts(zone)]
    [1]
    """
    if isinstance(zone.shape, Cylinder):
        return [zone_rings(zone)]
    rings = list(zip(zone_rings(zone), map(is_hole, zone.shape.rings), strict=True))
    # From the smallest: a hole belongs to the smallest outline about it.
    outlines = sorted((ring for ring, hole in rings if not hole), key=_area)
    shapes = zone_records([Zone("", "exclusion", Polygon((_open(ring),))) for ring in outlines])
    parts: list[list[Floats]] = [[ring] for ring in outlines]
    for ring, hole in rings:
        if hole:
            about = (k for k in range(len(outlines)) if edge_distance(shapes, k, *ring[0]) <= 0.0)
            parts[next(about)].append(ring)
    return [tuple(part) for part in parts]


def _open(ring: Floats) -> Ring:
    return tuple((east, north) for east, north in ring[:-1].tolist())


def _area(ring: Floats) -> float:
    return abs(float((ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]).sum()))


def level_heights(level: ZoneLevel | None, ground: Floats, absent: float) -> Floats:
    """Heights (n,) of a floor or a ceiling over ground (n,), m AMSL; `absent` where the zone has none.

    >>> level_heights(ZoneLevel(120.0, "ground"), np.array([10.0, 30.0]), 0.0).tolist()
    [130.0, 150.0]
    """
    if level is None:
        return np.full(len(ground), absent)
    return ground + level.height if level.datum == "ground" else np.full(len(ground), level.height)


def zone_walls(zone: Zone, terrain: Terrain | None, low: float, top: float) -> list[Floats]:
    """Rings (k, 2, 3) of a zone as a body: foot and upper edge of each corner, m.

    low, top: where no floor, or no ceiling, and no ground below says more, m AMSL.  A floor below the ground is on it.

    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0), ceiling=ZoneLevel(120.0, "amsl"))
    >>> zone_walls(zone, None, 0.0, 900.0)[0][0].tolist()
    [[200.0, 500.0, 0.0], [200.0, 500.0, 120.0]]
    """
    walls = []
    for ring in zone_rings(zone):
        ground = np.full(len(ring), low) if terrain is None else terrain.height(ring[:, 0], ring[:, 1])
        ground = np.where(np.isfinite(ground), ground, low)
        foot = np.maximum(level_heights(zone.floor, ground, -np.inf), ground)
        head = np.maximum(level_heights(zone.ceiling, ground, top), foot)
        walls.append(np.stack([np.column_stack([ring, foot]), np.column_stack([ring, head])], axis=1))
    return walls
