"""Make a commented scenario file to start from.

It has two positions and their terrain, with examples in comments.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from world.arrays import Floats
from world.elevation_formats import EMBEDDED
from world.errors import ArgumentError, TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.raster import coverage_text, is_covered, read_terrain, require_covered, require_no_holes, tile_bounds
from world.raster_file import RasterFile

# Width of terrain on either side of the straight line, for detours, as a fraction of the line's length.
_MARGIN_FRACTION = 0.3
# Smallest such width, m.
_MIN_MARGIN_M = 1500.0
# Largest such width, m.
_MAX_MARGIN_M = 15_000.0
# Fractions of the width that are tried in turn, as the elevation file may have no data further away.
_MARGIN_REDUCTIONS = (1.0, 0.5, 0.25, 0.12)
# Smallest distance of an end from the edge of the elevation file, m.
_EDGE_M = 100.0
# Smallest distance between the ends, m.
_MIN_LENGTH_M = 100.0
# Largest distance between the ends, m.
_MAX_LENGTH_M = 300_000.0
# Largest latitude of a map's origin, degrees.
_MAX_LATITUDE_DEG = 89.0
# Height of the ceiling above the highest ground and the ends, m.
_HEADROOM_M = 300.0
# The ceiling is rounded up to a multiple of this, m.
_CEILING_STEP_M = 50.0
# Clearance of paths above ground, m.
_CLEARANCE_M = 60.0
# Largest clearance as a fraction of the height of the ends.
_CLEARANCE_FRACTION = 0.5


class GeoPosition(NamedTuple):
    """Latitude and longitude, degrees."""

    lat: float
    lon: float


@dataclass(frozen=True, slots=True)
class Draft:
    """Contents of a scenario file to start from.

    terrain: path of the elevation file as the scenario states it; None for flat ground at mean sea level.
    start, destination: positions at `height` m above ground.
    origin: origin of the map.
    box: area, [[west, east], [south, north]] m from `origin`.
    ceiling: ceiling of the area, m AMSL.
    aircraft, autopilot: see [flight].
    version: release of the autopilot, None for the newest.
    airspeed: cruise speed of the aircraft, m/s.
    """

    name: str
    terrain: str | None
    start: GeoPosition
    destination: GeoPosition
    height: float
    origin: GeoOrigin
    box: Floats
    ceiling: float
    aircraft: str
    airspeed: float
    autopilot: str
    version: str | None

    @property
    def clearance(self) -> float:
        """Required clearance of a path above the ground, m."""
        return min(_CLEARANCE_M, _CLEARANCE_FRACTION * self.height)


def make_draft(
    name: str,
    start: GeoPosition,
    destination: GeoPosition,
    height: float,
    *,
    raster: RasterFile | None = None,
    terrain: str | None = None,
    aircraft: str = "aerosonde",
    airspeed: float = 25.0,
    autopilot: str = "ardupilot",
    version: str | None = None,
) -> Draft:
    """Make the draft of a scenario for a flight from a start to a destination.

    name: name of the scenario.
    height: height of start and destination above ground, m.
    raster: elevation file; None for flat ground.
    terrain: path of that file as the scenario file states it.
    aircraft, airspeed, autopilot, version: see `Draft`.

    The area extends beyond the line from start to destination by about a third of the line's length on all sides. It is
    clipped to the data of the elevation file. Raises ArgumentError for positions that are outside the file, or too near
    to or too far from each other, and TerrainError if there is no data even near the line.
    """
    east, north = (float(value) for value in to_map(GeoOrigin(*start), destination.lat, destination.lon))
    length = math.hypot(east, north)
    if not _MIN_LENGTH_M <= length <= _MAX_LENGTH_M:
        message = f"expected {_MIN_LENGTH_M:g} m to {_MAX_LENGTH_M / 1000.0:g} km from `start`"
        raise ArgumentError.of_argument("destination", destination, message, shown=_position_text(destination, length))
    midpoint = to_geo(GeoOrigin(*start), east / 2.0, north / 2.0)
    origin = GeoOrigin(round(float(midpoint[0]), 5), round(float(midpoint[1]), 5))
    if abs(origin.lat_deg) > _MAX_LATITUDE_DEG:
        message = f"the scenario must lie within {_MAX_LATITUDE_DEG:g}° of latitude"
        raise ArgumentError.of_argument("destination", destination, message, shown=_position_text(destination))
    endpoints = np.array([to_map(origin, *place) for place in (start, destination)])
    margin = min(max(_MARGIN_FRACTION * length, _MIN_MARGIN_M), _MAX_MARGIN_M)
    highest_ground, bounds = 0.0, _enclosing_box(endpoints, margin)
    if raster is not None:
        bounds, highest_ground = _find_covered_area(
            raster, origin, {"start": start, "destination": destination}, endpoints, margin
        )
    ceiling = math.ceil((highest_ground + height + _HEADROOM_M) / _CEILING_STEP_M) * _CEILING_STEP_M
    bounds = np.stack([np.ceil(bounds[:, 0] / 10.0), np.floor(bounds[:, 1] / 10.0)], axis=1) * 10.0
    return Draft(
        name, terrain, start, destination, height, origin, bounds, ceiling, aircraft, airspeed, autopilot, version
    )


def _find_covered_area(
    raster: RasterFile, origin: GeoOrigin, positions: Mapping[str, GeoPosition], endpoints: Floats, margin: float
) -> tuple[Floats, float]:
    """Find an area around start and destination that has elevation data, and the highest ground in it, m.

    positions: start and destination, by their keywords.
    endpoints: the same two positions on the map, (2, 2) m.
    margin: largest distance between the positions and the edges of the area, m; smaller distances are tried if data is
        missing.

    The area is [[west, east], [south, north]], (2, 2) m. Raises ArgumentError for a position that the file does not
    cover, and TerrainError if data is missing even with the smallest distance.
    """
    for fraction in _MARGIN_REDUCTIONS:
        # Clip the box to the area that the file covers.
        area = _enclosing_box(endpoints, fraction * margin)
        if is_covered(raster, origin, area):
            bounds = area
        else:
            tile_area = tile_bounds(raster, origin)
            bounds = np.stack(
                [np.maximum(area[:, 0], tile_area[:, 0]), np.minimum(area[:, 1], tile_area[:, 1])], axis=1
            )
        for (keyword, position), endpoint in zip(positions.items(), endpoints, strict=True):
            if not ((bounds[:, 0] + _EDGE_M <= endpoint) & (endpoint <= bounds[:, 1] - _EDGE_M)).all():
                message = (
                    f"outside the terrain or within {_EDGE_M:g} m of its edge; {raster.name} covers"
                    f" {coverage_text(raster)}"
                )
                raise ArgumentError.of_argument(keyword, position, message, shown=_position_text(position))
        try:
            require_covered(raster, origin, bounds)
            ground = read_terrain(raster, origin, bounds, 0.0)
            require_no_holes(ground, bounds)
            return bounds, float(np.nanmax(ground.heights))
        except TerrainError:
            if fraction == _MARGIN_REDUCTIONS[-1]:
                raise
    raise AssertionError


def _enclosing_box(endpoints: Floats, margin: float) -> Floats:
    """Return the box around two positions with a margin (m) on all sides.

    The result is [[west, east], [south, north]], (2, 2) m.

    endpoints: east and north of each position, (2, 2) m.
    """
    return np.stack([endpoints.min(axis=0) - margin, endpoints.max(axis=0) + margin], axis=1)


def _position_text(position: GeoPosition, distance: float | None = None) -> str:
    """Format a position in degrees for a message, with a distance (m) if one is given."""
    text = f"{position.lat:g},{position.lon:g}"
    return text if distance is None else f"{text}, {distance / 1000.0:,.3g} km away"


# ----------------------------------------------------------------------
# Text of the file.


def draft_text(draft: Draft) -> str:
    """Return the scenario file of a draft as TOML text.

    >>> start, destination = GeoPosition(46.5, 8.0), GeoPosition(46.55, 8.05)
    >>> print(draft_text(make_draft("site", start, destination, 120.0)).split("[area]")[0])
    # From 46.5, 8 to 46.55, 8.05.  Lines that begin with "# " and a key are examples; remove the "# " to use them.
    # All keys: docs/scenario-file.md of planfly.
    name = "site"
    <BLANKLINE>
    [origin]                      # where east_m = north_m = 0: half way
    lat_deg = 46.525
    lon_deg = 8.02499
    <BLANKLINE>
    [terrain]
    kind = "flat"                 # no elevation file was named, so the ground is flat, without hills
    amsl_m = 0                    # height of the ground above mean sea level
    # For measured ground use these lines instead of the two above:
    # kind = "dem"
    # path = "dem.tif"            # an elevation file, a folder of tiles, or a .vrt
    <BLANKLINE>
    <BLANKLINE>
    """
    start, destination = (
        f"{_number_text(place.lat)}, {_number_text(place.lon)}" for place in (draft.start, draft.destination)
    )
    head = f"""\
