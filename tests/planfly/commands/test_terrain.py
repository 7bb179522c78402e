"""``planfly terrain``: the ground of an area from tiles, and from a server that may be as bad as real ones are."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

import planfly
from planfly.api import cutting_terrain
from planfly.cli import main
from tests.world.tile_server import ROWS, TileServer, ground, serving, write_tile
from world import remote_files
from world.frames import GeoOrigin, to_geo
from world.raster import open_raster, read_terrain
from world.terrain_cut import tile_name

# About the corner of four tiles, degrees.
BOX = (46.9, 8.9, 47.1, 9.1)
AREA = ["--box", ",".join(map(str, BOX)), "--margin", "0"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cutting_terrain, "user_cache_dir", lambda _: str(tmp_path / "cache"))
    monkeypatch.setattr(remote_files, "_PAUSE", 0.0)
    return tmp_path


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four tiles that meet at 47 N 9 E."""
    folder = tmp_path_factory.mktemp("tiles")
    for lat in (46, 47):
        for lon in (8, 9):
            write_tile(folder, lat, lon)
    return folder


@pytest.fixture
def server(tiles: Path) -> Iterator[TileServer]:
    with serving(tiles) as found:
        yield found


def seen(file: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights, and latitude and longitude of the pixels' centres."""
    with rasterio.open(file) as opened:
        heights = opened.read(1)
        place = opened.transform
    rows, cols = heights.shape
    return heights, place.f + (np.arange(rows) + 0.5) * place.e, place.c + (np.arange(cols) + 0.5) * place.a


def check_ground(file: Path, box: tuple[float, ...] = BOX, off: float = 1e-3) -> None:
    """Every height is the ground's, and the file covers the area."""
    heights, lat, lon = seen(file)
    assert np.abs(heights - ground(lat[:, None], lon[None, :])).max() <= off
    south, west, north, east = box
    edges = np.array([south - lat[-1], west - lon[0], lat[0] - north, lon[-1] - east])
    assert ((edges > -1e-9) & (edges < 0.02)).all()


def test_four_tiles_of_a_server_are_one_file(
    here: Path, server: TileServer, tiles: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["terrain", *AREA, "--source", server.url, "--json", "a.json"]) == 0
    check_ground(here / "dem.tif")
    answer = json.loads((here / "a.json").read_text(encoding="utf-8"))
    assert sorted(answer["tiles"]) == sorted(tile_name(lat, lon) for lat in (46, 47) for lon in (8, 9))
    assert (answer["absent"], answer["empty_pixels"]) == ([], 0)
    # A part of each, and each part once.
    size = sum(file.stat().st_size for file in tiles.rglob("*.tif"))
    assert server.sent == answer["fetched_bytes"] < size
    parts = [(path, part) for method, path, part in server.asked if method == "GET"]
    assert len(parts) == len(set(parts))
    # The server's heights are above EGM2008, and the file says so.
    assert open_raster("dem.tif").datum.text == "mean sea level (EGM2008 height, as the file states)"
    assert "terrain   dem.tif: " in capsys.readouterr().out
    # What was fetched is not fetched again: only whether it has changed is asked.
    before = server.sent
    assert main(["terrain", *AREA, "--source", server.url, "--out", "again.tif"]) == 0
    assert server.sent == before
    assert (here / "again.tif").read_bytes() == (here / "dem.tif").read_bytes()


def test_a_larger_area_fetches_what_it_lacks(here: Path, server: TileServer) -> None:
    planfly.terrain("a.tif", box=BOX, margin=0.0, source=server.url)
    before = server.sent
    wide = (46.6, 8.6, 47.4, 9.4)
    planfly.terrain("b.tif", box=wide, margin=0.0, source=server.url)
    parts = [(path, part) for method, path, part in server.asked if method == "GET"]
    assert server.sent > before
    assert len(parts) == len(set(parts))
    check_ground(here / "b.tif", wide)


def test_a_line_that_breaks_is_taken_up_where_it_broke(here: Path, server: TileServer) -> None:
    server.cut = 2
    made = planfly.terrain("dem.tif", box=BOX, margin=0.0, source=server.url)
    check_ground(here / "dem.tif")
    # Nothing came twice.
    assert server.sent == made.fetched
    parts = [(path, *map(int, part[6:].split("-"))) for method, path, part in server.asked if method == "GET"]
    got: dict[str, int] = {}
    for path, first, last in parts:
        got[path] = got.get(path, 0) + last + 1 - first
    assert sum(got.values()) > made.fetched, "what was cut off was asked for again, from there on"


def test_a_server_that_goes_away_costs_one_line_and_what_came_stays(
    here: Path, server: TileServer, capsys: pytest.CaptureFixture[str]
) -> None:
    server.cut = 3
    argv = ["terrain", *AREA, "--source", server.url]
    assert main(argv) == 2
    [line] = [text for text in capsys.readouterr().err.splitlines() if text.startswith("planfly")]
    assert line.startswith(f"planfly: {server.url}/Copernicus_DSM_COG_10_N46_00_E008_00_DEM/")
    assert "cannot be fetched: " in line
    assert " bytes were received" in line
    assert not (here / "dem.tif").exists()
    before = server.sent
    assert main([*argv, "--json", "a.json"]) == 0
    assert json.loads((here / "a.json").read_text(encoding="utf-8"))["fetched_bytes"] == server.sent - before
    check_ground(here / "dem.tif")


def test_nobody_there_is_one_line(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    assert main(["terrain", *AREA, "--source", f"http://127.0.0.1:{port}"]) == 2
    [line] = [text for text in capsys.readouterr().err.splitlines() if text.startswith("planfly")]
    assert f"http://127.0.0.1:{port}/" in line
    assert line.endswith("cannot be reached: Connection refused")
    assert not (here / "dem.tif").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"status": 500}, "cannot be fetched: the server answers 500 Internal Server Error"),
        ({"status": 401}, "cannot be fetched: the server answers 401 Unauthorized"),
        ({"status": 403}, "cannot be fetched: the server answers 403 Forbidden"),
        ({"length": 0}, "Content-Length: 0: expected 1 to 536,870,912 bytes"),
        ({"length": 10**9}, "Content-Length: 1,000,000,000: expected 1 to 536,870,912 bytes"),
        ({"length": 10**20}, "Content-Length: 100,000,000,000,000,000,000: expected 1 to"),
        ({"garbage": True}, "the server's answer is not a readable GeoTIFF"),
        ({"moved": ("N46", "N47")}, "does not cover the area of its name: expected latitude 46..47, longitude 8..9"),
        ({"odd": True}, "cannot be fetched: bytes 0-65535 were requested, but the server sent bytes 1-65535/"),
        (
            {"status": 404},
            "the server has no tile for this area. Either the area is open sea, or the server has no Copernicus"
            " GLO-30 tiles",
        ),
    ],
)
def test_a_server_that_is_none_is_one_line(
    change: dict[str, object], said: str, here: Path, server: TileServer, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, value in change.items():
        setattr(server, name, value)
    assert main(["terrain", *AREA, "--source", server.url]) == 2
    [line] = [text for text in capsys.readouterr().err.splitlines() if text.startswith("planfly")]
    assert said in line
    assert not (here / "dem.tif").exists()


def test_a_server_without_parts_gives_whole_files(here: Path, server: TileServer, tiles: Path) -> None:
    server.ranges = False
    made = planfly.terrain("dem.tif", box=BOX, margin=0.0, source=server.url)
    check_ground(here / "dem.tif")
    assert made.fetched == sum(file.stat().st_size for file in tiles.rglob("*.tif"))


@pytest.mark.parametrize("tag", ['"2"', ""])
def test_a_file_that_has_changed_is_fetched_anew(tag: str, here: Path, server: TileServer) -> None:
    first = planfly.terrain("a.tif", box=BOX, margin=0.0, source=server.url)
    server.tag = tag
    again = planfly.terrain("b.tif", box=BOX, margin=0.0, source=server.url)
    assert again.fetched == first.fetched
    assert (here / "a.tif").read_bytes() == (here / "b.tif").read_bytes()


def test_a_note_of_the_cache_that_is_damaged_is_not_believed(here: Path, server: TileServer) -> None:
    first = planfly.terrain("a.tif", box=BOX, margin=0.0, source=server.url)
    notes = sorted((here / "cache").rglob("*.held"))
    for note, text in zip(notes, ("{", '[[5, 2, ""]]', "[[0, 65536]]", '[[0, 9e999, ""]]'), strict=True):
        note.write_text(text, encoding="ascii")
    assert planfly.terrain("b.tif", box=BOX, margin=0.0, source=server.url).fetched == first.fetched
    check_ground(here / "b.tif")


def test_where_no_tile_is_has_no_data_unless_it_is_sea(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of some countries no tiles are published: mountains must not be taken for sea unasked."""
    write_tile(here / "coast", 46, 8)
    write_tile(here / "coast", 47, 8)
    with serving(here / "coast") as server:
        assert main(["terrain", *AREA, "--source", server.url, "--out", "open.tif", "--json", "a.json"]) == 0
        said = capsys.readouterr().err
        assert (
            "no tiles with the south-west corners 46 9, 47 9 (degrees). Open sea, or tiles not published (--sea treats"
        ) in said
        assert main(["terrain", *AREA, "--source", server.url, "--sea", "--out", "sea.tif"]) == 0
        assert "46 9, 47 9 (degrees). Treated as sea at 0 m" in capsys.readouterr().err
    for name, value in (("open.tif", -32768.0), ("sea.tif", 0.0)):
        heights, lat, lon = seen(here / name)
        west = lon < 9.0 - 0.5 / ROWS
        assert np.abs(heights[:, west] - ground(lat[:, None], lon[None, west])).max() <= 1e-3
        assert (heights[:, ~west] == value).all()
    answer = json.loads((here / "a.json").read_text(encoding="utf-8"))
    assert (answer["absent"], answer["empty_pixels"]) == ([[46, 9], [47, 9]], int((~west).sum()) * len(lat))
    assert f"{answer['empty_pixels']:,} of {heights.size:,} pixels have no data" in said


@pytest.mark.parametrize("spoilt", ["directory", "block"])
def test_a_copy_that_is_spoilt_is_fetched_once_more(spoilt: str, here: Path, server: TileServer) -> None:
    """A power cut, or a proxy that gave something else."""
    first = planfly.terrain("a.tif", box=BOX, margin=0.0, source=server.url)
    for copy in (here / "cache").rglob("*.tif"):
        held = json.loads(copy.with_name(copy.name + ".held").read_text(encoding="ascii"))
        with copy.open("r+b") as file:
            file.seek(0 if spoilt == "directory" else held[-1][1] - 500)
            file.write(bytes(400))
    again = planfly.terrain("b.tif", box=BOX, margin=0.0, source=server.url)
    assert 0 < again.fetched <= first.fetched
    assert (here / "a.tif").read_bytes() == (here / "b.tif").read_bytes()


def test_a_copy_that_is_gone_takes_its_note_with_it(here: Path, server: TileServer) -> None:
    first = planfly.terrain("a.tif", box=BOX, margin=0.0, source=server.url)
    for copy in (here / "cache").rglob("*.tif"):
        copy.unlink()
    server.status = 500
    with pytest.raises(planfly.PlanflyError):
        planfly.terrain("b.tif", box=BOX, margin=0.0, source=server.url)
    server.status = 0
    assert planfly.terrain("b.tif", box=BOX, margin=0.0, source=server.url).fetched == first.fetched
    check_ground(here / "b.tif")


def test_no_pixel_is_read_that_was_not_fetched(here: Path, server: TileServer) -> None:
    """Edges at and beside those of blocks of 128 pixels, and of tiles."""
    for k, at in enumerate((8.0, 8.355, 8.35556, 8.356, 8.4, 8.7111, 8.999)):
        box = (46.3, at, 46.3 + 0.05 * (k + 1), at + 0.1)
        planfly.terrain(f"{k}.tif", box=box, margin=0.0, source=server.url)
        check_ground(here / f"{k}.tif", box)


def test_tiles_of_two_pitches_meet(here: Path, tmp_path: Path) -> None:
    """North of 50 degrees a GLO-30 tile has two thirds of the columns."""
    write_tile(tmp_path / "north", 49, 8)
    write_tile(tmp_path / "north", 50, 8, cols=ROWS * 2 // 3)
    box = (49.9, 8.4, 50.1, 8.6)
    with serving(tmp_path / "north") as server:
        planfly.terrain("dem.tif", box=box, margin=0.0, source=server.url)
    heights, lat, lon = seen(here / "dem.tif")
    true = ground(lat[:, None], lon[None, :])
    south = lat < 50.0 - 0.5 / ROWS
    assert np.abs(heights - true)[south].max() <= 1e-3
    # Between its own pixels, 1/240 of a degree apart: an eighth of the pitch squared times the curvature.
    curvature = 300.0 * np.radians(500.0) ** 2
    assert np.abs(heights - true)[~south].max() <= curvature / (8.0 * 240.0**2) + 0.01


def test_across_the_date_line(here: Path, tmp_path: Path) -> None:
    write_tile(tmp_path / "fiji", -18, 179)
    write_tile(tmp_path / "fiji", -18, -180)
    with serving(tmp_path / "fiji") as server:
        planfly.terrain("dem.tif", box=(-17.6, 179.9, -17.5, -179.9), margin=0.0, source=server.url)
    heights, lat, lon = seen(here / "dem.tif")
    assert lon[0] <= 179.9
    assert lon[-1] >= 180.1
    assert np.abs(heights - ground(lat[:, None], (lon[None, :] + 180.0) % 360.0 - 180.0)).max() <= 1e-3
    terrain = read_terrain(
        open_raster("dem.tif"), GeoOrigin(-17.55, 180.0), [[-9000.0, 9000.0], [-3000.0, 3000.0]], 0.0
    )
    # Within what lies between its pixels, 310 m apart.
    at = to_geo(GeoOrigin(-17.55, 180.0), 5000.0, 1000.0)
    assert float(terrain.height(5000.0, 1000.0)) == pytest.approx(float(ground(*map(np.asarray, at))), abs=1.0)


# ----------------------------------------------------------------------
# From tiles that are there.


def test_a_cut_of_a_folder_is_the_same_ground(here: Path, tiles: Path) -> None:
    flat = here / "flat"
    flat.mkdir()
    for file in tiles.rglob("*.tif"):
        (flat / file.name).symlink_to(file)
    made = planfly.terrain("dem.tif", box=BOX, margin=1.0, source=flat)
    assert made.fetched == 0
    whole, cut = (
        read_terrain(open_raster(path), GeoOrigin(47.0, 9.0), [[-6000.0, 6000.0], [-9000.0, 9000.0]], 100.0)
        for path in ("flat", "dem.tif")
    )
    east, north = np.random.default_rng(1).uniform([[-6000.0], [-9000.0]], [[6000.0], [9000.0]], (2, 2000))
    assert np.abs(whole.height(east, north) - cut.height(east, north)).max() < 0.01
    # A kilometre more on each side: 1/111.2 degrees of latitude.
    _, lat, _ = seen(here / "dem.tif")
    assert 46.9 - 1.0 / 111.2 - 2.5 / ROWS <= lat[-1] <= 46.9 - 1.0 / 111.2


def test_a_turned_grid_in_metres_stays_as_it_is(here: Path) -> None:
    made = {"driver": "GTiff", "width": 300, "height": 300, "count": 1, "dtype": "float32", "crs": "EPSG:25832"}
    heights = np.arange(90_000, dtype=np.float32).reshape(300, 300) / 100.0
    heights[150, 150] = np.nan
    place = Affine(29.0, 8.0, 497_000.0, 8.0, -29.0, 5_202_000.0)
    with rasterio.open(here / "utm.tif", "w", transform=place, **made) as file:
        file.write(heights, 1)
    planfly.terrain("dem.tif", box=(46.94, 9.0, 46.95, 9.01), margin=0.0, source="utm.tif")
    with rasterio.open(here / "dem.tif") as cut:
        rows, cols = cut.shape
        assert cut.crs.to_epsg() == 25832
        col, row = ~place @ (cut.transform.c, cut.transform.f)
        top, left = round(row), round(col)
        assert (row, col) == (pytest.approx(top), pytest.approx(left))
        assert rows < 100
        found = np.where(cut.read(1) == cut.nodata, np.nan, cut.read(1))
        assert np.array_equal(found, heights[top : top + rows, left : left + cols], equal_nan=True)


def test_an_area_without_data_is_refused_and_a_gap_is_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = {"driver": "GTiff", "width": 100, "height": 100, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    heights = np.full((100, 100), 300.0, np.float32)
    heights[:, 50:] = np.nan
    with rasterio.open(here / "half.tif", "w", transform=Affine(0.01, 0, 8.0, 0, -0.01, 47.0), **made) as file:
        file.write(heights, 1)
    argv = ["terrain", "--margin", "0", "--source", "half.tif"]
    assert main([*argv, "--box", "46.2,8.7,46.3,8.8"]) == 2
    assert "dem.tif: the tiles have no data in the area" in capsys.readouterr().err
    assert not (here / "dem.tif").exists()
    assert main([*argv, "--box", "46.2,8.4,46.3,8.6"]) == 0
    assert " pixels have no data" in capsys.readouterr().err


def test_an_area_beyond_the_tiles_is_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["terrain", "--box", "36.2,-84.3,36.5,-84.2", "--source", "jacksboro"]) == 2
    said = capsys.readouterr().err
    assert "jacksboro: does not cover latitude 36.1730..36.5270, longitude -84.33" in said
    assert main(["terrain", "--box", "36.25,-84.3,36.3,-84.2", "--source", "jacksboro"]) == 0
    assert float(
        read_terrain(open_raster("dem.tif"), GeoOrigin(36.28, -84.25), [[-100.0, 100.0], [-100.0, 100.0]], 0.0).height(
            0.0, 0.0
        )
    ) == pytest.approx(
        float(
            read_terrain(
                open_raster("jacksboro"), GeoOrigin(36.28, -84.25), [[-100.0, 100.0], [-100.0, 100.0]], 0.0
            ).height(0.0, 0.0)
        ),
        abs=0.01,
    )


MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t36.25\t-84.25\t0\t1
1\t0\t3\t16\t0\t0\t0\t0\t36.27\t-84.30\t100\t1
2\t0\t0\t178\t0\t20\t0\t0\t0\t0\t0\t1
3\t0\t3\t16\t0\t0\t0\t0\t36.29\t-84.20\t100\t1
"""


def test_around_a_mission_is_home_and_all_its_places(here: Path) -> None:
    (here / "m.waypoints").write_text(MISSION, encoding="ascii")
    made = planfly.terrain("dem.tif", around="m.waypoints", margin=2.0, source="jacksboro")
    _, lat, lon = seen(made.file)
    up, across = 2.0 / 111.2, 2.0 / 111.2 / np.cos(np.radians(36.29))
    pitch = 3.0 * 0.5 * (lat[0] - lat[1])
    assert lat[-1] == pytest.approx(36.25 - up, abs=2 * pitch)
    assert lat[0] == pytest.approx(36.29 + up, abs=2 * pitch)
    assert lon[0] == pytest.approx(-84.30 - across, abs=2 * pitch)
    assert lon[-1] == pytest.approx(-84.20 + across, abs=2 * pitch)
    # It is terrain to all else.
    assert planfly.check("m.waypoints", terrain=made.file).level == "geometric"


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ([], "planfly: expected either --around or --box"),
        (["--box", "46,8,47,9", "--around", "m.waypoints"], "expected either --around or --box"),
        (["--box", "46,8,47"], "argument --box: '46,8,47': expected S,W,N,E"),
        (["--box", "47,8,46,9"], "--box (47.0, 8.0, 46.0, 9.0): expected south, west, north, east"),
        (["--box", "46,8,nan,9"], "expected south, west, north, east"),
        (["--box", "46,8,47,9", "--margin", "-1"], "argument --margin: '-1': expected a distance from 0 to 100 km"),
        (["--box", "46,8,47,9", "--out", "dem.png"], "dem.png: expected a name that ends with .tif"),
        (
            ["--box", "46,8,47,9", "--source", "ftp://x/y"],
            "--source 'ftp://x/y': expected a folder, or an http or https address",
        ),
        (["--box", "46,8,47,9", "--source", "http://127.0.0.1:9/\u00e4"], "an http or https address without"),
        (["--box", "46,8,47,9", "--source", "http://[::1/"], "an http or https address without"),
        (["--box", "46,8,47,9", "--source", f"http://{'a' * 64}.example/"], "an http or https address without"),
        (["--box", "46,8,47,9", "--source", "http://a/?b"], "an http or https address without"),
        (["--box", "46,8,47,9", "--source", "none"], "none: no such elevation file"),
        (["--box", "40,0,46,9", "--source", "http://127.0.0.1:9"], "tiles: at most 25 tiles are fetched"),
        (["--around", "none.waypoints"], "none.waypoints"),
    ],
)
def test_bad_input_is_one_line(argv: list[str], said: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code: object = main(["terrain", *argv])
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    [line] = [text for text in capsys.readouterr().err.splitlines() if text.startswith("planfly")]
    assert said in line
    assert not (here / "dem.tif").exists()


def test_a_cache_that_cannot_be_written_is_done_without(
    here: Path, server: TileServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / "file").write_text("", encoding="ascii")
    monkeypatch.setattr(cutting_terrain, "user_cache_dir", lambda _: str(here / "file"))
    planfly.terrain("dem.tif", box=BOX, margin=0.0, source=server.url)
    check_ground(here / "dem.tif")
