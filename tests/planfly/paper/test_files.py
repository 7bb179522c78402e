"""The paper's table as text, and its tables as files."""

import csv
import json
from dataclasses import replace
from pathlib import Path

from planfly.paper.files import file_names, table_text, write_tables
from planfly.paper.seeded_plans import table
from tests.planfly.paper.made_plans import made_plan

PLANS = [made_plan("a", 1, 1.2, 0.0), made_plan("a", 2, 1.1, 0.5), made_plan("b", 1, 1.0, 0.0, bad=1)]


def read_csv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def test_the_text_has_a_line_for_each_row_of_the_table() -> None:
    text = table_text(table(PLANS)).splitlines()
    # One of a's two plans is safe, of length ratio 1.2; none of b's, so it has no length.
    assert text[1].split()[:6] == ["7", "a", "1/2", "1/2", "1.2000", "1.2000"]
    assert text[2].split()[:6] == ["7", "b", "0/1", "1/1", "-", "-"]
    assert text[0].split()[:4] == ["threats", "algorithm", "safe", "certified"]


def test_a_folder_has_two_pictures_for_each_problem_beside_the_tables() -> None:
    names = file_names([7, 60])
    assert len(names) == len(set(names))
    assert {"paths-07.png", "encodings-07.png", "paths-60.png", "encodings-60.png", "convergence.png"} == {
        name for name in names if name.endswith(".png")
    }


def test_tables_hold_the_plans_and_only_times_csv_their_time(tmp_path: Path) -> None:
    write_tables(tmp_path, table(PLANS), PLANS)
    rows = read_csv(tmp_path / "runs.csv")
    assert [(row["algorithm"], row["seed"], row["safe"]) for row in rows] == [
        ("a", "1", "True"), ("a", "2", "False"), ("b", "1", "False")
    ]  # fmt: skip
    assert [float(row["length_ratio"]) for row in rows] == [1.2, 1.1, 1.0]
    assert [float(row["detection_exposure"]) for row in rows] == [2.0, 4.0, 2.0]
    data = json.loads((tmp_path / "runs.json").read_text(encoding="utf-8"))
    assert [run["kill_exposure"] for run in data["runs"]] == [0.0, 0.5, 0.0]
    assert [(row["algorithm"], row["kill_worst"]) for row in data["table"]] == [("a", 0.5), ("b", 0.0)]
    times = read_csv(tmp_path / "times.csv")
    assert [float(row["cpu_s"]) for row in times] == [0.5, 1.0, 0.5]
    slower = [replace(PLANS[0], seconds=99.0)]
    kept = {}
    for folder, plans in (("x", PLANS[:1]), ("y", slower)):
        (tmp_path / folder).mkdir()
        write_tables(tmp_path / folder, table(plans), plans)
        kept[folder] = [(tmp_path / folder / name).read_bytes() for name in ("table.csv", "runs.csv", "runs.json")]
    assert kept["x"] == kept["y"]
