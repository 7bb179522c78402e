"""Convert the zones of a scenario file to its map, and make outlines to draw.

Start and destination are checked against the zones.
"""

import math
from collections.abc import Sequence

import numpy as np

from world.airspace.zone_kernels import ZoneRecords, edge_distance, height_outside_band, zone_records
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneLevel, is_hole, make_cylinder, make_polygon
from world.arrays import Floats
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_map
from world.scenario_tables import MAX_CORNERS, ZoneTable
from world.terrain import Terrain

# ----------------------------------------------------------------------
# Rings of latitudes and longitudes on a map: edges are straight in degrees, with extra corners where they bend.

# Largest distance between an edge that is straight in degrees and its straight pieces on the map, m; an edge along a
# parallel at 46 degrees bends by this over 2.2 km.
EDGE_BEND = 0.1
# Maximum number of pieces of an edge.
_MAX_PIECES = 2_000
# Maximum number of corners of all zones on a map, including the inserted corners.
MAX_MAP_CORNERS = 2_000_000


def ring_on_map(origin: GeoOrigin, corners: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """Convert a ring of corners (latitude, longitude), degrees, to corners (east, north), m.

    Between two corners a ring is straight in degrees, as in GeoJSON (RFC 7946, 3.1.1) and in the fences of autopilots.
    Corners are inserted where such an edge is not straight on the map. The longitude takes the shorter direction.
    Raises ValueError for edges so long that they need too many corners.

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
    midpoints = to_map(origin, lat + 0.5 * step_lat, lon + 0.5 * step_lon)
    bends = np.hypot(midpoints[0] - 0.5 * (east + np.roll(east, -1)), midpoints[1] - 0.5 * (north + np.roll(north, -1)))
    # The bend of a piece is proportional to the square of its length.
    piece_counts = np.clip(np.ceil(np.sqrt(bends / EDGE_BEND)), 1, _MAX_PIECES).astype(int)
    if piece_counts.sum() > MAX_CORNERS:
        raise ValueError(
            f"edges too long: {piece_counts.sum():,} corners on the map; at most {MAX_CORNERS:,} are allowed"
        )
    lats, lons = [], []
    for k, count in enumerate(piece_counts.tolist()):
        fractions = np.arange(count) / count
        lats.append(lat[k] + fractions * step_lat[k])
        lons.append(lon[k] + fractions * step_lon[k])
    east, north = to_map(origin, np.concatenate(lats), np.concatenate(lons))
    return list(zip(east.tolist(), north.tolist(), strict=True))


def add_corner_count(count: int, shape: Polygon | Cylinder) -> int:
    """Add the number of corners of a shape to a count of corners, and return the sum.

    Raises ValueError if the sum exceeds `MAX_MAP_CORNERS`.

    >>> add_corner_count(4, make_polygon([[(0.0, 0.0), (90.0, 0.0), (90.0, 90.0)]]))
    7
    >>> add_corner_count(4, Cylinder(0.0, 0.0, 9.0))
    4
    """
    count += 0 if isinstance(shape, Cylinder) else sum(map(len, shape.rings))
    if count > MAX_MAP_CORNERS:
        raise ValueError(f"all zones together then have {count:,} corners; at most {MAX_MAP_CORNERS:,} are allowed")
    return count


def make_zones(tables: Sequence[ZoneTable], source: str, origin: GeoOrigin, ground: Terrain | None) -> tuple[Zone, ...]:
    """Convert the zones of a scenario file to zones on its map.

    source: name of the file in messages.

    Raises ScenarioError for an invalid shape, and for a level above ground without terrain.
    """
    zones, corners = [], 0
    for k, table in enumerate(tables):
        label = f"{source}: zones[{k}] ({table.name})"
        try:
            rings_on_map = table.rings_m if table.polygon_m is None else [table.polygon_m]
            shape: Polygon | Cylinder
            if table.radius_m is not None and table.east_m is not None and table.north_m is not None:
                shape = make_cylinder(table.east_m, table.north_m, table.radius_m)
            elif table.radius_m is not None:
                east, north = to_map(origin, float(table.lat_deg or 0.0), float(table.lon_deg or 0.0))
                shape = make_cylinder(float(east), float(north), table.radius_m)
            elif rings_on_map is not None:
                shape = make_polygon([[(east, north) for east, north in ring] for ring in rings_on_map])
            else:
                rings_in_degrees = (table.rings_deg or []) if table.polygon_deg is None else [table.polygon_deg]
                shape = make_polygon([ring_on_map(origin, ring) for ring in rings_in_degrees])
            corners = add_corner_count(corners, shape)
        except ValueError as error:
            raise ScenarioError(f"{label}: {error}", file=source, field=f"zones[{k}]") from error
        floor = _make_level(table.floor_amsl_m, table.floor_agl_m)
        ceiling = _make_level(table.ceiling_amsl_m, table.ceiling_agl_m)
        zone = Zone(table.name, table.kind, shape, floor, ceiling)
        if zone.has_level_above_ground and ground is None:
            key = "floor_agl_m" if table.floor_agl_m is not None else "ceiling_agl_m"
            message = (
                f"{label}: {key}: requires terrain; name an elevation file (--terrain), or give the height as amsl"
            )
            raise ScenarioError(message, file=source, field=key, value=getattr(table, key))
        zones.append(zone)
    return tuple(zones)


# Distance from the area beyond which zones are omitted, m; a flight within the area does not come near them.
MAX_ZONE_DISTANCE = 20_000.0
# Length of a degree of latitude, m.
_DEGREE_LENGTH_M = 111_000.0


def select_near_zones(tables: Sequence[ZoneTable], source: str, origin: GeoOrigin, bounds: Floats) -> list[ZoneTable]:
    """Return the zones of a file that a flight in an area can meet.

    These are all inclusions, and the exclusions nearby.

    source: name of the file in messages.
    bounds: [[west, east], [south, north]] of the area, (2, 2) m.

    Exclusions within `MAX_ZONE_DISTANCE` of the area are nearby.

    Raises ScenarioError if an omitted zone has an invalid shape; `make_zones` checks the other zones.
    """
    zones_nearby = []
    for k, table in enumerate(tables):
        if table.kind == "inclusion" or _is_near_area(table, origin, bounds):
            zones_nearby.append(table)
            continue
        try:
            # For speed, degrees are multiplied by a constant length instead of projected on the map.
            rings = table.rings_deg if table.polygon_deg is None else [table.polygon_deg]
            if rings and rings[0]:
                centre_longitude = rings[0][0][1]
                centred_rings = [
                    [(lat, (lon - centre_longitude + 180.0) % 360.0 - 180.0) for lat, lon in ring] for ring in rings
                ]
                make_polygon(
                    [[(lon * _DEGREE_LENGTH_M, lat * _DEGREE_LENGTH_M) for lat, lon in ring] for ring in centred_rings]
                )
        except ValueError as error:
            raise ScenarioError(f"{source}: zones[{k}] ({table.name}): {error}", file=source, field="zones") from error
    return zones_nearby


def _is_near_area(table: ZoneTable, origin: GeoOrigin, bounds: Floats) -> bool:
    """Return True if a zone's bounding box is within `MAX_ZONE_DISTANCE` of an area.

    The result is also True for a zone whose table states positions in m, without latitudes and longitudes.

    bounds: [[west, east], [south, north]] of the area, (2, 2) m.
    """
    max_distance, corners = MAX_ZONE_DISTANCE, table.rings_deg if table.polygon_deg is None else [table.polygon_deg]
    if table.lat_deg is not None and table.lon_deg is not None:
        max_distance, corners = MAX_ZONE_DISTANCE + (table.radius_m or 0.0), [[[table.lat_deg, table.lon_deg]]]
    positions = np.array([corner for ring in corners or [] for corner in ring], dtype=np.float64)
    if not len(positions):
        return True
    spans = zip(to_map(origin, positions[:, 0], positions[:, 1]), bounds, strict=True)
    return all(
        coordinates.min() <= max_coordinate + max_distance and coordinates.max() >= min_coordinate - max_distance
        for coordinates, (min_coordinate, max_coordinate) in spans
    )


def _make_level(amsl: float | None, above_ground: float | None) -> ZoneLevel | None:
    """Make a floor or ceiling from its altitude AMSL or its height above ground, m; None if both are None."""
    if amsl is not None:
        return ZoneLevel(amsl, "amsl")
    return None if above_ground is None else ZoneLevel(above_ground, "ground")


def check_ends(zones: Sequence[Zone], source: str, ends: Sequence[tuple[str, Floats]], ground: Terrain | None) -> None:
    """Raise ScenarioError for a start or destination inside an exclusion or outside an inclusion.

    source: name of the file in messages.
    ends: start and destination, each as its key in the file and its position, (3,) m.
    """
    records = zone_records(zones)
    for key, point in ends:
        zone = _first_violated_by_records(zones, records, point, ground)
        if zone is not None:
            location_text = "inside this exclusion zone" if zone.kind == "exclusion" else "outside this inclusion zone"
            raise ScenarioError.at(source, "zones", zone.name, f"{key} lies {location_text}")


def first_violated_zone(zones: Sequence[Zone], point: Floats, ground: Terrain | None) -> Zone | None:
    """Return the first zone that a position violates, or None if it violates none.

    point: (3,) m.

    If the ground height is unknown, the position is assumed to be within limits that are heights above ground.

    >>> from world.airspace.zones import Cylinder
    >>> mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 200.0), ceiling=ZoneLevel(300.0, "amsl"))
    >>> [first_violated_zone([mast], np.array([0.0, 0.0, up]), None) is mast for up in (290.0, 310.0)]
    [True, False]
    """
    return _first_violated_by_records(zones, zone_records(zones), point, ground)


def _first_violated_by_records(
    zones: Sequence[Zone], records: ZoneRecords, point: Floats, ground: Terrain | None
) -> Zone | None:
    """Return the result of `first_violated_zone` for zones that are already converted to records.

    records: the zones as `zone_records` converts them.
    """
    east, north, up = (float(value) for value in point)
    ground_height = math.nan if ground is None else float(ground.height(east, north))
    for k, zone in enumerate(zones):
        distance = edge_distance(records, k, east, north)
        height_outside = height_outside_band(records.zones[k], up, ground_height)
        is_inside = distance <= 0.0 and not height_outside > 0.0
        if is_inside == (zone.kind == "exclusion"):
            return zone
    return None


# ----------------------------------------------------------------------
# Outlines of zones to draw: closed rings on the map, and the heights of floor and ceiling along them.

# Number of corners of a drawn circle.
CIRCLE_CORNERS = 72


def zone_rings(zone: Zone) -> tuple[Floats, ...]:
    """Return the closed rings of a zone for drawing: arrays (k, 2) of east and north, m.

    Holes run in the opposite direction to outlines.

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
    """Return the separate parts of a zone, each as (outline, *holes).

    The rings are as `zone_rings` returns them.

    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> [len(part) for part in zone_parts(zone)]
    [1]
    """
    if isinstance(zone.shape, Cylinder):
        return [zone_rings(zone)]
    rings = list(zip(zone_rings(zone), map(is_hole, zone.shape.rings), strict=True))
    # Smallest first: a hole belongs to the smallest outline around it.
    outlines = sorted(
        (ring for ring, is_ring_hole in rings if not is_ring_hole),
        key=lambda ring: abs(float((ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]).sum())),
    )
    # The last corner of a closed ring repeats the first.
    shapes = zone_records(
        [
            Zone("", "exclusion", Polygon((tuple((east, north) for east, north in ring[:-1].tolist()),)))
            for ring in outlines
        ]
    )
    parts: list[list[Floats]] = [[ring] for ring in outlines]
    for ring, is_ring_hole in rings:
        if is_ring_hole:
            enclosing_outlines = (k for k in range(len(outlines)) if edge_distance(shapes, k, *ring[0]) <= 0.0)
            parts[next(enclosing_outlines)].append(ring)
    return [tuple(part) for part in parts]


