"""Open and check elevation files, and read a window of them at source resolution.

`world.elevation_formats.FORMATS` lists the formats.  The format is chosen by the file's first bytes or by its suffix,
and its driver is explicit, so that nothing that merely names another file (VRT, a URL, a `/vsi` path) is ever opened.
`world.height_datum` determines the vertical datum of a file; the heights of a terrain are above mean sea level.
"""

import lzma
import math
import zipfile
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from world.address_space import AddressSpaceError
from world.arrays import Floats
from world.elevation_formats import EMBEDDED, FORMATS, SUFFIXES
from world.elevation_tiles import join_tiles, tile_files
from world.errors import TerrainError
from world.files import did_you_mean
from world.frames import GeoOrigin, PolyMap, fit_polymap, to_geo, to_map
from world.gdal_raster import PIXELS_AT_ONCE, open_geotiff, open_hgt
from world.height_datum import HeightDatum, StatedDatum, height_datum
from world.raster_file import (
    PixelMap,
    RasterFile,
    file_sha256,
    is_ground,
    longitude_near,
    one_line,
    outline,
    require_min_pixels,
)
from world.terrain import Terrain

# Largest number of pixels of a window, or of a file that is read as one array; more raise an error.
MAX_PIXELS = 120_000_000
# Folder of the embedded elevation files.
_EMBEDDED_FOLDER = Path(__file__).parent / "elevation"
# Errors that zipfile raises for a damaged file, among others.
_UNZIP_ERRORS = (zipfile.BadZipFile, zlib.error, lzma.LZMAError)


# ----------------------------------------------------------------------
# Checks for all formats.


