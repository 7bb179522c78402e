"""Map the glide footprint: the least height above ground from which a place can be reached engine-out.

The backward search from the chosen places (`logs.verdict.returns.glide_map`) gives the least altitude for every cell.
This module converts it to a height above the cell's ground, in bands, with the outlines of each band.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from logs.verdict.returns.glide_map import GlideMap
from world.arrays import Flags, Floats

# An outline (k, 2) in m, closed, and its holes.
Part = tuple[Floats, ...]

# Upper limits of the bands, m above ground.
BANDS = (150.0, 300.0, 600.0)
# Drawing role of each band, by its upper limit.
BAND_ROLES = dict(zip(BANDS, ("glide-near", "glide-middle", "glide-far"), strict=True))
_ALL = (-math.inf, math.inf)
# Largest number of blocks along the longer side of the shown map; a block is as bad as the worst cell in it.
_MAX_CELLS = 200


class Band(NamedTuple):
    """Area where the required height above ground lies between two heights, m.  parts: outlines on the map."""

    above: float
    up_to: float
    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True, eq=False)
class GlideFootprint:
    """Map on which glides were looked up.

    grid: its cells.
    min_altitude: (n, e) minimum altitude, m AMSL, from which home, a rally point or a landing place is reached; inf if
        none is.
    is_landable: (n, e) True for a cell on which a landing is possible.
    """

    grid: GlideMap
    min_altitude: Floats
    is_landable: Flags

    def bands(self, east: tuple[float, float] = _ALL, north: tuple[float, float] = _ALL) -> tuple[Band, ...]:
        """Return the bands of needed height above ground, lowest first, within ranges of the map, m."""
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

    def landings(self, east: tuple[float, float] = _ALL, north: tuple[float, float] = _ALL) -> tuple[Part, ...]:
        """Return the outlines of ground that is flat by the elevation file, within ranges of the map, m."""
        blocks = _CellBlocks.from_map(self.grid, east, north)
        return blocks.outlines(blocks.max_by_block(self.is_landable.astype(np.float64)) > 0.0)


class _CellBlocks(NamedTuple):
    """Square blocks of map cells, in rows to the north.

    west, south: corner of the first block, m.  side: side of a block, m.  block: number of cells along a side.
    first: row and column of the first cell.  shape: rows and columns of blocks.
    """

    west: float
    south: float
    side: float
    block: int
    first: tuple[int, int]
    shape: tuple[int, int]

    @classmethod
    def from_map(cls, grid: GlideMap, east: tuple[float, float], north: tuple[float, float]) -> "_CellBlocks":
        """Return the blocks of a map that lie within ranges, m."""
        rows, columns = grid.floor.shape
        sides = ((north, grid.south, rows), (east, grid.west, columns))
        first = [math.floor(max(0.0, (edge[0] - origin) / grid.cell)) for edge, origin, _ in sides]
        end = [math.ceil(min(count - 1.0, (edge[1] - origin) / grid.cell)) + 1 for edge, origin, count in sides]
        counts = [max(0, end - start) for start, end in zip(first, end, strict=True)]
        block = max(1, math.ceil(max(counts) / _MAX_CELLS))
        west, south = grid.west + (first[1] - 0.5) * grid.cell, grid.south + (first[0] - 0.5) * grid.cell
        return cls(
            west, south, block * grid.cell, block, (first[0], first[1]), (counts[0] // block, counts[1] // block)
        )

    def max_by_block(self, values: Floats) -> Floats:
        """Return the greatest value in each block."""
        (row, column), (rows, columns) = self.first, self.shape
        values_within = values[row : row + rows * self.block, column : column + columns * self.block]
        blocks = values_within.reshape(rows, self.block, columns, self.block)
        return np.asarray(blocks.max(axis=(1, 3)))

    def outlines(self, is_chosen: Flags) -> tuple[Part, ...]:
        """Return the outlines of chosen blocks, with their holes."""
        if not is_chosen.any():
            return ()
        edges = np.diff(np.pad(is_chosen.astype(np.int8), ((0, 0), (1, 1))), axis=1)
        rows, starts = np.nonzero(edges == 1)
        _, ends = np.nonzero(edges == -1)
        south = self.south + rows * self.side
        boxes = shapely.box(self.west + starts * self.side, south, self.west + ends * self.side, south + self.side)
        areas = shapely.get_parts(shapely.union_all(boxes).simplify(0.0))
        polygons = [orient(polygon) for polygon in areas if not polygon.is_empty]
        return tuple(
            tuple(shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors))
            for polygon in polygons
        )
