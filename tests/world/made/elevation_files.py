"""Elevation files of one made tile, in every format, and what reads them or is refused."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from pyproj import Transformer
from rasterio.transform import Affine

from world.arrays import Floats
from world.errors import TerrainError
from world.frames import GeoOrigin
from world.raster import open_raster, read_terrain, require_covered, require_no_holes
from world.terrain import Terrain


def from_origin(west: float, north: float, width: float, height: float) -> Affine:
    """Header of a raster with its north-west corner here (rasterio's own warns of a change in `affine`)."""
    return Affine(width, 0.0, west, 0.0, -height, north)


# The made tile: 1 arc second, 0.1 by 0.08 degrees, smooth enough to be read alike from another grid.
WEST, NORTH, PITCH = 8.0, 46.1, 1.0 / 3600.0
COLS, ROWS = 360, 288
MIDDLE = GeoOrigin(NORTH - ROWS * PITCH / 2, WEST + COLS * PITCH / 2)
# Of the area about the middle that is read, m.
BOUNDS = np.array([[-2500.0, 2500.0], [-2500.0, 2500.0]])


def made_ground(lon: Floats, lat: Floats) -> Floats:
    """Made hills, m, as a function of degrees: different in every direction."""
    u, v = (lon - WEST) * 100, (lat - 46.0) * 100
    return 900.0 + 300.0 * np.sin(u / 1.7) * np.cos(v / 2.3) + 60.0 * u - 25.0 * v


def made_tile() -> NDArray[np.float32]:
    """Heights of the made tile, m, rows from north to south."""
    lon = WEST + (np.arange(COLS) + 0.5) * PITCH
    lat = NORTH - (np.arange(ROWS) + 0.5) * PITCH
    return made_ground(lon[None, :], lat[:, None]).astype(np.float32)


def write_raster(path: Path, heights: NDArray[Any], crs: str, transform: Affine, **more: Any) -> Path:
    """A GeoTIFF with these heights, in a reference system."""
    profile = {"driver": "GTiff", "height": heights.shape[0], "width": heights.shape[1], "count": 1}
    with rasterio.open(path, "w", **profile, dtype=heights.dtype, crs=crs, transform=transform, **more) as out:
        out.write(heights, 1)
    return path


def write_npz(path: Path, **changes: Any) -> Path:
    """The made tile as .npz; None leaves a field out."""
    fields: dict[str, Any] = {
        "elevation": made_tile(),
        "xmin": WEST,
        "xmax": WEST + COLS * PITCH,
        "ymin": NORTH - ROWS * PITCH,
        "ymax": NORTH,
    }
    np.savez_compressed(path, **{key: value for key, value in (fields | changes).items() if value is not None})
    return path


def write_geotiff(path: Path, heights: NDArray[Any] | None = None, **more: Any) -> Path:
    """The made tile, or other heights, as a GeoTIFF in degrees."""
    return write_raster(
        path, made_tile() if heights is None else heights, "EPSG:4326", from_origin(WEST, NORTH, PITCH, PITCH), **more
    )


def write_in_crs(path: Path, crs: str = "EPSG:32632", pitch: float = 20.0) -> Path:
    """The same hills on a grid of ``pitch`` in a CRS, tilted to the meridians."""
    back = Transformer.from_crs(crs, 4326, always_xy=True)
    lat, lon = MIDDLE.lat_deg, MIDDLE.lon_deg
    x, y = back.transform(
        lon + 0.05 * np.array([-1, -1, 1, 1]), lat + 0.04 * np.array([-1, 1, -1, 1]), direction="INVERSE"
    )
    transform = from_origin(x.min(), y.max(), pitch, pitch)
    col, row = np.meshgrid(np.arange(int(np.ptp(x) / pitch)) + 0.5, np.arange(int(np.ptp(y) / pitch)) + 0.5)
    lon, lat = back.transform(transform.a * col + transform.c, transform.e * row + transform.f)
    return write_raster(path, made_ground(np.asarray(lon), np.asarray(lat)).astype(np.float32), crs, transform)


def write_hgt(folder: Path) -> Path:
    """An SRTM3 tile: 1201 by 1201 posts, the outer ones on whole degrees."""
    lon = 8.0 + np.arange(1201) / 1200.0
    lat = 47.0 - np.arange(1201) / 1200.0
    heights = np.round(made_ground(lon[None, :], lat[:, None])).astype(">i2")
    path = folder / "N46E008.hgt"
    path.write_bytes(heights.tobytes())
    return path


def read_window(
    path: Path | str, bounds: Floats = BOUNDS, origin: GeoOrigin = MIDDLE, buffer: float = 500.0
) -> Terrain:
    return read_terrain(open_raster(str(path)), origin, bounds, buffer)


def _read_whole_window(path: Path | str, bounds: Floats = BOUNDS, origin: GeoOrigin = MIDDLE) -> None:
    """Read a window that must lie inside the file and its data."""
    require_covered(open_raster(str(path)), origin, bounds)
    require_no_holes(read_window(path, bounds, origin), bounds)


def assert_refused(path: Path | str, match: str, **options: Any) -> None:
    """A file is refused in one line that matches, and no warning is given."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(TerrainError, match=match) as caught:
            _read_whole_window(path, **options)
    assert "\n" not in str(caught.value)
