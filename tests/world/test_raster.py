"""Elevation files of every format: the same ground at the same places; the tile that we ship; odd .npz files."""

import hashlib
import math
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from pyproj import Transformer
from rasterio.transform import Affine
from scipy.interpolate import RegularGridInterpolator

import world
from tests.soak import some
from tests.world.made.elevation_files import (
    BOUNDS,
    COLS,
    MIDDLE,
    NORTH,
    PITCH,
    ROWS,
    WEST,
    assert_refused,
    from_origin,
    made_ground,
    made_tile,
    read_window,
    write_geotiff,
    write_hgt,
    write_in_crs,
    write_npz,
    write_raster,
)
from world.arrays import Floats
from world.errors import TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.raster import open_raster, read_terrain, require_no_holes, tile_bounds


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"ymax": None}, "ymax: missing"),
        ({"elevation": None}, "elevation: missing"),
        ({"elevation": np.zeros(9)}, "2-D"),
        ({"elevation": np.zeros((1, 9))}, "at least 2 x 2"),
        ({"elevation": np.zeros((9, 0))}, "at least 2 x 2"),
        ({"elevation": np.array([["a", "b"], ["c", "d"]])}, "2-D"),
        ({"elevation": np.zeros((3, 3), dtype=complex)}, "2-D"),
        ({"elevation": np.array([[{}, {}], [{}, {}]])}, "not a readable"),  # a pickle
        ({"xmin": np.nan}, "degrees"),
        ({"xmin": WEST + 1.0, "xmax": WEST + 1.0}, "degrees"),
        ({"ymax": 460.0}, "degrees"),
        ({"xmin": np.zeros(4)}, "not a readable"),
        ({"xmin": "west"}, "not a readable"),
    ],
)
def test_odd_npz_files(changes: dict[str, Any], match: str, tmp_path: Path) -> None:
    assert_refused(write_npz(tmp_path / "t.npz", **changes), match)


