"""Elevation files: GeoTIFF, .hgt and .npz, read as a window at source resolution.

The driver is explicit and chosen by the file's first bytes, so that nothing that merely names another file
(VRT, a URL, a `/vsi` path) is ever opened.  Heights are taken as above mean sea level and never converted.
"""

import hashlib
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from world.errors import TerrainError
from world.frames import GeoOrigin, crs_transformer, fit_polymap, to_geo, to_map
from world.terrain import Terrain

Floats = NDArray[np.float64]
ToSource = Callable[[Floats, Floats], tuple[Floats, Floats]]

EMBEDDED = {"jacksboro": "jacksboro_fault_dem.npz"}
# A window with more pixels than this is refused before it is allocated.
MOST_PIXELS = 120_000_000
# Worst error allowed for the polynomial from map to pixels, in pixels.
PIXEL_TOLERANCE = 1e-3
EARTH_DATUM = "mean sea level, as the file's heights are taken"


@dataclass(frozen=True, slots=True)
class RasterFile:
    """An elevation file that was opened and understood, not yet read.

    to_source: longitude, latitude (deg) to fractional (col, row) of pixel centres.  shape: (rows, cols).
    corners: (n, 2) longitude, latitude along the outline of the pixel centres, deg.
    read: rows and columns half-open to a float32 block with NaN for nodata.
    """

    name: str
    shape: tuple[int, int]
    to_source: ToSource
    corners: Floats
    sha256: str
    read: Callable[[int, int, int, int], NDArray[np.float32]]

    @property
    def centre(self) -> GeoOrigin:
        """The middle of the tile."""
        lon, lat = (self.corners.min(axis=0) + self.corners.max(axis=0)) / 2
        return GeoOrigin(float(lat), float(lon))


def open_raster(path: str, base: Path | None = None) -> RasterFile:
    """Open an elevation file or an embedded name.  Relative paths count from ``base``.

    Raises TerrainError for anything that is not a single-band .tif, .hgt or .npz elevation file.
    """
    if path in EMBEDDED:
        from matplotlib import cbook

        found = cbook.get_sample_data(EMBEDDED[path], asfileobj=False)
        return _open_npz(Path(str(found)), path)
    if path.startswith("/vsi") or "://" in path:
        raise TerrainError(f"{path}: terrain path: only local files are read, not URLs or virtual file systems")
    file = Path(path) if base is None else base / path
    if not file.is_file():
        known = ", ".join(sorted(EMBEDDED))
        raise TerrainError(f"{file}: terrain path: no such file (a .tif, .hgt or .npz file, or one of: {known})")
    try:
        with file.open("rb") as handle:
            head = handle.read(4)
    except OSError as error:
        raise TerrainError(f"{file}: cannot be read: {error.strerror}") from error
    if head[:2] == b"PK":
        return _open_npz(file, str(path))
    if head in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _open_rasterio(file, "GTiff")
    if file.suffix.lower() == ".hgt":
        return _open_rasterio(file, "SRTMHGT")
    raise TerrainError(f"{file}: not an elevation file: a GeoTIFF, an SRTM .hgt or an .npz with `elevation` is expected")


def read_terrain(raster: RasterFile, origin: GeoOrigin, bounds: ArrayLike, margin: float) -> Terrain:
    """The window of ``raster`` that covers map ``bounds`` [[e0, e1], [n0, n1]] m and a margin, as `Terrain`.

    Raises TerrainError where the bounds reach beyond the tile, where data is missing inside them, or where
    the window is too large.  The margin is cut at the tile's edge in silence.
    """
    box = np.asarray(bounds, dtype=np.float64)
    rows, cols = raster.shape
    e0, e1, n0, n1 = _outline_window(raster, origin, box, 0.0)
    if e0 < -1e-6 or n0 < -1e-6 or e1 > cols - 1 + 1e-6 or n1 > rows - 1 + 1e-6:
        raise TerrainError(
            f"{raster.name}: area east {box[0, 0]:.0f}..{box[0, 1]:.0f} m, north {box[1, 0]:.0f}..{box[1, 1]:.0f} m "
            f"reaches beyond the tile, which covers {_tile_cover(raster, origin)}"
        )
    c0, c1, r0, r1 = _outline_window(raster, origin, box, margin)
    left, right = max(0, math.floor(c0) - 1), min(cols, math.ceil(c1) + 2)
    top, bottom = max(0, math.floor(r0) - 1), min(rows, math.ceil(r1) + 2)
    if (right - left) * (bottom - top) > MOST_PIXELS:
        raise TerrainError(
            f"{raster.name}: the area needs {(right - left) * (bottom - top):,} pixels; at most {MOST_PIXELS:,} are read"
        )
    heights = raster.read(top, bottom, left, right)
    to_pixel = fit_polymap(
        lambda e, n: _shifted(raster.to_source, origin, e, n, left, top),
        box + np.array([-margin, margin]),
        PIXEL_TOLERANCE,
    )
    if to_pixel.residual > 10 * PIXEL_TOLERANCE:
        raise TerrainError(f"{raster.name}: the area is too large to map: {to_pixel.residual:.2g} pixels of error")
    middle = box.mean(axis=1)
    col, row = to_pixel(middle[0] + np.array([0.0, 100.0, 0.0]), middle[1] + np.array([0.0, 0.0, 100.0]))
    # Columns and rows per metre of the map; the pitch is the length of the shorter pixel side.
    per_metre = np.array([[col[1] - col[0], col[2] - col[0]], [row[1] - row[0], row[2] - row[0]]]) / 100.0
    pitch = float(np.min(np.linalg.norm(np.linalg.inv(per_metre), axis=0)))
    terrain = Terrain(heights, to_pixel, pitch, raster.name, raster.sha256, EARTH_DATUM)
    _refuse_holes(terrain, (c0, c1, r0, r1), left, top, box)
    return terrain


