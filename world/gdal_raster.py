"""Read GeoTIFF and SRTM tiles with GDAL through rasterio, and write GeoTIFF files.

GDAL knows some 150 formats, among them lists of other files and addresses of servers.  This module opens
each file with one driver only, by its absolute path, and with `GUARD`: GDAL then reads this file and no other.
"""

import math
import os
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats
from world.errors import TerrainError
from world.frames import crs_to_wkt, crs_transformer, height_unit, is_geographic, transform_points
from world.raster_file import Grid, RasterFile, file_sha256, longitude_near, one_line, outline, require_min_pixels

# Options of GDAL: read only this file, no file next to it, and no file that is named in it.
GUARD: dict[str, Any] = {
    "GDAL_PAM_ENABLED": "NO",
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
    "GTIFF_GEOREF_SOURCES": "INTERNAL",
    "CPL_VSIL_CURL_ALLOWED_EXTENSIONS": ".none",
    # Report the vertical part of the reference system too, for its unit and its datum.
    "GTIFF_REPORT_COMPD_CS": "YES",
    # Cache for unpacked blocks, bytes; the default is a fraction of the machine's memory.
    "GDAL_CACHEMAX": 16 * 2**20,
}
# Largest number of pixels of a block (128 MiB of float32): GDAL unpacks whole blocks, even for a small window.
MAX_BLOCK_PIXELS = 32 * 2**20
# Number of pixels of a window read in one step: reading takes several times the memory of the heights.
PIXELS_AT_ONCE = 2**22

# Names of a unit that mean metres.
METRES = ("m", "metre", "metres", "meter", "meters")
# Names of a unit that mean feet.
_FOOT_NAMES = {"ft", "feet", "foot", "ftus", "usft"}
# Words in the name of a tag with the unit of distances, not of heights.
_HORIZONTAL_TAG = re.compile(r"horiz|linear|planar|xy", re.IGNORECASE)


def open_geotiff(file: Path, _name: str) -> RasterFile:
    """Open a GeoTIFF of heights in metres, in any reference system.

    Raises TerrainError for any other file.
    """
    return _open_raster_file(file, "GTiff", "not a readable GeoTIFF file")


def open_hgt(file: Path, _name: str) -> RasterFile:
    """Open an SRTM tile, whose file name states its position. Raises TerrainError for any other file."""
    expected = "expected a name such as N46E008.hgt and the bytes of 1201 x 1201 or 3601 x 3601 heights"
    return _open_raster_file(file, "SRTMHGT", f"not a readable SRTM tile; {expected}")


def open_dataset(file: Path, driver: str) -> Any:
    """Open a file in GDAL with one driver only; call it within an environment of the options `GUARD`."""
    import rasterio

    return rasterio.open(os.fspath(file.resolve()), driver=driver)


