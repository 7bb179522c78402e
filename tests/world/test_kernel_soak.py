"""Damaged cache files, kills while compiling and first starts at once: no wrong result and no broken process.

250 damages, 20 kills and 3 starts in a soak; a few otherwise.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.soak import note, scaled

ROOT = Path(__file__).parents[2]
# Two kernels, an inner one of both, and two types of argument.
KERNELS = """
from world.kernels import compiled, inner

@inner
def twice(a):
    return a[0] + a[0]

@compiled
def thrice(a):
    return twice(a) + a[0]

@compiled
def total(a, factor):
    s = 0.0
    for k in range(len(a)):
        s += factor * a[k] + twice(a)
    return s
"""
# Each line asks for a process of its own, whose imports but the kernels' stand before it: it prints its number, and
# then how it ended.  3 x 1.5 = 4.5; of 1, 2 and 3 twice the sum and three times 2 x 1 are 18; of 4 alone 12 + 8 are 20.
SERVER = """
import os, sys, traceback
sys.path[:0] = FOLDERS
import numpy as np
import numba.core.typing.templates, numba.np.arrayobj, world.kernels
for line in sys.stdin:
    child = os.fork()
    if not child:
        code = 1
        try:
            import kernels
            found = (
                kernels.thrice(np.array([1.5])),
                kernels.total(np.array([1.0, 2.0, 3.0]), 2.0),
                kernels.thrice(np.array([4])),
                kernels.total(np.array([4]), 3),
            )
            code = 0 if found == (4.5, 18.0, 12, 20.0) else 2
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@dataclass
class Starts:
    """Processes that call the kernels, with a cache folder of their own."""

    folder: Path
    server: subprocess.Popen[str]

    def run(self, kill_after_s: float | None = None) -> int:
        """Return the exit code of a process, which is killed after a time unless it has ended."""
        assert self.server.stdin is not None
        assert self.server.stdout is not None
        self.server.stdin.write("\n")
        self.server.stdin.flush()
        process = int(self.server.stdout.readline())
        if kill_after_s is not None:
            time.sleep(kill_after_s)
            # It may have ended before.
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        return int(self.server.stdout.readline())

    def files(self) -> list[Path]:
        """Return the cache files of the two kernels and the inner one."""
        return sorted(path for path in self.folder.rglob("kernels.*") if path.suffix in (".nbi", ".nbc"))


@pytest.fixture
def starts(tmp_path: Path) -> Iterator[Starts]:
    with _start(tmp_path, tmp_path / "kept") as server:
        yield Starts(tmp_path / "kept", server)
        assert server.stdin is not None
        server.stdin.close()
        assert server.wait(60.0) == 0


def _start(folder: Path, kept: Path) -> subprocess.Popen[str]:
    if not (folder / "kernels.py").exists():
        (folder / "kernels.py").write_text(KERNELS, encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-c", SERVER.replace("FOLDERS", repr([str(folder), str(ROOT)]))],
        env={"NUMBA_CACHE_DIR": str(kept), "PATH": ""},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _damage(content: bytes, cut: bool, rng: np.random.Generator) -> bytes:
    """Flip one random bit, or cut at a random byte; one cut in five leaves nothing."""
    at = int(rng.integers(len(content)))
    if cut:
        return content[: at if rng.random() < 0.8 else 0]
    return content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :]


def test_a_damaged_file_is_compiled_anew(starts: Starts) -> None:
    rng = np.random.default_rng(64)
    assert starts.run() == 0
    # Of each kernel an index and a form for each type of argument.
    assert len(starts.files()) == 9
    flips, cuts, wrong, unnoticed = scaled(200, 6), scaled(50, 3), 0, 0
    for k in range(flips + cuts):
        files = starts.files()
        path = files[int(rng.integers(len(files)))]
        damaged = _damage(path.read_bytes(), k >= flips, rng)
        path.write_bytes(damaged)
        wrong += starts.run() != 0
        # The inner kernel's files are read only when another kernel is compiled.
        unnoticed += path.read_bytes() == damaged and not path.name.startswith("kernels.twice")
    note("kernel cache: damages", flips=flips, cuts=cuts, wrong=wrong, unnoticed=unnoticed)
    assert (wrong, unnoticed) == (0, 0)


def test_a_process_that_is_killed_while_it_compiles_leaves_nothing_broken(starts: Starts) -> None:
    rng = np.random.default_rng(65)
    begun = time.monotonic()
    assert starts.run() == 0
    whole_s, kills, killed, wrong = time.monotonic() - begun, scaled(20, 2), 0, 0
    while killed < kills:
        for path in starts.files():
            path.unlink()
        code = starts.run(kill_after_s=float(rng.uniform(0.0, whole_s)))
        assert code in (0, -signal.SIGKILL)
        killed += code != 0
        wrong += starts.run() != 0
    note("kernel cache: kills", killed=killed, wrong=wrong)
    assert wrong == 0


def test_three_first_starts_at_once(tmp_path: Path) -> None:
    processes = [_start(tmp_path, tmp_path / "kept") for _ in range(3)]
    printed = [process.communicate("\n\n", timeout=300.0)[0].split() for process in processes]
    codes = [int(code) for lines in printed for code in lines[1::2]]
    note("kernel cache: first starts at once", count=len(processes), wrong=sum(code != 0 for code in codes))
    assert codes == [0] * 6
