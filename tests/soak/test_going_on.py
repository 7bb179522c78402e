"""A soak that was stopped goes on: what passed is left out, what was cut off begins anew."""

import json
from pathlib import Path

import pytest

from tests import soak

ONE, OTHER = "tests/test_one.py", "tests/test_other.py"


@pytest.fixture
def figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of figures of a soak of its own, with sources that a test may change."""
    target = tmp_path / "soak.json"
    for name, value in {"SOAK": True, "WHOLE": True, "FIGURES": target, "sources": lambda: "these"}.items():
        monkeypatch.setattr(soak, name, value)
    return target


def _run(monkeypatch: pytest.MonkeyPatch, file: str, cases: int, *, passes: bool = True) -> None:
    soak.begin_file(file)
    for case in range(cases):
        monkeypatch.setenv("PYTEST_CURRENT_TEST", f"{file}::test_it[{case}] (call)")
        soak.tally(f"row of {file}", cases=1)
    if passes:
        soak.end_file(file)


def test_a_file_that_passed_is_left_out(figures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only that one, and only as long as the sources are those that it passed with."""
    _run(monkeypatch, ONE, 3)
    _run(monkeypatch, OTHER, 2, passes=False)
    assert soak.passed_files() == {ONE}
    monkeypatch.setattr(soak, "sources", lambda: "others")
    assert soak.passed_files() == set()


def test_a_file_that_was_cut_off_counts_anew(figures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cases are not counted twice, and another file's rows stay."""
    _run(monkeypatch, ONE, 3)
    _run(monkeypatch, OTHER, 2, passes=False)
    _run(monkeypatch, OTHER, 5)
    rows = json.loads(figures.read_text(encoding="utf-8"))
    assert rows[f"row of {ONE}"] == {"cases": 3}
    assert rows[f"row of {OTHER}"] == {"cases": 5}
    assert soak.passed_files() == {ONE, OTHER}


def test_a_part_of_a_file_is_not_taken_for_the_whole(figures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests that a person chose by hand leave the file to be run."""
    monkeypatch.setattr(soak, "WHOLE", False)
    _run(monkeypatch, ONE, 3)
    monkeypatch.setattr(soak, "WHOLE", True)
    assert soak.passed_files() == set()


def test_the_hash_is_of_tests_and_packages_alike() -> None:
    """A file of each is among what it is made of."""
    names = {path.relative_to(soak.ROOT).as_posix() for path in soak.source_files()}
    assert {"tests/soak/test_going_on.py", "planner/plan.py", "pyproject.toml"} <= names
    assert not any(".venv" in name for name in names)
