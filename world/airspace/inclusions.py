"""Unite inclusion zones, for an autopilot that only has to be inside one of them."""

import math
from collections.abc import Sequence
from functools import reduce

import numpy as np
import shapely

from world.airspace.zones import Polygon, Zone, make_polygon

# Number of corners of a circle in a union of inclusions: it leaves out 1e-4 of the radius at most.
_CIRCLE_CORNERS = 256


def unite_inclusions(zones: Sequence[Zone]) -> tuple[Zone, ...]:
    """Return zones with all inclusions merged into one.

    It is used for an autopilot that must be inside at least one of them.

    Circles are approximated by inscribed polygons. Exclusions, and a single inclusion, are returned unchanged.

    >>> from world.airspace.zones import make_cylinder
    >>> circles = [Zone(f"fence item {k}", "inclusion", make_cylinder(800.0 * k, 0.0, 500.0)) for k in range(2)]
    >>> union, = unite_inclusions(circles)
    >>> union.name, len(union.shape.rings), round(max(east for east, _ in union.shape.rings[0]))
    ('fence item 0 and 1 more', 1, 1300)
    """
    inclusions = [zone for zone in zones if zone.kind == "inclusion"]
    if len(inclusions) < 2:
        return tuple(zones)
    areas = []
    for zone in inclusions:
        if isinstance(zone.shape, Polygon):
            # A position is inside if it is inside an odd number of rings.
            areas.append(reduce(shapely.symmetric_difference, map(shapely.Polygon, zone.shape.rings)))
        else:
            angles = np.linspace(0.0, 2.0 * math.pi, _CIRCLE_CORNERS, endpoint=False)
            east = zone.shape.east + zone.shape.radius * np.cos(angles)
            north = zone.shape.north + zone.shape.radius * np.sin(angles)
            areas.append(shapely.Polygon(np.column_stack([east, north])))
    union = shapely.union_all(areas)
    rings = [
        [(east, north) for east, north in ring.coords]
        for part in shapely.get_parts(union)
        for ring in (part.exterior, *part.interiors)
    ]
    name = f"{inclusions[0].name} and {len(inclusions) - 1} more"
    exclusions = [zone for zone in zones if zone.kind != "inclusion"]
    return (Zone(name, "inclusion", make_polygon(rings)), *exclusions)