def make_degree_raster(
    file: Path, name: str, heights: NDArray[np.generic], edges: tuple[float, float, float, float]
) -> RasterFile:
    """Make a raster file from an array of heights on a grid of longitudes and latitudes.

    heights: rows from north to south.
    edges: west, east, south and north edge of the outermost pixels, deg.

    Raises TerrainError for too few or too many pixels, and for edges that are not on the globe.
    """
    rows, cols = heights.shape
    require_min_pixels(name, (rows, cols))
    if heights.size > MAX_PIXELS:
        allowed = f"at most {MAX_PIXELS:,} are read"
        raise TerrainError.at(name, "pixels", heights.size, allowed, shown=f"{heights.size:,}")
    west, east, south, north = edges
    if not (-180.0 <= west < east <= 360.0 and -90.0 <= south < north <= 90.0):
        allowed = "expected degrees of longitude -180..360 and latitude -90..90"
        raise TerrainError.at(name, "west, east, south, north edge", list(edges), allowed)
    pixel_width, pixel_height = (east - west) / cols, (north - south) / rows

    def to_pixels(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
        """Convert longitudes and latitudes (deg) to fractional columns and rows."""
        shifted_lon = longitude_near(lon, (west + east) / 2)
        return (shifted_lon - west) / pixel_width - 0.5, (north - lat) / pixel_height - 0.5

    def read(top: int, bottom: int, left: int, right: int) -> NDArray[np.float32]:
        """Return the heights of a window of rows and columns."""
        return heights[top:bottom, left:right].astype(np.float32)

    def to_lon_lat(col: Floats, row: Floats) -> tuple[Floats, Floats]:
        """Convert fractional columns and rows to longitudes and latitudes (deg)."""
        return west + (col + 0.5) * pixel_width, north - (row + 0.5) * pixel_height

    corners = np.stack(to_lon_lat(*outline(cols, rows)), axis=1)
    grid = (pixel_width, 0.0, west, 0.0, -pixel_height, north)
    return RasterFile(name, (rows, cols), to_pixels, to_lon_lat, corners, file_sha256(file), read, grid)


# ----------------------------------------------------------------------
# The .npz format.

# Number of rows of the tile that planfly ships (matplotlib ships it, too).
_SHIPPED_TILE_ROWS = 344
# The values of xmin, xmax, ymin and ymax in that tile, deg; they identify a copy of it under another name.
_SHIPPED_TILE_EDGES_DEG = (-84.41375, -84.07791667, 36.73291667, 36.44625)
# Tolerance of these values: about a hundredth of a pixel, deg.
_SHIPPED_TILE_TOLERANCE_DEG = 1e-5


def open_npz(file: Path, name: str) -> RasterFile:
    """Open an .npz file of heights. Raises TerrainError for any other file.

    name: name of the file in messages.

    The file has `elevation` (rows from north to south) and xmin, xmax, ymin, ymax: pixel edges in degrees. The two
    values of a pair may be in any order, except in the tile that planfly ships.
    """
    heights, edges = _read_npz(file, name)
    if heights.ndim != 2 or heights.dtype.kind not in "iuf":
        allowed = "expected a 2-D array of numbers"
        shape_text = f"{heights.dtype} of shape {heights.shape}"
        raise TerrainError.at(name, "elevation", heights.shape, allowed, shown=shape_text)
    # The edges of the tile that planfly ships are corrected, because its ymin lies one tile height north of its
    # ymax instead of south of it.
    west, east = sorted(edges[:2])
    south, north = sorted(edges[2:])
    # In the shipped tile of 344 rows, ymax, 36.44625, is the north edge, and ymin, 36.73292, is the north edge plus the
    # tile's extent in latitude.  Read as north and south edge, they place the tile 0.28667 degrees too far north.  The
    # ground confirms this: the highest pixel lies 0.2479 degrees south of the north edge, and Cross Mountain, of the
    # same height, at 36.1983 N; the lake ends 0.2208 degrees south of the north edge, and Norris Dam stands at
    # 36.2242 N (https://en.wikipedia.org/wiki/Cross_Mountain_(Tennessee), https://en.wikipedia.org/wiki/Norris_Dam).
    if heights.shape[0] == _SHIPPED_TILE_ROWS and np.allclose(
        edges, _SHIPPED_TILE_EDGES_DEG, rtol=0.0, atol=_SHIPPED_TILE_TOLERANCE_DEG
    ):
        south, north = south - (north - south), south
    return make_degree_raster(file, name, heights, (west, east, south, north))


def _read_npz(file: Path, name: str) -> tuple[NDArray[np.generic], list[float]]:
    """Return the heights in an .npz file, and its edges xmin, xmax, ymin and ymax, deg.

    name: name of the file in messages.

    Raises TerrainError for a file that is damaged, incomplete or too large.
    """
    edge_keys = ("xmin", "xmax", "ymin", "ymax")
    try:
        with zipfile.ZipFile(file) as archive:
            # A few kilobytes of zeros unpack to gigabytes: check the size before unpacking.
            size = max((member.file_size for member in archive.infolist()), default=0)
        if size > 8 * MAX_PIXELS:
            allowed = f"at most {8 * MAX_PIXELS:,} are read"
            raise TerrainError(f"{name}: {size:,} bytes unpacked: {allowed}", file=name, value=size, allowed=allowed)
        with np.load(file, allow_pickle=False) as data:
            for key in ("elevation", *edge_keys):
                if key not in data.files:
                    message = f"{name}: field {key}: missing (elevation, xmin, xmax, ymin, ymax)"
                    raise TerrainError(message, file=name, field=key)
            heights = np.asarray(data["elevation"])
            return heights, [float(np.asarray(data[key]).item()) for key in edge_keys]
    # RuntimeError and NotImplementedError: an encrypted entry, an unknown compression.
    except AddressSpaceError:
        raise
    except MemoryError:
        raise TerrainError(
            f"{name}: elevation: its stated size does not fit into memory", file=name, field="elevation"
        ) from None
    except (*_UNZIP_ERRORS, OSError, ValueError, TypeError, EOFError, RuntimeError) as error:
        raise TerrainError(f"{name}: not a readable .npz elevation file: {one_line(error)}", file=name) from error


# ----------------------------------------------------------------------
# Open a file of any format.

# Function for each format that opens a file, from its path and the path as the user gave it.
_OPENERS: dict[str, Callable[[Path, str], RasterFile]] = {".tif": open_geotiff, ".hgt": open_hgt, ".npz": open_npz}


def open_raster(path: str, base: Path | None = None, datum: StatedDatum | None = None) -> RasterFile:
    """Open an elevation file, a folder or .vrt of tiles, or the built-in file of a name.

    base: folder of relative paths.
    datum: vertical datum of the heights; None for the datum that the file states.

    Raises TerrainError for anything but a file of one band in one of `world.elevation_formats.FORMATS`. Also raises
    TerrainError for heights above an ellipsoid if no geoid grid is installed to convert them.

    >>> open_raster("jacksboro").shape
    (344, 403)
    """
    if path in EMBEDDED:
        raster = open_npz(_EMBEDDED_FOLDER / EMBEDDED[path], path)
        return replace(raster, datum=_determine_datum(raster, datum))
    if path.startswith("/vsi") or "://" in path:
        allowed = "only local files are read, not URLs or virtual file systems"
        raise TerrainError(f"{path}: {allowed}", file=path, allowed=allowed)
    file = Path(path) if base is None else base / path
    files = tile_files(file) if file.exists() else None
    if files is not None:
        tiles = [open_raster(str(tile), None, datum) for tile in files]
        return join_tiles(tiles, f"{path} ({len(tiles)} tiles)" if len(tiles) > 1 else path)
    if not file.is_file():
        suffixes, names = _or_list(SUFFIXES), ", ".join(sorted(EMBEDDED))
        raise TerrainError(
            f"{file}: no such elevation file (expected a {suffixes} file, or the name of a built-in"
            f" terrain: {names}){did_you_mean(path, EMBEDDED)}",
            file=file,
        )
    try:
        with file.open("rb") as handle:
            head = handle.read(16)
    except OSError as error:
        raise TerrainError(f"{file}: cannot be read: {error.strerror}", file=file) from error
    suffix_formats = [
        known_format
        for known_format in FORMATS
        if not known_format.begins and known_format.suffix == file.suffix.lower()
    ]
    for known_format in (
        *(known_format for known_format in FORMATS if head.startswith(known_format.begins)),
        *suffix_formats,
    ):
        raster = _OPENERS[known_format.suffix](file, path)
        return replace(raster, datum=_determine_datum(raster, datum))
    expected = _or_list([known_format.name for known_format in FORMATS])
    raise TerrainError(f"{file}: not an elevation file; expected {expected}", file=file)


def open_tiles(paths: Sequence[str], base: Path | None = None, datum: StatedDatum | None = None) -> RasterFile:
    """Open one elevation file, as `open_raster` does, or join several files on one grid.

    Where they overlap, the first file with data is used. Raises TerrainError as `open_raster` does.

    >>> open_tiles(["jacksboro", "jacksboro"]).name
    'jacksboro and 1 more'
    """
    tiles = [open_raster(path, base, datum) for path in paths]
    return tiles[0] if len(tiles) == 1 else join_tiles(tiles, f"{paths[0]} and {len(paths) - 1} more")


def _determine_datum(raster: RasterFile, stated_datum: StatedDatum | None) -> HeightDatum:
    """Return the vertical datum of a raster, or the stated datum, which overrides it.

    Raises TerrainError if it is not usable.
    """
    try:
        return height_datum(raster.crs, stated_datum)
    except ValueError as error:
        allowed = (
            "give PROJ the grid of a geoid (projsync --file us_nga_egm96_15.tif), or state the height of mean sea level"
            " in the file (some 47.0 m in the Alps) as height_datum in a scenario's [terrain]"
        )
        raise TerrainError(
            f"{raster.name}: {error}: {allowed}", file=raster.name, field="height datum", allowed=allowed
        ) from error


def _or_list(names: Sequence[str]) -> str:
    """Join names by commas and a final "or"."""
    return f"{', '.join(names[:-1])} or {names[-1]}"


# ----------------------------------------------------------------------
# Windows of a raster as terrain.

# Largest allowed error of the polynomial from map to pixels, in pixels.
PIXEL_TOLERANCE = 1e-3
# Number of points along each side of a window at which mean sea level is sampled.
_SEA_LEVEL_SAMPLES = 200
# Number of pixels without data checked in one step: one inside the area is enough to refuse it.
_HOLES_PER_STEP = 2**16


def read_terrain(raster: RasterFile, origin: GeoOrigin, bounds: ArrayLike, buffer: float) -> Terrain:
    """Read the part of a raster that covers an area of the map and a buffer around it.

    bounds: area, [[west, east], [south, north]] m.
    buffer: width of the buffer, m.

    Ground beyond the raster, or without data, becomes NaN. Raises TerrainError if no ground in the area is known, or if
    it has too many pixels.

    >>> raster = open_raster("jacksboro")
    >>> terrain = read_terrain(raster, raster.centre, [[-500.0, 500.0], [-500.0, 500.0]], 100.0)
    >>> terrain.heights.shape, float(terrain.height(0.0, 0.0).round(1))
    ((16, 21), 568.0)
    """
    box = np.asarray(bounds, dtype=np.float64)
    rows, cols = raster.shape
    c0, c1, r0, r1 = _outline_window(raster, origin, box, buffer)
    # A coordinate system has no pixels far outside its region.
    if not np.isfinite([c0, c1, r0, r1]).all():
        raise _no_data_error(raster)
    left, right = max(0, math.floor(c0) - 1), min(cols, math.ceil(c1) + 2)
    top, bottom = max(0, math.floor(r0) - 1), min(rows, math.ceil(r1) + 2)
    if right - left < 2 or bottom - top < 2:
        raise _no_data_error(raster)
    if (right - left) * (bottom - top) > MAX_PIXELS:
        raise TerrainError(
            f"{raster.name}: the area needs {(right - left) * (bottom - top):,} pixels;"
            f" at most {MAX_PIXELS:,} are read",
            file=raster.name,
        )
    heights = raster.read(top, bottom, left, right)
    heights[~is_ground(heights)] = np.nan
    _convert_to_sea_level(heights, raster, top, left)
    to_pixel = fit_polymap(
        lambda east, north: _to_window_pixels(raster.to_pixels, origin, east, north, left, top),
        box + np.array([-buffer, buffer]),
        PIXEL_TOLERANCE,
    )
    if to_pixel.residual > 10 * PIXEL_TOLERANCE:
        raise TerrainError(
            f"{raster.name}: the area is too large to map: {to_pixel.residual:.2g} pixels of error", file=raster.name
        )
    # The length of the shorter pixel side.
    spacing = float(np.min(np.linalg.norm(np.linalg.inv(_pixels_per_metre(to_pixel, box)), axis=0)))
    if np.isnan(heights).all():
        raise _no_data_error(raster)
    return Terrain(heights, to_pixel, spacing, raster.name, raster.sha256, raster.datum.text)


def _no_data_error(raster: RasterFile) -> TerrainError:
    """Make the error about a raster without data in the area."""
    return TerrainError(
        f"{raster.name}: no data in the area; the file covers {coverage_text(raster)}", file=raster.name
    )


def require_covered(raster: RasterFile, origin: GeoOrigin, bounds: ArrayLike) -> None:
    """Raise TerrainError if an area extends beyond the outer pixel centres of a raster.

    bounds: area, [[west, east], [south, north]] m.
    """
    box = np.asarray(bounds, dtype=np.float64)
    if not is_covered(raster, origin, box):
        raise TerrainError(
            f"{raster.name}: area {_box_text(box)} reaches beyond the tile{_outside_text(raster, origin, box)}"
            f" (the tile covers {coverage_text(raster)})",
            file=raster.name,
            field="area",
            value=box.tolist(),
        )


def is_covered(raster: RasterFile, origin: GeoOrigin, box: Floats) -> bool:
    """Return True if a raster covers a box on the map, [[west, east], [south, north]] m.

    >>> raster = open_raster("jacksboro")
    >>> is_covered(raster, raster.centre, np.array([[0.0, 14_000.0], [0.0, 1.0]]))
    True
    >>> is_covered(raster, raster.centre, np.array([[0.0, 16_000.0], [0.0, 1.0]]))
    False
    """
    rows, cols = raster.shape
    col0, col1, row0, row1 = _outline_window(raster, origin, box, 0.0)
    return not (col0 < -1e-6 or row0 < -1e-6 or col1 > cols - 1 + 1e-6 or row1 > rows - 1 + 1e-6)


def _convert_to_sea_level(heights: NDArray[np.float32], raster: RasterFile, top: int, left: int) -> None:
    """Convert the heights in a window of a raster to heights above mean sea level, in place.

    top, left: row and column of the raster at which the window starts.

    Mean sea level is sampled on a grid and interpolated. Raises TerrainError if it is unknown in the window.
    """
    if raster.datum.sea_level is None:
        return
    rows, cols = (first + np.arange(size) for first, size in zip((top, left), heights.shape, strict=True))
    sample_row_numbers, col = (
        np.linspace(axis[0], axis[-1], min(len(axis), _SEA_LEVEL_SAMPLES)) for axis in (rows, cols)
    )
    sample_cols, sample_rows = np.meshgrid(col, sample_row_numbers)
    lon, lat = raster.to_lon_lat(sample_cols.ravel(), sample_rows.ravel())
    sea_level = raster.datum.sea_level(lon, lat)
    if not np.isfinite(sea_level).all():
        bad_index = int(np.argmin(np.isfinite(sea_level)))
        position_text = f"longitude {lon[bad_index]:.4f}, latitude {lat[bad_index]:.4f}"
        raise TerrainError(f"{raster.name}: {position_text}: the geoid height there is unknown", file=raster.name)
    sea_levels = np.stack([np.interp(cols, col, level_row) for level_row in sea_level.reshape(sample_cols.shape)])
    sample_row = np.interp(rows, sample_row_numbers, np.arange(sample_row_numbers.size))
    upper_row = np.minimum(sample_row.astype(np.intp), sample_row_numbers.size - 2)
    fraction = (sample_row - upper_row)[:, None]
    rows_at_once = max(1, PIXELS_AT_ONCE // cols.size)
    for first_row in range(0, rows.size, rows_at_once):
        row_slice = slice(first_row, first_row + rows_at_once)
        upper, lower = sea_levels[upper_row[row_slice]], sea_levels[upper_row[row_slice] + 1]
        heights[row_slice] -= (upper + (lower - upper) * fraction[row_slice]).astype(np.float32)


def _pixels_per_metre(to_pixel: PolyMap, box: Floats) -> Floats:
    """Return the derivatives of pixel coordinates by map position, pixels per m, (2, 2).

    They apply at the centre of a box.

    Row 0 has the derivatives of the column by east and by north, row 1 the derivatives of the row.
    """
    centre = box.mean(axis=1)
    col, row = to_pixel(centre[0] + np.array([0.0, 100.0, 0.0]), centre[1] + np.array([0.0, 0.0, 100.0]))
    return np.array([[col[1] - col[0], col[2] - col[0]], [row[1] - row[0], row[2] - row[0]]]) / 100.0


def require_no_holes(terrain: Terrain, bounds: ArrayLike) -> None:
    """Raise TerrainError if a height in an area depends on a pixel without data.

    bounds: area, [[west, east], [south, north]] m.
    """
    box = np.asarray(bounds, dtype=np.float64)
    rows, cols = np.nonzero(np.isnan(terrain.heights))
    if not rows.size:
        return
    to_map_metres = np.linalg.inv(_pixels_per_metre(terrain.to_pixel, box))
    # Each height is interpolated from the four pixels around it.
    footprint = np.abs(to_map_metres).sum(axis=1)[:, None]
    for first_hole in range(0, rows.size, _HOLES_PER_STEP):
        part = slice(first_hole, first_hole + _HOLES_PER_STEP)
        pixels = np.stack([cols[part], rows[part]]).astype(np.float64)
        # Newton's method with a constant slope: the map deviates from an affine map by only a few metres over the box.
        positions = np.repeat(box.mean(axis=1)[:, None], pixels.shape[1], axis=1)
        for _ in range(8):
            positions += to_map_metres @ (pixels - np.stack(terrain.to_pixel(positions[0], positions[1])))
        is_inside = ((positions > box[:, :1] - footprint) & (positions < box[:, 1:] + footprint)).all(axis=0)
        if is_inside.any():
            east, north = positions[:, int(np.argmax(is_inside))]
            raise TerrainError(
                f"{terrain.source}: no data at east {east:.0f} m, north {north:.0f} m ({rows.size:,} of "
                f"{terrain.heights.size:,} pixels in and around the area have no data);"
                " choose an area with data, or fill the holes of the file",
                file=terrain.source,
            )


def _outline_window(
    raster: RasterFile, origin: GeoOrigin, box: Floats, buffer: float
) -> tuple[float, float, float, float]:
    """Return the first and last column and row of a box on the map and a buffer around it.

    box: [[west, east], [south, north]] m.
    buffer: width of the buffer, m.

    The columns and rows are fractional, and may lie outside the raster.
    """
    ramp = np.linspace(0.0, 1.0, 41)
    (w, e), (s, n) = box + np.array([-buffer, buffer])
    east = np.concatenate([w + ramp * (e - w), w + ramp * (e - w), np.full(41, w), np.full(41, e)])
    north = np.concatenate([np.full(41, s), np.full(41, n), s + ramp * (n - s), s + ramp * (n - s)])
    col, row = _to_window_pixels(raster.to_pixels, origin, east, north, 0, 0)
    return float(col.min()), float(col.max()), float(row.min()), float(row.max())


def _to_window_pixels(
    to_pixels: PixelMap, origin: GeoOrigin, east: Floats, north: Floats, left: int, top: int
) -> tuple[Floats, Floats]:
    """Convert map positions to fractional columns and rows, counted from a window's first pixel.

    to_pixels: function from longitude and latitude to columns and rows of the raster.
    left, top: column and row of the window's first pixel.
    """
    lat, lon = to_geo(origin, east, north)
    col, row = to_pixels(lon, lat)
    return np.asarray(col) - left, np.asarray(row) - top


def tile_bounds(raster: RasterFile, origin: GeoOrigin) -> Floats:
    """Return the largest box on the map inside a raster, [[west, east], [south, north]] m.

    The box has the proportions of the raster's extent; its size is found to within half a percent.
    Raises TerrainError if no box fits.

    >>> raster = open_raster("jacksboro")
    >>> tile_bounds(raster, raster.centre).round(-2).tolist()
    [[-15000.0, 15000.0], [-15800.0, 15800.0]]
    """
    east, north = to_map(origin, raster.corners[:, 1], raster.corners[:, 0])
    centre_e, centre_n = (east.min() + east.max()) / 2, (north.min() + north.max()) / 2
    half = np.array([(east.max() - east.min()) / 2, (north.max() - north.min()) / 2])
    rows, cols = raster.shape
    for fraction in np.arange(0.995, 0.3, -0.005):
        box = np.array(
            [
                [centre_e - fraction * half[0], centre_e + fraction * half[0]],
                [centre_n - fraction * half[1], centre_n + fraction * half[1]],
            ]
        )
        c0, c1, r0, r1 = _outline_window(raster, origin, box, 0.0)
        if c0 >= 0 and r0 >= 0 and c1 <= cols - 1 and r1 <= rows - 1:
            return box
    raise TerrainError(f"{raster.name}: no upright area fits inside the tile; give [area]", file=raster.name)


def coverage_text(raster: RasterFile) -> str:
    """Return the range of latitudes and longitudes that a raster covers, as text for a message.

    >>> coverage_text(open_raster("jacksboro"))
    'latitude 36.160..36.446, longitude -84.413..-84.078'
    """
    lon, lat = longitude_near(raster.corners[:, 0], float(raster.corners[0, 0])), raster.corners[:, 1]
    return f"latitude {lat.min():.3f}..{lat.max():.3f}, longitude {lon.min():.3f}..{lon.max():.3f}"


def _box_text(box: Floats) -> str:
    """Format a box on the map, [[west, east], [south, north]] m, for a message."""
    return f"east {box[0, 0]:.0f}..{box[0, 1]:.0f} m, north {box[1, 0]:.0f}..{box[1, 1]:.0f} m"


def _outside_text(raster: RasterFile, origin: GeoOrigin, box: Floats) -> str:
    """Return text on how far a box extends beyond a raster, and on the largest box inside the raster.

    The text names the corner of the box that is farthest outside. It is "" if the raster's coordinate system cannot
    express a corner.
    """
    rows, cols = raster.shape
    east, north = (axis.ravel() for axis in np.meshgrid(*box))
    col, row = _to_window_pixels(raster.to_pixels, origin, east, north, 0, 0)
    if not np.isfinite([col, row]).all():
        return ""
    # Nearest positions with data, along the tile's own axes.
    lon, lat = raster.to_lon_lat(np.clip(col, 0.0, cols - 1.0), np.clip(row, 0.0, rows - 1.0))
    near_east, near_north = to_map(origin, lat, lon)
    distances = np.hypot(near_east - east, near_north - north)
    k = int(np.argmax(distances))
    text = f": its corner east {east[k]:.0f} m, north {north[k]:.0f} m is {distances[k]:.0f} m outside the data"
    with suppress(TerrainError):
        inner = tile_bounds(raster, origin)
        # Rounded towards the inside.
        inner_box = np.stack([np.ceil(inner[:, 0]), np.floor(inner[:, 1])], axis=1)
        text += f"; the largest area inside is {_box_text(inner_box)}"
    return text
