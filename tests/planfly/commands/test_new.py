"""``planfly new``: what it writes can be planned as it stands, over one's own ground, and with its examples on."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

import planfly
from planfly.cli import build_parser, main
from world.scenario import load_scenario

# A line of the file that is an example, and begins with a key or the name of a table.
EXAMPLE = re.compile(r"^# (?=[a-z0-9_]+ += |\[)", re.MULTILINE)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def tile(file: Path, heights: np.ndarray) -> Path:
    """Heights (400, 400), m, over 12 by 12 km near 20.78 S and 9 E, in UTM 32 S."""
    made = {"driver": "GTiff", "width": 400, "height": 400, "count": 1, "dtype": "float32", "crs": "EPSG:32732"}
    place = Affine(30.0, 0.0, 494_000.0, 0.0, -30.0, 7_706_000.0)
    with rasterio.open(file, "w", transform=place, **made) as opened:
        opened.write(heights.astype(np.float32), 1)
    return file


def test_a_scenario_over_ones_own_ground(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    row, col = np.mgrid[0:400, 0:400]
    tile(here / "dem.tif", 800.0 + 300.0 * np.sin(row / 60.0) ** 2 * np.cos(col / 80.0) ** 2)
    asked = ["new", "./site", "--from", "-20.78,8.97", "--to", "-20.81,9.03", "--terrain", "dem.tif"]
    assert main([*asked, "--height", "150", "--aircraft", "x8", "--json", "new.json"]) == 0
    out = capsys.readouterr().out
    assert "scenario  site/site.toml\n" in out
    assert "plans     safe: " in out
    assert "ground    flat" not in out
    answer = json.loads((here / "new.json").read_text(encoding="utf-8"))
    assert (answer["exit_code"], answer["file"], answer["safe"]) == (0, "site/site.toml", True)
    read = tomllib.loads((here / "site" / "site.toml").read_text(encoding="utf-8"))
    assert read["start"] == {"lat_deg": -20.78, "lon_deg": 8.97, "height_m": 150.0}
    assert read["terrain"]["path"] == "../dem.tif"
    assert read["flight"] == {"aircraft": "x8", "autopilot": "ardupilot"}
    # The ends stand 150 m above this ground, of 800 to 1,100 m, and below the ceiling.
    scenario = load_scenario("site/site.toml")
    assert 950.0 <= scenario.start[2] <= 1250.0
    assert scenario.terrain is not None
    assert scenario.start[2] - scenario.terrain.height(*scenario.start[:2]) == pytest.approx(150.0)
    assert 1400.0 <= scenario.ceiling <= 1600.0
    text = (here / "site" / "site.toml").read_text(encoding="utf-8")
    assert re.search(r"^# kill_scale_m = \d+ +# where the exposure \(scale/distance\)\^4 is 1$", text, re.MULTILINE)
    # The folder is moved with its ground.
    (here / "elsewhere").mkdir()
    for name in ("site", "dem.tif"):
        (here / name).rename(here / "elsewhere" / name)
    assert main(["plan", "elsewhere/site/site.toml", "--out", "plan.json"]) == 0


@pytest.mark.parametrize("law", ["ardupilot", "px4-1.16", "planfly"])
def test_every_example_may_be_switched_on(law: str, here: Path) -> None:
    file = planfly.new_scenario("site", (46.5, 8.0), (46.55, 8.09), autopilot=law)
    text, switched = EXAMPLE.subn(
        "", file.read_text(encoding="utf-8").replace('\n# kind = "dem"', "").replace('\n# path = "dem.tif"', "\n#")
    )
    assert switched > 20
    if law == "planfly":
        text = text.replace("\nparams = ", "\n# params = ")
    file.write_text(text, encoding="utf-8")
    (file.parent / "mine.param").write_text("NAV_ACC_RAD,12\n" if "px4" in law else "WP_RADIUS,60\n", encoding="ascii")
    found = load_scenario(str(file))
    assert [len(found.threats), len(found.zones)] == [1, 1]
    assert found.flight.airspeed_mps == 25.0
    assert (found.flight.autopilot, found.flight.px4_version) == (law.split("-")[0], "1.16" if "-" in law else None)
    assert found.spec.returns is not None
    assert planfly.plan(file).safe


def test_without_ground_it_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "cape", "--from", "-33.9,18.4", "--to=-33.95,18.6"]) == 0
    out = capsys.readouterr().out
    assert "ground    flat, at mean sea level: no elevation file was named (--terrain DEM)" in out


def test_across_the_date_line() -> None:
    found = load_scenario(str(planfly.new_scenario("fiji", (-17.5, 179.96), (-17.52, -179.95))))
    # 0.09 degrees of longitude at 17.5 degrees south, and 0.02 of latitude, m.
    east, north, _ = found.destination - found.start
    assert (east, north) == (pytest.approx(9560.0, abs=30.0), pytest.approx(-2214.0, abs=20.0))


def test_an_aircraft_of_ones_own(here: Path) -> None:
    (here / "site").mkdir()
    for folder, written in ((here / "mine", "../mine"), (here / "site" / "foam", "./foam")):
        planfly.new_aircraft(folder)
        file = planfly.new_scenario("site", (46.5, 8.0), (46.55, 8.05), aircraft=folder, overwrite=True)
        assert tomllib.loads(file.read_text(encoding="utf-8"))["flight"]["aircraft"] == written
        assert load_scenario(str(file)).flight.aircraft == str(folder)


def test_where_there_is_no_way_it_says_why_and_leaves_the_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # A wall of 2,900 m right across the file.
    tile(here / "wall.tif", np.where(abs(np.mgrid[0:400, 0:400][0] - 200) < 15, 2900.0, 0.0))
    asked = ["new", "site", "--from=-20.775,9.0", "--to=-20.835,9.0", "--terrain", "wall.tif"]
    assert main(asked) == 4
    out = capsys.readouterr().out
    assert "plans     no safe path\n  " in out
    assert (here / "site" / "site.toml").is_file()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--from", "46,8", "--to", "49,8"], "planfly: --to 49,8, 334 km away: expected 100 m to 300 km from --from"),
        (["--from", "91,8", "--to", "46,8"], "argument --from: '91,8': expected LAT,LON: degrees north"),
        (["--from", "46", "--to", "46,8"], "argument --from: '46': expected LAT,LON"),
        (["--from", "46,8", "--to", "46,8"], "--to 46,8, 0 km away: expected 100 m to 300 km from --from"),
        (["--from", "46,8"], "the following arguments are required: --to"),
        (
            ["--from", "46,8", "--to", "46,8.1", "--height", "0"],
            "argument --height: '0': expected a height above ground",
        ),
        (["--from", "46,8", "--to", "46,8.1", "--aircraft", "x9"], "x9"),
        (
            ["--from", "36.3,-84.2", "--to", "36.9,-84.2", "--terrain", "jacksboro"],
            "planfly: --to 36.9,-84.2: outside the terrain or within 100 m of its edge; jacksboro"
            " covers latitude 36.16",
        ),
        (["--from", "46,8", "--to", "46,8.1", "--terrain", "none.tif"], "none.tif"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_made(
    more: list[str], said: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code: object = main(["new", "site", *more])
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    [line] = [text for text in capsys.readouterr().err.splitlines() if not text.startswith("laying out")]
    assert said in line
    assert list(here.iterdir()) == []


def test_ground_without_data_beside_the_way_makes_the_area_smaller(here: Path) -> None:
    """A lake of 3 x 3 km without data to the north of a way of 6 km: 1.3 km, and 0.1 km."""
    heights = np.full((400, 400), 500.0)
    heights[100:200, 150:250] = np.nan
    tile(here / "lake.tif", heights)
    # The lake ends at 20.79988 S.
    file = planfly.new_scenario("site", (-20.812, 8.97), (-20.812, 9.028), terrain="lake.tif")
    found = load_scenario(str(file))
    assert 800.0 < found.bounds[1, 1] < 1300.0
    with pytest.raises(planfly.PlanflyError, match="no data at"):
        planfly.new_scenario("other", (-20.801, 8.97), (-20.801, 9.028), terrain="lake.tif")
    assert not (here / "other").exists()


def test_names_and_places_that_are_none_are_told_in_python_too(here: Path) -> None:
    for given in (None, ("a", "b"), (46.0,), "46,8", (float("nan"), 8.0)):
        with pytest.raises(planfly.PlanflyError, match=r"^start .*: expected latitude -89\.\.89 and longitude"):
            planfly.new_scenario("site", given, (46.0, 8.1))  # type: ignore[arg-type]
    for name in ("a\x7fb", "a\nb", "x" * 101, "caf\udce9"):
        with pytest.raises(planfly.PlanflyError, match="a folder with a name of 1 to 100 printable characters"):
            planfly.new_scenario(name, (46.0, 8.0), (46.0, 8.1))
    with pytest.raises(planfly.PlanflyError, match=r"^destination .*: the scenario must lie within 89° of latitude"):
        planfly.new_scenario("pole", (88.9, 0.0), (88.95, 170.0))
    assert list(here.iterdir()) == []
    file = planfly.new_scenario("b q'u é", (46.0, 8.0), (46.0, 8.1))
    assert load_scenario(str(file)).name == "b q'u é"
    (here / "link").symlink_to(here / "b q'u é")
    assert planfly.new_scenario("link", (46.0, 8.0), (46.0, 8.1)).name == "link.toml"


def test_what_lies_there_stays(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ends = ["--from", "46,8", "--to", "46,8.1"]
    (here / "site").mkdir()
    (here / "site" / "notes.txt").write_text("mine", encoding="ascii")
    assert main(["new", "site", *ends]) == 0
    assert (here / "site" / "notes.txt").read_text(encoding="ascii") == "mine"
    for folder, said in (
        ("site", "site/site.toml: exists; --overwrite replaces it"),
        ("site/notes.txt", "site/notes.txt: expected the name of a folder"),
        ("my.toml", "my.toml: expected the name of a folder"),
        ("no/site", "no/site: its parent folder 'no' does not exist"),
    ):
        assert main(["new", folder, *ends]) == 2
        assert said in capsys.readouterr().err
    assert main(["new", "site", *ends, "--overwrite"]) == 0


def test_a_negative_number_follows_its_option() -> None:
    found = build_parser().parse_args(
        ["plan", "tight", "--from", "p.json", "--at-leg", "1", "--add-threat", "-2000,5,8,9"]
    )
    assert found.threats == [(-2000.0, 5.0, 8.0, 9.0)]
