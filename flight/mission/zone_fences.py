"""A scenario's zones as the fence that they are, and what of them a fence cannot hold."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Frame, MissionItem, on_grid
from world.airspace.zones import Cylinder, Ring, Zone, is_hole
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]

_CIRCLES = {
    "inclusion": Command.NAV_FENCE_CIRCLE_INCLUSION,
    "exclusion": Command.NAV_FENCE_CIRCLE_EXCLUSION,
}
_POLYGONS = {
    "inclusion": Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    "exclusion": Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
}


def fence_item(origin: GeoOrigin, command: Command, p1: float, position: Sequence[float] | Floats) -> MissionItem:
    """An item of a fence at a position (east, north, m); p1: corners of its polygon, or radius of its circle, m.

    >>> item = fence_item(GeoOrigin(36.5, -84.2), Command.NAV_FENCE_CIRCLE_EXCLUSION, 200.0, (0.0, 0.0))
    >>> item.params[0], round(item.lat_deg, 6)
    (200.0, 36.5)
    """
    lat, lon = to_geo(origin, float(position[0]), float(position[1]))
    params = (round(p1, 3), 0.0, 0.0, 0.0)
    return MissionItem(0, int(command), int(Frame.GLOBAL), params, on_grid(float(lat)), on_grid(float(lon)), 0.0)


def zone_fences(zones: Sequence[Zone], origin: GeoOrigin) -> tuple[list[MissionItem], list[str]]:
    """Fence items of zones, and notes for people on what a fence cannot hold.

    A cylinder is a circle and an outline a polygon.  A hole of an inclusion is an exclusion.  A hole of an exclusion is
    closed with it, and an inclusion of several parts has no fence: every inclusion counts.  No fence has a height.

    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> items, notes = zone_fences([zone], GeoOrigin(36.5, -84.2))
    >>> [(item.command, item.params[0]) for item in items], notes
    ([(5004, 200.0)], [])
    """
    items, closed, left_out = [], [], []
    for zone in zones:
        rings = () if isinstance(zone.shape, Cylinder) else zone.shape.rings
        holes = [ring for ring in rings if is_hole(ring)]
        if zone.kind == "inclusion" and len(rings) - len(holes) > 1:
            left_out.append(zone.name)
            continue
        if zone.kind == "exclusion" and holes:
            closed.append(zone.name)
        items += list(_zone_items(zone, origin))
    bands = [zone.name for zone in zones if zone.floor is not None or zone.ceiling is not None]
    notes = []
    if bands:
        notes.append(f"a fence has no floor and no ceiling: {_names(bands)} in the fence at every height")
    if closed:
        notes.append(f"a fence has no holes in what it excludes: {_names(closed)} in the fence without them")
    if left_out:
        notes.append(f"every inclusion of a fence counts: {_names(left_out)} left out, being of several parts")
    return items, notes


def _zone_items(zone: Zone, origin: GeoOrigin) -> Iterator[MissionItem]:
    if isinstance(zone.shape, Cylinder):
        yield fence_item(origin, _CIRCLES[zone.kind], zone.shape.radius, (zone.shape.east, zone.shape.north))
        return
    for ring in zone.shape.rings:
        if not is_hole(ring):
            yield from _ring_items(ring, _POLYGONS[zone.kind], origin)
        elif zone.kind == "inclusion":
            yield from _ring_items(ring, _POLYGONS["exclusion"], origin)


def _ring_items(ring: Ring, command: Command, origin: GeoOrigin) -> Iterator[MissionItem]:
    for corner in ring:
        yield fence_item(origin, command, float(len(ring)), corner)


def _names(names: list[str]) -> str:
    """Up to three names, and how many more."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more + (" is" if len(names) == 1 else " are")
