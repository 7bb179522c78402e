"""Time, exposure and closest distance of a path inside spheres, against closed forms and the segments one by one."""

import math

import numpy as np
import pytest

from logs.verdict.measures.path_sweeps import path_clearance, path_spheres
from tests.synthetic import make_scenario
from world.geometry import segment_exposure

STRAIGHT = np.column_stack([np.linspace(0.0, 4000.0, 1001), np.zeros(1001), np.full(1001, 300.0)])
TIME = np.linspace(0.0, 160.0, 1001)


def test_a_chord_has_its_length_its_time_and_its_exposure() -> None:
    centre, radius, scale, away = np.array([[2000.0, 300.0, 300.0]]), np.array([500.0]), np.array([200.0]), 300.0
    visits = path_spheres(STRAIGHT, TIME, centre, radius, scale)
    half = math.sqrt(500.0**2 - away**2)
    exposure = 2 * (half / (2 * away**2 * (away**2 + half**2)) + math.atan(half / away) / (2 * away**3)) * 200.0**4
    assert visits.inside[0] == pytest.approx(2.0 * half / 25.0)
    assert visits.exposure[0] == pytest.approx(exposure / 25.0, rel=1e-3)
    assert (visits.closest[0], visits.closest_time[0]) == pytest.approx((away, 80.0))
    assert visits.entry_time[0] == pytest.approx((2000.0 - half) / 25.0)


def test_no_sphere_and_one_that_is_not_entered() -> None:
    centres = np.array([[2000.0, 0.0, 300.0], [2000.0, 900.0, 300.0]])
    visits = path_spheres(STRAIGHT, TIME, centres, np.array([0.0, 500.0]), np.array([100.0, 100.0]))
    assert visits.inside.tolist() == visits.exposure.tolist() == [0.0, 0.0]
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
    assert visits.inside[0] == pytest.approx(inside)
    assert visits.exposure[0] == pytest.approx(exposure)


def test_heights_above_flat_ground() -> None:
    ground = make_scenario(STRAIGHT, terrain={"kind": "flat", "amsl_m": 120.0}).terrain
    assert ground is not None
    low, _ = path_clearance(ground.heights, ground.to_pixel.record, STRAIGHT)
    assert low.shape == (1000,)
    np.testing.assert_allclose(low, 180.0, atol=1e-4)
