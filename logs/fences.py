"""Geofences of a mission: is a place inside every inclusion and outside every exclusion."""

import math

import numpy as np

from flight.mission import Command, MissionItem
from world.frames import GeoOrigin, to_map

_POLYGONS = (Command.NAV_FENCE_POLYGON_INCLUSION, Command.NAV_FENCE_POLYGON_EXCLUSION)
_INSIDE = (Command.NAV_FENCE_POLYGON_INCLUSION, Command.NAV_FENCE_CIRCLE_INCLUSION)


def fence_problem(fences: tuple[MissionItem, ...], origin: GeoOrigin, east: float, north: float) -> str | None:
    """Which fence a place (m) breaks, or None.

    fences: items 5001..5004, a polygon's corners together.  Inclusions count together: a place must be in all of them.
    """
    k = 0
    while k < len(fences):
        item = fences[k]
        count = int(item.params[0]) if item.command in _POLYGONS else 1
        shape = fences[k : k + max(1, count)]
        lat, lon = [corner.lat_deg for corner in shape], [corner.lon_deg for corner in shape]
        corners_east, corners_north = to_map(origin, lat, lon)
        if item.command in _POLYGONS:
            inside = _in_polygon(np.asarray(corners_east), np.asarray(corners_north), east, north)
            name = "polygon"
        else:
            inside = math.hypot(east - float(corners_east[0]), north - float(corners_north[0])) <= item.params[0]
            name = f"circle of {item.params[0]:.0f} m"
        if inside != (item.command in _INSIDE):
            return f"{'outside an inclusion' if not inside else 'inside an exclusion'} {name} (fence item {item.seq})"
        k += len(shape)
    return None


def _in_polygon(corners_east: np.ndarray, corners_north: np.ndarray, east: float, north: float) -> bool:
    """Whether a place lies in a polygon, by the crossings of a ray to the east."""
    e0, n0 = corners_east, corners_north
    e1, n1 = np.roll(e0, -1), np.roll(n0, -1)
    spans = (n0 > north) != (n1 > north)
    rise = np.where(spans, n1 - n0, 1.0)
    at = e0 + (north - n0) / rise * (e1 - e0)
    return bool((spans & (at > east)).sum() % 2)
