"""Routes over grids that know zones and the greatest height above ground, where a scenario has them."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.airspace_grids import AirspaceGrid, cheapest_airspace_route
from planner.seeding.grid_routes import EXPECTED, LAYERS_A_STEP, GridRoute, beside_used

Floats = NDArray[np.float64]

# Stages, to those of a grid that knows no zones: steps are to be short against hills and gaps.
FINER = 2
# Layers of a band of heights above ground, at least and at most.
FEWEST_LAYERS, MOST_LAYERS = 8, 24
# Pitch of layers that do not follow the ground, as a share of the pitch along, at least.
LEAST_PITCH = 0.05
# Cells of one grid, at most: stages x across x layers.
MOST_CELLS = 1_200_000


def airspace_grid(data: ProblemArrays, frame: RotatedFrame, span: tuple[float, float], stages: int) -> AirspaceGrid:
    """A grid of this many stages, or of fewer where it would get too large.

    span: lowest and highest place across, m.
    """
    level = np.array([*data.destination[:2], data.start[2]])
    gentlest = math.tan(max(0.0, min(slope_limits(data, np.array(data.start), level))))
    space = data.airspace
    band = space.max_height - space.buffer - data.clearance - data.buffer
    low = max(data.floor, float(np.nanmin(data.heights)) + data.clearance)
    follows = math.isfinite(band)
    while True:
        step = frame.length / stages
        across = np.arange(-math.floor(-span[0] / step), math.floor(span[1] / step) + 1) * step
        pitch = max(1.0, gentlest * step / LAYERS_A_STEP)
        if follows:
            layers = min(MOST_LAYERS, max(FEWEST_LAYERS, math.ceil(band / pitch) + 1))
            # Near an end that leaves less of the buffers the band is wider.
            widest = space.max_height - data.clearance
            pitch = max(1.0, band) / (layers - 1)
            layers = max(layers, min(2 * MOST_LAYERS, math.ceil(widest / pitch) + 1))
        else:
            pitch = max(pitch, LEAST_PITCH * step)
            layers = max(1, math.floor((data.ceiling - low) / pitch) + 1)
        if stages <= 8 or (stages + 1) * across.size * layers <= MOST_CELLS:
            return AirspaceGrid(stages, np.asarray(across, np.float64), layers, pitch, follows, low)
        stages = max(8, int(stages / 1.2))


def airspace_routes(
    data: ProblemArrays, frame: RotatedFrame, span: tuple[float, float], grids: tuple[tuple[int, int], ...]
) -> Iterator[GridRoute]:
    """Routes as found: of each grid's number of stages, `FINER` times as many, up to so many different ones."""
    expected = EXPECTED * math.dist(data.start, data.destination)
    for stages, each in grids:
        grid = airspace_grid(data, frame, span, FINER * stages)
        along = np.linspace(0.0, frame.length, grid.stages + 1)
        used: tuple[GridRoute, ...] = ()
        for _ in range(each):
            extra = beside_used(along, grid.across, used)
            for bound in (math.inf,) if used else (expected, math.inf):
                points, cost = cheapest_airspace_route(data, frame, grid, extra, bound)
                if len(points):
                    break
            if not len(points):
                break
            route = GridRoute(points, float(cost))
            expected = expected if used else route.cost
            used = (*used, route)
            yield route
