"""Compute the minimum altitude in each cell of a map for a glide to a destination.

The shortest paths over terrain are searched backwards.  One search begins at the destinations and runs against the
direction of flight.  The label of a cell is the minimum altitude from which a glide reaches a destination: the label of
the next cell plus the height lost on the step to the next cell, and no less than the ground plus the margin, in the
cell and between both cells.  So the labels include the terrain, and one search serves every second of a flight.  The
cost of a step is its length times sink rate over ground speed, on its course in the wind at that altitude, which is
exact.  Labels only grow in the backward direction: cells are settled by altitude, in bands no higher than the cheapest
step (E. W. Dijkstra, "A Note on Two Problems in Connexion with Graphs", 1959; bands: R. B. Dial, "Algorithm 360",
1969).

A step goes to one of 32 cells, in directions 7 to 14 degrees apart.  On a plane the labels equal the altitudes for the
straight path, or exceed them: by 1.0 % at the most in still air, and by 1.8 % in 10 m/s for an aircraft that glides at
18 m/s (`tests/logs/verdict/returns/test_glide_map.py`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import ground_speed
from flight.autopilots.point_mass import PointMass, excess_power
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from world.airspace.zone_kernels import ZoneRecords, edge_distance
from world.arrays import Codes, Flags, Floats
from world.highest_ground import highest_in_cells
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.terrain import Terrain
from world.wind import mean_wind_speed

# Rows and columns of c cells, (c, 2).
Cells = NDArray[np.int64]

# ----------------------------------------------------------------------
# The map: cells with their ground, minimum altitude and kill spheres.

# Largest number of cells of a map.
MAX_CELLS = 700_000
# Smallest side of a cell, m.
_MIN_CELL_M = 20.0
# Largest side of a cell, m.  A cell has the altitude of its highest ground, even if most of it is a valley.
_MAX_CELL_M = 240.0
# Largest side of a cell in pixels of the elevation file; applies if it is longer than `_MAX_CELL_M`.
_MAX_CELL_PIXELS = 8
# Margin of the map around the destinations and the flight, m.
MAP_MARGIN_M = 3000.0


@dataclass(frozen=True, slots=True, eq=False)
class GlideMap:
    """Map of square cells, with n rows from south to north and e columns from west to east.

    west, south: center of the first cell, m.
    cell: side of a cell, m.
    ground: ground altitude at the cells' centers, m, (n, e); NaN if unknown.
    floor: minimum altitude in each cell, which is its highest ground plus the margin, m, (n, e); NaN if unknown.
    sphere_bottoms, sphere_tops: altitudes between which each cell lies in kill spheres, m, (n, e); inf and -inf if the
        cell lies in none.
    """

    west: float
    south: float
    cell: float
    ground: Floats
    floor: Floats
    sphere_bottoms: Floats
    sphere_tops: Floats

    def cell_at(self, east: float, north: float) -> tuple[int, int]:
        """Return the row and column of the cell at a position, m; they may lie outside the map."""
        row = round((north - self.south) / self.cell)
        column = round((east - self.west) / self.cell)
        return row, column

    def cell_center(self, row: int, column: int) -> tuple[float, float]:
        """Return the center of a cell: east and north, m."""
        return self.west + column * self.cell, self.south + row * self.cell


def make_glide_map(
    terrain: Terrain, positions: Floats, margin: float, spheres: Floats, radii: Floats, map_margin: float = MAP_MARGIN_M
) -> GlideMap | None:
    """Make the glide map of the area around some positions.

    Each cell holds its ground, the minimum altitude of a glide in it, and the altitudes of the kill spheres in it.
    Return None for an area so large that a map with at most `MAX_CELLS` cells would be too coarse.

    positions: east and north, m, (p, 2).
    margin: height above ground that a glide keeps, m.
    spheres, radii: centers, m, (m, 3), and radii, m, (m,), of kill spheres.
    map_margin: margin of the map around the positions, m.

    >>> from world.terrain import make_flat_terrain
    >>> ground = make_flat_terrain(np.array([[-5000.0, 5000.0], [-5000.0, 5000.0]]), 100.0, 0.0)
    >>> made = make_glide_map(ground, np.zeros((1, 2)), 30.0, np.array([[0.0, 0.0, 100.0]]), np.array([500.0]))
    >>> row, column = made.cell_at(0.0, 0.0)
    >>> float(made.floor[row, column]), bool(made.sphere_tops[row, column] > 590.0), made.cell
    (130.0, True, 100.0)
    """
    (west, south), (east, north) = positions.min(axis=0) - map_margin, positions.max(axis=0) + map_margin
    spacing = max(1.0, terrain.spacing)
    cell = max(_MIN_CELL_M, min(0.5 * spacing, 100.0), math.sqrt((east - west) * (north - south) / MAX_CELLS))
    if cell > max(_MAX_CELL_M, _MAX_CELL_PIXELS * spacing):
        return None
    columns = math.ceil((east - west) / cell) + 1
    rows = math.ceil((north - south) / cell) + 1
    max_ground = highest_in_cells(terrain, west - 0.5 * cell, south - 0.5 * cell, cell, rows, columns)
    center_heights = terrain.height(west + cell * np.arange(columns)[None, :], south + cell * np.arange(rows)[:, None])
    sphere_bottoms = np.full(max_ground.shape, math.inf)
    sphere_tops = np.full(max_ground.shape, -math.inf)
    result = GlideMap(west, south, cell, center_heights, max_ground + margin, sphere_bottoms, sphere_tops)
    for center, radius in zip(spheres, radii.tolist(), strict=True):
        if not radius > 0.0:
            continue
        # Each cell around the sphere is checked at its point nearest to the sphere's center.
        row, column = result.cell_at(float(center[0]), float(center[1]))
        cell_reach = math.ceil(radius / cell) + 1
        near = (
            slice(max(0, row - cell_reach), max(0, row + cell_reach + 1)),
            slice(max(0, column - cell_reach), max(0, column + cell_reach + 1)),
        )
        bottoms, tops = sphere_bottoms[near], sphere_tops[near]
        norths = south + cell * (near[0].start + np.arange(bottoms.shape[0]))
        easts = west + cell * (near[1].start + np.arange(bottoms.shape[1]))
        east_distance = np.maximum(0.0, np.abs(easts[None, :] - center[0]) - 0.5 * cell)
        north_distance = np.maximum(0.0, np.abs(norths[:, None] - center[1]) - 0.5 * cell)
        distances = np.hypot(east_distance, north_distance)
        half_heights = np.sqrt(np.maximum(0.0, radius * radius - distances**2))
        is_inside = distances < radius
        bottoms[is_inside] = np.minimum(bottoms, center[2] - half_heights)[is_inside]
        tops[is_inside] = np.maximum(tops, center[2] + half_heights)[is_inside]
    return result


# Side of the square of flat ground that a landing needs, m.
LANDING_SQUARE_M = 150.0
# Largest gradient of the plane fitted to the ground of the square, m per m.
MAX_LANDING_GRADIENT = 0.05
# Largest root-mean-square deviation of the square's ground from that plane, m.
MAX_LANDING_ROUGHNESS_M = 1.5


def landable_cells(grid: GlideMap) -> Flags:
    """Return a mask (n, e): True for each cell outside kill spheres that has flat ground around it.

    A plane is fitted to the square of `LANDING_SQUARE_M` around the cell; its gradient and the deviations from it must
    be small.  The elevation file does not show trees, houses or water.
    """
    half_count = max(1, math.ceil(0.5 * (LANDING_SQUARE_M / grid.cell - 1.0) - 1e-9))
    offsets = np.arange(-half_count, half_count + 1)
    count = offsets.size**2
    ground = grid.ground
    # Heights relative to their mean, so that the sums of their squares lose no digits.
    relative_heights = ground - (np.nanmean(ground) if np.isfinite(ground).any() else 0.0)
    unit_weights = np.ones(offsets.size)
    height_sums = _square_sums(relative_heights, unit_weights, unit_weights)
    squared_height_sums = _square_sums(relative_heights * relative_heights, unit_weights, unit_weights)
    distances = np.asarray(offsets * grid.cell, dtype=np.float64)
    east_moments = _square_sums(relative_heights, unit_weights, distances)
    north_moments = _square_sums(relative_heights, distances, unit_weights)
    offset_moment = offsets.size * float((offsets**2).sum()) * grid.cell**2
    residuals = squared_height_sums - height_sums**2 / count - (east_moments**2 + north_moments**2) / offset_moment
    is_flat = np.hypot(east_moments, north_moments) / offset_moment <= MAX_LANDING_GRADIENT
    is_flat &= np.sqrt(np.maximum(0.0, residuals) / count) <= MAX_LANDING_ROUGHNESS_M
    return np.asarray(is_flat & ~((grid.sphere_bottoms < grid.floor) & (grid.floor < grid.sphere_tops)))


def _square_sums(values: Floats, row_weights: Floats, column_weights: Floats) -> Floats:
    """Return the weighted sum of values over the square around each cell, (n, e).

    It is NaN if the square leaves the map.
    values: (n, e).
    row_weights, column_weights: weights of the square's s rows and columns, (s,), s odd.  The weight of a cell in the
        square is the product of its row's and its column's weight.
    """
    sums = values
    for axis, weights in ((0, row_weights), (1, column_weights)):
        half_count = weights.size // 2
        padded_sums = np.pad(
            sums, [(half_count, half_count) if k == axis else (0, 0) for k in range(2)], constant_values=math.nan
        )
        length = values.shape[axis]
        shifted_sums = [np.take(padded_sums, range(k, k + length), axis=axis) for k in range(weights.size)]
        sums = np.sum([weight * shifted for weight, shifted in zip(weights, shifted_sums, strict=True)], axis=0)
    return np.asarray(sums)


def exclude_zones(grid: GlideMap, is_flat: Flags, zones: ZoneRecords, height: float) -> None:
    """Set `is_flat` to False in the cells of exclusion zones near the ground.

    Their floor is at most `height` above ground.

    height: m above ground.
    """
    for z in np.flatnonzero(zones.zones["exclusion"]):
        _exclude_zone(is_flat, grid.ground, zones, int(z), grid.west, grid.south, grid.cell, height)


@compiled
def _exclude_zone(
    is_flat: Flags, ground: Floats, zones: ZoneRecords, z: int, west: float, south: float, cell: float, height: float
) -> None:
    """Set `is_flat` to False in the cells of exclusion zone `z` where its floor is at most `height`.

    height: m above ground.
    west, south: center of the first cell, m.
    cell: side of a cell, m.
    """
    zone = zones.zones[z]
    rows, columns = is_flat.shape
    for i in range(
        max(0, math.ceil((zone.south - south) / cell)), min(rows, math.floor((zone.north - south) / cell) + 1)
    ):
        for j in range(
            max(0, math.ceil((zone.west - west) / cell)), min(columns, math.floor((zone.east - west) / cell) + 1)
        ):
            if is_flat[i, j]:
                floor = zone.floor + (ground[i, j] if zone.floor_above_ground else 0.0)
                if floor <= ground[i, j] + height and edge_distance(zones, z, west + j * cell, south + i * cell) < 0.0:
                    is_flat[i, j] = False


# ----------------------------------------------------------------------
# Steps from cell to cell, and their cost.

# Steps in cells in the octant from east to north-east; the other seven octants are mirrored.
_OCTANT_STEPS = ((1, 0), (4, 1), (2, 1), (3, 2), (1, 1))
# A step: its offset in cells, its course (rad), its length in cells, and its range of `_CROSSED_CELL` records.
STEP = record_dtype(
    ("east", np.int64), ("north", np.int64), "course", "length", ("first", np.int64), ("last", np.int64)
)
# A cell crossed by a step: its offset from the step's end, and the fraction of the step between the end and the cell.
_CROSSED_CELL = record_dtype(("east", np.int64), ("north", np.int64), "fraction")


def glide_steps() -> tuple[Records, Records]:
    """Return the 32 steps from a cell to nearby cells, and the cells that each step crosses.

    They are records of dtype `STEP` and of dtype `_CROSSED_CELL`.

    >>> made, between = glide_steps()
    >>> len(made), len({round(float(one.course), 6) for one in made})
    (32, 32)
    """
    offsets: set[tuple[int, int]] = set()
    for major, minor in _OCTANT_STEPS:
        offsets |= {(x * i, y * j) for x, y in ((major, minor), (minor, major)) for i in (-1, 1) for j in (-1, 1)}
    records: Records = np.zeros(len(offsets), STEP)
    crossed_cells: list[tuple[int, int, float]] = []
    for step, (east, north) in zip(records, sorted(offsets), strict=True):
        step.east, step.north = east, north
        step.course, step.length, step.first = math.atan2(east, north), math.hypot(east, north), len(crossed_cells)
        fraction_by_cell: dict[tuple[int, int], float] = {}
        # Sample 63 points between the ends of the step, backwards from its end.  A cell that is only touched at a
        # corner may be missed.
        for k in range(1, 64):
            fraction = k / 64.0
            cell = (-round(fraction * east), -round(fraction * north))
            fraction_by_cell.setdefault(cell, fraction)
        ends = ((0, 0), (-east, -north))
        crossed_cells += [
            (cell[0], cell[1], fraction) for cell, fraction in fraction_by_cell.items() if cell not in ends
        ]
        step.last = len(crossed_cells)
    cell_records: Records = np.zeros(len(crossed_cells), _CROSSED_CELL)
    for cell, row in zip(cell_records, crossed_cells, strict=True):
        cell.east, cell.north, cell.fraction = row
    return records, cell_records


class GlideSlopes(NamedTuple):
    """Height lost per meter over the ground, by course and altitude.

    first_altitude, altitude_step: first altitude and altitude step of the table, m.
    table: slopes for the courses of `glide_steps` and for h altitudes, m per m, (c, h); inf if no progress is made.
    """

    first_altitude: float
    altitude_step: float
    table: Floats


# Altitude step of the slopes, m.
_ALTITUDE_STEP_M = 100.0
# Minimum ground speed that counts as progress, m/s.
_MIN_GROUND_SPEED_MPS = 1.0


# Function that returns n possible winds at each of h altitudes (m AMSL), m/s, (n, h, 2).
PossibleWinds = Callable[[Floats], Floats]


def glide_slopes(
    aircraft: PointMass,
    airspeed: float,
    min_altitude: float,
    max_altitude: float,
    possible_winds: PossibleWinds | None = None,
) -> GlideSlopes:
    """Compute the height lost per meter over the ground, by course and altitude.

    The altitudes lie between two altitudes (m AMSL).

    airspeed: equivalent airspeed of the glide, m/s.
    possible_winds: winds of a forecast, the worst of which is used on each course; None for the mean wind.
    """
    courses = np.array(glide_steps()[0]["course"])
    slopes = np.zeros((courses.size, max(2, math.ceil((max_altitude - min_altitude) / _ALTITUDE_STEP_M) + 1)))
    altitudes: Floats = min_altitude + _ALTITUDE_STEP_M * np.arange(slopes.shape[1], dtype=np.float64)
    winds = np.zeros((0, 0, 2)) if possible_winds is None else possible_winds(altitudes)
    _fill_slopes(aircraft.record, aircraft.excess, airspeed, courses, min_altitude, winds, slopes)
    return GlideSlopes(min_altitude, _ALTITUDE_STEP_M, slopes)


@compiled
def _fill_slopes(
    aircraft: Record,
    excess: Floats,
    airspeed: float,
    courses: Floats,
    min_altitude: float,
    winds: Floats,
    slopes: Floats,
) -> None:
    """Fill the zeroed table `slopes`, (c, h), with glide slopes, m per m, by course and altitude.

    A slope is inf if the aircraft makes no progress against the wind.

    aircraft, excess: point mass, and its excess power by throttle and airspeed.
    airspeed: equivalent airspeed, m/s.
    courses: rad, (c,).
    min_altitude: first altitude of the table, m AMSL; the others follow every `_ALTITUDE_STEP_M`.
    winds: possible winds by altitude, m/s, (n, h, 2); the worst of them is used.  Empty for the mean wind.
    """
    for h in range(slopes.shape[1]):
        altitude = min_altitude + h * _ALTITUDE_STEP_M
        true_airspeed = airspeed * eas_to_tas_ratio(altitude)
        sink = max(0.0, -excess_power(excess, 0.0, true_airspeed, altitude, aircraft))
        horizontal_speed = math.sqrt(max(0.0, true_airspeed * true_airspeed - sink * sink))
        wind = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, altitude)
        wind_east, wind_north = aircraft.wind_east, aircraft.wind_north
        for k in range(max(1, winds.shape[0])):
            if winds.shape[0]:
                wind, wind_east, wind_north = 1.0, winds[k, h, 0], winds[k, h, 1]
            for c in range(courses.size):
                east, north = math.sin(courses[c]), math.cos(courses[c])
                tailwind = wind * (wind_east * east + wind_north * north)
                crosswind = wind * (wind_east * north - wind_north * east)
                speed_over_ground = ground_speed(horizontal_speed, tailwind, crosswind)
                slope = sink / speed_over_ground if speed_over_ground > _MIN_GROUND_SPEED_MPS else math.inf
                slopes[c, h] = max(slopes[c, h], slope)


# ----------------------------------------------------------------------
# The search.


@dataclass(frozen=True, slots=True)
class GlideAltitudes:
    """Result of the backward search from one set of destinations.

    grid: the map.
    min_altitude: minimum altitude from which a glide reaches a destination, m AMSL, (n, e); inf if none is reached.
    destination: cell of the destination that is reached, numbered through all rows, (n, e); -1 if none is reached.
    next_step: index in `glide_steps` of the next step of the glide, (n, e); -1 at the destination itself.
    """

    grid: GlideMap
    min_altitude: Floats
    destination: Codes
    next_step: Codes


def search_glide_altitudes(grid: GlideMap, cells: Cells, slopes: GlideSlopes, max_altitude: float) -> GlideAltitudes:
    """Compute, for each cell, the lowest altitude from which a glide reaches a destination.

    The search runs backwards from the destinations, up to ``max_altitude`` (m AMSL).  Destinations off the map and on
    unknown ground are ignored.

    cells: rows and columns of the destinations, (c, 2).
    """
    min_altitude: Floats = np.full_like(grid.floor, math.inf)
    destination: Codes = np.full(min_altitude.shape, -1, dtype=np.int32)
    next_step: Codes = np.full(min_altitude.shape, -1, dtype=np.int32)
    rows, columns = grid.floor.shape
    row, column = cells[:, 0], cells[:, 1]
    is_on_map = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    row, column = row[is_on_map], column[is_on_map]
    floor_altitudes = grid.floor[row, column]
    sphere_bottoms = grid.sphere_bottoms[row, column]
    sphere_tops = grid.sphere_tops[row, column]
    min_altitude[row, column] = np.where(
        (sphere_bottoms < floor_altitudes) & (floor_altitudes < sphere_tops), sphere_tops, floor_altitudes
    )
    min_altitude[~(min_altitude <= max_altitude)] = math.inf
    destination[row, column] = row * columns + column
    destination[np.isinf(min_altitude)] = -1
    step_records, crossed_cells = glide_steps()
    finite_slopes = slopes.table[np.isfinite(slopes.table) & (slopes.table > 0.0)]
    if np.isfinite(min_altitude).any() and finite_slopes.size:
        band = float(finite_slopes.min()) * grid.cell
        first_altitude = float(min_altitude.min())
        band_heads: Codes = np.full(max(1, math.ceil((max_altitude - first_altitude) / band) + 2), -1, dtype=np.int32)
        _settle_cells(
            grid.floor,
            grid.sphere_bottoms,
            grid.sphere_tops,
            min_altitude,
            destination,
            next_step,
            step_records,
            crossed_cells,
            slopes.table,
            slopes.first_altitude,
            slopes.altitude_step,
            grid.cell,
            first_altitude,
            band,
            max_altitude,
            band_heads,
            np.full((min_altitude.size, 2), -1, dtype=np.int32),
        )
    return GlideAltitudes(grid, min_altitude, destination, next_step)


@compiled
def _settle_cells(
    floor: Floats,
    sphere_bottoms: Floats,
    sphere_tops: Floats,
    min_altitude: Floats,
    destination: Codes,
    next_step: Codes,
    step_records: Records,
    crossed_cells: Records,
    slopes: Floats,
    slopes_first_altitude: float,
    altitude_step: float,
    cell: float,
    first_altitude: float,
    band: float,
    max_altitude: float,
    band_heads: Codes,
    links: Codes,
) -> None:
    """Fill `min_altitude`, `destination` and `next_step` by settling cells in order of altitude.

    This is the search of Dijkstra, against the direction of flight; see the head of this module.
    floor, sphere_bottoms, sphere_tops: see `GlideMap`.  step_records, crossed_cells: see `glide_steps`.
    slopes: glide slope of each step at altitudes from `slopes_first_altitude`, every `altitude_step`, m per m.
    cell, band: side of a cell, and height of a band, m.  first_altitude: lower end of the lowest band, m AMSL.
    band_heads: first cell of each band, (b,); -1 for an empty band.
    links: previous and next cell of each cell in its band, (cells, 2); -1 for none.
    """
    rows, columns = min_altitude.shape
    flat_altitudes = min_altitude.ravel()
    for k in range(flat_altitudes.size):
        if flat_altitudes[k] <= max_altitude:
            _insert_into_band(k, int((flat_altitudes[k] - first_altitude) / band), band_heads, links)
    for b in range(band_heads.size):
        while band_heads[b] >= 0:
            k = band_heads[b]
            _remove_from_band(k, b, band_heads, links)
            row, column = k // columns, k % columns
            altitude = flat_altitudes[k]
            # The position stays below the last column, because the slope is interpolated to the next column.
            slope_position = min(slopes.shape[1] - 1.001, max(0.0, (altitude - slopes_first_altitude) / altitude_step))
            slope_row = int(slope_position)
            for step_index in range(step_records.shape[0]):
                step = step_records[step_index]
                i, j = row - step.north, column - step.east
                if not (0 <= i < rows and 0 <= j < columns):
                    continue
                below, above = slopes[step_index, slope_row], slopes[step_index, slope_row + 1]
                altitude_loss = cell * step.length * (below + (slope_position - slope_row) * (above - below))
                if not altitude + altitude_loss < min_altitude[i, j]:
                    continue
                start_altitude = _step_start_altitude(
                    floor, sphere_bottoms, sphere_tops, crossed_cells, step, row, column, altitude, altitude_loss
                )
                if not (start_altitude < min_altitude[i, j] and start_altitude <= max_altitude):
                    continue
                neighbour = i * columns + j
                if min_altitude[i, j] <= max_altitude:
                    _remove_from_band(neighbour, int((min_altitude[i, j] - first_altitude) / band), band_heads, links)
                min_altitude[i, j], destination[i, j] = start_altitude, destination[row, column]
                next_step[i, j] = step_index
                _insert_into_band(neighbour, int((start_altitude - first_altitude) / band), band_heads, links)


@inner
def _step_start_altitude(
    floor: Floats,
    sphere_bottoms: Floats,
    sphere_tops: Floats,
    crossed_cells: Records,
    step: Record,
    row: int,
    column: int,
    end_altitude: float,
    altitude_loss: float,
) -> float:
    """Return the minimum altitude at the start of a step that clears all crossed cells, m AMSL.

    From the end of the step back to its start, the altitude is raised to the floor of each crossed cell and above the
    kill spheres in it.  The result is NaN if the ground is unknown.

    floor, sphere_bottoms, sphere_tops: see `GlideMap`.
    crossed_cells, step: the cells of all steps, and the step; see `glide_steps`.
    row, column: cell in which the step ends.
    end_altitude: altitude at the end of the step, m AMSL.
    altitude_loss: height lost in the step, m.
    """
    start_altitude = end_altitude + altitude_loss
    for k in range(step.first, step.last):
        cell = crossed_cells[k]
        i, j = row + cell.north, column + cell.east
        # Height lost from the step's start to this cell.
        altitude_lost = (1.0 - cell.fraction) * altitude_loss
        altitude = _raise_above_spheres(
            max(start_altitude - altitude_lost, floor[i, j]), sphere_bottoms[i, j], sphere_tops[i, j]
        )
        # The comparison is False for NaN, which means unknown ground.
        if not floor[i, j] <= altitude:
            return math.nan
        start_altitude = altitude + altitude_lost
    i, j = row - step.north, column - step.east
    if not floor[i, j] <= math.inf:
        return math.nan
    start_altitude = _raise_above_spheres(max(start_altitude, floor[i, j]), sphere_bottoms[i, j], sphere_tops[i, j])
    return start_altitude


@inner
def _raise_above_spheres(altitude: float, bottom: float, top: float) -> float:
    """Return an altitude (m), or the top of the kill spheres if the altitude lies inside them."""
    return top if bottom < altitude < top else altitude


@inner
def _insert_into_band(cell: int, band: int, band_heads: Codes, links: Codes) -> None:
    """Insert a cell at the head of the linked list of a band."""
    first = band_heads[band]
    links[cell, 0], links[cell, 1] = -1, first
    if first >= 0:
        links[first, 0] = cell
    band_heads[band] = cell


@inner
def _remove_from_band(cell: int, band: int, band_heads: Codes, links: Codes) -> None:
    """Remove a cell from the linked list of a band, if the list contains it."""
    previous, next_cell = links[cell, 0], links[cell, 1]
    if previous >= 0:
        links[previous, 1] = next_cell
    elif band_heads[band] == cell:
        band_heads[band] = next_cell
    if next_cell >= 0:
        links[next_cell, 0] = previous
    links[cell, 0], links[cell, 1] = -1, -1
