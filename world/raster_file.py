"""An elevation file that was opened and understood: what `world.raster` reads windows from; and the .npz form."""

import hashlib
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from world.errors import TerrainError
from world.frames import GeoOrigin

Floats = NDArray[np.float64]
ToSource = Callable[[Floats, Floats], tuple[Floats, Floats]]

# A window, or an .npz file, with more pixels than this is refused before it is allocated.
MOST_PIXELS = 120_000_000
# Rows of the tile that we ship (matplotlib does, too), and what it states as xmin, xmax, ymin and ymax, deg; a copy of
# it under another name is known by them, to a hundredth of a pixel.
_TILE_ROWS, _TILE_EDGES, _SAME_EDGE = 344, (-84.41375, -84.07791667, 36.73291667, 36.44625), 1e-5


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
        """The middle of the tile, its longitude in -180..180 also where the tile lies across the 180th meridian."""
        lat = (self.corners[:, 1].min() + self.corners[:, 1].max()) / 2
        lon = longitude_near(self.corners[:, 0], float(self.corners[0, 0]))
        return GeoOrigin(float(lat), float(longitude_near((lon.min() + lon.max()) / 2, 0.0)))


def longitude_near(lon: NDArray[np.float64] | float, middle: float) -> Floats:
    """Return the same longitudes (deg) within 180 degrees of ``middle``; one that is there already is unchanged."""
    return np.asarray(lon - 360.0 * np.round((np.asarray(lon) - middle) / 360.0))


def outline(cols: int, rows: int) -> tuple[Floats, Floats]:
    """Columns and rows, (84,) each, along the outline of a raster's pixel centres."""
    ramp = np.linspace(0.0, 1.0, 21)
    zero, one = np.zeros(21), np.ones(21)
    col = np.concatenate([ramp, ramp, zero, one]) * (cols - 1)
    row = np.concatenate([zero, one, ramp, ramp]) * (rows - 1)
    return col, row


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, in hex."""
    digest = hashlib.sha256()
    with path.open("rb") as handle:
        while block := handle.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def one_line(error: BaseException) -> str:
    """First line of an error's text, or its type where it has none."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def open_npz(file: Path, name: str) -> RasterFile:
    """Open an .npz with `elevation` (rows from north to south) and xmin, xmax, ymin, ymax: pixel edges in degrees.

    The order within each pair does not matter, but for the tile that we ship: see `_edges`.
    Raises TerrainError.
    """
    heights, edges = _read_npz(file, name)
    if heights.ndim != 2 or min(heights.shape) < 2 or heights.dtype.kind not in "iuf":
        raise TerrainError(
            f"{name}: elevation: a 2-D array of numbers of at least 2 x 2 is expected,"
            f" got {heights.dtype} of shape {heights.shape}",
            file=name, field="elevation", value=heights.shape,
            allowed="a 2-D array of numbers of at least 2 x 2 is expected",
        )  # fmt: skip
    west, east, south, north = _edges(edges, heights.shape[0])
    if not (-180.0 <= west < east <= 360.0 and -90.0 <= south < north <= 90.0):
        allowed = "degrees of longitude -180..360 and latitude -90..90 are expected"
        raise TerrainError.at(name, "xmin..ymax", edges, allowed)
    rows, cols = heights.shape
    pitch_x, pitch_y = (east - west) / cols, (north - south) / rows

    def to_source(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
        near = longitude_near(lon, (west + east) / 2)
        return (near - west) / pitch_x - 0.5, (north - lat) / pitch_y - 0.5

    def read(top: int, bottom: int, left: int, right: int) -> NDArray[np.float32]:
        return heights[top:bottom, left:right].astype(np.float32)

    col, row = outline(cols, rows)
    corners = np.stack([west + (col + 0.5) * pitch_x, north - (row + 0.5) * pitch_y], axis=1)
    return RasterFile(name, (rows, cols), to_source, corners, file_sha256(file), read)


def _edges(stated: list[float], rows: int) -> tuple[float, float, float, float]:
    """West, east, south and north edge, deg, of what a file states as xmin, xmax, ymin, ymax.

    In the tile of 344 rows that we ship ymax, 36.44625, is the north edge, and ymin, 36.73292, is that plus the tile's
    height where it should be less: read as south and north edge the tile stands 0.28667 degrees too far north.  So the
    ground says: the highest pixel lies 0.2479 degrees south of the tile's north edge, and Cross Mountain, as high, at
    36.1983 N; the lake ends 0.2208 degrees south of it, and Norris Dam stands at 36.2242 N (both places:
    https://en.wikipedia.org/wiki/Cross_Mountain_(Tennessee), https://en.wikipedia.org/wiki/Norris_Dam).
    """
    west, east = sorted(stated[:2])
    south, north = sorted(stated[2:])
    if rows == _TILE_ROWS and np.allclose(stated, _TILE_EDGES, rtol=0.0, atol=_SAME_EDGE):
        south, north = south - (north - south), south
    return west, east, south, north


def _read_npz(file: Path, name: str) -> tuple[NDArray[np.generic], list[float]]:
    """Read the heights as stored, and xmin, xmax, ymin, ymax."""
    edges = ("xmin", "xmax", "ymin", "ymax")
    try:
        with zipfile.ZipFile(file) as archive:
            # A few kilobytes of zeros unpack to gigabytes: ask before unpacking.
            size = max((entry.file_size for entry in archive.infolist()), default=0)
        if size > 8 * MOST_PIXELS:
            allowed = f"at most {8 * MOST_PIXELS:,} are read"
            raise TerrainError(f"{name}: {size:,} bytes unpacked: {allowed}", file=name, value=size, allowed=allowed)
        with np.load(file, allow_pickle=False) as data:
            for key in ("elevation", *edges):
                if key not in data.files:
                    message = f"{name}: field {key}: missing (elevation, xmin, xmax, ymin, ymax)"
                    raise TerrainError(message, file=name, field=key)
            heights = np.asarray(data["elevation"])
            return heights, [float(np.asarray(data[key]).item()) for key in edges]
    # RuntimeError and NotImplementedError: an encrypted entry, an unknown compression.
    except MemoryError:
        raise TerrainError(
            f"{name}: elevation: claims more than fits into memory", file=name, field="elevation"
        ) from None
    except (OSError, ValueError, TypeError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise TerrainError(f"{name}: not a readable .npz elevation file: {one_line(error)}", file=name) from error
