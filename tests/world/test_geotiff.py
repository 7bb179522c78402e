"""GeoTIFF without GDAL: the numbers that GDAL wrote and the place that it stated, however they are stored."""

import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.transform import Affine as GdalAffine

from tests.world.made.elevation_files import from_origin, write_raster
from world.elevation_tiles import Affine
from world.errors import MissingExtraError, TerrainError
from world.geotiff import BadTiffError, UnreadTiffError, geotiff_bytes, read_geotiff
from world.raster import open_raster

ROWS, COLS = 150, 203
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


PACKINGS: dict[str, dict[str, Any]] = {
    "stored": {},
    "deflate": {"compress": "deflate"},
    "deflate, differences": {"compress": "deflate", "predictor": 2},
    "deflate, bytes apart": {"compress": "deflate", "predictor": 3},
    "lzw": {"compress": "lzw"},
    "lzw, differences": {"compress": "lzw", "predictor": 2},
    "lzw, bytes apart": {"compress": "lzw", "predictor": 3},
    "zstd": {"compress": "zstd"},
    "lzma": {"compress": "lzma"},
}
LAYOUTS: dict[str, dict[str, Any]] = {
    "strips": {"blockysize": 16},
    "one strip": {"blockysize": ROWS},
    "tiles": {"tiled": True, "blockxsize": 64, "blockysize": 32},
    "large tile": {"tiled": True, "blockxsize": 256, "blockysize": 256},
    "big-endian": {"tiled": True, "blockxsize": 64, "blockysize": 32, "ENDIANNESS": "BIG"},
    "big-endian BigTIFF": {"blockysize": 7, "ENDIANNESS": "BIG", "BIGTIFF": "YES"},
}


TYPES = ("float32", "int16", "uint16", "float64", "int32", "uint8")
CASES = [("tiles", packing, dtype) for packing in PACKINGS for dtype in TYPES] + [
    (layout, packing, dtype)
    for layout in LAYOUTS
    for packing in ("stored", "lzw, differences", "deflate, bytes apart")
    for dtype in ("float32", "int16")
]


def can_be_written(packing: str, dtype: str) -> bool:
    """Bytes apart are of numbers with a point alone; GDAL of before 2023 writes no differences of 64 bits."""
    predictor = PACKINGS[packing].get("predictor")
    return dtype.startswith("float") if predictor == 3 else (predictor, dtype) != (2, "float64")


@pytest.mark.parametrize(("layout", "packing", "dtype"), [case for case in CASES if can_be_written(*case[1:])])
def test_numbers_are_those_that_gdal_reads(layout: str, packing: str, dtype: str, tmp_path: Path) -> None:
    path = write_raster(tmp_path / "t.tif", numbers(dtype), "EPSG:32632", PLACE, **LAYOUTS[layout], **PACKINGS[packing])
    with rasterio.open(path) as gdal:
        stored = gdal.read(1)
    # What GDAL of before 2023 writes big-endian with bytes apart is spoilt, for itself, too.
    assert "BIG" in LAYOUTS[layout].get("ENDIANNESS", "") or np.array_equal(stored, numbers(dtype))
    found = read_geotiff(path)
    assert (found.shape, found.bands, found.crs) == ((ROWS, COLS), 1, "EPSG:32632")
    assert found.transform == tuple(PLACE)[:6]
    heights = stored.astype(np.float32)
    assert np.array_equal(found.read(0, ROWS, 0, COLS), heights, equal_nan=True)
    # A window that begins and ends within blocks, and one pixel.
    assert np.array_equal(found.read(13, 101, 61, 130), heights[13:101, 61:130], equal_nan=True)
    assert np.array_equal(found.read(149, 150, 202, 203), heights[149:, 202:], equal_nan=True)