# From {start} to {destination}.  Lines that begin with "# " and a key are examples; remove the "# " to use them.
# All keys: docs/scenario-file.md of planfly.
name = {_quote(draft.name)}

[origin]                      # where east_m = north_m = 0: half way
lat_deg = {_number_text(draft.origin.lat_deg)}
lon_deg = {_number_text(draft.origin.lon_deg)}
"""
    limits = f"""\
[limits]                      # turns and slopes: what the aircraft can do, unless a number is given
{_entry_line("min_clearance_m", _number_text(draft.clearance), "above ground")}
{_entry_line("# max_height_m", _number_text(max(400.0, 2.0 * draft.height)), "above ground")}
{_entry_line("# max_turn_deg", "60", "at a waypoint")}
{_entry_line("# corridor_m", "60", "half width about the legs; by default as wide as the autopilot requires")}
"""
    autopilots = """"ardupilot", "px4", or "planfly": planfly's own guidance"""
    airspeed = _number_text(draft.airspeed)
    key = "px4_version" if draft.autopilot == "px4" else "arduplane_version"
    version = "" if draft.version is None else f"\n{key} = {_quote(draft.version)}"
    flight = f"""\
[flight]
{_entry_line("aircraft", _quote(draft.aircraft), "an aircraft listed by 'planfly aircraft', or a folder of your own")}
{_entry_line("autopilot", _quote(draft.autopilot), autopilots)}{version}
{_entry_line("# params", '"mine.param"', "parameter file of the autopilot, as saved by a ground station")}
{_entry_line("# airspeed_mps", airspeed, "equivalent, for planfly's guidance true; the default is this")}

[wind]
{_entry_line("speed_mps", "0", "your forecast, 0 to 40")}
{_entry_line("from_deg", "0", "direction the wind comes from; 270 is a west wind")}
{_entry_line("turbulence", '"none"', '"light" or "moderate"')}

[planner]
{_entry_line("seed", "1", "the same seed finds the same path")}
"""
    return "\n".join((head, _terrain_text(draft), _area_and_ends_text(draft), limits, flight, _examples_text(draft)))


