"""Targets on disk: what may be written over, and what is cleared."""

import os
from pathlib import Path

import pytest

from logs.views.figures import FIGURES
from planfly.workflow.output_paths import (
    REPORT_FIGURES,
    RUN_FILES,
    RUN_FOLDER,
    check_output_file,
    check_output_folder,
    expand_path_pattern,
    prepare_folder,
)
from world.errors import PlanflyError


def test_a_named_file_is_refused_where_it_would_destroy(tmp_path: Path) -> None:
    there, link = tmp_path / "there.plan", tmp_path / "link.plan"
    there.write_text("mine", encoding="utf-8")
    link.symlink_to(there)
    check_output_file(tmp_path / "new.plan", overwrite=False, source=there)
    check_output_file(there, overwrite=True)
    for path, overwrite, source, message in (
        (there, False, None, "overwrite=True replaces it"),
        (link, True, there, "is the input file"),
        (tmp_path, True, None, "is a folder"),
        (tmp_path / "none" / "a.plan", True, None, "does not exist"),
    ):
        with pytest.raises(PlanflyError, match=message):
            check_output_file(path, overwrite, source)
    assert there.read_text(encoding="utf-8") == "mine"


def test_a_named_folder_is_refused_unless_it_is_empty(tmp_path: Path) -> None:
    check_output_folder(tmp_path, overwrite=False)
    check_output_folder(tmp_path / "new", overwrite=False)
    file = tmp_path / "mine.txt"
    file.write_text("mine", encoding="utf-8")
    with pytest.raises(PlanflyError, match="not empty; overwrite=True"):
        check_output_folder(tmp_path, overwrite=False)
    with pytest.raises(PlanflyError, match="expected a folder"):
        check_output_folder(file, overwrite=True)
    check_output_folder(tmp_path, overwrite=True)


def test_a_folder_that_cannot_be_made_is_refused_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "mine.txt"
    file.write_text("mine", encoding="utf-8")
    with pytest.raises(PlanflyError, match=r"mine\.txt: is a file; expected a folder"):
        check_output_folder(file / "below" / "new", overwrite=False)
    # For root every folder is writable.
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    with pytest.raises(PlanflyError, match=r"new: cannot be written: .* is not writable"):
        check_output_folder(tmp_path / "below" / "new", overwrite=False)


def test_a_run_clears_its_old_results_and_nothing_of_others(tmp_path: Path) -> None:
    old = tmp_path / "round-1"
    mixed = tmp_path / "round-2"
    for folder in (tmp_path, old, mixed):
        folder.mkdir(exist_ok=True)
        for name in (*RUN_FILES, "scene.png", "energy.png"):
            (folder / name).write_text("old", encoding="utf-8")
    for kept in (tmp_path / "mine.txt", mixed / "mine.txt", tmp_path / "map.svg"):
        kept.write_text("mine", encoding="utf-8")
    (tmp_path / "rounds.json").write_text("old", encoding="utf-8")
    prepare_folder(tmp_path)
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*"))
    assert left == ["map.svg", "mine.txt", "round-2", "round-2/mine.txt"]


def test_a_folder_of_old_results_alone_stays_to_take_the_new_ones(tmp_path: Path) -> None:
    folder = tmp_path / "runs" / "a"
    prepare_folder(folder)
    (folder / "plan.json").write_text("old", encoding="utf-8")
    prepare_folder(folder)
    assert folder.is_dir()
    assert list(folder.iterdir()) == []


def test_another_command_leaves_a_runs_rounds_alone(tmp_path: Path) -> None:
    (tmp_path / "round-1").mkdir()
    for name in ("round-1/map.png", "map.png", "plan.json", "rounds.json"):
        (tmp_path / name).write_text("old", encoding="utf-8")
    prepare_folder(tmp_path, ("map.png", "report.html"))
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert left == ["plan.json", "round-1/map.png", "rounds.json"]


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("jacksboro", "runs/jacksboro-seed3"),
        # The six letters are those of sha256sum (GNU coreutils).
        ("../../etc/passwd", "runs/-..-etc-passwd-3754d6-seed3"),
        ("a b/c", "runs/a-b-c-539138-seed3"),
        ("...", "runs/run-ab5df6-seed3"),
        (".", "runs/run-cdb4ee-seed3"),
        ("..", "runs/run-5ec1f7-seed3"),
        ("a/b", "runs/a-b-c14cdd-seed3"),
        ("a\\b", "runs/a-b-c62016-seed3"),
    ],
)
def test_a_default_folder_stays_below_runs(name: str, folder: str) -> None:
    assert expand_path_pattern(RUN_FOLDER, name, 3) == Path(folder)


def test_no_two_names_share_a_folder() -> None:
    names = ["a/b", "a\\b", "a b", "a:b", "a-b", "a.b", ".a-b", ".", "..", "...", "run", "-", "/", "a", ".a", "\udcff"]
    folders = {expand_path_pattern("{name}", name, 0) for name in names}
    assert len(folders) == len(names)
    assert all(len(folder.parts) == 1 and ".." not in folder.parts for folder in folders)


def test_a_patterns_folder_may_be_missing_and_a_named_files_may_not(tmp_path: Path) -> None:
    made = expand_path_pattern(tmp_path / "{name}-{seed}" / "plan.json", "a/b", 3)
    assert made == tmp_path / "a-b-c14cdd-3" / "plan.json"
    check_output_file(made, overwrite=False, suffix=".json", folder_must_exist=False)
    with pytest.raises(PlanflyError, match="does not exist"):
        check_output_file(made, overwrite=True, suffix=".json")
    made.parent.mkdir()
    made.write_text("mine", encoding="utf-8")
    with pytest.raises(PlanflyError, match="overwrite=True replaces it"):
        check_output_file(made, overwrite=False, suffix=".json", folder_must_exist=False)
    with pytest.raises(PlanflyError, match=r"expected a \.mcap file"):
        check_output_file(made, overwrite=True, suffix=".mcap")


def test_every_figure_of_a_report_is_cleared_with_it() -> None:
    assert list(REPORT_FIGURES) == [entry.name for entry in FIGURES]
