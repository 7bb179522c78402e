"""Elevation files: every format reads the same heights at the same places, and what is no elevation is refused."""

import math
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from matplotlib import cbook
from numpy.typing import NDArray
from pyproj import Transformer
from rasterio.transform import Affine
from scipy.interpolate import RegularGridInterpolator

from world.errors import TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.raster import open_raster, read_terrain, tile_bounds
from world.terrain import Terrain

Floats = NDArray[np.float64]


def from_origin(west: float, north: float, width: float, height: float) -> Affine:
    """Header of a raster with its north-west corner here (rasterio's own warns of a change in `affine`)."""
    return Affine(width, 0.0, west, 0.0, -height, north)


# A made tile of 1 arc second, 0.1 by 0.08 degrees, smooth enough to be read alike from another grid.
WEST, NORTH, PITCH = 8.0, 46.1, 1.0 / 3600.0
COLS, ROWS = 360, 288
BOUNDS = np.array([[-2500.0, 2500.0], [-2500.0, 2500.0]])
MIDDLE = GeoOrigin(NORTH - ROWS * PITCH / 2, WEST + COLS * PITCH / 2)


def _ground(lon: Floats, lat: Floats) -> Floats:
    """Made hills, m, as a function of degrees: different in every direction."""
    u, v = (lon - WEST) * 100, (lat - 46.0) * 100
    return 900.0 + 300.0 * np.sin(u / 1.7) * np.cos(v / 2.3) + 60.0 * u - 25.0 * v


def _tile() -> NDArray[np.float32]:
    lon = WEST + (np.arange(COLS) + 0.5) * PITCH
    lat = NORTH - (np.arange(ROWS) + 0.5) * PITCH
    return _ground(lon[None, :], lat[:, None]).astype(np.float32)


def _geotiff(path: Path, heights: NDArray[Any], crs: str, transform: Affine, **more: Any) -> Path:
    profile = {"driver": "GTiff", "height": heights.shape[0], "width": heights.shape[1], "count": 1}
    with rasterio.open(path, "w", **profile, dtype=heights.dtype, crs=crs, transform=transform, **more) as out:
        out.write(heights, 1)
    return path


def _npz(path: Path, **changes: Any) -> Path:
    fields: dict[str, Any] = {
        "elevation": _tile(),
        "xmin": WEST,
        "xmax": WEST + COLS * PITCH,
        "ymin": NORTH - ROWS * PITCH,
        "ymax": NORTH,
    }
    np.savez_compressed(path, **{key: value for key, value in (fields | changes).items() if value is not None})
    return path


def _geo_tiff(path: Path, heights: NDArray[Any] | None = None, **more: Any) -> Path:
    return _geotiff(
        path, _tile() if heights is None else heights, "EPSG:4326", from_origin(WEST, NORTH, PITCH, PITCH), **more
    )


def _crs_tiff(path: Path, crs: str = "EPSG:32632", pitch: float = 20.0) -> Path:
    """The same hills on a grid of ``pitch`` in a CRS, tilted to the meridians."""
    back = Transformer.from_crs(crs, 4326, always_xy=True)
    lat, lon = MIDDLE.lat_deg, MIDDLE.lon_deg
    x, y = back.transform(
        lon + 0.05 * np.array([-1, -1, 1, 1]), lat + 0.04 * np.array([-1, 1, -1, 1]), direction="INVERSE"
    )
    transform = from_origin(x.min(), y.max(), pitch, pitch)
    col, row = np.meshgrid(np.arange(int(np.ptp(x) / pitch)) + 0.5, np.arange(int(np.ptp(y) / pitch)) + 0.5)
    lon, lat = back.transform(transform.a * col + transform.c, transform.e * row + transform.f)
    return _geotiff(path, _ground(np.asarray(lon), np.asarray(lat)).astype(np.float32), crs, transform)


def _hgt(folder: Path) -> Path:
    """An SRTM3 tile: 1201 by 1201 posts, the outer ones on whole degrees."""
    lon = 8.0 + np.arange(1201) / 1200.0
    lat = 47.0 - np.arange(1201) / 1200.0
    heights = np.round(_ground(lon[None, :], lat[:, None])).astype(">i2")
    path = folder / "N46E008.hgt"
    path.write_bytes(heights.tobytes())
    return path


def _read(path: Path | str, bounds: Floats = BOUNDS, origin: GeoOrigin = MIDDLE, margin: float = 500.0) -> Terrain:
    return read_terrain(open_raster(str(path)), origin, bounds, margin)


