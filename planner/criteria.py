"""The paper's four constraints and four objectives, compiled, for many paths at once.

`paper_scores` looks at the paper's six points a leg (eq. 5-11).  `planner.graded` looks along the whole path and
says how far a constraint is missed instead of how often; both share what `planner.legs` asks of waypoints and legs.

Paths are judged in blocks, side by side: each step is a short loop over the paths of a block, on rows of numbers, that
a compiler turns into vector instructions.  Every path's sums are in an order of its own, from its start to its
destination, so that a score depends neither on the block nor on the width of the machine's vectors.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.cells import Cells, Short
from planner.legs import Gauge, constraints, make_gauge, measure_corners, measure_legs, required_clearance
from planner.rules import SPHERE, Rules
from world.geometry import CLOSEST
from world.terrain import EDGE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = NDArray[np.float32]

# Dividing points a leg (eq. 6).
POINTS = 6
# Paths side by side: as many as leave a block's scratch in the fastest cache.
BLOCK = 64
# Rows of a place: map and height, m; then pixel coordinates.
EAST, NORTH, UP, COL, ROW = 0, 1, 2, 3, 4
# Rows of sums.
BELOW, HEIGHT, KILL, SEEN, TURNS, SLOPES, OUTSIDE, LENGTH = 0, 1, 2, 3, 4, 5, 6, 7


class Lanes(NamedTuple):
    """Scratch for a block of paths: rows of `BLOCK` numbers, one a path.

    here, there: (5, b) both ends of a leg.  step: (5, b) from one to the other.  point: (5, b) on the leg.
    sums: (8, b).  leg, before: (4, b) a leg's east, north, run and length, and those of the leg before.
    work: (8, b).  corners: (4, b) heights of the ground at the pixels about a point.
    place: (4, b) whole numbers: a pixel's or a cell's, the first unit of it and the number, and the paths in question.
    """

    here: Floats
    there: Floats
    step: Floats
    point: Floats
    sums: Floats
    leg: Floats
    before: Floats
    work: Floats
    corners: Heights
    place: Ints


@compiled
def _make_lanes() -> Lanes:  # pragma: no cover - compiled
    return Lanes(
        np.empty((5, BLOCK)),
        np.empty((5, BLOCK)),
        np.empty((5, BLOCK)),
        np.empty((5, BLOCK)),
        np.empty((8, BLOCK)),
        np.empty((4, BLOCK)),
        np.empty((4, BLOCK)),
        np.empty((8, BLOCK)),
        np.empty((4, BLOCK), dtype=np.float32),
        np.empty((4, BLOCK), dtype=np.int64),
    )


@compiled
def _load(
    packed: Floats, paths: Floats, begin: int, i: int, size: int, there: Floats, work: Floats
) -> None:  # pragma: no cover - compiled
    """Fill in waypoint i of each path, and take it to the raster: `polymap`, for all of them at once."""
    for b in range(size):
        there[0, b] = paths[begin + b, i, 0]
        there[1, b] = paths[begin + b, i, 1]
        there[2, b] = paths[begin + b, i, 2]
    degrees = packed.shape[1]
    for axis in range(2):
        middle, half = packed[0, axis], packed[1, axis]
        for b in range(size):
            work[axis, b] = (there[axis, b] - middle) / half
    a, b_, inner = work[0], work[1], work[2]
    for component in range(2):
        out = there[3 + component]
        for b in range(size):
            out[b] = 0.0
        for k in range(degrees - 1, -1, -1):
            for b in range(size):
                inner[b] = 0.0
            for j in range(degrees - 1 - k, -1, -1):
                coefficient = packed[2 + component * degrees + k, j]
                for b in range(size):
                    inner[b] = inner[b] * b_[b] + coefficient
            for b in range(size):
                out[b] = out[b] * a[b] + inner[b]


@compiled
def _along(here: Floats, step: Floats, share: float, size: int, point: Floats) -> None:  # pragma: no cover - compiled
    for row in range(5):
        for b in range(size):
            point[row, b] = here[row, b] + share * step[row, b]


@compiled
def _ground(
    heights: Heights, point: Floats, size: int, place: Ints, work: Floats, corners: Heights
) -> None:  # pragma: no cover - compiled
    """Fill work[0] with the ground's height at the points, as `pixel_height` gives it."""
    rows, cols = heights.shape
    flat = heights.reshape(heights.size)
    col, row, at, ground, u, v = point[COL], point[ROW], place[0], work[0], work[1], work[2]
    last_col, last_row = cols - 2.0, rows - 2.0
    for b in range(size):
        # What is outside, or no number, reads some pixel, and is put right at the end.
        c = col[b] if col[b] > 0.0 else 0.0
        r = row[b] if row[b] > 0.0 else 0.0
        j, i = int(c if c < last_col else last_col), int(r if r < last_row else last_row)
        at[b] = i * cols + j
        u[b] = col[b] - j
        v[b] = row[b] - i
    one, below = np.uintp(1), np.uintp(cols)
    for b in range(size):
        k = np.uintp(at[b])
        # All four are read before the first is written: what is written could be what is read, for all a compiler knows.
        top_left, top_right, low_left, low_right = flat[k], flat[k + one], flat[k + below], flat[k + below + one]
        corners[0, b], corners[1, b], corners[2, b], corners[3, b] = top_left, top_right, low_left, low_right
    north_west, north_east, south_west, south_east = corners[0], corners[1], corners[2], corners[3]
    for b in range(size):
        top = north_west[b] * (1.0 - u[b]) + north_east[b] * u[b]
        low = south_west[b] * (1.0 - u[b]) + south_east[b] * u[b]
        ground[b] = top * (1.0 - v[b]) + low * v[b]
    right, bottom = cols - 1 + EDGE, rows - 1 + EDGE
    for b in range(size):
        inside = (col[b] >= -EDGE) & (col[b] <= right) & (row[b] >= -EDGE) & (row[b] <= bottom)
        ground[b] = ground[b] if inside else math.nan


