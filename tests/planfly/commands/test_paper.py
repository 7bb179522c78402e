"""``planfly paper``: tables and figures of the paper's experiment."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from logs.views import drawing
from logs.views.drawing import write_png
from planfly.cli import main
from planfly.planning.paper import paper_file_names
from planfly.workflow.output_paths import prepare_folder
from tests.soak import SOAK, only_in_soak

ROWS = ["umda", "umda-strip", "umda-cartesian", "umda-polar", "umda-polar-45", "umda-bearing"]
SEEDS = 2 if SOAK else 1
ASKED = ["paper", "--problems", "7", "--runs", str(SEEDS), "--jobs"]
STABLE = ("table.csv", "runs.csv", "runs.json", "paths-07.png", "encodings-07.png", "convergence.png")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One problem, one process."""
    made = tmp_path_factory.mktemp("paper") / "out"
    assert main([*ASKED, "1", "--out", str(made)]) == 0
    return made


def test_every_file_is_there_and_the_table_agrees_with_the_runs(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == sorted(paper_file_names([7]))
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in folder.glob("*.png"))
    data = json.loads((folder / "runs.json").read_text(encoding="utf-8"))
    assert [row["algorithm"] for row in data["table"]] == ROWS
    for row in data["table"]:
        mine = [run for run in data["runs"] if run["algorithm"] == row["algorithm"]]
        assert [run["seed"] for run in mine] == [*range(1, SEEDS + 1)]
        safe = [run["length_ratio"] for run in mine if run["safe"]]
        assert row["safe"] == len(safe)
        assert row["length_worst"] == (max(safe) if safe else None)
        assert row["kill_worst"] == max(run["kill_exposure"] for run in mine)
        for run in mine:
            clean = not any(value for key, value in run.items() if key.startswith("violations_"))
            assert run["safe"] == (clean and run["kill_exposure"] == 0)
            assert (run["kill_probability"] > 0) == (run["kill_exposure"] > 0)
            assert 0 <= run["kill_probability"] <= 1
            assert run["evaluations"] == 120 + 100 * 60
            assert np.shape(run["waypoints_east_north_amsl_m"]) == (10, 3)
    with (folder / "runs.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["length_ratio"]) for row in rows] == [run["length_ratio"] for run in data["runs"]]


@only_in_soak
def test_same_bytes_whatever_the_number_of_processes(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not SOAK:
        # Drawn of the plans that runs.json holds; the convergence, of more than that.
        monkeypatch.setattr(drawing, "write_png", lambda figure, file: "conv" in file.name and write_png(figure, file))
    out = tmp_path / "again"
    assert main([*ASKED, "2", "--out", str(out)]) == 0
    for name in STABLE if SOAK else ("table.csv", "runs.csv", "runs.json", "convergence.png"):
        assert (out / name).read_bytes() == (folder / name).read_bytes(), name


def test_a_named_folder_that_holds_anything_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "--problems", "7", "--out", str(folder)]) == 2
    assert "--overwrite" in capsys.readouterr().err


def test_overwriting_clears_only_what_a_run_writes(tmp_path: Path) -> None:
    for name in ("mine.txt", "paths-60.png", "table.csv"):
        (tmp_path / name).write_text("old", encoding="utf-8")
    prepare_folder(tmp_path, tuple(paper_file_names([7, 60])))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("options", "printed"),
    [
        (["--problems", "8"], "7,15,30,60"),
        (["--problems", ""], "7,15,30,60"),
        (["--runs", "0"], "1 to 1,000"),
        (["--runs", "2.5"], "1 to 1,000"),
        (["--jobs", "-1"], "1 to 1,000"),
    ],
)
def test_bad_options_get_one_line(options: list[str], printed: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["paper", *options])
    assert stopped.value.code == 2
    line = capsys.readouterr().err
    assert printed in line
    assert line.count("\n") == 1


def test_an_unknown_algorithm_is_refused_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["paper", "--algorithm", "simplex", "--out", str(tmp_path / "out")]) == 2
    assert "simplex" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
