"""Make the local map and the ground around one flight, in the form that the compiled loop needs.

JSBSim provides latitudes and longitudes; all other code uses positions on the map.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flight.simulation.setup import FlightSetup
from world.arrays import Floats, Heights
from world.errors import FlightError
from world.frames import GeoOrigin, PolyMap, fit_polymap, to_geo, to_map
from world.terrain import Terrain

# Margin of the local map around the area and the route, m.
MAP_MARGIN_M = 5000.0
# Maximum errors of the local map, m and rad.
MAX_MAP_ERRORS = (0.01, 1e-6)


@dataclass(frozen=True, slots=True)
class LocalMap:
    """Map projection for compiled code: polynomials that are fitted around one flight.

    position: from latitude and longitude, rad, to east and north, m.
    angle: from latitude and longitude, rad, to the grid convergence, rad, which is the map course of true north, and 0.
    center_longitude: longitude of the map's center, rad; longitudes are normalised to within pi of it.
    """

    position: PolyMap
    angle: PolyMap
    center_longitude: float

    @staticmethod
    def around(setup: FlightSetup) -> "LocalMap":
        """Fit a local map around the area and the route, with a margin of `MAP_MARGIN_M`.

        The error is 0.1 mm and 1e-9 rad on areas up to 600 km wide. Raises FlightError if the map cannot be fitted, as
        for an area around a pole.
        """
        points = np.concatenate([setup.route.positions[:, :2], setup.scenario.bounds.T])
        min_corner, max_corner = points.min(axis=0) - MAP_MARGIN_M, points.max(axis=0) + MAP_MARGIN_M
        return _fit_local_map(
            setup.scenario.origin, tuple(min_corner.tolist()), tuple(max_corner.tolist()), setup.mission.source
        )

    def convergence(self, lat_deg: float, lon_deg: float) -> float:
        """Return the grid convergence at a position, rad: the map course of true north."""
        lon = self.center_longitude + math.remainder(math.radians(lon_deg) - self.center_longitude, 2.0 * math.pi)
        return float(self.angle(math.radians(lat_deg), lon)[0])


@lru_cache(maxsize=4)
def _fit_local_map(
    origin: GeoOrigin, min_corner: tuple[float, float], max_corner: tuple[float, float], source: str
) -> LocalMap:
    """Fit a local map over a rectangle of the map; the flights of a campaign share it.

    min_corner, max_corner: corners of the rectangle, east and north, m.
    source: file of the mission, for messages.

    Raises FlightError if the map cannot be fitted.
    """
    outline = np.array(
        [
            [east, north]
            for east in (min_corner[0], 0.5 * (min_corner[0] + max_corner[0]), max_corner[0])
            for north in (min_corner[1], max_corner[1])
        ]
    )
    lat, lon = (np.radians(values) for values in to_geo(origin, outline[:, 0], outline[:, 1]))
    # Longitudes relative to the origin, so that an area may include the 180th meridian.
    origin_longitude = math.radians(origin.lon_deg)
    lon = origin_longitude + (lon - origin_longitude + math.pi) % (2.0 * math.pi) - math.pi
    bounds = np.array([[lat.min(), lat.max()], [lon.min(), lon.max()]])
    if not (np.isfinite(bounds).all() and np.ptp(bounds[1]) < math.pi):
        raise FlightError(f"{source}: the area contains a pole", file=source)

    def position(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """Return the map position of a latitude and longitude (rad), m."""
        return to_map(origin, np.degrees(latitude), np.degrees(longitude))

    def angle(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """Return the map course of true north at a latitude and longitude (rad), rad, and 0."""
        step = 1e-5
        east0, north0 = position(latitude - step, longitude)
        east1, north1 = position(latitude + step, longitude)
        return np.arctan2(east1 - east0, north1 - north0), np.zeros_like(latitude)

    center_longitude = float((bounds[1, 0] + bounds[1, 1]) / 2)
    local = LocalMap(fit_polymap(position, bounds, 1e-4), fit_polymap(angle, bounds, 1e-9), center_longitude)
    if not (local.position.residual <= MAX_MAP_ERRORS[0] and local.angle.residual <= MAX_MAP_ERRORS[1]):
        raise FlightError(
            f"{source}: the area is too large to fly in: its map has an error "
            f"of {local.position.residual:.2g} m; {MAX_MAP_ERRORS[0]:g} m is allowed",
            file=source,
        )
    return local


class Ground:
    """Terrain for the compiled tick; without terrain, a raster without data.

    known: True if there is terrain.
    heights: altitudes of the ground, m, (rows, columns); NaN where unknown.
    to_pixel: transformation from map positions (east, north) to column and row of ``heights``.
    """

    def __init__(self, terrain: Terrain | None) -> None:
        self.known = terrain is not None
        self.terrain = terrain
        self.heights: Heights
        if terrain is None:
            self.heights, self.to_pixel = np.full((2, 2), np.nan, dtype=np.float32), _map_outside_raster()
            # Lock it like a terrain's array, because locked arrays are a different type for compiled code.
            self.heights.setflags(write=False)
        else:
            self.heights, self.to_pixel = terrain.heights, terrain.to_pixel

    def height(self, east: float, north: float) -> float:
        """Return the ground altitude at a map position, m; NaN if unknown."""
        return math.nan if self.terrain is None else float(self.terrain.height(east, north))


def _map_outside_raster() -> PolyMap:
    """Return a map from positions to pixels that stands for missing terrain: every pixel is outside any raster."""

    def outside_pixel(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return a pixel outside any raster for each position."""
        return np.full_like(x, -9.0), np.full_like(y, -9.0)

    return fit_polymap(outside_pixel, [[-1.0, 1.0], [-1.0, 1.0]], 1e-6)
