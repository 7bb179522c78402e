"""Each command's --json: alone on standard output, as its schema has it, and true."""

import json
from dataclasses import fields
from pathlib import Path

import pytest

import planfly.planning.paper
from aircraft.catalog import load_aircraft
from logs.recording.example_log import write_example_log
from logs.recording.reader import read_log
from logs.verdict.document import VerdictDocument
from planfly.api import predicting
from planfly.cli import main
from planfly.planning.paper import SeededPlan
from planfly.terminal.verdict_answers import CheckAnswer, FlyAnswer
from tests.logs.importers.written_logs import dataflash
from tests.planfly.commands.imported_log_files import example_plan
from tests.planfly.conftest import FIELD
from tests.planfly.made_plans import made_plan
from tests.planfly.terminal.answers.checked_answers import answered

Output = pytest.CaptureFixture[str]
QUICK = '[flight]\nautopilot = "planfly"\n[planner]\npopulation = 20\ngenerations = 5\n'


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("field.toml").write_text(FIELD + QUICK, encoding="utf-8")


@pytest.mark.usefixtures("blank_pictures")
def test_plan_run_and_fly(capsys: Output) -> None:
    plan = answered(capsys, 0, "plan", "field.toml", "--out", "plan.json")
    written = json.loads(Path("plan.json").read_text(encoding="utf-8"))
    assert (plan["file"], plan["seed"], plan["safe"]) == ("plan.json", 1, True)
    assert plan["waypoints"] == len(written["waypoints_east_north_amsl_m"])
    run = answered(capsys, 0, "run", "field.toml", "--out", "out", "--refine", "1")
    assert sorted(run["files"]) == sorted(path.name for path in Path("out").iterdir())
    assert run["verdict"] == json.loads(Path("out/verdict.json").read_text(encoding="utf-8"))
    assert [one["round"] for one in run["rounds"]] == [0]
    fly = answered(capsys, 0, "fly", "plan.json", "--log", "f.mcap")
    assert (fly["mission"], fly["log"], fly["autopilot_log"]) == ("plan.json", "f.mcap", None)
    assert fly["verdict"]["flyable"] is True
    assert fly["headline"] == fly["verdict"]["summary"].splitlines()[0]
    assert run["headline"] == run["verdict"]["summary"].splitlines()[0]


@pytest.mark.usefixtures("blank_pictures")
def test_what_is_asked_of_a_log(capsys: Output) -> None:
    write_example_log(Path("a.mcap"))
    log = read_log(Path("a.mcap"))
    check = answered(capsys, 4, "check", "a.mcap")
    report = answered(capsys, 4, "report", "a.mcap", "--out", "pages")
    headline = report["verdict"]["summary"].splitlines()[0]
    assert report["verdict"] | {"exit_code": 4, "headline": headline, "returns": None} == check
    assert sorted(report["files"]) == sorted(str(path) for path in Path("pages").iterdir())
    replay = answered(capsys, 0, "replay", "a.mcap", "--from", "5")
    assert replay["end_s"] == log.end_time
    assert min(one["time_s"] for one in replay["timeline"]) >= 5.0
    compare = answered(capsys, 0, "compare", "a.mcap", "a.mcap")
    assert (compare["flyable"], compare["files"]) == ([False, False], [])
    assert all(one["first"] == one["second"] for one in compare["quantities"])
    export = answered(capsys, 0, "export", "a.mcap", "a.kml", "a.plan")
    assert [one["file"] for one in export["files"]] == ["a.kml", "a.plan"]
    assert answered(capsys, 0, "recover", "a.mcap")["log"] is None
    data = Path("a.mcap").read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 3 // 4])
    recovered = answered(capsys, 3, "recover", "cut.mcap")
    assert recovered["log"] == "cut-recovered.mcap"
    assert recovered["rows"] == len(read_log(Path("cut-recovered.mcap")).track)


def test_logs_of_the_field(tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    dataflash(Path("a.BIN"))
    plan = str(example_plan(tmp_path))
    imported = answered(capsys, 0, "import", "a.BIN", "a.mcap", "--plan", plan, "--aircraft", "aerosonde")
    assert (imported["log"], imported["rows"]) == ("a.mcap", len(read_log(Path("a.mcap")).track))
    refly = answered(capsys, 0, "refly", "a.mcap")
    assert sorted(refly["files"]) == sorted(str(path) for path in Path("a-refly").iterdir())
    draws = predicting.draw_flight_variations(load_aircraft("aerosonde"), 3)
    monkeypatch.setattr(predicting, "draw_flight_variations", lambda _: draws)
    predict = answered(capsys, 0, "predict", "a.mcap", "--aircraft", "aerosonde", "--out", "predicted")
    assert sorted(predict["files"]) == sorted(str(path) for path in Path("predicted").iterdir())
    assert (predict["by"], predict["draws"], predict["windows"]) == ("mission", 3, 0)
    shares = {one["name"]: one["inside"] for one in predict["quantities"]}
    # The written log states 3,600 W, which no draw of the Aerosonde takes.
    assert shares["power"] == 0.0
    assert shares["cross-track"] is not None


def test_the_papers_table(capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    def planned(*_: object) -> list[SeededPlan]:
        return [made_plan("umda", seed, 1.2 + 0.1 * seed, 0.0) for seed in (1, 2)]

    monkeypatch.setattr(planfly.planning.paper, "plan_section", planned)
    monkeypatch.setattr(planfly.planning.paper, "write_figures", lambda *_: None)
    (row,) = answered(capsys, 0, "paper", "--out", "out")["rows"]
    assert (row["algorithm"], row["runs"], row["safe"]) == ("umda", 2, 2)
    assert row["length_worst"] == pytest.approx(1.4)


def test_the_scenarios(capsys: Output) -> None:
    found = answered(capsys, 0, "scenarios")["scenarios"]
    assert {"jacksboro", "tight", "steep"} < {one["name"] for one in found}
    assert main(["scenarios", "--json", "s.json"]) == 0
    # The lines stay where the answer goes elsewhere.
    assert capsys.readouterr().out.startswith("jacksboro ")
    assert json.loads(Path("s.json").read_text(encoding="utf-8"))["scenarios"] == found


def test_fly_and_check_name_the_same_things_alike() -> None:
    """As docs/file-formats.md states: `check` has the verdict's fields at the top, and the others in both."""
    verdict, checked, flown = (
        {field.name: field.type for field in fields(answer)} for answer in (VerdictDocument, CheckAnswer, FlyAnswer)
    )
    assert checked.keys() - verdict.keys() == {"exit_code", "headline", "returns"}
    assert checked.keys() - verdict.keys() <= flown.keys()
    assert "verdict" in flown
    assert "verdict" not in checked
