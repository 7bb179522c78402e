"""Find cheapest routes over coarse grids through terrain and threats, stage by stage.

The grids are in the rotated frame.

A grid decides on which side to pass each obstacle; `planner.seeding.waypoint_fitting` then places the path's waypoints,
one per interval, by evaluating whole legs. Both use dynamic programming over forward steps, because a path in the
rotated encoding never turns back.

Cells cost more near the ground and inside kill spheres (`set_cell_costs`). `cheapest_route` relaxes one stage after
another and prunes every cell through which no route stays within a cost bound; a route found within the bound is
optimal. `grid_routes` repeats this with a penalty near earlier routes, to find routes on other sides.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem import ProblemArrays, RequiredClearance, clearance_at, required_clearance
from world.arrays import Codes, Floats
from world.by_reference import by_reference
from world.frames import polymap
from world.kernels import Records, compiled, inner
from world.terrain import pixel_height

# --- Cost per metre of grid cells ---


# Additional cost per m inside a kill sphere, in m of path.
KILL_COST = 40.0
# Step of a grid above which kill spheres are enlarged, m, to cover the space between the cells. Finer grids use their
# true size and find the narrow gaps.
COARSE_STEP_M = 250.0
# Enlargement of the spheres, as a fraction of a step.
COARSE_GROWTH_STEPS = 0.15
# Fraction of a step around a cell over which the highest ground is taken.
GROUND_SPREAD_STEPS = 0.4
# A threat in the rotated frame, with the radius that routes avoid, m.
OBSTACLE = np.dtype(
    [("along", np.float64), ("across", np.float64), ("up", np.float64), ("radius", np.float64)], align=True
)


@by_reference
class Grid(NamedTuple):
    """Grid of one resolution: stages along, positions across and layers of height.

    stages: number of stages, which are equal steps along the line from start to destination.
    across: (across,) positions across, m from the line.
    layers: (layers,) altitudes, m.
    shrink: fraction of a step by which kill spheres are reduced; 0 for none. Routes on such a grid pass gaps narrower
        than its cells, but may have to be shortened to be safe.
    spread: fraction of a step around a cell over which the highest ground is taken.
    ratio: spacing across as a fraction of a step; below 1 the grid has more courses and resolves finer gaps.
    """

    stages: int
    across: Floats
    layers: Floats
    shrink: float = 0.0
    spread: float = GROUND_SPREAD_STEPS
    ratio: float = 1.0


class _PixelSteps(NamedTuple):
    """Steps between ground samples, in raster columns and rows: the step along and the step across."""

    columns_along: float
    rows_along: float
    columns_across: float
    rows_across: float


@inner
def to_world_position(frame: RotatedFrame, along: float, across: float) -> tuple[float, float]:
    """Convert a position (along, across) in the rotated frame to east and north, m."""
    return (
        frame.east + frame.cosine * along - frame.sine * across,
        frame.north + frame.sine * along + frame.cosine * across,
    )


@inner
def _min_height(
    data: ProblemArrays,
    required: RequiredClearance,
    frame: RotatedFrame,
    along: float,
    across: float,
    steps: _PixelSteps,
) -> float:
    """Return the lowest allowed altitude in a cell, m; inf outside the map or without terrain data.

    required: required clearance.
    along, across: position of the cell in the rotated frame, m.
    steps: steps between the 3 x 3 ground samples around the position; if they are 0, only the ground at the position is
        taken.

    It is the highest of the ground samples plus the required clearance.
    """
    east, north = to_world_position(frame, along, across)
    if not (data.west <= east <= data.east and data.south <= north <= data.north):
        return math.inf
    column, row = polymap(data.to_pixel, east, north)
    sample_radius = 0 if steps.columns_along == 0.0 and steps.rows_along == 0.0 else 1
    highest_ground = -math.inf
    for i in range(-sample_radius, sample_radius + 1):
        for j in range(-sample_radius, sample_radius + 1):
            ground = pixel_height(
                data.heights,
                column + i * steps.columns_along + j * steps.columns_across,
                row + i * steps.rows_along + j * steps.rows_across,
            )
            if math.isnan(ground):
                return math.inf
            highest_ground = max(highest_ground, ground)
    return highest_ground + clearance_at(required, east, north)


@inner
def _pixel_steps(data: ProblemArrays, frame: RotatedFrame, along: float, length: float) -> _PixelSteps:
    """Convert a step along the frame, and one across it, to raster columns and rows.

    along: position in the frame at which the steps are converted, m.
    length: length of the steps in the frame, m.
    """
    east, north = to_world_position(frame, along, 0.0)
    column, row = polymap(data.to_pixel, east, north)
    east, north = to_world_position(frame, along + length, 0.0)
    column_along, row_along = polymap(data.to_pixel, east, north)
    east, north = to_world_position(frame, along, length)
    column_across, row_across = polymap(data.to_pixel, east, north)
    return _PixelSteps(column_along - column, row_along - row, column_across - column, row_across - row)


@compiled
def find_obstacles(data: ProblemArrays, frame: RotatedFrame, step: float, shrink: float = 0.0) -> Records:
    """Convert the missiles to `OBSTACLE` records for a grid, with radii that suit the grid.

    step: length of a stage, m. Spheres are enlarged on coarse grids, to cover the space between the cells.
    shrink: if it is not 0, spheres are reduced by this fraction of a step instead.
    """
    growth = COARSE_GROWTH_STEPS * step if step > COARSE_STEP_M else 0.0
    if shrink > 0.0:
        growth = -shrink * step
    obstacles = np.zeros(data.threats.shape[0], dtype=OBSTACLE)
    count = 0
    for k in range(data.threats.shape[0]):
        threat = data.threats[k]
        if threat.kill_radius <= 0.0:
            continue
        east, north = threat.east - frame.east, threat.north - frame.north
        obstacles[count].along = frame.cosine * east + frame.sine * north
        obstacles[count].across = frame.cosine * north - frame.sine * east
        obstacles[count].up = threat.up
        obstacles[count].radius = threat.kill_radius + (data.kill_margin + growth)
        count += 1
    return obstacles[:count]


@inner
def _add_kill_cost(
    obstacles: Records, along: float, grid: Grid, first_across: int, last_across: int, cell_costs: Floats
) -> None:
    """Add the cost of kill spheres to cells of a stage; the cost increases towards the centre of a sphere.

    obstacles: `OBSTACLE` records: kill spheres in the rotated frame.
    along: position of the stage, m.
    first_across, last_across: range of the cells across, both included.
    cell_costs: (layers, across) cost per m; updated.
    """
    across, layers = grid.across, grid.layers
    across_spacing = across[1] - across[0] if across.size > 1 else 1.0
    for k in range(obstacles.shape[0]):
        obstacle = obstacles[k]
        radius = obstacle.radius
        along2 = (along - obstacle.along) ** 2
        if along2 >= radius * radius:
            continue
        half_width = math.sqrt(radius * radius - along2)
        first_y = max(first_across, math.ceil((obstacle.across - half_width - across[0]) / across_spacing))
        last_y = min(last_across, math.floor((obstacle.across + half_width - across[0]) / across_spacing))
        for z in range(layers.size):
            plane_distance2 = along2 + (layers[z] - obstacle.up) ** 2
            if plane_distance2 >= radius * radius:
                continue
            for y in range(first_y, last_y + 1):
                distance2 = plane_distance2 + (across[y] - obstacle.across) ** 2
                if distance2 < radius * radius:
                    # From KILL_COST at the surface to three times as much at the centre.
                    cell_costs[z, y] += KILL_COST * (3.0 - 2.0 * math.sqrt(distance2) / radius)


@inner
def set_cell_costs(
    data: ProblemArrays,
    required: RequiredClearance,
    frame: RotatedFrame,
    stage: int,
    obstacles: Records,
    grid: Grid,
    extra: Floats,
    first_across: int,
    last_across: int,
    cell_costs: Floats,
) -> None:
    """Fill the cost per m of path in the cells of a stage.

    required: required clearance.
    stage: number of the stage.
    obstacles: `OBSTACLE` records: kill spheres in the rotated frame.
    extra: (stages + 1, across) additional cost per m.
    first_across, last_across: range of the cells across, both included.
    cell_costs: (layers, across) array to fill.

    The cost is inf for a cell too close to the ground, and higher inside kill spheres.
    """
    across, layers = grid.across, grid.layers
    step = frame.length / grid.stages
    steps = _pixel_steps(data, frame, stage * step, grid.spread * step if stage < grid.stages else 0.0)
    for y in range(first_across, last_across + 1):
        # The destination is fixed, whatever its clearance.
        if stage == grid.stages and across[y] == 0.0:
            min_altitude = -math.inf
        else:
            min_altitude = _min_height(data, required, frame, stage * step, across[y], steps)
        for z in range(layers.size):
            cell_costs[z, y] = 1.0 + extra[stage, y] if layers[z] >= min_altitude else math.inf
    _add_kill_cost(obstacles, stage * step, grid, first_across, last_across, cell_costs)


# --- Dynamic programme over stages ---


# Maximum lateral step, in cells, per stage.
MAX_SIDE = 3
# A cell of a route: its indices across and among the layers.
ROUTE_CELL = np.dtype([("across", np.int64), ("layer", np.int64)], align=True)
# Maximum climb and descent of a step, in layers.
STEP_LAYERS = np.dtype([("climb", np.int64), ("sink", np.int64)], align=True)
# First and last index across with a finite cost, per layer; first > last for none.
SPAN = np.dtype([("first", np.int64), ("last", np.int64)], align=True)


@inner
def layers_per_step(data: ProblemArrays, frame: RotatedFrame, step: float, layers: Floats, ratio: float) -> Records:
    """Return the steepest climb and descent of a step, in whole layers.

    The result is `STEP_LAYERS` records (2 * MAX_SIDE + 1, layers). Entry [MAX_SIDE + k, z] is for the step that begins
    in layer z and goes one stage forward and k cells to the side.

    frame: frame of the direct line.
    step: length of a step along the line, m.
    layers: altitudes of the layers, m.
    ratio: spacing across as a fraction of a step.
    """
    layer_spacing = layers[1] - layers[0] if layers.size > 1 else 1.0
    step_layers = np.zeros((2 * MAX_SIDE + 1, layers.size), dtype=STEP_LAYERS)
    a, b = np.zeros(3), np.zeros(3)
    for side in range(-MAX_SIDE, MAX_SIDE + 1):
        horizontal_length = step * math.sqrt(1.0 + (side * ratio) ** 2)
        b[0], b[1] = to_world_position(frame, step, side * ratio * step)
        a[0], a[1] = frame.east, frame.north
        for z in range(layers.size):
            a[2] = layers[z]
            b[2] = layers[z]
            climb, dive = slope_limits(data, a, b)
            step_layers[side + MAX_SIDE, z].climb = max(
                0, math.floor(math.tan(climb) * horizontal_length / layer_spacing)
            )
            step_layers[side + MAX_SIDE, z].sink = max(
                0, math.floor(math.tan(dive) * horizontal_length / layer_spacing)
            )
    return step_layers


@inner
def relax_cells(
    cost: Floats,
    cell_costs: Floats,
    next_cost: Floats,
    parents: Codes,
    first_source: int,
    first_target: int,
    first_cell_cost: int,
    count: int,
    length: float,
) -> None:
    """Extend the routes of successive cells to the next stage; keep the cheaper route to each cell.

    cost, next_cost: costs of the routes to the cells of this stage and of the next stage; `next_cost` is updated.
    cell_costs: cost per m of the cells.
    parents: cells from which the cheapest routes come; updated.
    first_source, first_target, first_cell_cost: indices of the first cells, and of the first cell cost.
    count: number of the cells.
    length: length of each step, m.

    Cell first_source + k is extended to cell first_target + k, for k from 0 to count - 1. All arrays are flat: layer
    after layer, and in each layer the cells across.
    """
    for k in range(count):
        # Unsigned indices (numba checks signed ones for wrap-around) and no branches: this innermost loop is
        # vectorised.
        i, j = np.uintp(first_source) + np.uintp(k), np.uintp(first_target) + np.uintp(k)
        total = cost[i] + length * cell_costs[np.uintp(first_cell_cost) + np.uintp(k)]
        is_better = total < next_cost[j]
        next_cost[j] = total if is_better else next_cost[j]
        parents[j] = first_source + k if is_better else parents[j]


@inner
def relax_stage(
    cost: Floats,
    next_cost: Floats,
    parents: Codes,
    spans: Records,
    step_layers: Records,
    cell_costs: Floats,
    step: float,
    layer_spacing: float,
    ratio: float,
) -> None:
    """Extend all routes by one step to the next stage; keep the cheapest route to each of its cells.

    cost, next_cost: (layers, across) costs of the routes to the cells of the previous stage and of this stage; the
        latter are updated.
    parents: (layers, across) cells of the previous stage from which the cheapest routes come; updated.
    spans: `SPAN` records (layers,) of the cells with a finite cost in the previous stage.
    step_layers: steepest climb and descent from the previous stage, as `layers_per_step` returns them.
    cell_costs: (layers, across) cost per m of the steps to the cells of this stage.
    step: length of a step along the line, m.
    layer_spacing: m.
    ratio: spacing across as a fraction of a step.
    """
    layer_count, width = cost.shape
    flat_cost = cost.ravel()
    flat_next_cost = next_cost.ravel()
    flat_parents = parents.ravel()
    flat_cell_costs = cell_costs.ravel()
    for z in range(layer_count):
        first, last = spans[z].first, spans[z].last
        if first > last:
            continue
        for side in range(-MAX_SIDE, MAX_SIDE + 1):
            first_cell, end_cell = max(first, -side), min(last, width - 1 - side) + 1
            if first_cell >= end_cell:
                continue
            limit = step_layers[side + MAX_SIDE, z]
            bottom, top = max(0, z - limit.sink), min(layer_count - 1, z + limit.climb)
            for next_z in range(bottom, top + 1):
                length = math.sqrt(step * step * (1.0 + (side * ratio) ** 2) + ((next_z - z) * layer_spacing) ** 2)
                source, target = z * width + first_cell, next_z * width + first_cell + side
                relax_cells(
                    flat_cost,
                    flat_cell_costs,
                    flat_next_cost,
                    flat_parents,
                    source,
                    target,
                    target,
                    end_cell - first_cell,
                    length,
                )


@inner
def fill_goal_distances(
    columns: int, goal_index: int, remaining_stages: int, step: float, ratio: float, out: Floats
) -> None:
    """Fill `out` with the length of the shortest route to the destination from each position across, m.

    The route is horizontal and ignores obstacles, so that no real route is shorter.

    columns: number of positions across.
    goal_index: index across of the destination.
    remaining_stages: number of stages between this stage and the destination.
    step: length of a step along the line, m.
    ratio: spacing across as a fraction of a step.
    out: (columns,) array to fill; inf if the destination cannot be reached in the remaining stages.

    On the shortest route each step moves k or k + 1 positions across, where k is the mean number, rounded down.
    """
    for y in range(columns):
        offset = abs(y - goal_index)
        if offset > MAX_SIDE * remaining_stages:
            out[y] = math.inf
            continue
        k = offset // remaining_stages if remaining_stages > 0 else 0
        short_count, long_count = (k + 1) * remaining_stages - offset, offset - k * remaining_stages
        short_length, long_length = math.sqrt(1.0 + (k * ratio) ** 2), math.sqrt(1.0 + ((k + 1) * ratio) ** 2)
        out[y] = step * (short_count * short_length + long_count * long_length)


@inner
def prune_cells(
    next_cost: Floats,
    spans: Records,
    goal_distances: Floats,
    height_differences: Floats,
    bound: float,
    first_across: int,
    last_across: int,
) -> None:
    """Drop the cells of a stage from which the destination cannot be reached within the bound on the cost.

    The cost of a dropped cell is set to inf. The spans of the remaining cells are stored.

    next_cost: (layers, across) costs of the routes to the cells; updated.
    spans: `SPAN` records (layers,) to fill with the remaining cells.
    goal_distances: (across,) horizontal distance to the destination, m.
    height_differences: (layers,) height differences to the destination, m.
    bound: upper limit on the cost of a whole route, m.
    first_across, last_across: range of cells across that may have a finite cost, both included.
    """
    for z in range(next_cost.shape[0]):
        spans[z].first, spans[z].last = next_cost.shape[1], -1
        height_difference2 = height_differences[z] * height_differences[z]
        for y in range(first_across, last_across + 1):
            remaining_cost = bound - next_cost[z, y]
            if (
                remaining_cost >= 0.0
                and remaining_cost * remaining_cost >= goal_distances[y] * goal_distances[y] + height_difference2
                and next_cost[z, y] < math.inf
            ):
                spans[z].first = min(spans[z].first, y)
                spans[z].last = y
            else:
                next_cost[z, y] = math.inf


class GridSearch(NamedTuple):
    """State of a search for the cheapest route over a grid, which is continued stage by stage.

    step_layers: steepest climb and descent of a step, as `layers_per_step` returns them.
    obstacles: `OBSTACLE` records.
    parents: (stages + 1, layers, across) cell of the previous stage from which the cheapest route comes.
    cost: (layers, across) costs of the routes to the cells of the last stage reached.
    next_cost, cell_costs: (layers, across) working memory.
    spans: `SPAN` records (layers,) of the cells with a finite cost.
    start_layer, goal_layer: layers of the ends.
    centre_index: index across of both ends.
    stage: the last stage reached.
    """

    step_layers: Records
    obstacles: Records
    parents: Codes
    cost: Floats
    next_cost: Floats
    cell_costs: Floats
    spans: Records
    start_layer: int
    centre_index: int
    goal_layer: int
    stage: int


# Number of cells reached between two calls of `check_stop`: some 10 ms.
CELLS_PER_CHECK = 150_000


def cheapest_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: Grid,
    extra: Floats,
    bound: float,
    check_stop: Callable[[], None] = lambda: None,
) -> tuple[Records, float]:
    """Find the cheapest route over a grid; return its `ROUTE_CELL` records (stages + 1,) and its cost.

    extra: (stages + 1, across) additional cost per m.
    bound: upper limit on the cost; more expensive routes are not searched.
    check_stop: called after every `CELLS_PER_CHECK` cells; an exception raised there stops the search.

    Without a route, there are no records and the cost is inf.
    """
    stages = max(1, CELLS_PER_CHECK // (grid.across.size * grid.layers.size))
    search: GridSearch = begin_route(data, frame, grid)
    while search.stage < grid.stages:
        search = continue_route(data, frame, grid, extra, bound, search, stages)
        check_stop()
    cells, cost = extract_route(search)
    return cells, cost


@compiled
def begin_route(data: ProblemArrays, frame: RotatedFrame, grid: Grid) -> GridSearch:
    """Make a search for the cheapest route, before its first stage, with the cost 0 at the start."""
    stages, width, layer_count = grid.stages, grid.across.size, grid.layers.size
    step = frame.length / stages
    centre_index, start_layer = int(np.argmin(np.abs(grid.across))), int(np.argmin(np.abs(grid.layers - data.start[2])))
    goal_layer = int(np.argmin(np.abs(grid.layers - data.destination[2])))
    cost = np.full((layer_count, width), np.inf)
    cost[start_layer, centre_index] = 0.0
    spans = np.zeros(layer_count, dtype=SPAN)
    for z in range(layer_count):
        spans[z].first, spans[z].last = (centre_index, centre_index) if z == start_layer else (width, -1)
    return GridSearch(
        layers_per_step(data, frame, step, grid.layers, grid.ratio),
        find_obstacles(data, frame, step, grid.shrink),
        np.empty((stages + 1, layer_count, width), dtype=np.int32),
        cost,
        np.full((layer_count, width), np.inf),
        np.full((layer_count, width), np.inf),
        spans,
        start_layer,
        centre_index,
        goal_layer,
        0,
    )


@compiled
def continue_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: Grid,
    extra: Floats,
    bound: float,
    search: GridSearch,
    max_stages: int,
) -> GridSearch:
    """Continue a search by up to `max_stages` stages, or until no route can continue; return its state.

    extra: (stages + 1, across) additional cost per m of path in each position.
    bound: upper limit on the cost of the route; cells that only dearer routes can use are dropped.
    search: state of the search; its arrays are overwritten.
    """
    stages, width, layer_count = grid.stages, grid.across.size, grid.layers.size
    step = frame.length / stages
    layer_spacing = grid.layers[1] - grid.layers[0] if layer_count > 1 else 1.0
    required = required_clearance(data)
    (
        step_layers,
        obstacles,
        parents,
        cost,
        next_cost,
        cell_costs,
        spans,
        start_layer,
        centre_index,
        goal_layer,
        reached_stage,
    ) = search
    height_differences, goal_distances = grid.layers - grid.layers[goal_layer], np.empty(width)
    last_stage = min(stages, reached_stage + max_stages)
    for stage in range(reached_stage + 1, last_stage + 1):
        first, last = width, -1
        for z in range(layer_count):
            first, last = min(first, spans[z].first), max(last, spans[z].last)
        first, last = max(0, first - MAX_SIDE), min(width - 1, last + MAX_SIDE)
        if first > last:
            last_stage = stages
            break
        set_cell_costs(data, required, frame, stage, obstacles, grid, extra, first, last, cell_costs)
        next_cost[:, first : last + 1] = np.inf
        relax_stage(cost, next_cost, parents[stage], spans, step_layers, cell_costs, step, layer_spacing, grid.ratio)
        fill_goal_distances(width, centre_index, stages - stage, step, grid.ratio, goal_distances)
        prune_cells(next_cost, spans, goal_distances, height_differences, bound, first, last)
        cost, next_cost = next_cost, cost
    return GridSearch(
        step_layers,
        obstacles,
        parents,
        cost,
        next_cost,
        cell_costs,
        spans,
        start_layer,
        centre_index,
        goal_layer,
        last_stage,
    )


@compiled
def extract_route(search: GridSearch) -> tuple[Records, float]:
    """Return the route that a search found, as `ROUTE_CELL` records (stages + 1,), and its cost.

    Without a route, there are no records and the cost is inf.
    """
    goal_layer, centre_index, cost = search.goal_layer, search.centre_index, search.cost
    if (
        search.spans[goal_layer].first > centre_index
        or search.spans[goal_layer].last < centre_index
        or cost[goal_layer, centre_index] == np.inf
    ):
        return np.zeros(0, dtype=ROUTE_CELL), np.inf
    return trace_back(search.parents, goal_layer, centre_index), cost[goal_layer, centre_index]


@inner
def trace_back(parents: Codes, layer: int, across: int) -> Records:
    """Return `ROUTE_CELL` records of the route from the start to a cell of the last stage.

    parents: (stages + 1, layers, across) parent of each cell, as layer x width + across.
    layer, across: the cell of the last stage.
    """
    width = parents.shape[2]
    cells = np.zeros(parents.shape[0], dtype=ROUTE_CELL)
    for stage in range(parents.shape[0] - 1, -1, -1):
        cells[stage].across = across
        cells[stage].layer = layer
        if stage > 0:
            parent = parents[stage, layer, across]
            layer, across = parent // width, parent % width
    return cells


# --- Grids and routes ---

# Layers that the gentler slope limit climbs per step along; the limits of the layer spacing below apply.
LAYERS_PER_STEP = 2.5
# Smallest spacing of the layers, as a fraction of the step along.
MIN_LAYER_SPACING_STEPS = 0.05
# Largest spacing of the layers, as a fraction of the step along.
MAX_LAYER_SPACING_STEPS = 0.12
# Maximum number of cells of a grid: stages x across x layers.
MAX_CELLS = 1_200_000
# Expected cost of the first route over the straight line; with few courses, grid routes are too long by about this.
EXPECTED_COST_RATIO = 1.12
# Distance from an earlier route within which a route costs up to twice as much, m.
ROUTE_SPACING_M = 800.0
# Alternative distance from an earlier route, in grid steps; the larger one of both distances is used.
ROUTE_SPACING_STEPS = 3.0


@dataclass(frozen=True, slots=True)
class GridRoute:
    """A route over a grid: points (stages + 1, 3) along, across, up, and its cost in m of path."""

    points: Floats
    cost: float


def positions_across(span: tuple[float, float], spacing: float, stages: int) -> Floats:
    """Return the positions across of a grid's cells, m: those within a span that a route can reach.

    span: lowest and highest position across, m.
    spacing: distance between neighbouring positions, m.
    stages: number of stages of the grid.

    A route begins and ends at the position 0 and moves by at most `MAX_SIDE` cells per stage. With few stages it can
    therefore reach only positions near the line.
    """
    reach = MAX_SIDE * (stages // 2)
    first, last = max(-reach, math.ceil(span[0] / spacing)), min(reach, math.floor(span[1] / spacing))
    return np.asarray(np.arange(first, last + 1) * spacing, np.float64)


def make_grid(data: ProblemArrays, frame: RotatedFrame, span: tuple[float, float], stages: int) -> Grid:
    """Make a grid with square cells on the map, and with one layer at the altitude of the start.

    span: lowest and highest position across, m.
    stages: number of stages; fewer if the grid would have more than `MAX_CELLS` cells.
    """
    min_altitude, max_altitude = max(data.floor, float(np.nanmin(data.heights))), data.ceiling
    level_point = np.array([*data.destination[:2], data.start[2]])
    gentler_slope = math.tan(max(0.0, min(slope_limits(data, np.array(data.start), level_point))))
    spacing_ratio = min(MAX_LAYER_SPACING_STEPS, max(MIN_LAYER_SPACING_STEPS, gentler_slope / LAYERS_PER_STEP))
    while True:
        step = frame.length / stages
        layer_spacing = spacing_ratio * step
        width = math.floor(-span[0] / step) + math.floor(span[1] / step) + 1
        layer_numbers = np.arange(
            math.ceil((min_altitude - data.start[2]) / layer_spacing),
            math.floor((max_altitude - data.start[2]) / layer_spacing) + 1,
        )
        if stages <= 4 or (stages + 1) * width * max(1, layer_numbers.size) <= MAX_CELLS:
            return Grid(
                stages,
                positions_across(span, step, stages),
                np.asarray(data.start[2] + layer_numbers * layer_spacing, np.float64),
            )
        stages = max(4, int(stages / 1.2))


def grid_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: Grid,
    earlier_routes: tuple[GridRoute, ...] = (),
    expected_cost: float = math.inf,
    check_stop: Callable[[], None] = lambda: None,
) -> GridRoute | None:
    """Return the cheapest route over a grid; None if terrain and ceiling block every route.

    earlier_routes: routes near which a path costs more, so that the next route takes another side.
    expected_cost: upper limit on the cost with which the search is tried first, such as the cost on a coarser grid. If
        no route is found, a search without a limit follows.
    check_stop: called from time to time; an exception raised there stops the search.
    """
    if grid.layers.size == 0:
        return None
    along = np.linspace(0.0, frame.length, grid.stages + 1)
    extra = proximity_cost(along, grid.across, earlier_routes)
    for bound in (expected_cost, math.inf):
        cells, cost = cheapest_route(data, frame, grid, extra, bound, check_stop)
        if cells.size:
            points = np.column_stack([along, grid.across[cells["across"]], grid.layers[cells["layer"]]])
            return GridRoute(points, float(cost))
        if bound == math.inf:
            break
    return None


def proximity_cost(along: Floats, across: Floats, earlier_routes: tuple[GridRoute, ...]) -> Floats:
    """Return the additional cost per m near earlier routes, (s, y), to lead the next route elsewhere.

    along: (s,) positions along, m.
    across: (y,) positions across, m.

    Each earlier route adds 1 on the route itself, and less with the distance across from it.
    """
    extra = np.zeros((along.size, across.size))
    width = max(ROUTE_SPACING_M, ROUTE_SPACING_STEPS * along[-1] / (along.size - 1))
    for route in earlier_routes:
        stage_across = np.interp(along, route.points[:, 0], route.points[:, 1])
        extra += np.maximum(0.0, 1.0 - np.abs(across[None, :] - stage_across[:, None]) / width)
    return extra


def grid_routes(
    data: ProblemArrays,
    frame: RotatedFrame,
    span: tuple[float, float],
    grids: tuple[tuple[int, int], ...],
    check_stop: Callable[[], None] = lambda: None,
) -> Iterator[GridRoute]:
    """Yield the routes of each grid, cheapest first.

    frame: frame of the direct line.
    span: lowest and highest position across, m.
    grids: for each grid, its number of stages and its number of different routes.
    check_stop: called from time to time; an exception raised there stops the search.
    """
    expected_cost = EXPECTED_COST_RATIO * math.dist(data.start, data.destination)
    for stages, route_count in grids:
        grid = make_grid(data, frame, span, stages)
        earlier_routes: tuple[GridRoute, ...] = ()
        for _ in range(route_count):
            # A second route costs more than the first.
            route = grid_route(
                data, frame, grid, earlier_routes, math.inf if earlier_routes else expected_cost, check_stop
            )
            if route is None:
                break
            if not earlier_routes:
                expected_cost = route.cost
            earlier_routes = (*earlier_routes, route)
            yield route
