"""Prove that no path exists, because ground, ceiling and missiles block every path on the map.

In thin air an aircraft may not be able to climb or to hold its altitude at its cruise speed. The lowest such altitude
acts as a ceiling (`highest_level_flight`, `highest_waypoint`).

The map is divided into square columns. An altitude is closed in a column if the whole square is inside one kill sphere
there, or below the lowest ground of the square plus the clearance; all other altitudes are open, and a path may go from
a column to a neighbour, and on from there, at any altitude that is open in both. If the destination is not reached, no
safe path exists. Other slopes, turns, zones and margins are ignored: they could only close more.
"""

import math

import numpy as np

from aircraft.path_limits import true_airspeed
from planner.evaluation.problem import ProblemArrays
from world.arrays import Flags, Floats, Ints
from world.frames import polymap
from world.kernels import compiled, inner
from world.wind import mean_wind_speed

# Number of columns along the map's longer side.
COLUMN_COUNT = 500
# Smallest side of a column, m.
MIN_SIDE_M = 10.0
# Maximum number of closed altitude ranges of a column; further ranges stay open.
MAX_ALTITUDE_RANGES = 6
# Added to the altitude of the highest level flight, m; it exceeds the error of the interpolation.
LEVEL_FLIGHT_ROUNDING_M = 1e-6


def column_side(data: ProblemArrays) -> float:
    """Return the side of the columns, m.

    A closed area narrower than about this length may be treated as open.
    """
    return max(MIN_SIDE_M, max(data.east - data.west, data.north - data.south) / COLUMN_COUNT)


def is_closed(data: ProblemArrays, missiles: Flags | None = None, margin: float = 0.0) -> bool:
    """Return True if it is proven that ground, ceiling and missiles together block every path.

    missiles: (m,) True for each of `data.threats` to consider; None for all.
    margin: required distance from the missiles' spheres, m.

    A path stays above the clearance, below the ceiling and outside the missiles' spheres.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario, with_threats
    >>> scenario = load_scenario("hard-07")
    >>> threat = {"east_m": 5000.0, "north_m": 5000.0, "kill_radius_m": 6000.0}
    >>> guarded = with_threats(scenario, [threat], "threats")
    >>> [is_closed(make_problem(one, load_uav(one).limits).certified) for one in (scenario, guarded)]
    [False, True]
    """
    is_considered = np.ones(len(data.threats), dtype=np.bool_) if missiles is None else missiles
    ceiling = min(data.ceiling, highest_level_flight(data), highest_waypoint(data))
    if max(data.start[2], data.destination[2]) > ceiling:
        return True
    return bool(_is_proven_closed(data._replace(ceiling=ceiling), is_considered, column_side(data), margin))


def highest_waypoint(data: ProblemArrays) -> float:
    """Return the highest altitude that a waypoint may have, m.

    It is inf if `highest_level_flight` finds no limit.

    The leg to the highest waypoint is level or climbs, unless this waypoint is the start. Therefore the highest
    waypoint is not above the start, or the aircraft can climb there at least as steeply as the margin to the slope
    limits, `angle_margin`. Over the ground the climb is steepest in a headwind w. At the airspeed V, its slope equals
    the margin m if the climb angle through the air is m - asin(w / V sin m).
    """
    headwind_ratio = min(1.0, _max_wind_speed(data) / true_airspeed(data.aircraft, data.floor))
    air_angle = data.angle_margin - math.asin(headwind_ratio * math.sin(data.angle_margin))
    return max(float(data.start[2]), highest_level_flight(data, air_angle))


def highest_level_flight(data: ProblemArrays, min_climb: float = 0.0) -> float:
    """Return the highest altitude at which the aircraft can fly level, m; no waypoint may be above it.

    min_climb: climb angle through the air that must be possible, rad; 0 for level flight.

    The result is inf if there is no such limit below the ceiling, if a slope limit is stated as a number, or if the
    wind is too strong to hold a course; it is -inf if the aircraft cannot fly level at any altitude.
    """
    table = data.aircraft
    if not (math.isnan(data.max_climb) and math.isnan(data.max_dive) and table.equivalent > 0.0):
        return math.inf
    # The table entries that affect slopes below the ceiling.
    count = int(np.searchsorted(table.amsl, data.ceiling)) + 1
    climb, amsl = table.climb[:count] - min_climb, table.amsl[:count]
    level_rows = np.flatnonzero(climb >= 0.0)
    last_row = int(level_rows[-1]) if level_rows.size else -1
    if last_row == climb.size - 1:
        return math.inf
    max_altitude = -math.inf
    if last_row >= 0:
        fraction = climb[last_row] / (climb[last_row] - climb[last_row + 1])
        max_altitude = (
            float(amsl[last_row] + fraction * (amsl[last_row + 1] - amsl[last_row])) + LEVEL_FLIGHT_ROUNDING_M
        )
    max_slope = np.abs(np.concatenate([climb, table.descent[:count]])).max()
    min_speed = true_airspeed(table, max(max_altitude, data.floor)) * math.cos(max_slope)
    max_wind = _max_wind_speed(data)
    # The comparison is False for an unknown slope (NaN).
    return max_altitude if max_wind < min_speed else math.inf


