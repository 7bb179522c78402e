"""Find cheapest routes over grids among zones and below a maximum height above ground.

The grids are in the rotated frame.

Dynamic programming over forward steps as in `planner.seeding.grids`, with two differences. If there is a maximum height
above ground, the layers follow the terrain. Each step as a whole is tested against the zones, because an obstacle
between two cells may be narrower than their spacing.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from planner.airspace.zone_distances import penetration_depth
from planner.airspace.zone_limits import MapSegment, ZonesWithMargins, first_exclusion_near, segment_between, view_shape
from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem import ProblemArrays, clearance_at, required_clearance, required_headroom
from planner.seeding.grids import (
    EXPECTED_COST_RATIO,
    KILL_COST,
    LAYERS_PER_STEP,
    MAX_SIDE,
    GridRoute,
    fill_goal_distances,
    find_obstacles,
    positions_across,
    proximity_cost,
    to_world_position,
)
from world.arrays import Codes, Floats
from world.kernels import Record, Records, compiled, inner
from world.terrain import ground_height

# Additional cost per m at the edges of the height band, relative to its middle: legs are longer than grid steps.
EDGE_COST = 0.3
# Cost of a change of course on a gentle grid, in grid steps per squared change of the lateral step.
TURN_COST = 0.15
# Fraction of the steepest slopes that a route on a gentle grid uses, because legs cut its corners.
GENTLE_SLOPE_FRACTION = 0.9
# A grid column: its ground and the lowest and highest allowed altitude, m; lowest > highest if none is allowed.
COLUMN = np.dtype([("ground", np.float64), ("lowest", np.float64), ("highest", np.float64)])


class AirspaceGrid(NamedTuple):
    """Grid of one resolution: positions across at stages + 1 positions along, and layers of height.

    A stage is the step from one position along to the next.

    stages: number of stages.
    across: (across,) positions across, m from the line.
    layers: number of layers.
    layer_spacing: m.
    follows: True if the layers follow the ground: the first layer is at the lowest allowed altitude of each column.
    floor: altitude of the first layer if the layers do not follow the ground, m.
    gentle: True if changes of course have a cost and slopes stay below the steepest possible slopes.
    """

    stages: int
    across: Floats
    layers: int
    layer_spacing: float
    follows: bool
    floor: float
    gentle: bool = False


class _ClosedHeights(NamedTuple):
    """Range of altitudes that zones close to a step, from low to high, m AMSL; low > high for none."""

    low: float
    high: float


@inner
def _fill_column(
    data: ProblemArrays, frame: RotatedFrame, grid: AirspaceGrid, along: float, across: float, column: Record
) -> None:
    """Fill the `COLUMN` record of a grid position: its ground and its range of allowed altitudes.

    along, across: position in the rotated frame, m.
    column: the record to fill; its lowest altitude exceeds its highest outside the area and above unknown ground.

    The range obeys the floor, the ceiling, the clearance, and the limits of inclusion zones.
    """
    east, north = to_world_position(frame, along, across)
    column.lowest, column.highest = math.inf, -math.inf
    if not (data.west <= east <= data.east and data.south <= north <= data.north):
        return
    ground = ground_height(data.heights, data.to_pixel, east, north)
    if math.isnan(ground):
        return
    column.ground = ground
    column.lowest = max(data.floor, ground + clearance_at(required_clearance(data), east, north))
    column.highest = data.ceiling
    if grid.follows:
        column.highest = min(data.ceiling, ground - clearance_at(required_headroom(data), east, north))
    zones = data.airspace.zones
    for z in range(zones.inclusions):
        zone, margin = zones.records.zones[z], zones.required[z]
        column.lowest = max(column.lowest, zone.floor + margin.vertical + (ground if zone.floor_above_ground else 0.0))
        zone_top = zone.ceiling - margin.vertical + (ground if zone.ceiling_above_ground else 0.0)
        column.highest = min(column.highest, zone_top)


@inner
def _closed_heights(zones: ZonesWithMargins, line: MapSegment, lateral: float, ground: float) -> _ClosedHeights:
    """Return the range of altitudes at which zones block a step, m AMSL.

    line: the step on the map.
    lateral: tracking error to add to the zones' margins, m.
    ground: altitude of the ground at the start of the step, m, from which a zone's heights above ground are measured.

    If several exclusions block it, the range reaches from the lowest floor to the highest ceiling. If an inclusion
    blocks it, all altitudes are closed. If nothing blocks it, the range is empty: inf to -inf.
    """
    low, high = math.inf, -math.inf
    for z in range(zones.inclusions):
        required_distance = zones.required[z].horizontal + lateral
        view = view_shape(zones.records, z, line, required_distance)
        if not view.inside or view.distance < required_distance:
            return _ClosedHeights(-math.inf, math.inf)
    max_margin = zones.max_horizontal + lateral
    to_east, to_north = line.east + line.length * line.course_east, line.north + line.length * line.course_north
    west, east = min(line.east, to_east) - max_margin, max(line.east, to_east) + max_margin
    south, north = min(line.north, to_north) - max_margin, max(line.north, to_north) + max_margin
    for z in range(first_exclusion_near(zones, west), zones.required.shape[0]):
        zone, margin = zones.records.zones[z], zones.required[z]
        if zone.west > east:
            break
        if zone.east < west or zone.south > north or zone.north < south:
            continue
        depth, _, _ = penetration_depth(zones.records, z, line, margin.horizontal + lateral)
        if depth > 0.0:
            low = min(low, zone.floor - margin.vertical + (ground if zone.floor_above_ground else 0.0))
            high = max(high, zone.ceiling + margin.vertical + (ground if zone.ceiling_above_ground else 0.0))
    return _ClosedHeights(low, high)


@inner
def _step_slopes(data: ProblemArrays, frame: RotatedFrame, step: float, amsl: float, fraction: float) -> Floats:
    """Return the tangents of the steepest climb and dive for steps of each direction.

    step: length of a cell, m.
    amsl: altitude of the slope limits, m.
    fraction: fraction of the limits that may be used.

    Returns (2 * MAX_SIDE + 1, 2): row `MAX_SIDE + k` is for the step that goes one cell forward and k cells to the
    side.
    """
    slopes, a, b = np.zeros((2 * MAX_SIDE + 1, 2)), np.zeros(3), np.zeros(3)
    a[0], a[1] = frame.east, frame.north
    a[2], b[2] = amsl, amsl
    for side in range(-MAX_SIDE, MAX_SIDE + 1):
        b[0], b[1] = to_world_position(frame, step, side * step)
        climb, dive = slope_limits(data, a, b)
        slopes[side + MAX_SIDE, 0] = fraction * math.tan(climb)
        slopes[side + MAX_SIDE, 1] = fraction * math.tan(dive)
    return slopes


@inner
def _set_layer_costs(
    grid: AirspaceGrid,
    columns: Records,
    obstacles: Records,
    along: float,
    extra: Floats,
    first_across: int,
    last_across: int,
    cell_costs: Floats,
) -> None:
    """Fill the cost per m of path in the cells of a stage; inf outside the range of allowed altitudes.

    columns: `COLUMN` records (across,) of the stage, with the range of allowed altitudes.
    obstacles: `OBSTACLE` records: kill spheres in the rotated frame.
    along: position of the stage, m.
    extra: (across,) additional cost per m.
    first_across, last_across: range of cells across, both included.
    cell_costs: (across, layers) array to fill.

    The cost increases towards the edges of the band of allowed heights above ground, and inside kill spheres.
    """
    near_obstacles, horizontal2 = np.empty(obstacles.shape[0], dtype=np.int64), np.empty(obstacles.shape[0])
    for y in range(first_across, last_across + 1):
        column, count = columns[y], 0
        for k in range(obstacles.shape[0]):
            obstacle = obstacles[k]
            horizontal2[count] = (along - obstacle.along) ** 2 + (grid.across[y] - obstacle.across) ** 2
            if horizontal2[count] < obstacle.radius * obstacle.radius:
                near_obstacles[count] = k
                count += 1
        first_height = column.lowest if grid.follows else grid.floor
        mid_height, half_height = 0.5 * (column.lowest + column.highest), 0.5 * (column.highest - column.lowest)
        for z in range(grid.layers):
            height = first_height + z * grid.layer_spacing
            if not column.lowest <= height <= column.highest:
                cell_costs[y, z] = math.inf
                continue
            cell_costs[y, z] = 1.0 + extra[y]
            if grid.follows:
                cell_costs[y, z] += EDGE_COST * ((height - mid_height) / max(half_height, 1e-6)) ** 2
            for n in range(count):
                obstacle = obstacles[near_obstacles[n]]
                distance2 = horizontal2[n] + (height - obstacle.up) ** 2
                if distance2 < obstacle.radius * obstacle.radius:
                    cell_costs[y, z] += KILL_COST * (3.0 - 2.0 * math.sqrt(distance2) / obstacle.radius)


@inner
def _relax_airspace_stage(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: AirspaceGrid,
    stage: int,
    previous_columns: Records,
    columns: Records,
    cost: Floats,
    cell_costs: Floats,
    next_cost: Floats,
    previous_parents: Codes,
    parents: Codes,
) -> None:
    """Extend all routes by one step to the next stage; keep the cheapest route to each of its cells.

    previous_columns, columns: `COLUMN` records (across,) of the previous stage and of this stage.
    cost, next_cost: (across, layers) costs of the routes to the cells of the previous stage and this stage (updated).
    cell_costs: (across, layers) cost per m of the steps to this stage; a change of course costs extra.
    previous_parents, parents: (across, layers) cells from which these routes come: across x layers + layer (updated).
    """
    step, width, zones, spacing = frame.length / grid.stages, grid.across.size, data.airspace.zones, grid.layer_spacing
    lateral = 0.0 if stage in (1, grid.stages) else float(data.tracking.across)  # No tracking error at a fixed end.
    turn_cost, slope_fraction = (TURN_COST * step, GENTLE_SLOPE_FRACTION) if grid.gentle else (0.0, 1.0)
    slopes = _step_slopes(data, frame, step, 0.5 * (data.start[2] + data.destination[2]), slope_fraction)
    for y in range(width):
        if not np.isfinite(cost[y]).any():
            continue
        east, north = to_world_position(frame, (stage - 1) * step, grid.across[y])
        first_height = previous_columns[y].lowest if grid.follows else grid.floor
        for side in range(-MAX_SIDE, MAX_SIDE + 1):
            target = y + side
            if not 0 <= target < width or columns[target].lowest > columns[target].highest:
                continue
            target_first_height = columns[target].lowest if grid.follows else grid.floor
            horizontal_length = step * math.sqrt(1.0 + side * side)
            end_east, end_north = to_world_position(frame, stage * step, grid.across[target])
            closed_heights = _ClosedHeights(math.inf, -math.inf)
            if zones.required.shape[0] > 0:
                leg = segment_between(east, north, end_east, end_north)
                closed_heights = _closed_heights(zones, leg, lateral, previous_columns[y].ground)
            climb, dive = slopes[side + MAX_SIDE, 0] * horizontal_length, slopes[side + MAX_SIDE, 1] * horizontal_length
            for z in range(grid.layers):
                if cost[y, z] == math.inf:
                    continue
                height = first_height + z * spacing
                course_change = 0 if stage == 1 else side - (y - previous_parents[y, z] // grid.layers)
                base_cost = cost[y, z] + turn_cost * course_change * course_change
                lowest_layer = max(0, math.ceil((height - dive - target_first_height) / spacing))
                highest_layer = min(grid.layers - 1, math.floor((height + climb - target_first_height) / spacing))
                for next_z in range(lowest_layer, highest_layer + 1):
                    # A step is at least as long as a level step; most cost too much even then, and need no square root.
                    if base_cost + horizontal_length * cell_costs[target, next_z] >= next_cost[target, next_z]:
                        continue
                    altitude_change = target_first_height + next_z * spacing - height
                    end_height = height + altitude_change
                    if max(height, end_height) > closed_heights.low and min(height, end_height) < closed_heights.high:
                        continue
                    length = math.sqrt(horizontal_length * horizontal_length + altitude_change * altitude_change)
                    total = base_cost + length * cell_costs[target, next_z]
                    if total < next_cost[target, next_z]:
                        next_cost[target, next_z] = total
                        parents[target, next_z] = y * grid.layers + z


class AirspaceSearch(NamedTuple):
    """State of a search for the cheapest route over a grid, which is continued stage by stage.

    obstacles: `OBSTACLE` records.
    columns: `COLUMN` records (stages + 1, across).
    cells: (stages + 1, across, layers), the parent of each cell, as across x layers + layer.
    cost: (across, layers) costs of the routes to the cells of the last stage reached.
    next_cost, cell_costs: working memory.
    centre_index: index across of both ends.
    stage: the last stage reached.
    """

    obstacles: Records
    columns: Records
    cells: Codes
    cost: Floats
    next_cost: Floats
    cell_costs: Floats
    centre_index: int
    stage: int


# Number of cells reached between two calls of `check_stop`: some 20 ms at most.
CELLS_PER_CHECK = 100_000


def cheapest_airspace_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: AirspaceGrid,
    extra: Floats,
    bound: float,
    check_stop: Callable[[], None] = lambda: None,
) -> tuple[Floats, float]:
    """Find the cheapest route over a grid; return its points and its cost.

    extra: (stages + 1, across) additional cost per m.
    bound: upper limit on the cost of the route; dearer routes are not found.
    check_stop: called after every `CELLS_PER_CHECK` cells; an exception raised there stops the search.

    The points are along, across and up, (stages + 1, 3) m. Without a route, they are (0, 3) and the cost is inf.
    """
    stages = max(1, CELLS_PER_CHECK // (grid.across.size * grid.layers))
    search: AirspaceSearch = begin_airspace_route(data, frame, grid)
    while search.stage < grid.stages:
        search = continue_airspace_route(data, frame, grid, extra, bound, search, stages)
        check_stop()
    points, cost = end_airspace_route(data, frame, grid, search)
    return points, cost


@compiled
def begin_airspace_route(data: ProblemArrays, frame: RotatedFrame, grid: AirspaceGrid) -> AirspaceSearch:
    """Make a search for the cheapest route, before its first stage, with the cost 0 at the start."""
    stages, width, step = grid.stages, grid.across.size, frame.length / grid.stages
    centre_index = int(np.argmin(np.abs(grid.across)))
    columns = np.zeros((stages + 1, width), dtype=COLUMN)
    for y in range(width):
        _fill_column(data, frame, grid, 0.0, grid.across[y], columns[0, y])
    cost = np.full((width, grid.layers), math.inf)
    cost[centre_index, _nearest_layer(grid, columns[0, centre_index], data.start[2])] = 0.0
    return AirspaceSearch(
        find_obstacles(data, frame, step),
        columns,
        np.full((stages + 1, width, grid.layers), -1, dtype=np.int32),
        cost,
        np.full((width, grid.layers), math.inf),
        np.full((width, grid.layers), math.inf),
        centre_index,
        0,
    )


@compiled
def continue_airspace_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: AirspaceGrid,
    extra: Floats,
    bound: float,
    search: AirspaceSearch,
    max_stages: int,
) -> AirspaceSearch:
    """Continue a search by up to `max_stages` stages, or until no route can continue; return its state.

    extra: (stages + 1, across) additional cost per m of path in each position.
    bound: upper limit on the cost of the route; cells that only dearer routes can use are dropped.
    search: state of the search; its arrays are overwritten.
    """
    stages, width, step = grid.stages, grid.across.size, frame.length / grid.stages
    obstacles, columns, cells, cost, next_cost, cell_costs, centre_index, reached_stage = search
    last_stage, goal_distances = min(stages, reached_stage + max_stages), np.empty(width)
    for stage in range(reached_stage + 1, last_stage + 1):
        along, first, last = stage * step, width, -1
        for y in range(width):
            if cost[y].min() < math.inf:
                first, last = min(first, y), max(last, y)
        if first > last:
            # No cell of the previous stage is reached, so the last stage cannot be reached either.
            last_stage = stages
            break
        first, last = max(0, first - MAX_SIDE), min(width - 1, last + MAX_SIDE)
        for y in range(first, last + 1):
            _fill_column(data, frame, grid, along, grid.across[y], columns[stage, y])
        _set_layer_costs(grid, columns[stage], obstacles, along, extra[stage], first, last, cell_costs)
        if stage == stages:
            cell_costs[centre_index, _nearest_layer(grid, columns[stage, centre_index], data.destination[2])] = 1.0
        next_cost[:] = math.inf
        _relax_airspace_stage(
            data,
            frame,
            grid,
            stage,
            columns[stage - 1],
            columns[stage],
            cost,
            cell_costs,
            next_cost,
            cells[stage - 1],
            cells[stage],
        )
        fill_goal_distances(width, centre_index, stages - stage, step, 1.0, goal_distances)
        for y in range(first, last + 1):
            for z in range(grid.layers):
                if goal_distances[y] == math.inf or next_cost[y, z] + goal_distances[y] > bound:
                    next_cost[y, z] = math.inf
        cost, next_cost = next_cost, cost
    return AirspaceSearch(obstacles, columns, cells, cost, next_cost, cell_costs, centre_index, last_stage)


@compiled
def end_airspace_route(
    data: ProblemArrays, frame: RotatedFrame, grid: AirspaceGrid, search: AirspaceSearch
) -> tuple[Floats, float]:
    """Trace the route that a search found; return its points and its cost.

    grid: grid that was searched.
    search: the search after its last stage.

    The points are along, across and up, (stages + 1, 3) m. Without a route, they are (0, 3) and the cost is inf.
    """
    stages = grid.stages
    step = frame.length / grid.stages
    columns = search.columns
    y = search.centre_index
    z = _nearest_layer(grid, columns[stages, y], data.destination[2])
    total = search.cost[y, z]
    if total == math.inf:
        return np.empty((0, 3)), math.inf
    points = np.empty((stages + 1, 3))
    for stage in range(stages, -1, -1):
        first_height = columns[stage, y].lowest if grid.follows else grid.floor
        points[stage, 0] = stage * step
        points[stage, 1] = grid.across[y]
        points[stage, 2] = first_height + z * grid.layer_spacing
        if stage > 0:
            parent = search.cells[stage, y, z]
            y, z = parent // grid.layers, parent % grid.layers
    return points, total


@inner
def _nearest_layer(grid: AirspaceGrid, column: Record, height: float) -> int:
    """Return the index of the layer nearest to an altitude in a `COLUMN` record.

    height: the altitude, m AMSL.
    """
    first_height = column.lowest if grid.follows else grid.floor
    return min(grid.layers - 1, max(0, round((height - first_height) / grid.layer_spacing)))


# --- Grids and routes ---

# Factor on the number of stages of a grid without zones: hills and gaps need short steps.
STAGE_FACTOR = 2
# Bound on the cost of a first route, relative to the first route on the previous grid. A route on a finer grid may cost
# a little more, as it is freer to turn; the bound saves work and does not change the route.
FINER_COST_RATIO = 1.05
# Minimum number of layers of a band of heights above ground.
MIN_LAYERS = 8
# Maximum number of layers of a band of heights above ground.
MAX_LAYERS = 24
# Minimum spacing of layers that do not follow the ground, as a fraction of the step along.
MIN_LAYER_SPACING_STEPS = 0.05
# Maximum number of cells of a grid: stages x across x layers.
MAX_CELLS = 1_200_000


def airspace_grid(data: ProblemArrays, frame: RotatedFrame, span: tuple[float, float], stages: int) -> AirspaceGrid:
    """Make a grid for a problem with zones or a maximum height.

    span: lowest and highest position across, m.
    stages: number of stages; fewer if the grid would have more than `MAX_CELLS` cells.
    """
    level_point = np.array([*data.destination[:2], data.start[2]])
    gentler_slope = math.tan(max(0.0, min(slope_limits(data, np.array(data.start), level_point))))
    space = data.airspace
    band_height = space.max_height - space.buffer - data.clearance - data.buffer
    min_altitude = max(data.floor, float(np.nanmin(data.heights)) + data.clearance)
    follows_ground = math.isfinite(band_height)
    while True:
        step = frame.length / stages
        width = math.floor(-span[0] / step) + math.floor(span[1] / step) + 1
        layer_spacing = max(1.0, gentler_slope * step / LAYERS_PER_STEP)
        if follows_ground:
            layers = min(MAX_LAYERS, max(MIN_LAYERS, math.ceil(band_height / layer_spacing) + 1))
            # Near an end with smaller buffers the band is wider.
            max_band_height = space.max_height - data.clearance
            layer_spacing = max(1.0, band_height) / (layers - 1)
            layers = max(layers, min(2 * MAX_LAYERS, math.ceil(max_band_height / layer_spacing) + 1))
        else:
            layer_spacing = max(layer_spacing, MIN_LAYER_SPACING_STEPS * step)
            layers = max(1, math.floor((data.ceiling - min_altitude) / layer_spacing) + 1)
        if stages <= 8 or (stages + 1) * width * layers <= MAX_CELLS:
            across = positions_across(span, step, stages)
            return AirspaceGrid(stages, across, layers, layer_spacing, follows_ground, min_altitude, gentle=True)
        stages = max(8, int(stages / 1.2))


def airspace_routes(
    data: ProblemArrays,
    frame: RotatedFrame,
    span: tuple[float, float],
    grids: tuple[tuple[int, int], ...],
    check_stop: Callable[[], None] = lambda: None,
) -> Iterator[GridRoute]:
    """Yield routes over grids, for a problem with zones or a maximum height.

    span: lowest and highest position across, m.
    grids: for each grid, its number of stages (multiplied by `STAGE_FACTOR`) and its number of different routes.
    check_stop: called from time to time; an exception raised there stops the search.

    Grids are gentle (see `AirspaceGrid`), because their routes are easier to fly. The first grid is searched without
    this restriction before that, because narrow gaps may require steep or curved routes.
    """
    expected_cost = EXPECTED_COST_RATIO * math.dist(data.start, data.destination)
    for index, (stages, route_count) in enumerate(grids):
        grid = airspace_grid(data, frame, span, STAGE_FACTOR * stages)
        if index == 0:
            route = _find_route(data, frame, grid._replace(gentle=False), (), expected_cost, check_stop)
            if route is not None:
                yield route
        earlier_routes: tuple[GridRoute, ...] = ()
        for _ in range(route_count):
            route = _find_route(
                data,
                frame,
                grid,
                earlier_routes,
                math.inf if earlier_routes else FINER_COST_RATIO * expected_cost,
                check_stop,
            )
            if route is None:
                break
            expected_cost = expected_cost if earlier_routes else route.cost
            earlier_routes = (*earlier_routes, route)
            yield route


def _find_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: AirspaceGrid,
    earlier_routes: tuple[GridRoute, ...],
    expected_cost: float,
    check_stop: Callable[[], None],
) -> GridRoute | None:
    """Return the cheapest route over a grid that keeps away from earlier routes; None without one.

    earlier_routes: routes near which a path costs more.
    expected_cost: upper limit on the cost with which the search is tried first; the second search has no limit.
    check_stop: called from time to time; an exception raised there stops the search.
    """
    extra = proximity_cost(np.linspace(0.0, frame.length, grid.stages + 1), grid.across, earlier_routes)
    for bound in (expected_cost, math.inf):
        points, cost = cheapest_airspace_route(data, frame, grid, extra, bound, check_stop)
        if len(points):
            return GridRoute(points, float(cost))
        if bound == math.inf:
            break
    return None
