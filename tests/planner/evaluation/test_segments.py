"""The ground under a line and the missiles beside it, against plain sums over everything."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.path_limits import Limits
from planner.evaluation.leg_constraints import pack_clearance
from planner.evaluation.missile_index import kill_density, make_missiles
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import Steep
from planner.evaluation.terrain_clearance import terrain_excess
from world.geometry import segment_exposure
from world.scenario import Scenario
from world.terrain import TILE, steepest_slopes

MARGIN = 15.0


def threats_of(rng: np.random.Generator, count: int, largest: float) -> np.ndarray:
    """Missiles of radii from 20 m up, some without any, in a few places twice."""
    place = np.column_stack([rng.uniform(-5000.0, 5000.0, (count, 2)), rng.uniform(0.0, 600.0, count)])
    place[: count // 10] = place[-(count // 10) - 1 : -1]
    radius = np.exp(rng.uniform(math.log(20.0), math.log(largest), count)) * (rng.random(count) < 0.9)
    return np.column_stack([place, radius, rng.uniform(10.0, 300.0, count)])


def line_of(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray]:
    a = np.append(rng.uniform(-7000.0, 7000.0, 2), rng.uniform(0.0, 800.0))
    step = np.append(rng.normal(0.0, 1500.0, 2), rng.normal(0.0, 300.0))
    changes = {
        "any": step,
        "eastward": step * [1.0, 0.0, 1.0],
        "northward": step * [0.0, 1.0, 1.0],
        "upright": step * [0.0, 0.0, 1.0],
        "none": 0.0 * step,
        "short": 0.01 * step,
    }
    return a, a + changes[kind]


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 10_000),
    st.sampled_from([(1, 3000.0), (3, 3000.0), (200, 3000.0), (4000, 150.0)]),
    st.sampled_from(["any", "eastward", "northward", "upright", "none", "short"]),
)
def test_kill_density_is_that_of_all_missiles(seed: int, many: tuple[int, float], kind: str) -> None:
    rng = np.random.default_rng(seed)
    threats = threats_of(rng, *many)
    armed = threats[threats[:, 3] > 0.0]
    missiles = make_missiles(threats)
    assert len(missiles.units) == len(armed)

    def nearest(p: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Distance from each missile's sphere to the line from p."""
        along = np.clip((armed[:, :3] - p) @ part / max(part @ part, 1e-300), 0.0, 1.0)
        return np.linalg.norm(p + along[:, None] * part - armed[:, :3], axis=1) - armed[:, 3] - MARGIN

    for _ in range(10):
        a, b = line_of(rng, kind)
        length = float(np.linalg.norm(b - a))
        first, last, slack = rng.uniform(0.0, 400.0, 3) * [1.0, 1.0, 0.1]
        dose, near_a, near_b = kill_density(missiles, MARGIN, slack, *a, *b, first, last)
        inside = armed[nearest(a, b - a) < 1.0]
        expected = sum(segment_exposure(a, b, unit[:3].copy(), unit[3] + MARGIN, unit[4])[1] for unit in inside)
        assert dose == pytest.approx(expected, rel=1e-9, abs=1e-15)
        for got, p, q, reach in ((near_a, a, b, first), (near_b, b, a, last)):
            part = (q - p) * min(1.0, reach / length if length > 0.0 else 1.0)
            true = float(nearest(p, part).min(initial=math.inf))
            # Right up to the slack, and beyond it no nearer than that.
            assert got == pytest.approx(true, abs=1e-6) if true < slack else got >= slack - 1e-6


def test_no_missiles_at_all() -> None:
    missiles = make_missiles(np.zeros((0, 7)))
    assert kill_density(missiles, MARGIN, 30.0, *np.zeros(3), *np.ones(3), 1.0, 1.0) == (0.0, math.inf, math.inf)


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
    rules = make_problem(scenario, limits).search
    rng = np.random.default_rng(seed)
    # Level ground with steep cones, and gentle ones in the other half of the map.
    rows, cols = np.indices(rules.heights.shape)
    pitch = float(rules.steep.reach / TILE)
    tops = rng.uniform([0.0, 0.0], rules.heights.shape, (60, 2))
    rough = np.zeros(rules.heights.shape, dtype=np.float32)
    for row, col in tops:
        slope = 0.8 if col < rules.heights.shape[1] / 2 else 0.3
        cone = rng.uniform(100.0, 300.0) - slope * pitch * np.hypot(rows - row, cols - col)
        rough = np.maximum(rough, cone.astype(np.float32))
    slopes = steepest_slopes(rough, pitch)
    padded = np.pad(slopes, 1)
    around = np.max([padded[i : i + len(slopes), j : j + slopes.shape[1]] for i in range(3) for j in range(3)], axis=0)
    rules = rules._replace(heights=rough, steep=Steep(float(slopes.max()), around, rules.steep.reach))
    clear = pack_clearance(rules)
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
        wanted = float((ground - rise * share).max()) + clear[0] + clear[1]
        step = slopes.max() * clear[8] + abs(rise) / run * clear[8]
        for off in (0.5, -step):
            height = wanted + off
            depth = terrain_excess(
                rough, rules.steep, clear, tuple(ends), a[0], a[1], height, b[0], b[1], height + rise
            )
            assert (depth > 0.0) == (off < 0.0)
            both[int(depth > 0.0)] += 1
    assert both.min() > 100