def _refuse_holes(
    terrain: Terrain, window: tuple[float, float, float, float], left: int, top: int, box: Floats
) -> None:
    if not np.isnan(terrain.heights).any():
        return
    bad_rows, bad_cols = np.nonzero(np.isnan(terrain.heights))
    east = np.linspace(box[0, 0], box[0, 1], 200)
    north = np.linspace(box[1, 0], box[1, 1], 200)
    grid_e, grid_n = np.meshgrid(east, north)
    holes = np.isnan(terrain.height(grid_e, grid_n))
    if holes.any():
        row, col = np.argwhere(holes)[0]
        raise TerrainError(
            f"{terrain.source}: no data at east {east[col]:.0f} m, north {north[row]:.0f} m "
            f"({bad_rows.size} of {terrain.heights.size} pixels of the area have none); choose an area with data"
        )


def _outline_window(
    raster: RasterFile, origin: GeoOrigin, box: Floats, margin: float
) -> tuple[float, float, float, float]:
    """Range of cols and rows that the outline of a map box takes: (col0, col1, row0, row1)."""
    ramp = np.linspace(0.0, 1.0, 41)
    (w, e), (s, n) = box + np.array([-margin, margin])
    east = np.concatenate([w + ramp * (e - w), w + ramp * (e - w), np.full(41, w), np.full(41, e)])
    north = np.concatenate([np.full(41, s), np.full(41, n), s + ramp * (n - s), s + ramp * (n - s)])
    col, row = _shifted(raster.to_source, origin, east, north, 0, 0)
    return float(col.min()), float(col.max()), float(row.min()), float(row.max())


def _shifted(
    to_source: ToSource, origin: GeoOrigin, east: Floats, north: Floats, left: int, top: int
) -> tuple[Floats, Floats]:
    lat, lon = to_geo(origin, east, north)
    col, row = to_source(lon, lat)
    return np.asarray(col) - left, np.asarray(row) - top


def tile_bounds(raster: RasterFile, origin: GeoOrigin) -> Floats:
    """The largest upright map box inside the tile, [[e0, e1], [n0, n1]] m, shrunk by half a pixel or so."""
    east, north = to_map(origin, raster.corners[:, 1], raster.corners[:, 0])
    middle_e, middle_n = (east.min() + east.max()) / 2, (north.min() + north.max()) / 2
    half = np.array([(east.max() - east.min()) / 2, (north.max() - north.min()) / 2])
    rows, cols = raster.shape
    for share in np.arange(0.995, 0.3, -0.005):
        box = np.array(
            [
                [middle_e - share * half[0], middle_e + share * half[0]],
                [middle_n - share * half[1], middle_n + share * half[1]],
            ]
        )
        c0, c1, r0, r1 = _outline_window(raster, origin, box, 0.0)
        if c0 >= 0 and r0 >= 0 and c1 <= cols - 1 and r1 <= rows - 1:
            return box
    raise TerrainError(f"{raster.name}: no upright area fits inside the tile; give [area]")


