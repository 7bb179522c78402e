"""Spatial indexes of threats.

Points are looked up by grid cell, and line segments by position of the missiles.

`ThreatCells` lists for each cell of a grid the units (numbers of threats) whose spheres reach it; the paper's scores
look up points in it. `MissileIndex` stores missiles in the order of grid cells, one grid per class of similar radii;
`kill_density` integrates the kill density along a segment and measures the distance of the nearest spheres.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.arrays import Floats, Ints
from world.by_reference import by_reference
from world.geometry import window_exposure
from world.kernels import Records, compiled, inlined, inner

Int32s = NDArray[np.int32]


# --- Threats that reach a cell ---


# Side of a cell, as a fraction of the median radius.
CELL_SIDE_FRACTION = 0.2
# Maximum number of cells.
MAX_THREAT_CELLS = 300_000
# Largest height (m) that a cell stores.
MAX_CELL_HEIGHT = 2_000_000_000
# Extension of the grid beyond the map, as a fraction of the map's sides.
GRID_EXTENSION_FRACTION = 0.1
# A cell: first entry and number of its units in the list, and the lowest and highest heights (m) that any of them
# reaches.
THREAT_CELL = np.dtype(
    [("first", np.int32), ("count", np.int32), ("lowest", np.int32), ("highest", np.int32)], align=True
)


@by_reference
class ThreatCells(NamedTuple):
    """Grid on the map. Each cell lists the units (numbers of threats) that reach it.

    cells: `THREAT_CELL` records (c,), row by row; the last represents all points outside the grid and lists every unit.
    units: one array for all cells: first the units that reach cell 0, in increasing order, then those of cell 1.
    west, south: edges of the grid, m. side: side of a cell, m.
    columns, rows: number of columns and rows of the grid.
    """

    cells: Records
    units: Int32s
    west: float
    south: float
    side: float
    columns: int
    rows: int


def make_threat_cells(position: Floats, radius: Floats, bounds: Floats) -> ThreatCells:
    """List, for each cell of a grid on the map, the units whose sphere reaches above or below the cell.

    position: (m, 3) positions of the units, m.
    radius: (m,) radii of the spheres, m; 0 for none.
    bounds: (2, 2) map, m: west and east, then south and north.
    """
    min_corner, max_corner = bounds[:, 0], bounds[:, 1]
    min_corner, max_corner = (
        min_corner - GRID_EXTENSION_FRACTION * (max_corner - min_corner),
        max_corner + GRID_EXTENSION_FRACTION * (max_corner - min_corner),
    )
    size = max_corner - min_corner
    cell_size = math.sqrt(float(size[0] * size[1]) / MAX_THREAT_CELLS)
    positive_radii = radius[radius > 0.0]
    if positive_radii.size:
        cell_size = min(max(cell_size, CELL_SIDE_FRACTION * float(np.median(positive_radii))), float(size.max()))
    columns, rows = max(1, math.ceil(size[0] / cell_size)), max(1, math.ceil(size[1] / cell_size))
    first, units = _list_units(
        np.ascontiguousarray(position), radius, float(min_corner[0]), float(min_corner[1]), cell_size, columns, rows
    )
    # Whole metres, widened against rounding.
    min_altitudes = np.clip(np.floor(position[:, 2] - radius) - 1.0, -MAX_CELL_HEIGHT, MAX_CELL_HEIGHT).astype(np.int32)
    max_altitudes = np.clip(np.ceil(position[:, 2] + radius) + 1.0, -MAX_CELL_HEIGHT, MAX_CELL_HEIGHT).astype(np.int32)
    cells = np.zeros(first.size - 1, dtype=THREAT_CELL)
    _fill_cells(first, units, min_altitudes, max_altitudes, cells)
    for array in (cells, units):
        array.setflags(write=False)
    return ThreatCells(cells, units, float(min_corner[0]), float(min_corner[1]), cell_size, columns, rows)


@compiled
def _fill_cells(first: Int32s, units: Int32s, min_altitudes: Int32s, max_altitudes: Int32s, cells: Records) -> None:
    """Fill the record of each cell: its range of the list of units, and the altitudes they reach.

    first: (cells + 1,) cell k has the entries first[k] to first[k + 1] - 1 of the list.
    units: the list: first the units of cell 0, then those of cell 1.
    min_altitudes, max_altitudes: (u,) lowest and highest altitude that each unit reaches, m.
    cells: `THREAT_CELL` records to fill.
    """
    for k in range(cells.shape[0]):
        cell = cells[k]
        cell.first, cell.count = first[k], first[k + 1] - first[k]
        for entry in range(first[k], first[k + 1]):
            unit = units[entry]
            is_first = entry == first[k]
            cell.lowest = min_altitudes[unit] if is_first else min(cell.lowest, min_altitudes[unit])
            cell.highest = max_altitudes[unit] if is_first else max(cell.highest, max_altitudes[unit])


@compiled
def _list_units(
    position: Floats, radius: Floats, west: float, south: float, cell_size: float, columns: int, rows: int
) -> tuple[Int32s, Int32s]:
    """List the units that reach each cell; return each cell's first entry in the list, and the list.

    The list contains first the units of cell 0, then those of cell 1, and so on; the last cell is for points outside
    the grid and lists all units. The entries of cell k are first[k] to first[k + 1] - 1.

    position: (u, 3) positions of the units, m; altitudes are ignored.
    radius: (u,) horizontal reach of the units, m; a unit with 0 or less is left out.
    west, south: edges of the grid, m.
    cell_size: side of a cell, m.
    columns, rows: size of the grid.
    """
    count = columns * rows
    first = np.zeros(count + 2, dtype=np.int32)
    units = np.empty(0, dtype=np.int32)
    next_entries = first[:0].copy()
    # The first pass counts, the second fills.
    for pass_number in range(2):
        for k in range(position.shape[0]):
            if radius[k] <= 0.0:
                continue
            x, y, r = (position[k, 0] - west) / cell_size, (position[k, 1] - south) / cell_size, radius[k] / cell_size
            # Widened against rounding.
            r += 1e-6
            for row in range(max(0, math.floor(y - r)), min(rows - 1, math.floor(y + r)) + 1):
                dy = max(0.0, row - y, y - row - 1.0)
                for col in range(max(0, math.floor(x - r)), min(columns - 1, math.floor(x + r)) + 1):
                    dx = max(0.0, col - x, x - col - 1.0)
                    if dx * dx + dy * dy <= r * r:
                        cell = row * columns + col
                        if pass_number == 0:
                            first[cell + 1] += 1
                        else:
                            units[next_entries[cell]] = k
                            next_entries[cell] += 1
            if pass_number == 0:
                first[count + 1] += 1
            else:
                units[next_entries[count]] = k
                next_entries[count] += 1
        if pass_number == 0:
            for cell in range(count + 1):
                first[cell + 1] += first[cell]
            units = np.empty(first[count + 1], dtype=np.int32)
            next_entries = first.copy()
    return first, units


# --- Missiles near a segment ---


# Maximum number of classes by radius.
MAX_CLASSES = 8
# Mean number of missiles per cell.
MISSILES_PER_CELL = 2.0
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

    Missiles of similar radius form a class, which has a grid of its own: a long radius in one class does not enlarge
    the search in the others.

    missiles: `MISSILE` records (m,) of the missiles with a radius: class by class, and cell by cell within a class.
    classes: `MISSILE_CLASS` records (k,).
    first: (c,) first missile of each cell of the first class, then the end of its last cell; then the same for the next
    class.
    """

    missiles: Records
    classes: Records
    first: Ints


