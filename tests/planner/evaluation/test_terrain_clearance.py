"""Steps over the ground under a line leave nothing out, against samples every metre."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits, downwind_vector
from planner.evaluation.corners import LEG, measure_legs
from planner.evaluation.problem import SlopeBounds, make_problem, required_clearance
from planner.evaluation.terrain_clearance import HEIGHT_LAG, clearance_deficit, compute_height_lags, lag_at
from tests.planner.tracking_limits import with_tracking_error
from world.arrays import Floats
from world.kernels import read_only
from world.scenario import Scenario
from world.terrain import TILE_PIXELS, steepest_slopes


def test_steepest_slopes_bound_the_ground_of_each_tile() -> None:
    rng = np.random.default_rng(2)
    heights = (rng.random((45, 70)) * rng.choice([1.0, 30.0], (45, 70))).astype(np.float32)
    heights[3, 5] = np.nan
    slopes = steepest_slopes(read_only(heights), 30.0)
    assert slopes.shape == (3, 5)
    rows, cols = np.mgrid[0:44, 0:69]
    corner = heights[:-1, :-1].astype(float)
    across = np.maximum(abs(heights[:-1, 1:] - corner), abs(heights[1:, 1:] - heights[1:, :-1]))
    down = np.maximum(abs(heights[1:, :-1] - corner), abs(heights[1:, 1:] - heights[:-1, 1:]))
    for i, j in np.ndindex(slopes.shape):
        inside = (rows // TILE_PIXELS == i) & (cols // TILE_PIXELS == j)
        assert slopes[i, j] == pytest.approx(np.nanmax(np.hypot(across, down)[inside]) / 30.0, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_steps_over_the_ground_leave_nothing_out(scenario: Scenario, limits: Limits, seed: int) -> None:
    """Against samples every metre: a line is clear of the ground, or is not, as they say."""
    data = make_problem(scenario, limits).search
    rng = np.random.default_rng(seed)
    # Level ground with steep cones, and gentle ones in the other half of the map.
    rows, cols = np.indices(data.heights.shape)
    pitch = float(data.slope_bounds.tile_side / TILE_PIXELS)
    tops = rng.uniform([0.0, 0.0], data.heights.shape, (60, 2))
    rough = np.zeros(data.heights.shape, dtype=np.float32)
    for row, col in tops:
        slope = 0.8 if col < data.heights.shape[1] / 2 else 0.3
        cone = rng.uniform(100.0, 300.0) - slope * pitch * np.hypot(rows - row, cols - col)
        rough = np.maximum(rough, cone.astype(np.float32))
    slopes = steepest_slopes(read_only(rough), pitch)
    padded = np.pad(slopes, 1)
    around = np.max([padded[i : i + len(slopes), j : j + slopes.shape[1]] for i in range(3) for j in range(3)], axis=0)
    data = data._replace(
        heights=read_only(rough),
        slope_bounds=SlopeBounds(float(slopes.max()), read_only(around), data.slope_bounds.tile_side),
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
        step = float(slopes.max()) * required.sample_spacing + abs(rise) / run * required.sample_spacing
        for off in (0.5, -step):
            height = wanted + off
            line = a[0], a[1], height, b[0], b[1], height + rise
            depth = clearance_deficit(data.heights, data.slope_bounds, required, 0.0, tuple(ends), *line, math.inf)
            assert (depth > 0.0) == (off < 0.0)
            # With more wanted by what it is clear, or less by what it is deep and a step between samples.
            need = step if off > 0.0 else -step - 0.5
            more = clearance_deficit(data.heights, data.slope_bounds, required, need, tuple(ends), *line, math.inf)
            assert (more > 0.0) == (off > 0.0)
            both[int(depth > 0.0)] += 1
    assert both.min() > 100


# ----------------------------------------------------------------------
# How far a late autopilot is below its legs, against the lag stepped through in hundredths of a second.

Make = Callable[[Scenario], Limits]
# Level, up at 5 degrees, level, down at 8, a step of 10 m down, a short climb, level.
RISES = (0.0, 87.0, 0.0, -140.0, -10.0, 17.0, 0.0)
RUNS = (600.0, 1000.0, 700.0, 1000.0, 900.0, 120.0, 800.0)


def path_of(runs: tuple[float, ...], rises: tuple[float, ...]) -> Floats:
    north = np.concatenate([[0.0], np.cumsum(runs)])
    up = 300.0 + np.concatenate([[0.0], np.cumsum(rises)])
    return np.stack([np.zeros(north.size), north - 2500.0, up], axis=1)


def lags_of(limits: Limits, scenario: Scenario, path: Floats) -> Any:
    data = make_problem(scenario, limits).search
    legs, lags = np.zeros(len(path) - 1, LEG), np.zeros(len(path) - 1, HEIGHT_LAG)
    measure_legs(path, legs)
    compute_height_lags(data.tracking, data.aircraft, downwind_vector(data.aircraft), path, legs, lags)
    return lags


def stepped(path: Floats, speed: float, lag: float, step: float) -> list[Floats]:
    """How far below each leg, at even shares of it, an aircraft is whose height follows the demand late."""
    dt, height, found = 0.01, float(path[0, 2]), []
    for a, b in pairwise(path):
        run, rise = float(b[1] - a[1]), float(b[2] - a[2])
        ticks = round(run / speed / dt)
        below = np.empty(ticks)
        for k in range(ticks):
            drawn = float(a[2]) + rise * k / ticks
            below[k] = drawn - height
            demand = float(b[2]) if abs(rise) < step else drawn
            height += (demand - height) * dt / lag
        found.append(below)
    return found


@pytest.mark.parametrize("wind", [0.0, 8.0, -8.0])
def test_height_follows_late(small: Callable[..., Scenario], make_limits: Make, wind: float) -> None:
    """25 m/s north, with a wind along: within half a metre of the lag, and of its most and least, everywhere."""
    blowing = {"speed_mps": abs(wind), "from_deg": 180.0 if wind > 0.0 else 0.0}
    scenario = small(wind=blowing)
    limits = with_tracking_error(make_limits(scenario), lag=3.0, step=15.0)
    path = path_of(RUNS, RISES)
    lags = lags_of(limits, scenario, path)
    for lag, below in zip(lags, stepped(path, 25.0 * 1.016 + wind, 3.0, 15.0), strict=True):
        shares = np.linspace(0.0, 1.0, below.size, endpoint=False)
        got = np.array([lag_at(lag, share) for share in shares])
        assert got == pytest.approx(below, abs=0.7)
        assert lag["max_below"] >= max(0.0, got.max()) - 1e-9
        assert lag["min_below"] <= min(0.0, got.min()) + 1e-9


def test_a_steady_climb_is_lag_times_climb_rate_low(small: Callable[..., Scenario], make_limits: Make) -> None:
    """3 s of 25 m/s at 0.1 are 7.5 m, and with a lag of 1 s 2.5 m; at 300 m true airspeed is 1.5 % more."""
    scenario = small()
    path = path_of((3000.0,), (300.0,))
    for seconds, low in ((3.0, 7.5), (1.0, 2.5)):
        lag = lags_of(with_tracking_error(make_limits(scenario), lag=seconds), scenario, path)[0]
        assert lag_at(lag, 1.0) == pytest.approx(low * 1.015, rel=0.01)
        assert lag_at(lag, 0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("rise", "flown_level"), [(-14.9, True), (-15.1, False)])
def test_a_small_change_of_height_is_flown_at_its_end(
    small: Callable[..., Scenario], make_limits: Make, rise: float, flown_level: bool
) -> None:
    scenario = small()
    lag = lags_of(
        with_tracking_error(make_limits(scenario), lag=3.0, step=15.0), scenario, path_of((2000.0,), (rise,))
    )[0]
    # Half way, 7.5 m below the leg; or a little above its slope.
    assert lag_at(lag, 0.5) == pytest.approx(7.45 if flown_level else -3.0 * 25.4 * 15.1 / 2000.0, abs=0.05)


def test_no_lag_is_no_difference(small: Callable[..., Scenario], make_limits: Make) -> None:
    scenario = small()
    lags = lags_of(with_tracking_error(make_limits(scenario), lag=0.0), scenario, path_of(RUNS, RISES))
    assert np.abs([[lag_at(lag, share) for share in (0.0, 0.5, 1.0)] for lag in lags]).max() < 1e-3
    assert math.isclose(lags["max_below"].max(), 0.0, abs_tol=1e-3)
