"""``planfly export``: plans, missions and logs in every form."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import gpxpy
import numpy as np
import pyarrow.parquet
import pytest

import planfly
from flight.autopilots.parameter_files import read_parameter_file
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.mission.items import Mission, MissionItem
from flight.mission_files.formats import mission_text, read_mission
from logs.recording.reader import read_log
from planfly.api.exporting import format_judging_parameters
from planfly.cli import main
from planner.plan import plan_json
from tests.mission_lines import a_plan
from world.errors import MissionError

MISSIONS = Path(__file__).parents[2] / "flight" / "missions"
KML = "{http://www.opengis.net/kml/2.2}"


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("plan") / "plan.json"
    file.write_text(plan_json(a_plan([(9500.0, -5000.0, 700.0), (9000.0, -3000.0, 750.0), (6000.0, -2000.0, 800.0)])))
    return file


@pytest.fixture(scope="module")
def log_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("log")
    places = ["46\t8\t100", "46.01\t8\t120", "46.01\t8.01\t120"]
    lines = [f"{k}\t0\t3\t16\t0\t0\t0\t0\t{place}\t1" for k, place in enumerate(places, 1)]
    text = "\n".join(["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t46\t8\t0\t1", *lines]) + "\n"
    (folder / "m.waypoints").write_text(text, encoding="ascii")
    assert main(["fly", str(folder / "m.waypoints"), "--log", str(folder / "flight.mcap"), "--log-hz", "10"]) == 0
    return folder / "flight.mcap"


def test_a_plan_in_every_form(plan_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    targets = [tmp_path / f"a.{kind}" for kind in ("waypoints", "plan", "fence", "kml", "gpx")]
    assert main(["export", str(plan_file), *map(str, targets)]) == 0
    printed = capsys.readouterr()
    assert "a fence has no height" in printed.err
    # A map is named by the scenario, not by where its file lies.
    assert ElementTree.parse(targets[3]).getroot().findtext(f"{KML}Document/{KML}name") == "jacksboro-air"
    assert gpxpy.parse(targets[4].read_text()).name == "jacksboro-air"
    assert printed.out.count("\n") == len(targets)
    waypoints, plan, fence = (read_mission(target) for target in targets[:3])
    assert waypoints.items == plan.items
    assert plan.fences == fence.fences
    assert len(fence.fences) > 4
    # No returns are required, so the verdict had no rally points, and there are none to write.
    assert plan.rally == ()
    assert main(["export", str(plan_file), str(tmp_path / "a.rally")]) == 2
    assert "no rally points to write to" in capsys.readouterr().err
    # What is written is refused the second time.
    assert main(["export", str(plan_file), str(targets[2])]) == 2


def test_the_cruise_speed_of_a_plan_file_is_that_of_the_mission_or_the_aircraft(
    log_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The Aerosonde cruises at 25 m/s, the scenario's X8 at its own; a DO_CHANGE_SPEED of 19 m/s is the mission's."""
    monkeypatch.chdir(tmp_path)
    mission = log_file.with_name("m.waypoints").read_text()
    Path("m.waypoints").write_text(mission)
    lines = mission.splitlines()
    Path("slow.waypoints").write_text(
        "\n".join([*lines[:3], "2\t0\t3\t178\t0\t19\t-1\t0\t0\t0\t0\t1", *lines[3:]]) + "\n"
    )
    area = "[area]\neast_m = [-900, 9000]\nnorth_m = [-900, 9000]\nceiling_amsl_m = 900\n"
    ends = "".join(
        f"[{name}]\neast_m = {k}\nnorth_m = 0\namsl_m = 100\n" for name, k in (("start", 0), ("destination", 900))
    )
    terrain = '[terrain]\nkind = "flat"\namsl_m = 0\n[origin]\nlat_deg = 46.0\nlon_deg = 8.0\n'
    Path("x8.toml").write_text(f'name = "x"\n{terrain}{area}{ends}[flight]\naircraft = "x8"\n')
    x8 = planfly.aircraft("x8").airspeed
    for source, more, speed, words in (
        ("m.waypoints", [], 25.0, "from the default aircraft aerosonde; name yours with --aircraft"),
        ("m.waypoints", ["--aircraft", "x8"], x8, "from x8"),
        ("slow.waypoints", [], 19.0, "from the mission"),
        ("m.waypoints", ["--scenario", "x8.toml"], x8, "from x8"),
        (str(log_file), [], 25.0, "from aerosonde"),
    ):
        assert main(["export", source, "a.plan", *more, "--overwrite"]) == 0
        assert f"cruiseSpeed {speed:.0f} m/s {words})" in capsys.readouterr().out
        assert json.loads(Path("a.plan").read_text())["mission"]["cruiseSpeed"] == round(speed)


