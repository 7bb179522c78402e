"""A glider whose sink is the same at every airspeed, and grounds for it: what it reaches can be summed up."""

import math
from functools import cache

import numpy as np

from flight.autopilots.point_mass import POINT_MASS, PointMass
from logs.verdict.returns.glide_map import GlideMap, make_glide_map
from world.kernels import Record
from world.terrain import Terrain, make_gridded_terrain

AIRSPEED, SINK, BANK = 18.0, 1.8, math.radians(30.0)
# Without spheres.
NO_SPHERES, NO_RADII = np.zeros((0, 3)), np.zeros(0)


def glider(
    wind: float = 0.0, blows_to: float = 0.0, fast_sink: float = SINK, induced: float = 0.0, growth: float = 0.0
) -> PointMass:
    """One that sinks 1.8 m/s at any airspeed and in any bank, in a wind (m/s) that blows on a course (degrees).

    fast_sink: from 24 m/s on, m/s.  induced: of `POINT_MASS`, which a bank adds to.  growth: of the sink by airspeed,
    from 26 m/s to 30 m/s, the fastest.
    """
    record: Record = np.zeros(1, POINT_MASS)[0]
    record.airspeed, record.first_airspeed, record.airspeed_step, record.altitude_step = 25.0, AIRSPEED, 2.0, 2000.0
    record.wind_speed = wind
    record.wind_east, record.wind_north = math.sin(math.radians(blows_to)), math.cos(math.radians(blows_to))
    excess = np.full((21, 7, 3), -SINK)
    excess[:, 3:] = -fast_sink
    excess[:, 4:] -= growth * np.array([0.0, 2.0, 4.0])[None, :, None]
    record.induced = induced
    return PointMass(record, excess, np.zeros((3, 7, 3)))


def true_airspeed(amsl: float) -> float:
    """Of 18 m/s equivalent, in the standard atmosphere (ISO 2533): density falls as T^4.2559, T by 6.5 K a km."""
    return float(AIRSPEED * ((288.15 - 0.0065 * amsl) / 288.15) ** (-0.5 * 4.2559))


def height_needed(east: float, north: float, end: float, wind: float = 0.0, blows_to: float = 0.0) -> float:
    """From what height a straight glide from (east, north) ends at the middle at a height, m; by the wind triangle."""
    distance, height = math.hypot(east, north), end
    course, to = math.atan2(-east, -north), math.radians(blows_to)
    along, across = wind * math.cos(to - course), wind * math.sin(to - course)
    for _ in range(400):
        level = math.sqrt(true_airspeed(height) ** 2 - SINK**2)
        height += distance / 400.0 * SINK / (math.sqrt(level**2 - across**2) + along)
    return height


def ground(function: "np.ufunc | object", half: float = 6000.0, pitch: float = 50.0, shift: float = 0.0) -> Terrain:
    """Ground of a function of east and north (m) within so far from the middle; its pixels so far apart and shifted."""
    line = np.arange(-half, half + 0.5 * pitch, pitch) + shift
    heights = np.asarray(function(line[None, :], line[:, None]) + np.zeros((line.size, line.size)))  # type: ignore[operator]
    return make_gridded_terrain(heights, line, line, source="made", sha256="", datum="mean sea level")


@cache
def plane() -> Terrain:
    """Ground at 0 m."""
    return ground(lambda east, _north: 0.0 * east)


_maps: dict[float, GlideMap] = {}


def map_of(terrain: Terrain, margin: float = 30.0) -> GlideMap:
    """The map of the ways to the middle of a ground; the plane's, which most of them ask for, is made once."""
    made = _maps.get(margin) if terrain is plane() else None
    if made is None:
        made = make_glide_map(terrain, np.zeros((1, 2)), margin, NO_SPHERES, NO_RADII, 5900.0)
        assert made is not None
        if terrain is plane():
            _maps[margin] = made
    return made
