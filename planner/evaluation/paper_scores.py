"""Score many paths at once by the paper's four constraints and four objectives.

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
    BLOCK_SCRATCH,
    PATHS_PER_BLOCK,
    PrecomputedLimits,
    add_leg_violations,
    clear_sums,
    copy_point,
    interpolate_legs,
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
from planner.evaluation.threat_index import Int32s, ThreatCells
from world.arrays import Floats, Heights, Ints
from world.geometry import MIN_RANGE_M
from world.kernels import Record, Records, compiled, inlined, inner
from world.terrain import EDGE_TOLERANCE

# Number of points per leg (eq. 6).
POINTS_PER_LEG = 6


def paper_scores(data: ProblemArrays, paths: Floats) -> tuple[Ints, Floats]:
    """Score paths (n, w, 3) at six points per leg and at the destination (eq. 1-11).

    Returns violations (n, 4) by `planner.plan.Violation`, and objectives (n, 4) by `planner.plan.Objective`.
    """
    path_count, waypoint_count, _ = paths.shape
    violations, objectives = np.zeros(path_count, dtype=VIOLATIONS), np.zeros(path_count, dtype=OBJECTIVES)
    scratch = np.zeros(1, dtype=BLOCK_SCRATCH)
    legs, corners = np.zeros(waypoint_count - 1, dtype=LEG), np.zeros(waypoint_count, dtype=CORNER)
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
    """Fill the `VIOLATIONS` and `OBJECTIVES` records (n,) of paths (n, w, 3).

    scratch: a `BLOCK_SCRATCH` record (1,).
    legs, corners: working memory for one path.
    violations, objectives: records to fill.

    Paths are scored in blocks. Turns, slopes and bounds are counted in the blocks, too, if their limits are constants;
    otherwise they are counted path by path.
    """
    path_count, block = paths.shape[0], scratch[0]
    limits = precompute_limits(data)
    # Limits of turns and slopes are constants, and no end course is prescribed.
    has_free_courses = math.isnan(data.start_course) and math.isnan(data.destination_course)
    has_fixed_limits = has_free_courses and not data.legs_hold_turns and not limits.slopes_by_aircraft
    for first_path in range(0, path_count, PATHS_PER_BLOCK):
        size = min(PATHS_PER_BLOCK, path_count - first_path)
        _score_block(data, limits, paths, first_path, size, block)
        sums = block.sums
        for b in range(size):
            violation, objective = violations[first_path + b], objectives[first_path + b]
            if has_fixed_limits:
                violation.turn, violation.slope = sums.turns[b], sums.slopes[b]
                violation.bounds = sums.outside[b]
            else:
                path = paths[first_path + b]
                measure_legs(path, legs)
                if data.legs_hold_turns:
                    measure_corners(data, limits.wind, path, legs, corners)
                add_leg_violations(data, limits, path, legs, corners, False, violation)
            violation.terrain = sums.below[b]
            objective.length_ratio = sums.length[b] / limits.straight_distance
            objective.kill_exposure, objective.detection_exposure = sums.kill[b], sums.detection[b]
            objective.height_sum = sums.height[b] / POINTS_PER_LEG


@inner
def _score_block(
    data: ProblemArrays, limits: PrecomputedLimits, paths: Floats, first_path: int, size: int, block: Record
) -> None:
    """Score `size` paths side by side, from number `first_path` on; store their sums in the block.

    Each waypoint is mapped to the raster once. Between waypoints a leg is assumed to be straight in pixels.
    """
    leg_count = paths.shape[1] - 1
    clear_sums(block.sums)
    load_waypoints(data.to_pixel, paths, first_path, 0, size, block)
    _add_bounds_violations(data, size, block.end, block.sums)
    for i in range(leg_count):
        copy_point(block.end, block.begin, size)
        load_waypoints(data.to_pixel, paths, first_path, i + 1, size, block)
        _add_bounds_violations(data, size, block.end, block.sums)
        subtract_points(block.end, block.begin, size, block.step)
        _add_leg(limits, size, i == 0, block)
        # Departure from the paper: eq. 6 never reaches the destination, which is the seventh point of the last leg
        # here.
        for j in range(POINTS_PER_LEG + (i == leg_count - 1)):
            interpolate_legs(block.begin, block.step, j * (1.0 / POINTS_PER_LEG), size, block.point)
            _find_ground(data.heights, size, block)
            _add_terrain(limits.required, size, j < POINTS_PER_LEG, block)
            _find_nearby_units(data.threat_cells, size, block)
            _add_exposures(data.spheres, data.threat_cells.units, size, block)


@inlined
def _find_ground(heights: Heights, size: int, block: Record) -> None:
    """Interpolate the ground height at one point of each path of a block, as `pixel_height` does.

    heights: ground heights by pixel, m.
    size: number of paths in the block.
    block: one point of each path of the block; the ground heights are stored in it, NaN off the raster.
    """
    rows, columns = heights.shape
    flat = heights.reshape(heights.size)
    last_column, last_row = columns - 2.0, rows - 2.0
    point_column, point_row = block.point.column, block.point.row
    index = block.index
    us = block.u
    vs = block.v
    ground = block.ground
    top_left = block.top_left
    top_right = block.top_right
    low_left = block.low_left
    low_right = block.low_right
    for b in range(size):
        # Points off the raster and NaN read an arbitrary pixel; the last loop sets them to NaN.
        column, row = point_column[b], point_row[b]
        c, r = column if column > 0.0 else 0.0, row if row > 0.0 else 0.0
        j, i = int(c if c < last_column else last_column), int(r if r < last_row else last_row)
        index[b] = i * columns + j
        us[b] = column - j
        vs[b] = row - i
    right_step, down_step = np.uintp(1), np.uintp(columns)
    for b in range(size):
        k = np.uintp(index[b])
        top_left[b] = flat[k]
        top_right[b] = flat[k + right_step]
        low_left[b] = flat[k + down_step]
        low_right[b] = flat[k + down_step + right_step]
    max_column, max_row = columns - 1 + EDGE_TOLERANCE, rows - 1 + EDGE_TOLERANCE
    for b in range(size):
        u, v = us[b], vs[b]
        top_height = top_left[b] * (1.0 - u) + top_right[b] * u
        bottom_height = low_left[b] * (1.0 - u) + low_right[b] * u
        ground[b] = top_height * (1.0 - v) + bottom_height * v
    for b in range(size):
        column, row = point_column[b], point_row[b]
        is_on_raster = (
            (column >= -EDGE_TOLERANCE) & (column <= max_column) & (row >= -EDGE_TOLERANCE) & (row <= max_row)
        )
        ground[b] = ground[b] if is_on_raster else math.nan


@inlined
def _add_terrain(required: RequiredClearance, size: int, adds_height: bool, block: Record) -> None:
    """Count the points that are too low (eq. 5); if `adds_height`, add up their heights (eq. 11).

    The equations are those of Yang, Tang and Lozano 2014. A point above unknown ground counts as too low.

    required: required clearance.
    size: number of paths in the block.
    adds_height: True to add the heights, m; a point below the ground adds 0.
    block: one point of each path of the block, with the ground below it; its sums are updated.
    """
    east, north, up = block.point.east, block.point.north, block.point.up
    ground = block.ground
    required_height = block.need
    below = block.sums.below
    height = block.sums.height
    for b in range(size):
        required_height[b] = required.clearance + required.buffer
    if not required.same_everywhere:
        for b in range(size):
            required_height[b] = clearance_at(required, east[b], north[b])
    for b in range(size):
        # This form treats NaN as below.
        below[b] += 0.0 if up[b] > ground[b] + required_height[b] else 1.0
    if adds_height:
        for b in range(size):
            height_above = up[b] - ground[b]
            height[b] += height_above if height_above > 0.0 else 0.0


@inlined
def _find_nearby_units(threat_cells: ThreatCells, size: int, block: Record) -> None:
    """Find the threats that may reach the current point of each path.

    threat_cells: for each cell of a grid, the range of entries in one long list that holds the threats near this cell.
    size: number of paths in the block.
    block: one point of each path. `first` and `count` are set to the first entry and the length of the range of the
        point's cell; `count` is 0 at an altitude that no threat of the cell reaches.
    """
    # A cell is not bounded in height; it stores the heights that its units reach.
    west, south, per_metre = threat_cells.west, threat_cells.south, 1.0 / threat_cells.side
    columns, rows, cells = threat_cells.columns, threat_cells.rows, threat_cells.cells
    outside_index = columns * rows
    east, north, up = block.point.east, block.point.north, block.point.up
    index, first_entries, entry_counts = block.index, block.first, block.count
    for b in range(size):
        column, row = (east[b] - west) * per_metre, (north[b] - south) * per_metre
        is_inside = (column >= 0.0) & (row >= 0.0) & (column < columns) & (row < rows)
        cell_index = int(row if is_inside else 0.0) * columns + int(column if is_inside else 0.0)
        index[b] = cell_index if is_inside else outside_index
    for b in range(size):
        cell, z = cells[np.uintp(index[b])], up[b]
        first_entry = cell.first
        entry_count = cell.count
        min_altitude = cell.lowest
        max_altitude = cell.highest
        first_entries[b] = first_entry
        entry_counts[b] = entry_count if (z >= min_altitude) & (z <= max_altitude) else 0


@inlined
def _add_exposures(spheres: Records, units: Int32s, size: int, block: Record) -> None:
    """Add the kill and detection exposure of each path's current point to the sums of the path.

    spheres: centres, radii and scales of all threats.
    units: one array of threat indices for all map cells: the threats near the first cell, then those near the second.
    size: number of paths in the block.
    block: one point of each path. `first` and `count` say which entries of `units` belong to the point's cell. `sums`
        is updated.

    These are eqs. 9 and 10 of Yang, Tang and Lozano 2014. The loop goes through the threats in rounds: round 0 adds the
    first threat near each point, round 1 the second. This avoids branches that the processor cannot predict.
    """
    east, north, up = block.point.east, block.point.north, block.point.up
    kill, detection = block.sums.kill, block.sums.detection
    first_entries, entry_counts, active = block.first, block.count, block.active
    # Unsigned: numba checks signed indices for wrap-around.
    one = np.uintp(1)
    open_paths = np.uintp(0)
    for b in range(size):
        active[open_paths] = b
        open_paths += one if entry_counts[b] > 0 else np.uintp(0)
    round_number = 0
    while open_paths > 0:
        remaining_paths = np.uintp(0)
        for entry in range(open_paths):
            path = np.uintp(active[np.uintp(entry)])
            sphere = spheres[np.uintp(units[np.uintp(first_entries[path] + round_number)])]
            dx, dy = east[path] - sphere.east, north[path] - sphere.north
            dz = up[path] - sphere.up
            distance2 = dx * dx + dy * dy + dz * dz
            closest2 = distance2 if distance2 > MIN_RANGE_M * MIN_RANGE_M else MIN_RANGE_M * MIN_RANGE_M
            inverse4 = 1.0 / (closest2 * closest2)
            # Multiply, because a branch on the radius is unpredictable and a misprediction costs more.
            kill[path] += sphere.kill_scale4 * inverse4 * (1.0 if distance2 <= sphere.kill_radius2 else 0.0)
            detection[path] += (
                sphere.detection_scale4 * inverse4 * (1.0 if distance2 <= sphere.detection_radius2 else 0.0)
            )
            active[remaining_paths] = np.int64(path)
            remaining_paths += one if entry_counts[path] > round_number + 1 else np.uintp(0)
        open_paths = remaining_paths
        round_number += 1


@inlined
def _add_leg(limits: PrecomputedLimits, size: int, is_first: bool, block: Record) -> None:
    """Add the length of a leg; count the leg if it is too steep, and the turn into it if it is too sharp.

    These are eqs. 1 to 4 and 8 of Yang, Tang and Lozano 2014.

    limits: tangents of the slope limits, and cosine of the turn limit.
    size: number of paths in the block.
    is_first: True for the first leg, which has no turn.
    block: one leg of each path of the block, and the leg before it; its sums are updated.
    """
    climb, dive, cos_max_turn = limits.climb_slope, limits.dive_slope, limits.cos_max_turn
    east = block.step.east
    north = block.step.north
    up = block.step.up
    runs = block.run
    east_before, north_before, run_before = block.east_before, block.north_before, block.run_before
    turns, slopes, lengths = block.sums.turns, block.sums.slopes, block.sums.length
    for b in range(size):
        dx, dy, dz = east[b], north[b], up[b]
        runs[b] = math.sqrt(dx * dx + dy * dy)
        lengths[b] += math.sqrt(dx * dx + dy * dy + dz * dz)
    for b in range(size):
        altitude_change, horizontal_length = up[b], runs[b]
        slopes[b] += (
            1.0
            if (altitude_change - climb * horizontal_length > 0.0) | (-altitude_change - dive * horizontal_length > 0.0)
            else 0.0
        )
    if not is_first:
        for b in range(size):
            # A leg without a course makes no turn: both sides are 0.
            dot = east[b] * east_before[b] + north[b] * north_before[b]
            turns[b] += 0.0 if dot >= cos_max_turn * (runs[b] * run_before[b]) else 1.0
    for b in range(size):
        east_before[b] = east[b]
        north_before[b] = north[b]
        run_before[b] = runs[b]


@inlined
def _add_bounds_violations(data: ProblemArrays, size: int, waypoints: Record, sums: Record) -> None:
    """Count the paths' current waypoints that are off the map, below the floor or above the ceiling.

    This is eq. 7 of Yang, Tang and Lozano 2014.

    size: number of paths in the block.
    waypoints: record with the east, north and up of one waypoint of each path, m.
    sums: sums of each path; `outside` is increased by 1 if the path's waypoint is outside.
    """
    west = data.west
    east = data.east
    south = data.south
    north = data.north
    floor, ceiling = data.floor, data.ceiling
    xs = waypoints.east
    ys = waypoints.north
    zs = waypoints.up
    outside_counts = sums.outside
    for b in range(size):
        x, y, z = xs[b], ys[b], zs[b]
        is_outside = (x < west) | (x > east) | (y < south) | (y > north) | (z < floor) | (z > ceiling)
        outside_counts[b] += 1.0 if is_outside else 0.0