def test_numbers_without_data_are_none_and_others_are_scaled(tmp_path: Path) -> None:
    stored = np.full((20, 30), 500, np.int16)
    stored[3, 4] = -9999
    path = write_raster(tmp_path / "t.tif", stored, "EPSG:32632", PLACE, nodata=-9999)
    with rasterio.open(path, "r+") as out:
        out.scales, out.offsets, out.units = (0.1,), (100.0,), ("m",)
    found = read_geotiff(path)
    assert (found.scale, found.offset, found.unit) == (0.1, 100.0, "m")
    heights = found.read(0, 20, 0, 30)
    assert np.isnan(heights[3, 4])
    assert np.isnan(heights).sum() == 1
    assert heights[0, 0] == 150.0
    # A number that the type cannot hold is nobody's.
    text = path.read_bytes().replace(b"-9999\0", b"-99.5\0")
    path.write_bytes(text)
    assert not np.isnan(read_geotiff(path).read(0, 20, 0, 30)).any()


def test_blocks_that_were_never_written_have_no_data(tmp_path: Path) -> None:
    profile = {"driver": "GTiff", "width": 128, "height": 128, "count": 1, "dtype": "float32", "crs": "EPSG:32632"}
    tiles = {"tiled": True, "blockxsize": 64, "blockysize": 64, "sparse_ok": True}
    with rasterio.open(tmp_path / "t.tif", "w", transform=PLACE, **profile, **tiles) as out:
        out.write(np.full((64, 64), 7.0, np.float32), 1, window=((64, 128), (0, 64)))
    found = read_geotiff(tmp_path / "t.tif")
    heights = found.read(0, 128, 0, 128)
    assert (heights[64:, :64] == 7.0).all()
    assert np.isnan(heights).sum() == 3 * 64 * 64
    assert found.span(0, 0) is None


@pytest.mark.parametrize("point", [False, True])
def test_pixels_that_are_points_stand_half_a_pixel_further(point: bool, tmp_path: Path) -> None:
    path = write_raster(tmp_path / "t.tif", np.zeros((9, 9), np.float32), "EPSG:32632", PLACE)
    with rasterio.open(path, "r+") as out:
        out.update_tags(AREA_OR_POINT="Point" if point else "Area")
    with rasterio.open(path) as gdal:
        wanted = tuple(gdal.transform)[:6]
    assert read_geotiff(path).transform == pytest.approx(wanted)


def test_a_turned_grid_is_placed_as_gdal_places_it(tmp_path: Path) -> None:
    turned = GdalAffine(8.0, 6.0, 424_000.0, 6.0, -8.0, 5_099_000.0)
    path = write_raster(tmp_path / "t.tif", np.zeros((9, 9), np.float32), "EPSG:32632", turned)
    assert read_geotiff(path).transform == tuple(turned)[:6]


def test_an_affine_and_its_inverse_lead_back() -> None:
    made = Affine(8.0, 6.0, 424_000.0, 6.0, -8.0, 5_099_000.0)
    assert made.applied(3.0, 5.0) == (424_054.0, 5_098_978.0)
    assert made.inverse().applied(424_054.0, 5_098_978.0) == pytest.approx((3.0, 5.0), abs=1e-9)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632", "EPSG:4326+3855", "EPSG:25832+5783"])
@pytest.mark.parametrize("turned", [False, True])
def test_gdal_reads_what_is_written(crs: str, turned: bool, tmp_path: Path) -> None:
    heights = numbers("float32")
    heights[5, 6] = -32768.0
    place = (1e-3, 2e-4, 8.0, 2e-4, -1e-3, 46.0) if turned else (1e-3, 0.0, 8.0, 0.0, -2e-3, 46.0)
    (tmp_path / "t.tif").write_bytes(geotiff_bytes(heights, place, crs, -32768.0))
    with rasterio.Env(GTIFF_REPORT_COMPD_CS="YES"), rasterio.open(tmp_path / "t.tif") as gdal:
        assert np.array_equal(gdal.read(1), heights)
        assert (gdal.nodata, gdal.units[0]) == (-32768.0, "m")
        assert tuple(gdal.transform)[:6] == pytest.approx(place)
        assert gdal.crs == rasterio.crs.CRS.from_user_input(crs)
    assert read_geotiff(tmp_path / "t.tif").crs == crs


