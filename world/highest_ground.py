"""Find the highest ground in each cell of a map.

It is exact for the bilinear surface between a raster's pixels.

Between four pixels the surface has no summit of its own.  Its highest point in a square is at a pixel in the square, or
on the square's sides.
"""

import math

import numpy as np

from world.arrays import Floats, Heights
from world.frames import PolyMapRecord, polymap
from world.kernels import compiled, inner
from world.terrain import Terrain, segment_clearance


def highest_in_cells(terrain: Terrain, west: float, south: float, cell_side: float, rows: int, columns: int) -> Floats:
    """Return the highest ground in each square cell, sides included, m, (rows, columns).

    west, south: outer corner of the first cell, m.
    cell_side: side of a cell, m.

    Rows go north, columns east. The value is NaN for a cell in which any data is missing.

    >>> from world.terrain import make_gridded_terrain
    >>> line = np.arange(-100.0, 101.0, 50.0)
    >>> heights = np.maximum(0.0, 50.0 - np.hypot(*np.meshgrid(line, line)))
    >>> cone = make_gridded_terrain(heights, line, line, source="made", sha256="", datum="mean sea level")
    >>> highest_in_cells(cone, -30.0, -10.0, 20.0, 1, 3).round(6).tolist()
    [[40.0, 50.0, 40.0]]
    """
    max_heights = np.full((rows, columns), -math.inf)
    _fill_cells(terrain.heights, terrain.to_pixel.record, west, south, cell_side, max_heights)
    return max_heights


@compiled
def _fill_cells(
    heights: Heights, to_pixel: PolyMapRecord, west: float, south: float, cell_side: float, max_heights: Floats
) -> None:
    """Set `max_heights` to the highest ground of each cell.

    It lies on the sides of the cell, or at the pixels inside it.

    heights, to_pixel: heights of the terrain, and the map from positions to its pixels.
    west, south, cell_side: outer corner of the first cell, and side of a cell, m.
    """
    rows, columns = max_heights.shape
    start, end = np.zeros(3), np.zeros(3)
    for i in range(rows + 1):
        for j in range(columns + 1):
            start[0], start[1] = west + j * cell_side, south + i * cell_side
            if j < columns:
                end[0], end[1] = west + (j + 1) * cell_side, start[1]
                side_height = -segment_clearance(heights, to_pixel, start, end)[0]
                _update_max_height(max_heights, i - 1, j, side_height)
                _update_max_height(max_heights, i, j, side_height)
            if i < rows:
                end[0], end[1] = start[0], south + (i + 1) * cell_side
                side_height = -segment_clearance(heights, to_pixel, start, end)[0]
                _update_max_height(max_heights, i, j - 1, side_height)
                _update_max_height(max_heights, i, j, side_height)
    for i in range(rows):
        for j in range(columns):
            if not math.isnan(max_heights[i, j]):
                _update_max_height(
                    max_heights,
                    i,
                    j,
                    _highest_pixel(heights, to_pixel, west + j * cell_side, south + i * cell_side, cell_side),
                )


@inner
def _update_max_height(max_heights: Floats, i: int, j: int, height: float) -> None:
    """Raise the highest ground of cell (i, j) to a height if the height is larger or NaN.

    max_heights: (rows, columns) highest ground in each cell, m; updated. A cell outside the array is ignored.
    """
    if (
        0 <= i < max_heights.shape[0]
        and 0 <= j < max_heights.shape[1]
        and (height > max_heights[i, j] or math.isnan(height))
    ):
        max_heights[i, j] = height


@inner
def _highest_pixel(heights: Heights, to_pixel: PolyMapRecord, west: float, south: float, cell_side: float) -> float:
    """Return the height of the highest pixel in a cell, m.

    heights, to_pixel: heights of the terrain, and the map from positions to its pixels.
    west, south, cell_side: corner and side of the cell, m.

    The sides of the cell are taken as straight in pixel coordinates. Returns -inf for a cell without a pixel, and NaN
    if a pixel has no data.
    """
    col, row = polymap(to_pixel, west, south)
    east_col, east_row = polymap(to_pixel, west + cell_side, south)
    north_col, north_row = polymap(to_pixel, west, south + cell_side)
    east_col = east_col - col
    east_row = east_row - row
    north_col = north_col - col
    north_row = north_row - row
    area = east_col * north_row - north_col * east_row
    first_row = math.ceil(row + min(0.0, east_row) + min(0.0, north_row))
    last_row = math.floor(row + max(0.0, east_row) + max(0.0, north_row))
    first_col = math.ceil(col + min(0.0, east_col) + min(0.0, north_col))
    last_col = math.floor(col + max(0.0, east_col) + max(0.0, north_col))
    max_height = -math.inf
    for i in range(max(0, first_row), min(heights.shape[0], last_row + 1)):
        for j in range(max(0, first_col), min(heights.shape[1], last_col + 1)):
            east_fraction = ((j - col) * north_row - (i - row) * north_col) / area
            north_fraction = ((i - row) * east_col - (j - col) * east_row) / area
            if 0.0 <= east_fraction <= 1.0 and 0.0 <= north_fraction <= 1.0 and not max_height >= heights[i, j]:
                max_height = float(heights[i, j])
                if math.isnan(max_height):
                    return max_height
    return max_height
