"""The paper's four constraints and four objectives for many paths at once.

Eq. 1-11 of Yang, Tang and Lozano, "Estimation of Distribution Algorithms based Unmanned Aerial Vehicle Path Planner
Using a New Coordinate System", CEC 2014, evaluated at six points per leg. `planner.evaluation.graded_scores` measures
violations along the whole path instead of counting them.

Paths are evaluated in blocks, side by side: each step is a short loop over the paths of a block, which the compiler
turns into vector instructions. The sums of each path run from its start to its destination, so that a score depends
neither on the block nor on the vector width of the machine.
"""

import math

import numpy as np

from planner.evaluation.corners import CORNER, LEG, measure_corners, measure_legs
from planner.evaluation.leg_constraints import (
    BLOCK,
    BLOCK_SCRATCH,
    PrecomputedLimits,
    add_leg_violations,
    clear_sums,
    copy_point,
    divide_legs,
    load_waypoints,
    precompute_limits,
    subtract_points,
)
from planner.evaluation.problem import (
    OBJECTIVES,
    VIOLATIONS,
    ProblemArrays,
    RequiredClearance,
    as_columns,
    clearance_at,
)
from planner.evaluation.threat_index import Short, ThreatCells
from world.arrays import Floats, Heights, Ints
from world.geometry import CLOSEST
from world.kernels import Record, Records, compiled, inlined, inner
from world.terrain import EDGE

# Points per leg (eq. 6).
POINTS = 6


def paper_scores(data: ProblemArrays, paths: Floats) -> tuple[Ints, Floats]:
    """Score paths (n, w, 3) at six points per leg and the destination (eq. 1-11).

    Returns violations (n, 4) by `planner.plan.Violation` and objectives (n, 4) by `planner.plan.Objective`.
    """
    number, count, _ = paths.shape
    violations, objectives = np.zeros(number, dtype=VIOLATIONS), np.zeros(number, dtype=OBJECTIVES)
    scratch = np.zeros(1, dtype=BLOCK_SCRATCH)
    legs, corners = np.zeros(count - 1, dtype=LEG), np.zeros(count, dtype=CORNER)
    _score_paths(data, paths, scratch, legs, corners, violations, objectives)
    return as_columns(violations).astype(np.int64), as_columns(objectives)


@compiled
def _score_paths(
    data: ProblemArrays,
    paths: Floats,
    scratch: Records,
    legs: Records,
    corners: Records,
    violations: Records,
    objectives: Records,
) -> None:
    """Fill `VIOLATIONS` and `OBJECTIVES` records (n,) of paths (n, w, 3).

    scratch: a `BLOCK_SCRATCH` record (1,). legs, corners: scratch records of one path.
    """
    number, block = paths.shape[0], scratch[0]
    limits = precompute_limits(data)
    by_numbers = _are_limits_fixed(data, limits)
    for begin in range(0, number, BLOCK):
        size = min(BLOCK, number - begin)
        _score_block(data, limits, paths, begin, size, block)
        sums = block.sums
        for b in range(size):
            violation, objective = violations[begin + b], objectives[begin + b]
            if by_numbers:
                violation.turn, violation.slope = sums.turns[b], sums.slopes[b]
                violation.bounds = sums.outside[b]
            else:
                path = paths[begin + b]
                measure_legs(path, legs)
                if data.legs_hold_turns:
                    measure_corners(data, limits.wind, path, legs, corners)
                add_leg_violations(data, limits, path, legs, corners, False, violation)
            violation.terrain = sums.below[b]
            objective.length_ratio = sums.length[b] / limits.straight_distance
            objective.kill_exposure, objective.detection_exposure = sums.kill[b], sums.detection[b]
            objective.height_sum = sums.height[b] / POINTS


@inlined
def _are_limits_fixed(data: ProblemArrays, limits: PrecomputedLimits) -> bool:
    """Return True if turns and slopes have fixed limits, and no course is prescribed at the ends."""
    courses = math.isnan(data.start_course) and math.isnan(data.destination_course)
    return courses and not data.legs_hold_turns and not limits.slopes_by_aircraft


