"""The paper's four constraints and four objectives, compiled, for many paths at once.

`paper_scores` looks at the paper's six points a leg (eq. 5-11).  `planner.evaluation.graded_scores` looks along the
whole path and says how far a constraint is missed instead of how often; both share what
`planner.evaluation.leg_constraints` asks of waypoints and legs.

Paths are judged in blocks, side by side: each step is a short loop over the paths of a block, on rows of numbers, that
a compiler turns into vector instructions.  Every path's sums are in an order of its own, from its start to its
destination, so that a score depends neither on the block nor on the width of the machine's vectors.
"""

import math

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.clearance_reserve import required_clearance
from planner.evaluation.leg_constraints import Gauge, constraints, make_gauge, measure_corners, measure_legs
from planner.evaluation.problem_arrays import SPHERE, Rules
from planner.evaluation.threat_grid import Cells, Short
from world.frames import PolyMapRecord
from world.geometry import CLOSEST
from world.kernels import compiled, compiled_views
from world.terrain import EDGE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = NDArray[np.float32]

# Dividing points a leg (eq. 6).
POINTS = 6
# Paths side by side: as many as leave a block's scratch in the fastest cache.
BLOCK = 128

# Where rows of numbers, one a path, begin in a block's scratch.  Both ends of a leg, the step between them, and a
# point of it: each east, north, up (m), column and row (pixels).
HERE, THERE, STEP, POINT = 0, 5 * BLOCK, 10 * BLOCK, 15 * BLOCK
EAST, NORTH, UP, COL, ROW = 0, BLOCK, 2 * BLOCK, 3 * BLOCK, 4 * BLOCK
# A leg's run, and the east, north and run of the one before it, m.
RUN, EAST_BEFORE, NORTH_BEFORE, RUN_BEFORE = 20 * BLOCK, 21 * BLOCK, 22 * BLOCK, 23 * BLOCK
# What is summed along a path.
BELOW, HEIGHT, KILL, SEEN = 24 * BLOCK, 25 * BLOCK, 26 * BLOCK, 27 * BLOCK
TURNS, SLOPES, OUTSIDE, LENGTH = 28 * BLOCK, 29 * BLOCK, 30 * BLOCK, 31 * BLOCK
# The ground at a point and the clearance wanted there, m; the place within a pixel; and scratch.
GROUND, NEED, U, V, A, B, C = (k * BLOCK for k in range(32, 39))
# Heights of the pixels about a point.
TOP_LEFT, TOP_RIGHT, LOW_LEFT, LOW_RIGHT = (k * BLOCK for k in range(4))
# Whole numbers: a pixel or a cell, where its units begin and how many there are, and the paths in question.
AT, FIRST, NUMBER, ASKED = (k * BLOCK for k in range(4))


@compiled_views
def _load(to_pixel: PolyMapRecord, paths: Floats, begin: int, i: int, size: int, w: Floats) -> None:  # pragma: no cover
    """Fill in waypoint i of each path, and take it to the raster: `polymap`, for all of them at once."""
    for b in range(size):
        w[THERE + EAST + b] = paths[begin + b, i, 0]
        w[THERE + NORTH + b] = paths[begin + b, i, 1]
        w[THERE + UP + b] = paths[begin + b, i, 2]
    middle_x, middle_y, half_x, half_y = to_pixel.centre_x, to_pixel.centre_y, to_pixel.half_x, to_pixel.half_y
    for b in range(size):
        w[A + b] = (w[THERE + EAST + b] - middle_x) / half_x
        w[B + b] = (w[THERE + NORTH + b] - middle_y) / half_y
    for component in range(2):
        out = THERE + (COL if component == 0 else ROW)
        coefficients = to_pixel.u if component == 0 else to_pixel.v
        for b in range(size):
            w[out + b] = 0.0
        for k in range(to_pixel.size - 1, -1, -1):
            for b in range(size):
                w[C + b] = 0.0
            for j in range(to_pixel.size - 1 - k, -1, -1):
                coefficient = coefficients[k, j]
                for b in range(size):
                    w[C + b] = w[C + b] * w[B + b] + coefficient
            for b in range(size):
                w[out + b] = w[out + b] * w[A + b] + w[C + b]