@compiled
def _add_terrain(
    clear: Floats, point: Floats, size: int, inner: bool, work: Floats, sums: Floats
) -> None:  # pragma: no cover - compiled
    """Add what work[0], the ground at the points, says of terrain and height (eq. 5, 11)."""
    up, ground, need, below, height = point[UP], work[0], work[1], sums[BELOW], sums[HEIGHT]
    for b in range(size):
        need[b] = clear[0] + clear[1]
    if clear[10] == 0.0:
        for b in range(size):
            need[b] = required_clearance(clear, point[EAST, b], point[NORTH, b])
    for b in range(size):
        # Written so that NaN is below.
        below[b] += 0.0 if up[b] > ground[b] + need[b] else 1.0
    if inner:
        for b in range(size):
            height[b] += up[b] - ground[b] if up[b] > ground[b] else 0.0


@compiled
def _find_units(near: Cells, point: Floats, size: int, place: Ints) -> None:  # pragma: no cover - compiled
    """Fill place[1] and place[2]: where the list of the units near each point begins, and its length."""
    west, south, per_metre, cols, rows = near.west, near.south, 1.0 / near.side, near.cols, near.rows
    east, north, up = point[EAST], point[NORTH], point[UP]
    cell, first, number = place[0], place[1], place[2]
    outside = cols * rows
    for b in range(size):
        col, row = (east[b] - west) * per_metre, (north[b] - south) * per_metre
        inside = (col >= 0.0) & (row >= 0.0) & (col < cols) & (row < rows)
        at = int(row if inside else 0.0) * cols + int(col if inside else 0.0)
        cell[b] = at if inside else outside
    table = near.table
    for b in range(size):
        c, z = np.uintp(cell[b]), up[b]
        begin, entries, low, high = table[c, 0], table[c, 1], table[c, 2], table[c, 3]
        first[b] = begin
        number[b] = entries if (z >= low) & (z <= high) else 0


