"""What is no elevation file, or has no data in the area, is refused in one line."""

import re
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
import rasterio
from pyproj import Transformer

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
    made_tile,
    read_window,
    write_geotiff,
    write_hgt,
    write_in_crs,
    write_npz,
    write_raster,
)
from world.elevation_formats import FORMATS
from world.errors import TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.raster import open_raster, require_covered


def test_heights_that_are_not_in_metres_are_refused(tmp_path: Path) -> None:
    datum = write_in_crs(tmp_path / "datum.tif", "EPSG:32632+6360")
    assert_refused(datum, "unit of heights: US survey foot: expected metres")
    path = write_geotiff(tmp_path / "unit.tif")
    for unit, taken in (("ft", False), ("Meters", True), ("m", True)):
        with rasterio.open(path, "r+") as out:
            out.units = (unit,)
        if taken:
            assert read_window(path).heights.size
        else:
            assert_refused(path, "unit of heights: ft: expected metres")


@pytest.mark.parametrize("of_band", [True, False])
@pytest.mark.parametrize(
    ("key", "value", "taken"),
    [
        ("units", "feet", False),
        ("VERTICAL_UNITS", "US_survey_foot", False),
        ("elevation#units", "Ft (NAVD88)", False),
        ("Unit", "us-ft", False),
        ("units", "metres", True),
        ("HORIZONTAL_UNITS", "feet", True),
        ("source", "a map in feet", True),
    ],
)
def test_feet_that_a_tag_states_are_refused(key: str, value: str, taken: bool, of_band: bool, tmp_path: Path) -> None:
    """A tag that GDAL gives no meaning; what it says of the places across the ground, or as a remark, is no unit."""
    path = write_geotiff(tmp_path / "unit.tif")
    with rasterio.open(path, "r+") as out:
        out.update_tags(*([1] if of_band else []), **{key: value})
    if taken:
        assert read_window(path).heights.size
    else:
        assert_refused(path, f"unit of heights: {re.escape(value)} \\(tag {key}\\): expected metres")


VRT = """<VRTDataset rasterXSize="2" rasterYSize="2"><VRTRasterBand dataType="Float32" band="1"><SimpleSource>
<SourceFilename>secret.tif</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"""


@pytest.mark.parametrize("name", ["a.tif", "a.hgt", "N46E008.hgt"])
def test_a_vrt_is_refused_under_any_other_name(name: str, tmp_path: Path) -> None:
    write_geotiff(tmp_path / "secret.tif")
    (tmp_path / name).write_text(VRT, encoding="utf-8")
    assert_refused(tmp_path / name, "not a")


