"""Map the glide footprint of a site.

It is the minimum height above ground from which the site is in reach after an engine failure.

The backward search from the sites (`logs.verdict.returns.glide_map`) gives the minimum altitude for every cell.  This
module converts it to a height above the cell's ground, and outlines the areas in each band of these heights.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from logs.verdict.returns.glide_map import GlideMap
from world.arrays import Flags, Floats

# Closed outline of an area, m, (k, 2), followed by the outlines of its holes.
Part = tuple[Floats, ...]

# Upper limits of the bands, m above ground.
BANDS = (150.0, 300.0, 600.0)
# Drawing role of each band, by its upper limit.
BAND_ROLES = dict(zip(BANDS, ("glide-near", "glide-middle", "glide-far"), strict=True))
_WHOLE_RANGE = (-math.inf, math.inf)
# Maximum number of blocks along the longer side of the drawn map; a block has the value of its worst cell.
_MAX_BLOCKS = 200


class Band(NamedTuple):
    """Area in which the height above ground that a glide requires lies between two limits.

    min_height, max_height: limits of the required height above ground, m.
    parts: outlines of the area's parts on the map.
    """

    min_height: float
    max_height: float
    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True, eq=False)
class GlideFootprint:
    """Map of the minimum altitudes for glides.

    grid: cells of the map.
    min_altitude: minimum altitude from which home, a rally point or a landing place is reached, m AMSL, (n, e); inf if
        none is reached.
    is_landable: True for a cell on which a landing is possible, (n, e).
    """

    grid: GlideMap
    min_altitude: Floats
    is_landable: Flags

    def bands(
        self, east: tuple[float, float] = _WHOLE_RANGE, north: tuple[float, float] = _WHOLE_RANGE
    ) -> tuple[Band, ...]:
        """Return the bands of required height above ground, the lowest first.

        east, north: ranges (from, to) of the map, m; by default the whole map.
        """
        grid = self.grid
        needed_heights = np.where(np.isfinite(grid.ground), self.min_altitude - grid.ground, math.inf)
        blocks = _CellBlocks.from_map(grid, east, north)
        block_heights = blocks.max_by_block(needed_heights)
        band_limits = (-math.inf, *BANDS)
        bands = (
            Band(max(0.0, lower), upper, blocks.outlines((block_heights > lower) & (block_heights <= upper)))
            for lower, upper in zip(band_limits, BANDS, strict=False)
        )
        return tuple(band for band in bands if band.parts)

    def landings(
        self, east: tuple[float, float] = _WHOLE_RANGE, north: tuple[float, float] = _WHOLE_RANGE
    ) -> tuple[Part, ...]:
        """Return the outlines of the areas in which a landing is possible.

        east, north: ranges (from, to) of the map, m; by default the whole map.
        """
        blocks = _CellBlocks.from_map(self.grid, east, north)
        return blocks.outlines(blocks.max_by_block(self.is_landable.astype(np.float64)) > 0.0)


class _CellBlocks(NamedTuple):
    """Square blocks of map cells, in rows from south to north.

    west, south: south-western corner of the first block, m.
    side: side of a block, m.
    cells_per_side: number of cells along a side of a block.
    first_cell: row and column of the first cell.
    shape: numbers of rows and columns of blocks.
    """

    west: float
    south: float
    side: float
    cells_per_side: int
    first_cell: tuple[int, int]
    shape: tuple[int, int]

    @classmethod
    def from_map(cls, grid: GlideMap, east: tuple[float, float], north: tuple[float, float]) -> "_CellBlocks":
        """Group the cells of a map within ranges to the east and north (m) into blocks."""
        rows, columns = grid.floor.shape
        axes = ((north, grid.south, rows), (east, grid.west, columns))
        first_cell = [math.floor(max(0.0, (limits[0] - origin) / grid.cell)) for limits, origin, _ in axes]
        end_cell = [math.ceil(min(count - 1.0, (limits[1] - origin) / grid.cell)) + 1 for limits, origin, count in axes]
        counts = [max(0, end_cell - start) for start, end_cell in zip(first_cell, end_cell, strict=True)]
        cells_per_side = max(1, math.ceil(max(counts) / _MAX_BLOCKS))
        west = grid.west + (first_cell[1] - 0.5) * grid.cell
        south = grid.south + (first_cell[0] - 0.5) * grid.cell
        return cls(
            west,
            south,
            cells_per_side * grid.cell,
            cells_per_side,
            (first_cell[0], first_cell[1]),
            (counts[0] // cells_per_side, counts[1] // cells_per_side),
        )

    def max_by_block(self, values: Floats) -> Floats:
        """Return the maximum of the cells' values in each block, with the shape of the blocks."""
        (row, column), (rows, columns) = self.first_cell, self.shape
        cell_values = values[row : row + rows * self.cells_per_side, column : column + columns * self.cells_per_side]
        block_values = cell_values.reshape(rows, self.cells_per_side, columns, self.cells_per_side)
        return np.asarray(block_values.max(axis=(1, 3)))

    def outlines(self, is_chosen: Flags) -> tuple[Part, ...]:
        """Join the blocks with True in a mask into areas, and return the areas' outlines with their holes."""
        return cell_outlines(self.west, self.south, self.side, is_chosen)


def cell_outlines(west: float, south: float, side: float, is_chosen: Flags) -> tuple[Part, ...]:
    """Join chosen square cells into areas, and return the areas' outlines with their holes.

    Return () if no cell is chosen.

    west, south: south-western corner of the first cell, m.
    side: side of a cell, m.
    is_chosen: (n, e), rows from south to north.

    >>> [sorted(set(map(tuple, ring.tolist()))) for ring in cell_outlines(0.0, 0.0, 1.0, np.array([[True, True]]))[0]]
    [[(0.0, 0.0), (0.0, 1.0), (2.0, 0.0), (2.0, 1.0)]]
    """
    if not is_chosen.any():
        return ()
    edges = np.diff(np.pad(is_chosen.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    rows, starts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    bottom = south + rows * side
    boxes = shapely.box(west + starts * side, bottom, west + ends * side, bottom + side)
    return outline_parts(shapely.union_all(boxes).simplify(0.0))


def outline_parts(area: BaseGeometry) -> tuple[Part, ...]:
    """Return the outline of each polygon of an area, followed by its holes.

    Outlines run counter-clockwise.

    >>> [ring.shape for ring in outline_parts(shapely.box(0.0, 0.0, 2.0, 1.0))[0]]
    [(5, 2)]
    """
    polygons = [orient(polygon) for polygon in shapely.get_parts(area) if not polygon.is_empty]
    return tuple(
        tuple(shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)) for polygon in polygons
    )
