"""Compute the altitude from which an aircraft can glide to a place, for every cell of a map.

The shortest paths over terrain are searched backwards.  One search begins at the places to be reached and runs
against the direction of flight.  A cell's label is the least altitude from which the glide gets there: the label of
the next cell plus the height lost on the step to it, and no less than the ground with its margin, there and between
them.  So the labels include the terrain, and one search serves every second of a flight.  A step costs its length
times sink by ground speed on its course in the wind at that altitude, which is exact for each step of a path.  Labels
only grow in the backward direction: cells are settled by altitude, in bands no higher than the cheapest step (E. W.
Dijkstra, "A Note on Two Problems in Connexion with Graphs", 1959; bands: R. B. Dial, "Algorithm 360", 1969).

A step goes to one of 32 cells, in directions 7 to 14 degrees apart.  On a plane the labels equal the altitudes for the
straight path, or exceed them: by 1.0 % at the most in still air, and by 1.8 % in 10 m/s for an aircraft that glides at
18 m/s (`tests/logs/verdict/returns/test_glide_map.py`).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import ground_speed
from flight.autopilots.arduplane.point_mass import PointMass, excess_power
from flight.guidance.equivalent_airspeed import true_by_equivalent
from world.airspace.zone_kernels import ZoneRecords, edge_distance
from world.arrays import Codes, Flags, Floats
from world.highest_ground import highest_in_cells
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.terrain import Terrain
from world.wind import mean_wind_speed

# Rows and columns of cells (c, 2).
Cells = NDArray[np.int64]

# ----------------------------------------------------------------------
# The map: cells with their least altitudes.

# Largest number of cells of a map.
MAX_CELLS = 700_000
# Smallest side of a cell, m.
_MIN_CELL_M = 20.0
# Largest side of a cell, m: a larger cell has the altitude of its highest ground even if most of it is valley.
_MAX_CELL_M = 240.0
# Largest side of a cell, pixels of the elevation file, if that is more.
_MAX_CELL_PIXELS = 8
# Margin of the map around the places and the flight, m.
AROUND = 3000.0


@dataclass(frozen=True, slots=True)
class GlideMap:
    """Square cells in rows to the north and columns to the east.

    west, south: m, center of the first cell.  cell: its side, m.
    ground: (n, e) ground altitude at the centers, m, NaN if unknown.
    floor: (n, e) least altitude in a cell: its highest ground plus the margin, m; NaN if unknown.
    low, high: (n, e) altitudes between which a cell lies in kill spheres, m; inf and -inf if in none.
    """

    west: float
    south: float
    cell: float
    ground: Floats
    floor: Floats
    low: Floats
    high: Floats

    def cell_of(self, east: float, north: float) -> tuple[int, int]:
        """Return row and column of the cell that contains a place on the map."""
        row, column = round((north - self.south) / self.cell), round((east - self.west) / self.cell)
        return row, column

    def middle(self, row: int, column: int) -> tuple[float, float]:
        """Return east and north of a cell's center, m."""
        return self.west + column * self.cell, self.south + row * self.cell