# ----------------------------------------------------------------------
# What is not read here, and what is damaged.

ODD: dict[str, tuple[dict[str, Any], str]] = {
    "packbits": ({"compress": "packbits"}, "packed by method 32773"),
    "jpeg": ({"compress": "jpeg", "dtype": "uint8"}, "packed by method 7"),
    "lerc": ({"compress": "lerc"}, "packed by method 34887"),
    "no code": ({"crs": "+proj=laea +lat_0=46 +lon_0=8 +ellps=bessel +units=m"}, "without a code of EPSG"),
    "12 bits": ({"dtype": "uint16", "nbits": 12}, "numbers of 12 bits"),
}


def write_odd(path: Path, kind: str) -> Path:
    changes = dict(ODD[kind][0])
    heights = np.full((64, 64), 200, changes.pop("dtype", "float32"))
    return write_raster(path, heights, changes.pop("crs", "EPSG:32632"), PLACE, **changes)


@pytest.mark.parametrize("kind", ODD)
def test_rare_kinds_are_read_by_gdal_or_name_the_extra(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_odd(tmp_path / "t.tif", kind)
    with pytest.raises(UnreadTiffError, match=ODD[kind][1]):
        read_geotiff(path)
    assert np.allclose(open_raster(str(path)).read(0, 64, 0, 64), 200.0)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(MissingExtraError) as caught:
        open_raster(str(path))
    line = f"{path}: {ODD[kind][1]}: reading it needs the extra 'gdal': pip install 'planfly[gdal]'"
    assert str(caught.value).replace("blocks ", "").replace("a reference system ", "") == line


def test_a_mask_of_pixels_is_left_to_gdal(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "t.tif", np.full((64, 64), 200.0, np.float32), "EPSG:32632", PLACE)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "r+") as out:
        out.write_mask(np.arange(64 * 64).reshape(64, 64) % 2 == 0)
    with pytest.raises(UnreadTiffError, match="a mask"):
        read_geotiff(path)
    assert np.isnan(open_raster(str(path)).read(0, 64, 0, 64)).sum() == 64 * 32


@pytest.mark.parametrize("packing", ["stored", "deflate", "lzw", "zstd", "lzma"])
def test_a_file_that_is_cut_or_changed_is_told_in_a_line_or_read(
    packing: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whatever byte is another, and wherever it ends: heights, or one line."""
    whole = write_raster(tmp_path / "t.tif", numbers("float32"), "EPSG:32632", PLACE, **PACKINGS[packing]).read_bytes()
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
            found = read_geotiff(bad)
            if found.shape[0] * found.shape[1] < 10**6:
                found.read(0, found.shape[0], 0, found.shape[1])
        except (BadTiffError, UnreadTiffError) as error:
            lines.append(str(error))
    assert len(lines) > 20
    assert not any("\n" in line for line in lines)
    assert capfd.readouterr() == ("", "")


def test_what_a_block_claims_is_no_more_than_it_has(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "t.tif", np.zeros((64, 64), np.float32), "EPSG:32632", PLACE, blockysize=64)
    data = bytearray(path.read_bytes())
    # The one strip's length, 16,384 bytes, as a tag of its own (279, LONG, 1).
    at = data.index(struct.pack("<HHII", 279, 4, 1, 64 * 64 * 4))
    data[at + 8 : at + 12] = struct.pack("<I", 2**31)
    path.write_bytes(data)
    with pytest.raises(BadTiffError, match="beyond the file's end"):
        read_geotiff(path).read(0, 64, 0, 64)
    with pytest.raises(TerrainError, match=r"t\.tif: cannot be read: a block reaches beyond"):
        open_raster(str(path)).read(0, 64, 0, 64)