def _tile_cover(raster: RasterFile, origin: GeoOrigin) -> str:
    east, north = to_map(origin, raster.corners[:, 1], raster.corners[:, 0])
    return f"east {east.min():.0f}..{east.max():.0f} m, north {north.min():.0f}..{north.max():.0f} m"


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as handle:
        while block := handle.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _outline(cols: int, rows: int) -> tuple[Floats, Floats]:
    ramp = np.linspace(0.0, 1.0, 21)
    zero, one = np.zeros(21), np.ones(21)
    col = np.concatenate([ramp, ramp, zero, one]) * (cols - 1)
    row = np.concatenate([zero, one, ramp, ramp]) * (rows - 1)
    return col, row


def _open_npz(file: Path, name: str) -> RasterFile:
    """An .npz with `elevation` (rows from north to south) and xmin, xmax, ymin, ymax: pixel edges in degrees.

    The order within each pair does not matter: the tile that matplotlib ships has ymin and ymax swapped.
    """
    try:
        with np.load(file, allow_pickle=False) as data:
            heights = np.asarray(data["elevation"])
            edges = [float(data[key]) for key in ("xmin", "xmax", "ymin", "ymax")]
    except KeyError as error:
        raise TerrainError(f"{name}: field {error.args[0]}: missing (elevation, xmin, xmax, ymin, ymax)") from error
    except (OSError, ValueError, TypeError, EOFError) as error:
        raise TerrainError(f"{name}: not a readable .npz elevation file: {_line(error)}") from error
    if heights.ndim != 2 or min(heights.shape) < 2 or heights.dtype.kind not in "iuf":
        raise TerrainError(f"{name}: elevation: a 2-D array of numbers of at least 2 x 2 is expected, got {heights.shape}")
    west, east = sorted(edges[:2])
    south, north = sorted(edges[2:])
    if not (-180.0 <= west < east <= 360.0 and -90.0 <= south < north <= 90.0):
        raise TerrainError(f"{name}: xmin..ymax: {edges}: degrees of longitude -180..360 and latitude -90..90 are expected")
    rows, cols = heights.shape
    pitch_x, pitch_y = (east - west) / cols, (north - south) / rows

    def to_source(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
        return (lon - west) / pitch_x - 0.5, (north - lat) / pitch_y - 0.5

    def read(top: int, bottom: int, left: int, right: int) -> NDArray[np.float32]:
        return heights[top:bottom, left:right].astype(np.float32)

    col, row = _outline(cols, rows)
    corners = np.stack([west + (col + 0.5) * pitch_x, north - (row + 0.5) * pitch_y], axis=1)
    return RasterFile(name, (rows, cols), to_source, corners, _sha256(file), read)


def _open_rasterio(file: Path, driver: str) -> RasterFile:
    import rasterio
    from rasterio.errors import RasterioError, RasterioIOError
    from rasterio.windows import Window

    guard: dict[str, Any] = {
        "GDAL_PAM_ENABLED": "NO",
        "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
        "CPL_VSIL_CURL_ALLOWED_EXTENSIONS": ".none",
    }
    try:
        with rasterio.Env(**guard), rasterio.open(os.fspath(file.resolve()), driver=driver) as source:
            if source.count != 1:
                raise TerrainError(f"{file}: bands: {source.count}; an elevation file has 1")
            if source.crs is None:
                raise TerrainError(f"{file}: no coordinate reference system is stated")
            inverse = ~source.transform
            forward = source.transform
            rows, cols = source.height, source.width
            transformer = crs_transformer(source.crs.to_wkt())
    except (RasterioError, RasterioIOError, ValueError, OSError) as error:
        raise TerrainError(f"{file}: not a readable {driver} file: {_line(error)}") from error
    if min(rows, cols) < 2:
        raise TerrainError(f"{file}: size {cols} x {rows}: at least 2 x 2 pixels are expected")

    def to_source(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
        x, y = transformer.transform(lon, lat)
        col, row = inverse * (np.asarray(x), np.asarray(y))
        return np.asarray(col) - 0.5, np.asarray(row) - 0.5

    def read(top: int, bottom: int, left: int, right: int) -> NDArray[np.float32]:
        try:
            with rasterio.Env(**guard), rasterio.open(os.fspath(file.resolve()), driver=driver) as opened:
                block = opened.read(1, window=Window(left, top, right - left, bottom - top), masked=True)
        except (RasterioError, RasterioIOError, OSError) as error:
            raise TerrainError(f"{file}: cannot be read: {_line(error)}") from error
        return np.asarray(np.ma.filled(block.astype(np.float32), np.nan))

    col, row = _outline(cols, rows)
    x, y = forward * (col + 0.5, row + 0.5)
    lon, lat = transformer.transform(np.asarray(x), np.asarray(y), direction="INVERSE")
    return RasterFile(str(file), (rows, cols), to_source, np.stack([lon, lat], axis=1), _sha256(file), read)


def _line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
