"""``planfly plan --front``: a folder of plans with their table and pictures; what it refuses."""

import csv
import json
from pathlib import Path

import pytest

from planfly.cli import main
from planfly.terminal.plan_answers import fewer_plans_line, front_lines
from planfly.workflow.uav import load_uav
from planner.plan import read_plan
from planner.search.plan_front import plan_front
from planner.search.plan_path import plan_path
from world.scenario import load_scenario


@pytest.mark.usefixtures("short_fronts")
def test_a_front_is_a_folder_of_plans_with_their_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, answer = tmp_path / "front", tmp_path / "answer.json"
    assert main(["plan", "hard-07", "--front", "3", "--seed", "2", "--out", str(folder), "--json", str(answer)]) == 0
    text = capsys.readouterr().out
    made = json.loads(answer.read_text(encoding="utf-8"))
    plans = [read_plan(Path(one["file"])) for one in made["plans"]]
    assert len(plans) == 3
    assert "asked for" not in text
    assert all(plan.safe for plan in plans)
    names = {f"plan-{number}.json" for number in range(1, len(plans) + 1)}
    pictures = {"front-map.png", "front-values.png"}
    assert {file.name for file in folder.iterdir()} == names | pictures | {"front.csv", "front.json"}
    assert "front-values.png" in text
    table = json.loads((folder / "front.json").read_text(encoding="utf-8"))
    with (folder / "front.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert table["asked"] == made["asked"] == 3
    assert [row["file"] for row in table["plans"]] == [f"plan-{row['plan']}.json" for row in rows]
    for row, entry, one, plan in zip(rows, table["plans"], made["plans"], plans, strict=True):
        for name in ("length_m", "exposure_s", "clearance_m", "energy_wh", "time_s"):
            assert float(row[name]) == entry[name] == one[name]
        legs = plan.waypoints[1:] - plan.waypoints[:-1]
        assert float(row["length_m"]) == pytest.approx(((legs**2).sum(axis=1) ** 0.5).sum(), abs=0.06)


@pytest.mark.usefixtures("short_fronts")
def test_a_front_without_choices_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Level ground without radars, between ends at 75 m: all there is to choose is how short it is."""
    folder, answer = tmp_path / "front", tmp_path / "answer.json"
    assert main(["plan", "tight", "--front", "10", "--seed", "1", "--out", str(folder), "--json", str(answer)]) == 0
    text = capsys.readouterr().out
    assert text.startswith("front of 1 safe plan\n")
    assert (
        "  note    1 of the 10 requested plans: no further plan gains more than 0.1% in length or energy, 1% in "
        "exposure or 1 m in height above ground\n"
    ) in text
    assert [file.name for file in folder.glob("plan-*")] == ["plan-1.json"]
    for written in (answer, folder / "front.json"):
        document = json.loads(written.read_text(encoding="utf-8"))
        assert (document["asked"], len(document["plans"])) == (10, 1)
    (failure,) = json.loads(answer.read_text(encoding="utf-8"))["plans"][0]["expected_failures"]
    assert failure.startswith("flights are expected to fail: the limits of the scenario are looser than")
    assert f"  note    plan 1: {failure}\n" in text


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--front", "1"], "argument --front: '1': expected a whole number of plans, 2 to 100"),
        (["--front", "101"], "argument --front: '101': expected a whole number of plans, 2 to 100"),
        (["--front", "5", "--algorithm", "umda"], "--algorithm umda: cannot be combined with --front N"),
        (["--front", "5", "--budget", "900"], "--budget 900: with --front N the budget is a number of seconds"),
    ],
)
def test_what_does_not_go_with_a_front_is_refused_in_a_line(
    options: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code: object = main(["plan", "tight", *options, "--out", str(tmp_path / "front")])
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert line in error
    assert list(tmp_path.iterdir()) == []


def test_a_front_that_its_budget_ended_says_so_and_that_its_limits_are_loose() -> None:
    scenario = load_scenario("tight")
    limits = load_uav(scenario).limits
    default = plan_path(scenario, limits, seed=1)
    front = plan_front(scenario, limits, 10, seed=1, default=default, stop=lambda: "budget")
    # The search stops after the first seed, which is the default plan.
    assert (front.ended, front.evaluations, len(front.plans)) == ("budget", 1, 1)
    assert fewer_plans_line(front).startswith(
        "1 of the 10 requested plans: the search was stopped by the time budget after 1 evaluation;"
    )
    (note,) = [line for line in front_lines(front, Path("front")) if "expected to fail" in line]
    assert note.startswith("  note    plan 1: flights are expected to fail: the limits of the scenario are looser")
