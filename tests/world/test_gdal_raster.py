"""GeoTIFF files: the numbers and the place that were written, however stored; damage and foreign files are refused."""

import socket
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.shutil import copy as copy_raster
from rasterio.transform import Affine

from tests.world.made import elevation_files as made
from tests.world.made.elevation_files import assert_refused, from_origin, made_tile, write_geotiff, write_raster
from world.errors import TerrainError
from world.gdal_raster import block_spans, geotiff_bytes, open_geotiff
from world.raster import open_raster

ROWS = 150
COLS = 203
PLACE = from_origin(500_000.0, 5_100_000.0, 10.0, 10.0)


def numbers(dtype: str) -> NDArray[Any]:
    """Numbers that fill the type: neighbours differ by much and by little, above and below zero."""
    rng = np.random.default_rng(7)
    ground = (
        900.0 + 80.0 * np.sin(np.arange(COLS) / 9.0) + 2.0 * np.arange(ROWS)[:, None] + rng.normal(size=(ROWS, COLS))
    )
    if np.dtype(dtype).kind == "f":
        return ground.astype(dtype)
    info = np.iinfo(dtype)
    return (np.round(ground * 37.0).astype(np.int64) % (info.max - info.min + 1) + info.min).astype(dtype)


TILES: dict[str, Any] = {"tiled": True, "blockxsize": 64, "blockysize": 32}
STORED: dict[str, tuple[str, dict[str, Any]]] = {
    "strips": ("float32", {"blockysize": 16}),
    "one strip, lzw": ("int16", {"blockysize": ROWS, "compress": "lzw", "predictor": 2}),
    "tiles, deflate": ("float32", {**TILES, "compress": "deflate", "predictor": 3}),
    "tiles, lzw": ("float32", {**TILES, "compress": "lzw", "predictor": 3}),
    "tiles, zstd": ("uint16", {**TILES, "compress": "zstd"}),
    "tiles, lzma": ("int32", {**TILES, "compress": "lzma"}),
    "tiles, lerc": ("float64", {**TILES, "compress": "lerc"}),
    "packbits": ("uint8", {"compress": "packbits"}),
    "big-endian": ("int16", {**TILES, "ENDIANNESS": "BIG"}),
    "big-endian BigTIFF": ("float32", {"blockysize": 7, "ENDIANNESS": "BIG", "BIGTIFF": "YES"}),
    "12 bits": ("uint16", {"nbits": 12}),
}


@pytest.mark.parametrize("stored", STORED)
def test_numbers_are_those_that_were_written(stored: str, tmp_path: Path) -> None:
    dtype, layout = STORED[stored]
    written = numbers(dtype) % 4096 if stored == "12 bits" else numbers(dtype)
    found = open_raster(str(write_raster(tmp_path / "t.tif", written, "EPSG:32632", PLACE, **layout)))
    assert (found.shape, found.grid) == ((ROWS, COLS), tuple(PLACE)[:6])
    heights = written.astype(np.float32)
    assert np.array_equal(found.read(0, ROWS, 0, COLS), heights)
    # A window that begins and ends within blocks, and one pixel.
    assert np.array_equal(found.read(13, 101, 61, 130), heights[13:101, 61:130])
    assert np.array_equal(found.read(149, 150, 202, 203), heights[149:, 202:])


def test_missing_data_is_nan_and_other_numbers_are_scaled(tmp_path: Path) -> None:
    stored = np.full((20, 30), 500, np.int16)
    stored[3, 4] = -9999
    path = write_raster(tmp_path / "t.tif", stored, "EPSG:32632", PLACE, nodata=-9999)
    with rasterio.open(path, "r+") as out:
        out.scales, out.offsets, out.units = (0.1,), (100.0,), ("m",)
    heights = open_raster(str(path)).read(0, 20, 0, 30)
    assert np.isnan(heights[3, 4])
    assert np.isnan(heights).sum() == 1
    assert heights[0, 0] == 150.0
    # A number that the type cannot hold is no pixel's.
    path.write_bytes(path.read_bytes().replace(b"-9999\0", b"-99.5\0"))
    assert not np.isnan(open_raster(str(path)).read(0, 20, 0, 30)).any()


@pytest.mark.parametrize("nodata", [None, -9999.0])
def test_blocks_that_were_never_written_have_no_data(nodata: float | None, tmp_path: Path) -> None:
    profile = {"driver": "GTiff", "width": 128, "height": 128, "count": 1, "dtype": "float32", "crs": "EPSG:32632"}
    tiles = {"tiled": True, "blockxsize": 64, "blockysize": 64, "sparse_ok": True, "nodata": nodata}
    path = tmp_path / "t.tif"
    with rasterio.open(path, "w", transform=PLACE, **profile, **tiles) as out:
        out.write(np.full((64, 64), 7.0, np.float32), 1, window=((64, 128), (0, 64)))
    found = open_raster(str(path))
    heights = found.read(0, 128, 0, 128)
    assert (heights[64:, :64] == 7.0).all()
    assert np.isnan(heights).sum() == 3 * 64 * 64
    # Windows that begin and end within blocks: 14 rows and 10 columns of the block that was written.
    part = found.read(50, 78, 54, 71)
    assert (part[14:, :10] == 7.0).all()
    assert np.isnan(part).sum() == part.size - 14 * 10
    # One block of 64 x 64 numbers of four bytes has bytes in the file, and nothing follows it.
    [(begin, end)] = block_spans(path, (0, 128, 0, 128))
    assert end - begin == 4 * 64 * 64
    assert np.frombuffer(path.read_bytes()[begin:end], "<f4").tolist() == [7.0] * 64 * 64
    assert list(block_spans(path, (0, 64, 0, 128))) == []