@inner
def _score_block(
    data: ProblemArrays, limits: PrecomputedLimits, paths: Floats, begin: int, size: int, block: Record
) -> None:
    """Fill the sums of paths begin : begin + size.

    Each waypoint is mapped to the raster once; between waypoints a leg is taken as straight in pixels.
    """
    last = paths.shape[1] - 1
    clear_sums(block.sums)
    load_waypoints(data.to_pixel, paths, begin, 0, size, block)
    _add_bounds(data, size, block.end, block.sums)
    for i in range(last):
        copy_point(block.end, block.begin, size)
        load_waypoints(data.to_pixel, paths, begin, i + 1, size, block)
        _add_bounds(data, size, block.end, block.sums)
        subtract_points(block.end, block.begin, size, block.step)
        _add_leg(limits, size, i == 0, block)
        # Departure from the paper: eq. 6 never reaches the destination, which is the seventh point of the last leg
        # here.
        for j in range(POINTS + (i == last - 1)):
            divide_legs(block.begin, block.step, j * (1.0 / POINTS), size, block.point)
            _find_ground(data.heights, size, block)
            _add_terrain(limits.required, size, j < POINTS, block)
            _find_nearby_units(data.threat_cells, size, block)
            _add_exposures(data.spheres, data.threat_cells.units, size, block)


@inlined
def _find_ground(heights: Heights, size: int, block: Record) -> None:
    """Fill the ground height at the points, as `pixel_height` computes it."""
    rows, columns = heights.shape
    flat = heights.reshape(heights.size)
    last_column, last_row = columns - 2.0, rows - 2.0
    point_column, point_row = block.point.column, block.point.row
    index, us, vs, ground = block.index, block.u, block.v, block.ground
    top_left, top_right, low_left, low_right = block.top_left, block.top_right, block.low_left, block.low_right
    for b in range(size):
        # Points off the raster and NaN read an arbitrary pixel; the last loop sets them to NaN.
        column, row = point_column[b], point_row[b]
        c, r = column if column > 0.0 else 0.0, row if row > 0.0 else 0.0
        j, i = int(c if c < last_column else last_column), int(r if r < last_row else last_row)
        index[b] = i * columns + j
        us[b] = column - j
        vs[b] = row - i
    one, below = np.uintp(1), np.uintp(columns)
    for b in range(size):
        k = np.uintp(index[b])
        top_left[b] = flat[k]
        top_right[b] = flat[k + one]
        low_left[b] = flat[k + below]
        low_right[b] = flat[k + below + one]
    right, bottom = columns - 1 + EDGE, rows - 1 + EDGE
    for b in range(size):
        u, v = us[b], vs[b]
        top = top_left[b] * (1.0 - u) + top_right[b] * u
        low = low_left[b] * (1.0 - u) + low_right[b] * u
        ground[b] = top * (1.0 - v) + low * v
    for b in range(size):
        column, row = point_column[b], point_row[b]
        inside = (column >= -EDGE) & (column <= right) & (row >= -EDGE) & (row <= bottom)
        ground[b] = ground[b] if inside else math.nan


@inlined
def _add_terrain(required: RequiredClearance, size: int, inner: bool, block: Record) -> None:
    """Add the points' terrain violations and heights above ground (eq. 5, 11)."""
    east, north, up = block.point.east, block.point.north, block.point.up
    ground, need, below, height = block.ground, block.need, block.sums.below, block.sums.height
    for b in range(size):
        need[b] = required.clearance + required.buffer
    if not required.same_everywhere:
        for b in range(size):
            need[b] = clearance_at(required, east[b], north[b])
    for b in range(size):
        # This form treats NaN as below.
        below[b] += 0.0 if up[b] > ground[b] + need[b] else 1.0
    if inner:
        for b in range(size):
            above = up[b] - ground[b]
            height[b] += above if above > 0.0 else 0.0


@inlined
def _find_nearby_units(threat_cells: ThreatCells, size: int, block: Record) -> None:
    """Fill the first entry and the length of each point's list of nearby units."""
    # A cell is not bounded in height; it notes the heights its units reach.
    west, south, per_metre = threat_cells.west, threat_cells.south, 1.0 / threat_cells.side
    columns, rows, cells = threat_cells.columns, threat_cells.rows, threat_cells.cells
    outside = columns * rows
    east, north, up = block.point.east, block.point.north, block.point.up
    index, first, count = block.index, block.first, block.count
    for b in range(size):
        column, row = (east[b] - west) * per_metre, (north[b] - south) * per_metre
        inside = (column >= 0.0) & (row >= 0.0) & (column < columns) & (row < rows)
        at = int(row if inside else 0.0) * columns + int(column if inside else 0.0)
        index[b] = at if inside else outside
    for b in range(size):
        cell, z = cells[np.uintp(index[b])], up[b]
        begin, entries, low, high = cell.first, cell.count, cell.lowest, cell.highest
        first[b] = begin
        count[b] = entries if (z >= low) & (z <= high) else 0


