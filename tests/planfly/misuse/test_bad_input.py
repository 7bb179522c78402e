"""Bad input: one line on standard error, exit code 2, nothing left behind."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from planfly.cli import main

SCENARIO = """\
name = "small"
[terrain]
kind = "flat"
amsl_m = 100
[area]
east_m = [0, 6000]
north_m = [0, 6000]
ceiling_amsl_m = 900
[start]
east_m = 500
north_m = 500
amsl_m = 300
[destination]
east_m = 5500
north_m = 5500
amsl_m = 320
"""

HOME, LANDING = '[home]\nplace = "start"\n', "[landing]\neast_m = 4000\nnorth_m = 4000\n"
LINK = "[link]\nfrequency_mhz = {}\npower_dbm = 20\nsensitivity_dbm = -100\n"
ZONE = '[[zones]]\nname = "town"\nkind = "exclusion"\n{}\n'
YARD = "polygon_m = [[2000, 2000], [3000, 2000], [3000, 3000]]\n"

WPL_HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t36.59\t-84.25\t300\t1\n"
WPL_ROW = "{}\t0\t0\t16\t0\t0\t0\t0\t{}\t{}\t500\t1\n"


def edited(old: str, new: str) -> str:
    assert old in SCENARIO
    return SCENARIO.replace(old, new)


SCENARIOS = {
    "empty": "",
    "not TOML": "name = ",
    "unknown key": SCENARIO + "colour = 3\n",
    "unknown table": SCENARIO + "[engine]\npower = 3\n",
    "unknown nested key": edited("amsl_m = 100", "amsl_m = 100\nslope = 2"),
    "missing start": SCENARIO.replace("[start]", "[begin]"),
    "wrong type": edited("amsl_m = 100", 'amsl_m = "high"'),
    "quoted number": edited("amsl_m = 100", 'amsl_m = "100"'),
    "truth for a number": edited("amsl_m = 100", "amsl_m = true"),
    "NaN": edited("amsl_m = 300", "amsl_m = nan"),
    "infinity": edited("amsl_m = 300", "amsl_m = inf"),
    "out of range": edited("amsl_m = 300", "amsl_m = 90000"),
    "start outside the area": edited("east_m = 500", "east_m = 7000"),
    "start under the ground": edited("amsl_m = 300", "amsl_m = 50"),
    "start above the ceiling": edited("amsl_m = 300", "amsl_m = 1000"),
    "area turned round": edited("east_m = [0, 6000]", "east_m = [6000, 0]"),
    "both forms of a position": edited("north_m = 500", "north_m = 500\nlat_deg = 46"),
    "kind of terrain": edited('kind = "flat"', 'kind = "moon"'),
    "terrain file missing": edited('kind = "flat"\namsl_m = 100', 'kind = "dem"\npath = "nowhere.tif"'),
    "terrain by URL": edited('kind = "flat"\namsl_m = 100', 'kind = "dem"\npath = "http://example.org/a.tif"'),
    "threat without a weapon": SCENARIO + "[[threats]]\neast_m = 3000\nnorth_m = 3000\n",
    "threat with half a missile": SCENARIO + "[[threats]]\neast_m = 3000\nnorth_m = 3000\nkill_scale_m = 300\n",
    "planner algorithm": SCENARIO + '[planner]\nalgorithm = "magic"\n',
    "terrain above the ceiling everywhere": edited('kind = "flat"\namsl_m = 100', 'kind = "flat"\namsl_m = 1000'),
    "population of one": SCENARIO + "[planner]\npopulation = 1\n",
    "two waypoints": SCENARIO + "[planner]\nwaypoints = 2\n",
    "negative generations": SCENARIO + "[planner]\ngenerations = -1\n",
    "aircraft": SCENARIO + '[flight]\naircraft = "zeppelin"\n',
    "airspeed": SCENARIO + "[flight]\nairspeed_mps = 58\n",
    "autopilot": SCENARIO + '[flight]\nautopilot = "px5"\n',
    "guidance of another autopilot": SCENARIO + '[flight]\nautopilot = "ardupilot"\nguidance = "l1"\n',
    "parameters of guidance": SCENARIO + '[flight]\nguidance = "path"\nparams = "mine.parm"\n',
    "parameters missing": SCENARIO + '[flight]\nparams = "nowhere.parm"\n',
    "wind too strong": SCENARIO + "[wind]\nspeed_mps = 24\n",
    "turbulence": SCENARIO + '[wind]\nturbulence = "severe"\n',
    "a launch without home": SCENARIO + '[launch]\nmethod = "catapult"\n',
    "a landing off the map": SCENARIO + HOME + "[landing]\neast_m = 7000\nnorth_m = 500\n",
    "a landing by a course that is none": SCENARIO + HOME + LANDING + 'course_deg = "downwind"\n',
    "home off the map": SCENARIO + "[home]\neast_m = 500\nnorth_m = -500\n",
    "a rally point in the ground": SCENARIO + "[returns]\nrally = [{ east_m = 900, north_m = 900, amsl_m = 90 }]\n",
    "a link without its frequency": SCENARIO + "[link]\npower_dbm = 20\nsensitivity_dbm = -100\n",
    "a link of light": SCENARIO + LINK.format(60_000),
    "a link with half a position": SCENARIO + LINK.format(915) + "lat_deg = 46\n",
    "a link with two positions": SCENARIO + LINK.format(915) + "lat_deg = 46\nlon_deg = 8\neast_m = 0\nnorth_m = 0\n",
    "a link to a station off the terrain": SCENARIO + LINK.format(915) + "east_m = 90000\nnorth_m = 0\n",
    "a link below the ground": SCENARIO + LINK.format(915) + "antenna_m = -2\n",
    "a link of smoke": SCENARIO + LINK.format(915) + 'use = "smoke"\n',
    "a link that may be lost for ever": SCENARIO + LINK.format(915) + "max_outage_s = inf\n",
    "a return below home": SCENARIO + "[returns]\nrtl_altitude_m = -20\n",
    "control character in a name": edited('name = "small"', 'name = "sm\\u0007all"'),
    "a zone that crosses itself": SCENARIO + ZONE.format("polygon_m = [[1, 1], [900, 900], [900, 1], [1, 900]]"),
    "a zone of two corners": SCENARIO + ZONE.format("polygon_m = [[1, 1], [900, 900]]"),
    "a zone with nothing inside": SCENARIO + ZONE.format("polygon_m = [[1, 1], [900, 1], [900, 1.001]]"),
    "a zone's corner NaN": SCENARIO + ZONE.format("polygon_m = [[1, 1], [nan, 900], [900, 1]]"),
    "a zone's radius of nothing": SCENARIO + ZONE.format("east_m = 3000\nnorth_m = 3000\nradius_m = 0"),
    "a zone's floor above its ceiling": SCENARIO + ZONE.format(f"{YARD}floor_amsl_m = 300\nceiling_amsl_m = 200"),
    "a zone of no shape": SCENARIO + ZONE.format(""),
    "a zone that holds the start": SCENARIO + ZONE.format("east_m = 600\nnorth_m = 600\nradius_m = 300"),
    "a zone that holds no destination": SCENARIO
    + ZONE.format("east_m = 600\nnorth_m = 600\nradius_m = 900").replace("exclusion", "inclusion"),
    "a file of zones missing": f'zones_file = "nowhere.geojson"\n{SCENARIO}',
    "the greatest height below the clearance": SCENARIO + "[limits]\nmax_height_m = 20\n",
    "start inside a kill radius": SCENARIO
    + "[[threats]]\neast_m = 600\nnorth_m = 600\nkill_radius_m = 400\nkill_scale_m = 100\n",
}

# A file of zones that the scenario names.
ZONE_FILES = {
    "empty.geojson": "",
    "list.geojson": "[1, 2, 3]",
    "deep.geojson": "[" * 100_000,
    "nan.geojson": '{"type": "Polygon", "coordinates": [[[8, 46], [NaN, 46], [8, 46.1]]]}',
    "line.geojson": '{"type": "LineString", "coordinates": [[8, 46], [8.1, 46]]}',
    "two.geojson": '{"type": "Polygon", "coordinates": [[[8, 46], [8.1, 46], [8, 46]]]}',
    "bow.geojson": '{"type": "Polygon", "coordinates": [[[8, 46], [8.1, 46.1], [8.1, 46], [8, 46.1], [8, 46]]]}',
    "bomb.kml": '<!DOCTYPE kml [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]><kml>&b;</kml>',
    "empty.kml": "<kml/>",
    "open.kml": "<kml><Placemark>",
    "sheet.kml": "<kml><Placemark><Polygon><altitudeMode>absolute</altitudeMode></Polygon></Placemark></kml>",
    "other.kmz": "PK",
}

FENCE = "{}\t0\t0\t{}\t{}\t0\t0\t0\t{}\t{}\t0\t1\n"
WAY = WPL_HEAD + WPL_ROW.format(1, "36.6", "-84.2") + WPL_ROW.format(2, "36.61", "-84.2")

MISSIONS = {
    "bow.waypoints": WAY
    + "".join(
        FENCE.format(3 + k, 5002, 4, lat, lon)
        for k, (lat, lon) in enumerate(((36.5, -84.1), (36.6, -84.0), (36.6, -84.1), (36.5, -84.0)))
    ),
    "circle.waypoints": WAY + FENCE.format(3, 5004, 0, 36.5, -84.1),
    "empty.waypoints": "",
    "header.waypoints": "QGC WPL 120\n",
    "latitude.waypoints": WPL_HEAD + WPL_ROW.format(1, "91.0", "-84.2") + WPL_ROW.format(2, "36.6", "-84.2"),
    "nan.waypoints": WPL_HEAD + WPL_ROW.format(1, "nan", "-84.2") + WPL_ROW.format(2, "36.6", "-84.2"),
    "comma.waypoints": WPL_HEAD + WPL_ROW.format(1, "36,61", "-84.2") + WPL_ROW.format(2, "36.6", "-84.2"),
    "columns.waypoints": WPL_HEAD + "1\t0\t0\t16\t0\n",
    # A landing without a place before it.
    "landing.waypoints": WPL_HEAD + WPL_ROW.format(1, "36.6", "-84.2").replace("\t16\t", "\t21\t"),
    "one.waypoints": WPL_HEAD + WPL_ROW.format(1, "36.6", "-84.2"),
    "binary.waypoints": "\x00\x01\x02\x03" * 50,
    "truncated.plan": '{"fileType": "Plan", "version": 1, "mission": {"items": [',
    "other.plan": '{"fileType": "GeoFence"}',
    "mission.kml": "<kml/>",
    "truncated.json": '{"schema": "planfly.plan/1", ',
    "other.json": '{"schema": "planfly.plan/9"}',
    "list.json": "[1, 2, 3]",
    "nan.json": '{"schema": NaN}',
    "deep.json": "[" * 100_000,
}

# Fences named beside a mission that is well.
FENCES = {
    "empty.fence": "",
    "none.waypoints": WAY,
    "bow.fence": MISSIONS["bow.waypoints"],
    "circle.fence": MISSIONS["circle.waypoints"],
    "open.fence": "36.5 -84.2\n36.6 -84.2\n36.6 -84.1\n36.5 -84.1\n",
    "comma.txt": "36.5,-84.2\n",
    "column.txt": "36.5\n",
    "nan.fence": "nan nan\n" * 5,
    "far.fence": "136.5 -84.2\n" * 5,
    "zone.plan": ZONE_FILES["bow.geojson"],
    "fence.kmz": "PK",
    "none.rally": "QGC WPL 110\n",
    "far.rally": "QGC WPL 110\n0\t0\t3\t5100\t0\t0\t0\t0\t136.5\t-84.1\t50\t1\n",
    **ZONE_FILES,
}

LOGS = {
    "empty.mcap": b"",
    "text.mcap": b"this is not a log\n" * 20,
    "magic.mcap": b"\x89MCAP0\r\n",
    "binary.mcap": bytes(range(256)) * 64,
}


def refused(argv: list[str], folder: Path, capsys: pytest.CaptureFixture[str], *, leaves: tuple[str, ...] = ()) -> str:
    """Run a command that must be refused; its line on standard error.  leaves: names of the files that it writes."""
    before = sorted([*(path.name for path in folder.rglob("*")), *leaves])
    code = main(argv)
    captured = capsys.readouterr()
    assert code == 2, captured.err
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert "Traceback" not in captured.err
    assert sorted(path.name for path in folder.rglob("*")) == before
    return captured.err


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("command", [["run"], ["plan"]])
def test_a_malformed_scenario(
    name: str, command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.toml").write_text(SCENARIOS[name], encoding="utf-8")
    line = refused([*command, "bad.toml"], tmp_path, capsys)
    # A file that a scenario names is named itself.
    assert "bad.toml" in line or "small" in line or "nowhere.parm" in line


@pytest.mark.parametrize("name", ZONE_FILES)
def test_a_malformed_file_of_zones(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / name).write_text(ZONE_FILES[name], encoding="utf-8")
    (tmp_path / "named.toml").write_text(f'zones_file = "{name}"\n{SCENARIO}', encoding="utf-8")
    line = refused(["plan", "named.toml"], tmp_path, capsys)
    assert name in line or "named.toml: zones[0]" in line


@pytest.mark.parametrize("name", MISSIONS)
@pytest.mark.parametrize("command", ["fly", "check"])
def test_a_malformed_mission(name: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / name).write_text(MISSIONS[name], encoding="utf-8")
    assert name in refused([command, name], tmp_path, capsys)


@pytest.mark.parametrize("command", ["fly", "check"])
def test_a_broken_mission_is_an_error_case_in_the_xml(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.waypoints").write_text("no mission", encoding="utf-8")
    line = refused([command, "m.waypoints", "--junit", "m.xml"], tmp_path, capsys, leaves=("m.xml",))
    (suite,) = ElementTree.parse(tmp_path / "m.xml").getroot()
    assert suite.attrib == {"name": "m.waypoints"} | dict.fromkeys(("tests", "errors"), "1") | dict.fromkeys(
        ("failures", "skipped"), "0"
    )
    (case,) = suite
    assert case[0].tag == "error"
    assert case[0].attrib["message"] == line.removeprefix("planfly: ").rstrip("\n")
    (tmp_path / "m.xml").write_text("mine", encoding="utf-8")
    assert "exists; --overwrite replaces it" in refused([command, "m.waypoints", "--junit", "m.xml"], tmp_path, capsys)
    assert (tmp_path / "m.xml").read_text() == "mine"


@pytest.mark.parametrize("name", FENCES)
@pytest.mark.parametrize("command", [["check"], ["fly"], ["serve"], ["export"]])
def test_a_malformed_fence(name: str, command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / name).write_text(FENCES[name], encoding="utf-8")
    (tmp_path / "well.waypoints").write_text(WAY, encoding="utf-8")
    targets = ["out.plan"] if command == ["export"] else []
    assert name in refused([*command, "well.waypoints", *targets, "--fence", name], tmp_path, capsys)


@pytest.mark.parametrize("name", LOGS)
@pytest.mark.parametrize("command", ["check", "replay", "report"])
def test_a_malformed_log(name: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / name).write_bytes(LOGS[name])
    assert name in refused([command, name], tmp_path, capsys)


@pytest.mark.parametrize(
    "argv",
    [
        ["run", "missing.toml"],
        ["plan", "missing.toml"],
        ["export", "missing.json", "out.plan"],
        ["fly", "missing.waypoints"],
        ["check", "missing.mcap"],
        ["studio", "missing.waypoints", "--no-browser"],
        ["check", "well.waypoints", "--fence", "missing.fence"],
        ["check", "well.waypoints", "--fence", "missing.kml"],
        ["replay", "missing.mcap"],
        ["report", "missing.mcap"],
    ],
)
def test_a_missing_file(argv: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "well.waypoints").write_text(WAY, encoding="utf-8")
    assert "missing" in refused(argv, tmp_path, capsys)


@pytest.mark.parametrize(
    "argv",
    [
        *(["fly", "run"], ["check", "run"], ["report", "run"], ["replay", "run"], ["recover", "run"], ["run", "run"]),
        *(["plan", "run"], ["campaign", "run"], ["winds", "run"], ["returns", "run"], ["survey", "run"]),
        *(["export", "run", "out.plan"], ["import", "run", "new.mcap"], ["refly", "run"], ["compare", "run", "run"]),
        ["studio", "run", "--no-browser"],
        ["predict", "run", "--aircraft", "aerosonde"],
        *(["check", "well.waypoints", option, "run"] for option in ("--scenario", "--params", "--fence")),
        ["campaign", "well.waypoints", "--spread", "run"],
    ],
)
def test_a_folder_is_called_one_and_what_it_holds_is_named(
    argv: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "well.waypoints").write_text(WAY, encoding="utf-8")
    (tmp_path / "run").mkdir()
    for name in ("plan.json", "flight.mcap", "notes.txt"):
        (tmp_path / "run" / name).write_text("", encoding="utf-8")
    line = refused(argv, tmp_path, capsys)
    assert "run: is a folder that holds flight.mcap, plan.json; expected" in line or (
        "--fence" in argv and "run: is a folder that holds flight.mcap, plan.json" in line
    )


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (
            "campaign.sqlite",
            "is a folder that holds a campaign: planfly compare reads it, planfly campaign --resume --out",
        ),
        ("winds.sqlite", "is a folder that holds a search for winds: planfly winds --resume --out continues it"),
    ],
)
def test_the_folder_of_a_campaign_names_its_commands(
    file: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / file).touch()
    for command in ("check", "fly", "report"):
        assert words in refused([command, "out"], tmp_path, capsys)


def test_binary_scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.toml").write_bytes(b"\xff\xfe\x00\x01" * 40)
    assert "UTF-8" in refused(["run", "bad.toml"], tmp_path, capsys)


def test_the_message_names_file_key_value_and_range(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.toml").write_text(SCENARIOS["out of range"], encoding="utf-8")
    line = refused(["run", "bad.toml"], tmp_path, capsys)
    for part in ("bad.toml", "start.amsl_m", "90000", "9000"):
        assert part in line


@pytest.mark.parametrize("target", ["there.plan", "nowhere/out.plan", "out.gpx", "folder"])
def test_targets_are_checked_first(target: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "there.plan").write_text("mine", encoding="utf-8")
    (tmp_path / "folder").mkdir()
    (tmp_path / "plan.json").write_text(json.dumps({"schema": "planfly.plan/1"}), encoding="utf-8")
    refused(["export", "plan.json", target], tmp_path, capsys)
    assert (tmp_path / "there.plan").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    "argv",
    [
        [],
        ["land"],
        ["run", "--seed", "-1"],
        ["run", "--seed", "one"],
        ["fly", "m.plan", "--wind", "5"],
        ["fly", "m.plan", "--wind", "nan,3"],
        ["survey", "m.plan", "--camera", "23.5,16"],
        ["survey", "m.plan", "--camera", "23.5x15.6x3"],
        ["survey", "m.plan", "--camera", "23.5x15.6,0"],
        ["survey", "m.plan", "--camera", "23.5x15.6,16,75"],
        ["survey", "m.plan", "--camera", "23.5x15.6,16,75,100"],
        ["fly", "m.plan", "--turbulence", "severe"],
        ["replay", "a.mcap", "--speed", "0"],
    ],
)
def test_bad_usage_is_one_line(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(argv)
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
