"""The whole chain as a person runs it."""

import html
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flight.mission.items import Command
from flight.mission_files.formats import read_mission
from logs.recording.reader import read_log
from logs.verdict.rules.registry import RULES
from planfly.cli import main
from planfly.workflow.output_paths import RUN_FILES
from planfly.workflow.pipeline import return_summary
from tests.logs.verdict.judging import SILENT_ON_WAYPOINTS
from tests.planfly.conftest import FIELD
from tests.planfly.made_plans import DEFAULT_RUN, default_run
from tests.soak import SOAK, scaled, some

ROOT = Path(__file__).parents[3]
SAME = ("plan.json", "mission.waypoints", "mission.plan", "flight.mcap", "verdict.json")
# Seeds 1 to 3 are flown in tests/test_same_results.py, too.
SEEDS = range(1, 1 + scaled(100, 1))
# ``planfly run`` but for its pictures, which take most of its time.
WITHOUT_PICTURES = """
import sys
import logs.views.report.page
from planfly.cli import main
logs.views.report.page.write_report = lambda *_, **__: []
sys.exit(main(["run", *sys.argv[1:]]))
"""


def planfly(*argv: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "planfly", *argv],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that one run of the default scenario leaves: in a soak of a process of its own, with its pictures."""
    folder = tmp_path_factory.mktemp("demo")
    if SOAK:
        result = planfly("run", cwd=folder)
        code, said = result.returncode, result.stdout
    else:
        code, said, files = default_run()
        (folder / DEFAULT_RUN).mkdir(parents=True)
        for name, data in files.items():
            (folder / DEFAULT_RUN / name).write_bytes(data)
    assert code == 0, said
    assert said.startswith("flyable\n")
    return folder / DEFAULT_RUN


# What a program's flight leaves.
OF_OTHERS = {"flight.BIN", "flight.ulg"}
# What the demo has that a plain route has not: a launch, a landing and its go-around.
OF_THE_DEMO = {"launch", "touchdown", "go_around"}


def test_a_run_leaves_every_file(demo: Path) -> None:
    assert sorted(path.name for path in demo.iterdir()) == sorted(set(RUN_FILES) - OF_OTHERS)
    assert all(path.stat().st_size > 300 for path in demo.iterdir())
    assert (demo / "map.png").read_bytes().startswith(b"\x89PNG")
    page = (demo / "report.html").read_text(encoding="utf-8")
    assert len(page.encode("utf-8")) < 8e6
    assert not re.search(r"(src|href)=.https?:", page)


def test_the_verdict_file_has_findings_of_every_rule(demo: Path) -> None:
    verdict = json.loads((demo / "verdict.json").read_text(encoding="utf-8"))
    assert verdict["flyable"] is True
    assert verdict["complete"] is True
    assert {finding["rule"] for finding in verdict["findings"]} == set(RULES) - SILENT_ON_WAYPOINTS | OF_THE_DEMO
    numbers = ["planned", "flown", "limit", "tolerance", "margin", "unit"]
    words = ["where", "reason", "brief", "suggestion"]
    data = ["place", "placed", "suggestions", "check", "facts", "at_least", "passes"]
    keys = ["rule", *numbers, "limit_source", "method", "ok", *words, *data]
    assert all(sorted(finding) == sorted(keys) for finding in verdict["findings"])
    assert all(finding["ok"] is True for finding in verdict["findings"])


def test_the_demo_is_flown_from_the_ground_to_the_ground_and_comes_home(demo: Path) -> None:
    log = read_log(demo / "flight.mcap")
    ways = log.setup.ground_phases
    assert ways.take_off is not None
    assert ways.approach is not None
    assert log.track.clearance[0] < 5.0
    assert np.hypot(*log.track.velocity[-1, :2]) < 0.5
    commands = [item.command for item in read_mission(demo / "mission.waypoints").items]
    assert (commands[0], commands[-1]) == (Command.NAV_TAKEOFF, Command.NAV_LAND)
    parameters = (demo / "mission.parm").read_text(encoding="utf-8")
    assert re.search(r"^RTL_AUTOLAND[ ,\t]+3", parameters, re.MULTILINE)
    page = (demo / "report.html").read_text(encoding="utf-8")
    assert "launched from a catapult at home" in page
    beside = return_summary(log.setup, log.track)
    assert beside.line.startswith("all ")
    # An ordinary run's pictures are blank, captions and all.
    assert not SOAK or html.escape(beside.line[1:]) in page


@pytest.mark.skipif(not SOAK, reason="kept digests say so of three runs in every suite: in make soak")
def test_two_runs_are_byte_identical(demo: Path, tmp_path: Path) -> None:
    """In another process, with another hash seed and another number of threads."""
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT_PICTURES, "--out", "again"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONHASHSEED": "77", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert result.returncode == 0, result.stderr
    for name in SAME:
        assert (tmp_path / "again" / name).read_bytes() == (demo / name).read_bytes(), name


def test_check_of_the_log_repeats_the_verdict(demo: Path, tmp_path: Path) -> None:
    assert main(["check", str(demo / "flight.mcap"), "--json", str(tmp_path / "v.json")]) == 0
    answer = json.loads((tmp_path / "v.json").read_bytes())
    assert answer.pop("exit_code") == 0
    returns = answer.pop("returns")
    assert returns["returns"] == sum(returns["outcomes"].values()) > 0
    assert answer.pop("headline") == "flyable"
    assert answer == json.loads((demo / "verdict.json").read_bytes())


@pytest.mark.skipif(not SOAK, reason="its exported mission is flown again below: in make soak")
def test_flying_the_plan_again_gives_the_same_track(demo: Path, tmp_path: Path) -> None:
    assert main(["fly", str(demo / "plan.json"), "--log", str(tmp_path / "f.mcap")]) == 0
    again, first = read_log(tmp_path / "f.mcap").track, read_log(demo / "flight.mcap").track
    assert again.position.tobytes() == first.position.tobytes()


# A flight of a .plan with the same items is the same; it is flown in make soak.
@pytest.mark.parametrize("suffix", ["waypoints", "plan"] if SOAK else ["waypoints"])
def test_the_exported_mission_flies_in_its_scenario(demo: Path, flight: Path, tmp_path: Path, suffix: str) -> None:
    """Of the demo in a soak, otherwise of a flight that is a tenth as long."""
    run, scenario, code = (demo, "jacksboro", 0) if SOAK else (flight, "tight", 4)
    mission, log = str(run / f"mission.{suffix}"), tmp_path / "f.mcap"
    assert main(["fly", mission, "--scenario", scenario, "--log", str(log), "--seed", "1"]) == code
    again, first = read_log(log).track, read_log(run / "flight.mcap").track
    assert again.position.tobytes() == first.position.tobytes()


def test_export_writes_what_the_run_wrote(demo: Path, tmp_path: Path) -> None:
    targets = [tmp_path / "m.waypoints", tmp_path / "m.plan"]
    assert main(["export", str(demo / "plan.json"), *map(str, targets)]) == 0
    assert targets[0].read_bytes() == (demo / "mission.waypoints").read_bytes()
    # An export adds the fence and the rally points, which the run's own files leave out.
    plan, bare = (json.loads(file.read_text(encoding="utf-8")) for file in (targets[1], demo / "mission.plan"))
    assert plan["mission"] == bare["mission"]
    assert plan["geoFence"]["circles"]
    assert plan["rallyPoints"]["points"]
    assert not bare["geoFence"]["circles"]


def test_replay_and_report_from_the_log_alone(demo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = tmp_path / "only.mcap"
    copy.write_bytes((demo / "flight.mcap").read_bytes())
    assert main(["replay", str(copy)]) == 0
    lines = capsys.readouterr().out.splitlines()
    verdict = json.loads((demo / "verdict.json").read_text(encoding="utf-8"))
    legs = sum(finding["rule"] == "slope" for finding in verdict["findings"])
    # The landing's leg is none that has a slope to be held to.
    assert sum(line[13:16] == "leg" for line in lines) == legs + 1
    if not SOAK:
        return  # A report of a log alone is drawn in the tests of the command.
    assert main(["report", str(copy), "--out", str(tmp_path / "r")]) == 0
    drawn = {name for name in RUN_FILES if name.endswith((".png", ".html"))}
    assert {path.name for path in (tmp_path / "r").iterdir()} == drawn
    assert (tmp_path / "r" / "map.png").read_bytes() == (demo / "map.png").read_bytes()


def test_a_named_target_that_exists_is_refused(demo: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mine.txt").write_text("keep", encoding="utf-8")
    assert main(["run", "--out", str(tmp_path / "run")]) == 2
    assert main(["check", str(demo / "flight.mcap"), "--json", str(demo / "verdict.json")]) == 2
    assert main(["fly", str(demo / "plan.json"), "--log", str(demo / "flight.mcap")]) == 2
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["mine.txt"]


@pytest.mark.skipif(not SOAK, reason="three seeds are among the kept results: in make soak")
@pytest.mark.parametrize("seed", SEEDS)
def test_every_seed_ends_flyable(seed: int, tmp_path: Path) -> None:
    import planfly as package

    result = package.plan_then_fly("jacksboro-air", seed=seed)
    assert result.plan.safe, result.plan.certificate.problems
    assert result.verdict.flyable, result.verdict.summary


@pytest.mark.skipif(not SOAK, reason="its first seed is flown by most tests here: in make soak")
@pytest.mark.parametrize("seed", [2, 3])
def test_the_demo_from_the_ground_flies_and_comes_home_with_other_seeds(seed: int, tmp_path: Path) -> None:
    import planfly as package

    found: list[package.Round] = []
    package.run("jacksboro", seed=seed, out=tmp_path / "run", on_round=found.append)
    assert found[0].verdict.flyable, found[0].verdict.summary
    assert found[0].returns_line.startswith("all ")


@pytest.mark.skipif(not SOAK, reason="README's lines, nearly the same, run in the tests of the pages; in make soak")
def test_the_example_runs() -> None:
    result = subprocess.run(
        [sys.executable, ROOT / "examples" / "plan_then_fly.py"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("flyable\n")
    source = (ROOT / "examples" / "plan_then_fly.py").read_text(encoding="utf-8")
    assert len([line for line in source.splitlines() if line and not line.startswith('"""')]) < 10