def glide_map(
    terrain: Terrain, places: Floats, margin: float, spheres: Floats, radii: Floats, around: float = AROUND
) -> GlideMap | None:
    """Return the map around places (p, 2), m, or None if its cells would be too coarse for its extent.

    margin: height above ground that a glide keeps, m.  spheres, radii: (m, 3) and (m,) of kill spheres, m.

    >>> from world.terrain import flat_terrain
    >>> ground = flat_terrain(np.array([[-5000.0, 5000.0], [-5000.0, 5000.0]]), 100.0, 0.0)
    >>> made = glide_map(ground, np.zeros((1, 2)), 30.0, np.array([[0.0, 0.0, 100.0]]), np.array([500.0]))
    >>> row, column = made.cell_of(0.0, 0.0)
    >>> float(made.floor[row, column]), bool(made.high[row, column] > 590.0), made.cell
    (130.0, True, 100.0)
    """
    (west, south), (east, north) = places.min(axis=0) - around, places.max(axis=0) + around
    spacing = max(1.0, terrain.spacing)
    cell = max(_MIN_CELL_M, min(0.5 * spacing, 100.0), math.sqrt((east - west) * (north - south) / MAX_CELLS))
    if cell > max(_MAX_CELL_M, _MAX_CELL_PIXELS * spacing):
        return None
    columns, rows = math.ceil((east - west) / cell) + 1, math.ceil((north - south) / cell) + 1
    highest = highest_in_cells(terrain, west - 0.5 * cell, south - 0.5 * cell, cell, rows, columns)
    middles = terrain.height(west + cell * np.arange(columns)[None, :], south + cell * np.arange(rows)[:, None])
    low, high = np.full(highest.shape, math.inf), np.full(highest.shape, -math.inf)
    made = GlideMap(west, south, cell, middles, highest + margin, low, high)
    for centre, radius in zip(spheres, radii, strict=True):
        if radius > 0.0:
            _add_sphere(made, centre, float(radius))
    return made


def _add_sphere(made: GlideMap, centre: Floats, radius: float) -> None:
    """Widen the altitude ranges in which the cells of `made` lie in a kill sphere.

    Each cell is checked at its point nearest to the sphere's center.
    """
    row, column = made.cell_of(float(centre[0]), float(centre[1]))
    steps = math.ceil(radius / made.cell) + 1
    rows = slice(max(0, row - steps), max(0, row + steps + 1))
    columns = slice(max(0, column - steps), max(0, column + steps + 1))
    shape = made.floor[rows, columns].shape
    norths = made.south + made.cell * (rows.start + np.arange(shape[0]))
    easts = made.west + made.cell * (columns.start + np.arange(shape[1]))
    across = np.maximum(0.0, np.abs(easts[None, :] - centre[0]) - 0.5 * made.cell)
    along = np.maximum(0.0, np.abs(norths[:, None] - centre[1]) - 0.5 * made.cell)
    away = np.hypot(across, along)
    half = np.sqrt(np.maximum(0.0, radius * radius - away**2))
    inside = away < radius
    low, high = made.low[rows, columns], made.high[rows, columns]
    low[inside] = np.minimum(low, centre[2] - half)[inside]
    high[inside] = np.maximum(high, centre[2] + half)[inside]


# Side of the square that a landing place needs, m.
PATCH = 150.0
# Largest gradient of the plane that fits the square best, m per m.
STEEPEST = 0.05
# Largest root-mean-square deviation of the square's ground from that plane, m.
ROUGHEST = 1.5


def landable(made: GlideMap) -> Flags:
    """Return cells (n, e) with flat ground around them by the elevation file, outside kill spheres.

    The file has no trees, houses or water.
    """
    half = max(1, math.ceil(0.5 * (PATCH / made.cell - 1.0) - 1e-9))
    taps = np.arange(-half, half + 1)
    count = taps.size**2
    ground = made.ground
    # Heights relative to a mean, so that their squares keep their digits.
    z = ground - (np.nanmean(ground) if np.isfinite(ground).any() else 0.0)
    one = np.ones(taps.size)
    total, squares = _patch_sums(z, one, one), _patch_sums(z * z, one, one)
    away = np.asarray(taps * made.cell, dtype=np.float64)
    across, up = _patch_sums(z, one, away), _patch_sums(z, away, one)
    spread = taps.size * float((taps**2).sum()) * made.cell**2
    left = squares - total**2 / count - (across**2 + up**2) / spread
    flat = np.hypot(across, up) / spread <= STEEPEST
    flat &= np.sqrt(np.maximum(0.0, left) / count) <= ROUGHEST
    return np.asarray(flat & ~((made.low < made.floor) & (made.floor < made.high)))


