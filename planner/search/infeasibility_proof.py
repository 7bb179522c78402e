"""Prove that no path exists, because ground, ceiling and missiles block every path on the map.

In thin air an aircraft may not be able to hold its altitude at its cruise speed; no leg may begin or end there, so that
the lowest such altitude acts as a ceiling.

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
COLUMNS = 500
# Smallest side of a column, m.
MIN_SIDE = 10.0
# Maximum number of closed altitude ranges of a column; further ranges stay open.
STRETCHES = 6
# Added to the altitude of the highest level flight, m: more than the error of its interpolation.
ROUNDING = 1e-6


def column_side(data: ProblemArrays) -> float:
    """Return the side of the columns, m; closed areas narrower than about this may be treated as open."""
    return max(MIN_SIDE, max(data.east - data.west, data.north - data.south) / COLUMNS)


def is_closed(data: ProblemArrays, missiles: Flags | None = None, margin: float = 0.0) -> bool:
    """Return True if no path stays above the clearance, below the ceiling and outside all missiles.

    missiles: (m,) True for the `data.threats` that are considered; None for all. margin: distance from their spheres,
    m. Return False if nothing is proven.

    >>> from planfly.workflow.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario, with_threats
    >>> scenario = load_scenario("hard-07")
    >>> guarded = with_threats(scenario, [(5000.0, 5000.0, 6000.0, 0.0)], "threats")
    >>> [is_closed(make_problem(one, load_airframe(one).limits).certified) for one in (scenario, guarded)]
    [False, True]
    """
    used, top = np.ones(len(data.threats), dtype=np.bool_) if missiles is None else missiles, highest_level_flight(data)
    if max(data.start[2], data.destination[2]) > top:
        return True
    return bool(_is_closed(data._replace(ceiling=min(data.ceiling, top)), used, column_side(data), margin))


def highest_level_flight(data: ProblemArrays) -> float:
    """Return the altitude above which the aircraft cannot hold its altitude, so that no waypoint may exceed it, m.

    Return inf without such an altitude, and in winds in which a course cannot be held. As in
    `planner.evaluation.leg_constraints`, if both slope limits are the aircraft's own.
    """
    table = data.aircraft
    if not (math.isnan(data.max_climb) and math.isnan(data.max_dive) and table.equivalent > 0.0):
        return math.inf
    # The table entries that affect slopes below the ceiling.
    count = int(np.searchsorted(table.amsl, data.ceiling)) + 1
    climb, amsl = table.climb[:count], table.amsl[:count]
    level = np.flatnonzero(climb >= 0.0)
    last = int(level[-1]) if level.size else -1
    if last == climb.size - 1:
        return math.inf
    top = -math.inf
    if last >= 0:
        share = climb[last] / (climb[last] - climb[last + 1])
        top = float(amsl[last] + share * (amsl[last + 1] - amsl[last])) + ROUNDING
    steepest = np.abs(np.concatenate([climb, table.descent[:count]])).max()
    slowest = true_airspeed(table, max(top, data.floor)) * math.cos(steepest)
    wind = table.wind_speed, table.wind_gradient, table.wind_reference_amsl
    strongest = max(mean_wind_speed(*wind, data.floor), mean_wind_speed(*wind, data.ceiling))
    # The comparison is False for an unknown slope (NaN).
    return top if strongest < slowest else math.inf


def closing_missiles(data: ProblemArrays) -> list[int] | None:
    """Return the indices of a minimal set of missiles that block every path together with ground and ceiling.

    Return None if `is_closed` proves nothing, and no indices if ground and ceiling suffice.
    """
    if not is_closed(data):
        return None
    kept, size = np.flatnonzero(data.threats["kill_radius"] > 0.0), len(data.threats)
    while size > 0:
        first = 0
        while first < len(kept):
            without = np.delete(kept, slice(first, first + size))
            if is_closed(data, _index_mask(without, len(data.threats))):
                kept = without
            else:
                first += size
        size //= 2
    return [int(k) for k in kept]


def _index_mask(indices: Ints, count: int) -> Flags:
    flags = np.zeros(count, dtype=np.bool_)
    flags[indices] = True
    return flags


@compiled
def _is_closed(data: ProblemArrays, missiles: Flags, side: float, margin: float) -> bool:
    """Implement `is_closed` for columns of the given side, m."""
    columns, rows = (
        max(1, math.ceil((data.east - data.west) / side)),
        max(1, math.ceil((data.north - data.south) / side)),
    )
    # Closed altitude ranges of each column, ascending and disjoint: lower ends, upper ends, and their number.
    low, high = np.empty((columns, rows, STRETCHES)), np.empty((columns, rows, STRETCHES))
    count = np.zeros((columns, rows), dtype=np.int64)
    for i in range(columns):
        for j in range(rows):
            top = _lowest_ground(data, i, j, side) + data.clearance
            low[i, j, 0], high[i, j, 0], count[i, j] = -math.inf, max(top, data.floor), 1
    for k in range(missiles.size):
        if missiles[k] and data.threats[k].kill_radius > 0.0:
            missile = data.threats[k]
            place = missile.east - data.west, missile.north - data.south
            _close_sphere(place[0], place[1], missile.up, missile.kill_radius + margin, side, low, high, count)
    return not _reaches_destination(data, side, low, high, count)


@inner
def _lowest_ground(data: ProblemArrays, i: int, j: int, side: float) -> float:
    """Return the lowest pixel under a column and next to it, m; -inf if any is missing."""
    first_column, first_row, last_column, last_row = math.inf, math.inf, -math.inf, -math.inf
    for corner in range(4):
        east, north = data.west + (i + corner % 2) * side, data.south + (j + corner // 2) * side
        column, row = polymap(data.to_pixel, east, north)
        first_column, last_column = min(first_column, column), max(last_column, column)
        first_row, last_row = min(first_row, row), max(last_row, row)
    rows, columns = data.heights.shape
    if min(first_column, first_row) < 0.0 or last_column > columns - 1 or last_row > rows - 1:
        return -math.inf
    lowest = math.inf
    for row in range(int(first_row), min(rows - 1, int(last_row) + 1) + 1):
        for column in range(int(first_column), min(columns - 1, int(last_column) + 1) + 1):
            height = data.heights[row, column]
            if math.isnan(height):
                return -math.inf
            lowest = min(lowest, height)
    return lowest


@inner
def _close_sphere(
    east: float, north: float, up: float, radius: float, side: float, low: Floats, high: Floats, count: Ints
) -> None:
    """Close the altitudes at which a whole column is inside a sphere.

    east, north: distances from the map's corner, m.
    """
    columns, rows = count.shape
    first, last = max(0, math.floor((east - radius) / side)), min(columns - 1, math.floor((east + radius) / side))
    bottom, top = max(0, math.floor((north - radius) / side)), min(rows - 1, math.floor((north + radius) / side))
    for i in range(first, last + 1):
        dx = abs((i + 0.5) * side - east) + 0.5 * side
        for j in range(bottom, top + 1):
            dy = abs((j + 0.5) * side - north) + 0.5 * side
            left = radius * radius - dx * dx - dy * dy
            if left > 0.0:
                half = math.sqrt(left)
                _close_range(low[i, j], high[i, j], count[i], j, up - half, up + half)


@inner
def _close_range(low: Floats, high: Floats, count: Ints, j: int, begin: float, end: float) -> None:
    """Add an altitude range to the closed ranges of column j of a row.

    A range beyond the maximum number stays open.
    """
    kept = 0
    for k in range(count[j]):
        if low[k] <= end and begin <= high[k]:
            begin, end = min(begin, low[k]), max(end, high[k])
        else:
            low[kept], high[kept] = low[k], high[k]
            kept += 1
    if kept == low.size:
        count[j] = kept
        return
    at = kept
    while at > 0 and low[at - 1] > begin:
        low[at], high[at] = low[at - 1], high[at - 1]
        at -= 1
    low[at], high[at] = begin, end
    count[j] = kept + 1


@inner
def _reaches_destination(data: ProblemArrays, side: float, low: Floats, high: Floats, count: Ints) -> bool:
    """Return True if the destination can be reached from the start through open altitudes of adjacent columns.

    Open range s of a column is above its closed range s.
    """
    columns, rows, stretches = low.shape
    ends = np.zeros(2, dtype=np.int64)
    for k in range(2):
        point = data.start if k == 0 else data.destination
        i = min(columns - 1, max(0, math.floor((point[0] - data.west) / side)))
        j = min(rows - 1, max(0, math.floor((point[1] - data.south) / side)))
        # A fixed end may be below the clearance; then it is in the lowest open range.
        s = 0
        while s + 1 < count[i, j] and low[i, j, s + 1] < point[2]:
            s += 1
        ends[k] = (i * rows + j) * stretches + s
    seen = np.zeros(low.size, dtype=np.bool_)
    stack = np.empty(low.size, dtype=np.int64)
    stack[0], size = ends[0], 1
    seen[ends[0]] = True
    while size > 0:
        size -= 1
        here = stack[size]
        if here == ends[1]:
            return True
        s, j, i = here % stretches, here // stretches % rows, here // (stretches * rows)
        bottom = high[i, j, s]
        top = low[i, j, s + 1] if s + 1 < count[i, j] else data.ceiling
        for step in range(4):
            x, y = i + (step == 0) - (step == 1), j + (step == 2) - (step == 3)
            if x < 0 or y < 0 or x >= columns or y >= rows:
                continue
            for t in range(count[x, y]):
                begin = high[x, y, t]
                end = low[x, y, t + 1] if t + 1 < count[x, y] else data.ceiling
                there = (x * rows + y) * stretches + t
                if max(bottom, begin) <= min(top, end) and not seen[there]:
                    seen[there] = True
                    stack[size] = there
                    size += 1
    return False