@compiled_views
def _ground(heights: Heights, size: int, w: Floats, corners: Heights, t: Ints) -> None:  # pragma: no cover - compiled
    """Fill in the ground's height at the points, as `pixel_height` gives it."""
    rows, cols = heights.shape
    flat = heights.reshape(heights.size)
    last_col, last_row = cols - 2.0, rows - 2.0
    for b in range(size):
        # What is outside, or no number, reads some pixel, and is put right at the end.
        col, row = w[POINT + COL + b], w[POINT + ROW + b]
        c, r = col if col > 0.0 else 0.0, row if row > 0.0 else 0.0
        j, i = int(c if c < last_col else last_col), int(r if r < last_row else last_row)
        t[AT + b] = i * cols + j
        w[U + b] = col - j
        w[V + b] = row - i
    one, below = np.uintp(1), np.uintp(cols)
    for b in range(size):
        k = np.uintp(t[AT + b])
        corners[TOP_LEFT + b] = flat[k]
        corners[TOP_RIGHT + b] = flat[k + one]
        corners[LOW_LEFT + b] = flat[k + below]
        corners[LOW_RIGHT + b] = flat[k + below + one]
    right, bottom = cols - 1 + EDGE, rows - 1 + EDGE
    for b in range(size):
        u, v = w[U + b], w[V + b]
        top = corners[TOP_LEFT + b] * (1.0 - u) + corners[TOP_RIGHT + b] * u
        low = corners[LOW_LEFT + b] * (1.0 - u) + corners[LOW_RIGHT + b] * u
        w[GROUND + b] = top * (1.0 - v) + low * v
    for b in range(size):
        col, row = w[POINT + COL + b], w[POINT + ROW + b]
        inside = (col >= -EDGE) & (col <= right) & (row >= -EDGE) & (row <= bottom)
        w[GROUND + b] = w[GROUND + b] if inside else math.nan


@compiled_views
def _add_terrain(clear: Floats, size: int, inner: bool, w: Floats) -> None:  # pragma: no cover - compiled
    """Add what the ground at the points says of terrain and height (eq. 5, 11)."""
    for b in range(size):
        w[NEED + b] = clear[0] + clear[1]
    if clear[10] == 0.0:
        for b in range(size):
            w[NEED + b] = required_clearance(clear, w[POINT + EAST + b], w[POINT + NORTH + b])
    for b in range(size):
        # Written so that NaN is below.
        w[BELOW + b] += 0.0 if w[POINT + UP + b] > w[GROUND + b] + w[NEED + b] else 1.0
    if inner:
        for b in range(size):
            above = w[POINT + UP + b] - w[GROUND + b]
            w[HEIGHT + b] += above if above > 0.0 else 0.0


@compiled_views
def _find_units(near: Cells, size: int, w: Floats, t: Ints) -> None:  # pragma: no cover - compiled
    """Fill in where the list of the units near each point begins, and its length."""
    # These cells are as tall as the world.
    west, south, per_metre, cols, rows = near.west, near.south, 1.0 / near.side, near.cols, near.rows
    outside = cols * rows
    for b in range(size):
        col, row = (w[POINT + EAST + b] - west) * per_metre, (w[POINT + NORTH + b] - south) * per_metre
        inside = (col >= 0.0) & (row >= 0.0) & (col < cols) & (row < rows)
        at = int(row if inside else 0.0) * cols + int(col if inside else 0.0)
        t[AT + b] = at if inside else outside
    table = near.table
    for b in range(size):
        c, z = np.uintp(t[AT + b]), w[POINT + UP + b]
        begin, entries, low, high = table[c, 0], table[c, 1], table[c, 2], table[c, 3]
        t[FIRST + b] = begin
        t[NUMBER + b] = entries if (z >= low) & (z <= high) else 0


@compiled_views
def _add_exposures(spheres: Floats, units: Short, size: int, w: Floats, t: Ints) -> None:  # pragma: no cover - compiled
    """Add kill and detection exposure of the points to the units that were found near them (eq. 9, 10).

    In rounds: the first unit of each list, then the second, as long as there are any.  Within a round no loop depends
    on what is in a list, which nobody could guess.
    """
    # Unsigned: numba would look whether each index counts from the end.
    east, north, up = np.uintp(POINT + EAST), np.uintp(POINT + NORTH), np.uintp(POINT + UP)
    kill, seen, asked = np.uintp(KILL), np.uintp(SEEN), np.uintp(ASKED)
    one, r2_kill, kill4, r2_seen, seen4 = np.uintp(1), np.uintp(3), np.uintp(4), np.uintp(5), np.uintp(6)
    count = np.uintp(0)
    for b in range(size):
        t[asked + count] = b
        count += one if t[NUMBER + b] > 0 else np.uintp(0)
    turn = 0
    while count > 0:
        left = np.uintp(0)
        for entry in range(count):
            lane = np.uintp(t[asked + np.uintp(entry)])
            k = np.uintp(units[np.uintp(t[np.uintp(FIRST) + lane] + turn)]) * np.uintp(SPHERE)
            dx, dy = w[east + lane] - spheres[k], w[north + lane] - spheres[k + one]
            dz = w[up + lane] - spheres[k + np.uintp(2)]
            d2 = dx * dx + dy * dy + dz * dz
            closest2 = d2 if d2 > CLOSEST * CLOSEST else CLOSEST * CLOSEST
            share = 1.0 / (closest2 * closest2)
            # By multiplication: whether a radius is passed cannot be guessed, and a wrong guess costs more.
            w[kill + lane] += spheres[k + kill4] * share * (1.0 if d2 <= spheres[k + r2_kill] else 0.0)
            w[seen + lane] += spheres[k + seen4] * share * (1.0 if d2 <= spheres[k + r2_seen] else 0.0)
            t[asked + left] = np.int64(lane)
            left += one if t[np.uintp(NUMBER) + lane] > turn + 1 else np.uintp(0)
        count = left
        turn += 1