@inlined
def _add_exposures(spheres: Records, units: Short, size: int, block: Record) -> None:
    """Add kill and detection exposure of the points to the units found near them (eq. 9, 10).

    Round k takes the k-th unit of every list that has one. Within a round no branch depends on the contents of a list,
    because branch prediction would fail.
    """
    east, north, up = block.point.east, block.point.north, block.point.up
    kill, detection = block.sums.kill, block.sums.detection
    first, count, active = block.first, block.count, block.active
    # Unsigned: numba checks signed indices for wrap-around.
    one = np.uintp(1)
    open_paths = np.uintp(0)
    for b in range(size):
        active[open_paths] = b
        open_paths += one if count[b] > 0 else np.uintp(0)
    turn = 0
    while open_paths > 0:
        left = np.uintp(0)
        for entry in range(open_paths):
            lane = np.uintp(active[np.uintp(entry)])
            sphere = spheres[np.uintp(units[np.uintp(first[lane] + turn)])]
            dx, dy = east[lane] - sphere.east, north[lane] - sphere.north
            dz = up[lane] - sphere.up
            d2 = dx * dx + dy * dy + dz * dz
            closest2 = d2 if d2 > CLOSEST * CLOSEST else CLOSEST * CLOSEST
            share = 1.0 / (closest2 * closest2)
            # By multiplication: a branch on the radius is unpredictable, and a misprediction costs more.
            kill[lane] += sphere.kill_scale4 * share * (1.0 if d2 <= sphere.kill_radius2 else 0.0)
            detection[lane] += sphere.detection_scale4 * share * (1.0 if d2 <= sphere.detection_radius2 else 0.0)
            active[left] = np.int64(lane)
            left += one if count[lane] > turn + 1 else np.uintp(0)
        open_paths = left
        turn += 1


@inlined
def _add_leg(limits: PrecomputedLimits, size: int, first: bool, block: Record) -> None:
    """Add a leg's length, and count its slope and the turn into the leg if they exceed their limits (eq. 1-4, 8)."""
    climb, dive, cosine = limits.climb_slope, limits.dive_slope, limits.cos_max_turn
    east, north, up, runs = block.step.east, block.step.north, block.step.up, block.run
    east_before, north_before, run_before = block.east_before, block.north_before, block.run_before
    turns, slopes, lengths = block.sums.turns, block.sums.slopes, block.sums.length
    for b in range(size):
        dx, dy, dz = east[b], north[b], up[b]
        runs[b] = math.sqrt(dx * dx + dy * dy)
        lengths[b] += math.sqrt(dx * dx + dy * dy + dz * dz)
    for b in range(size):
        rise, run = up[b], runs[b]
        slopes[b] += 1.0 if (rise - climb * run > 0.0) | (-rise - dive * run > 0.0) else 0.0
    if not first:
        for b in range(size):
            # A leg without a course makes no turn: both sides are 0.
            dot = east[b] * east_before[b] + north[b] * north_before[b]
            turns[b] += 0.0 if dot >= cosine * (runs[b] * run_before[b]) else 1.0
    for b in range(size):
        east_before[b] = east[b]
        north_before[b] = north[b]
        run_before[b] = runs[b]


@inlined
def _add_bounds(data: ProblemArrays, size: int, place: Record, sums: Record) -> None:
    """Count a waypoint that is off the map, below the floor or above the ceiling (eq. 7)."""
    west, east, south, north = data.west, data.east, data.south, data.north
    floor, ceiling = data.floor, data.ceiling
    xs, ys, zs, outside = place.east, place.north, place.up, sums.outside
    for b in range(size):
        x, y, z = xs[b], ys[b], zs[b]
        out = (x < west) | (x > east) | (y < south) | (y > north) | (z < floor) | (z > ceiling)
        outside[b] += 1.0 if out else 0.0