def places(file: Path) -> list[list[tuple[float, float, float]]]:
    """Points of each LineString of a KML file: longitude, latitude, height."""
    lines = ElementTree.parse(file).getroot().iter(f"{KML}LineString")
    texts = [line.findtext(f"{KML}coordinates") or "" for line in lines]
    return [[(float(a), float(b), float(c)) for a, b, c in (p.split(",") for p in text.split())] for text in texts]


def test_maps_of_a_log(log_file: Path, tmp_path: Path) -> None:
    assert main(["export", str(log_file), str(tmp_path / "f.kml"), str(tmp_path / "f.gpx")]) == 0
    log = read_log(log_file)
    plan, flown = places(tmp_path / "f.kml")
    items = [item for item in log.setup.mission.items if item.has_position]
    wanted = np.array([(item.lon_deg, item.lat_deg) for item in items])
    at = [k for k in range(len(items)) if k == 0 or items[k].x != items[k - 1].x or items[k].y != items[k - 1].y]
    assert np.array(plan)[:, :2] == pytest.approx(wanted[at], abs=2e-8)
    assert [up for _, _, up in plan] == pytest.approx(list(log.setup.route.positions[:, 2]), abs=1e-3)
    assert len(flown) == pytest.approx(2.0 * log.end_time, abs=3)
    assert flown[-1][2] == pytest.approx(log.track.position[-1, 2], abs=1e-3)
    gpx = gpxpy.parse((tmp_path / "f.gpx").read_text())
    assert [(p.longitude, p.latitude, p.elevation) for p in gpx.routes[0].points] == plan
    points = gpx.tracks[0].segments[0].points
    assert [(p.longitude, p.latitude, p.elevation) for p in points] == flown
    assert gpx.routes[0].points[0].name == "0 (item 1)"


def test_a_mission_from_form_to_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = str(MISSIONS / "qgc_takeoff.plan")
    targets = [tmp_path / name for name in ("a.waypoints", "a.fence", "a.rally", "a.plan")]
    assert main(["export", source, *map(str, targets)]) == 0
    original = read_mission(MISSIONS / "qgc_takeoff.plan")
    assert read_mission(targets[3]) == original
    assert read_mission(targets[1]).fences == original.fences
    assert read_mission(targets[2]).rally == original.rally
    capsys.readouterr()
    assert (
        main(["export", str(MISSIONS / "qgc.waypoints"), str(tmp_path / "b.waypoints"), str(tmp_path / "b.fence")]) == 2
    )
    assert "no fence items to write" in capsys.readouterr().err
    assert not (tmp_path / "b.waypoints").exists()


def test_the_parameters_that_a_plan_is_judged_with(plan_file: Path, tmp_path: Path) -> None:
    assert main(["export", str(plan_file), str(tmp_path / "a.parm")]) == 0
    read = read_parameter_file(tmp_path / "a.parm")
    assert {"RTL_ALTITUDE", "RALLY_LIMIT_KM", "LAND_FLARE_SEC", "RTL_AUTOLAND"} <= set(read)
    assert read["RTL_ALTITUDE"].value == 100.0
    # What flies by them alone is not in it.
    assert not {"WP_RADIUS", "ROLL_LIMIT_DEG"} & set(read)


def test_planflys_own_guidance_has_none_of_these_parameters() -> None:
    with pytest.raises(MissionError, match=r"^a\.waypoints: .* has no parameters of take-off, landing and returns$"):
        format_judging_parameters(Mission(None, (), source="a.waypoints"), PlanflyGuidance())


