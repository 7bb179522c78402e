"""Which threats may reach a place: lists by the cells of a grid, so that a judge asks only those nearby."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled, inlined

Floats = NDArray[np.float64]
Short = NDArray[np.int32]

# Side of a cell, as a share of the median reach: for points, and for lines; and cells of one grid, at most.
CELL = 0.2
SOLID_CELL = 0.7
MOST_CELLS = 300_000
# Highest whole metre that a cell notes.
MOST = 2_000_000_000
# Ground beyond the map that the grid covers, as a share of the map's sides.
BEYOND = 0.1


class Cells(NamedTuple):
    """Lists of units by cell, in the form that the compiled functions take.

    table: (c, 4) of each cell: where its units begin in `units`, their number, and the lowest and the highest place (m)
    that any of them reaches.  Units stand in increasing order.  The last cell stands for all places outside the map and
    holds every unit.  west, south, bottom, side: m.  cols, rows, slabs: cells across, along and up; the lowest slab
    reaches down, and the highest up, without end.
    """

    table: Short
    units: Short
    west: float
    south: float
    bottom: float
    side: float
    cols: int
    rows: int
    slabs: int


class Grid(NamedTuple):
    """What `cell_at` takes of some cells; per_metre: cells a metre."""

    west: float
    south: float
    bottom: float
    per_metre: float
    cols: int
    rows: int
    slabs: int


def make_cells(position: Floats, reach: Floats, bounds: Floats) -> Cells:
    """Lists of the units (m, 3) whose reach (m,), where it is above 0, meets a cell seen from above.

    bounds: (2, 2) map.
    """
    low, high = _wider(bounds)
    side = math.sqrt(float(np.prod(high - low)) / MOST_CELLS)
    armed = reach[reach > 0.0]
    if armed.size:
        side = min(max(side, CELL * float(np.median(armed))), float((high - low).max()))
    return _make(position, reach, reach, low, high, (0.0, 0.0), side)


def make_solid_cells(
    position: Floats, reach: Floats, bounds: Floats, heights: tuple[float, float], slack: float
) -> Cells:
    """Lists of the units (m, 3) for points that stand a side apart along a line: those that may reach half-way.

    reach: (m,) m, the slack (m) not included, of units with any.  bounds: (2, 2) map.  heights: m, lowest and highest
    of a path.
    """
    low, high = _wider(bounds)
    side = float((high - low).max())
    armed = reach[reach > 0.0]
    if armed.size:
        side = min(SOLID_CELL * (float(np.median(armed)) + slack), side)
    while np.prod(np.ceil((high - low) / side)) * math.ceil(max(1.0, heights[1] - heights[0]) / side) > MOST_CELLS:
        side *= 1.1
    # Half a side along each axis, seen from above and from the side.
    widened = np.where(reach > 0.0, reach + slack + 0.5 * side, 0.0)
    return _make(position, reach + slack + 0.5 * side, widened, low, high, heights, side)


def _wider(bounds: Floats) -> tuple[Floats, Floats]:
    low, high = bounds[:, 0], bounds[:, 1]
    return low - BEYOND * (high - low), high + BEYOND * (high - low)


def _make(
    position: Floats, tall: Floats, wide: Floats, low: Floats, high: Floats, heights: tuple[float, float], side: float
) -> Cells:
    """Cells of this side; tall, wide: how far units reach up and down, and sideways, m."""
    cols, rows, slabs = (
        max(1, math.ceil(size / side)) for size in (high[0] - low[0], high[1] - low[1], heights[1] - heights[0])
    )
    west, south, bottom = float(low[0]), float(low[1]), float(heights[0])
    # Whole metres, a hair wider, for what rounding would leave out.
    lowest = np.clip(np.floor(position[:, 2] - tall) - 1.0, -MOST, MOST).astype(np.int32)
    highest = np.clip(np.ceil(position[:, 2] + tall) + 1.0, -MOST, MOST).astype(np.int32)
    between = np.stack([lowest, highest], axis=1)
    place = np.ascontiguousarray(position[:, :2] - low)
    first, units = _lists(place / side, wide / side, (between - bottom) / side, cols, rows, slabs)
    table = _table(first, units, lowest, highest)
    for array in (table, units):
        array.setflags(write=False)
    return Cells(table, units, west, south, bottom, side, cols, rows, slabs)


@compiled
def _table(first: Short, units: Short, lowest: Short, highest: Short) -> Short:  # pragma: no cover - compiled
    out = np.zeros((first.size - 1, 4), dtype=np.int32)
    for cell in range(first.size - 1):
        out[cell, 0], out[cell, 1] = first[cell], first[cell + 1] - first[cell]
        for entry in range(first[cell], first[cell + 1]):
            k = units[entry]
            fresh = entry == first[cell]
            out[cell, 2] = lowest[k] if fresh else min(out[cell, 2], lowest[k])
            out[cell, 3] = highest[k] if fresh else max(out[cell, 3], highest[k])
    return out


@inlined
def grid_of(cells: Cells) -> Grid:  # pragma: no cover - compiled
    """What `cell_at` takes of some cells."""
    return Grid(cells.west, cells.south, cells.bottom, 1.0 / cells.side, cells.cols, cells.rows, cells.slabs)


@inlined
def cell_at(grid: Grid, east: float, north: float, up: float) -> int:  # pragma: no cover - compiled
    """Number of the cell at a place."""
    col, row = (east - grid.west) * grid.per_metre, (north - grid.south) * grid.per_metre
    # Written so that NaN falls outside.
    if col >= 0.0 and row >= 0.0 and col < grid.cols and row < grid.rows:
        slab = (up - grid.bottom) * grid.per_metre
        slab = slab if slab > 0.0 else 0.0
        slab = slab if slab < grid.slabs - 1.0 else grid.slabs - 1.0
        return (int(slab) * grid.rows + int(row)) * grid.cols + int(col)
    return grid.slabs * grid.cols * grid.rows


@compiled
def _lists(
    place: Floats, reach: Floats, between: Floats, cols: int, rows: int, slabs: int
) -> tuple[Short, Short]:  # pragma: no cover - compiled
    """Where the units of each cell begin, and the units.

    place: (m, 2), reach: (m,), and between: (m, 2), the lowest and highest height reached, in sides.
    """
    count = cols * rows * slabs
    first = np.zeros(count + 2, dtype=np.int32)
    units = np.empty(0, dtype=np.int32)
    filled = first[:0].copy()
    # Counted first, then filled.
    for turn in range(2):
        for k in range(place.shape[0]):
            if reach[k] <= 0.0:
                continue
            # A hair wider, for what rounding would leave out.
            x, y, r = place[k, 0], place[k, 1], reach[k] + 1e-6
            lowest = min(slabs - 1, max(0, math.floor(between[k, 0])))
            highest = min(slabs - 1, max(0, math.floor(between[k, 1])))
            for row in range(max(0, math.floor(y - r)), min(rows - 1, math.floor(y + r)) + 1):
                dy = max(0.0, row - y, y - row - 1.0)
                for col in range(max(0, math.floor(x - r)), min(cols - 1, math.floor(x + r)) + 1):
                    dx = max(0.0, col - x, x - col - 1.0)
                    if dx * dx + dy * dy > r * r:
                        continue
                    for slab in range(lowest, highest + 1):
                        cell = (slab * rows + row) * cols + col
                        if turn == 0:
                            first[cell + 1] += 1
                        else:
                            units[filled[cell]] = k
                            filled[cell] += 1
            if turn == 0:
                first[count + 1] += 1
            else:
                units[filled[count]] = k
                filled[count] += 1
        if turn == 0:
            for cell in range(count + 1):
                first[cell + 1] += first[cell]
            units = np.empty(first[count + 1], dtype=np.int32)
            filled = first.copy()
    return first, units
