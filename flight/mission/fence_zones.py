"""A mission's own fence as zones of airspace: the one place where its latitudes and longitudes become metres."""

from flight.mission.fences import INCLUSIONS, POLYGONS, fence_shapes
from flight.mission.items import MissionItem
from world.airspace.ring_on_map import ring_on_map
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneKind, make_cylinder, make_polygon
from world.errors import MissionError
from world.frames import GeoOrigin, to_map


def fence_zones(fences: tuple[MissionItem, ...], origin: GeoOrigin, source: str = "fence") -> tuple[Zone, ...]:
    """Zones of a fence's items 5001..5004, without floor and ceiling: MAVLink's fences have none.

    source: names the mission in messages.  Each zone is named by its first item.  Raises MissionError for a polygon of
    fewer corners than it counts, and for a shape that is none.

    >>> from flight.mission.items import Command, Frame
    >>> radius = (500.0, 0.0, 0.0, 0.0)
    >>> circle = MissionItem(0, Command.NAV_FENCE_CIRCLE_INCLUSION, Frame.GLOBAL, radius, 36.5, -84.2, 0.0)
    >>> zone, = fence_zones((circle,), GeoOrigin(36.5, -84.2))
    >>> zone.name, zone.kind, zone.shape.radius
    ('fence item 0', 'inclusion', 500.0)
    """
    zones = []
    shape: Polygon | Cylinder
    for corners in fence_shapes(fences, source):
        first = corners[0]
        try:
            if first.command in POLYGONS:
                shape = make_polygon([ring_on_map(origin, [(corner.lat_deg, corner.lon_deg) for corner in corners])])
            else:
                east, north = to_map(origin, first.lat_deg, first.lon_deg)
                shape = make_cylinder(float(east), float(north), first.params[0])
        except ValueError as error:
            item = f"fence item {first.seq}"
            raise MissionError(f"{source}: {item}: {error}", file=source, field=item) from error
        kind: ZoneKind = "inclusion" if first.command in INCLUSIONS else "exclusion"
        zones.append(Zone(f"fence item {first.seq}", kind, shape))
    return tuple(zones)
