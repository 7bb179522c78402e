"""What compiles is said before it begins, once, and only where something does."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from planfly import first_start
from planfly.first_start import warm_up
from planfly.kernel_units.unit_kernels import kernels_of
from planfly.stages import received_by
from planfly.terminal.output import ON_STANDARD_ERROR, SILENT
from world.compile_events import kernel_is_compiled

ROOT = Path(__file__).parents[2]
CODE = """
import sys, numpy as np
from planfly.first_start import warm_up
from world.terrain import steepest_slopes
with warm_up():
    for _ in range(2):
        steepest_slopes(np.zeros((2, 2), np.float32), 1.0)
"""
SAID = "compiling the numeric kernels, once"


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """Units that were shared out, instead of being compiled: of each a kernel more is ready."""
    asked: list[list[str]] = []

    def compile_units(units: list[str], folder: Path, tell: object) -> None:
        assert folder == tmp_path
        asked.append(units)
        for done in range(1, len(units) + 1):
            assert callable(tell)
            tell(done)

    monkeypatch.setattr(first_start, "compile_units", compile_units)
    monkeypatch.setattr(first_start, "_shared", set())
    monkeypatch.setattr("world.kernels.cache_folder", lambda: tmp_path)
    return asked


def test_units_are_counted_before_the_work_goes_on(shared: list[list[str]], capsys: pytest.CaptureFixture[str]) -> None:
    whole = len(kernels_of(("scores", "paper")))
    with received_by(ON_STANDARD_ERROR), warm_up("scores", "paper"):
        assert capsys.readouterr().err == ""
        assert numba.njit(lambda a: a + 1)(1) == 2
        begun, done = capsys.readouterr().err.splitlines()
        kernel_is_compiled()
    assert begun == f"{SAID} ..."
    assert done.startswith(f"{SAID}: done in ")
    assert done.endswith(f" s: 2 of {whole}")
    assert capsys.readouterr().err == ""
    # What this process has shared out it does not share out again.
    with warm_up("scores", "flight"):
        kernel_is_compiled()
    with warm_up("scores"):
        kernel_is_compiled()
    assert shared == [["scores", "paper"], ["flight"]]


def test_nothing_is_said_in_silence(shared: list[list[str]], capsys: pytest.CaptureFixture[str]) -> None:
    with received_by(SILENT), warm_up("scores"):
        kernel_is_compiled()
    assert shared == [["scores"]]
    with received_by(SILENT), warm_up():
        kernel_is_compiled()
    assert capsys.readouterr().err == ""


def test_a_cold_process_says_it_once_and_a_warm_one_nothing(tmp_path: Path) -> None:
    said = [_said(NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    assert said == [f"{SAID} ...\n", ""]


def test_a_cache_that_cannot_be_written_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], shared: list[list[str]]
) -> None:
    folder = Path("/proc/none/kernels")
    monkeypatch.setattr("world.kernels.cache_folder", lambda: folder)
    with received_by(ON_STANDARD_ERROR), warm_up("scores"):
        kernel_is_compiled()
    said = f"compiling the numeric kernels: {folder} cannot be written, and keeps none of them\n"
    assert (capsys.readouterr().err, shared) == (said, [])


def _said(**environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", CODE], cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return done.stderr