@pytest.mark.parametrize(
    "path", ["/vsizip/x.zip/a.tif", "/vsicurl/http://x/a.tif", "http://x/a.tif", "file:///a.tif", "s3://bucket/a.tif"]
)
def test_urls_and_virtual_paths_are_refused(path: str, tmp_path: Path) -> None:
    assert_refused(path, "only local files")
    with pytest.raises(TerrainError, match=r"only local files|no such elevation file"):
        open_raster(path, tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"PK", b"PK\x03\x04 no zip at all", b"\x89PNG\r\n", b"II*\0 no tiff at all", bytes(1000)]
)
@pytest.mark.parametrize("suffix", [".npz", ".tif", ".hgt", ""])
def test_what_is_no_elevation_is_refused(content: bytes, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"x{suffix}"
    path.write_bytes(content)
    assert_refused(path, "not")
    assert_refused(tmp_path / "missing.tif", "no such elevation file")
    (tmp_path / "empty").mkdir()
    assert_refused(tmp_path / "empty", "a folder without an elevation file")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_damaged_npz_is_refused_whatever_packed_it(method: int, tmp_path: Path) -> None:
    whole, path = write_npz(tmp_path / "whole.npz"), tmp_path / "a.npz"
    with zipfile.ZipFile(whole) as source, zipfile.ZipFile(path, "w", method) as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
        first = target.infolist()[0]
    begins = 30 + len(first.filename)
    assert read_window(path).heights.size
    data = path.read_bytes()
    path.write_bytes(data[:begins] + bytes(first.compress_size) + data[begins + first.compress_size :])
    assert_refused(path, r"not a readable \.npz elevation file")


def test_odd_geotiffs(tmp_path: Path) -> None:
    transform = from_origin(WEST, NORTH, PITCH, PITCH)
    profile = {"driver": "GTiff", "height": 9, "width": 9, "dtype": "float32", "transform": transform}
    with rasterio.open(tmp_path / "two.tif", "w", count=2, crs="EPSG:4326", **profile) as out:
        out.write(np.zeros((2, 9, 9), dtype=np.float32))
    assert_refused(tmp_path / "two.tif", "bands: 2")
    assert_refused(write_geotiff(tmp_path / "c.tif", np.ones((9, 9), dtype=np.complex64)), "numbers")
    with rasterio.open(tmp_path / "bare.tif", "w", count=1, **profile) as out:
        out.write(np.zeros((1, 9, 9), dtype=np.float32))
    assert_refused(tmp_path / "bare.tif", "no coordinate reference system")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            tmp_path / "none.tif", "w", driver="GTiff", height=9, width=9, count=1, dtype="int16"
        ) as out:
            out.write(np.zeros((1, 9, 9), dtype=np.int16))
    assert_refused(tmp_path / "none.tif", "no coordinate reference system")
    assert_refused(write_geotiff(tmp_path / "thin.tif", np.zeros((1, 50), dtype=np.int16)), "at least 2 x 2")
    whole = write_geotiff(tmp_path / "whole.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(whole[: len(whole) // 2])
    assert_refused(tmp_path / "cut.tif", r"not a readable|cannot be read")


def test_area_beyond_the_tile(tmp_path: Path) -> None:
    path = write_npz(tmp_path / "t.npz")
    assert_refused(path, "reaches beyond the tile", bounds=BOUNDS * 4)
    assert_refused(path, "reaches beyond the tile", origin=GeoOrigin(MIDDLE.lat_deg + 1.0, MIDDLE.lon_deg))
    # A buffer is cut at the edge without a word.
    assert not np.isnan(read_window(path, buffer=50_000.0).heights).any()


def test_the_corner_beyond_a_tilted_tile_is_named(tmp_path: Path) -> None:
    """In UTM a map about 8 E is turned by 0.72 degrees, so a box within the tile's extents has corners outside."""
    path = write_in_crs(tmp_path / "t.tif")
    with rasterio.open(path) as tile:
        (west, south, east, north), half_pixel = tile.bounds, 0.5 * tile.transform.a
    raster = open_raster(str(path))
    extents = np.array([[np.min(axis), np.max(axis)] for axis in to_map(MIDDLE, *raster.corners.T[::-1])])
    with pytest.raises(TerrainError) as caught:
        require_covered(raster, MIDDLE, extents)
    found = re.search(
        r"its corner east (-?\d+) m, north (-?\d+) m is (\d+) m outside the data; the largest area inside is"
        r" east (-?\d+)\.\.(-?\d+) m, north (-?\d+)\.\.(-?\d+) m \(",
        str(caught.value),
    )
    assert found is not None, caught.value
    corner_east, corner_north, outside, *inner = (float(number) for number in found.groups())
    to_utm = Transformer.from_crs(4326, "EPSG:32632", always_xy=True)
    farthest = 0.0
    for corner in ((e, n) for e in extents[0] for n in extents[1]):
        lat, lon = to_geo(MIDDLE, *(np.array([value]) for value in corner))
        x, y = (float(value[0]) for value in to_utm.transform(lon, lat))
        across = max(west + half_pixel - x, x - east + half_pixel, 0.0)
        along = max(south + half_pixel - y, y - north + half_pixel, 0.0)
        distance = float(np.hypot(across, along))
        if np.hypot(corner[0] - corner_east, corner[1] - corner_north) < 1.0:
            assert outside == pytest.approx(distance, abs=1.0)
        farthest = max(farthest, distance)
    assert outside == pytest.approx(farthest, abs=1.0)
    assert outside > 50.0
    require_covered(raster, MIDDLE, np.array(inner).reshape(2, 2))


@pytest.mark.parametrize("value", [np.nan, -9999.0, -32768.0, 1e20, np.inf])
def test_missing_data_in_the_area_is_refused_stated_or_not(value: float, tmp_path: Path) -> None:
    heights = made_tile()
    heights[ROWS // 2, COLS // 2 - 7] = value
    assert_refused(write_geotiff(tmp_path / "t.tif", heights), "no data at east -1[456]")
    with np.errstate(over="ignore"):
        assert_refused(write_npz(tmp_path / "t.npz", elevation=heights), "no data at east")
    stated = made_tile()
    stated[3, 3] = 777.0
    stated[ROWS // 2, COLS // 2] = 777.0
    assert_refused(write_geotiff(tmp_path / "s.tif", stated, nodata=777.0), "no data at east")
    # Beyond the area it does no harm.
    away = made_tile()
    away[2, 2] = value
    assert read_window(write_geotiff(tmp_path / "away.tif", away), buffer=0.0).heights.size > 0


def test_one_missing_pixel_of_a_large_fine_area_is_found(tmp_path: Path) -> None:
    heights = np.full((1500, 1500), 500.0, dtype=np.float32)
    heights[761, 333] = np.nan
    transform = from_origin(500_000.0, 5_100_000.0, 5.0, 5.0)
    path = write_raster(tmp_path / "t.tif", heights, "EPSG:32632", transform)
    origin = open_raster(str(path)).centre
    assert_refused(path, "1 of .* pixels", bounds=np.array([[-3500.0, 3500.0], [-3500.0, 3500.0]]), origin=origin)


def test_hgt_void_is_missing_data(tmp_path: Path) -> None:
    path = write_hgt(tmp_path)
    posts = np.frombuffer(path.read_bytes(), dtype=">i2").reshape(1201, 1201).copy()
    row, col = round((47.0 - MIDDLE.lat_deg) * 1200), round((MIDDLE.lon_deg - 8.0) * 1200)
    posts[row, col] = -32768
    path.write_bytes(posts.tobytes())
    assert_refused(path, "no data at east")


def test_no_format_is_known_by_fewer_than_four_bytes() -> None:
    """A file of another kind begins with a height, which may be any two bytes."""
    assert all(len(mark) >= 4 for known in FORMATS for mark in known.begins)