def _patch_sums(values: Floats, by_row: Floats, by_column: Floats) -> Floats:
    """Return weighted sums (n, e) over the square around each cell; NaN if the square leaves the map."""
    out = values
    for axis, weights in ((0, by_row), (1, by_column)):
        half = weights.size // 2
        padded = np.pad(out, [(half, half) if k == axis else (0, 0) for k in range(2)], constant_values=math.nan)
        length = values.shape[axis]
        parts = [np.take(padded, range(k, k + length), axis=axis) for k in range(weights.size)]
        out = np.sum([weight * part for weight, part in zip(weights, parts, strict=True)], axis=0)
    return np.asarray(out)


def bar_zones(made: GlideMap, flat: Flags, zones: ZoneRecords, above: float) -> None:
    """Clear cells (n, e) in exclusion zones that reach down to a height above ground, m."""
    for z in np.flatnonzero(zones.zones["exclusion"]):
        _bar_zone(flat, made.ground, zones, int(z), made.west, made.south, made.cell, above)


@compiled
def _bar_zone(
    flat: Flags, ground: Floats, zones: ZoneRecords, z: int, west: float, south: float, cell: float, above: float
) -> None:
    zone = zones.zones[z]
    rows, columns = flat.shape
    for i in range(
        max(0, math.ceil((zone.south - south) / cell)), min(rows, math.floor((zone.north - south) / cell) + 1)
    ):
        for j in range(
            max(0, math.ceil((zone.west - west) / cell)), min(columns, math.floor((zone.east - west) / cell) + 1)
        ):
            if flat[i, j]:
                floor = zone.floor + (ground[i, j] if zone.floor_above_ground else 0.0)
                if floor <= ground[i, j] + above and edge_distance(zones, z, west + j * cell, south + i * cell) < 0.0:
                    flat[i, j] = False


# ----------------------------------------------------------------------
# Steps from cell to cell, and their cost.

# Steps in cells in the octant from east to north-east; the other seven octants are mirrored.
_OCTANT_STEPS = ((1, 0), (4, 1), (2, 1), (3, 2), (1, 1))
# A step: its offset in cells, its course (rad), its length in cells, and its range of cells in `_BETWEEN`.
STEP = record_dtype(
    ("east", np.int64), ("north", np.int64), "course", "length", ("first", np.int64), ("last", np.int64)
)
# A cell crossed by a step: its offset from the step's end, and the fraction of the step between the end and the cell.
_BETWEEN = record_dtype(("east", np.int64), ("north", np.int64), "share")


def steps() -> tuple[Records, Records]:
    """Return the 32 steps, (32,) of `STEP`, and the cells that lie between the ends of each.

    >>> made, between = steps()
    >>> len(made), len({round(float(one.course), 6) for one in made})
    (32, 32)
    """
    found: set[tuple[int, int]] = set()
    for a, b in _OCTANT_STEPS:
        found |= {(x * i, y * j) for x, y in ((a, b), (b, a)) for i in (-1, 1) for j in (-1, 1)}
    made: Records = np.zeros(len(found), STEP)
    between: list[tuple[int, int, float]] = []
    for step, (east, north) in zip(made, sorted(found), strict=True):
        step.east, step.north = east, north
        step.course, step.length, step.first = math.atan2(east, north), math.hypot(east, north), len(between)
        nearest: dict[tuple[int, int], float] = {}
        for k in range(1, 64):
            share = k / 64.0
            # From the end backwards; corners, which are touched and not crossed, are assigned to either side.
            cell = (-round(share * east), -round(share * north))
            nearest.setdefault(cell, share)
        ends = ((0, 0), (-east, -north))
        between += [(cell[0], cell[1], share) for cell, share in nearest.items() if cell not in ends]
        step.last = len(between)
    cells: Records = np.zeros(len(between), _BETWEEN)
    for cell, row in zip(cells, between, strict=True):
        cell.east, cell.north, cell.share = row
    return made, cells


