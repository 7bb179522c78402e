"""The zones of a scenario on its map: shapes checked, ends on their right sides, and outlines to be drawn."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_kernels import ZoneRecords, edge_distance, outside_band, zone_records
from world.airspace.zones import Cylinder, Polygon, Ring, Zone, ZoneLevel, is_hole, make_cylinder, make_polygon
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_map
from world.scenario_tables import ZoneTable
from world.terrain import Terrain

Floats = NDArray[np.float64]

# ----------------------------------------------------------------------
# Rings of latitudes and longitudes on a map: their edges, straight in degrees, with more corners where they bend.

# m.  An edge that is straight in degrees leaves the straight line between its corners on the map by this at most: one
# along a parallel at 46 degrees bends by so much over 2.2 km.
EDGE_BEND = 0.1
# Pieces that an edge is cut into at most.
_MAX_PIECES = 2_000


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
    pieces = np.clip(np.ceil(np.sqrt(off / EDGE_BEND)), 1, _MAX_PIECES).astype(int)
    lats, lons = [], []
    for k, count in enumerate(pieces.tolist()):
        shares = np.arange(count) / count
        lats.append(lat[k] + shares * step_lat[k])
        lons.append(lon[k] + shares * step_lon[k])
    east, north = to_map(origin, np.concatenate(lats), np.concatenate(lons))
    return list(zip(east.tolist(), north.tolist(), strict=True))


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
            message = f"{label}: {key}: there is no terrain to count it from: name one (--terrain), or give it as amsl"
            raise ScenarioError(message, file=source, field=key, value=getattr(table, key))
        zones.append(zone)
    return tuple(zones)


# m.  No flight that stays in its area comes near a zone beyond this.
FAR = 20_000.0
# m.  A degree of latitude.
_METRES = 111_000.0


def near_zones(tables: Sequence[ZoneTable], source: str, origin: GeoOrigin, bounds: Floats) -> list[ZoneTable]:
    """The zones of a file that a flight may meet: inclusions, and exclusions within `FAR` of the area.

    source: names the file in messages.  bounds: (2, 2) m, west and east, south and north of the area.
    Raises ScenarioError for a shape that is none among those that are left out; `make_zones` looks at the others.
    """
    near = []
    for k, table in enumerate(tables):
        if table.kind == "inclusion" or _is_near(table, origin, bounds):
            near.append(table)
            continue
        try:
            _check_far(table)
        except ValueError as error:
            raise ScenarioError(f"{source}: zones[{k}] ({table.name}): {error}", file=source, field="zones") from error
    return near


def _check_far(table: ZoneTable) -> None:
    """Raise ValueError for rings in degrees that are no polygon; their shape on the map is not asked for."""
    rings = table.rings_deg if table.polygon_deg is None else [table.polygon_deg]
    if rings and rings[0]:
        middle = rings[0][0][1]
        about = [[(lat, (lon - middle + 180.0) % 360.0 - 180.0) for lat, lon in ring] for ring in rings]
        make_polygon([[(lon * _METRES, lat * _METRES) for lat, lon in ring] for ring in about])


def _is_near(table: ZoneTable, origin: GeoOrigin, bounds: Floats) -> bool:
    reach, corners = FAR, table.rings_deg if table.polygon_deg is None else [table.polygon_deg]
    if table.lat_deg is not None and table.lon_deg is not None:
        reach, corners = FAR + (table.radius_m or 0.0), [[[table.lat_deg, table.lon_deg]]]
    places = np.array([corner for ring in corners or [] for corner in ring], dtype=np.float64)
    if not len(places):
        return True
    spans = zip(to_map(origin, places[:, 0], places[:, 1]), bounds, strict=True)
    return all(at.min() <= high + reach and at.max() >= low - reach for at, (low, high) in spans)


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


# ----------------------------------------------------------------------
# Outlines of zones to be drawn: closed rings on the map, and the heights of floor and ceiling along them.

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
