"""Write the terrain of an area as one GeoTIFF.

The sources are a folder of tiles, or a server of Copernicus GLO-30 tiles.

The server has the layout of the Copernicus DEM in the AWS registry of open data: a folder for each degree, with a
cloud-optimised GeoTIFF in it.  Only the blocks that cover the area are fetched.  A degree without a tile is open sea,
or land that is not published: the Copernicus DEM lacks some tiles.
Heights are above EGM2008 (Copernicus DEM Product Handbook, GEO.2018-1988-2, "Vertical datum").
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.arrays import Heights
from world.errors import TerrainError
from world.files import write_atomically
from world.gdal_raster import block_spans, geotiff_bytes, open_geotiff
from world.raster import MAX_PIXELS, open_raster
from world.raster_file import RasterFile, is_ground, shift_grid
from world.remote_files import RemoteFile, find_remote

Floats = NDArray[Any]

# Server of the Copernicus GLO-30 tiles.
COPERNICUS = "https://copernicus-dem-30m.s3.amazonaws.com"
# Largest number of tiles for an area: 100 would be about 3 GB.
MAX_FETCHED = 25
# Number of pixels fetched beyond each edge of an area.
_MARGIN_PIXELS = 5
# Number of bytes fetched first from a tile, which hold its directory; the directory of a GLO-30 tile takes 6 kB.
_DIRECTORY_BYTES = 2**16
# WGS 84 with heights above EGM2008.
_SYSTEM = "EPSG:4326+3855"
# Value that marks missing data in written files.
_NODATA = -32768.0

# Progress callback: the work done, the expected total, and a remark.
CutProgress = Callable[[float, float, str], None]


class Box(NamedTuple):
    """Area in degrees."""

    south: float
    west: float
    north: float
    east: float


class CutTerrain(NamedTuple):
    """Terrain of an area that was written to a file.

    file: the GeoTIFF.
    shape: its number of rows and columns.
    tiles: names of the tiles or files that it was made from.
    absent: degrees (south-west corners) for which the server has no tile.
    empty: number of pixels without data.
    fetched: number of bytes received from the server.
    """

    file: Path
    shape: tuple[int, int]
    tiles: tuple[str, ...]
    absent: tuple[tuple[int, int], ...]
    empty: int
    fetched: int


# ----------------------------------------------------------------------
# Cut from a folder, a file or a virtual raster.


def cut_from_files(source: Path, box: Box, out: Path) -> CutTerrain:
    """Write the part of local elevation files that covers an area as one GeoTIFF.

    source: a folder of tiles, a file or a virtual raster.
    out: path of the GeoTIFF.

    The file has the reference system and the grid of the tiles. Raises TerrainError if the tiles do not reach beyond
    the area, have no data in it, or cannot be read.
    """
    raster = open_raster(str(source))
    col, row = raster.to_pixels(*_box_outline(box))
    rows, cols = raster.shape
    if not (col.min() >= 0.0 and row.min() >= 0.0 and col.max() <= cols - 1 and row.max() <= rows - 1):
        south, west, north, east = box
        area_text = f"latitude {south:.4f}..{north:.4f}, longitude {west:.4f}..{east:.4f}"
        raise TerrainError(
            f"{raster.name}: does not cover {area_text}", file=raster.name, field="area", value=tuple(box)
        )
    top, left = max(0, math.floor(row.min()) - 1), max(0, math.floor(col.min()) - 1)
    bottom, right = min(rows, math.ceil(row.max()) + 2), min(cols, math.ceil(col.max()) + 2)
    heights = raster.read(top, bottom, left, right)
    _write_geotiff(out, heights, shift_grid(raster.grid, top, left), raster.crs or "EPSG:4326")
    return CutTerrain(out, (bottom - top, right - left), (raster.name,), (), _count_empty(heights), 0)


def _box_outline(box: Box) -> tuple[Floats, Floats]:
    """Return longitudes and latitudes of points along the edge of an area, deg."""
    ramp = np.linspace(0.0, 1.0, 41)
    lons, lats = box.west + ramp * (box.east - box.west), box.south + ramp * (box.north - box.south)
    lon = np.concatenate([lons, lons, np.full(41, box.west), np.full(41, box.east)])
    lat = np.concatenate([np.full(41, box.south), np.full(41, box.north), lats, lats])
    return lon, lat


def _count_empty(heights: Heights) -> int:
    """Return the number of heights that are missing: NaN, or a value that marks missing data."""
    return int(heights.size - is_ground(heights).sum())


def _write_geotiff(out: Path, heights: Heights, grid: Sequence[float], crs: str) -> None:
    """Write heights as a GeoTIFF, completely or not at all.

    grid: affine coefficients that convert columns and rows to coordinates.
    crs: reference system of these coordinates.

    Raises TerrainError for too many heights, or if all are missing.
    """
    if heights.size > MAX_PIXELS:
        message = f"{heights.size:,} pixels; at most {MAX_PIXELS:,} are written"
        raise TerrainError(f"{out}: {message}", file=out, value=heights.size, allowed=message)
    if _count_empty(heights) == heights.size:
        raise TerrainError(f"{out}: the tiles have no data in the area", file=out)
    filled_heights = np.where(is_ground(heights), heights, np.float32(_NODATA))
    write_atomically(out, geotiff_bytes(filled_heights, tuple(grid), crs, _NODATA))


# ----------------------------------------------------------------------
# Cut from a server.


def tile_name(lat: int, lon: int) -> str:
    """Return the name of a GLO-30 tile with this south-west corner, degrees.

    >>> tile_name(46, 8), tile_name(-34, -71)
    ('Copernicus_DSM_COG_10_N46_00_E008_00_DEM', 'Copernicus_DSM_COG_10_S34_00_W071_00_DEM')
    """
    north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"Copernicus_DSM_COG_10_{north}{abs(lat):02d}_00_{east}{abs(lon):03d}_00_DEM"


def degree_corners(box: Box) -> list[tuple[int, int]]:
    """Return the south-west corner of each one-degree square that an area touches.

    Longitudes are in -180..179.

    >>> degree_corners(Box(46.9, 8.2, 47.1, 8.3)), degree_corners(Box(-0.1, 179.9, 0.0, 180.1))
    ([(46, 8), (47, 8)], [(-1, 179), (-1, -180), (0, 179), (0, -180)])
    """
    lats = range(math.floor(box.south), math.floor(box.north) + 1)
    lons = range(math.floor(box.west), math.floor(box.east) + 1)
    return [(lat, (lon + 180) % 360 - 180) for lat in lats for lon in lons]


def cut_from_server(server: str, box: Box, out: Path, cache: Path, progress: CutProgress, *, sea: bool) -> CutTerrain:
    """Fetch the part of a server's tiles that covers an area, and write it as one GeoTIFF.

    server: address of the folder with the tiles.
    cache: folder for the fetched parts.
    progress: function that is called with the work done, the total and a remark.
    sea: True if one-degree squares without a tile are sea, at 0 m; otherwise they have no data.

    Where tiles of different pixel size meet (at latitudes of 50, 60, 70, 75, 80 and 85 degrees), the coarser tiles are
    interpolated to the grid of the finest tile. Raises TerrainError if the server cannot be reached or does not answer
    as expected.
    """
    # The edge of a tile is half a pixel off its degree: an area close to that edge needs the neighbouring tile, too.
    fetched_box = Box(box.south - 0.001, box.west - 0.001, box.north + 0.001, box.east + 0.001)
    degrees = degree_corners(fetched_box)
    if len(degrees) > MAX_FETCHED:
        allowed = f"at most {MAX_FETCHED} tiles are fetched; choose a smaller area"
        raise TerrainError(f"{server}: the area needs {len(degrees)} tiles: {allowed}", file=server, allowed=allowed)
    remote_files = {}
    for index, degree in enumerate(degrees):
        name = tile_name(*degree)
        progress(index, 10.0 * len(degrees), f"looking for {name}")
        remote_files[degree] = find_remote(f"{server.rstrip('/')}/{name}/{name}.tif", cache)
    remotes = {degree: remote for degree, remote in remote_files.items() if remote is not None}
    if not remotes:
        raise TerrainError(
            f"{server}: the server has no tile for this area. Either the area is open sea, or the server has no"
            " Copernicus"
            " GLO-30 tiles",
            file=server,
        )
    fetched_bytes = 0
    tiles = []
    for index, (degree, remote) in enumerate(remotes.items()):

        def count_bytes(byte_count: int, tile_index: int = index, name: str = remote.copy.name) -> None:
            """Count the bytes of a tile that have arrived, and report the progress."""
            nonlocal fetched_bytes
            fetched_bytes += byte_count
            progress(len(remotes) + 9.0 * tile_index, 10.0 * len(remotes), f"{name}: {fetched_bytes / 1e6:.1f} MB")

        tiles.append(_georeference_tile(_fetch_tile(remote, fetched_box, count_bytes), degree, box))
    heights, grid = _merge_tiles(tiles, box)
    absent_degrees = tuple(degree for degree, remote in remote_files.items() if remote is None)
    if sea:
        dx, _, west, _, dy, north = grid
        lon, lat = west + (np.arange(heights.shape[1]) + 0.5) * dx, north + (np.arange(len(heights)) + 0.5) * dy
        for south_degree, west_degree in absent_degrees:
            # Tiles reach half a pixel beyond their degree; one pixel is added.
            is_in_columns = np.abs((lon - west_degree - 0.5 + 180.0) % 360.0 - 180.0) <= 0.5 + abs(dx)
            is_in_rows = np.abs(lat - south_degree - 0.5) <= 0.5 + abs(dy)
            degree_heights = heights[np.ix_(is_in_rows, is_in_columns)]
            degree_heights[np.isnan(degree_heights)] = 0.0
            heights[np.ix_(is_in_rows, is_in_columns)] = degree_heights
    _write_geotiff(out, heights, grid, _SYSTEM)
    rows, cols = heights.shape
    names = tuple(tile_name(*degree) for degree in remotes)
    return CutTerrain(out, (rows, cols), names, absent_degrees, _count_empty(heights), fetched_bytes)


def _fetch_tile(remote: RemoteFile, box: Box, count_bytes: Callable[[int], None]) -> RasterFile:
    """Fetch the blocks of a tile that cover an area, and open the local copy of the tile.

    count_bytes: function that is called with the number of bytes of each chunk that arrives.

    If the copy cannot be read, for example after a power cut or because of a proxy, the tile is fetched once more.
    Raises TerrainError if it cannot be read then, or if it cannot be fetched.
    """
    for is_last in (not remote.parts, True):
        try:
            tile = _open_copy(remote, count_bytes, (_DIRECTORY_BYTES, remote.size) if is_last else (_DIRECTORY_BYTES,))
            # Rows and columns that cover the area, with a margin for interpolation to another grid.
            col, row = tile.to_pixels(*_box_outline(box))
            rows, cols = tile.shape
            ends = (
                (row.min() - _MARGIN_PIXELS, row.max() + _MARGIN_PIXELS + 2.0),
                (col.min() - _MARGIN_PIXELS, col.max() + _MARGIN_PIXELS + 2.0),
            )
            top, bottom = (int(np.clip(value, 0, rows)) for value in ends[0])
            left, right = (int(np.clip(value, 0, cols)) for value in ends[1])
            window = top, bottom, left, right
            for begin, end in block_spans(remote.copy, window):
                remote.fetch(begin, end, count_bytes)
            if window[0] < window[1] and window[2] < window[3]:
                tile.read(*window)
            return replace(tile, name=remote.url)
        except _UnreadableError as error:
            remote.clear_copy()
            if is_last:
                message = f"{remote.url}: the server's answer is not a readable GeoTIFF"
                raise TerrainError(message, file=remote.url) from error
    raise AssertionError


class _UnreadableError(Exception):
    """Error for a copy that is not a GeoTIFF, or has a block that cannot be unpacked."""


def _open_copy(remote: RemoteFile, count_bytes: Callable[[int], None], sizes: Sequence[int]) -> RasterFile:
    """Fetch the directory of a tile, and open the local copy of the tile.

    sizes: numbers of bytes to fetch from the start of the file, tried in turn.

    The directory of a file that is not cloud-optimised may be longer, or at the end of the file. Raises TerrainError if
    the bytes cannot be fetched, and _UnreadableError if the file cannot be opened.
    """
    for size in sizes:
        remote.fetch(0, size, count_bytes)
        try:
            tile = open_geotiff(remote.copy, remote.url)
        except TerrainError:
            continue

        def read(*window: int, tile: RasterFile = tile) -> Heights:
            """Return the heights of the window. Raises _UnreadableError if the copy cannot be read."""
            try:
                return tile.read(*window)
            except TerrainError as error:
                raise _UnreadableError from error

        return replace(tile, read=read)
    raise _UnreadableError


# Largest offset of a tile from its degree, deg.
_MAX_TILE_OFFSET_DEG = 0.02
# Rounding tolerance for positions on a grid, pixels.
_PIXEL_TOLERANCE = 1e-3


class _PlacedTile(NamedTuple):
    """One-degree tile with its grid of longitudes and latitudes.

    raster: the tile.
    west, north: outer edges, deg; the longitude is shifted by multiples of 360 degrees to match the area.
    dx, dy: size of a pixel, deg.
    """

    raster: RasterFile
    west: float
    north: float
    dx: float
    dy: float


def _georeference_tile(tile: RasterFile, degree: tuple[int, int], box: Box) -> _PlacedTile:
    """Return a one-degree tile with its grid of latitude and longitude, checked against its degree.

    The longitude is shifted by a multiple of 360 degrees to match the longitudes of the area.

    degree: latitude and longitude of the tile's south-west corner.

    Raises TerrainError for a tile without a north-up grid of latitude and longitude over this degree.
    """
    dx, column_skew, west, row_skew, dy, north = tile.grid
    if column_skew or row_skew or not dx > 0.0 > dy:
        raise TerrainError(f"{tile.name}: expected a grid of longitudes and latitudes", file=tile.name)
    offset = max(abs(north - degree[0] - 1.0), abs((west - degree[1] + 180.0) % 360.0 - 180.0))
    if (
        offset > _MAX_TILE_OFFSET_DEG
        or abs(dx * tile.shape[1] - 1.0) > _MAX_TILE_OFFSET_DEG
        or abs(-dy * tile.shape[0] - 1.0) > _MAX_TILE_OFFSET_DEG
    ):
        lat, lon = degree
        allowed = f"expected latitude {lat}..{lat + 1}, longitude {lon}..{lon + 1}"
        raise TerrainError(
            f"{tile.name}: does not cover the area of its name: {allowed}", file=tile.name, allowed=allowed
        )
    turn_count = round(((box.west + box.east) / 2.0 - (west + dx * tile.shape[1] / 2.0)) / 360.0)
    return _PlacedTile(tile, west + 360.0 * turn_count, north, dx, -dy)


def _merge_tiles(tiles: list[_PlacedTile], box: Box) -> tuple[Heights, tuple[float, ...]]:
    """Return the heights of an area on the grid of the finest tile.

    Also return the affine coefficients of this grid.

    Heights are NaN where there is no tile.
    """
    finest = min(tiles, key=lambda tile: tile.dx)
    # First and last pixels whose centres enclose the area, relative to the first pixel of the finest tile.
    left = math.floor((box.west - finest.west) / finest.dx - 0.5 + _PIXEL_TOLERANCE)
    right = math.ceil((box.east - finest.west) / finest.dx - 0.5 - _PIXEL_TOLERANCE) + 1
    top = math.floor((finest.north - box.north) / finest.dy - 0.5 + _PIXEL_TOLERANCE)
    bottom = math.ceil((finest.north - box.south) / finest.dy - 0.5 - _PIXEL_TOLERANCE) + 1
    if (right - left) * (bottom - top) > MAX_PIXELS:
        allowed = f"at most {MAX_PIXELS:,} are written; choose a smaller area"
        count = (right - left) * (bottom - top)
        raise TerrainError.at(finest.raster.name, "pixels", count, allowed, shown=f"{count:,}")
    west, north = finest.west + left * finest.dx, finest.north - top * finest.dy
    lon, lat = west + (np.arange(right - left) + 0.5) * finest.dx, north - (np.arange(bottom - top) + 0.5) * finest.dy
    heights = np.full((lat.size, lon.size), np.nan, dtype=np.float32)
    for tile in sorted(tiles, key=lambda tile: tile.dx):
        _fill_from_tile(heights, lat, lon, tile)
    return heights, (finest.dx, 0.0, west, 0.0, -finest.dy, north)


def _fill_from_tile(heights: Heights, lat: Floats, lon: Floats, tile: _PlacedTile) -> None:
    """Fill the empty points of a grid from a tile, by interpolation, in place.

    heights: heights of the grid, m, (rows, columns); NaN where they are missing.
    lat, lon: latitudes of its rows and longitudes of its columns, deg.
    """
    rows, cols = tile.raster.shape
    col, row = (lon - tile.west) / tile.dx - 0.5, (tile.north - lat) / tile.dy - 0.5
    # A tile covers half a pixel beyond the centres of its outermost pixels.
    columns = np.flatnonzero((col > -0.5) & (col < cols - 0.5))
    rows_covered = np.flatnonzero((row > -0.5) & (row < rows - 0.5))
    if not columns.size or not rows_covered.size:
        return
    # Snap positions to pixels that are nearly there: their heights stay unchanged, and need no neighbouring pixel.
    col, row = (
        np.where(np.abs(position - np.round(position)) < _PIXEL_TOLERANCE, np.round(position), position)
        for position in (np.clip(col[columns], 0.0, cols - 1.0), np.clip(row[rows_covered], 0.0, rows - 1.0))
    )
    left, top = int(col[0]), int(row[0])
    tile_heights = tile.raster.read(top, min(rows, int(row[-1]) + 2), left, min(cols, int(col[-1]) + 2))
    tile_heights[~is_ground(tile_heights)] = np.nan
    area_heights = heights[rows_covered[0] : rows_covered[-1] + 1, columns[0] : columns[-1] + 1]
    # Bilinear interpolation.
    row, col = row - top, col - left
    r0, c0 = np.floor(row).astype(int), np.floor(col).astype(int)
    r1, c1 = np.minimum(r0 + 1, tile_heights.shape[0] - 1), np.minimum(c0 + 1, tile_heights.shape[1] - 1)
    row_fractions, col_fractions = (row - r0)[:, None], (col - c0)[None, :]

    def blend(first: Heights, second: Heights, fraction: Floats) -> Floats:
        """Return the mean of two arrays, weighted by a fraction of the second."""
        return np.where(fraction == 0.0, first, (1.0 - fraction) * first + fraction * second)

    upper = blend(tile_heights[np.ix_(r0, c0)], tile_heights[np.ix_(r0, c1)], col_fractions)
    lower = blend(tile_heights[np.ix_(r1, c0)], tile_heights[np.ix_(r1, c1)], col_fractions)
    values = blend(upper.astype(np.float32), lower.astype(np.float32), row_fractions).astype(np.float32)
    is_empty = np.isnan(area_heights)
    area_heights[is_empty] = values[is_empty]