def _max_wind_speed(data: ProblemArrays) -> float:
    """Return the maximum wind speed between floor and ceiling, m/s."""
    table = data.aircraft
    wind = table.wind_speed, table.wind_gradient, table.wind_reference_amsl
    return max(mean_wind_speed(*wind, data.floor), mean_wind_speed(*wind, data.ceiling))


def blocking_missiles(data: ProblemArrays) -> list[int] | None:
    """Return the indices of a minimal set of missiles that, with ground and ceiling, block every path.

    Missiles are left out in groups as long as the others still block every path, so that each missile of the set is
    needed. The list is empty if ground and ceiling alone block every path. Returns None if it is not proven that every
    path is blocked.
    """
    if not is_closed(data):
        return None
    remaining, group_size = np.flatnonzero(data.threats["kill_radius"] > 0.0), len(data.threats)
    while group_size > 0:
        group_start = 0
        while group_start < len(remaining):
            reduced = np.delete(remaining, slice(group_start, group_start + group_size))
            flags = np.zeros(len(data.threats), dtype=np.bool_)
            flags[reduced] = True
            if is_closed(data, flags):
                remaining = reduced
            else:
                group_start += group_size
        group_size //= 2
    return [int(k) for k in remaining]


@compiled
def _is_proven_closed(data: ProblemArrays, missiles: Flags, column_size: float, margin: float) -> bool:
    """Return True if it is proven that ground, ceiling and the selected missiles block every path.

    missiles: (m,) True for each of `data.threats` to consider.
    column_size: side of the square columns, m.
    margin: required distance from the missiles' spheres, m.

    A list of closed altitude ranges is built for each column: first the ground, then each sphere. Then a search over
    the open ranges of neighbouring columns looks for the destination.
    """
    columns = max(1, math.ceil((data.east - data.west) / column_size))
    rows = max(1, math.ceil((data.north - data.south) / column_size))
    # Closed altitude ranges of each column, ascending and disjoint: lower ends, upper ends, and their number.
    range_bottoms = np.empty((columns, rows, MAX_ALTITUDE_RANGES))
    range_tops = np.empty((columns, rows, MAX_ALTITUDE_RANGES))
    range_counts = np.zeros((columns, rows), dtype=np.int64)
    for i in range(columns):
        for j in range(rows):
            closed_below = _lowest_ground(data, i, j, column_size) + data.clearance
            range_bottoms[i, j, 0] = -math.inf
            range_tops[i, j, 0] = max(closed_below, data.floor)
            range_counts[i, j] = 1
    for k in range(missiles.size):
        if missiles[k] and data.threats[k].kill_radius > 0.0:
            missile = data.threats[k]
            position = missile.east - data.west, missile.north - data.south
            _close_altitudes_in_sphere(
                position[0],
                position[1],
                missile.up,
                missile.kill_radius + margin,
                column_size,
                range_bottoms,
                range_tops,
                range_counts,
            )
    return not _reaches_destination(data, column_size, range_bottoms, range_tops, range_counts)