def _quote(value: str) -> str:
    """Convert a text to a TOML string; JSON's escapes are valid in TOML."""
    return json.dumps(value, ensure_ascii=False)


def _number_text(value: float) -> str:
    """Format a number with up to eight significant digits."""
    return f"{value:.8g}"


def _entry_line(key: str, value: str, comment: str = "") -> str:
    """Return a line "key = value", followed by an aligned comment if there is one."""
    return f"{f'{key} = {value}':<30}# {comment}" if comment else f"{key} = {value}"


def _terrain_text(draft: Draft) -> str:
    """Return the [terrain] table of a scenario file, with comments."""
    if draft.terrain is None:
        return f"""\
[terrain]
{_entry_line("kind", '"flat"', "no elevation file was named, so the ground is flat, without hills")}
{_entry_line("amsl_m", "0", "height of the ground above mean sea level")}
# For measured ground use these lines instead of the two above:
# kind = "dem"
{_entry_line("# path", '"dem.tif"', "an elevation file, a folder of tiles, or a .vrt")}
"""
    comment = "the tile that planfly ships" if draft.terrain in EMBEDDED else "relative to this file's folder"
    return f"""\
[terrain]
kind = "dem"
{_entry_line("path", _quote(draft.terrain), comment)}
{_entry_line("# vertical_error_m", "5", "as its source states it; clearance is then also shown minus this error")}
"""


