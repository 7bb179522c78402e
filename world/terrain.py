"""Terrain heights on a raster, at any point and exactly along a segment.

The raster keeps its own grid and source resolution; a `PolyMap` converts map positions to pixel coordinates, and
heights are bilinear between pixel centres.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from world.arrays import Floats, Heights
from world.frames import PolyMap, PolyMapRecord, fit_polymap, polymap
from world.kernels import compiled, inlined, inner

# Longest piece of a segment that is treated as straight in the raster's grid, m: at 60 degrees latitude a 500 m piece
# bends by 9 mm.
STRAIGHT_PIECE_M = 500.0
# Error tolerance of the map from positions to pixels, pixels: positions so close to the raster's edge are inside.
EDGE_TOLERANCE = 2e-3
# Side of the tiles with a stored steepest slope, pixels.
TILE_PIXELS = 16


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """Measured or synthetic ground heights above mean sea level.

    heights: (rows, cols) float32 m at pixel centres, NaN if there is no data.
    to_pixel: map (east, north) to fractional (col, row).
    spacing: spacing of the pixels, m; the smaller one if the two directions differ.
    source, sha256: name and hash of the elevation file.
    datum: description of the vertical datum.
    vertical_error: stated error of the heights, m; None if not stated.
    """

    heights: Heights
    to_pixel: PolyMap
    spacing: float
    source: str
    sha256: str
    datum: str
    vertical_error: float | None = None

    def __post_init__(self) -> None:
        """Replace the heights by a read-only array."""
        heights = np.ascontiguousarray(self.heights, dtype=np.float32)
        if heights.flags.writeable:
            heights = heights if heights is not self.heights else heights.copy()
            heights.setflags(write=False)
        object.__setattr__(self, "heights", heights)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the terrain so that its raster is locked again when it is unpickled."""
        return _rebuild_terrain, tuple(getattr(self, field.name) for field in fields(self))

    def height(self, east: ArrayLike, north: ArrayLike) -> Floats:
        """Return the ground height at map positions (m, any shape), m AMSL.

        It is NaN without data or off the raster.
        """
        es, ns = np.broadcast_arrays(np.asarray(east, dtype=np.float64), np.asarray(north, dtype=np.float64))
        return _ground_heights(self.heights, self.to_pixel.record, es.ravel(), ns.ravel()).reshape(es.shape)

    def clearance(self, a: ArrayLike, b: ArrayLike) -> tuple[float, float]:
        """Return the smallest height of the segment a-b above ground, m, and its fraction of the segment.

        a, b: ends of the segment, (3,) m.

        The height is exact for the bilinearly interpolated ground, and NaN if the segment leaves the raster or its
        data.
        """
        start, end = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
        clearance, fraction = segment_clearance(self.heights, self.to_pixel.record, start, end)
        return float(clearance), float(fraction)


def _rebuild_terrain(heights: Heights, *other_fields: Any) -> Terrain:
    """Make a terrain from unpickled heights, made read-only again, and its other fields in order."""
    heights.setflags(write=False)
    return Terrain(heights, *other_fields)


@inlined
def pixel_height(heights: Heights, col: float, row: float) -> float:
    """Return the bilinearly interpolated height at fractional pixel coordinates, m; NaN off the raster.

    heights: m at the pixel centres, (rows, columns).

    The raster extends `EDGE_TOLERANCE` beyond the outer pixel centres.
    """
    rows, cols = heights.shape
    if not (
        -EDGE_TOLERANCE <= col <= cols - 1 + EDGE_TOLERANCE and -EDGE_TOLERANCE <= row <= rows - 1 + EDGE_TOLERANCE
    ):
        return math.nan
    i = min(int(row), rows - 2)
    j = min(int(col), cols - 2)
    v = row - i
    u = col - j
    # Unsigned, so that numba does not check each index for being negative.
    upper_row = np.uintp(i)
    lower_row = np.uintp(i + 1)
    left_col = np.uintp(j)
    right_col = np.uintp(j + 1)
    upper_height = heights[upper_row, left_col] * (1.0 - u) + heights[upper_row, right_col] * u
    lower_height = heights[lower_row, left_col] * (1.0 - u) + heights[lower_row, right_col] * u
    return upper_height * (1.0 - v) + lower_height * v


