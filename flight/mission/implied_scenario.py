"""Build a scenario around a mission file that came without one."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight.mission.items import Mission
from flight.mission.itinerary import Itinerary, Position, RoutePoint, make_itinerary
from flight.mission.placing import MAX_ALTITUDE_M, PlacedMission, place_stops, project_stops, rally_stops
from world.arrays import Floats
from world.errors import MissionError, TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.raster import coverage_text, open_raster, read_terrain
from world.raster_file import RasterFile
from world.scenario import GROUND_BUFFER, Scenario, scenario_from_spec
from world.scenario_tables import MAP_EXTENT, AreaTable, EndTable, FlightTable, OriginTable, ScenarioFile, TerrainTable
from world.terrain import Terrain

# Margin of the area around the mission's positions, and of the ceiling above its highest, m.
AREA_MARGIN_M = 2000.0
# Largest distance between home and the first position, m: ground stations write a default position if no home was set,
# so that a more distant home does not belong to the mission.
_MAX_HOME_DISTANCE_M = 100_000.0


@dataclass(frozen=True, slots=True)
class ImpliedScenario:
    """Scenario built around a mission, and the placed mission."""

    scenario: Scenario
    placed: PlacedMission


def implied_scenario(
    mission: Mission, terrain_path: str | None, flight: FlightTable | None = None, *, vertical_legs: bool = False
) -> ImpliedScenario:
    """Build a scenario around a mission that has none: an area, no threats, and default limits.

    The scenario's ``external`` is True.

    terrain_path: an elevation file or a built-in name; None for no terrain.
    flight: the scenario's [flight] table; None for the defaults.
    vertical_legs: see `flight.mission.placing.place_stops`.

    The area is the bounding box of the mission's positions and loiters, home and rally points, with a margin of 2 km. A
    home or rally point more than 100 km from the start of the mission is left out.

    Start and destination are the first and last positions of the mission. A scenario requires them to be above the
    ground, so they are raised to 1 m above it if necessary. The route and its verdict keep the mission's altitudes.

    Raises MissionError if the mission cannot be placed on the map. Raises TerrainError if the ground is unknown at all
    positions of the mission.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = [
    ...     MissionItem(k, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, lat, -84.2, 700.0)
    ...     for k, lat in enumerate((36.50, 36.51), 1)
    ... ]
    >>> scenario = implied_scenario(Mission(None, tuple(items)), terrain_path=None).scenario
    >>> scenario.external, scenario.bounds.round().tolist()
    (True, [[-2000.0, 2000.0], [-2000.0, 3110.0]])
    """
    flight = flight or FlightTable(aircraft_by_default=True)
    itinerary = make_itinerary(mission)
    origin = mission_origin(mission, itinerary.stops)
    points = project_stops(mission.source, itinerary.stops, origin)
    area = _mission_area(mission, itinerary, origin, points)
    terrain, table = _load_terrain(terrain_path, origin, area, points)
    placed_mission = place_stops(mission, origin, terrain, itinerary=itinerary, vertical_legs=vertical_legs)
    max_altitude = max(placed_stop.map_position[2] for placed_stop in placed_mission.stops)
    if terrain is not None:
        max_altitude = max(max_altitude, float(np.nanmax(terrain.heights)))
    file_name = re.split(r"[/\\]", mission.source)[-1]
    name = "".join(character if character.isprintable() else "?" for character in file_name)
    spec = ScenarioFile(
        name=name[:100] or "mission",
        description="Made around a mission that came without a scenario",
        origin=OriginTable(lat_deg=origin.lat_deg, lon_deg=origin.lon_deg),
        terrain=table,
        area=AreaTable(
            east_m=area[0].tolist(),
            north_m=area[1].tolist(),
            ceiling_amsl_m=min(max_altitude + AREA_MARGIN_M, MAX_ALTITUDE_M),
        ),
        start=_end_table_above_ground(placed_mission.stops[0].map_position, terrain),
        destination=_end_table_above_ground(placed_mission.stops[-1].map_position, terrain),
        flight=flight,
    )
    return ImpliedScenario(scenario_from_spec(spec, mission.source, ground=terrain, external=True), placed_mission)


def mission_origin(mission: Mission, stops: tuple[RoutePoint, ...]) -> GeoOrigin:
    """Return the map origin for a mission without a scenario: home, or the mission's first position.

    stops: stops of the mission's itinerary.

    Home is used if it is within 100 km of the first position. Raises MissionError beyond 89 degrees of latitude.
    """
    first_stop = stops[0]
    positions = [item for item in mission.items if item.has_position and item.seq >= first_stop.item]
    lat, lon = (positions[0].lat_deg, positions[0].lon_deg) if positions else (first_stop.lat_deg, first_stop.lon_deg)
    if abs(lat) > 89.0:
        allowed = "a mission is flown within -89..89 degrees"
        message = f"{mission.source}: latitude {lat:.7f}: {allowed}"
        raise MissionError(message, file=mission.source, field="latitude", value=lat, allowed=allowed)
    origin = GeoOrigin(lat, lon)
    home = mission.home
    if home is not None and abs(home.lat_deg) <= 89.0:
        east, north = to_map(origin, home.lat_deg, home.lon_deg)
        if math.hypot(float(east), float(north)) <= _MAX_HOME_DISTANCE_M:
            origin = GeoOrigin(home.lat_deg, home.lon_deg)
    return origin


def _mission_area(mission: Mission, itinerary: Itinerary, origin: GeoOrigin, points: Floats) -> Floats:
    """Return the area around a mission, (2, 2) [[west, east], [south, north]], m.

    points: positions of the mission's stops, (n, 2) m.
    """
    stops, home = itinerary.stops, mission.home
    margin = AREA_MARGIN_M + max(abs(stop.loiter.radius) if stop.loiter is not None else 0.0 for stop in stops)
    # A return flies to home or a rally point from anywhere on the route.
    targets = [(stop.lat_deg, stop.lon_deg) for stop in rally_stops(mission)]
    targets += [] if home is None else [(home.lat_deg, home.lon_deg)]
    lats, lons = np.reshape(targets, (-1, 2)).T
    targets_on_map = np.stack(to_map(origin, lats, lons), axis=1)
    is_near = np.hypot(*(targets_on_map - points[0]).T) <= _MAX_HOME_DISTANCE_M
    positions = np.vstack([points, targets_on_map[is_near]])
    area = np.stack([positions.min(axis=0), positions.max(axis=0)], axis=1)
    return np.clip(area + np.array([-margin, margin]), -MAP_EXTENT, MAP_EXTENT)


def _load_terrain(
    path: str | None, origin: GeoOrigin, area: Floats, points: Floats
) -> tuple[Terrain | None, TerrainTable]:
    """Read the terrain of an area; return it with the scenario's [terrain] table.

    path: elevation file or built-in name; None for no terrain.
    area: [[west, east], [south, north]], (2, 2) m.
    points: positions of the mission's stops, (n, 2) m.

    Raises TerrainError if the ground is unknown at all of these positions, as in the file of another region.
    """
    if path is None:
        return None, TerrainTable(kind="none")
    raster = open_raster(path)
    file = Path(path)
    table = TerrainTable(kind="dem", path=str(file.resolve()) if file.is_file() else path, sha256=raster.sha256)
    lat, lon = to_geo(origin, *points.T)
    if _covers_any(raster, lat, lon):
        terrain = read_terrain(raster, origin, area, GROUND_BUFFER)
        if np.isfinite(terrain.height(points[:, 0], points[:, 1])).any():
            return terrain, table
    positions_text = f"latitude {lat.min():.4f}..{lat.max():.4f}, longitude {lon.min():.4f}..{lon.max():.4f}"
    swap_text = (
        ". With latitude and longitude swapped, the mission would lie in this terrain"
        if _covers_any(raster, lon, lat)
        else ""
    )
    raise TerrainError(
        f"{path}: no data at any position of the mission, which flies to {positions_text};"
        f" the terrain covers {coverage_text(raster)}{swap_text}",
        file=path,
    )


def _covers_any(raster: RasterFile, lat: Floats, lon: Floats) -> bool:
    """Return True if a raster covers any of some positions; lat, lon: degrees, (n,)."""
    (cols, rows), (row_count, col_count) = raster.to_pixels(lon, lat), raster.shape
    # False for a position that the file's coordinate system cannot express (NaN or inf).
    return bool(((cols >= 0.0) & (cols <= col_count - 1.0) & (rows >= 0.0) & (rows <= row_count - 1.0)).any())


def _end_table_above_ground(position: Position, terrain: Terrain | None) -> EndTable:
    """Return the scenario table of a start or destination, raised to at least 1 m above the ground."""
    east, north, amsl = position
    if terrain is not None:
        amsl = max(amsl, float(terrain.height(east, north)) + 1.0)
    return EndTable(east_m=east, north_m=north, amsl_m=amsl)