def _area_and_ends_text(draft: Draft) -> str:
    """Return the [area], [start] and [destination] tables of a scenario file, with comments."""
    (east0, east1), (north0, north1) = (tuple(f"{value:.0f}" for value in span) for span in draft.box)
    ends = []
    for key, place, course_comment in (
        ("start", draft.start, "on which the aircraft begins"),
        ("destination", draft.destination, "on which it arrives"),
    ):
        ends.append(f"""\
[{key}]
lat_deg = {_number_text(place.lat)}
lon_deg = {_number_text(place.lon)}
{_entry_line("height_m", _number_text(draft.height), "above ground; amsl_m is above mean sea level")}
{_entry_line("# course_deg", "0", course_comment)}
""")
    return f"""\
[area]                        # where a path may lead, m from [origin]
east_m = [{east0}, {east1}]
north_m = [{north0}, {north1}]
{_entry_line("ceiling_amsl_m", _number_text(draft.ceiling), "above mean sea level")}

""" + "\n".join(ends)


def _examples_text(draft: Draft) -> str:
    """Return the commented examples of a scenario file: a threat, a zone, and requirements on returns.

    Threat and zone are near the line from start to destination, and small enough to fly around.
    """
    radius = max(50.0, round(float(np.diff(draft.box, axis=1).min()) / 200.0) * 10.0)
    # Positions on both sides of the line from start to destination: each is a third of the line's length from one
    # end, and half of the radius to the side.
    endpoints = np.array([to_map(draft.origin, *place) for place in (draft.start, draft.destination)])
    straight_line = endpoints[1] - endpoints[0]
    offset = np.array([-straight_line[1], straight_line[0]]) / (math.hypot(*straight_line) or 1.0) * radius * 0.5
    first_position = endpoints[0] + straight_line / 3.0 + offset
    second_position = endpoints[1] - straight_line / 3.0 - offset
    threat, zone = (
        GeoPosition(*(float(degrees) for degrees in to_geo(draft.origin, *point)))
        for point in (
            (float(first_position[0]), float(first_position[1])),
            (float(second_position[0]), float(second_position[1])),
        )
    )
    return f"""\
# A threat: a missile, a radar, or both; on the ground unless a height is given.
# [[threats]]
# name = "battery"
# lat_deg = {threat.lat:.5f}
# lon_deg = {threat.lon:.5f}
{_entry_line("# kill_radius_m", _number_text(radius))}
{_entry_line("# kill_scale_m", _number_text(round(radius / 4.0)), "where the exposure (scale/distance)^4 is 1")}
{_entry_line("# detection_radius_m", _number_text(2.0 * radius))}
{_entry_line("# detection_scale_m", _number_text(round(radius / 2.0)))}

# A zone to keep out of ("inclusion": to stay in); files of zones: zones_file = "airspace.geojson" above all tables.
# [[zones]]
# name = "village"
# kind = "exclusion"
# lat_deg = {zone.lat:.5f}
# lon_deg = {zone.lon:.5f}
{_entry_line("# radius_m", _number_text(radius))}
{_entry_line("# ceiling_agl_m", "300", "height above ground up to which the zone reaches")}

# Requirements on the return from every point of the route.
# [returns]
# require = ["rtl", "glide"]  # from anywhere on the route a return to launch must be safe, and the engine may fail
"""