@pytest.mark.parametrize("point", [False, True])
def test_a_place_is_that_of_the_corner_also_where_pixels_are_points(point: bool, tmp_path: Path) -> None:
    """GDAL writes the place of a pixel's middle where pixels are points, and the corner's elsewhere."""
    path = write_raster(tmp_path / "t.tif", np.zeros((9, 9), np.float32), "EPSG:32632", PLACE)
    with rasterio.open(path, "r+") as out:
        out.update_tags(AREA_OR_POINT="Point" if point else "Area")
    # The tie point's x: 500,000 m, or 5 m more.
    tie = struct.pack("<6d", 0.0, 0.0, 0.0, 500_000.0 + 5.0 * point, 5_100_000.0 - 5.0 * point, 0.0)
    assert tie in path.read_bytes()
    assert open_raster(str(path)).grid == pytest.approx((10.0, 0.0, 500_000.0, 0.0, -10.0, 5_100_000.0))


def test_a_turned_grid_and_its_inverse_lead_back(tmp_path: Path) -> None:
    turned = Affine(8.0, 6.0, 424_000.0, 6.0, -8.0, 5_099_000.0)
    found = open_raster(str(write_raster(tmp_path / "t.tif", np.zeros((9, 9), np.float32), "EPSG:32632", turned)))
    assert found.grid == tuple(turned)[:6]
    col, row = np.array([0.0, 3.0, 8.0]), np.array([1.0, 5.0, 8.0])
    back = found.to_pixels(*found.to_lon_lat(col, row))
    assert np.stack(back) == pytest.approx(np.stack([col, row]), abs=1e-6)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632", "EPSG:4326+3855", "EPSG:25832+5783"])
@pytest.mark.parametrize("turned", [False, True])
def test_what_is_written_is_read(crs: str, turned: bool, tmp_path: Path) -> None:
    heights = numbers("float32")
    heights[5, 6] = -32768.0
    place = (1e-3, 2e-4, 8.0, 2e-4, -1e-3, 46.0) if turned else (1e-3, 0.0, 8.0, 0.0, -2e-3, 46.0)
    (tmp_path / "t.tif").write_bytes(geotiff_bytes(heights, place, crs, -32768.0))
    with rasterio.Env(GTIFF_REPORT_COMPD_CS="YES"), rasterio.open(tmp_path / "t.tif") as gdal:
        assert np.array_equal(gdal.read(1), heights)
        assert (gdal.nodata, gdal.units[0]) == (-32768.0, "m")
        assert tuple(gdal.transform)[:6] == pytest.approx(place)
        assert gdal.crs == rasterio.crs.CRS.from_user_input(crs)
    found = open_geotiff(tmp_path / "t.tif", "t.tif")
    assert np.isnan(found.read(5, 6, 6, 7)).all()
    assert rasterio.crs.CRS.from_user_input(found.crs) == rasterio.crs.CRS.from_user_input(crs)


@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_heights_above_the_ellipsoid_are_refused_in_old_and_new_files(version: str, tmp_path: Path) -> None:
    """EPSG:4937 is ETRS89 with ellipsoidal heights; of a file of version 1.0 GDAL alone would drop the heights."""
    place = from_origin(8.0, 46.0, 0.001, 0.001)
    path = write_raster(tmp_path / "t.tif", np.zeros((9, 9), np.float32), "EPSG:4937", place, GEOTIFF_VERSION=version)
    assert_refused(path, "heights are above the ellipsoid")


def test_a_mask_of_pixels_counts(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "t.tif", np.full((64, 64), 200.0, np.float32), "EPSG:32632", PLACE)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "r+") as out:
        out.write_mask(np.arange(64 * 64).reshape(64, 64) % 2 == 0)
    assert np.isnan(open_raster(str(path)).read(0, 64, 0, 64)).sum() == 64 * 32


def test_a_file_without_the_place_of_a_pixel_is_refused(tmp_path: Path) -> None:
    """GDAL would place it at 0, 0."""
    path = write_geotiff(tmp_path / "t.tif")
    data = path.read_bytes()
    # The tie points' tag (33922, DOUBLE, 6) under a number that nobody knows.
    tag = struct.pack("<HHI", 33922, 12, 6)
    assert data.count(tag) == 1
    path.write_bytes(data.replace(tag, struct.pack("<HHI", 33923, 12, 6)))
    assert_refused(path, "no coordinate reference system and position")


# ----------------------------------------------------------------------
# Damage.


