"""Write the terrain of an area to a file."""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

from platformdirs import user_cache_dir

from flight.mission_files.formats import read_mission
from planfly.arguments import check_arguments
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import check_output_file
from world.argument_types import checks_types
from world.errors import ArgumentError, PlanflyError
from world.remote_files import is_address
from world.terrain_cut import COPERNICUS, Box, CutTerrain, cut_from_files, cut_from_server

# Length of a degree of latitude, km.
_DEGREE_KM = 111.2
# Maximum absolute latitude of an area, degrees.
_MAX_LATITUDE_DEG = 84.0


@checks_types
def terrain(
    out: str | Path,
    *,
    around: str | Path | None = None,
    box: Sequence[float] | None = None,
    margin: float = 3.0,
    source: str | Path = COPERNICUS,
    sea: bool = False,
    overwrite: bool = False,
) -> CutTerrain:
    """Write the terrain of an area as a GeoTIFF, which the other functions of planfly read as terrain.

    out: the file.  overwrite: True replaces an existing file.
    around: a mission file; the area contains all its positions.  Alternatively box: south, west, north and east edge of
    the area, degrees.
    margin: width of the terrain added on every side, km.
    source: a folder of tiles or an elevation file; or the address (http or https) of a server with GLO-30 tiles of the
    Copernicus DEM, laid out as in the AWS registry of open data.  This registry is the default.  Downloaded parts are
    kept in the user's cache.
    sea: True treats degree cells for which the server has no tile as sea, at 0 m.  Otherwise these cells have no data,
    because the tiles of some countries are not published.
    Raises a `planfly.PlanflyError` for bad input, and if the server cannot be reached; then nothing is written.

    >>> import planfly
    >>> planfly.terrain("dem.tif", box=(47.0, 8.0, 46.0, 9.0))
    Traceback (most recent call last):
    world.errors.ArgumentError: box (47.0, 8.0, 46.0, 9.0): expected south, west, north, east, degrees -84..84 and \
-180..180, south below north
    """
    check_arguments(margin=margin)
    if (around is None) == (box is None):
        raise PlanflyError("expected either `around` or `box`", field="around, box")
    target = Path(out)
    if target.suffix.lower() not in (".tif", ".tiff"):
        raise PlanflyError(f"{target}: expected a name that ends with .tif", file=target)
    check_output_file(target, overwrite, Path(around) if around is not None else None)
    if box is not None:
        try:
            south, west, north, east = (float(value) for value in box)
        except (TypeError, ValueError):
            south = west = north = east = math.nan
        # An area may lie across the 180th meridian, from 179 to -179 or to 181.
        unwrapped_east = east + 360.0 if east < west else east
        # NaN must fail these comparisons.
        is_valid_lat = -_MAX_LATITUDE_DEG <= south < north <= _MAX_LATITUDE_DEG
        if not (is_valid_lat and -180.0 <= west <= 180.0 and west < unwrapped_east <= west + 30.0):
            allowed = "expected south, west, north, east, degrees -84..84 and -180..180, south below north"
            raise ArgumentError.of_argument("box", box, allowed)
        inner = Box(south, west, north, unwrapped_east)
    else:
        inner = _find_mission_box(Path(str(around)))
    lat_margin = margin / _DEGREE_KM
    lon_margin = lat_margin / math.cos(math.radians(min(_MAX_LATITUDE_DEG, max(abs(inner.south), abs(inner.north)))))
    area = Box(inner.south - lat_margin, inner.west - lon_margin, inner.north + lat_margin, inner.east + lon_margin)
    source_name = str(source)
    with stage("fetching terrain" if "://" in source_name else "cutting terrain") as advance:
        if "://" not in source_name:
            check_output_file(target, overwrite=True, source=Path(source_name))
            return cut_from_files(Path(source_name), area, target)
        if not is_address(source_name):
            allowed = "expected a folder, or an http or https address without a query"
            raise ArgumentError.of_argument("source", source_name, allowed, shown=ascii(source_name))
        with tempfile.TemporaryDirectory() as fallback:
            cache = Path(user_cache_dir("planfly")) / "terrain"
            try:
                cache.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=cache):
                    pass
            except OSError:
                # The user's cache cannot be written.
                cache = Path(fallback)
            return cut_from_server(source_name, area, target, cache, advance, sea=sea)


def _find_mission_box(file: Path) -> Box:
    """Return the smallest box that contains all items, home, fences and rally points of a mission.

    Raises PlanflyError for a mission without positions, or with positions too far apart or too close to a pole.
    """
    mission = read_mission(file)
    positions = [
        (item.lat_deg, item.lon_deg) for item in (*mission.items, *mission.fences, *mission.rally) if item.has_position
    ]
    if mission.home is not None:
        positions.append((mission.home.lat_deg, mission.home.lon_deg))
    if not positions:
        raise PlanflyError(f"{file}: contains no coordinates", file=file)
    first_lon = positions[0][1]
    lats = [lat for lat, _ in positions]
    lons = [first_lon + (lon - first_lon + 180.0) % 360.0 - 180.0 for _, lon in positions]
    if max(abs(lat) for lat in lats) > _MAX_LATITUDE_DEG or max(lons) - min(lons) > 30.0:
        raise PlanflyError(
            f"{file}: the positions are more than 30 degrees of longitude apart, or beyond"
            f" {_MAX_LATITUDE_DEG:g} degrees of latitude",
            file=file,
        )
    return Box(min(lats), min(lons), max(lats), max(lons))