def make_missile_index(threats: Records, side: float | None = None) -> MissileIndex:
    """Make the spatial index of missiles: sort them by class, and within a class by the cells of its grid.

    threats: records with the fields east, north, up, kill_radius and kill_scale, m; threats without a kill radius are
        ignored.
    side: side of a cell, m; None for `MISSILES_PER_CELL` missiles per cell.
    """
    armed_threats = threats[threats["kill_radius"] > 0.0]
    missiles = np.zeros(len(armed_threats), dtype=MISSILE)
    for name, field in zip(MISSILE.names or (), ("east", "north", "up", "kill_radius", "kill_scale"), strict=True):
        missiles[name] = armed_threats[field]
    # A class spans a factor of two; the last class takes all smaller radii.
    max_radius = float(missiles["radius"].max(initial=1.0))
    class_numbers = np.minimum(MAX_CLASSES - 1, np.floor(np.log2(max_radius / missiles["radius"]))).astype(np.int64)
    ordered_missiles, classes, first = [missiles[:0]], [], [np.zeros(0, dtype=np.int64)]
    cell_count, missile_count = 0, 0
    for class_number in np.unique(class_numbers):
        class_missiles = missiles[class_numbers == class_number]
        positions = np.stack([class_missiles["east"], class_missiles["north"]], axis=1)
        min_corner, max_corner = positions.min(axis=0), positions.max(axis=0)
        area = float(np.prod(np.maximum(max_corner - min_corner, 1.0)))
        per_metre = 1.0 / (math.sqrt(MISSILES_PER_CELL * area / len(class_missiles)) if side is None else side)
        columns, rows = (int(size * per_metre) + 1 for size in max_corner - min_corner)
        steps = ((positions - min_corner) * per_metre).astype(np.int64)
        cell_indices = np.minimum(steps[:, 1], rows - 1) * columns + np.minimum(steps[:, 0], columns - 1)
        order = np.argsort(cell_indices, kind="stable")
        ordered_missiles.append(class_missiles[order])
        first.append(missile_count + np.searchsorted(cell_indices[order], np.arange(columns * rows + 1)))
        classes.append(
            (min_corner[0], min_corner[1], per_metre, columns, rows, cell_count, class_missiles["radius"].max())
        )
        cell_count, missile_count = cell_count + columns * rows + 1, missile_count + len(class_missiles)
    arrays = np.concatenate(ordered_missiles), np.array(classes, dtype=MISSILE_CLASS), np.concatenate(first)
    for array in arrays:
        array.setflags(write=False)
    return MissileIndex(*arrays)