WRITERS: dict[str, tuple[Callable[[Path], Path], float]] = {
    "npz": (lambda folder: _npz(folder / "t.npz"), 0.05),
    "npz-swapped": (lambda folder: _npz(folder / "t.npz", ymin=NORTH, ymax=NORTH - ROWS * PITCH), 0.05),
    "geographic": (lambda folder: _geo_tiff(folder / "t.tif"), 0.05),
    "big-tiff": (lambda folder: _geo_tiff(folder / "t.tif", BIGTIFF="YES"), 0.05),
    "tiled-compressed": (lambda folder: _geo_tiff(folder / "a.dat", tiled=True, compress="deflate"), 0.05),
    "utm": (lambda folder: _crs_tiff(folder / "t.tif"), 0.05),
    "hgt": (_hgt, 1.0),  # whole metres, and a coarser pitch
}


@pytest.mark.parametrize("kind", WRITERS)
def test_every_format_reads_the_same_ground(kind: str, tmp_path: Path) -> None:
    write, tolerance = WRITERS[kind]
    terrain = _read(write(tmp_path))
    east, north = np.random.default_rng(2).uniform(-2500.0, 2500.0, (2, 2000))
    lat, lon = to_geo(MIDDLE, east, north)
    assert terrain.height(east, north) == pytest.approx(_ground(lon, lat), abs=tolerance)
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
    "EPSG:4979": 1.0 / 3600.0,
    "+proj=laea +lat_0=46 +lon_0=8 +ellps=bessel +units=m": 20.0,
}


@pytest.mark.parametrize("crs", SYSTEMS)
def test_any_reference_system(crs: str, tmp_path: Path) -> None:
    terrain = _read(_crs_tiff(tmp_path / "t.tif", crs, SYSTEMS[crs]), margin=100.0)
    east, north = np.random.default_rng(3).uniform(-2400.0, 2400.0, (2, 500))
    lat, lon = to_geo(MIDDLE, east, north)
    assert terrain.height(east, north) == pytest.approx(_ground(lon, lat), abs=0.1)


def test_heights_that_are_not_in_metres_are_refused(tmp_path: Path) -> None:
    _refused(_crs_tiff(tmp_path / "datum.tif", "EPSG:32632+6360"), "heights in US survey foot: metres are expected")
    path = _geo_tiff(tmp_path / "unit.tif")
    for unit, taken in (("ft", False), ("Meters", True), ("m", True)):
        with rasterio.open(path, "r+") as out:
            out.units = (unit,)
        if taken:
            assert _read(path).heights.size
        else:
            _refused(path, "heights in ft: metres are expected")


# The tile that matplotlib ships.


def _jacksboro() -> tuple[Floats, Floats, Floats]:
    """Heights, and the latitudes and longitudes of their pixel centres, read without our code.

    The file's ymin and ymax are the edges of 344 rows of 3 arc seconds, in the wrong order.
    """
    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as data:
        heights = data["elevation"].astype(np.float64)
        north, west = float(max(data["ymin"], data["ymax"])), float(min(data["xmin"], data["xmax"]))
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


# What is refused, in one line.


def _refused(path: Path | str, match: str, **options: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(TerrainError, match=match) as caught:
            _read(path, **options)
    assert "\n" not in str(caught.value)


VRT = """<VRTDataset rasterXSize="2" rasterYSize="2"><VRTRasterBand dataType="Float32" band="1"><SimpleSource>
<SourceFilename>secret.tif</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"""


@pytest.mark.parametrize("name", ["a.vrt", "a.tif", "a.hgt", "N46E008.hgt"])
def test_a_vrt_is_refused_under_any_name(name: str, tmp_path: Path) -> None:
    _geo_tiff(tmp_path / "secret.tif")
    (tmp_path / name).write_text(VRT, encoding="utf-8")
    _refused(tmp_path / name, "not a")


@pytest.mark.parametrize(
    "path", ["/vsizip/x.zip/a.tif", "/vsicurl/http://x/a.tif", "http://x/a.tif", "file:///a.tif", "s3://bucket/a.tif"]
)
def test_urls_and_virtual_paths_are_refused(path: str, tmp_path: Path) -> None:
    _refused(path, "only local files")
    with pytest.raises(TerrainError, match=r"only local files|no such file"):
        open_raster(path, tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"PK", b"PK\x03\x04 no zip at all", b"\x89PNG\r\n", b"II*\0 no tiff at all", bytes(1000)]
)
@pytest.mark.parametrize("suffix", [".npz", ".tif", ".hgt", ""])
def test_what_is_no_elevation_is_refused(content: bytes, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"x{suffix}"
    path.write_bytes(content)
    _refused(path, "not")
    _refused(tmp_path / "missing.tif", "no such file")
    _refused(tmp_path, "no such file")


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"ymax": None}, "ymax: missing"),
        ({"elevation": None}, "elevation: missing"),
        ({"elevation": np.zeros(9)}, "2-D"),
        ({"elevation": np.zeros((1, 9))}, "2-D"),
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
    _refused(_npz(tmp_path / "t.npz", **changes), match)