@compiled_views
def _add_leg(gauge: Gauge, size: int, first: bool, w: Floats) -> None:  # pragma: no cover - compiled
    """Add a leg's length, and whether its slope and the turn into it are too much (eq. 1-4, 8)."""
    climb, dive, cosine = gauge.climb, gauge.dive, gauge.cos_turn
    for b in range(size):
        dx, dy, dz = w[STEP + EAST + b], w[STEP + NORTH + b], w[STEP + UP + b]
        w[RUN + b] = math.sqrt(dx * dx + dy * dy)
        w[LENGTH + b] += math.sqrt(dx * dx + dy * dy + dz * dz)
    for b in range(size):
        rise, run = w[STEP + UP + b], w[RUN + b]
        w[SLOPES + b] += 1.0 if (rise - climb * run > 0.0) | (-rise - dive * run > 0.0) else 0.0
    if not first:
        for b in range(size):
            # A leg without a course has no turn: both sides are 0.
            dot = w[STEP + EAST + b] * w[EAST_BEFORE + b] + w[STEP + NORTH + b] * w[NORTH_BEFORE + b]
            w[TURNS + b] += 0.0 if dot >= cosine * (w[RUN + b] * w[RUN_BEFORE + b]) else 1.0
    for b in range(size):
        w[EAST_BEFORE + b] = w[STEP + EAST + b]
        w[NORTH_BEFORE + b] = w[STEP + NORTH + b]
        w[RUN_BEFORE + b] = w[RUN + b]


@compiled_views
def _add_outside(rules: Rules, size: int, w: Floats) -> None:  # pragma: no cover - compiled
    """Add whether a waypoint is off the map, below the floor or above the ceiling (eq. 7)."""
    west, east, south, north = rules.bounds[0, 0], rules.bounds[0, 1], rules.bounds[1, 0], rules.bounds[1, 1]
    floor, ceiling = rules.floor, rules.ceiling
    for b in range(size):
        x, y, z = w[THERE + EAST + b], w[THERE + NORTH + b], w[THERE + UP + b]
        out = (x < west) | (x > east) | (y < south) | (y > north) | (z < floor) | (z > ceiling)
        w[OUTSIDE + b] += 1.0 if out else 0.0


@compiled
def _judge_block(
    rules: Rules, gauge: Gauge, paths: Floats, begin: int, size: int, w: Floats, corners: Heights, t: Ints
) -> None:  # pragma: no cover - compiled
    """Fill the sums of paths begin : begin + size.

    A waypoint is taken to the raster once; between waypoints a leg counts as straight in pixels.
    """
    spheres = rules.spheres.reshape(rules.spheres.size)
    last = paths.shape[1] - 1
    w[BELOW : LENGTH + BLOCK] = 0.0
    _load(rules.to_pixel, paths, begin, 0, size, w)
    _add_outside(rules, size, w)
    for i in range(last):
        w[HERE:THERE] = w[THERE:STEP]
        _load(rules.to_pixel, paths, begin, i + 1, size, w)
        _add_outside(rules, size, w)
        for row in (EAST, NORTH, UP, COL, ROW):
            for b in range(size):
                w[STEP + row + b] = w[THERE + row + b] - w[HERE + row + b]
        _add_leg(gauge, size, i == 0, w)
        # A departure: eq. 6 never reaches the destination, which is the seventh point of the last leg.
        for j in range(POINTS + (i == last - 1)):
            share = j * (1.0 / POINTS)
            for row in (EAST, NORTH, UP, COL, ROW):
                for b in range(size):
                    w[POINT + row + b] = w[HERE + row + b] + share * w[STEP + row + b]
            _ground(rules.heights, size, w, corners, t)
            _add_terrain(gauge.clear, size, j < POINTS, w)
            _find_units(rules.near, size, w, t)
            _add_exposures(spheres, rules.near.units, size, w, t)


@compiled_views
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
    gauge = make_gauge(rules)
    w, corners, t = np.empty(39 * BLOCK), np.empty(4 * BLOCK, dtype=np.float32), np.empty(4 * BLOCK, dtype=np.int64)
    by_numbers = _by_numbers(rules, gauge)
    legs, turns = np.empty((count - 1, 4)), np.zeros((count, 2))
    for begin in range(0, number, BLOCK):
        size = min(BLOCK, number - begin)
        _judge_block(rules, gauge, paths, begin, size, w, corners, t)
        for b in range(size):
            n = begin + b
            if by_numbers:
                missed[n, 0], missed[n, 1], missed[n, 3] = w[TURNS + b], w[SLOPES + b], w[OUTSIDE + b]
            else:
                measure_legs(paths, n, legs)
                if rules.room:
                    measure_corners(rules, gauge, paths, n, legs, turns)
                constraints(rules, gauge, paths, n, legs, turns, False, missed)
            missed[n, 2] = w[BELOW + b]
            objectives[n, 0] = w[LENGTH + b] / gauge.straight
            objectives[n, 1], objectives[n, 2] = w[KILL + b], w[SEEN + b]
            objectives[n, 3] = w[HEIGHT + b] / POINTS
    return missed.astype(np.int64), objectives