class GlideSlopes(NamedTuple):
    """Height lost per metre over the ground, by course and altitude.

    low, pitch: the first altitude and the step between two, m.
    table: (c, h) m per m, for the courses of `steps`; inf if no progress is made.
    """

    low: float
    pitch: float
    table: Floats


# Altitude step of the slopes, m.
_ALTITUDE_STEP_M = 100.0
# Least ground speed that is progress, m/s.
_MIN_GROUND_SPEED_MPS = 1.0


def glide_slopes(aircraft: PointMass, airspeed: float, low: float, top: float) -> GlideSlopes:
    """Return the slopes between two altitudes (m AMSL) at an equivalent airspeed, m/s."""
    courses = np.array(steps()[0]["course"])
    table = np.empty((courses.size, max(2, math.ceil((top - low) / _ALTITUDE_STEP_M) + 1)))
    _fill_slopes(aircraft.record, aircraft.excess, airspeed, courses, low, table)
    return GlideSlopes(low, _ALTITUDE_STEP_M, table)


@compiled
def _fill_slopes(aircraft: Record, excess: Floats, airspeed: float, courses: Floats, low: float, table: Floats) -> None:
    for h in range(table.shape[1]):
        amsl = low + h * _ALTITUDE_STEP_M
        true = airspeed * true_by_equivalent(amsl)
        sink = max(0.0, -excess_power(excess, 0.0, true, amsl, aircraft))
        level = math.sqrt(max(0.0, true * true - sink * sink))
        wind = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, amsl)
        for c in range(courses.size):
            east, north = math.sin(courses[c]), math.cos(courses[c])
            along = wind * (aircraft.wind_east * east + aircraft.wind_north * north)
            across = wind * (aircraft.wind_east * north - aircraft.wind_north * east)
            over = ground_speed(level, along, across)
            table[c, h] = sink / over if over > _MIN_GROUND_SPEED_MPS else math.inf


# ----------------------------------------------------------------------
# The search.


@dataclass(frozen=True, slots=True)
class Needs:
    """Result of the search for one set of places.

    made: the map.
    need: (n, e) least altitude from which a glide gets to one of them, m AMSL; inf if none.
    origin: (n, e) the cell of the place that is reached, numbered through all rows; -1 if none.
    onward: (n, e) the next step of the glide, an index of `steps`; -1 at the place itself.
    """

    made: GlideMap
    need: Floats
    origin: Codes
    onward: Codes


def least_heights(made: GlideMap, cells: Cells, slopes: GlideSlopes, top: float) -> Needs:
    """Search backwards from cells up to an altitude, m AMSL; higher labels are not computed.

    Cells off the map, and cells whose ground is unknown, lead nowhere.
    """
    need: Floats = np.full_like(made.floor, math.inf)
    origin: Codes = np.full(need.shape, -1, dtype=np.int32)
    onward: Codes = np.full(need.shape, -1, dtype=np.int32)
    rows, columns = made.floor.shape
    row, column = cells[:, 0], cells[:, 1]
    held = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    row, column = row[held], column[held]
    begins = made.floor[row, column]
    low, high = made.low[row, column], made.high[row, column]
    need[row, column] = np.where((low < begins) & (begins < high), high, begins)
    need[~(need <= top)] = math.inf
    origin[row, column] = row * columns + column
    origin[np.isinf(need)] = -1
    moves, between = steps()
    finite = slopes.table[np.isfinite(slopes.table) & (slopes.table > 0.0)]
    if np.isfinite(need).any() and finite.size:
        band = float(finite.min()) * made.cell
        lowest = float(need.min())
        heads: Codes = np.full(max(1, math.ceil((top - lowest) / band) + 2), -1, dtype=np.int32)
        _search(
            made.floor,
            made.low,
            made.high,
            need,
            origin,
            onward,
            moves,
            between,
            slopes.table,
            slopes.low,
            slopes.pitch,
            made.cell,
            lowest,
            band,
            top,
            heads,
            np.full((need.size, 2), -1, dtype=np.int32),
        )
    return Needs(made, need, origin, onward)