def test_damaged_and_bloated_npz(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _npz(tmp_path / "t.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "bad.npz").write_bytes(data)
    _refused(tmp_path / "bad.npz", "not a readable")
    (tmp_path / "half.npz").write_bytes(data[: len(data) // 2])
    _refused(tmp_path / "half.npz", "not a readable")
    monkeypatch.setattr("world.raster_file.MOST_PIXELS", 1_000_000)
    np.savez_compressed(tmp_path / "bomb.npz", elevation=np.zeros((1001, 1000)), xmin=0, xmax=1, ymin=0, ymax=1)
    _refused(tmp_path / "bomb.npz", "unpacked: at most")


def test_odd_geotiffs(tmp_path: Path) -> None:
    transform = from_origin(WEST, NORTH, PITCH, PITCH)
    profile = {"driver": "GTiff", "height": 9, "width": 9, "dtype": "float32", "transform": transform}
    with rasterio.open(tmp_path / "two.tif", "w", count=2, crs="EPSG:4326", **profile) as out:
        out.write(np.zeros((2, 9, 9), dtype=np.float32))
    _refused(tmp_path / "two.tif", "bands: 2")
    _refused(_geo_tiff(tmp_path / "c.tif", np.ones((9, 9), dtype=np.complex64)), "numbers")
    with rasterio.open(tmp_path / "bare.tif", "w", count=1, **profile) as out:
        out.write(np.zeros((1, 9, 9), dtype=np.float32))
    _refused(tmp_path / "bare.tif", "no coordinate reference system")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            tmp_path / "none.tif", "w", driver="GTiff", height=9, width=9, count=1, dtype="int16"
        ) as out:
            out.write(np.zeros((1, 9, 9), dtype=np.int16))
    _refused(tmp_path / "none.tif", "no coordinate reference system")
    _refused(_geo_tiff(tmp_path / "thin.tif", np.zeros((1, 50), dtype=np.int16)), "at least 2 x 2")
    whole = _geo_tiff(tmp_path / "whole.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(whole[: len(whole) // 2])
    _refused(tmp_path / "cut.tif", r"not a readable|cannot be read")


def test_area_beyond_the_tile(tmp_path: Path) -> None:
    path = _npz(tmp_path / "t.npz")
    _refused(path, "reaches beyond the tile", bounds=BOUNDS * 4)
    _refused(path, "reaches beyond the tile", origin=GeoOrigin(MIDDLE.lat_deg + 1.0, MIDDLE.lon_deg))
    # A margin is cut at the edge without a word.
    assert not np.isnan(_read(path, margin=50_000.0).heights).any()


@pytest.mark.parametrize("value", [np.nan, -9999.0, -32768.0, 1e20, np.inf])
def test_missing_data_in_the_area_is_refused_stated_or_not(value: float, tmp_path: Path) -> None:
    heights = _tile()
    heights[ROWS // 2, COLS // 2 - 7] = value
    _refused(_geo_tiff(tmp_path / "t.tif", heights), "no data at east -1[456]")
    with np.errstate(over="ignore"):
        _refused(_npz(tmp_path / "t.npz", elevation=heights), "no data at east")
    stated = _tile()
    stated[3, 3] = 777.0
    stated[ROWS // 2, COLS // 2] = 777.0
    _refused(_geo_tiff(tmp_path / "s.tif", stated, nodata=777.0), "no data at east")
    # Beyond the area it does no harm.
    away = _tile()
    away[2, 2] = value
    assert _read(_geo_tiff(tmp_path / "away.tif", away), margin=0.0).heights.size > 0


def test_one_missing_pixel_of_a_large_fine_area_is_found(tmp_path: Path) -> None:
    heights = np.full((1500, 1500), 500.0, dtype=np.float32)
    heights[761, 333] = np.nan
    transform = from_origin(500_000.0, 5_100_000.0, 5.0, 5.0)
    path = _geotiff(tmp_path / "t.tif", heights, "EPSG:32632", transform)
    origin = open_raster(str(path)).centre
    _refused(path, "1 of .* pixels", bounds=np.array([[-3500.0, 3500.0], [-3500.0, 3500.0]]), origin=origin)


def test_hgt_void_is_missing_data(tmp_path: Path) -> None:
    path = _hgt(tmp_path)
    posts = np.frombuffer(path.read_bytes(), dtype=">i2").reshape(1201, 1201).copy()
    row, col = round((47.0 - MIDDLE.lat_deg) * 1200), round((MIDDLE.lon_deg - 8.0) * 1200)
    posts[row, col] = -32768
    path.write_bytes(posts.tobytes())
    _refused(path, "no data at east")


def test_files_beside_are_ignored(tmp_path: Path) -> None:
    path = _geo_tiff(tmp_path / "t.tif")
    before = _read(path)
    (tmp_path / "t.tif.aux.xml").write_text(
        "<PAMDataset><GeoTransform>1, 0.5, 0, 2, 0, -0.5</GeoTransform>"
        '<PAMRasterBand band="1"><NoDataValue>900</NoDataValue><Offset>7000</Offset><Scale>3</Scale></PAMRasterBand>'
        "</PAMDataset>",
        encoding="utf-8",
    )
    (tmp_path / "t.tfw").write_text("0.5\n0\n0\n-0.5\n1\n2\n", encoding="utf-8")
    after = _read(path)
    assert np.array_equal(before.heights, after.heights)
    assert np.array_equal(before.to_pixel.rows(), after.to_pixel.rows())


def test_stored_scale_and_offset_count(tmp_path: Path) -> None:
    path = _geo_tiff(tmp_path / "t.tif", np.round(_tile() * 10).astype(np.int16))
    with rasterio.open(path, "r+") as out:
        out.scales, out.offsets = (0.1,), (100.0,)
    assert not (tmp_path / "t.tif.aux.xml").exists()
    lat, lon = to_geo(MIDDLE, 300.0, -900.0)
    assert float(_read(path).height(300.0, -900.0)) == pytest.approx(float(_ground(lon, lat)) + 100.0, abs=0.2)


@pytest.mark.parametrize("kind", ["npz", "tif"])
@pytest.mark.parametrize("west", [179.95, 190.0, 359.9])
def test_longitudes_beyond_180(kind: str, west: float, tmp_path: Path) -> None:
    if kind == "npz" and west > 359.0:
        west = 200.0
    heights = _tile()
    if kind == "npz":
        path = _npz(tmp_path / "t.npz", xmin=west, xmax=west + COLS * PITCH)
    else:
        path = _geotiff(tmp_path / "t.tif", heights, "EPSG:4326", from_origin(west, NORTH, PITCH, PITCH))
    raster = open_raster(str(path))
    assert -180.0 <= raster.centre.lon_deg <= 180.0
    terrain = read_terrain(raster, raster.centre, BOUNDS, 100.0)
    lat, lon = to_geo(MIDDLE, 1000.0, 700.0)
    assert float(terrain.height(1000.0, 700.0)) == pytest.approx(float(_ground(lon, lat)), abs=0.1)


def test_a_turned_raster(tmp_path: Path) -> None:
    # Rows along a course of 30 degrees: the header's transform has rotation terms.
    cos, sin = math.sqrt(3) / 2, 0.5
    transform = Affine(20 * cos, 20 * sin, 424_000.0, 20 * sin, -20 * cos, 5_099_000.0)
    col, row = np.meshgrid(np.arange(700) + 0.5, np.arange(700) + 0.5)
    x, y = transform.a * col + transform.b * row + transform.c, transform.d * col + transform.e * row + transform.f
    lon, lat = Transformer.from_crs(32632, 4326, always_xy=True).transform(x, y)
    path = _geotiff(
        tmp_path / "t.tif", _ground(np.asarray(lon), np.asarray(lat)).astype(np.float32), "EPSG:32632", transform
    )
    origin = open_raster(str(path)).centre
    terrain = _read(path, origin=origin)
    east, north = np.random.default_rng(6).uniform(-2500.0, 2500.0, (2, 200))
    at_lat, at_lon = to_geo(origin, east, north)
    assert terrain.height(east, north) == pytest.approx(_ground(at_lon, at_lat), abs=0.1)
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
        path, "w", driver="GTiff", width=side, height=side, count=1, dtype="float32", crs=crs, nodata=-9999.0,
        transform=from_origin(west, north, pitch, pitch), tiled=True, sparse_ok=True, compress="deflate",
    ) as out:  # fmt: skip
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
    with pytest.raises(TerrainError, match=r"no data|nodata|missing"):
        read_terrain(open_raster(str(path)), GeoOrigin(46.065, 8.05), 6 * BOUNDS, 500.0)