@compiled
def steepest_slopes(heights: Heights, spacing: float) -> Heights:
    """Return an upper bound on the slope of the ground in each tile of a raster, m per m.

    The result has the shape (tile rows, tile columns).

    heights: m at the pixels, (rows, columns); NaN without data.
    spacing: distance between pixels, m.

    The ground is interpolated bilinearly. A tile has `TILE_PIXELS` x `TILE_PIXELS` pixel cells. Pixels without data are
    ignored.
    """
    rows, cols = heights.shape
    tiles = np.zeros(((rows - 2) // TILE_PIXELS + 1, (cols - 2) // TILE_PIXELS + 1), dtype=np.float32)
    for i in range(rows - 1):
        for j in range(cols - 1):
            step_across = max(abs(heights[i, j + 1] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i + 1, j]))
            step_down = max(abs(heights[i + 1, j] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i, j + 1]))
            slope2 = step_across * step_across + step_down * step_down
            # False for NaN.
            if slope2 > tiles[i // TILE_PIXELS, j // TILE_PIXELS]:
                tiles[i // TILE_PIXELS, j // TILE_PIXELS] = slope2
    for i in range(tiles.shape[0]):
        for j in range(tiles.shape[1]):
            # Slightly more, to cover the rounding of single precision.
            tiles[i, j] = math.sqrt(tiles[i, j]) / spacing * (1.0 + 1e-6)
    return tiles


@inlined
def ground_height(heights: Heights, to_pixel: PolyMapRecord, east: float, north: float) -> float:
    """Return the ground height at one map position, m AMSL; NaN outside the raster."""
    col, row = polymap(to_pixel, east, north)
    return pixel_height(heights, col, row)


@compiled
def _ground_heights(
    heights: Heights, to_pixel: PolyMapRecord, east: Floats, north: Floats
) -> Floats:  # pragma: no cover
    """Return the ground height at n positions, m AMSL, (n,)."""
    ground_heights = np.empty(east.size)
    for k in range(east.size):
        ground_heights[k] = ground_height(heights, to_pixel, east[k], north[k])
    return ground_heights


@compiled
def segment_clearance(heights: Heights, to_pixel: PolyMapRecord, a: Floats, b: Floats) -> tuple[float, float]:
    """Return the smallest height of the segment a-b above ground, m, and its fraction of the segment.

    heights, to_pixel: heights of the terrain, and the map from positions to its pixels.
    a, b: ends of the segment, (3,) m.

    The ground is interpolated bilinearly. The height is NaN if the segment leaves the raster.
    """
    col, row = polymap(to_pixel, a[0], a[1])
    clearance, fraction, _, _ = _clearance_from_pixel(heights, to_pixel, a, b, col, row)
    return clearance, fraction


@inner
def path_clearances(heights: Heights, to_pixel: PolyMapRecord, points: Floats) -> tuple[Floats, Floats]:
    """Return the smallest height above ground of each segment of a path, m, and its fraction, (n - 1,).

    points: ends of the segments, m, (n, 3).

    The values equal those of `segment_clearance`, but need only half as many map transformations.
    """
    count = max(0, points.shape[0] - 1)
    clearance, fraction = np.empty(count), np.empty(count)
    col, row = math.nan, math.nan
    for k in range(count):
        a, b = points[k], points[k + 1]
        if math.isnan(col):
            col, row = polymap(to_pixel, a[0], a[1])
        clearance[k], fraction[k], col, row = _clearance_from_pixel(heights, to_pixel, a, b, col, row)
        if a[0] + (b[0] - a[0]) != b[0] or a[1] + (b[1] - a[1]) != b[1]:
            # The pixel of the segment's end, computed from its start, may differ from the pixel of `b` in the last bit.
            col = math.nan
    return clearance, fraction


@inlined
def _clearance_from_pixel(
    heights: Heights, to_pixel: PolyMapRecord, a: Floats, b: Floats, start_col: float, start_row: float
) -> tuple[float, float, float, float]:
    """Return the results of `segment_clearance`, and the pixel coordinates of the segment's end.

    The coordinates are (column, row).

    a, b: ends of the segment, (3,) m.
    start_col, start_row: pixel coordinates of `a`.

    The column of the end is NaN if the segment leaves the raster.
    """
    piece_count = max(1, math.ceil(math.hypot(b[0] - a[0], b[1] - a[1]) / STRAIGHT_PIECE_M))
    min_clearance = math.inf
    min_fraction = 0.0
    col1, row1 = start_col, start_row
    for piece in range(piece_count):
        start_fraction = piece / piece_count
        end_fraction = (piece + 1) / piece_count
        col0, row0 = col1, row1
        col1, row1 = polymap(to_pixel, a[0] + end_fraction * (b[0] - a[0]), a[1] + end_fraction * (b[1] - a[1]))
        clearance, fraction = _piece_clearance(
            heights, col0, row0, a[2] + start_fraction * (b[2] - a[2]), col1, row1, a[2] + end_fraction * (b[2] - a[2])
        )
        if math.isnan(clearance):
            return math.nan, start_fraction + fraction * (end_fraction - start_fraction), math.nan, math.nan
        if clearance < min_clearance:
            min_clearance = clearance
            min_fraction = start_fraction + fraction * (end_fraction - start_fraction)
    return min_clearance, min_fraction, col1, row1


@inlined
def _next_crossing(start: float, step: float, fraction: float) -> float:
    """Return the next fraction at which start + fraction * step is an integer; inf if none.

    It is above a given fraction.
    """
    if step == 0.0:
        return math.inf
    position = start + fraction * step
    line = math.floor(position + 1e-9) + 1.0 if step > 0.0 else math.ceil(position - 1e-9) - 1.0
    return (line - start) / step


@inlined
def _piece_clearance(
    heights: Heights, col0: float, row0: float, up0: float, col1: float, row1: float, up1: float
) -> tuple[float, float]:
    """Return the smallest height above ground on a straight piece of a segment, m.

    Also return the fraction of the piece there.

    col0, row0, up0, col1, row1, up1: ends of the piece, in fractional pixels and m AMSL.

    The height is NaN if the piece leaves the data. The piece is followed from one pixel boundary to the next. Between
    two boundaries, the height above the bilinearly interpolated ground is a parabola, whose lowest point is computed.
    """
    delta_col, delta_row, delta_up = col1 - col0, row1 - row0, up1 - up0
    start_fraction = 0.0
    start_clearance = up0 - pixel_height(heights, col0, row0)
    min_clearance, min_fraction = start_clearance, 0.0
    if math.isnan(start_clearance):
        return math.nan, 0.0
    # Go from one pixel boundary to the next.
    while start_fraction < 1.0:
        end_fraction = min(
            1.0, _next_crossing(col0, delta_col, start_fraction), _next_crossing(row0, delta_row, start_fraction)
        )
        if end_fraction <= start_fraction:
            end_fraction = min(1.0, start_fraction + 1e-6)
        middle_fraction = 0.5 * (start_fraction + end_fraction)
        middle_clearance = (
            up0
            + middle_fraction * delta_up
            - pixel_height(heights, col0 + middle_fraction * delta_col, row0 + middle_fraction * delta_row)
        )
        end_clearance = (
            up0
            + end_fraction * delta_up
            - pixel_height(heights, col0 + end_fraction * delta_col, row0 + end_fraction * delta_row)
        )
        if math.isnan(middle_clearance) or math.isnan(end_clearance):
            return math.nan, middle_fraction
        if end_clearance < min_clearance:
            min_clearance, min_fraction = end_clearance, end_fraction
        # The parabola through the three values; its vertex is used if it lies between them.
        curvature = 2.0 * (start_clearance - 2.0 * middle_clearance + end_clearance)
        if curvature > 0.0:
            vertex_fraction = (3.0 * start_clearance - 4.0 * middle_clearance + end_clearance) / (2.0 * curvature)
            if 0.0 < vertex_fraction < 1.0:
                vertex_clearance = (
                    start_clearance
                    - (3.0 * start_clearance - 4.0 * middle_clearance + end_clearance) * vertex_fraction
                    + curvature * vertex_fraction * vertex_fraction
                )
                if vertex_clearance < min_clearance:
                    min_clearance = vertex_clearance
                    min_fraction = start_fraction + vertex_fraction * (end_fraction - start_fraction)
        start_clearance = end_clearance
        start_fraction = end_fraction
    return min_clearance, min_fraction


def make_gridded_terrain(
    heights: Floats, east: Floats, north: Floats, *, source: str, sha256: str, datum: str
) -> Terrain:
    """Make terrain from heights on a regular grid of map positions.

    heights: (n, e) m.
    east, north: (e,) and (n,) m, evenly increasing.
    source, sha256, datum: as in `Terrain`.
    """
    step_e, step_n = east[1] - east[0], north[1] - north[0]
    to_pixel = fit_polymap(
        lambda grid_east, grid_north: ((grid_east - east[0]) / step_e, (grid_north - north[0]) / step_n),
        [[east[0], east[-1]], [north[0], north[-1]]],
        1e-9,
    )
    return Terrain(heights.astype(np.float32), to_pixel, float(min(step_e, step_n)), source, sha256, datum)


def make_flat_terrain(bounds: Floats, amsl: float, buffer: float) -> Terrain:
    """Make level ground at an altitude (m AMSL).

    bounds: [[west, east], [south, north]] m.
    buffer: width of terrain around the bounds, m.
    """
    east = np.linspace(bounds[0, 0] - buffer, bounds[0, 1] + buffer, 3)
    north = np.linspace(bounds[1, 0] - buffer, bounds[1, 1] + buffer, 3)
    return make_gridded_terrain(
        np.full((3, 3), amsl), east, north, source=f"flat at {amsl:g} m", sha256="", datum="mean sea level"
    )


class Peak(NamedTuple):
    """Gaussian hill: position and height of its summit, and its standard deviation, m."""

    east: float
    north: float
    height: float
    sigma: float


def make_peaks_terrain(bounds: Floats, peaks: Sequence[Peak], buffer: float) -> Terrain:
    """Make terrain of Gaussian hills on level ground at sea level.

    bounds: [[west, east], [south, north]] m.
    buffer: width of terrain around the bounds, m.

    The grid spacing is a sixteenth of the smallest sigma, with at most 1,500 pixels a side. This keeps each summit
    within 0.05 % of its height.
    """
    width = max(float(np.ptp(bounds[0])), float(np.ptp(bounds[1]))) + 2 * buffer
    spacing = max(min(peak.sigma for peak in peaks) / 16.0, width / 1500.0) if len(peaks) else width / 8.0

    def axis(minimum: float, maximum: float) -> Floats:
        """Return evenly spaced coordinates of an axis, with the buffer on both sides, m."""
        return np.linspace(minimum - buffer, maximum + buffer, 2 + int((maximum - minimum + 2 * buffer) / spacing))

    east, north = axis(*bounds[0]), axis(*bounds[1])
    heights = np.zeros((north.size, east.size))
    for peak in peaks:
        heights += peak.height * np.outer(
            np.exp(-((north - peak.north) ** 2) / (2 * peak.sigma**2)),
            np.exp(-((east - peak.east) ** 2) / (2 * peak.sigma**2)),
        )
    source = f"{len(peaks)} Gaussian peak{'s' * (len(peaks) != 1)}"
    return make_gridded_terrain(heights, east, north, source=source, sha256="", datum="mean sea level")