def test_damaged_and_bloated_npz(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_npz(tmp_path / "t.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "bad.npz").write_bytes(data)
    assert_refused(tmp_path / "bad.npz", "not a readable")
    (tmp_path / "half.npz").write_bytes(data[: len(data) // 2])
    assert_refused(tmp_path / "half.npz", "not a readable")
    monkeypatch.setattr("world.raster.MAX_PIXELS", 1_000_000)
    np.savez_compressed(tmp_path / "bomb.npz", elevation=np.zeros((1001, 1000)), xmin=0, xmax=1, ymin=0, ymax=1)
    assert_refused(tmp_path / "bomb.npz", "unpacked: at most")
    assert_refused(write_npz(tmp_path / "large.npz", elevation=np.zeros((1001, 1000), np.float32)), "pixels: 1,001,000")
    assert read_window(write_npz(tmp_path / "fits.npz", elevation=np.zeros((1000, 1000), np.float32))).heights.size


# ----------------------------------------------------------------------
# Every format of elevation file reads the same heights at the same places.


WRITERS: dict[str, tuple[Callable[[Path], Path], float]] = {
    "npz": (lambda folder: write_npz(folder / "t.npz"), 0.05),
    "npz-swapped": (lambda folder: write_npz(folder / "t.npz", ymin=NORTH, ymax=NORTH - ROWS * PITCH), 0.05),
    "geographic": (lambda folder: write_geotiff(folder / "t.tif"), 0.05),
    "big-tiff": (lambda folder: write_geotiff(folder / "t.tif", BIGTIFF="YES"), 0.05),
    "tiled-compressed": (lambda folder: write_geotiff(folder / "a.dat", tiled=True, compress="deflate"), 0.05),
    "utm": (lambda folder: write_in_crs(folder / "t.tif"), 0.05),
    "hgt": (write_hgt, 1.0),  # whole metres, and a coarser pitch
}


@pytest.mark.parametrize("kind", WRITERS)
def test_every_format_reads_the_same_ground(kind: str, tmp_path: Path) -> None:
    write, tolerance = WRITERS[kind]
    terrain = read_window(write(tmp_path))
    east, north = np.random.default_rng(2).uniform(-2500.0, 2500.0, (2, 2000))
    lat, lon = to_geo(MIDDLE, east, north)
    assert terrain.height(east, north) == pytest.approx(made_ground(lon, lat), abs=tolerance)
    assert terrain.spacing == pytest.approx({"utm": 20.0, "hgt": 64.0}.get(kind, 21.5), rel=0.01)
    assert len(terrain.sha256) == 64
    low, _ = terrain.clearance(np.array([-2400.0, 0.0, 2000.0]), np.array([2400.0, 100.0, 2000.0]))
    assert 500.0 < low < 1500.0


# Conformal, equal-area, azimuthal about a pole, oblique, in feet on the ground, with heights, and made up for a place.
SYSTEMS: dict[str, float] = {
    "EPSG:3857": 30.0,
    "EPSG:3035": 20.0,
    "EPSG:3413": 25.0,
    "EPSG:2056": 20.0,
    "EPSG:2222": 60.0,
    "EPSG:32632+5773": 20.0,
    "EPSG:4326+3855": 1.0 / 3600.0,
    "+proj=laea +lat_0=46 +lon_0=8 +ellps=bessel +units=m": 20.0,
}


@pytest.mark.parametrize("crs", some(SYSTEMS, 2))
def test_any_reference_system(crs: str, tmp_path: Path) -> None:
    terrain = read_window(write_in_crs(tmp_path / "t.tif", crs, SYSTEMS[crs]), buffer=100.0)
    east, north = np.random.default_rng(3).uniform(-2400.0, 2400.0, (2, 500))
    lat, lon = to_geo(MIDDLE, east, north)
    assert terrain.height(east, north) == pytest.approx(made_ground(lon, lat), abs=0.1)


# The tile that we ship.
TILE = Path(world.__file__).parent / "elevation" / "jacksboro.npz"
# Of the file that all plans over it were made with, which matplotlib's sample data held too.
TILE_SHA256 = "d493f50a33e82a4420494c54d1fca1539d177bdc27ab190bc5fe6e92f62fb637"


def test_the_tile_is_the_one_that_plans_were_made_over() -> None:
    assert hashlib.sha256(TILE.read_bytes()).hexdigest() == TILE_SHA256
    assert open_raster("jacksboro").sha256 == TILE_SHA256
    readme = (TILE.parent / "README.md").read_text(encoding="utf-8")
    assert TILE_SHA256 in readme
    assert {"**Source**", "**Licence**"} <= set(re.findall(r"\*\*\w+\*\*", readme))


def test_the_tile_needs_no_matplotlib() -> None:
    code = (
        "import sys\nsys.modules['matplotlib'] = None\nfrom world.raster import open_raster\n"
        "print(open_raster('jacksboro').shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout == "(344, 403)\n", done.stderr


def test_its_pixels_stand_on_the_grid_of_the_shuttles_survey() -> None:
    """Centres at whole multiples of 3 arc seconds, as SRTM's tiles of that spacing have them."""
    with np.load(TILE) as data:
        west, north, pitch = (float(data[name]) for name in ("xmin", "ymax", "dx"))
    assert pitch == pytest.approx(1.0 / 1200.0, rel=1e-12)
    for centre in (west + pitch / 2, north - pitch / 2):
        assert centre * 1200.0 == pytest.approx(round(centre * 1200.0), abs=1e-5)


def _jacksboro() -> tuple[Floats, Floats, Floats]:
    """Heights, and the latitudes and longitudes of their pixel centres, read without our code.

    The tile's 344 rows of 3 arc seconds begin at the north edge that the file states as its ymax.
    """
    with np.load(TILE) as data:
        heights = data["elevation"].astype(np.float64)
        north, west = float(data["ymax"]), float(data["xmin"])
        pitch = float(data["dx"])
    rows, cols = heights.shape
    return heights, north - (np.arange(rows) + 0.5) * pitch, west + (np.arange(cols) + 0.5) * pitch


def test_jacksboro_at_its_pixel_centres() -> None:
    raster = open_raster("jacksboro")
    heights, lat, lon = _jacksboro()
    origin = raster.centre
    # The tile's box to the last whole pixel.
    terrain = read_terrain(raster, origin, tile_bounds(raster, origin), 0.0)
    reference = RegularGridInterpolator((lat[::-1], lon), heights[::-1])
    rows, cols = np.meshgrid(np.arange(8, 336, 5), np.arange(8, 394, 5))
    east, north = to_map(origin, lat[rows], lon[cols])
    inside = ~np.isnan(terrain.height(east, north))
    assert inside.mean() > 0.98
    # 1e-3 pixels of the map's polynomial on a slope of 36 degrees are 5 cm.
    assert terrain.height(east, north)[inside] == pytest.approx(heights[rows, cols][inside], abs=0.1)
    random_e, random_n = np.random.default_rng(4).uniform(-11_000.0, 11_000.0, (2, 3000))
    at_lat, at_lon = to_geo(origin, random_e, random_n)
    wanted = reference(np.column_stack([at_lat, at_lon]))
    assert terrain.height(random_e, random_n) == pytest.approx(wanted, abs=0.1)


# Places of the ground, as maps have them, deg: https://en.wikipedia.org/wiki/Cross_Mountain_(Tennessee), 1,077 m, the
# highest of the range, and https://en.wikipedia.org/wiki/Norris_Dam.
CROSS_MOUNTAIN = 36.1983, -84.2308
NORRIS_DAM = 36.2242, -84.0917


def _tile_pixel(lat: float, lon: float) -> tuple[float, float]:
    """Row and column of the tile, as our reading places it."""
    col, row = open_raster("jacksboro").to_pixels(np.array(lon), np.array(lat))
    return float(row), float(col)


def test_cross_mountain_is_the_highest_pixel() -> None:
    heights, lat, lon = _jacksboro()
    row, col = np.unravel_index(np.argmax(heights), heights.shape)
    assert heights[row, col] == pytest.approx(1077.0, abs=2.0)
    assert _tile_pixel(*CROSS_MOUNTAIN) == pytest.approx((row, col), abs=1.0)
    assert (lat[row], lon[col]) == pytest.approx(CROSS_MOUNTAIN, abs=1.0 / 1200.0)


def test_norris_dam_stands_where_the_lake_ends() -> None:
    heights, _, _ = _jacksboro()
    row, col = _tile_pixel(*NORRIS_DAM)
    # North of the dam the lake's level, 305 m; south of it the river, 40 m lower.  The dam is the row between.
    at = round(col)
    lake = np.flatnonzero(np.abs(heights[:, at] - 305.0) < 0.5)
    last = int(lake[np.abs(lake - row) < 10].max())
    assert heights[last + 2, at] < 270.0
    assert row == pytest.approx(last + 1, abs=1.0)


def test_a_copy_of_the_tile_lies_where_the_tile_does(tmp_path: Path) -> None:
    copy = tmp_path / "copy.npz"
    copy.write_bytes(TILE.read_bytes())
    assert open_raster(str(copy)).centre == open_raster("jacksboro").centre
    assert open_raster("jacksboro").centre.lat_deg == pytest.approx((36.15958 + 36.44625) / 2, abs=1e-5)


def test_jacksboro_lies_the_right_way_round() -> None:
    # Facts of the place, not of the file.  The Cumberland Mountains stand west, their highest summit in the south; the
    # valley of the Clinch lies lowest, in the south-east.  Norris Dam holds the lake at 305 m (its winter pool, in the
    # month of the Shuttle's survey), and the river leaves it southward at 255 to 260 m.
    raster = open_raster("jacksboro")
    origin = raster.centre
    box = tile_bounds(raster, origin)
    terrain = read_terrain(raster, origin, box, 0.0)
    east = np.linspace(box[0, 0] + 200, box[0, 1] - 200, 300)
    north = np.linspace(box[1, 0] + 200, box[1, 1] - 200, 320)
    heights = terrain.height(*np.meshgrid(east, north))
    row, col = np.unravel_index(np.argmax(heights), heights.shape)
    assert heights[row, col] == pytest.approx(1076.0, abs=6.0)
    assert north[row] < -8_000.0
    assert abs(east[col]) < 3_000.0
    row, col = np.unravel_index(np.argmin(heights), heights.shape)
    assert north[row] < -5_000.0
    assert east[col] > 8_000.0
    half = heights.shape[0] // 2, heights.shape[1] // 2
    assert heights[: half[0], : half[1]].mean() > heights[: half[0], half[1] :].mean() + 150.0
    # The dam is pixel (266, 386) of the tile: 94 rows south and 185 columns east of the middle.
    dam_e, dam_n = (386 - 201) * 74.6, -(266 - 171.5) * 92.5
    lake = terrain.height(dam_e - 100.0 + 60.0 * np.arange(3), dam_n + 280.0)
    river = terrain.height(dam_e + 80.0, dam_n - 280.0)
    assert lake == pytest.approx([305.0] * 3, abs=12.0)
    assert float(river) < 275.0


def test_files_beside_are_ignored(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "t.tif")
    before = read_window(path)
    (tmp_path / "t.tif.aux.xml").write_text(
        "<PAMDataset><GeoTransform>1, 0.5, 0, 2, 0, -0.5</GeoTransform>"
        '<PAMRasterBand band="1"><NoDataValue>900</NoDataValue><Offset>7000</Offset><Scale>3</Scale></PAMRasterBand>'
        "</PAMDataset>",
        encoding="utf-8",
    )
    (tmp_path / "t.tfw").write_text("0.5\n0\n0\n-0.5\n1\n2\n", encoding="utf-8")
    after = read_window(path)
    assert np.array_equal(before.heights, after.heights)
    assert np.array_equal(before.to_pixel.to_rows(), after.to_pixel.to_rows())


def test_stored_scale_and_offset_count(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "t.tif", np.round(made_tile() * 10).astype(np.int16))
    with rasterio.open(path, "r+") as out:
        out.scales, out.offsets = (0.1,), (100.0,)
    assert not (tmp_path / "t.tif.aux.xml").exists()
    lat, lon = to_geo(MIDDLE, 300.0, -900.0)
    assert float(read_window(path).height(300.0, -900.0)) == pytest.approx(
        float(made_ground(lon, lat)) + 100.0, abs=0.2
    )


@pytest.mark.parametrize("kind", ["npz", "tif"])
@pytest.mark.parametrize("west", [179.95, 190.0, 359.9])
def test_longitudes_beyond_180(kind: str, west: float, tmp_path: Path) -> None:
    if kind == "npz" and west > 359.0:
        west = 200.0
    heights = made_tile()
    if kind == "npz":
        path = write_npz(tmp_path / "t.npz", xmin=west, xmax=west + COLS * PITCH)
    else:
        path = write_raster(tmp_path / "t.tif", heights, "EPSG:4326", from_origin(west, NORTH, PITCH, PITCH))
    raster = open_raster(str(path))
    assert -180.0 <= raster.centre.lon_deg <= 180.0
    terrain = read_terrain(raster, raster.centre, BOUNDS, 100.0)
    lat, lon = to_geo(MIDDLE, 1000.0, 700.0)
    assert float(terrain.height(1000.0, 700.0)) == pytest.approx(float(made_ground(lon, lat)), abs=0.1)


def test_a_turned_raster(tmp_path: Path) -> None:
    # Rows along a course of 30 degrees: the header's transform has rotation terms.
    cos, sin = math.sqrt(3) / 2, 0.5
    transform = Affine(20 * cos, 20 * sin, 424_000.0, 20 * sin, -20 * cos, 5_099_000.0)
    col, row = np.meshgrid(np.arange(700) + 0.5, np.arange(700) + 0.5)
    x, y = transform.a * col + transform.b * row + transform.c, transform.d * col + transform.e * row + transform.f
    lon, lat = Transformer.from_crs(32632, 4326, always_xy=True).transform(x, y)
    path = write_raster(
        tmp_path / "t.tif", made_ground(np.asarray(lon), np.asarray(lat)).astype(np.float32), "EPSG:32632", transform
    )
    origin = open_raster(str(path)).centre
    terrain = read_window(path, origin=origin)
    east, north = np.random.default_rng(6).uniform(-2500.0, 2500.0, (2, 200))
    at_lat, at_lon = to_geo(origin, east, north)
    assert terrain.height(east, north) == pytest.approx(made_ground(at_lon, at_lat), abs=0.1)
    assert terrain.spacing == pytest.approx(20.0, rel=0.01)


def test_tile_bounds_fill_the_tile() -> None:
    raster = open_raster("jacksboro")
    box = tile_bounds(raster, raster.centre)
    assert np.ptp(box[0]) == pytest.approx(403 * 74.6, rel=0.02)
    assert np.ptp(box[1]) == pytest.approx(344 * 92.5, rel=0.02)
    read_terrain(raster, raster.centre, box, 1000.0)


@pytest.mark.parametrize("crs", ["EPSG:32632", "EPSG:4326"])
def test_a_large_tile_is_read_by_its_window(tmp_path: Path, crs: str) -> None:
    """10,000 x 10,000 pixels, most of them never written and without data: the window about the area is read alone."""
    side, path = 10_000, tmp_path / "large.tif"
    pitch, west, north = (10.0, 376_000.0, 5_149_000.0) if crs == "EPSG:32632" else (1e-4, 7.6, 46.6)
    east, up = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(8.05, 46.065)
    column, row = int((east - west) / pitch), int((north - up) / pitch)
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=side,
        height=side,
        count=1,
        dtype="float32",
        crs=crs,
        nodata=-9999.0,
        transform=from_origin(west, north, pitch, pitch),
        tiled=True,
        sparse_ok=True,
        compress="deflate",
    ) as out:
        block = np.full((1600, 1600), 321.0, dtype=np.float32)
        out.write(block, 1, window=rasterio.windows.Window(column - 800, row - 800, 1600, 1600))
    tracemalloc.start()
    ground = read_terrain(open_raster(str(path)), GeoOrigin(46.065, 8.05), BOUNDS, 500.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert float(ground.height(0.0, 0.0)) == 321.0
    assert float(ground.height(-2400.0, 2400.0)) == 321.0
    assert ground.heights.size < 2_000_000
    assert peak < 60e6
    wide = read_terrain(open_raster(str(path)), GeoOrigin(46.065, 8.05), 6 * BOUNDS, 500.0)
    with pytest.raises(TerrainError, match="no data at east"):
        require_no_holes(wide, 6 * BOUNDS)
