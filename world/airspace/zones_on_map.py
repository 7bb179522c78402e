"""The zones of a scenario on its map: shapes checked, and its ends on their right sides."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from world.airspace.ring_on_map import ring_on_map
from world.airspace.zone_kernels import ZoneRecords, edge_distance, outside_band, zone_records
from world.airspace.zone_tables import ZoneTable
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneLevel, make_cylinder, make_polygon
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_map
from world.terrain import Terrain

Floats = NDArray[np.float64]


def make_zones(tables: Sequence[ZoneTable], source: str, origin: GeoOrigin, ground: Terrain | None) -> tuple[Zone, ...]:
    """Place the zones of a scenario file on its map.

    source: names the file in messages.  Raises ScenarioError for a shape that is none, and for a level above ground
    where there is no terrain.
    """
    zones = []
    for k, table in enumerate(tables):
        label = f"{source}: zones[{k}] ({table.name})"
        try:
            shape = _shape(table, origin)
        except ValueError as error:
            raise ScenarioError(f"{label}: {error}", file=source, field=f"zones[{k}]") from error
        floor = _level(table.floor_amsl_m, table.floor_agl_m)
        ceiling = _level(table.ceiling_amsl_m, table.ceiling_agl_m)
        zone = Zone(table.name, table.kind, shape, floor, ceiling)
        if zone.above_ground and ground is None:
            key = "floor_agl_m" if table.floor_agl_m is not None else "ceiling_agl_m"
            message = f"{label}: {key}: there is no terrain to count it from; give it as amsl"
            raise ScenarioError(message, file=source, field=key, value=getattr(table, key))
        zones.append(zone)
    return tuple(zones)


def _shape(table: ZoneTable, origin: GeoOrigin) -> Polygon | Cylinder:
    if table.radius_m is not None:
        east, north = table.east_m, table.north_m
        if east is None or north is None:
            place = to_map(origin, float(table.lat_deg or 0.0), float(table.lon_deg or 0.0))
            east, north = float(place[0]), float(place[1])
        return make_cylinder(east, north, table.radius_m)
    metres = table.rings_m if table.polygon_m is None else [table.polygon_m]
    if metres is not None:
        return make_polygon([[(east, north) for east, north in ring] for ring in metres])
    degrees = (table.rings_deg or []) if table.polygon_deg is None else [table.polygon_deg]
    return make_polygon([ring_on_map(origin, ring) for ring in degrees])


def _level(amsl: float | None, above_ground: float | None) -> ZoneLevel | None:
    if amsl is not None:
        return ZoneLevel(amsl, "amsl")
    return None if above_ground is None else ZoneLevel(above_ground, "ground")


def check_ends(zones: Sequence[Zone], source: str, ends: Sequence[tuple[str, Floats]], ground: Terrain | None) -> None:
    """Raise ScenarioError for an end inside an exclusion, or outside an inclusion.

    ends: of each its key in the file, and its position (3,) m.
    """
    records = zone_records(zones)
    for key, point in ends:
        broken = _first_broken(zones, records, point, ground)
        if broken is not None:
            side = "inside the exclusion" if broken.kind == "exclusion" else "outside the inclusion"
            raise ScenarioError.at(source, "zones", broken.name, f"{key} lies {side}")


def zone_broken_at(zones: Sequence[Zone], point: Floats, ground: Terrain | None) -> Zone | None:
    """The first zone that a position (3,) m violates, None for none; unknown ground puts it within a band.

    >>> from world.airspace.zones import Cylinder
    >>> mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 200.0), ceiling=ZoneLevel(300.0, "amsl"))
    >>> [zone_broken_at([mast], np.array([0.0, 0.0, up]), None) is mast for up in (290.0, 310.0)]
    [True, False]
    """
    return _first_broken(zones, zone_records(zones), point, ground)


def _first_broken(zones: Sequence[Zone], records: ZoneRecords, point: Floats, ground: Terrain | None) -> Zone | None:
    east, north, up = (float(value) for value in point)
    under = math.nan if ground is None else float(ground.height(east, north))
    for k, zone in enumerate(zones):
        away = edge_distance(records, k, east, north)
        off = outside_band(records.zones[k], up, under)
        inside = away <= 0.0 and not off > 0.0
        if inside == (zone.kind == "exclusion"):
            return zone
    return None
