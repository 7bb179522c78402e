"""The glide's footprint: from how low over the ground a place can be reached without an engine, as shapes on a map.

The search backwards from the places that somebody has chosen (`logs.verdict.returns.glide_map`) leaves the least height
in every cell.  What stands here is that height over the cell's ground, in bands, with the outlines of each band.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

from logs.verdict.returns.glide_map import Flags, GlideMap

Floats = NDArray[np.float64]
# An outline (k, 2) in m, closed, and its holes.
Part = tuple[Floats, ...]

# Upper ends of the bands, m above ground.
BANDS = (150.0, 300.0, 600.0)
# By their ends, the roles that they are drawn in.
BAND_ROLES = dict(zip(BANDS, ("glide-near", "glide-middle", "glide-far"), strict=True))
_ALL = (-math.inf, math.inf)
# Cells along the longer side of what is shown, at most: larger ones are as bad as the worst cell in them.
_MAX_CELLS = 200


class Band(NamedTuple):
    """Where the least height above ground lies between two heights, m.  parts: of the map."""

    above: float
    up_to: float
    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True, eq=False)
class GlideFootprint:
    """The map that glides were looked up on.

    made: its cells.
    chosen: (n, e) least height, m AMSL, from which home, a rally point or a landing place is reached; inf for none.
    flat: (n, e) whether a cell could be landed on.
    """

    made: GlideMap
    chosen: Floats
    flat: Flags

    def bands(self, east: tuple[float, float] = _ALL, north: tuple[float, float] = _ALL) -> tuple[Band, ...]:
        """By the height above ground that is needed, the least first, as far as the map lies within these ranges, m."""
        made = self.made
        above = np.where(np.isfinite(made.ground), self.chosen - made.ground, math.inf)
        cells = _Cells.within(made, east, north)
        worst = cells.merged(above)
        edges = (-math.inf, *BANDS)
        found = (
            Band(max(0.0, low), high, cells.parts((worst > low) & (worst <= high)))
            for low, high in zip(edges, BANDS, strict=False)
        )
        return tuple(band for band in found if band.parts)

    def landings(self, east: tuple[float, float] = _ALL, north: tuple[float, float] = _ALL) -> tuple[Part, ...]:
        """Ground that is flat by the elevation file, as far as the map lies within these ranges, m."""
        cells = _Cells.within(self.made, east, north)
        return cells.parts(cells.merged(self.flat.astype(np.float64)) > 0.0)


class _Cells(NamedTuple):
    """Square blocks of cells of a map, in rows to the north.

    west, south: m, of the first block's corner.  side: of a block, m.  block: cells along it.
    first: row and column of the first cell.  shape: rows and columns of blocks.
    """

    west: float
    south: float
    side: float
    block: int
    first: tuple[int, int]
    shape: tuple[int, int]

    @classmethod
    def within(cls, made: GlideMap, east: tuple[float, float], north: tuple[float, float]) -> "_Cells":
        """Those of a map that lie in ranges, m."""
        rows, columns = made.floor.shape
        sides = ((north, made.south, rows), (east, made.west, columns))
        low = [math.floor(max(0.0, (edge[0] - origin) / made.cell)) for edge, origin, _ in sides]
        high = [math.ceil(min(count - 1.0, (edge[1] - origin) / made.cell)) + 1 for edge, origin, count in sides]
        spans = [max(0, end - begin) for begin, end in zip(low, high, strict=True)]
        block = max(1, math.ceil(max(spans) / _MAX_CELLS))
        west, south = made.west + (low[1] - 0.5) * made.cell, made.south + (low[0] - 0.5) * made.cell
        return cls(west, south, block * made.cell, block, (low[0], low[1]), (spans[0] // block, spans[1] // block))

    def merged(self, values: Floats) -> Floats:
        """The greatest of each block's values."""
        (row, column), (rows, columns) = self.first, self.shape
        cut = values[row : row + rows * self.block, column : column + columns * self.block]
        blocks = cut.reshape(rows, self.block, columns, self.block)
        return np.asarray(blocks.max(axis=(1, 3)))

    def parts(self, chosen: Flags) -> tuple[Part, ...]:
        """Outlines of chosen blocks, with their holes."""
        if not chosen.any():
            return ()
        edges = np.diff(np.pad(chosen.astype(np.int8), ((0, 0), (1, 1))), axis=1)
        rows, starts = np.nonzero(edges == 1)
        _, ends = np.nonzero(edges == -1)
        south = self.south + rows * self.side
        boxes = shapely.box(self.west + starts * self.side, south, self.west + ends * self.side, south + self.side)
        whole = shapely.get_parts(shapely.union_all(boxes).simplify(0.0))
        polygons = [orient(one) for one in whole if not one.is_empty]
        return tuple(
            tuple(shapely.get_coordinates(ring) for ring in (one.exterior, *one.interiors)) for one in polygons
        )