@inner
def _lowest_ground(data: ProblemArrays, i: int, j: int, column_size: float) -> float:
    """Return the lowest ground among the pixels below a column and next to it, m.

    The result is -inf if a pixel has no data or the column is not completely above the raster.

    i, j: indices of the column towards east and north.
    column_size: side of a column, m.
    """
    first_column = math.inf
    first_row = math.inf
    last_column = -math.inf
    last_row = -math.inf
    for corner in range(4):
        east, north = data.west + (i + corner % 2) * column_size, data.south + (j + corner // 2) * column_size
        column, row = polymap(data.to_pixel, east, north)
        first_column, last_column = min(first_column, column), max(last_column, column)
        first_row, last_row = min(first_row, row), max(last_row, row)
    rows, columns = data.heights.shape
    if min(first_column, first_row) < 0.0 or last_column > columns - 1 or last_row > rows - 1:
        return -math.inf
    min_ground = math.inf
    for row in range(int(first_row), min(rows - 1, int(last_row) + 1) + 1):
        for column in range(int(first_column), min(columns - 1, int(last_column) + 1) + 1):
            height = data.heights[row, column]
            if math.isnan(height):
                return -math.inf
            min_ground = min(min_ground, height)
    return min_ground


@inner
def _close_altitudes_in_sphere(
    east: float,
    north: float,
    altitude: float,
    radius: float,
    column_size: float,
    range_bottoms: Floats,
    range_tops: Floats,
    range_counts: Ints,
) -> None:
    """Close the altitudes of each column at which the whole column is inside a sphere.

    east, north, altitude, radius: sphere, m, with its centre relative to the map's south-western corner.
    column_size: side of a column, m.
    range_bottoms, range_tops, range_counts: closed altitude ranges of all columns, which are changed.
    """
    columns, rows = range_counts.shape
    first_column = max(0, math.floor((east - radius) / column_size))
    last_column = min(columns - 1, math.floor((east + radius) / column_size))
    first_row = max(0, math.floor((north - radius) / column_size))
    last_row = min(rows - 1, math.floor((north + radius) / column_size))
    for i in range(first_column, last_column + 1):
        dx = abs((i + 0.5) * column_size - east) + 0.5 * column_size
        for j in range(first_row, last_row + 1):
            dy = abs((j + 0.5) * column_size - north) + 0.5 * column_size
            half_height2 = radius * radius - dx * dx - dy * dy
            if half_height2 > 0.0:
                half_height = math.sqrt(half_height2)
                _close_range(
                    range_bottoms[i, j],
                    range_tops[i, j],
                    range_counts[i],
                    j,
                    altitude - half_height,
                    altitude + half_height,
                )


@inner
def _close_range(
    range_bottoms: Floats, range_tops: Floats, range_counts: Ints, j: int, bottom: float, top: float
) -> None:
    """Add the altitudes from `bottom` to `top` (m) to the closed ranges of column j in a row of columns.

    The range is merged with those that it overlaps. If the column already has the maximum number of closed ranges, the
    range stays open.

    range_bottoms, range_tops: (c,) closed ranges of the column, m, in ascending order.
    range_counts: number of closed ranges of each column in the row.
    """
    kept_count = 0
    for k in range(range_counts[j]):
        if range_bottoms[k] <= top and bottom <= range_tops[k]:
            bottom, top = min(bottom, range_bottoms[k]), max(top, range_tops[k])
        else:
            range_bottoms[kept_count], range_tops[kept_count] = range_bottoms[k], range_tops[k]
            kept_count += 1
    if kept_count == range_bottoms.size:
        range_counts[j] = kept_count
        return
    position = kept_count
    while position > 0 and range_bottoms[position - 1] > bottom:
        range_bottoms[position], range_tops[position] = range_bottoms[position - 1], range_tops[position - 1]
        position -= 1
    range_bottoms[position], range_tops[position] = bottom, top
    range_counts[j] = kept_count + 1


@inner
def _reaches_destination(
    data: ProblemArrays, column_size: float, range_bottoms: Floats, range_tops: Floats, range_counts: Ints
) -> bool:
    """Return True if open altitudes of neighbouring columns connect start and destination.

    column_size: side of a column, m.
    range_bottoms, range_tops: (columns, rows, ranges) bottom and top of the closed ranges of each column, m AMSL.
    range_counts: (columns, rows) number of closed ranges of each column.

    Each open range of a column lies above the closed range with the same index.
    """
    columns, rows, range_limit = range_bottoms.shape
    ends = np.zeros(2, dtype=np.int64)
    for k in range(2):
        point = data.start if k == 0 else data.destination
        i = min(columns - 1, max(0, math.floor((point[0] - data.west) / column_size)))
        j = min(rows - 1, max(0, math.floor((point[1] - data.south) / column_size)))
        # A fixed end may be below the clearance; then it is in the lowest open range.
        range_index = 0
        while range_index + 1 < range_counts[i, j] and range_bottoms[i, j, range_index + 1] < point[2]:
            range_index += 1
        ends[k] = (i * rows + j) * range_limit + range_index
    # Depth-first search over open ranges; ranges of neighbouring columns are connected if they overlap.
    is_visited = np.zeros(range_bottoms.size, dtype=np.bool_)
    stack = np.empty(range_bottoms.size, dtype=np.int64)
    stack[0], stack_size = ends[0], 1
    is_visited[ends[0]] = True
    while stack_size > 0:
        stack_size -= 1
        state = stack[stack_size]
        if state == ends[1]:
            return True
        range_index, j, i = state % range_limit, state // range_limit % rows, state // (range_limit * rows)
        bottom = range_tops[i, j, range_index]
        top = range_bottoms[i, j, range_index + 1] if range_index + 1 < range_counts[i, j] else data.ceiling
        for step in range(4):
            next_i, next_j = i + (step == 0) - (step == 1), j + (step == 2) - (step == 3)
            if next_i < 0 or next_j < 0 or next_i >= columns or next_j >= rows:
                continue
            for next_index in range(range_counts[next_i, next_j]):
                next_bottom = range_tops[next_i, next_j, next_index]
                next_top = (
                    range_bottoms[next_i, next_j, next_index + 1]
                    if next_index + 1 < range_counts[next_i, next_j]
                    else data.ceiling
                )
                next_state = (next_i * rows + next_j) * range_limit + next_index
                if max(bottom, next_bottom) <= min(top, next_top) and not is_visited[next_state]:
                    is_visited[next_state] = True
                    stack[stack_size] = next_state
                    stack_size += 1
    return False
