"""What a m of way costs in the cells of a grid: near the ground, and inside kill spheres."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.clearance_buffer import RequiredClearance, clearance_at
from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.problem_arrays import ProblemArrays
from world.frames import polymap
from world.kernels import Records, compiled
from world.terrain import pixel_height

Floats = NDArray[np.float64]

# Cost of a m inside a kill sphere, in m of path.
KILL_COST = 40.0
# Steps between stages longer than this (m) are coarse: kill spheres grow there by this share of a step, for what lies
# between the cells.  Finer grids keep them as they are, and find the narrow gaps.
COARSE, COARSE_GROWTH = 250.0, 0.15
# Share of a step to either side of a cell within which the highest ground counts.
GROUND_SPREAD = 0.4
# A threat in the rotated frame, m, with the radius that routes keep away.
OBSTACLE = np.dtype(
    [("along", np.float64), ("across", np.float64), ("up", np.float64), ("radius", np.float64)], align=True
)


class Grid(NamedTuple):
    """One resolution: stages along, places across (m from the line) and layers of height (m).

    shrink: share of a step by which kill spheres are taken to be smaller than they are; 0 for none.  What such a grid
    finds may have to be moved to be safe, and it finds gaps between its cells.
    spread: share of a step to either side of a cell within which the highest ground counts.
    ratio: between places across, as a share of a step; below 1 the grid knows more courses and finer gaps.
    """

    stages: int
    across: Floats
    layers: Floats
    shrink: float = 0.0
    spread: float = GROUND_SPREAD
    ratio: float = 1.0


class _PixelSteps(NamedTuple):
    """Columns and rows of the raster from one sample of the ground to the next, along and across."""

    columns_along: float
    rows_along: float
    columns_across: float
    rows_across: float


@compiled
def position_of(frame: RotatedFrame, along: float, across: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """East and north of a place in the rotated frame."""
    return (
        frame.east + frame.cosine * along - frame.sine * across,
        frame.north + frame.sine * along + frame.cosine * across,
    )


@compiled
def _lowest_height(
    data: ProblemArrays,
    required: RequiredClearance,
    frame: RotatedFrame,
    along: float,
    across: float,
    steps: _PixelSteps,
) -> float:  # pragma: no cover - compiled
    """Lowest height allowed in a cell: highest ground on 3 x 3 samples, plus clearance; inf outside the map.

    steps: 0 along for the middle sample alone.
    """
    east, north = position_of(frame, along, across)
    if not (data.west <= east <= data.east and data.south <= north <= data.north):
        return math.inf
    column, row = polymap(data.to_pixel, east, north)
    spread = 0 if steps.columns_along == 0.0 and steps.rows_along == 0.0 else 1
    worst = -math.inf
    for i in range(-spread, spread + 1):
        for j in range(-spread, spread + 1):
            ground = pixel_height(
                data.heights,
                column + i * steps.columns_along + j * steps.columns_across,
                row + i * steps.rows_along + j * steps.rows_across,
            )
            if math.isnan(ground):
                return math.inf
            worst = max(worst, ground)
    return worst + clearance_at(required, east, north)


@compiled
def _pixel_steps(
    data: ProblemArrays, frame: RotatedFrame, along: float, pitch: float
) -> _PixelSteps:  # pragma: no cover - compiled
    """Steps over the raster that are `pitch` m along and across the line, at this distance along."""
    east, north = position_of(frame, along, 0.0)
    column, row = polymap(data.to_pixel, east, north)
    east, north = position_of(frame, along + pitch, 0.0)
    column_along, row_along = polymap(data.to_pixel, east, north)
    east, north = position_of(frame, along, pitch)
    column_across, row_across = polymap(data.to_pixel, east, north)
    return _PixelSteps(column_along - column, row_along - row, column_across - column, row_across - row)


@compiled
def find_obstacles(
    data: ProblemArrays, frame: RotatedFrame, step: float, shrink: float = 0.0
) -> Records:  # pragma: no cover - compiled
    """`OBSTACLE` records of the missiles for a grid with this step between stages; shrink: see `Grid`."""
    growth = COARSE_GROWTH * step if step > COARSE else 0.0
    if shrink > 0.0:
        growth = -shrink * step
    out = np.zeros(data.threats.shape[0], dtype=OBSTACLE)
    count = 0
    for k in range(data.threats.shape[0]):
        threat = data.threats[k]
        if threat.kill_radius <= 0.0:
            continue
        east, north = threat.east - frame.east, threat.north - frame.north
        out[count].along = frame.cosine * east + frame.sine * north
        out[count].across = frame.cosine * north - frame.sine * east
        out[count].up = threat.up
        out[count].radius = threat.kill_radius + (data.kill_margin + growth)
        count += 1
    return out[:count]


@compiled
def _add_danger(
    obstacles: Records, along: float, grid: Grid, low: int, high: int, price: Floats
) -> None:  # pragma: no cover - compiled
    """Add the cost per m inside kill spheres, growing inwards, to a stage's cells price (layers, across) low..high."""
    across, layers = grid.across, grid.layers
    pitch = across[1] - across[0] if across.size > 1 else 1.0
    for k in range(obstacles.shape[0]):
        obstacle = obstacles[k]
        radius = obstacle.radius
        ahead2 = (along - obstacle.along) ** 2
        if ahead2 >= radius * radius:
            continue
        half = math.sqrt(radius * radius - ahead2)
        first = max(low, math.ceil((obstacle.across - half - across[0]) / pitch))
        last = min(high, math.floor((obstacle.across + half - across[0]) / pitch))
        for z in range(layers.size):
            flat2 = ahead2 + (layers[z] - obstacle.up) ** 2
            if flat2 >= radius * radius:
                continue
            for y in range(first, last + 1):
                d2 = flat2 + (across[y] - obstacle.across) ** 2
                if d2 < radius * radius:
                    price[z, y] += KILL_COST * (3.0 - 2.0 * math.sqrt(d2) / radius)


@compiled
def set_prices(
    data: ProblemArrays,
    required: RequiredClearance,
    frame: RotatedFrame,
    stage: int,
    obstacles: Records,
    grid: Grid,
    extra: Floats,
    low: int,
    high: int,
    price: Floats,
) -> None:  # pragma: no cover - compiled
    """Cost per m of a stage's cells price (layers, across) low..high; inf where the ground is too near."""
    across, layers = grid.across, grid.layers
    step = frame.length / grid.stages
    steps = _pixel_steps(data, frame, stage * step, grid.spread * step if stage < grid.stages else 0.0)
    for y in range(low, high + 1):
        # The destination is where it is, whatever its clearance.
        if stage == grid.stages and across[y] == 0.0:
            lowest = -math.inf
        else:
            lowest = _lowest_height(data, required, frame, stage * step, across[y], steps)
        for z in range(layers.size):
            price[z, y] = 1.0 + extra[stage, y] if layers[z] >= lowest else math.inf
    _add_danger(obstacles, stage * step, grid, low, high, price)
