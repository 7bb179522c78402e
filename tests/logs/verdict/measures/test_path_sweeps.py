"""Time, exposure and closest distance of a path inside spheres, against closed forms and the segments one by one."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logs.verdict.measures.path_sweeps import path_clearance, path_spheres, segment_clearances, sphere_stays
from tests.synthetic import make_scenario
from world.geometry import segment_exposure
from world.terrain import make_flat_terrain, make_gridded_terrain

STRAIGHT = np.column_stack([np.linspace(0.0, 4000.0, 1001), np.zeros(1001), np.full(1001, 300.0)])
TIME = np.linspace(0.0, 160.0, 1001)


def test_a_chord_has_its_length_its_time_and_its_exposure() -> None:
    centre, radius, scale, away = np.array([[2000.0, 300.0, 300.0]]), np.array([500.0]), np.array([200.0]), 300.0
    visits = path_spheres(STRAIGHT, TIME, centre, radius, scale)
    half = math.sqrt(500.0**2 - away**2)
    exposure = 2 * (half / (2 * away**2 * (away**2 + half**2)) + math.atan(half / away) / (2 * away**3)) * 200.0**4
    assert visits.time_inside[0] == pytest.approx(2.0 * half / 25.0)
    assert visits.exposure[0] == pytest.approx(exposure / 25.0, rel=1e-3)
    assert (visits.closest[0], visits.closest_time[0]) == pytest.approx((away, 80.0))
    assert visits.entry_time[0] == pytest.approx((2000.0 - half) / 25.0)


def test_no_sphere_and_one_that_is_not_entered() -> None:
    centres = np.array([[2000.0, 0.0, 300.0], [2000.0, 900.0, 300.0]])
    visits = path_spheres(STRAIGHT, TIME, centres, np.array([0.0, 500.0]), np.array([100.0, 100.0]))
    assert visits.time_inside.tolist() == visits.exposure.tolist() == [0.0, 0.0]
    assert visits.closest.tolist() == [math.inf, 900.0]
    assert np.isnan(visits.entry_time).all()


def test_blocks_of_segments_add_up_to_the_segments() -> None:
    rng = np.random.default_rng(3)
    points = np.cumsum(rng.normal(0.0, 20.0, (1500, 3)), axis=0)
    time = np.cumsum(rng.uniform(0.5, 1.5, 1500))
    centre, radius, scale = points[700] + 5.0, 150.0, 50.0
    visits = path_spheres(points, time, centre[None], np.array([radius]), np.array([scale]))
    inside = exposure = 0.0
    for k in range(len(points) - 1):
        share, mean = segment_exposure(points[k], points[k + 1], centre, radius, scale)
        inside += share * (time[k + 1] - time[k])
        exposure += mean * (time[k + 1] - time[k])
    assert visits.time_inside[0] == pytest.approx(inside)
    assert visits.exposure[0] == pytest.approx(exposure)


def test_heights_above_flat_ground() -> None:
    ground = make_scenario(STRAIGHT, terrain={"kind": "flat", "amsl_m": 120.0}).terrain
    assert ground is not None
    low, _ = path_clearance(ground.heights, ground.to_pixel.record, STRAIGHT)
    assert low.shape == (1000,)
    np.testing.assert_allclose(low, 180.0, atol=1e-4)


def test_a_path_has_the_heights_of_its_segments_bit_for_bit() -> None:
    """Close and far points, points whose step is inexact in floating point, and a path that leaves the raster."""
    random = np.random.default_rng(5)
    heights = random.uniform(100.0, 900.0, (16, 25))
    ground = make_gridded_terrain(
        heights, np.linspace(-1e3, 1400.0, 25), np.linspace(-800.0, 700.0, 16), source="t", sha256="", datum="msl"
    )
    far = random.uniform([-900.0, -700.0, 500.0], [1300.0, 600.0, 900.0], (60, 3))
    close = np.array([0.1, 0.3, 600.0]) + np.cumsum(random.normal(0.0, 0.4, (300, 3)), axis=0)
    # 0.1 + (2000.1 - 0.1) is not 2000.1.
    points = np.vstack([far, close, [[0.1, 0.3, 700.0], [2000.1, 0.3, 700.0]], far[:9]])
    clearance, fraction = path_clearance(ground.heights, ground.to_pixel.record, points)
    alone = [ground.clearance(start, end) for start, end in pairwise(points)]
    np.testing.assert_array_equal(np.column_stack([clearance, fraction]), np.array(alone))
    assert int(np.isnan(clearance).sum()) == 2


# ----------------------------------------------------------------------
# Stays in spheres and heights above ground along a track are those of its segments.


@given(
    speed=st.floats(10.0, 60.0),
    offset=st.floats(0.0, 390.0),
    rate=st.sampled_from([1.0, 7.0, 60.0]),
)
@settings(max_examples=40, deadline=None)
def test_passage_times_are_the_spheres_chord(speed: float, offset: float, rate: float) -> None:
    time = np.arange(round(3000.0 / speed * rate) + 2) / rate
    position = np.stack([-1500.0 + speed * time, np.full(time.size, offset), np.full(time.size, 100.0)], axis=1)
    (stay,) = sphere_stays(time, position, np.array([0.0, 0.0, 100.0]), 400.0)
    half = math.sqrt(400.0**2 - offset**2)
    assert stay.start == pytest.approx((1500.0 - half) / speed, abs=1e-6)
    assert stay.end == pytest.approx((1500.0 + half) / speed, abs=1e-6)
    assert stay.closest == pytest.approx(offset, abs=1e-6)
    assert stay.whole


def test_a_flight_that_starts_and_ends_inside() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    position = np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0], [200.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    first, last = sphere_stays(time, position, np.zeros(3), 100.0)
    assert (first.start, first.end, first.whole) == (0.0, 0.5, True)
    assert (last.start, last.end, last.whole) == (2.5, 3.0, False)
    assert sphere_stays(time, position, np.array([0.0, 0.0, 500.0]), 100.0) == []
    assert sphere_stays(time, position, np.zeros(3), 0.0) == []


def test_garbage_positions_meet_nothing() -> None:
    ground = make_flat_terrain(np.array([[-1e3, 1e3], [-1e3, 1e3]]), 5.0, 100.0)
    position = np.array(
        [[0.0, 0.0, 50.0], [10.0, 0.0, 40.0], [math.nan, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0, 0.0, 20.0]]
    )
    low, at = segment_clearances(ground, position)
    assert low[0] == pytest.approx(35.0)
    assert at[0] == pytest.approx(1.0)
    assert np.isnan(low[1:]).all()
    stays = sphere_stays(np.arange(5.0), position, np.zeros(3), 60.0)
    assert [(stay.start, stay.end) for stay in stays] == [(0.0, 1.0)]


def test_no_sphere_and_no_way_have_no_stay() -> None:
    way = np.array([[-100.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    assert len(sphere_stays(np.arange(2.0), way, np.zeros(3), 50.0)) == 1
    for radius in (0.0, -50.0, math.nan):
        assert sphere_stays(np.arange(2.0), way, np.zeros(3), radius) == []
    for rows in (0, 1):
        assert sphere_stays(np.arange(2.0)[:rows], np.zeros((rows, 3)), np.zeros(3), 50.0) == []
    ground = make_flat_terrain(np.array([[-1e3, 1e3], [-1e3, 1e3]]), 5.0, 100.0)
    for rows in (0, 1):
        assert [one.size for one in segment_clearances(ground, np.zeros((rows, 3)))] == [0, 0]
