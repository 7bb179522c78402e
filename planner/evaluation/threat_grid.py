"""Which threats may reach a place: lists by the cells of a grid, so that an evaluation asks only those nearby."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.kernels import Records, compiled

Floats = NDArray[np.float64]
Short = NDArray[np.int32]

# Side of a cell, as a share of the median radius; and cells of one grid, at most.
CELL_SIDE = 0.2
MOST_THREAT_CELLS = 300_000
# Highest whole metre that a cell notes.
HIGHEST_METRE = 2_000_000_000
# Ground beyond the map that the grid covers, as a share of the map's sides.
BEYOND = 0.1
# A cell: where its units begin in the list of units, their number, and the lowest and the highest place (m) that any of
# them reaches.
THREAT_CELL = np.dtype(
    [("first", np.int32), ("count", np.int32), ("lowest", np.int32), ("highest", np.int32)], align=True
)


class ThreatCells(NamedTuple):
    """Lists of units by the cells that they reach, in the form that the compiled functions take.

    cells: `THREAT_CELL` records (c,), row by row; the last stands for all places outside the grid and holds every unit.
    units: of one cell after the other, in increasing order.
    west, south, side: of the grid and of its cells, m.
    columns, rows: cells across and up.
    """

    cells: Records
    units: Short
    west: float
    south: float
    side: float
    columns: int
    rows: int


def make_threat_cells(position: Floats, radius: Floats, bounds: Floats) -> ThreatCells:
    """Lists of the units (m, 3) whose sphere of this radius (m,), where it is above 0, meets a cell seen from above.

    bounds: (2, 2) map.
    """
    low, high = bounds[:, 0], bounds[:, 1]
    low, high = low - BEYOND * (high - low), high + BEYOND * (high - low)
    size = high - low
    side = math.sqrt(float(size[0] * size[1]) / MOST_THREAT_CELLS)
    armed = radius[radius > 0.0]
    if armed.size:
        side = min(max(side, CELL_SIDE * float(np.median(armed))), float(size.max()))
    columns, rows = max(1, math.ceil(size[0] / side)), max(1, math.ceil(size[1] / side))
    first, units = _lists(np.ascontiguousarray(position), radius, float(low[0]), float(low[1]), side, columns, rows)
    # Whole metres, a hair wider, for what rounding would leave out.
    lowest = np.clip(np.floor(position[:, 2] - radius) - 1.0, -HIGHEST_METRE, HIGHEST_METRE).astype(np.int32)
    highest = np.clip(np.ceil(position[:, 2] + radius) + 1.0, -HIGHEST_METRE, HIGHEST_METRE).astype(np.int32)
    cells = np.zeros(first.size - 1, dtype=THREAT_CELL)
    _fill_cells(first, units, lowest, highest, cells)
    for array in (cells, units):
        array.setflags(write=False)
    return ThreatCells(cells, units, float(low[0]), float(low[1]), side, columns, rows)


@compiled
def _fill_cells(
    first: Short, units: Short, lowest: Short, highest: Short, cells: Records
) -> None:  # pragma: no cover - compiled
    for k in range(cells.shape[0]):
        cell = cells[k]
        cell.first, cell.count = first[k], first[k + 1] - first[k]
        for entry in range(first[k], first[k + 1]):
            unit = units[entry]
            fresh = entry == first[k]
            cell.lowest = lowest[unit] if fresh else min(cell.lowest, lowest[unit])
            cell.highest = highest[unit] if fresh else max(cell.highest, highest[unit])


@compiled
def _lists(
    position: Floats, radius: Floats, west: float, south: float, side: float, columns: int, rows: int
) -> tuple[Short, Short]:  # pragma: no cover - compiled
    count = columns * rows
    first = np.zeros(count + 2, dtype=np.int32)
    units = np.empty(0, dtype=np.int32)
    filled = first[:0].copy()
    # Counted first, then filled.
    for turn in range(2):
        for k in range(position.shape[0]):
            if radius[k] <= 0.0:
                continue
            x, y, r = (position[k, 0] - west) / side, (position[k, 1] - south) / side, radius[k] / side
            # A hair wider, for what rounding would leave out.
            r += 1e-6
            for row in range(max(0, math.floor(y - r)), min(rows - 1, math.floor(y + r)) + 1):
                dy = max(0.0, row - y, y - row - 1.0)
                for col in range(max(0, math.floor(x - r)), min(columns - 1, math.floor(x + r)) + 1):
                    dx = max(0.0, col - x, x - col - 1.0)
                    if dx * dx + dy * dy <= r * r:
                        cell = row * columns + col
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
