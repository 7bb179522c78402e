"""The map plane against geodesics, and the polynomial copies against the map."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from world.frames import GeoOrigin, PolyMap, crs_transformer, fit_polymap, polymap, to_geo, to_map

WGS84 = Geod(ellps="WGS84")
# pyproj writes an origin with 15 digits after the point: 1e-9 degrees (0.1 mm) beside zero are lost.
ORIGINS = st.builds(
    GeoOrigin,
    st.floats(-85.0, 85.0).map(lambda x: round(x, 7)),
    st.floats(-180.0, 180.0).map(lambda x: round(x, 7)),
)


@given(ORIGINS, st.floats(-200_000.0, 200_000.0), st.floats(-200_000.0, 200_000.0))
def test_map_and_back(origin: GeoOrigin, east: float, north: float) -> None:
    lat, lon = to_geo(origin, east, north)
    back = to_map(origin, lat, lon)
    # PROJ takes everything nearer than 1e-10 earth radii to the origin for the origin.
    assert (float(back[0]), float(back[1])) == pytest.approx(
        (east, north), abs=1e-3 if math.hypot(east, north) < 1e-3 else 1e-6
    )


@given(ORIGINS, st.floats(-math.pi, math.pi), st.floats(1.0, 200_000.0))
def test_distance_and_course_from_the_origin_are_the_geodesic(origin: GeoOrigin, course: float, reach: float) -> None:
    lat, lon = to_geo(origin, reach * math.sin(course), reach * math.cos(course))
    azimuth, _, distance = WGS84.inv(origin.lon_deg, origin.lat_deg, float(lon), float(lat))
    assert distance == pytest.approx(reach, abs=1e-6)
    assert math.remainder(math.radians(azimuth) - course, math.tau) * reach == pytest.approx(0.0, abs=1e-5)


def test_known_point() -> None:
    # Geodesic by Karney's method (GeographicLib's GeodSolve -i, through PROJ): 100 km north-east of 46 N 8 E.
    lon, lat, _ = WGS84.fwd(8.0, 46.0, 45.0, 100_000.0)
    east, north = to_map(GeoOrigin(46.0, 8.0), lat, lon)
    assert (float(east), float(north)) == pytest.approx((70710.678118, 70710.678118), abs=1e-5)
    # A metre of latitude at the equator and at 46 degrees, from the meridian's radius of curvature.
    for lat_deg in (0.0, 46.0):
        sin2 = math.sin(math.radians(lat_deg)) ** 2
        radius = 6378137.0 * (1 - 0.00669437999014) / (1 - 0.00669437999014 * sin2) ** 1.5
        _, north = to_map(GeoOrigin(lat_deg, 8.0), lat_deg + 1e-3, 8.0)
        assert float(north) == pytest.approx(radius * math.radians(1e-3), rel=1e-7)


def test_shapes_are_kept() -> None:
    origin = GeoOrigin(46.0, 8.0)
    east, north = to_map(origin, np.full((2, 3), 46.1), np.full((2, 3), 8.1))
    assert east.shape == north.shape == (2, 3)
    assert to_map(origin, 46.0, 8.0)[0].shape == ()


def test_transformer_keeps_the_axis_order_and_names_what_it_does_not_know() -> None:
    east, north = crs_transformer("EPSG:32632").transform(9.0, 46.0)
    assert east == pytest.approx(500_000.0, abs=1e-6)  # the central meridian of zone 32
    assert 5_000_000.0 < north < 5_200_000.0
    with pytest.raises(ValueError, match="EPSG"):
        crs_transformer("EPSG:999999")


@settings(max_examples=25)
@given(st.floats(-80.0, 80.0), st.floats(10.0, 60_000.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_polynomial_copy_of_a_frame_change(lat_deg: float, half: float, u: float, v: float) -> None:
    origin = GeoOrigin(lat_deg, 8.0)

    def true(east: np.ndarray, north: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lat, lon = to_geo(origin, east, north)
        return lat * 1200.0, lon * 1200.0  # in pixels of 3 arc seconds

    copy = fit_polymap(true, [[-half, half], [-half, half]], 1e-3)
    assert copy.residual <= 1e-3
    wanted = true(np.array(u * half), np.array(v * half))
    got = copy(u * half, v * half)
    assert got[0] == pytest.approx(float(wanted[0]), abs=2e-3)
    assert got[1] == pytest.approx(float(wanted[1]), abs=2e-3)
    assert polymap(copy.record, u * half, v * half) == (float(got[0]), float(got[1]))


def test_polynomial_says_how_wrong_it_is() -> None:
    def step(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.sign(x), y

    copy = fit_polymap(step, [[-1.0, 1.0], [-1.0, 1.0]], 1e-6)
    grid = np.linspace(-1.0, 1.0, 401)
    worst = np.abs(copy(grid, 0.0 * grid)[0] - np.sign(grid)).max()
    assert copy.residual > 0.1
    assert worst > 0.1
    with pytest.raises(ValueError, match="read-only"):
        copy.record["u"][0, 0] = 1.0


def test_polynomial_goes_through_the_rows_of_a_log_bit_for_bit() -> None:
    copy = fit_polymap(lambda x, y: (np.sin(x / 900.0) * y, x - y), [[-500.0, 1500.0], [0.0, 800.0]], 1e-9)
    rows = copy.to_rows()
    size = rows.shape[1]
    assert rows.shape == (2 + 2 * size, size)
    again = PolyMap.from_rows(rows, copy.residual)
    assert np.array_equal(again.to_rows(), rows)
    x, y = np.random.default_rng(8).uniform(0.0, 800.0, (2, 50))
    assert np.array_equal(np.stack(again(x, y)), np.stack(copy(x, y)))


@pytest.mark.parametrize("shape", [(), (1,), (1, 1), (2,), (2, 3)])
def test_a_shape_comes_back_whatever_it_is(shape: tuple[int, ...]) -> None:
    """One point in an array is an array of one point, and the same numbers."""
    origin = GeoOrigin(46.0, 8.0)
    lat, lon = to_geo(origin, np.full(shape, 100.0), np.full(shape, 200.0))
    east, north = to_map(origin, lat, lon)
    assert lat.shape == lon.shape == east.shape == north.shape == shape
    many = to_geo(origin, np.full(3, 100.0), np.full(3, 200.0))
    assert set(lat.ravel().tolist()) == {float(many[0][0])}
    assert set(lon.ravel().tolist()) == {float(many[1][0])}