@inner
def kill_density(
    index: MissileIndex,
    margin: float,
    max_distance: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    length_a: float,
    length_b: float,
    below: float,
    above: float,
) -> tuple[float, float, float]:
    """Return the mean kill density over the segment a-b, and the distances of spheres from its ends, m.

    index: missiles in classes of similar radii, each with its own grid; only missiles in cells near a-b are tested.
    margin: distance that is added to the radii, m.
    max_distance: a returned distance is exact if it is below this, m; otherwise it may be inf.
    ax, ay, az, bx, by, bz: east, north and altitude of the two ends, m.
    length_a, length_b: lengths of the parts at both ends, m, for which the distances to the nearest sphere are
        returned.
    below, above: largest distance of the aircraft below and above the segment, from its tracking error, m.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    length2 = dx * dx + dy * dy + dz * dz
    inverse, inverse_dy = 1.0 / length2 if length2 > 0.0 else 0.0, 1.0 / dy if abs(dy) > 1e-9 else 0.0
    missiles, starts = index.missiles, index.first
    density, distance_a, distance_b = 0.0, math.inf, math.inf
    for class_number in range(index.classes.shape[0]):
        missile_class = index.classes[class_number]
        per_metre, columns, rows = missile_class.cells_per_metre, missile_class.columns, missile_class.rows
        # Enlarged against rounding.
        radius, side = missile_class.largest_radius + margin + max_distance + 1e-6, 1.0 / per_metre
        first_row = _cell_index((min(ay, by) - radius - missile_class.south) * per_metre, rows)
        last_row = _cell_index((max(ay, by) + radius - missile_class.south) * per_metre, rows)
        for row in range(max(0, first_row), min(rows, last_row + 1)):
            # The part of the segment that can be near missiles in this row of cells.
            north = missile_class.south + row * side - ay
            begin_fraction, end_fraction = (
                _clip_fractions((north - radius) * inverse_dy, (north + side + radius) * inverse_dy)
                if inverse_dy != 0.0
                else (0.0, 1.0)
            )
            x, end_x = ax + begin_fraction * dx - missile_class.west, ax + end_fraction * dx - missile_class.west
            x, end_x = (x, end_x) if x < end_x else (end_x, x)
            first_column = _cell_index((x - radius) * per_metre, columns)
            last_column = _cell_index((end_x + radius) * per_metre, columns)
            if last_column < 0 or first_column >= columns:
                continue
            row_start = missile_class.first_cell + row * columns
            for entry in range(
                starts[row_start + max(0, first_column)], starts[row_start + min(columns - 1, last_column) + 1]
            ):
                missile = missiles[np.uintp(entry)]
                x, y, z = ax - missile.east, ay - missile.north, az - missile.up
                grown_radius = missile.radius + margin
                if below > 0.0 or above > 0.0:
                    z = _shift_towards_missile(
                        z, dz * min(1.0, max(0.0, -(dx * x + dy * y + dz * z) * inverse)), below, above
                    )
                dot, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
                closest2 = _closest2(-dot * inverse, 0.0, 1.0, dot, start2, length2)
                if closest2 < (grown_radius + max_distance) * (grown_radius + max_distance):
                    length = math.sqrt(length2)
                    end_a, begin_b = length_a / max(length, length_a), 1.0 - length_b / max(length, length_b)
                    distance2_a = _closest2(-dot * inverse, 0.0, end_a, dot, start2, length2)
                    distance2_b = _closest2(-dot * inverse, begin_b, 1.0, dot, start2, length2)
                    distance_a = min(distance_a, math.sqrt(distance2_a) - grown_radius)
                    distance_b = min(distance_b, math.sqrt(distance2_b) - grown_radius)
                    if closest2 < grown_radius * grown_radius:
                        density += _sphere_density(dot, start2, length2, grown_radius, missile.scale)
    return density, distance_a, distance_b


@inlined
def _clip_fractions(start_fraction: float, end_fraction: float) -> tuple[float, float]:
    """Sort two fractions of a line, and clip the interval between them to [0, 1].

    The first result exceeds the second if the interval does not overlap the line.
    """
    start_fraction, end_fraction = (
        (start_fraction, end_fraction) if start_fraction < end_fraction else (end_fraction, start_fraction)
    )
    return start_fraction if start_fraction > 0.0 else 0.0, end_fraction if end_fraction < 1.0 else 1.0


@inlined
def _shift_towards_missile(start_height: float, altitude_change: float, below: float, above: float) -> float:
    """Shift a segment towards a missile by up to the tracking error; return its start's new height, m.

    start_height: height of the segment's start above the missile, m.
    altitude_change: altitude change of the segment up to its closest point, m.
    below, above: vertical tracking error, m.

    The returned height, too, is measured from the missile. The shift ends when the closest point is level with the
    missile.
    """
    closest_height = start_height + altitude_change
    shift = min(closest_height, below) if closest_height > 0.0 else max(closest_height, -above)
    return start_height - shift


@inlined
def _cell_index(position: float, count: int) -> int:
    """Return the index of the cell that contains a position (in cells) along one axis.

    The index is -1 below the first cell, and `count` above the last.
    """
    clipped = position if position > -1.0 else -1.0
    return math.floor(clipped if clipped < count else count)


@inlined
def _closest2(
    closest_fraction: float, begin_fraction: float, end_fraction: float, dot: float, start2: float, length2: float
) -> float:
    """Return the squared distance from a point to the part of a segment between two fractions, m^2.

    closest_fraction: fraction of the infinite line that is closest to the point.
    begin_fraction, end_fraction: limits of the part, 0 to 1.
    dot, start2, length2: scalar products of the segment's vector d and the vector s from the point to the segment's
        start: d.s, s.s and d.d, m^2.
    """
    fraction = closest_fraction if closest_fraction < end_fraction else end_fraction
    fraction = fraction if fraction > begin_fraction else begin_fraction
    return max(0.0, start2 + fraction * (2.0 * dot + fraction * length2))


@inlined
def _sphere_density(
    dot: float, start2: float, length2: float, radius: float, scale: float
) -> float:  # pragma: no cover
    """Return the mean kill density over a segment that enters a sphere.

    dot, start2, length2: as in `window_exposure`; the point is the centre of the sphere.
    radius, scale: radius of the sphere, and scale of its kill density, m.
    """
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, dot, start2, scale)
    mid_fraction = -dot / length2
    half_fraction = math.sqrt(max(0.0, mid_fraction * mid_fraction - (start2 - radius * radius) / length2))
    begin_fraction, end_fraction = max(0.0, mid_fraction - half_fraction), min(1.0, mid_fraction + half_fraction)
    return (
        window_exposure(begin_fraction, end_fraction, length2, dot, start2, scale)
        if end_fraction > begin_fraction
        else 0.0
    )
