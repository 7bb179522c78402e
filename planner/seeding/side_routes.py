"""Find routes that pass obstacles on other sides than the cheapest route.

There is one route per choice of sides.

Two passes of dynamic programming run over the same grid, one from the start and one from the destination. The sum of
their costs in a cell is the cost of the cheapest route through this cell. The smallest sum to the left of an obstacle
is the cost of the cheapest of all routes that pass it on the left; the same two passes give this for every obstacle and
side.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.problem import ProblemArrays, required_clearance
from planner.evaluation.threat_index import make_missile_index
from planner.seeding.grids import (
    MAX_SIDE,
    ROUTE_CELL,
    SPAN,
    Grid,
    GridRoute,
    fill_goal_distances,
    find_obstacles,
    layers_per_step,
    make_grid,
    positions_across,
    prune_cells,
    relax_cells,
    relax_stage,
    set_cell_costs,
    trace_back,
)
from world.arrays import Codes, Floats, Ints
from world.kernels import Records, compiled, inlined, inner

# --- Costs of passing each obstacle on each side ---


# Sides on which a route passes an obstacle: quadrants around its centre.
LEFT = 0
RIGHT = 1
OVER = 2
UNDER = 3
# The cheapest route past an obstacle on one side: its cost (inf for none) and the cell through which it passes.
PASSING = np.dtype(
    [("cost", np.float64), ("stage", np.int64), ("layer", np.int64), ("across", np.int64)],
    align=True,
)


class GridCosts(NamedTuple):
    """Costs of the cheapest routes from the start to each grid cell, and from there to the destination.

    All arrays are (stages + 1, layers, across). The cost is inf for a cell on no route within the bound.

    start_costs: costs from the start, m.
    parents: the previous cell on that route, as layer x width + across.
    goal_costs: costs to the destination, m.
    successors: the next cell on that route, as layer x width + across.
    """

    start_costs: Floats
    parents: Codes
    goal_costs: Floats
    successors: Codes


@inner
def _relax_stage_back(
    next_costs: Floats,
    cell_costs: Floats,
    costs: Floats,
    successors: Codes,
    spans: Records,
    step_layers: Records,
    step: float,
    layer_spacing: float,
    ratio: float,
) -> None:
    """Compute the costs from the cells of a stage to the destination, from the costs of the next stage.

    next_costs: (layers, across) costs from the cells of the next stage to the destination.
    cell_costs: (layers, across) cost per m of the steps to the cells of the next stage.
    costs: (layers, across) array to fill: costs from the cells of this stage to the destination.
    successors: (layers, across) array to fill: cells of the next stage to which the cheapest routes lead.
    spans: `SPAN` records (layers,) of this stage's cells whose cost is within the route-cost bound.
    step_layers: steepest climb and descent from this stage, as `layers_per_step` returns them.
    step: length of a step along the line, m.
    layer_spacing: m.
    ratio: spacing across as a fraction of a step.
    """
    layer_count, width = next_costs.shape
    flat_next_costs = next_costs.ravel()
    flat_costs = costs.ravel()
    flat_successors = successors.ravel()
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
                    flat_next_costs,
                    flat_cell_costs,
                    flat_costs,
                    flat_successors,
                    target,
                    source,
                    target,
                    end_cell - first_cell,
                    length,
                )


@inner
def _drop_cells_above_bound(start_costs: Floats, goal_costs: Floats, spans: Records, bound: float) -> None:
    """Set `goal_costs` to inf for the cells of a stage that are on no route within the bound.

    start_costs, goal_costs: (layers, across) costs from the start and to the destination.
    spans: `SPAN` records (layers,) of the cells that the start can reach.
    bound: upper limit on the cost of a whole route.
    """
    for z in range(start_costs.shape[0]):
        for y in range(spans[z].first, spans[z].last + 1):
            if not start_costs[z, y] + goal_costs[z, y] <= bound:
                goal_costs[z, y] = math.inf


class SideSearch(NamedTuple):
    """State of a computation of `GridCosts`, which is continued stage by stage.

    Costs from the start are computed forwards, then costs to the destination backwards.

    step_layers: steepest climb and descent of a step, as `layers_per_step` returns them.
    cell_costs: cost per m of the cells, (stages + 1, layers, across).
    spans: `SPAN` records (stages + 1, layers) of the cells within the bound.
    stages_done: number of completed stages, forwards and then backwards; at the end twice the number of stages of the
        grid.
    """

    costs: GridCosts
    step_layers: Records
    obstacles: Records
    cell_costs: Floats
    spans: Records
    centre_index: int
    goal_layer: int
    stages_done: int


# Number of cells reached between two calls of `check_stop`: some 10 ms.
CELLS_PER_CHECK = 100_000


def grid_costs(
    data: ProblemArrays, frame: RotatedFrame, grid: Grid, bound: float, check_stop: Callable[[], None] = lambda: None
) -> GridCosts:
    """Compute the costs of the cheapest routes to each cell of a grid, and on to the destination.

    bound: upper limit on the cost of a whole route.
    check_stop: called after every `CELLS_PER_CHECK` cells; an exception raised there stops the search.
    """
    stages = max(1, CELLS_PER_CHECK // (grid.across.size * grid.layers.size))
    search: SideSearch = begin_grid_costs(data, frame, grid)
    while search.stages_done < 2 * grid.stages:
        search = continue_grid_costs(data, frame, grid, bound, search, stages)
        check_stop()
    return search.costs


@compiled
def begin_grid_costs(data: ProblemArrays, frame: RotatedFrame, grid: Grid) -> SideSearch:
    """Make the state of a computation of `GridCosts`, before its first stage."""
    stages, width, layer_count = grid.stages, grid.across.size, grid.layers.size
    step = frame.length / stages
    shape = (stages + 1, layer_count, width)
    centre_index, start_layer = int(np.argmin(np.abs(grid.across))), int(np.argmin(np.abs(grid.layers - data.start[2])))
    start_costs, goal_costs = np.full(shape, np.inf), np.full(shape, np.inf)
    spans = np.zeros((stages + 1, layer_count), dtype=SPAN)
    for z in range(layer_count):
        spans[0, z].first, spans[0, z].last = (centre_index, centre_index) if z == start_layer else (width, -1)
    start_costs[0, start_layer, centre_index] = 0.0
    return SideSearch(
        GridCosts(start_costs, np.zeros(shape, dtype=np.int32), goal_costs, np.zeros(shape, dtype=np.int32)),
        layers_per_step(data, frame, step, grid.layers, grid.ratio),
        find_obstacles(data, frame, step, grid.shrink),
        np.full(shape, np.inf),
        spans,
        centre_index,
        int(np.argmin(np.abs(grid.layers - data.destination[2]))),
        0,
    )


@compiled
def continue_grid_costs(
    data: ProblemArrays, frame: RotatedFrame, grid: Grid, bound: float, search: SideSearch, max_stages: int
) -> SideSearch:
    """Continue a computation by up to `max_stages` stages, or end it early; return its state.

    bound: upper limit on the cost of a route.
    search: state of the computation; its arrays are overwritten.

    The first half of the stages computes the costs from the start forwards, the second half the costs to the
    destination. The computation ends early if no route can continue.
    """
    stages, width, layer_count = grid.stages, grid.across.size, grid.layers.size
    step, required = frame.length / stages, required_clearance(data)
    layer_spacing = grid.layers[1] - grid.layers[0] if layer_count > 1 else 1.0
    costs, step_layers, obstacles, cell_costs, spans, centre_index, goal_layer, stages_done = search
    start_costs, parents, goal_costs, successors = costs
    height_differences = grid.layers - grid.layers[goal_layer]
    goal_distances = np.empty(width)
    extra = np.zeros((stages + 1, width))
    end_number = min(2 * stages, stages_done + max_stages)
    for step_number in range(stages_done, end_number):
        stage = step_number + 1
        if stage <= stages:
            first, last = width, -1
            for z in range(layer_count):
                first, last = min(first, spans[stage - 1, z].first), max(last, spans[stage - 1, z].last)
            first, last = max(0, first - MAX_SIDE), min(width - 1, last + MAX_SIDE)
            if first > last:
                end_number = 2 * stages
                break
            set_cell_costs(data, required, frame, stage, obstacles, grid, extra, first, last, cell_costs[stage])
            previous_costs, stage_costs = start_costs[stage - 1], start_costs[stage]
            relax_stage(
                previous_costs,
                stage_costs,
                parents[stage],
                spans[stage - 1],
                step_layers,
                cell_costs[stage],
                step,
                layer_spacing,
                grid.ratio,
            )
            fill_goal_distances(width, centre_index, stages - stage, step, grid.ratio, goal_distances)
            prune_cells(start_costs[stage], spans[stage], goal_distances, height_differences, bound, first, last)
            continue
        if step_number == stages:
            goal_costs[stages, goal_layer, centre_index] = 0.0
        stage = 2 * stages - 1 - step_number
        next_costs, stage_costs = goal_costs[stage + 1], goal_costs[stage]
        _relax_stage_back(
            next_costs,
            cell_costs[stage + 1],
            stage_costs,
            successors[stage],
            spans[stage],
            step_layers,
            step,
            layer_spacing,
            grid.ratio,
        )
        _drop_cells_above_bound(start_costs[stage], goal_costs[stage], spans[stage], bound)
    return SideSearch(costs, step_layers, obstacles, cell_costs, spans, centre_index, goal_layer, end_number)


@inlined
def passing_side(lateral_offset: float, vertical_offset: float) -> int:
    """Return the side on which a point passes an obstacle: LEFT, RIGHT, OVER or UNDER.

    lateral_offset, vertical_offset: offset of the point to the left of the obstacle's centre, and above the centre, m.
    """
    if abs(lateral_offset) >= abs(vertical_offset):
        return LEFT if lateral_offset >= 0.0 else RIGHT
    return OVER if vertical_offset > 0.0 else UNDER


@compiled
def cheapest_passings(costs: GridCosts, grid: Grid, obstacles: Records, step: float) -> Records:
    """Find the cheapest route past each obstacle on each side: `PASSING` records (obstacles, 4).

    The sides are those of `passing_side`. A route passes an obstacle at the stage that is nearest to the obstacle's
    centre. An obstacle beyond the ends of the grid is not passed, and has the cost inf.

    costs: costs of the cheapest routes from the start to each cell, and from there to the destination.
    obstacles: `OBSTACLE` records.
    step: length of a step along the line, m.
    """
    passings = np.zeros((obstacles.shape[0], 4), dtype=PASSING)
    for k in range(obstacles.shape[0]):
        obstacle, stage = obstacles[k], round(obstacles[k].along / step)
        for side in range(4):
            passings[k, side].cost = math.inf
        if not 0 < stage < grid.stages:
            continue
        for z in range(grid.layers.size):
            for y in range(grid.across.size):
                cost = costs.start_costs[stage, z, y] + costs.goal_costs[stage, z, y]
                if cost == math.inf:
                    continue
                passing = passings[k, passing_side(grid.across[y] - obstacle.across, grid.layers[z] - obstacle.up)]
                if cost < passing.cost:
                    passing.cost = cost
                    passing.stage = stage
                    passing.layer = z
                    passing.across = y
    return passings


@compiled
def route_through(costs: GridCosts, stage: int, layer: int, across: int) -> Records:
    """Return `ROUTE_CELL` records (stages + 1,) of the cheapest route through a given cell.

    costs: costs from the start and to the destination, with the neighbours on the cheapest routes.
    stage, layer, across: the cell.
    """
    last_stage, width = costs.successors.shape[0] - 1, costs.successors.shape[2]
    cells = np.zeros(last_stage + 1, dtype=ROUTE_CELL)
    previous_cells = trace_back(costs.parents[: stage + 1], layer, across)
    for index in range(stage + 1):
        cells[index] = previous_cells[index]
    for index in range(stage, last_stage):
        next_cell = costs.successors[index, layer, across]
        layer, across = next_cell // width, next_cell % width
        cells[index + 1].layer, cells[index + 1].across = layer, across
    return cells


# --- Routes of different sides ---

# Routes with a mean lateral distance below this are the same route, m.
SAME_ROUTE_DISTANCE_M = 100.0


def sides_passed(points: Floats, obstacles: Records) -> Ints:
    """Return the side on which a route passes each obstacle, (k,); -1 for an obstacle it does not pass.

    points: (s, 3) along, across, up, m.
    obstacles: `OBSTACLE` records (k,).

    A route does not pass an obstacle beyond its ends. Two routes with the same sides can be deformed into each other
    without touching an obstacle. Routes with different sides are treated as different, although a route over a sphere
    on the ground could be moved to either side of it.
    """
    step = points[1, 0] - points[0, 0]
    stages = np.rint(obstacles["along"] / step).astype(np.int64)
    is_beyond_end = (stages <= 0) | (stages >= len(points) - 1)
    nearest_points = points[np.clip(stages, 0, len(points) - 1)]
    lateral_offsets = nearest_points[:, 1] - obstacles["across"]
    vertical_offsets = nearest_points[:, 2] - obstacles["up"]
    horizontal_sides = np.where(lateral_offsets >= 0.0, LEFT, RIGHT)
    sides = np.where(
        np.abs(lateral_offsets) >= np.abs(vertical_offsets),
        horizontal_sides,
        np.where(vertical_offsets > 0.0, OVER, UNDER),
    )
    return np.where(is_beyond_end, -1, sides)


def side_routes(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: Grid,
    bound: float,
    max_routes: int,
    check_stop: Callable[[], None] = lambda: None,
) -> list[GridRoute]:
    """Return routes that pass the obstacles on different sides, cheapest first.

    bound: upper limit on the cost.
    max_routes: maximum number of routes.
    check_stop: called from time to time; an exception raised there stops the search.

    Each route is the cheapest route past one obstacle on one side; the first route is the cheapest of all. Among routes
    close to each other, only the cheapest is returned.
    """
    if grid.layers.size == 0:
        return []
    step = frame.length / grid.stages
    costs = grid_costs(data, frame, grid, bound, check_stop)
    obstacles = find_obstacles(data, frame, step, grid.shrink)
    passings = cheapest_passings(costs, grid, obstacles, step).ravel()
    passings = passings[np.isfinite(passings["cost"])]
    along = np.linspace(0.0, frame.length, grid.stages + 1)
    routes: list[GridRoute] = []
    known_sides: set[bytes] = set()
    for passing in passings[np.argsort(passings["cost"], kind="stable")]:
        cells = route_through(costs, passing["stage"], passing["layer"], passing["across"])
        points = np.column_stack([along, grid.across[cells["across"]], grid.layers[cells["layer"]]])
        sides = sides_passed(points, obstacles).tobytes()
        if sides in known_sides:
            continue
        known_sides.add(sides)
        if any(np.abs(points[:, 1] - route.points[:, 1]).mean() < SAME_ROUTE_DISTANCE_M for route in routes):
            continue
        routes.append(GridRoute(points, float(passing["cost"])))
        if len(routes) == max_routes:
            break
    return routes


def closest_places(data: ProblemArrays, path: Floats, distance: float) -> Floats:
    """Find the points of a path (w, 3) that are too close to missile spheres, the closest first, (k, 3) m.

    distance: required distance from the spheres, m.

    Each leg has at most one point for each sphere: the one that is closest to the sphere.
    """
    threats = data.threats[data.threats["kill_radius"] > 0.0]
    centres = np.column_stack([threats["east"], threats["north"], threats["up"]])
    legs, offsets = np.diff(path, axis=0)[:, None], centres - path[:-1, None]
    fractions = (offsets * legs).sum(axis=2) / np.maximum(1e-9, (legs**2).sum(axis=2))
    points = path[:-1, None] + np.clip(fractions, 0.0, 1.0)[..., None] * legs
    distances = np.sqrt(((points - centres) ** 2).sum(axis=2)) - threats["kill_radius"]
    is_close = distances < distance
    return np.asarray(points[is_close][np.argsort(distances[is_close], kind="stable")])


def close_places(data: ProblemArrays, places: Floats, radius: float) -> ProblemArrays:
    """Add missile spheres around places (k, 3) to the data, so that grids and lattices avoid them.

    radius: radius of the spheres, m.
    """
    closed = np.zeros(len(places), dtype=data.threats.dtype)
    closed["east"], closed["north"], closed["up"] = places.T
    closed["kill_radius"] = closed["kill_scale"] = radius
    threats = np.concatenate([data.threats, closed])
    # Read-only like a scenario's threats: for a writable array the kernels would be compiled again.
    threats.setflags(write=False)
    return data._replace(threats=threats, missiles=make_missile_index(threats))


def optimistic_grid(
    data: ProblemArrays,
    frame: RotatedFrame,
    span: tuple[float, float],
    stages: int,
    *,
    shrink: float,
    spread: float,
    ratio: float,
) -> Grid:
    """Make a grid that underestimates threats and terrain, so that its routes also use narrow gaps.

    frame: frame of the direct line from start to destination.
    span: smallest and largest offset of the cells across the line, m.
    stages: number of stages along the line.
    shrink: fraction of a step by which the kill spheres are reduced.
    spread: fraction of a step around a cell over which the highest ground is taken.
    ratio: spacing across as a fraction of a step.

    The highest layer is at the ceiling, where the spheres of missiles on the ground are narrowest.
    """
    square_grid = make_grid(data, frame, span, stages)
    step = ratio * frame.length / square_grid.stages
    across = positions_across(span, step, square_grid.stages)
    layers, start_altitude = square_grid.layers, data.start[2]
    if data.ceiling > start_altitude and layers.size > 1:
        layer_spacing = (data.ceiling - start_altitude) / math.ceil(
            (data.ceiling - start_altitude) / (layers[1] - layers[0])
        )
        layers = (
            start_altitude
            + np.arange(
                -math.floor((start_altitude - layers[0]) / layer_spacing),
                round((data.ceiling - start_altitude) / layer_spacing) + 1,
            )
            * layer_spacing
        )
    return square_grid._replace(across=across, layers=layers, shrink=shrink, spread=spread, ratio=ratio)