@compiled
def _add_exposures(
    spheres: Floats, units: Short, point: Floats, size: int, place: Ints, sums: Floats
) -> None:  # pragma: no cover - compiled
    """Add kill and detection exposure of the points to the units that were found near them (eq. 9, 10).

    In rounds: the first unit of each list, then the second, as long as there are any.  Within a round no loop depends
    on what is in a list, which nobody could guess.
    """
    east, north, up, kill, seen = point[EAST], point[NORTH], point[UP], sums[KILL], sums[SEEN]
    first, number, asked = place[1], place[2], place[3]
    count = 0
    for b in range(size):
        asked[np.uintp(count)] = b
        count += 1 if number[b] > 0 else 0
    turn = 0
    while count > 0:
        left = 0
        for entry in range(count):
            b = np.uintp(asked[entry])
            k = np.uintp(units[np.uintp(first[b] + turn)]) * np.uintp(SPHERE)
            dx, dy, dz = east[b] - spheres[k], north[b] - spheres[k + np.uintp(1)], up[b] - spheres[k + np.uintp(2)]
            d2 = dx * dx + dy * dy + dz * dz
            closest2 = d2 if d2 > CLOSEST * CLOSEST else CLOSEST * CLOSEST
            share = 1.0 / (closest2 * closest2)
            # By multiplication: whether a radius is passed cannot be guessed, and a wrong guess costs more.
            kill[b] += spheres[k + np.uintp(4)] * share * (1.0 if d2 <= spheres[k + np.uintp(3)] else 0.0)
            seen[b] += spheres[k + np.uintp(6)] * share * (1.0 if d2 <= spheres[k + np.uintp(5)] else 0.0)
            asked[np.uintp(left)] = np.int64(b)
            left += 1 if number[b] > turn + 1 else 0
        count = left
        turn += 1


@compiled
def _add_leg(
    gauge: Gauge, size: int, first: bool, step: Floats, before: Floats, leg: Floats, sums: Floats
) -> None:  # pragma: no cover - compiled
    """Add a leg's length, and whether its slope and the turn into it are too much (eq. 1-4, 8)."""
    dx, dy, dz, run, length = step[EAST], step[NORTH], step[UP], leg[2], leg[3]
    for b in range(size):
        run[b] = math.sqrt(dx[b] * dx[b] + dy[b] * dy[b])
    for b in range(size):
        length[b] = math.sqrt(dx[b] * dx[b] + dy[b] * dy[b] + dz[b] * dz[b])
    total, slopes, turns = sums[LENGTH], sums[SLOPES], sums[TURNS]
    climb, dive, cosine = gauge.climb, gauge.dive, gauge.cos_turn
    for b in range(size):
        total[b] += length[b]
    for b in range(size):
        slopes[b] += 1.0 if (dz[b] - climb * run[b] > 0.0) | (-dz[b] - dive * run[b] > 0.0) else 0.0
    if not first:
        east, north, run_in = before[0], before[1], before[2]
        for b in range(size):
            # A leg without a course has no turn: both sides are 0.
            dot = dx[b] * east[b] + dy[b] * north[b]
            turns[b] += 0.0 if dot >= cosine * (run[b] * run_in[b]) else 1.0
    for b in range(size):
        before[0, b] = dx[b]
        before[1, b] = dy[b]
        before[2, b] = run[b]


@compiled
def _add_outside(rules: Rules, there: Floats, size: int, outside: Floats) -> None:  # pragma: no cover - compiled
    """Add whether a waypoint is off the map, below the floor or above the ceiling (eq. 7)."""
    west, east, south, north = rules.bounds[0, 0], rules.bounds[0, 1], rules.bounds[1, 0], rules.bounds[1, 1]
    floor, ceiling = rules.floor, rules.ceiling
    x, y, z = there[EAST], there[NORTH], there[UP]
    for b in range(size):
        out = (x[b] < west) | (x[b] > east) | (y[b] < south) | (y[b] > north) | (z[b] < floor) | (z[b] > ceiling)
        outside[b] += 1.0 if out else 0.0


