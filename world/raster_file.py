"""Elevation file that was opened and checked.

It has its grid, its position on Earth, and a function to read its heights.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats
from world.errors import TerrainError
from world.frames import GeoOrigin
from world.height_datum import UNSTATED, HeightDatum

PixelMap = Callable[[Floats, Floats], tuple[Floats, Floats]]
# Affine coefficients (a, b, c, d, e, f) from columns and rows: x = a col + b row + c, y = d col + e row + f.
Grid = tuple[float, ...]
ReadWindow = Callable[[int, int, int, int], NDArray[np.float32]]

# Values that mark missing data in files that do not state one.
UNSTATED_NODATA = (-9999.0, -32768.0, -32767.0)
# Lower end of the range of ground on Earth, m; heights outside the range are missing data.
LOWEST_GROUND_M = -12_000.0
# Upper end of this range, m.
HIGHEST_GROUND_M = 9000.0


@dataclass(frozen=True, slots=True)
class RasterFile:
    """Elevation file that was opened and checked; its heights are not read yet.

    name: name in messages.
    to_pixels: function from longitude and latitude (deg) to fractional (col, row) of pixel centres.
    to_lon_lat: inverse of `to_pixels`.
    shape: (rows, cols).
    corners: (n, 2) longitude, latitude along the outline of the pixel centres, deg.
    grid: affine coefficients (a, b, c, d, e, f) from columns and rows of pixel corners to the reference
        system; to degrees if the file has none.
    read: function of a half-open window (top, bottom, left, right) of rows and columns that returns the heights as
        stored in the file, float32, with NaN for missing data.
    crs: the file's reference system as WKT; None if it has none.
    datum: vertical datum of the heights.
    """

    name: str
    shape: tuple[int, int]
    to_pixels: PixelMap
    to_lon_lat: PixelMap
    corners: Floats
    sha256: str
    read: ReadWindow
    grid: Grid
    crs: str | None = None
    datum: HeightDatum = field(default=HeightDatum(UNSTATED))

    @property
    def centre(self) -> GeoOrigin:
        """Middle between the smallest and largest latitude and longitude of the outer pixel centres.

        The longitude is in -180..180, also for a tile that lies across the 180th meridian. The centre of a projected
        grid differs from this position by some metres.
        """
        lat = (self.corners[:, 1].min() + self.corners[:, 1].max()) / 2
        lon = longitude_near(self.corners[:, 0], float(self.corners[0, 0]))
        return GeoOrigin(float(lat), float(longitude_near((lon.min() + lon.max()) / 2, 0.0)))


def is_ground(heights: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return a mask: True for heights (m) of ground, False for NaN and for values that mark missing data.

    >>> is_ground(np.array([-9999.0, 480.0, np.nan], dtype=np.float32)).tolist()
    [False, True, False]
    """
    is_plausible: NDArray[np.bool_] = (heights >= LOWEST_GROUND_M) & (heights <= HIGHEST_GROUND_M)
    return is_plausible & ~np.isin(heights, UNSTATED_NODATA)


def longitude_near(lon: NDArray[np.float64] | float, centre: float) -> Floats:
    """Shift longitudes (deg) by full turns to within 180 degrees of ``centre``."""
    return np.asarray(lon - 360.0 * np.round((np.asarray(lon) - centre) / 360.0))


def outline(cols: int, rows: int) -> tuple[Floats, Floats]:
    """Return columns and rows of 84 points along a raster's outline of pixel centres, (84,) each.

    cols, rows: size of the raster.
    """
    fractions = np.linspace(0.0, 1.0, 21)
    zeros, ones = np.zeros(21), np.ones(21)
    col = np.concatenate([fractions, fractions, zeros, ones]) * (cols - 1)
    row = np.concatenate([zeros, ones, fractions, fractions]) * (rows - 1)
    return col, row


def shift_grid(grid: Grid, rows: int, cols: int) -> Grid:
    """Return the affine coefficients of a grid that starts ``rows`` rows and ``cols`` columns later.

    >>> shift_grid((30.0, 0.0, 400.0, 0.0, -30.0, 900.0), 1, 2)
    (30.0, 0.0, 460.0, 0.0, -30.0, 870.0)
    """
    a, b, c, d, e, f = grid
    return a, b, c + a * cols + b * rows, d, e, f + d * cols + e * rows


def require_min_pixels(name: str | Path, shape: tuple[int, int]) -> None:
    """Raise TerrainError if a raster has too few rows or columns to interpolate heights.

    shape: (rows, cols).
    """
    if min(shape) < 2:
        raise TerrainError.at(name, "rows, columns", shape, "expected at least 2 x 2 pixels")


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hex."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def one_line(error: BaseException) -> str:
    """Return the first line of an error's text, or its type if the text is empty."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__