LANDING = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46\t8\t0\t1
1\t0\t3\t16\t0\t0\t0\t0\t46.01\t8\t100\t1
2\t0\t3\t189\t0\t0\t0\t0\t0\t0\t0\t1
3\t0\t3\t16\t0\t0\t0\t0\t46.01\t8.01\t60\t1
4\t0\t3\t21\t0\t0\t0\t0\t46\t8\t0\t1
"""


def test_the_parameters_of_a_mission_are_defaults_unless_a_file_states_them(tmp_path: Path) -> None:
    mission, mine, target = tmp_path / "m.waypoints", tmp_path / "mine.param", tmp_path / "a.parm"
    mission.write_text(LANDING, encoding="ascii")
    mine.write_text("RTL_AUTOLAND,2\nTKOFF_THR_MINACC,15\n", encoding="ascii")
    assert main(["export", str(mission), str(target)]) == 0
    assert "by planfly's defaults for this mission; name your own parameter file" in target.read_text()
    # With 0 ArduPlane does not arm.
    assert read_parameter_file(target)["RTL_AUTOLAND"].value == 1.0
    assert main(["export", str(mission), str(target), "--params", str(mine), "--overwrite"]) == 0
    assert "with which planfly judges the mission" in target.read_text()
    read = read_parameter_file(target)
    assert (read["RTL_AUTOLAND"].value, read["TKOFF_THR_MINACC"].value) == (2.0, 15.0)


def test_a_value_with_which_the_autopilot_does_not_arm_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission, mine, target = tmp_path / "m.waypoints", tmp_path / "mine.param", tmp_path / "a.parm"
    mission.write_text(LANDING, encoding="ascii")
    mine.write_text("RTL_AUTOLAND,0\n", encoding="ascii")
    assert main(["export", str(mission), str(target), "--params", str(mine)]) == 0
    assert "without RTL_AUTOLAND 0, because the autopilot does not arm with that value" in capsys.readouterr().out
    assert "RTL_AUTOLAND" not in read_parameter_file(target)


@pytest.mark.parametrize("suffix", ["parm", "plan", "waypoints", "kml", "csv"])
def test_a_log_has_its_own_autopilot_and_parameters(
    suffix: str, log_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target, params = tmp_path / f"a.{suffix}", tmp_path / "px4.params"
    params.write_text("NAV_ACC_RAD 20\n", encoding="ascii")
    for option, value, word in (("autopilot", "px4", "autopilot"), ("params", str(params), "parameters")):
        assert main(["export", str(log_file), str(target), f"--{option}", value]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert line.endswith(f"a log is exported with the {word} of its flight")
    assert not target.exists()


@pytest.mark.parametrize("name", ["a.kmz", "a.json", "a"])
def test_an_unknown_suffix_is_refused_with_the_known_ones(
    plan_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert main(["export", str(plan_file), str(tmp_path / "a.plan"), str(tmp_path / name)]) == 2
    assert (
        "expected one of .waypoints, .plan, .txt, .fence, .rally, .kml, .gpx, .parm, .csv, .parquet, .tlog, .ulg"
        in capsys.readouterr().err
    )
    assert not (tmp_path / "a.plan").exists()


def test_a_log_in_other_programs_forms(log_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    targets = [tmp_path / f"f.{kind}" for kind in ("csv", "parquet", "tlog", "ulg")]
    assert main(["export", str(log_file), *map(str, targets)]) == 0
    rows = len(read_log(log_file).track)
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["flight"] * 4
    assert len(targets[0].read_text().splitlines()) == rows + 1
    assert pyarrow.parquet.read_metadata(targets[1]).num_rows == rows
    # Both are imported logs to `check`, and the same flight.
    for target in targets[2:]:
        assert main(["check", str(target)]) in (0, 4)
        assert "Judged: " in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["csv", "parquet", "tlog", "ulg"])
def test_what_is_about_a_flight_is_not_written_of_a_plan(
    plan_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    assert main(["export", str(plan_file), str(tmp_path / "a.plan"), str(tmp_path / f"a.{kind}")]) == 2
    assert f"only a flight log (.mcap) can be exported as .{kind}" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_only_a_file_with_a_fence_says_what_the_fence_omits(tmp_path: Path) -> None:
    scenario = planfly.make_scenario("tight", threats=[[1200.0, 4000.0, 45.0, 0.0]])
    plan = planfly.plan(scenario, seed=1)
    assert planfly.export(plan, tmp_path / "m.waypoints", tmp_path / "m.kml").notes == ()
    for name in ("m.plan", "m.fence"):
        (note,) = planfly.export(plan, tmp_path / name).notes
        assert note.startswith("1 missile sphere became an exclusion circle")


WPL_PLACES = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46\t8\t0\t1\n" + "".join(
    f"{k}\t0\t3\t16\t0\t0\t0\t0\t46.0{k}\t8\t100\t1\n" for k in (1, 2)
)


@pytest.mark.parametrize(
    ("options", "firmware"),
    [
        ([], 3),
        (["--autopilot", "px4-1.16"], 12),
        (["--autopilot", "ardupilot"], 3),
        (["--autopilot", "planfly"], 0),
        (["--params", "px4.params"], 12),
        (["--params", "px4.params", "--autopilot", "ardupilot"], 3),
    ],
)
def test_a_plan_file_is_for_the_autopilot_that_is_named(
    options: list[str],
    firmware: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """MAV_AUTOPILOT: 3 is ArduPilot, 12 PX4; a .waypoints file names none, which is said if nobody names one."""
    monkeypatch.chdir(tmp_path)
    Path("a.waypoints").write_text(WPL_PLACES, encoding="ascii")
    Path("px4.params").write_text("# Stack: PX4 Pro\n1\t1\tNAV_ACC_RAD\t20\t9\n", encoding="ascii")
    assert main(["export", "a.waypoints", "a.plan", *options]) == 0
    assert json.loads(Path("a.plan").read_text())["mission"]["firmwareType"] == firmware
    note = "a.waypoints names no autopilot: the .plan is for ArduPilot; name another with --autopilot or --params"
    assert (note in capsys.readouterr().err) is not bool(options)
    # Converted again, it stays what it is.
    assert main(["export", "a.plan", "b.plan"]) == 0
    assert json.loads(Path("b.plan").read_text())["mission"]["firmwareType"] == (firmware or 3)


def test_rally_points_of_a_plan_are_kept_and_those_of_a_fence_are_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.waypoints").write_text(WPL_PLACES, encoding="ascii")
    mission = read_mission(Path("a.waypoints"))
    corners = [MissionItem(k, 5001, 0, (3.0, 0.0, 0.0, 0.0), *place, 0.0) for k, place in enumerate(CORNERS)]
    rally = MissionItem(0, 5100, 3, (0.0,) * 4, 46.01, 8.0, 100.0)
    full = replace(mission, fences=tuple(corners), rally=(rally,), autopilot="px4")
    Path("full.plan").write_text(mission_text(full, "plan"), encoding="utf-8")
    assert main(["export", "full.plan", "again.plan"]) == 0
    again = read_mission(Path("again.plan"))
    assert (len(again.fences), len(again.rally), again.autopilot) == (3, 1, "px4")
    assert "rally" not in capsys.readouterr().err
    assert main(["export", "a.waypoints", "bare.plan", "--fence", "full.plan", "--autopilot", "px4"]) == 0
    assert "full.plan: 1 rally point not exported: --fence reads only the fence" in capsys.readouterr().err
    assert read_mission(Path("bare.plan")).rally == ()


CORNERS = ((45.9, 7.9), (45.9, 8.1), (46.1, 8.0))


def test_an_error_about_a_plan_names_no_temporary_file(tmp_path: Path) -> None:
    plan = a_plan([(0.0, 0.0, 700.0), (2000.0, 0.0, 700.0), (4000.0, 100.0, 700.0), (6000.0, 0.0, 700.0)])
    with pytest.raises(MissionError) as caught:
        planfly.export(plan, tmp_path / "p.rally")
    assert str(caught.value) == f"the plan: contains no rally points to write to {tmp_path / 'p.rally'}"
