"""Convert the positions in a scenario file to map positions, and check them.

These are start, destination, threats and others.
"""

import math

import numpy as np

from world.arrays import Floats
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_geo, to_map
from world.scenario_tables import PointTable, PositionTable, ThreatTable
from world.terrain import Terrain
from world.threats import Threats, threat_label


def map_coordinates(table: PositionTable, origin: GeoOrigin) -> tuple[float, float]:
    """Return the map position (east, north, m) that a table states in metres or in degrees."""
    if table.east_m is not None and table.north_m is not None:
        return table.east_m, table.north_m
    east, north = to_map(origin, float(table.lat_deg or 0.0), float(table.lon_deg or 0.0))
    return float(east), float(north)


def map_position(table: PointTable, key: str, source: str, origin: GeoOrigin, ground: Terrain | None) -> Floats:
    """Return the position that a table states, (3,) m: east, north, altitude AMSL.

    key, source: names of the table and its file in messages.

    A stated height above ground is added to the terrain height. Raises ScenarioError if there is no terrain.
    """
    east, north = map_coordinates(table, origin)
    if table.amsl_m is not None:
        return np.array([east, north, table.amsl_m])
    ground_height = float(ground.height(east, north)) if ground is not None else math.nan
    if math.isnan(ground_height):
        lat, lon = to_geo(origin, east, north)
        terrain = "no terrain there" if ground is None else f"no terrain there ({ground.source} has no data)"
        raise ScenarioError(
            f"{source}: {key}: east {east:.0f} m, north {north:.0f} m (latitude {float(lat):.5f}, longitude"
            f" {float(lon):.5f}): {terrain} to measure a height from; give amsl_m",
            file=source,
            field=key,
        )
    return np.array([east, north, ground_height + (table.height_m or 0.0)])


def check_in_area(key: str, point: Floats, source: str, bounds: Floats, origin: GeoOrigin) -> None:
    """Raise ScenarioError for a position outside an area; the message states the distance from the area.

    key, source: names of the point and its file in messages.
    point: (2,) or (3,) m.
    bounds: [[west, east], [south, north]] of the area, (2, 2) m.
    """
    for axis, name in enumerate(("east", "north")):
        min_coordinate, max_coordinate = bounds[axis]
        if not min_coordinate <= point[axis] <= max_coordinate:
            outside = max(min_coordinate - point[axis], point[axis] - max_coordinate)
            outside_text = f"{outside:.1f}".removesuffix(".0")
            lat, lon = to_geo(origin, bounds[0, [0, 1, 0, 1]], bounds[1, [0, 0, 1, 1]])
            area_text = f"latitude {lat.min():.4f}..{lat.max():.4f}, longitude {lon.min():.4f}..{lon.max():.4f}"
            allowed = (
                f"{outside_text} m outside the area, which reaches from {min_coordinate:.0f} to {max_coordinate:.0f} m"
                f" (the area covers {area_text})"
            )
            raise ScenarioError.at(source, key, float(point[axis]), allowed, shown=f"{name} {point[axis]:.0f} m")


def check_altitude(key: str, point: Floats, source: str, floor: float, ceiling: float, ground: Terrain | None) -> None:
    """Raise ScenarioError for a start or destination in the ground or outside the area's altitudes.

    key, source: names of the point and its file in messages.
    point: (3,) m.
    floor, ceiling: lowest and highest altitude of the area, m AMSL.
    """
    amsl = f"{point[2]:.0f} m AMSL"
    if not floor <= point[2] <= ceiling:
        limit_text = f"above the ceiling, {ceiling:.0f}" if point[2] > ceiling else f"below the floor, {floor:.0f}"
        allowed = f"{limit_text} m AMSL"
        raise ScenarioError.at(source, key, float(point[2]), allowed, shown=amsl)
    check_above_ground(key, point, source, ground)


def check_above_ground(key: str, point: Floats, source: str, ground: Terrain | None) -> None:
    """Raise ScenarioError for a point that is not above the terrain.

    A point over unknown terrain is accepted.

    key, source: names of the point and its file in messages.
    point: (3,) m.
    """
    ground_height = float(ground.height(point[0], point[1])) if ground is not None else math.nan
    if point[2] <= ground_height:
        allowed = f"not above the terrain, which is at {ground_height:.0f} m"
        raise ScenarioError.at(source, key, float(point[2]), allowed, shown=f"{point[2]:.0f} m AMSL")


def make_threats(tables: list[ThreatTable], source: str, origin: GeoOrigin, ground: Terrain | None) -> Threats:
    """Convert the threats of a scenario file to threats on the map.

    source: name of the file in messages.
    ground: terrain; None if unknown.

    A threat without a height is on the ground. Raises ScenarioError for a threat without an altitude AMSL at a position
    without terrain.
    """
    positions = np.zeros((len(tables), 3))
    for k, table in enumerate(tables):
        placed_table = (
            table if table.amsl_m is not None else table.model_copy(update={"height_m": table.height_m or 0.0})
        )
        positions[k] = map_position(placed_table, f"threats[{k}]", source, origin, ground)
    return Threats(
        names=tuple(threat_label(table.name or "", k) for k, table in enumerate(tables)),
        position=positions,
        kill_radius=np.array([table.kill_radius_m or 0.0 for table in tables]),
        detection_radius=np.array([table.detection_radius_m or 0.0 for table in tables]),
        kill_scale=np.array([table.kill_scale_m or 0.0 for table in tables]),
        detection_scale=np.array([table.detection_scale_m or 0.0 for table in tables]),
    )
