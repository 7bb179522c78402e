"""Several tiles as one: the heights of the same ground in one file, seams and overlaps included; what is no mosaic."""

from pathlib import Path

import numpy as np
import pytest

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
    write_raster,
)
from world.errors import PlanflyError, ScenarioError
from world.raster import open_raster, read_terrain, tile_bounds
from world.scenario import Scenario, load_scenario, scenario_from_spec


def cut(folder: Path, name: str, rows: slice, cols: slice, shift: float = 0.0, crs: str = "EPSG:4326") -> Path:
    """A part of the made tile as a file of its own.  shift: of its place, in pixels."""
    folder.mkdir(exist_ok=True)
    heights = made_tile()[rows, cols]
    west, north = WEST + (cols.start + shift) * PITCH, NORTH - rows.start * PITCH
    return write_raster(folder / name, heights, crs, from_origin(west, north, PITCH, PITCH))


def four(folder: Path, overlap: int) -> Path:
    """The made tile as four, whose seams go through its middle."""
    row, col = ROWS // 2, COLS // 2
    for k, rows in enumerate((slice(0, row + overlap), slice(row, ROWS))):
        for m, cols in enumerate((slice(0, col + overlap), slice(col, COLS))):
            cut(folder, f"{k}{m}.tif", rows, cols)
    return folder


def vrt(path: Path, names: list[str], relative: int = 1, root: str = "VRTDataset") -> Path:
    """What gdalbuildvrt writes, as far as it is read."""
    sources = "".join(
        f'<ComplexSource><SourceFilename relativeToVRT="{relative}">{name}</SourceFilename></ComplexSource>'
        for name in names
    )
    path.write_text(f'<{root}><VRTRasterBand dataType="Float32" band="1">{sources}</VRTRasterBand></{root}>')
    return path


@pytest.mark.parametrize("overlap", [0, 1, 17])
@pytest.mark.parametrize("by", ["folder", "vrt"])
def test_four_tiles_are_the_ground_of_one(overlap: int, by: str, tmp_path: Path) -> None:
    folder = four(tmp_path / "dem", overlap)
    whole = read_window(write_geotiff(tmp_path / "whole.tif"))
    names = [f"dem/{file.name}" for file in sorted(folder.iterdir())]
    parts = read_window(folder if by == "folder" else vrt(tmp_path / "dem.vrt", names))
    east, north = np.random.default_rng(1).uniform(-2500.0, 2500.0, (2, 2000))
    # On the seams themselves, too.
    east[:100], north[100:200] = 0.0, 0.0
    assert np.abs(parts.height(east, north) - whole.height(east, north)).max() < 0.01
    assert parts.source.endswith("(4 tiles)")


def test_the_outline_is_that_of_all_tiles(tmp_path: Path) -> None:
    raster, whole = open_raster(str(four(tmp_path / "dem", 0))), open_raster(str(write_geotiff(tmp_path / "w.tif")))
    assert raster.shape == whole.shape
    assert tile_bounds(raster, MIDDLE) == pytest.approx(tile_bounds(whole, MIDDLE), abs=1.0)
    one = cut(tmp_path / "alone", "a.tif", slice(0, 200), slice(0, 200))
    assert open_raster(str(tmp_path / "alone")).sha256 == open_raster(str(one)).sha256


