"""Spatial indexes of threats: units by grid cell for points, missiles by position for line segments.

`ThreatCells` lists for each cell of a grid the units whose spheres reach it; the paper's scores look up points in it.
`MissileIndex` stores missiles in the order of grid cells, one grid per class of similar radii; `kill_density`
integrates the kill density along a segment and measures the distance of the nearest spheres.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats, Ints
from world.by_reference import by_reference
from world.geometry import window_exposure
from world.kernels import Records, compiled, inlined, inner

Short = NDArray[np.int32]


# --- Threats that reach a cell ---


# Side of a cell as a share of the median radius, and the maximum number of cells.
CELL_SIDE = 0.2
MAX_THREAT_CELLS = 300_000
# Largest height (m) that a cell stores.
HIGHEST_METRE = 2_000_000_000
# Extension of the grid beyond the map, as a share of the map's sides.
BEYOND = 0.1
# A cell: first entry and number of its units in the list, and the lowest and highest heights (m) that any of them
# reaches.
THREAT_CELL = np.dtype(
    [("first", np.int32), ("count", np.int32), ("lowest", np.int32), ("highest", np.int32)], align=True
)


@by_reference
class ThreatCells(NamedTuple):
    """Lists of units by the cells that they reach, for compiled functions.

    cells: `THREAT_CELL` records (c,), row by row; the last represents all points outside the grid and lists every unit.
    units: of one cell after another, in increasing order.
    west, south, side: of the grid and of its cells, m.
    columns, rows: of the grid.
    """

    cells: Records
    units: Short
    west: float
    south: float
    side: float
    columns: int
    rows: int


def make_threat_cells(position: Floats, radius: Floats, bounds: Floats) -> ThreatCells:
    """Make lists of the units (m, 3) whose sphere, seen from above, meets a cell.

    radius: (m,) of the spheres, m; 0 for none. bounds: (2, 2) map.
    """
    low, high = bounds[:, 0], bounds[:, 1]
    low, high = low - BEYOND * (high - low), high + BEYOND * (high - low)
    size = high - low
    side = math.sqrt(float(size[0] * size[1]) / MAX_THREAT_CELLS)
    armed = radius[radius > 0.0]
    if armed.size:
        side = min(max(side, CELL_SIDE * float(np.median(armed))), float(size.max()))
    columns, rows = max(1, math.ceil(size[0] / side)), max(1, math.ceil(size[1] / side))
    first, units = _lists(np.ascontiguousarray(position), radius, float(low[0]), float(low[1]), side, columns, rows)
    # Whole metres, widened against rounding.
    lowest = np.clip(np.floor(position[:, 2] - radius) - 1.0, -HIGHEST_METRE, HIGHEST_METRE).astype(np.int32)
    highest = np.clip(np.ceil(position[:, 2] + radius) + 1.0, -HIGHEST_METRE, HIGHEST_METRE).astype(np.int32)
    cells = np.zeros(first.size - 1, dtype=THREAT_CELL)
    _fill_cells(first, units, lowest, highest, cells)
    for array in (cells, units):
        array.setflags(write=False)
    return ThreatCells(cells, units, float(low[0]), float(low[1]), side, columns, rows)


@compiled
def _fill_cells(first: Short, units: Short, lowest: Short, highest: Short, cells: Records) -> None:
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
) -> tuple[Short, Short]:
    count = columns * rows
    first = np.zeros(count + 2, dtype=np.int32)
    units = np.empty(0, dtype=np.int32)
    filled = first[:0].copy()
    # The first pass counts, the second fills.
    for turn in range(2):
        for k in range(position.shape[0]):
            if radius[k] <= 0.0:
                continue
            x, y, r = (position[k, 0] - west) / side, (position[k, 1] - south) / side, radius[k] / side
            # Widened against rounding.
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


# --- Missiles near a segment ---


# Maximum number of classes by radius, and mean number of missiles per cell.
MAX_CLASSES = 8
MISSILES_A_CELL = 2.0
# A missile: its position, kill radius and scale, m.
MISSILE = np.dtype([(name, np.float64) for name in ("east", "north", "up", "radius", "scale")])
# Missiles of similar radius, with a grid of their own: its west and south (m), cells per metre, columns and rows, first
# cell in `MissileIndex.first`, and the largest radius (m).
MISSILE_CLASS = np.dtype(
    [
        ("west", np.float64),
        ("south", np.float64),
        ("cells_per_metre", np.float64),
        ("columns", np.int64),
        ("rows", np.int64),
        ("first_cell", np.int64),
        ("largest_radius", np.float64),
    ]
)


@by_reference
class MissileIndex(NamedTuple):
    """Missiles in the order of their grid cells, so that those near a segment are adjacent in memory.

    missiles: `MISSILE` records (m,), of those with a radius.
    classes: `MISSILE_CLASS` records (k,).
    first: (c,) first missile of each cell, and after each class's cells the end of its last one.
    """

    missiles: Records
    classes: Records
    first: Ints


def make_missile_index(threats: Records, side: float | None = None) -> MissileIndex:
    """Return the index of the missiles of records with fields east, north, up, kill_radius and kill_scale (m).

    side: of a cell, m; None for `MISSILES_A_CELL` missiles per cell.
    """
    armed = threats[threats["kill_radius"] > 0.0]
    missiles = np.zeros(len(armed), dtype=MISSILE)
    for name, source in zip(MISSILE.names or (), ("east", "north", "up", "kill_radius", "kill_scale"), strict=True):
        missiles[name] = armed[source]
    # A class spans a factor of two; the last class takes all smaller radii.
    largest = float(missiles["radius"].max(initial=1.0))
    alike = np.minimum(MAX_CLASSES - 1, np.floor(np.log2(largest / missiles["radius"]))).astype(np.int64)
    ordered, classes, first = [missiles[:0]], [], [np.zeros(0, dtype=np.int64)]
    cells, before = 0, 0
    for number in np.unique(alike):
        own = missiles[alike == number]
        place = np.stack([own["east"], own["north"]], axis=1)
        low, high = place.min(axis=0), place.max(axis=0)
        area = float(np.prod(np.maximum(high - low, 1.0)))
        per_metre = 1.0 / (math.sqrt(MISSILES_A_CELL * area / len(own)) if side is None else side)
        columns, rows = (int(size * per_metre) + 1 for size in high - low)
        steps = ((place - low) * per_metre).astype(np.int64)
        cell = np.minimum(steps[:, 1], rows - 1) * columns + np.minimum(steps[:, 0], columns - 1)
        order = np.argsort(cell, kind="stable")
        ordered.append(own[order])
        first.append(before + np.searchsorted(cell[order], np.arange(columns * rows + 1)))
        classes.append((low[0], low[1], per_metre, columns, rows, cells, own["radius"].max()))
        cells, before = cells + columns * rows + 1, before + len(own)
    arrays = np.concatenate(ordered), np.array(classes, dtype=MISSILE_CLASS), np.concatenate(first)
    for array in arrays:
        array.setflags(write=False)
    return MissileIndex(*arrays)


@inner
def kill_density(
    index: MissileIndex,
    margin: float,
    within: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    first: float,
    last: float,
    below: float,
    above: float,
) -> tuple[float, float, float]:
    """Return the mean kill density over a-b with enlarged radii, and the distances to the nearest spheres, m.

    first, last: lengths (m) at a and at b from which the two distances are measured; a distance is exact if below
    `within`. below, above: vertical tracking error, m.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    length2 = dx * dx + dy * dy + dz * dz
    inverse, slant = 1.0 / length2 if length2 > 0.0 else 0.0, 1.0 / dy if abs(dy) > 1e-9 else 0.0
    missiles, starts = index.missiles, index.first
    dose, near_a, near_b = 0.0, math.inf, math.inf
    for number in range(index.classes.shape[0]):
        kind = index.classes[number]
        per_metre, columns, rows = kind.cells_per_metre, kind.columns, kind.rows
        # Enlarged against rounding.
        radius, side = kind.largest_radius + margin + within + 1e-6, 1.0 / per_metre
        lowest = _cell((min(ay, by) - radius - kind.south) * per_metre, rows)
        highest = _cell((max(ay, by) + radius - kind.south) * per_metre, rows)
        for row in range(max(0, lowest), min(rows, highest + 1)):
            # The part of the segment that can be near missiles in this row of cells.
            north = kind.south + row * side - ay
            f, g = _part((north - radius) * slant, (north + side + radius) * slant) if slant != 0.0 else (0.0, 1.0)
            x, x2 = ax + f * dx - kind.west, ax + g * dx - kind.west
            x, x2 = (x, x2) if x < x2 else (x2, x)
            left, right = _cell((x - radius) * per_metre, columns), _cell((x2 + radius) * per_metre, columns)
            if right < 0 or left >= columns:
                continue
            here = kind.first_cell + row * columns
            for entry in range(starts[here + max(0, left)], starts[here + min(columns - 1, right) + 1]):
                missile = missiles[np.uintp(entry)]
                x, y, z = ax - missile.east, ay - missile.north, az - missile.up
                grown = missile.radius + margin
                if below > 0.0 or above > 0.0:
                    z = _nearer(z, dz * min(1.0, max(0.0, -(dx * x + dy * y + dz * z) * inverse)), below, above)
                along, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
                closest2 = _closest2(-along * inverse, 0.0, 1.0, along, start2, length2)
                if closest2 < (grown + within) * (grown + within):
                    length = math.sqrt(length2)
                    until, since = first / max(length, first), 1.0 - last / max(length, last)
                    one = _closest2(-along * inverse, 0.0, until, along, start2, length2)
                    two = _closest2(-along * inverse, since, 1.0, along, start2, length2)
                    near_a, near_b = min(near_a, math.sqrt(one) - grown), min(near_b, math.sqrt(two) - grown)
                    if closest2 < grown * grown:
                        dose += _dose(along, start2, length2, grown, missile.scale)
    return dose, near_a, near_b


