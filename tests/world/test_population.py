"""Population rasters: densities by hand in both common kinds, coverage, and files that are refused."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import shapely
from pyproj import Geod, Transformer
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

from tests.world.made.elevation_files import from_origin, write_raster
from world.errors import PlanflyError
from world.frames import GeoOrigin
from world.population import Population, PopulationUnit, density_band, read_population

ORIGIN = GeoOrigin(46.0, 8.0)
# 3 seconds of arc, degrees.
PITCH = 1.0 / 1200.0
# Square of 600 m about the origin.
AREA = shapely.box(-300.0, -300.0, 300.0, 300.0)


def hand_area_m2(lat_deg: float) -> float:
    """Area of a cell of 3 seconds of arc from the radii of curvature of WGS84."""
    axis, eccentricity_squared = 6378137.0, 0.00669437999014
    lat = math.radians(lat_deg)
    root = math.sqrt(1.0 - eccentricity_squared * math.sin(lat) ** 2)
    meridian, normal = axis * (1.0 - eccentricity_squared) / root**3, axis / root
    return meridian * normal * math.cos(lat) * math.radians(PITCH) ** 2


def write_degrees(path: Path, people: Any, **more: Any) -> Path:
    """A raster of 40 x 40 cells of 3 seconds of arc about the origin, as WorldPop writes it."""
    people = np.broadcast_to(np.asarray(people, dtype=np.float32), (40, 40))
    transform = from_origin(8.0 - 20 * PITCH, 46.0 + 20 * PITCH, PITCH, PITCH)
    more = {"crs": "EPSG:4326", "transform": transform, "nodata": -99999.0} | more
    return write_raster(path, people, more.pop("crs"), more.pop("transform"), **more)


def write_mollweide(path: Path, people: Any) -> Path:
    """A raster of 40 x 40 cells of 100 m about the origin, as GHS-POP writes it."""
    x, y = Transformer.from_crs("EPSG:4326", "ESRI:54009", always_xy=True).transform(8.0, 46.0)
    transform = from_origin(round(x / 100.0) * 100.0 - 2000.0, round(y / 100.0) * 100.0 + 2000.0, 100.0, 100.0)
    people = np.broadcast_to(np.asarray(people, dtype=np.float64), (40, 40))
    return write_raster(path, people, "ESRI:54009", transform, nodata=-200.0)


def read(path: Path, unit: PopulationUnit = "per-cell", area: Any = AREA, origin: GeoOrigin = ORIGIN) -> Population:
    return read_population(path, unit, origin, area)


def test_people_per_cell_in_degrees_become_a_density(tmp_path: Path) -> None:
    population = read(write_degrees(tmp_path / "worldpop.tif", 3.0))
    # The cells of the area lie within 300 m of 46 degrees, where a cell's area changes by 0.005 %.
    assert population.max_density == pytest.approx(3.0 / hand_area_m2(46.0) * 1e6, rel=1e-4)
    assert population.mean_density == pytest.approx(population.max_density, rel=1e-4)
    assert population.cell_size == pytest.approx(math.sqrt(hand_area_m2(46.0)), rel=1e-4)
    assert population.is_complete


def test_people_per_cell_in_mollweide_become_a_density(tmp_path: Path) -> None:
    """A cell of GHS-POP is 100 m wide on a sphere; the area of its geodesics on the ellipsoid is 0.7 % off at most."""
    path = write_mollweide(tmp_path / "ghs.tif", 3.0)
    with rasterio.open(path) as source:
        corner = source.transform
    x, y = corner.c + 2000.0, corner.f - 2000.0
    corners = [(x, y), (x + 100.0, y), (x + 100.0, y - 100.0), (x, y - 100.0)]
    to_degrees = Transformer.from_crs("ESRI:54009", "EPSG:4326", always_xy=True)
    lon, lat = to_degrees.transform([one[0] for one in corners], [one[1] for one in corners])
    cell_area = abs(Geod(ellps="WGS84").polygon_area_perimeter(lon, lat)[0])
    assert cell_area == pytest.approx(10_000.0, rel=0.008)
    assert read(path).max_density == pytest.approx(3.0 / cell_area * 1e6, rel=1e-4)


def test_a_density_is_taken_as_it_is(tmp_path: Path) -> None:
    population = read(write_degrees(tmp_path / "density.tif", 312.0), "per-km2")
    assert population.max_density == population.mean_density == 312.0


def test_the_densest_cell_that_the_area_touches_counts(tmp_path: Path) -> None:
    people = np.ones((40, 40))
    # The centre of this cell lies 4.5 cells of 92.6 m north of the origin, and half a cell of 64.4 m east of it.
    people[15, 20], people[0, 0] = 50.0, 900.0
    path = write_degrees(tmp_path / "worldpop.tif", people)
    touching = read(path, area=shapely.box(-300.0, -300.0, 300.0, 375.0))
    assert touching.max_density == pytest.approx(50.0 / hand_area_m2(46.0) * 1e6, rel=1e-4)
    assert touching.max_position == pytest.approx((46.0 + 4.5 * PITCH, 8.0 + 0.5 * PITCH), abs=1e-9)
    assert touching.max_place == pytest.approx((0.5 * PITCH * 77_400.0, 4.5 * PITCH * 111_145.0), abs=1.0)
    beside = read(path, area=shapely.box(-300.0, -300.0, 300.0, 365.0))
    assert beside.max_density == pytest.approx(1.0 / hand_area_m2(46.0) * 1e6, rel=1e-4)


@pytest.mark.parametrize(
    ("density", "band"),
    [(0.0, 0), (4.99, 0), (5.0, 1), (49.9, 1), (50.0, 2), (500.0, 3), (5000.0, 4), (49_999.0, 4), (50_000.0, 5)],
)
def test_bands_begin_at_their_limit(density: float, band: int) -> None:
    assert density_band(density) == band


def test_cells_without_data_leave_the_area_incomplete(tmp_path: Path) -> None:
    people = np.ones((40, 40))
    people[20, 20] = -99999.0
    population = read(write_degrees(tmp_path / "worldpop.tif", people))
    # 600 m are 7.8 cells of 77.4 m / 1,200 * 1,000 = 64.5 m and 6.5 of 92.6 m: 10 by 8 cells about the corner of four.
    assert population.known_fraction == pytest.approx(79 / 80)
    assert not population.is_complete


def test_nan_is_no_data(tmp_path: Path) -> None:
    people = np.ones((40, 40))
    people[20, 20] = math.nan
    assert not read(write_degrees(tmp_path / "worldpop.tif", people, nodata=None)).is_complete


def test_an_area_beyond_the_edge_is_incomplete(tmp_path: Path) -> None:
    path = write_degrees(tmp_path / "worldpop.tif", 1.0)
    # The raster ends 20 cells of 64.5 m east of the origin: half of the area lies beyond it.
    population = read(path, area=shapely.box(20 * 64.5 - 300.0, -300.0, 20 * 64.5 + 300.0, 300.0))
    assert 0.4 < population.known_fraction < 0.6


def test_a_raster_in_another_turn_of_longitude_is_read(tmp_path: Path) -> None:
    transform = from_origin(180.0 - 20 * PITCH, 46.0 + 20 * PITCH, PITCH, PITCH)
    path = write_degrees(tmp_path / "date_line.tif", 3.0, transform=transform)
    population = read(path, origin=GeoOrigin(46.0, -180.0))
    assert population.is_complete
    assert population.max_density == pytest.approx(3.0 / hand_area_m2(46.0) * 1e6, rel=1e-4)


def test_bands_are_drawn_where_their_cells_are(tmp_path: Path) -> None:
    people = np.zeros((40, 40))
    people[20, 20] = 3.0
    bands = dict(read(write_degrees(tmp_path / "worldpop.tif", people)).bands)
    assert set(bands) == {0, 3}
    assert bands[3].area == pytest.approx(hand_area_m2(46.0), rel=1e-3)
    # The cell south-east of the origin.
    assert bands[3].bounds[0] == pytest.approx(0.0, abs=0.1)
    assert bands[3].bounds[3] == pytest.approx(0.0, abs=0.1)


# ----------------------------------------------------------------------
# Refusals, each in one line.


def _truncated(path: Path) -> Path:
    write_degrees(path, np.random.default_rng(1).random((40, 40)))
    path.write_bytes(path.read_bytes()[:3000])
    return path


def _text(path: Path) -> Path:
    path.write_text("not a raster")
    return path


def _unplaced(path: Path) -> Path:
    with (
        pytest.warns(NotGeoreferencedWarning),
        rasterio.open(path, "w", driver="GTiff", width=40, height=40, count=1, dtype="float32") as out,
    ):
        out.write(np.ones((1, 40, 40), dtype=np.float32))
    return path


def _no_crs(path: Path) -> Path:
    transform = Affine(PITCH, 0.0, 8.0 - 20 * PITCH, 0.0, -PITCH, 46.0 + 20 * PITCH)
    with rasterio.open(
        path, "w", driver="GTiff", width=40, height=40, count=1, dtype="float32", transform=transform
    ) as out:
        out.write(np.ones((1, 40, 40), dtype=np.float32))
    return path


def _three_bands(path: Path) -> Path:
    transform = Affine(PITCH, 0.0, 8.0, 0.0, -PITCH, 46.0)
    profile = {"driver": "GTiff", "width": 40, "height": 40, "count": 3, "dtype": "uint8", "crs": "EPSG:4326"}
    with rasterio.open(path, "w", **profile, transform=transform) as out:
        out.write(np.ones((3, 40, 40), dtype=np.uint8))
    return path


def _with_unit(path: Path, unit: str) -> Path:
    write_degrees(path, 3.0)
    with rasterio.open(path, "r+") as out:
        out.units = (unit,)
    return path


def _whole_world(path: Path) -> Path:
    return write_raster(path, np.ones((180, 360), dtype=np.float32), "EPSG:4326", from_origin(-180.0, 90.0, 1.0, 1.0))


REFUSED: dict[str, tuple[Callable[[Path], Any], str]] = {
    "missing": (lambda _: None, "no such file"),
    "a folder": (lambda path: path.mkdir(), "no such file"),
    "empty": (lambda path: path.touch(), "not a readable population raster"),
    "text": (_text, "not a readable population raster"),
    "truncated": (_truncated, "not a readable population raster"),
    "no position": (_unplaced, "no coordinate reference system"),
    "no reference system": (_no_crs, "no coordinate reference system"),
    "three bands": (_three_bands, "bands: 3"),
    "elevations": (lambda path: _with_unit(path, "m"), "unit: m: expected people per cell"),
    "densities by unit": (lambda path: _with_unit(path, "people/km2"), "per-km2"),
    "densities by number": (lambda path: write_degrees(path, 7000.0), "the population unit is per-km2"),
    "negative": (lambda path: write_degrees(path, -1.0), "does the file state its NoData value?"),
    "undeclared NoData": (lambda path: write_degrees(path, -200.0, nodata=None), "NoData"),
    "all NoData": (lambda path: write_degrees(path, -99999.0), "no data in the ground risk buffer"),
    "all NaN": (lambda path: write_degrees(path, math.nan, nodata=None), "no data in the ground risk buffer"),
    "elsewhere": (
        lambda path: write_degrees(path, 1.0, transform=from_origin(20.0, 46.0, PITCH, PITCH)),
        "the file covers latitude 45.967..46.000, longitude 20.000..20.033",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_raster_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    make, message = REFUSED[name]
    path = tmp_path / "population.tif"
    make(path)
    with pytest.raises(PlanflyError) as refused:
        read(path)
    assert message in str(refused.value)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("crs", ["EPSG:4326", "ESRI:54009"])
def test_an_area_across_the_antimeridian_is_not_torn(crs: str, tmp_path: Path) -> None:
    """A raster of the whole world ends there: the area beyond its edge is unknown, or the raster is refused."""
    if crs == "EPSG:4326":
        path = _whole_world(tmp_path / "world.tif")
    else:
        transform = from_origin(-18_050_000.0, 9_050_000.0, 50_000.0, 50_000.0)
        path = write_raster(tmp_path / "world.tif", np.ones((362, 722), dtype=np.float32), crs, transform)
    with pytest.raises(PlanflyError, match="edge of the raster's reference system, such as the antimeridian"):
        read(path, origin=GeoOrigin(46.0, 180.0))


def test_a_very_large_area_is_refused(tmp_path: Path) -> None:
    transform = from_origin(8.0, 46.0, PITCH / 100.0, PITCH / 100.0)
    path = write_degrees(tmp_path / "fine.tif", 1.0, transform=transform)
    with pytest.raises(PlanflyError, match="cells; at most 4,000,000 are read"):
        read(path, area=shapely.box(-3000.0, -3000.0, 3000.0, 3000.0))
