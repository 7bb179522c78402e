"""Heights and clearances against scipy and dense sampling."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from world.scenario import load_scenario
from world.terrain import Peak, Terrain, make_flat_terrain, make_gridded_terrain, make_peaks_terrain

EAST = np.linspace(-1000.0, 1400.0, 25)
NORTH = np.linspace(-800.0, 700.0, 16)
ROUGH = np.random.default_rng(8).uniform(100.0, 900.0, (16, 25)).astype(np.float32)
BOUNDS = np.array([[-1000.0, 1400.0], [-800.0, 700.0]])


def _rough() -> Terrain:
    return make_gridded_terrain(ROUGH.astype(np.float64), EAST, NORTH, source="test", sha256="", datum="mean sea level")


ROUGH_TERRAIN = _rough()
INSIDE = st.tuples(st.floats(-999.0, 1399.0), st.floats(-799.0, 699.0), st.floats(0.0, 1500.0))


@given(INSIDE)
def test_heights_are_bilinear(point: tuple[float, float, float]) -> None:
    reference = RegularGridInterpolator((NORTH, EAST), ROUGH.astype(np.float64))
    got = float(ROUGH_TERRAIN.height(point[0], point[1]))
    assert got == pytest.approx(float(reference((point[1], point[0]))), abs=1e-6)


def test_heights_of_any_shape_and_beyond_the_edge() -> None:
    east, north = np.meshgrid(EAST, NORTH)
    assert ROUGH_TERRAIN.height(east, north) == pytest.approx(ROUGH, abs=1e-4)
    assert ROUGH_TERRAIN.height(0.0, 0.0).shape == ()
    outside = ROUGH_TERRAIN.height([-1000.3, 1400.3, 0.0, 0.0, math.nan], [0.0, 0.0, -800.3, 700.3, 0.0])
    assert np.isnan(outside).all()
    with pytest.raises(ValueError, match="read-only"):
        ROUGH_TERRAIN.heights[0, 0] = 1.0


def test_a_raster_of_the_caller_stays_the_callers() -> None:
    mine = np.ones((3, 3), dtype=np.float32)
    terrain = Terrain(mine, ROUGH_TERRAIN.to_pixel, 1.0, "test", "", "")
    mine[0, 0] = 5.0
    assert terrain.heights[0, 0] == 1.0


@given(INSIDE, INSIDE)
def test_clearance_against_dense_sampling(a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
    start, end = np.array(a), np.array(b)
    low, at = ROUGH_TERRAIN.clearance(start, end)
    fraction = np.linspace(0.0, 1.0, 6001)
    points = start + fraction[:, None] * (end - start)
    above = points[:, 2] - ROUGH_TERRAIN.height(points[:, 0], points[:, 1])
    # The steepest the ground can be: one node's height over one pitch, twice.
    step = np.linalg.norm(end - start) / 6000
    assert low <= above.min() + 1e-6
    assert low >= above.min() - step * (1.0 + 2 * 800.0 / 100.0)
    assert 0.0 <= at <= 1.0
    place = start + at * (end - start)
    assert place[2] - float(ROUGH_TERRAIN.height(place[0], place[1])) == pytest.approx(low, abs=1e-4)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ([-1000.0, 0.0, 900.0], [1400.0, 0.0, 900.0]),  # along a row of pixels
        ([0.0, -800.0, 900.0], [0.0, 700.0, 900.0]),
        ([-1000.0, -800.0, 900.0], [1400.0, 700.0, 900.0]),  # corner to corner
        ([200.0, 100.0, 900.0], [200.0, 100.0, 500.0]),  # straight down
        ([200.0, 100.0, 900.0], [200.0, 100.0, 900.0]),  # a point
        ([500.0, 100.0, 800.0], [500.0 - 1e-9, 100.0 + 1e-10, 800.0]),
    ],
)
def test_clearance_where_grid_and_path_line_up(a: list[float], b: list[float]) -> None:
    start, end = np.array(a), np.array(b)
    points = start + np.linspace(0.0, 1.0, 20001)[:, None] * (end - start)
    above = points[:, 2] - ROUGH_TERRAIN.height(points[:, 0], points[:, 1])
    assert ROUGH_TERRAIN.clearance(start, end)[0] == pytest.approx(above.min(), abs=0.6)
    assert ROUGH_TERRAIN.clearance(start, end)[0] <= above.min() + 1e-5


def test_the_lowest_point_may_lie_inside_a_cell() -> None:
    # A saddle: along its diagonal the ground rises as u (1 - u) between two zero corners.
    heights = np.array([[0.0, 100.0], [100.0, 0.0]])
    saddle = make_gridded_terrain(heights, np.array([0.0, 10.0]), np.array([0.0, 10.0]), source="", sha256="", datum="")
    low, at = saddle.clearance(np.array([0.0, 0.0, 60.0]), np.array([10.0, 10.0, 60.0]))
    assert (low, at) == (pytest.approx(10.0), pytest.approx(0.5))


def test_leaving_the_raster_or_its_data_is_nan() -> None:
    low, at = ROUGH_TERRAIN.clearance(np.array([0.0, 0.0, 990.0]), np.array([2000.0, 0.0, 990.0]))
    assert math.isnan(low)
    assert at == pytest.approx(0.7, abs=0.1)
    holed = ROUGH.copy()
    holed[8, 12] = np.nan
    terrain = make_gridded_terrain(holed.astype(np.float64), EAST, NORTH, source="", sha256="", datum="")
    assert math.isnan(terrain.clearance(np.array([-900.0, 0.0, 990.0]), np.array([900.0, 0.0, 990.0]))[0])
    assert not math.isnan(terrain.clearance(np.array([-900.0, 500.0, 990.0]), np.array([900.0, 500.0, 990.0]))[0])


def test_flat_and_peaks() -> None:
    flat = make_flat_terrain(BOUNDS, 123.0, 5000.0)
    assert flat.height([-5999.0, 6399.0, 0.0], [0.0, 5699.0, 0.0]) == pytest.approx([123.0] * 3)
    low, _ = flat.clearance(np.array([0.0, 0.0, 200.0]), np.array([900.0, 0.0, 150.0]))
    assert low == pytest.approx(27.0)
    hills = np.array([[0.0, 0.0, 400.0, 300.0], [700.0, -200.0, 250.0, 160.0]])
    peaks = make_peaks_terrain(BOUNDS, [Peak(*hill) for hill in hills.tolist()], 1000.0)
    east, north = np.random.default_rng(1).uniform([[-1900.0], [-1700.0]], [[2300.0], [1600.0]], (2, 500))
    wanted = sum(h * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2 * s * s)) for e, n, h, s in hills)
    assert peaks.height(east, north) == pytest.approx(wanted, abs=0.002 * 400)
    # 728 m apart: 2.427 sigmas of the first, 4.55 of the second.
    summits = peaks.height(hills[:, 0], hills[:, 1])
    assert summits == pytest.approx([400.0 + 250 * 3.19e-5, 250.0 + 400 * 0.05260], abs=0.3)


def test_clearance_over_measured_ground() -> None:
    terrain = load_scenario("jacksboro-air").terrain
    assert terrain is not None
    random = np.random.default_rng(5)
    for _ in range(40):
        start, end = random.uniform([-11000, -8000, 300], [11000, 8000, 1100], (2, 3))
        low, at = terrain.clearance(start, end)
        points = start + np.linspace(0.0, 1.0, 8001)[:, None] * (end - start)
        above = points[:, 2] - terrain.height(points[:, 0], points[:, 1])
        assert above.min() - 2.0 <= low <= above.min() + 0.01
        assert abs(np.argmin(above) / 8000 - at) < 0.001 or above[round(at * 8000)] < above.min() + 1.0