@compiled
def _search(
    floor: Floats,
    low: Floats,
    high: Floats,
    need: Floats,
    origin: Codes,
    onward: Codes,
    moves: Records,
    between: Records,
    slopes: Floats,
    slopes_low: float,
    pitch: float,
    cell: float,
    lowest: float,
    band: float,
    top: float,
    heads: Codes,
    links: Codes,
) -> None:
    """Fill `need`, `origin` and `onward` by settling cells in order of altitude, band after band.

    heads: (b,) the first cell of each band, -1 for none.  links: (cells, 2) a cell's neighbours in its band.
    """
    rows, columns = need.shape
    flat = need.ravel()
    for k in range(flat.size):
        if flat[k] <= top:
            _insert(k, int((flat[k] - lowest) / band), heads, links)
    for b in range(heads.size):
        while heads[b] >= 0:
            k = heads[b]
            _remove(k, b, heads, links)
            row, column = k // columns, k % columns
            here = flat[k]
            x = min(slopes.shape[1] - 1.001, max(0.0, (here - slopes_low) / pitch))
            h = int(x)
            for m in range(moves.shape[0]):
                move = moves[m]
                i, j = row - move.north, column - move.east
                if not (0 <= i < rows and 0 <= j < columns):
                    continue
                loss = cell * move.length * (slopes[m, h] + (x - h) * (slopes[m, h + 1] - slopes[m, h]))
                if not here + loss < need[i, j]:
                    continue
                wanted = _step_start_altitude(floor, low, high, between, move, row, column, here, loss)
                if not (wanted < need[i, j] and wanted <= top):
                    continue
                other = i * columns + j
                if need[i, j] <= top:
                    _remove(other, int((need[i, j] - lowest) / band), heads, links)
                need[i, j], origin[i, j], onward[i, j] = wanted, origin[row, column], m
                _insert(other, int((wanted - lowest) / band), heads, links)


@inner
def _step_start_altitude(
    floor: Floats,
    low: Floats,
    high: Floats,
    between: Records,
    move: Record,
    row: int,
    column: int,
    here: float,
    loss: float,
) -> float:
    """Return the minimum start altitude of a step that ends in a cell and stays above all cells between, m, or NaN."""
    wanted = here + loss
    for k in range(move.first, move.last):
        cell = between[k]
        i, j = row + cell.north, column + cell.east
        # Height lost from the step's start to this cell.
        lost = (1.0 - cell.share) * loss
        altitude = _raise_above_spheres(max(wanted - lost, floor[i, j]), low[i, j], high[i, j])
        # NaN, for unknown ground, fails the comparison.
        if not floor[i, j] <= altitude:
            return math.nan
        wanted = altitude + lost
    i, j = row - move.north, column - move.east
    if not floor[i, j] <= math.inf:
        return math.nan
    wanted = _raise_above_spheres(max(wanted, floor[i, j]), low[i, j], high[i, j])
    return wanted


@inner
def _raise_above_spheres(up: float, low: float, high: float) -> float:
    """Return an altitude, or the top of the spheres if they contain the altitude, m."""
    return high if low < up < high else up


@inner
def _insert(cell: int, band: int, heads: Codes, links: Codes) -> None:
    """Insert a cell at the head of a band."""
    first = heads[band]
    links[cell, 0], links[cell, 1] = -1, first
    if first >= 0:
        links[first, 0] = cell
    heads[band] = cell


@inner
def _remove(cell: int, band: int, heads: Codes, links: Codes) -> None:
    """Remove a cell from its band, if it is in it."""
    before, after = links[cell, 0], links[cell, 1]
    if before >= 0:
        links[before, 1] = after
    elif heads[band] == cell:
        heads[band] = after
    if after >= 0:
        links[after, 0] = before
    links[cell, 0], links[cell, 1] = -1, -1
