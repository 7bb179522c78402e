"""Write the terrain of an area to a file."""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

from platformdirs import user_cache_dir

from flight.mission_files.formats import read_mission
from planfly.arguments import check_arguments
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import refuse_existing
from world.errors import ArgumentError, PlanflyError
from world.remote_files import is_address
from world.terrain_cut import COPERNICUS, Box, CutTerrain, cut_from_files, cut_from_server

# Length of a degree of latitude, km.
_DEGREE = 111.2
# Maximum absolute latitude of an area, degrees.
_MAX_LATITUDE_DEG = 84.0


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
    around: a mission file whose places the area contains.  Alternatively box: south, west, north and east edge of the
    area, degrees.
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
        raise PlanflyError("`around`, `box`: expected one of them", field="around, box")
    target = Path(out)
    if target.suffix.lower() not in (".tif", ".tiff"):
        raise PlanflyError(f"{target}: expected a name that ends with .tif", file=target)
    refuse_existing(target, overwrite, Path(around) if around is not None else None)
    area = _widen(_parse_box(box) if box is not None else _mission_box(Path(str(around))), margin)
    named = str(source)
    with stage("fetching terrain" if "://" in named else "cutting terrain") as advance:
        if "://" not in named:
            refuse_existing(target, True, Path(named))
            return cut_from_files(Path(named), area, target)
        if not is_address(named):
            allowed = "expected a folder, or the address of one by http or https"
            raise ArgumentError.of_argument("source", named, allowed, shown=ascii(named))
        with tempfile.TemporaryDirectory() as instead:
            return cut_from_server(named, area, target, _cache_folder(Path(instead)), advance, sea=sea)


def _parse_box(given: Sequence[float]) -> Box:
    """Return the box with the given edges.  Raises ArgumentError for invalid edges."""
    try:
        south, west, north, east = (float(value) for value in given)
    except (TypeError, ValueError):
        south = west = north = east = math.nan
    # NaN must fail these comparisons.  An area may lie across the 180th meridian, from 179 to -179 or to 181.
    around = east + 360.0 if east < west else east
    if not (
        -_MAX_LATITUDE_DEG <= south < north <= _MAX_LATITUDE_DEG
        and -180.0 <= west <= 180.0
        and west < around <= west + 30.0
    ):
        allowed = "expected south, west, north, east, degrees -84..84 and -180..180, south below north"
        raise ArgumentError.of_argument("box", given, allowed)
    return Box(south, west, north, around)


def _mission_box(file: Path) -> Box:
    """Return the smallest box around all items, home, fences and rally points of a mission.  Raises PlanflyError."""
    mission = read_mission(file)
    places = [
        (one.lat_deg, one.lon_deg) for one in (*mission.items, *mission.fences, *mission.rally) if one.has_position
    ]
    if mission.home is not None:
        places.append((mission.home.lat_deg, mission.home.lon_deg))
    if not places:
        raise PlanflyError(f"{file}: contains no coordinates", file=file)
    first = places[0][1]
    lats = [lat for lat, _ in places]
    lons = [first + (lon - first + 180.0) % 360.0 - 180.0 for _, lon in places]
    if max(abs(lat) for lat in lats) > _MAX_LATITUDE_DEG or max(lons) - min(lons) > 30.0:
        raise PlanflyError(
            f"{file}: its places lie too far apart, or beyond {_MAX_LATITUDE_DEG:g} degrees of latitude", file=file
        )
    return Box(min(lats), min(lons), max(lats), max(lons))


def _widen(box: Box, margin: float) -> Box:
    """Return the box widened by a margin on every side.  margin: km."""
    up = margin / _DEGREE
    across = up / math.cos(math.radians(min(_MAX_LATITUDE_DEG, max(abs(box.south), abs(box.north)))))
    return Box(box.south - up, box.west - across, box.north + up, box.east + across)


def _cache_folder(instead: Path) -> Path:
    """Return the cache folder of downloaded parts, or `instead` if the user's cache cannot be written."""
    folder = Path(user_cache_dir("planfly")) / "terrain"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return instead