# `tight` is flown in test_run_unflyable.py, too.
@pytest.mark.parametrize(("name", "rule"), some([("steep", "slope"), ("tight", "turn")], 2))
@pytest.mark.usefixtures("blank_pictures")
def test_plans_that_do_not_fly(name: str, rule: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", name, "--out", str(tmp_path / "out")]) == 4
    said = capsys.readouterr().out
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text(encoding="utf-8"))
    assert verdict["flyable"] is False
    failed = [finding for finding in verdict["findings"] if finding["ok"] is False]
    assert rule in {finding["rule"] for finding in failed}
    assert said.startswith("not flyable: ")
    assert rule in said.splitlines()[0]


@pytest.mark.usefixtures("blank_pictures")
def test_no_feasible_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ridge = "".join(
        f"[[terrain.peak]]\neast_m = 3000\nnorth_m = {north}\nheight_m = 1500\nsigma_m = 500\n"
        for north in range(-1000, 7001, 500)
    )
    (tmp_path / "walled.toml").write_text(
        'name = "walled"\n[terrain]\nkind = "peaks"\n' + ridge + "[area]\neast_m = [0, 6000]\nnorth_m = [0, 6000]\n"
        "ceiling_amsl_m = 900\n[start]\neast_m = 300\nnorth_m = 3000\nheight_m = 100\n"
        "[destination]\neast_m = 5700\nnorth_m = 3000\nheight_m = 100\n"
        "[planner]\npopulation = 40\ngenerations = 10\n",
        encoding="utf-8",
    )
    assert main(["run", str(tmp_path / "walled.toml"), "--out", str(tmp_path / "out")]) == 4
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text(encoding="utf-8"))
    assert verdict["complete"] is False
    assert verdict["flyable"] is False
    assert {"clearance"} <= {finding["rule"] for finding in verdict["findings"] if finding["ok"] is False}
    assert (tmp_path / "out" / "plan.json").exists()
    assert not (tmp_path / "out" / "flight.mcap").exists()
    assert "no feasible plan" in capsys.readouterr().out.splitlines()[0]


