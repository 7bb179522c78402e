"""Threats by where they stand: lists by grid cell, and the exposure of a line past each missile."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.geometry import window_exposure
from world.kernels import Records, compiled, inlined

Floats = NDArray[np.float64]
Short = NDArray[np.int32]
Ints = NDArray[np.int64]


# ----------------------------------------------------------------------
# Which threats may reach a place: lists by the cells of a grid, so that an evaluation asks only those nearby.


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


# ----------------------------------------------------------------------
# Missiles by where they stand, and what a line past them is exposed to.


# Classes of missiles by radius, at most; and missiles a cell, on the mean.
MOST_CLASSES = 8
MISSILES_A_CELL = 2.0
# A missile: its position, kill radius and scale, m.
MISSILE = np.dtype([(name, np.float64) for name in ("east", "north", "up", "radius", "scale")])
# Missiles alike in radius, with a grid of their own: west and south of it (m), cells a metre, columns and rows, where
# its cells begin in `MissileIndex.first`, and the largest radius (m).
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


class MissileIndex(NamedTuple):
    """Missiles in the order of the cells that they stand in, so that those near a line are read one after the other.

    missiles: `MISSILE` records (m,), of those with a radius.
    classes: `MISSILE_CLASS` records (k,).
    first: (c,) where the missiles of each cell begin, and after each class's cells where the last one's end.
    """

    missiles: Records
    classes: Records
    first: Ints


def make_missile_index(threats: Records, side: float | None = None) -> MissileIndex:
    """Missiles of records with fields east, north, up, kill_radius and kill_scale (m).

    side: of a cell, m; None for `MISSILES_A_CELL` missiles a cell.
    """
    armed = threats[threats["kill_radius"] > 0.0]
    missiles = np.zeros(len(armed), dtype=MISSILE)
    for name, source in zip(MISSILE.names or (), ("east", "north", "up", "kill_radius", "kill_scale"), strict=True):
        missiles[name] = armed[source]
    # Alike: within a factor of two, as long as there are not too many classes.
    largest = float(missiles["radius"].max(initial=1.0))
    alike = np.minimum(MOST_CLASSES - 1, np.floor(np.log2(largest / missiles["radius"]))).astype(np.int64)
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


@compiled
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
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Mean kill density over the segment a-b, radii grown by the margin, and distances to the nearest such sphere, m.

    first, last: lengths (m) at a and at b: the distances are from there, and right if they are less than `within`.
    below, above: how far below and above the segment a flight may be, m.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    length2 = dx * dx + dy * dy + dz * dz
    inverse, slant = 1.0 / length2 if length2 > 0.0 else 0.0, 1.0 / dy if abs(dy) > 1e-9 else 0.0
    missiles, starts = index.missiles, index.first
    dose, near_a, near_b = 0.0, math.inf, math.inf
    for number in range(index.classes.shape[0]):
        kind = index.classes[number]
        per_metre, columns, rows = kind.cells_per_metre, kind.columns, kind.rows
        # A hair more, for what rounding would leave out.
        radius, side = kind.largest_radius + margin + within + 1e-6, 1.0 / per_metre
        lowest = _cell((min(ay, by) - radius - kind.south) * per_metre, rows)
        highest = _cell((max(ay, by) + radius - kind.south) * per_metre, rows)
        for row in range(max(0, lowest), min(rows, highest + 1)):
            # The part of the segment from which something in this row of cells may be near.
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
def _part(f: float, g: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Fractions of a line in order, and within it."""
    f, g = (f, g) if f < g else (g, f)
    return f if f > 0.0 else 0.0, g if g < 1.0 else 1.0


@inlined
def _nearer(z: float, rise: float, below: float, above: float) -> float:  # pragma: no cover - compiled
    """Height of a segment's beginning over a missile, m, where its nearest place comes as near as the flight may.

    rise: of the segment up to that place.
    """
    over = z + rise
    shift = min(over, below) if over > 0.0 else max(over, -above)
    return z - shift


@inlined
def _cell(place: float, count: int) -> int:  # pragma: no cover - compiled
    """Number of the cell along one axis; -1 and `count` stand for what is outside."""
    inside = place if place > -1.0 else -1.0
    number: int = math.floor(inside if inside < count else count)
    return number


@inlined
def _closest2(
    nearest: float, low: float, high: float, along: float, start2: float, length2: float
) -> float:  # pragma: no cover - compiled
    """Squared distance from a point to the part low..high (fractions) of a segment.

    nearest: fraction of the whole line that is nearest to it.  along, start2, length2: see `window_exposure`.
    """
    f = nearest if nearest < high else high
    f = f if f > low else low
    return max(0.0, start2 + f * (2.0 * along + f * length2))


@inlined
def _dose(along: float, start2: float, length2: float, radius: float, scale: float) -> float:  # pragma: no cover
    """Mean kill density of a segment that enters a sphere; see `window_exposure`."""
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, along, start2, scale)
    middle = -along / length2
    half = math.sqrt(max(0.0, middle * middle - (start2 - radius * radius) / length2))
    enter, leave = max(0.0, middle - half), min(1.0, middle + half)
    return window_exposure(enter, leave, length2, along, start2, scale) if leave > enter else 0.0