def test_another_tile_is_another_terrain(tmp_path: Path) -> None:
    folder = four(tmp_path / "dem", 0)
    before = open_raster(str(folder)).sha256
    write_raster(
        folder / "11.tif",
        made_tile()[ROWS // 2 :, COLS // 2 :] + 1,
        "EPSG:4326",
        from_origin(WEST + COLS // 2 * PITCH, NORTH - ROWS // 2 * PITCH, PITCH, PITCH),
    )
    assert open_raster(str(folder)).sha256 != before


def test_where_one_has_no_data_another_may(tmp_path: Path) -> None:
    """Of a stated value, and of one that nobody states."""
    for nodata in (None, -5.0):
        folder = tmp_path / f"dem{nodata}"
        folder.mkdir()
        heights = made_tile()
        heights[100:200, 100:250] = -9999.0 if nodata is None else nodata
        write_geotiff(folder / "a.tif", heights, nodata=nodata)
        cut(folder, "b.tif", slice(90, 210), slice(90, 260))
        whole = read_window(write_geotiff(tmp_path / "whole.tif"))
        assert np.abs(read_window(folder).height(0.0, 0.0) - whole.height(0.0, 0.0)) < 0.01


def test_where_two_have_data_the_first_by_name_counts(tmp_path: Path) -> None:
    write_geotiff(tmp_path / "a.tif")
    write_geotiff(tmp_path / "b.tif", made_tile() + 50.0)
    raster = open_raster(str(tmp_path))
    assert raster.read(10, 11, 10, 11) == open_raster(str(tmp_path / "a.tif")).read(10, 11, 10, 11)


def test_the_gap_between_tiles_is_a_gap(tmp_path: Path) -> None:
    folder = tmp_path / "dem"
    cut(folder, "west.tif", slice(0, ROWS), slice(0, COLS // 2 - 20))
    cut(folder, "east.tif", slice(0, ROWS), slice(COLS // 2 + 20, COLS))
    assert_refused(folder, "no data at east")
    # Beside it there is ground, the other tile's or not.
    aside = np.array([[1200.0, 3000.0], [-1000.0, 1000.0]])
    terrain = read_terrain(open_raster(str(folder)), MIDDLE, aside, 100.0)
    assert np.isfinite(terrain.height(1500.0, 0.0))
    assert BOUNDS[0, 0] < aside[0, 0]


def test_tiles_of_srtm_share_their_outer_posts(tmp_path: Path) -> None:
    write_hgt(tmp_path)
    west = tmp_path / "N46E007.hgt"
    west.write_bytes(np.full((1201, 1201), 500, dtype=">i2").tobytes())
    raster = open_raster(str(tmp_path))
    assert raster.shape == (1201, 2401)
    assert float(raster.read(600, 601, 0, 1)[0, 0]) == 500.0


FAULTS = {
    "off the grid": (
        ("b.tif", 0.5, "EPSG:4326"),
        r"b.tif: its pixel grid is offset by 0.5 pixels from the grid of .*a.tif",
    ),
    "another system": (("b.tif", 0.0, "EPSG:4258"), r"b.tif: another reference system"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_mosaic(case: str, tmp_path: Path) -> None:
    (name, shift, crs), match = FAULTS[case]
    folder = tmp_path / "dem"
    cut(folder, "a.tif", slice(0, ROWS), slice(0, COLS // 2))
    cut(folder, name, slice(0, ROWS), slice(COLS // 2, COLS), shift, crs)
    assert_refused(folder, match)


def test_another_pitch_is_no_mosaic(tmp_path: Path) -> None:
    folder = tmp_path / "dem"
    cut(folder, "a.tif", slice(0, ROWS), slice(0, COLS // 2))
    coarse = made_tile()[::2, COLS // 2 :: 2]
    write_raster(
        folder / "b.tif", coarse, "EPSG:4326", from_origin(WEST + COLS // 2 * PITCH, NORTH, 2 * PITCH, 2 * PITCH)
    )
    assert_refused(folder, "b.tif: its pixel grid is offset")


def test_no_more_tiles_are_opened_than_may_be(tmp_path: Path) -> None:
    for k in range(101):
        (tmp_path / f"{k}.tif").touch()
    assert_refused(tmp_path, "tiles: 101: at most 100 tiles are read")


VIRTUAL = {
    "no text": (b"\xff\xfe", "cannot be read"),
    "no XML": (b"II*\0", "not a virtual raster"),
    "another root": (b"<kml/>", "SourceFilename is missing"),
    "no source": (b"<VRTDataset/>", "SourceFilename is missing"),
    "entities": (b'<!DOCTYPE a [<!ENTITY b "c">]><VRTDataset/>', "declares a document type"),
    "a warped one": (
        b'<VRTDataset subClass="VRTWarpedDataset"><SourceFilename>a.tif</SourceFilename></VRTDataset>',
        "VRTWarpedDataset computes pixels",
    ),
    "a scaled one": (
        b"<VRTDataset><ComplexSource><SourceFilename>a.tif</SourceFilename><ScaleRatio>2</ScaleRatio></ComplexSource>"
        b"</VRTDataset>",
        "ScaleRatio computes pixels",
    ),
    "a function": (
        b"<VRTDataset><VRTRasterBand subClass='VRTDerivedRasterBand'><SourceFilename>a.tif</SourceFilename>"
        b"</VRTRasterBand></VRTDataset>",
        "VRTDerivedRasterBand computes pixels",
    ),
    "a URL": (b"<VRTDataset><SourceFilename>http://x/a.tif</SourceFilename></VRTDataset>", "only local .tif"),
    "a virtual path": (b"<VRTDataset><SourceFilename>/vsizip/a.tif</SourceFilename></VRTDataset>", "only local .tif"),
    "another's file": (b"<VRTDataset><SourceFilename>/etc/passwd</SourceFilename></VRTDataset>", "only local .tif"),
    "another list": (b"<VRTDataset><SourceFilename>b.vrt</SourceFilename></VRTDataset>", "only local .tif"),
    "a file above": (
        b"<VRTDataset><SourceFilename relativeToVRT='1'>../a.tif</SourceFilename></VRTDataset>",
        "../a.tif: expected files in the folder of a.vrt or below",
    ),
    "a file above, later": (
        b"<VRTDataset><SourceFilename>b/../../a.tif</SourceFilename></VRTDataset>",
        "expected files in the folder of a.vrt or below",
    ),
    "a file elsewhere": (
        b"<VRTDataset><SourceFilename>/etc/a.tif</SourceFilename></VRTDataset>",
        "expected files in the folder of a.vrt or below",
    ),
    "a file that is not there": (
        b"<VRTDataset><SourceFilename>a.tif</SourceFilename></VRTDataset>",
        "no such elevation file",
    ),
}


@pytest.mark.parametrize("case", VIRTUAL)
def test_a_virtual_raster_that_is_none(case: str, tmp_path: Path) -> None:
    content, match = VIRTUAL[case]
    (tmp_path / "a.vrt").write_bytes(content)
    assert_refused(tmp_path / "a.vrt", match)


SCENARIO = """
name = "four"
[terrain]
kind = "dem"
path = {path}
[origin]
lat_deg = {lat}
lon_deg = {lon}
[area]
east_m = [-2500, 2500]
north_m = [-2500, 2500]
ceiling_amsl_m = 4000
[start]
east_m = -2000
north_m = 0
amsl_m = 3500
[destination]
east_m = 2000
north_m = 0
amsl_m = 3500
"""


def scenario(folder: Path, path: str) -> Scenario:
    file = folder / "four.toml"
    file.write_text(SCENARIO.format(path=path, lat=MIDDLE.lat_deg, lon=MIDDLE.lon_deg), encoding="ascii")
    return load_scenario(str(file))


def test_a_scenario_lists_its_tiles(tmp_path: Path) -> None:
    four(tmp_path / "dem", 3)
    listed = scenario(tmp_path, '["dem/00.tif", "dem/01.tif", "dem/10.tif", "dem/11.tif"]')
    folder = scenario(tmp_path, '"dem"')
    assert listed.terrain is not None
    assert folder.terrain is not None
    assert np.array_equal(listed.terrain.heights, folder.terrain.heights, equal_nan=True)
    assert listed.terrain.source == "dem/00.tif and 3 more"
    # Written down with whole paths, and made again from there; a tile that has changed is told.
    written = listed.to_json()
    assert written["terrain"]["path"][3] == str(tmp_path / "dem" / "11.tif")
    assert scenario_from_spec(written, "a plan").terrain.sha256 == listed.terrain.sha256  # type: ignore[union-attr]
    cut(tmp_path / "dem", "11.tif", slice(ROWS // 2, ROWS), slice(COLS // 2, COLS - 1))
    with pytest.raises(ScenarioError, match="the file has changed: its SHA-256 differs"):
        scenario_from_spec(written, "a plan")


def test_of_listed_tiles_the_first_counts(tmp_path: Path) -> None:
    write_geotiff(tmp_path / "b.tif")
    lower = write_raster(tmp_path / "a.tif", made_tile() - 50.0, "EPSG:4326", from_origin(WEST, NORTH, PITCH, PITCH))
    assert lower.name < "b.tif"
    first, second = (scenario(tmp_path, f'["{names[0]}.tif", "{names[1]}.tif"]').terrain for names in ("ab", "ba"))
    assert first is not None
    assert second is not None
    assert float(second.height(0.0, 0.0) - first.height(0.0, 0.0)) == pytest.approx(50.0, abs=0.01)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("[]", "four.toml: terrain.path: expected a file's name, or a list of 1 to 100"),
        ("5", "terrain.path: 5: expected a file's name, or a list of 1 to 100"),
        ('["dem/00.tif", 5]', "expected a file's name, or a list of 1 to 100 names"),
        ('["dem/00.tif", ""]', "terrain.path"),
        ('["dem/00.tif", "none.tif"]', "none.tif: no such elevation file"),
        ('["dem/00.tif", "http://x/y.tif"]', "only local files are read"),
        (str(["a.tif"] * 101), "expected a file's name, or a list of 1 to 100 names"),
    ],
)
def test_a_list_that_is_none_is_one_line(path: str, said: str, tmp_path: Path) -> None:
    four(tmp_path / "dem", 0)
    with pytest.raises(PlanflyError) as found:
        scenario(tmp_path, path)
    assert said in str(found.value)
    assert "\n" not in str(found.value)