@pytest.mark.parametrize("packing", [{}, {"compress": "deflate"}, {"compress": "lzw"}, {"compress": "zstd"}])
def test_a_file_that_is_cut_or_changed_is_read_or_refused_in_a_line(
    packing: dict[str, str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whatever byte is changed, and wherever the file ends: heights, or one line."""
    whole = write_raster(tmp_path / "t.tif", numbers("float32"), "EPSG:32632", PLACE, **packing).read_bytes()
    rng = np.random.default_rng(3)
    bad = tmp_path / "bad.tif"
    lines = []
    for k in range(60):
        data = bytearray(whole)
        # The directory lies at the begin: half of the changes hit it.
        at = int(rng.integers(4, 400 if k % 2 else len(whole)))
        if k % 3 == 0:
            del data[at:]
        else:
            data[at] ^= int(rng.integers(1, 256))
        bad.write_bytes(data)
        try:
            found = open_raster(str(bad))
            if found.shape[0] * found.shape[1] < 10**6:
                found.read(0, found.shape[0], 0, found.shape[1])
        except TerrainError as error:
            lines.append(str(error))
    assert len(lines) > 20
    assert not any("\n" in line for line in lines)
    assert capfd.readouterr() == ("", "")


def test_a_block_that_claims_more_bytes_than_the_file_has_is_refused(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "t.tif", np.ones((64, 64), np.float32), "EPSG:32632", PLACE, blockysize=64)
    data = bytearray(path.read_bytes())
    # The strip's offset, of 16,384 bytes, as a tag of its own (273, LONG, 1).
    at = data.index(struct.pack("<HHI", 273, 4, 1))
    data[at + 8 : at + 12] = struct.pack("<I", len(data) - 100)
    path.write_bytes(data)
    with pytest.raises(TerrainError, match=r"t\.tif: cannot be read: ") as caught:
        open_raster(str(path)).read(0, 64, 0, 64)
    assert "See previous exception" not in str(caught.value)


# ----------------------------------------------------------------------
# One file, by one driver.


def test_no_file_beside_is_read(tmp_path: Path) -> None:
    """A mask, overviews, a world file, and GDAL's own notes, each of which would change what is read."""
    path = write_geotiff(tmp_path / "t.tif")
    before = open_raster(str(path))
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False), rasterio.open(path, "r+") as out:
        out.write_mask(np.zeros((made.ROWS, made.COLS), bool))
    assert (tmp_path / "t.tif.msk").exists()
    (tmp_path / "t.tif.ovr").write_bytes((tmp_path / "t.tif.msk").read_bytes())
    (tmp_path / "t.tfw").write_text("0.5\n0\n0\n-0.5\n1\n2\n", encoding="ascii")
    (tmp_path / "t.tif.aux.xml").write_text(
        "<PAMDataset><SRS>EPSG:4979</SRS><GeoTransform>1, 0.5, 0, 2, 0, -0.5</GeoTransform>"
        '<PAMRasterBand band="1"><NoDataValue>900</NoDataValue><Offset>7000</Offset></PAMRasterBand></PAMDataset>',
        encoding="ascii",
    )
    after = open_raster(str(path))
    assert (after.grid, after.crs) == (before.grid, before.crs)
    assert np.array_equal(after.read(0, made.ROWS, 0, made.COLS), made_tile())


@pytest.mark.parametrize("driver", ["PNG", "AAIGrid", "ENVI", "GPKG"])
@pytest.mark.parametrize("name", ["t.tif", "N46E008.hgt", "t"])
def test_formats_of_other_drivers_are_refused_under_every_name(driver: str, name: str, tmp_path: Path) -> None:
    heights = np.full((64, 64), 200, np.uint8)
    place = from_origin(8.0, 46.0, 0.001, 0.001)
    profile = {"width": 64, "height": 64, "count": 1, "dtype": "uint8", "crs": "EPSG:4326", "transform": place}
    with rasterio.open(tmp_path / "made.tif", "w", driver="GTiff", **profile) as out:
        out.write(heights, 1)
    copy_raster(tmp_path / "made.tif", tmp_path / name, driver=driver)
    assert_refused(tmp_path / name, "not a")


@pytest.mark.parametrize("name", ["t.vrt", "t.tif", "N46E008.hgt"])
@pytest.mark.parametrize("form", ["/vsicurl/{url}/x.tif", "{url}/x.tif", "WMS:{url}", "vrt:///vsicurl/{url}/x.tif"])
def test_a_crafted_virtual_raster_reaches_no_server(form: str, name: str, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        source = form.format(url=f"http://127.0.0.1:{server.getsockname()[1]}")
        (tmp_path / name).write_text(
            '<VRTDataset rasterXSize="9" rasterYSize="9"><SRS>EPSG:4326</SRS><GeoTransform>8,1,0,46,0,-1</GeoTransform>'
            f'<VRTRasterBand dataType="Float32" band="1"><SimpleSource><SourceFilename>{source}</SourceFilename>'
            "</SimpleSource></VRTRasterBand></VRTDataset>",
            encoding="ascii",
        )
        assert_refused(tmp_path / name, "not a|only local")
        server.setblocking(False)
        with pytest.raises(BlockingIOError):
            server.accept()