@compiled
def _judge_block(
    rules: Rules, gauge: Gauge, lanes: Lanes, paths: Floats, begin: int, size: int
) -> None:  # pragma: no cover - compiled
    """Fill the sums of paths begin : begin + size.

    A waypoint is taken to the raster once; between waypoints a leg counts as straight in pixels.
    """
    here, there, step, point, sums = lanes.here, lanes.there, lanes.step, lanes.point, lanes.sums
    work, corners, place = lanes.work, lanes.corners, lanes.place
    spheres = rules.spheres.reshape(rules.spheres.size)
    last = paths.shape[1] - 1
    sums[:] = 0.0
    _load(rules.to_pixel, paths, begin, 0, size, there, work)
    _add_outside(rules, there, size, sums[OUTSIDE])
    for i in range(last):
        here[:] = there
        _load(rules.to_pixel, paths, begin, i + 1, size, there, work)
        _add_outside(rules, there, size, sums[OUTSIDE])
        for row in range(5):
            for b in range(size):
                step[row, b] = there[row, b] - here[row, b]
        _add_leg(gauge, size, i == 0, step, lanes.before, lanes.leg, sums)
        # A departure: eq. 6 never reaches the destination, which is the seventh point of the last leg.
        for j in range(POINTS + (i == last - 1)):
            _along(here, step, j * (1.0 / POINTS), size, point)
            _ground(rules.heights, point, size, place, work, corners)
            _add_terrain(gauge.clear, point, size, j < POINTS, work, sums)
            _find_units(rules.near, point, size, place)
            _add_exposures(spheres, rules.near.units, point, size, place, sums)


@compiled
def _by_numbers(rules: Rules, gauge: Gauge) -> bool:  # pragma: no cover - compiled
    """Whether turns and slopes are limited by numbers alone, and the ends have no course."""
    courses = math.isnan(rules.start_course) and math.isnan(rules.destination_course)
    return courses and not rules.room and not gauge.by_aircraft


@compiled
def paper_scores(rules: Rules, paths: Floats) -> tuple[Ints, Floats]:  # pragma: no cover - compiled
    """Judge paths (n, w, 3) on six points a leg and the destination: counts (n, 4), objectives (n, 4) (eq. 1-11)."""
    number, count, _ = paths.shape
    missed = np.zeros((number, 4))
    objectives = np.zeros((number, 4))
    gauge, lanes = make_gauge(rules), _make_lanes()
    by_numbers = _by_numbers(rules, gauge)
    legs, corners = np.empty((count - 1, 4)), np.zeros((count, 2))
    for begin in range(0, number, BLOCK):
        size = min(BLOCK, number - begin)
        _judge_block(rules, gauge, lanes, paths, begin, size)
        sums = lanes.sums
        for b in range(size):
            n = begin + b
            if by_numbers:
                missed[n, 0], missed[n, 1], missed[n, 3] = sums[TURNS, b], sums[SLOPES, b], sums[OUTSIDE, b]
            else:
                measure_legs(paths, n, legs)
                if rules.room:
                    measure_corners(rules, gauge, paths, n, legs, corners)
                constraints(rules, gauge, paths, n, legs, corners, False, missed)
            missed[n, 2] = sums[BELOW, b]
            objectives[n, 0] = sums[LENGTH, b] / gauge.straight
            objectives[n, 1], objectives[n, 2] = sums[KILL, b], sums[SEEN, b]
            objectives[n, 3] = sums[HEIGHT, b] / POINTS
    return missed.astype(np.int64), objectives