@pytest.mark.usefixtures("blank_pictures")
def test_a_run_takes_what_a_flight_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    quick = "[planner]\npopulation = 20\ngenerations = 5\n"
    Path("field.toml").write_text(FIELD + quick, encoding="utf-8")
    options = ["--wind", "5,90", "--turbulence", "none", "--airspeed", "22", "--guidance", "path", "--nav", "rtk"]
    assert main(["run", "field.toml", *options, "--log-hz", "10", "--out", "out"]) == 0
    log = read_log(Path("out/flight.mcap"))
    wind = log.setup.scenario.wind
    assert (wind.speed, math.degrees(wind.from_course), wind.turbulence) == (5.0, pytest.approx(90.0), "none")
    assert (log.setup.route.leg_airspeeds == 22.0).all()
    assert (log.setup.autopilot.store().guidance, log.setup.nav, log.setup.aircraft) == ("path", "rtk", "aerosonde")
    assert log.track.time[1] - log.track.time[0] == pytest.approx(0.1)
    # The plan was made in that wind, too, and the report names the line that repeats it.
    assert json.loads(Path("out/plan.json").read_text(encoding="utf-8"))["scenario"]["wind"]["speed_mps"] == 5.0
    page = Path("out/report.html").read_text(encoding="utf-8")
    repeated = "--wind 5,90 --turbulence none --airspeed 22.0 --guidance path --nav rtk --log-hz 10"
    assert f"planfly run field.toml --seed 1 {repeated}" in page