@inlined
def _part(f: float, g: float) -> tuple[float, float]:
    """Return two fractions of a line in increasing order, clipped to it."""
    f, g = (f, g) if f < g else (g, f)
    return f if f > 0.0 else 0.0, g if g < 1.0 else 1.0


@inlined
def _nearer(z: float, rise: float, below: float, above: float) -> float:
    """Return the height of a segment's start above a missile (m), shifted towards it by the tracking error.

    rise: of the segment up to its closest point.
    """
    over = z + rise
    shift = min(over, below) if over > 0.0 else max(over, -above)
    return z - shift


@inlined
def _cell(place: float, count: int) -> int:
    """Return the index of the cell along one axis; -1 and `count` if outside."""
    inside = place if place > -1.0 else -1.0
    return math.floor(inside if inside < count else count)


@inlined
def _closest2(nearest: float, low: float, high: float, along: float, start2: float, length2: float) -> float:
    """Return the squared distance from a point to the part low..high (fractions) of a segment.

    nearest: fraction of the infinite line that is closest to the point. along, start2, length2: see `window_exposure`.
    """
    f = nearest if nearest < high else high
    f = f if f > low else low
    return max(0.0, start2 + f * (2.0 * along + f * length2))


@inlined
def _dose(along: float, start2: float, length2: float, radius: float, scale: float) -> float:  # pragma: no cover
    """Return the mean kill density of a segment that enters a sphere; see `window_exposure`."""
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, along, start2, scale)
    middle = -along / length2
    half = math.sqrt(max(0.0, middle * middle - (start2 - radius * radius) / length2))
    enter, leave = max(0.0, middle - half), min(1.0, middle + half)
    return window_exposure(enter, leave, length2, along, start2, scale) if leave > enter else 0.0
