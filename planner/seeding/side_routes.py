"""Routes that pass obstacles on other sides than the cheapest does: one of each choice of sides, cheapest first."""

import math

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.grid_prices import Grid, find_obstacles
from planner.seeding.grid_routes import GridRoute, make_grid
from planner.seeding.side_kernels import LEFT, OVER, RIGHT, UNDER, cheapest_passings, grid_costs, route_through
from world.kernels import Records

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Routes that are nearer to each other than this on average, across, are one way: m.
SAME_WAY = 100.0


def sides_passed(points: Floats, obstacles: Records) -> Ints:
    """Sides (k,) on which a route's points (s, 3) along, across, up pass `OBSTACLE` records; -1 beyond its ends.

    Two routes of the same sides can be bent into each other without touching an obstacle; it is taken that others
    cannot, though a way over a sphere on the ground can be bent to either side.
    """
    step = points[1, 0] - points[0, 0]
    stages = np.rint(obstacles["along"] / step).astype(np.int64)
    beyond = (stages <= 0) | (stages >= len(points) - 1)
    at = points[np.clip(stages, 0, len(points) - 1)]
    aside, above = at[:, 1] - obstacles["across"], at[:, 2] - obstacles["up"]
    level = np.where(aside >= 0.0, LEFT, RIGHT)
    sides = np.where(np.abs(aside) >= np.abs(above), level, np.where(above > 0.0, OVER, UNDER))
    return np.where(beyond, -1, sides)


def side_routes(
    data: ProblemArrays,
    frame: RotatedFrame,
    grid: Grid,
    bound: float,
    most: int,
) -> list[GridRoute]:
    """Up to `most` routes of different sides, cheapest first, that cost at most `bound`.

    Each is the cheapest that passes one obstacle on one side; the first is the cheapest of all.  Of routes that lie
    near each other only the cheapest is kept.
    """
    if grid.layers.size == 0:
        return []
    step = frame.length / grid.stages
    costs = grid_costs(data, frame, grid, bound)
    obstacles = find_obstacles(data, frame, step, grid.shrink)
    passings = cheapest_passings(costs, grid, obstacles, step).ravel()
    passings = passings[np.isfinite(passings["cost"])]
    along = np.linspace(0.0, frame.length, grid.stages + 1)
    routes: list[GridRoute] = []
    known: set[bytes] = set()
    for passing in passings[np.argsort(passings["cost"], kind="stable")]:
        cells = route_through(costs, passing["stage"], passing["layer"], passing["across"])
        points = np.column_stack([along, grid.across[cells["across"]], grid.layers[cells["layer"]]])
        sides = sides_passed(points, obstacles).tobytes()
        if sides in known:
            continue
        known.add(sides)
        if any(np.abs(points[:, 1] - route.points[:, 1]).mean() < SAME_WAY for route in routes):
            continue
        routes.append(GridRoute(points, float(passing["cost"])))
        if len(routes) == most:
            break
    return routes


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
    """A grid that sees kill spheres smaller, and less of the ground about a cell, than they are: see `Grid`.

    Its highest layer is the ceiling, where spheres on the ground are smallest.
    """
    square = make_grid(data, frame, span, stages)
    step = ratio * frame.length / square.stages
    across = np.arange(math.ceil(span[0] / step), math.floor(span[1] / step) + 1) * step
    layers, start = square.layers, data.start[2]
    if data.ceiling > start and layers.size > 1:
        pitch = (data.ceiling - start) / math.ceil((data.ceiling - start) / (layers[1] - layers[0]))
        layers = (
            start
            + np.arange(-math.floor((start - layers[0]) / pitch), round((data.ceiling - start) / pitch) + 1) * pitch
        )
    return square._replace(
        across=np.asarray(across, np.float64), layers=layers, shrink=shrink, spread=spread, ratio=ratio
    )
