"""Which threats may reach a place: lists by the cells of a grid, so that a judge asks only those nearby."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.kernels import compiled

Floats = NDArray[np.float64]
Short = NDArray[np.int32]

# Side of a cell, as a share of the median reach; and cells of one grid, at most.
CELL = 0.2
MOST_CELLS = 300_000
# Highest whole metre that a cell notes.
MOST = 2_000_000_000
# Ground beyond the map that the grid covers, as a share of the map's sides.
BEYOND = 0.1


class Cells(NamedTuple):
    """Lists of units by the cells that they reach, in the form that the compiled functions take.

    table: (c, 4) of each cell: where its units begin in `units`, their number, and the lowest and the highest place (m)
    that any of them reaches.  Units stand in increasing order.  The last cell stands for all places outside the grid
    and holds every unit.  west, south, side: m.  cols, rows: cells across and up.
    """

    table: Short
    units: Short
    west: float
    south: float
    side: float
    cols: int
    rows: int


def make_cells(position: Floats, reach: Floats, bounds: Floats) -> Cells:
    """Lists of the units (m, 3) whose reach (m,), where it is above 0, meets a cell seen from above.

    bounds: (2, 2) map.
    """
    low, high = bounds[:, 0], bounds[:, 1]
    low, high = low - BEYOND * (high - low), high + BEYOND * (high - low)
    size = high - low
    side = math.sqrt(float(size[0] * size[1]) / MOST_CELLS)
    armed = reach[reach > 0.0]
    if armed.size:
        side = min(max(side, CELL * float(np.median(armed))), float(size.max()))
    cols, rows = max(1, math.ceil(size[0] / side)), max(1, math.ceil(size[1] / side))
    first, units = _lists(np.ascontiguousarray(position), reach, float(low[0]), float(low[1]), side, cols, rows)
    # Whole metres, a hair wider, for what rounding would leave out.
    lowest = np.clip(np.floor(position[:, 2] - reach) - 1.0, -MOST, MOST).astype(np.int32)
    highest = np.clip(np.ceil(position[:, 2] + reach) + 1.0, -MOST, MOST).astype(np.int32)
    table = _table(first, units, lowest, highest)
    for array in (table, units):
        array.setflags(write=False)
    return Cells(table, units, float(low[0]), float(low[1]), side, cols, rows)


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


@compiled
def _lists(
    position: Floats, reach: Floats, west: float, south: float, side: float, cols: int, rows: int
) -> tuple[Short, Short]:  # pragma: no cover - compiled
    count = cols * rows
    first = np.zeros(count + 2, dtype=np.int32)
    units = np.empty(0, dtype=np.int32)
    filled = first[:0].copy()
    # Counted first, then filled.
    for turn in range(2):
        for k in range(position.shape[0]):
            if reach[k] <= 0.0:
                continue
            x, y, r = (position[k, 0] - west) / side, (position[k, 1] - south) / side, reach[k] / side
            # A hair wider, for what rounding would leave out.
            r += 1e-6
            for row in range(max(0, math.floor(y - r)), min(rows - 1, math.floor(y + r)) + 1):
                dy = max(0.0, row - y, y - row - 1.0)
                for col in range(max(0, math.floor(x - r)), min(cols - 1, math.floor(x + r)) + 1):
                    dx = max(0.0, col - x, x - col - 1.0)
                    if dx * dx + dy * dy <= r * r:
                        cell = row * cols + col
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
