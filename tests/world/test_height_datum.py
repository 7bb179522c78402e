"""Heights above an ellipsoid are converted or refused, and a person may state what a file's heights count from."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
from rasterio import Affine

from world.errors import ScenarioError, TerrainError
from world.height_datum import UNSTATED, is_above_ellipsoid
from world.raster import open_raster, read_terrain
from world.scenario import Scenario, load_scenario

ROOT = Path(__file__).parents[2]
WEST, NORTH, STEP, PIXELS, HEIGHT = 8.0, 46.1, 0.001, 40, 500.0
# As programs wrote it before systems of three dimensions had numbers.
OLD_COMPOUND = (
    'COMPD_CS["WGS 84 + Ellipsoid (metre)",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],VERT_CS["Ellipsoid (metre)",'
    'VERT_DATUM["Ellipsoid",2002],UNIT["metre",1],AXIS["Up",UP]]]'
)
# Reference systems of elevation files as EPSG numbers them, and whether EPSG says that heights are ellipsoidal.
SYSTEMS = {
    "EPSG:4979": True,  # WGS 84, three-dimensional
    "EPSG:4937": True,  # ETRS89, three-dimensional
    "EPSG:9754": True,  # WGS 84 (G2139), three-dimensional
    "EPSG:7843": True,  # GDA2020, three-dimensional
    "EPSG:6319": True,  # NAD83(2011), three-dimensional
    OLD_COMPOUND: True,
    "EPSG:4326": False,
    "EPSG:32632": False,
    "EPSG:4326+5773": False,  # EGM96 height
    "EPSG:9518": False,  # EGM2008 height
    "EPSG:25832+5783": False,  # DHHN92 height
    "EPSG:4269+5703": False,  # NAVD88 height
}
SCENARIO = """name = "hill"
[terrain]
kind = "dem"
path = "hill.tif"
{datum}
[area]
east_m = [-300, 300]
north_m = [-300, 300]
[start]
east_m = -200
north_m = 0
amsl_m = 700
[destination]
east_m = 200
north_m = 0
amsl_m = 700
"""


@pytest.fixture(autouse=True)
def without_grids(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No grid of a geoid of this machine's own counts."""
    from world import height_datum

    monkeypatch.setattr(height_datum, "GEOIDS", {"EGM96": 5773})
    monkeypatch.setattr("pyproj.transformer.TransformerGroup.best_available", property(lambda _: False))
    height_datum._find_geoid.cache_clear()
    monkeypatch.chdir(tmp_path)


def write_tile(file: Path, crs: str) -> None:
    """A level tile, 500 m by its own heights."""
    profile = {"driver": "GTiff", "width": PIXELS, "height": PIXELS, "count": 1, "dtype": "float32", "crs": crs}
    metric = not rasterio.crs.CRS.from_user_input(crs).is_geographic
    place = (
        Affine(50.0, 0.0, 500_000.0, 0.0, -50.0, 5_100_000.0) if metric else Affine(STEP, 0.0, WEST, 0.0, -STEP, NORTH)
    )
    with rasterio.open(file, "w", transform=place, GEOTIFF_VERSION="1.1", **profile) as made:
        made.write(np.full((PIXELS, PIXELS), HEIGHT, np.float32), 1)


def scenario_over(file: Path, crs: str, datum: str) -> Scenario:
    write_tile(file, crs)
    (file.parent / "hill.toml").write_text(SCENARIO.format(datum=datum), encoding="utf-8")
    return load_scenario(str(file.parent / "hill.toml"))


@pytest.mark.parametrize("crs", SYSTEMS)
def test_ellipsoidal_systems_are_refused_where_no_grid_is_at_hand_and_others_are_read(crs: str, tmp_path: Path) -> None:
    assert is_above_ellipsoid(crs) == SYSTEMS[crs]
    file = tmp_path / "hill.tif"
    write_tile(file, crs)
    if SYSTEMS[crs]:
        with pytest.raises(TerrainError, match=r"hill\.tif: heights are above the ellipsoid, .*height_datum") as caught:
            open_raster(str(file))
        assert "\n" not in str(caught.value)
    else:
        raster = open_raster(str(file))
        ground = read_terrain(raster, raster.centre, [[-200.0, 200.0], [-200.0, 200.0]], 10.0)
        assert (float(ground.heights.min()), float(ground.heights.max())) == (HEIGHT, HEIGHT)