def level_altitudes(level: ZoneLevel | None, ground: Floats, default: float) -> Floats:
    """Return the altitude of a floor or a ceiling above each point of the ground, m AMSL, (n,).

    ground: altitudes of the ground, m AMSL, (n,).
    default: altitude for a level of None, m AMSL.

    >>> level_altitudes(ZoneLevel(120.0, "ground"), np.array([10.0, 30.0]), 0.0).tolist()
    [130.0, 150.0]
    """
    if level is None:
        return np.full(len(ground), default)
    return ground + level.height if level.datum == "ground" else np.full(len(ground), level.height)


def zone_walls(zone: Zone, terrain: Terrain | None, default_floor: float, default_ceiling: float) -> list[Floats]:
    """Return the walls of a zone for drawing: one array (k, 2, 3) m for each ring.

    The array has the lower and the upper end of the wall at each of the k corners.

    default_floor: altitude of the ground where it is unknown, m AMSL.
    default_ceiling: altitude of the upper end for a zone without a ceiling, m AMSL.

    A floor below the ground is raised to the ground.

    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0), ceiling=ZoneLevel(120.0, "amsl"))
    >>> zone_walls(zone, None, 0.0, 900.0)[0][0].tolist()
    [[200.0, 500.0, 0.0], [200.0, 500.0, 120.0]]
    """
    walls = []
    for ring in zone_rings(zone):
        ground = np.full(len(ring), default_floor) if terrain is None else terrain.height(ring[:, 0], ring[:, 1])
        ground = np.where(np.isfinite(ground), ground, default_floor)
        bottom = np.maximum(level_altitudes(zone.floor, ground, -np.inf), ground)
        top = np.maximum(level_altitudes(zone.ceiling, ground, default_ceiling), bottom)
        walls.append(np.stack([np.column_stack([ring, bottom]), np.column_stack([ring, top])], axis=1))
    return walls