def _open_raster_file(file: Path, driver: str, failure_text: str) -> RasterFile:
    """Open an elevation file with one GDAL driver, and check its layout, position and unit.

    failure_text: beginning of the message if GDAL cannot open the file.

    Raises TerrainError for a file that cannot be opened or used.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    try:
        with warnings.catch_warnings(), rasterio.Env(**GUARD):
            # For a file without a position on Earth, GDAL would return columns and rows.
            warnings.simplefilter("error", NotGeoreferencedWarning)
            with open_dataset(file, driver) as source:
                # The file has one band of real numbers, in blocks that fit into memory.
                number_kind = np.dtype(source.dtypes[0]).kind
                if source.count != 1 or number_kind not in "iuf":
                    allowed = "an elevation file has 1 band of integers or real numbers"
                    raise TerrainError.at(
                        file, "bands", source.count, allowed, shown=f"{source.count} of {source.dtypes[0]}"
                    )
                block_pixels = math.prod(source.block_shapes[0])
                if block_pixels > MAX_BLOCK_PIXELS:
                    allowed = f"at most {MAX_BLOCK_PIXELS:,} are read at once; save the file with tiles"
                    raise TerrainError.at(file, "pixels of a block", block_pixels, allowed, shown=f"{block_pixels:,}")
                require_min_pixels(file, (source.height, source.width))
                shape, grid = (source.height, source.width), tuple(source.transform)[:6]
                scale, crs = (source.scales[0], source.offsets[0]), _read_crs(file, driver, source)
                # GDAL ignores the tags of other programs: heights in feet with such a tag would be read as metres.
                foot_tags = (
                    f"{value} (tag {key})"
                    for key, value in {**source.tags(), **source.tags(1)}.items()
                    if "unit" in key.lower()
                    and not _HORIZONTAL_TAG.search(key)
                    and not _FOOT_NAMES.isdisjoint(re.split("[^a-z]+", value.lower()))
                )
                unit = next(foot_tags, source.units[0] or "")
                may_have_gaps = driver == "GTiff" and source.nodata is None
    except NotGeoreferencedWarning:
        _raise_unplaced(file)
    except (RasterioError, ValueError, TypeError, OSError) as error:
        raise TerrainError(f"{file}: {failure_text}: {first_error_line(error)}", file=file) from error

    def read(top: int, bottom: int, left: int, right: int) -> NDArray[np.float32]:
        """Return the heights of a window of rows and columns; NaN for missing data."""
        try:
            with rasterio.Env(**GUARD), open_dataset(file, driver) as source:
                heights = _read_strips(source, (top, bottom, left, right), *scale)
                if may_have_gaps:
                    clear_unwritten(source, heights, top, left)
                return heights
        except (RasterioError, OSError) as error:
            raise TerrainError(f"{file}: cannot be read: {first_error_line(error)}", file=file) from error

    return _make_raster_file(file, shape, grid, crs, unit, read)


def first_error_line(error: BaseException) -> str:
    """Return the text of the original error in a chain of causes, in one line."""
    while error.__cause__ is not None:
        error = error.__cause__
    return one_line(error)


def _raise_unplaced(file: Path) -> NoReturn:
    """Raise TerrainError, because a file has no georeferencing."""
    auxiliary_file = file.with_name(f"{file.name}.aux.xml")
    unread_text = f" in the file itself; {auxiliary_file.name} is not read" if auxiliary_file.exists() else ""
    raise TerrainError(f"{file}: no coordinate reference system and position are stated{unread_text}", file=file)


def _read_crs(file: Path, driver: str, source: Any) -> str | None:
    """Return the reference system of an open file as WKT, with its height axis if any.

    Return None if the file states none.

    driver: GDAL driver of the file.
    source: the open file.
    """
    import rasterio

    if source.crs is None:
        return None
    wkt = source.crs.to_wkt(version="WKT2_2019")
    # GDAL drops the height axis of a three-dimensional system in a GeoTIFF 1.0 file, unless it takes EPSG's definition.
    with rasterio.Env(GTIFF_SRS_SOURCE="EPSG"), open_dataset(file, driver) as epsg_source:
        has_height = "CS[ellipsoidal,3]" in epsg_source.crs.to_wkt(version="WKT2_2019")
    return crs_to_wkt(wkt, with_height=has_height)


def _make_raster_file(
    file: Path, shape: tuple[int, int], grid: Grid, crs: str | None, unit: str, read: Any
) -> RasterFile:
    """Make a raster file from the georeferencing of an elevation file.

    shape: number of rows and columns.
    grid: coefficients of the transformation from pixels to coordinates of the reference system.
    unit: stated unit of the heights, "" if none is stated.
    read: function that reads a window of heights.

    Raises TerrainError without a usable position on Earth, or if the heights are not in metres.
    """
    a, b, c, d, e, f = grid
    determinant = a * e - b * d
    if crs is None or determinant == 0.0:
        _raise_unplaced(file)
    try:
        transformer, (height_unit_name, unit_length) = crs_transformer(crs), height_unit(crs)
    except ValueError as error:
        raise TerrainError(f"{file}: its reference system cannot be read: {one_line(error)}", file=file) from error
    if (unit or "m").lower() not in METRES or unit_length != 1.0:
        raise TerrainError.at(
            file, "unit of heights", height_unit_name if unit_length != 1.0 else unit, "expected metres"
        )
    rows, cols = shape
    middle_longitude = a * cols / 2 + b * rows / 2 + c if is_geographic(crs) else math.nan

    def to_pixels(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
        """Convert longitudes and latitudes (deg) to fractional columns and rows.

        Columns and rows are counted between pixel centres.
        """
        x, y = (
            np.asarray(coordinates)
            for coordinates in transform_points(transformer.transform, np.asarray(lon), np.asarray(lat))
        )
        if not math.isnan(middle_longitude):
            x = longitude_near(x, middle_longitude)
        col, row = (e * (x - c) - b * (y - f)) / determinant, (a * (y - f) - d * (x - c)) / determinant
        return col - 0.5, row - 0.5

    def to_lon_lat(col: Floats, row: Floats) -> tuple[Floats, Floats]:
        """Convert fractional columns and rows to longitudes and latitudes (deg).

        Columns and rows are counted between pixel centres.
        """
        pixel_x, pixel_y = col + 0.5, row + 0.5
        x, y = a * pixel_x + b * pixel_y + c, d * pixel_x + e * pixel_y + f
        lon, lat = transformer.transform(np.asarray(x), np.asarray(y), direction="INVERSE")
        return np.asarray(lon), np.asarray(lat)

    # The coordinates of a damaged file may overflow.
    with np.errstate(all="ignore"):
        corners = np.stack(to_lon_lat(*outline(cols, rows)), axis=1)
    if not (np.isfinite(corners).all() and np.abs(corners[:, 1]).max() <= 90.0):
        raise TerrainError(f"{file}: its outline does not lie on Earth", file=file)
    return RasterFile(str(file), shape, to_pixels, to_lon_lat, corners, file_sha256(file), read, grid, crs)


# ----------------------------------------------------------------------
# Windows of heights.


def _read_strips(source: Any, window: tuple[int, int, int, int], scale: float, offset: float) -> NDArray[np.float32]:
    """Read the heights of a window in strips of rows; NaN for missing data.

    window: first row, end row, first column, end column; the ends are not included.
    scale, offset: factor and addend that convert the file's numbers to heights.
    """
    top, bottom, left, right = window
    heights = np.empty((bottom - top, right - left), dtype=np.float32)
    rows_at_once = max(1, PIXELS_AT_ONCE // (right - left))
    for row in range(top, bottom, rows_at_once):
        rows = min(rows_at_once, bottom - row)
        strip = source.read(1, window=((row, row + rows), (left, right)), masked=True)
        # Numbers in a damaged file may overflow.
        with np.errstate(all="ignore"):
            heights[row - top : row - top + rows] = np.ma.filled(strip.astype(np.float64), np.nan) * scale + offset
    return heights


def clear_unwritten(source: Any, heights: NDArray[np.float32], top: int, left: int) -> None:
    """Set heights to NaN, in place, in the blocks that were never written to a GeoTIFF.

    source: the open file.
    top, left: row and column of the file at which ``heights`` starts.

    GDAL returns 0 for an omitted block if the file states no nodata value.
    """
    rows, cols = source.block_shapes[0]
    bottom, right = top + len(heights), left + heights.shape[1]
    for block_row in range(top // rows, -(-bottom // rows)):
        for block_column in range(left // cols, -(-right // cols)):
            if _block_bytes(source, block_row, block_column) is None:
                first_row, first_column = max(0, block_row * rows - top), max(0, block_column * cols - left)
                heights[first_row : (block_row + 1) * rows - top, first_column : (block_column + 1) * cols - left] = (
                    np.nan
                )


def _block_bytes(source: Any, block_row: int, block_column: int) -> tuple[int, int] | None:
    """Return the bytes [begin, end) that a block occupies in a GeoTIFF; None for a block never written."""
    offset, size = (
        source.get_tag_item(f"BLOCK_{tag}_{block_column}_{block_row}", "TIFF", bidx=1) for tag in ("OFFSET", "SIZE")
    )
    return None if offset is None or size is None else (int(offset), int(offset) + int(size))


def block_spans(file: Path, window: tuple[int, int, int, int]) -> Iterator[tuple[int, int]]:
    """Yield the bytes [begin, end) that each block of a window occupies in a GeoTIFF.

    window: first row, end row, first column, end column; the ends are not included.
    """
    import rasterio

    top, bottom, left, right = window
    if top >= bottom or left >= right:
        return
    with rasterio.Env(**GUARD), open_dataset(file, "GTiff") as source:
        rows, cols = source.block_shapes[0]
        for block_row in range(top // rows, -(-bottom // rows)):
            for block_column in range(left // cols, -(-right // cols)):
                if (span := _block_bytes(source, block_row, block_column)) is not None:
                    yield span


# ----------------------------------------------------------------------
# Writing.


def geotiff_bytes(values: NDArray[np.float32], grid: Grid, crs: str, nodata: float, unit: str = "m") -> bytes:
    """Return a GeoTIFF of heights or other values as bytes, compressed with deflate.

    values: (rows, columns), rows from north to south.
    grid: coefficients of the transformation from pixels to coordinates of the reference system.
    crs: reference system, in a form that PROJ accepts.
    nodata: number that stands for missing data.
    unit: unit of the values.
    """
    import rasterio
    from rasterio.io import MemoryFile

    rows, cols = values.shape
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "height": rows,
        "width": cols,
        "count": 1,
        "dtype": "float32",
        "crs": crs,
        "transform": rasterio.Affine(*grid),
        "nodata": nodata,
        "compress": "deflate",
        "predictor": 3,
    }
    with rasterio.Env(**GUARD), MemoryFile() as memory:
        with memory.open(**profile) as file:
            file.write(values, 1)
            file.units = (unit,)
        return bytes(memory.getbuffer())
