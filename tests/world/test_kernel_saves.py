"""Processes that compile one kernel for different types at the same moment keep both forms apart.

Numba's files alone do not: of 450 kernels that two processes compiled at once, one for float64 and one for int64, 83
were left with one file for both forms, and one was then called with the other's numbers.
"""

import fcntl
import subprocess
import sys
import time
from pathlib import Path
from typing import TextIO

import pytest

from world import kernel_saves
from world.kernel_cache import sources_digest

ROOT = Path(__file__).parents[2]
# Two kernels, one of which calls the other, and is compiled and saved within it.
KERNELS = """
from world.kernels import compiled, inner

@inner
def twice(a):
    return a[0] + a[0]

@compiled
def thrice(a):
    return twice(a) + a[0]
"""
COMPILE = """
import sys
from pathlib import Path
import numpy as np
from numba.core import event

class Tell(event.Listener):
    def on_start(self, event): pass
    def on_end(self, event): print("compiled", flush=True)

# Told of before planfly is, which waits then.
event.register("numba:compile", Tell())
from world import kernel_saves
kernel_saves.LOCK_TIMEOUT_S = PATIENCE_S
import kernels
print(kernels.thrice(np.array([1.5])))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "kernels.py").write_text(KERNELS, encoding="utf-8")
    return tmp_path


def _start(folder: Path, patience: float) -> subprocess.Popen[str]:
    code = f"import sys; sys.path[:0] = [{str(folder)!r}, {str(ROOT)!r}]\n" + COMPILE
    code = code.replace("PATIENCE_S", str(patience))
    environment = {"NUMBA_CACHE_DIR": str(folder / "kept"), "PATH": ""}
    return subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)


def _kept(folder: Path) -> list[str]:
    return sorted(file.name.split("-")[0] for file in folder.rglob("*.nbi") if file.name.startswith("kernels."))


def _hold(folder: Path) -> TextIO:
    """Lock the cache folder that the sources have within a folder, as a process does that is saving there."""
    kept = folder / "kept" / f"kernels-{sources_digest(ROOT)}"
    kept.mkdir(parents=True)
    handle = (kept / kernel_saves.LOCK_NAME).open("w")
    fcntl.flock(handle, fcntl.LOCK_EX)
    return handle


def test_a_kernel_is_saved_only_while_no_other_process_saves(folder: Path) -> None:
    with _hold(folder):
        other = _start(folder, 60.0)
        assert other.stdout is not None
        first = other.stdout.readline()
        # It would be there within milliseconds.
        time.sleep(0.5)
        kept = _kept(folder)
    rest = other.communicate()[0]
    assert (first, kept) == ("compiled\n", [])
    assert rest.split() == ["compiled", "4.5"]
    assert _kept(folder) == ["kernels.thrice", "kernels.twice"]


def test_a_process_that_stopped_while_it_saved_keeps_no_other_waiting_for_ever(folder: Path) -> None:
    with _hold(folder):
        assert _start(folder, 0.01).communicate(timeout=60)[0].split()[-1] == "4.5"
    assert _kept(folder) == ["kernels.thrice", "kernels.twice"]
