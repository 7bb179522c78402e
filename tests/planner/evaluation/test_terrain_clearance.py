"""Steps over the ground under a line leave nothing out, against samples every metre."""

import math

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.clearance_buffer import required_clearance
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import SlopeBounds
from planner.evaluation.terrain_clearance import terrain_excess
from world.scenario import Scenario
from world.terrain import TILE, steepest_slopes


def test_steepest_slopes_bound_the_ground_of_each_tile() -> None:
    rng = np.random.default_rng(2)
    heights = (rng.random((45, 70)) * rng.choice([1.0, 30.0], (45, 70))).astype(np.float32)
    heights[3, 5] = np.nan
    slopes = steepest_slopes(heights, 30.0)
    assert slopes.shape == (3, 5)
    rows, cols = np.mgrid[0:44, 0:69]
    corner = heights[:-1, :-1].astype(float)
    across = np.maximum(abs(heights[:-1, 1:] - corner), abs(heights[1:, 1:] - heights[1:, :-1]))
    down = np.maximum(abs(heights[1:, :-1] - corner), abs(heights[1:, 1:] - heights[:-1, 1:]))
    for i, j in np.ndindex(slopes.shape):
        inside = (rows // TILE == i) & (cols // TILE == j)
        assert slopes[i, j] == pytest.approx(np.nanmax(np.hypot(across, down)[inside]) / 30.0, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_steps_over_the_ground_leave_nothing_out(scenario: Scenario, limits: Limits, seed: int) -> None:
    """Against samples every metre: a line is clear of the ground, or is not, as they say."""
    data = make_problem(scenario, limits).search
    rng = np.random.default_rng(seed)
    # Level ground with steep cones, and gentle ones in the other half of the map.
    rows, cols = np.indices(data.heights.shape)
    pitch = float(data.slope_bounds.tile_side / TILE)
    tops = rng.uniform([0.0, 0.0], data.heights.shape, (60, 2))
    rough = np.zeros(data.heights.shape, dtype=np.float32)
    for row, col in tops:
        slope = 0.8 if col < data.heights.shape[1] / 2 else 0.3
        cone = rng.uniform(100.0, 300.0) - slope * pitch * np.hypot(rows - row, cols - col)
        rough = np.maximum(rough, cone.astype(np.float32))
    slopes = steepest_slopes(rough, pitch)
    padded = np.pad(slopes, 1)
    around = np.max([padded[i : i + len(slopes), j : j + slopes.shape[1]] for i in range(3) for j in range(3)], axis=0)
    data = data._replace(
        heights=rough, slope_bounds=SlopeBounds(float(slopes.max()), around, data.slope_bounds.tile_side)
    )
    required = required_clearance(data)
    terrain = scenario.terrain
    assert terrain is not None
    corner = np.array(terrain.to_pixel(-500.0, -3000.0))
    both = np.zeros(2, dtype=int)
    for _ in range(300):
        # Past the top of a cone, or as it comes.
        top = tops[rng.integers(len(tops))][::-1] + rng.normal(0.0, 1.0, 2)
        middle = np.array([-500.0, -3000.0]) + (top - corner) * pitch
        way = rng.normal(0.0, 1200.0, 2)
        a = np.append(np.clip(middle - rng.random() * way, [-400.0, -2900.0], [6400.0, 2900.0]), 0.0)
        b = np.append(np.clip(middle + rng.random() * way, [-400.0, -2900.0], [6400.0, 2900.0]), 0.0)
        run = math.dist(a, b)
        if run < 100.0:
            continue
        places = np.linspace(a[:2], b[:2], max(2, math.ceil(run)))
        ends = np.concatenate([np.array(terrain.to_pixel(*end[:2])) for end in (a, b)])
        col, row = np.linspace(ends[:2], ends[2:], len(places)).T
        i, j = row.astype(int), col.astype(int)
        v, u = row - i, col - j
        top, low = (rough[i + d, j] * (1 - u) + rough[i + d, j + 1] * u for d in (0, 1))
        ground = top * (1 - v) + low * v
        share = np.linspace(0.0, 1.0, len(places))
        rise = rng.normal(0.0, 100.0)
        # Just clear of the ground, or just below what is wanted.
        wanted = float((ground - rise * share).max()) + required.clearance + required.buffer
        step = slopes.max() * required.sample_pitch + abs(rise) / run * required.sample_pitch
        for off in (0.5, -step):
            height = wanted + off
            line = a[0], a[1], height, b[0], b[1], height + rise
            depth = terrain_excess(rough, data.slope_bounds, required, 0.0, tuple(ends), *line)
            assert (depth > 0.0) == (off < 0.0)
            # With more wanted by what it is clear, or less by what it is deep and a step between samples.
            more = terrain_excess(
                rough, data.slope_bounds, required, step if off > 0.0 else -step - 0.5, tuple(ends), *line
            )
            assert (more > 0.0) == (off > 0.0)
            both[int(depth > 0.0)] += 1
    assert both.min() > 100