@pytest.mark.parametrize(
    ("crs", "datum", "height", "text"),
    [
        ("EPSG:4326", "", HEIGHT, UNSTATED),
        ("EPSG:4326+5773", "", HEIGHT, "mean sea level (EGM96 height, as the file states)"),
        ("EPSG:4979", 'height_datum = "egm2008"', HEIGHT, "mean sea level (EGM2008, as stated)"),
        ("EPSG:4979", "height_datum = 47.25", HEIGHT - 47.25, "mean sea level (at 47.25 m in"),
        ("EPSG:4326", "height_datum = -30", HEIGHT + 30.0, "mean sea level (at -30 m in"),
    ],
)
def test_what_heights_count_from_may_be_stated(crs: str, datum: str, height: float, text: str, tmp_path: Path) -> None:
    scenario = scenario_over(tmp_path / "hill.tif", crs, datum)
    assert scenario.terrain is not None
    assert float(scenario.terrain.height(0.0, 0.0)) == height
    assert scenario.terrain.datum.startswith(text)


@pytest.mark.parametrize("value", ['"geoid"', "200.5", "-201", "true", "nan"])
def test_another_datum_is_refused_in_one_line(value: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"terrain\.height_datum") as caught:
        scenario_over(tmp_path / "hill.tif", "EPSG:4326", f"height_datum = {value}")
    assert "\n" not in str(caught.value)


def test_depths_are_refused(tmp_path: Path) -> None:
    # EPSG:5715 is depth below mean sea level.
    write_tile(tmp_path / "hill.tif", "EPSG:4326+5715")
    with pytest.raises(TerrainError, match=r"hill\.tif: heights are positive downwards"):
        open_raster(str(tmp_path / "hill.tif"))


def test_the_datum_of_a_tile_that_we_ship_may_be_stated_too() -> None:
    levels = []
    for datum in (None, 100.0):
        raster = open_raster("jacksboro", datum=datum)
        ground = read_terrain(raster, raster.centre, [[-500.0, 500.0], [-500.0, 500.0]], 100.0)
        levels.append(float(ground.height(0.0, 0.0)))
    assert levels[0] - levels[1] == pytest.approx(100.0, abs=1e-4)


def test_ground_that_is_made_has_no_datum(tmp_path: Path) -> None:
    text = SCENARIO.format(datum="height_datum = 1").replace('path = "hill.tif"', "amsl_m = 5")
    (tmp_path / "flat.toml").write_text(text.replace('"dem"', '"flat"'), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r'height_datum: not a key of kind = "flat"'):
        load_scenario(str(tmp_path / "flat.toml"))


# A geoid of our own in the format of NOAA's .gtx, which PROJ finds by EGM96's name: a plane that rises by 0.5 m for a
# degree of longitude and 0.25 m for one of latitude, and is 47 m high at 46 degrees N and 8 degrees E.
CODE = """
from pyproj import datadir
datadir.append_data_dir(".")
from world.raster import open_raster, read_terrain
raster = open_raster("hill.tif")
ground = read_terrain(raster, raster.centre, [[-1000.0, 1000.0], [-1000.0, 1000.0]], 50.0)
print(raster.centre.lat_deg, raster.centre.lon_deg, ground.height(0.0, 0.0), ground.height(900.0, 0.0), ground.datum)
"""


def test_a_grid_of_the_geoid_converts_heights(tmp_path: Path) -> None:
    south, west, step = 44.0, 6.0, 0.25
    lat, lon = south + step * np.arange(17)[:, None], west + step * np.arange(17)[None, :]
    heights = 47.0 + 0.5 * (lon - 8.0) + 0.25 * (lat - 46.0)
    head = np.array([south, west, step, step], ">f8").tobytes() + np.array(heights.shape, ">i4").tobytes()
    (tmp_path / "egm96_15.gtx").write_bytes(head + heights.astype(">f4").tobytes())
    write_tile(tmp_path / "hill.tif", "EPSG:4979")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PROJ_NETWORK": "OFF"}
    done = subprocess.run(
        [sys.executable, "-c", CODE], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    latitude, longitude, middle, east, *datum = done.stdout.split()
    assert " ".join(datum) == "mean sea level, converted from the ellipsoid by EGM96"
    undulation = 47.0 + 0.5 * (float(longitude) - 8.0) + 0.25 * (float(latitude) - 46.0)
    assert float(middle) == pytest.approx(HEIGHT - undulation, abs=1e-3)
    # A degree of longitude is 77.4 km there.
    assert float(east) - float(middle) == pytest.approx(-0.5 * 0.9 / 77.4, abs=1e-4)


def test_a_reference_system_that_stands_beside_the_file_is_named(tmp_path: Path) -> None:
    """GeoTIFF has no place for a projected system of three dimensions: GDAL writes it into a file beside."""
    file = tmp_path / "hill.tif"
    write_tile(file, pyproj.CRS("EPSG:32632").to_3d().to_wkt())
    beside = tmp_path / "hill.tif.aux.xml"
    assert beside.exists()
    said = "no coordinate reference system and position are stated"
    with pytest.raises(TerrainError, match=rf"{said} in the file itself; hill\.tif\.aux\.xml is not read$"):
        open_raster(str(file))
    beside.unlink()
    with pytest.raises(TerrainError, match=f"{said}$"):
        open_raster(str(file))
