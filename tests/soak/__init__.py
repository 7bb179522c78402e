"""Full counts with PLANFLY_SOAK=1, and one file with the figures of all packages: build/soak.json.

A soak takes hours.  ``make soak GO_ON=1`` goes on with one that was stopped: files of tests that passed as a whole,
with these very sources, are not run again, and what a file had noted before it was cut off is taken out.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import pytest

Case = TypeVar("Case")
SOAK = os.environ.get("PLANFLY_SOAK") == "1"
# Whether files are run as a whole, so that those that pass can be left out another time: `make soak` does.
WHOLE = SOAK and os.environ.get("PLANFLY_SOAK_WHOLE") == "1"
# Mark of a test that `make test` skips: it takes more than 4 s of a core or 15 s by the clock, and cheaper tests of
# `make test` exercise the same code.
only_in_soak = pytest.mark.skipif(not SOAK, reason="takes long; runs in make soak")
ROOT = Path(__file__).parents[2]
FIGURES = Path(os.environ.get("PLANFLY_SOAK_FIGURES", ROOT / "build" / "soak.json"))
# Rows of the file that are not figures: the file of tests that noted each row, and the sources that a file passed with.
NOTED_BY, PASSED_WITH = "noted by", "passed with sources"
_SOURCES = ("*.py", "*.toml", "*.txt", "*.xml", "*.js", "*.html")
# Rows with a figure of each file, or of each test.
SECONDS, CORE_SECONDS = "seconds by the clock", "seconds of a core"
_SHARED = (PASSED_WITH, SECONDS, CORE_SECONDS)
_PACKAGES = ("aircraft", "flight", "logs", "planfly", "planner", "tests", "world")


def scaled(full: int, few: int) -> int:
    """The full count in a soak, or PLANFLY_SOAK_SHARE of it where that is set; a few otherwise."""
    if not SOAK:
        return few
    return max(few, round(full * float(os.environ.get("PLANFLY_SOAK_SHARE", "1"))))


def some(cases: Iterable[Case], every: int) -> list[Case]:
    """All cases in a soak; otherwise the first and each so many after it."""
    return list(cases) if SOAK else list(cases)[::every]


def at_most(seconds: float) -> float:
    """A bound on time: itself in a soak, where little else runs; four times it otherwise, as a loaded core is slow."""
    return seconds if SOAK else 4.0 * seconds


def note(row: str, **figures: float | int | str) -> None:
    """Put a row of figures into the file, in a soak; rows of the same run stand beside each other."""
    _change(row, lambda there: there | figures)


def tally(row: str, **figures: int) -> None:
    """Add figures to those of a row, in a soak: for a test with many cases."""
    _change(row, lambda there: there | {name: there.get(name, 0) + value for name, value in figures.items()})


def widen(row: str, **figures: float) -> None:
    """Put the largest of figures into a row, in a soak: for a test with many cases."""
    _change(row, lambda there: there | {name: max(there.get(name, value), value) for name, value in figures.items()})


def begin_file(file: str) -> None:
    """Take out what a file of tests has noted before: it is run anew, from its first test."""
    sources()  # As they are before the file's tests run.

    def without(rows: dict[str, Any]) -> dict[str, Any]:
        mine = {row for row, noted in rows.get(NOTED_BY, {}).items() if noted == file}
        return {row: figures for row, figures in rows.items() if row not in mine}

    _change_all(without)


def end_file(file: str) -> None:
    """Remember that all tests of a file passed, so that a soak that goes on leaves them out."""
    if WHOLE:
        note(PASSED_WITH, **{file: sources()})


def passed_files() -> set[str]:
    """Files of tests that a soak that goes on need not run again."""
    if not WHOLE or not FIGURES.is_file():
        return set()
    rows = json.loads(FIGURES.read_text(encoding="utf-8"))
    return {file for file, of in rows.get(PASSED_WITH, {}).items() if of == sources()}


@cache
def sources() -> str:
    """Hash of all sources, tests and pinned versions."""
    digest = hashlib.sha256()
    for path in source_files():
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def source_files() -> list[Path]:
    """What the hash is made of."""
    found = [path for package in _PACKAGES for kind in _SOURCES for path in (ROOT / package).rglob(kind)]
    return sorted([*found, ROOT / "pyproject.toml", ROOT / "constraints.txt"])


def _change(row: str, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    # pytest's own word for the test that is running, and its children inherit it: FILE::TEST (PHASE)
    file = os.environ.get("PYTEST_CURRENT_TEST", "").split("::")[0]

    def changed(rows: dict[str, Any]) -> dict[str, Any]:
        known = rows | {row: change(rows.get(row, {}))}
        shared = row in _SHARED or not file
        return known if shared else known | {NOTED_BY: rows.get(NOTED_BY, {}) | {row: file}}

    _change_all(changed)


def _change_all(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    if not SOAK:
        return
    FIGURES.parent.mkdir(parents=True, exist_ok=True)
    with FIGURES.open("a+", encoding="utf-8") as file:
        # Two processes test at a time.
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        text = file.read()
        rows = change(json.loads(text) if text else {})
        file.seek(0)
        file.truncate()
        file.write(json.dumps(rows, indent=1, sort_keys=True) + "\n")
