"""A copy of the sources in which mutants are tried, one after another; the sources themselves are never touched."""

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from tests.mutations.mutant import ROOT, Mutant

_LEFT_OUT = shutil.ignore_patterns(".*", "runs", "build", "*.egg-info", "__pycache__", "*.mcap")
_PYTEST = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "--tb=line")


@dataclass(frozen=True, slots=True)
class Trial:
    """What became of a mutant.

    status: "killed" by a failing test, "alive", or "too long" for the time limit, which counts as killed.
    by: the test that failed first, "" for none.
    seconds: how long it took.
    """

    mutant: Mutant
    status: str
    by: str
    seconds: float


class Workplace:
    """A folder with a copy of the repository and caches of its own.

    Compiled code is cached by the path of its file, so each workplace compiles once, in `warm`.  A trial works on a
    copy of that cache made of links: what it compiles goes with it.
    """

    def __init__(self, folder: Path, limit: float) -> None:
        self.copy, self._warm, self._cache = folder / "copy", folder / "warm", folder / "trial"
        self._limit = limit
        if not self.copy.exists():
            shutil.copytree(ROOT, self.copy, ignore=_LEFT_OUT)

    def warm(self, tests: list[str]) -> str:
        """Run tests without a mutant, so that all is compiled; the failing test's line, "" where all pass."""
        code, text = self._run(tests, self._warm, 3600.0, keep_bytecode=True)
        return "" if code == 0 else _failure(text) or text[-2000:]

    def try_out(self, mutant: Mutant, tests: list[str], kernels: list[str]) -> Trial:
        """Apply a mutant, run the tests that cover it, and put the source back.

        kernels: files whose compiled code rests on what it changes.
        """
        target = self.copy / mutant.file
        # Numba knows a changed file by its bytes, and a remark at its end changes no line's number.
        changed = {file: file.read_bytes() + b"#\n" for file in (self.copy / name for name in kernels)}
        changed[target] = mutant.applied(target.read_bytes())
        kept = {file: (file.read_bytes(), file.stat()) for file in changed}
        shutil.rmtree(self._cache, ignore_errors=True)
        shutil.copytree(self._warm, self._cache, copy_function=os.link)
        started = time.monotonic()
        try:
            for file, data in changed.items():
                file.write_bytes(data)
            code, text = self._run(tests, self._cache, self._limit)
        finally:
            for file, (data, was) in kept.items():
                file.write_bytes(data)
                os.utime(file, ns=(was.st_atime_ns, was.st_mtime_ns))
        status = {None: "too long", 0: "alive"}.get(code, "killed")
        return Trial(mutant, status, _failure(text) if status == "killed" else "", time.monotonic() - started)

    def _run(
        self, tests: list[str], cache: Path, limit: float, *, keep_bytecode: bool = False
    ) -> tuple[int | None, str]:
        """Exit code (None where the time ran out) and output of pytest."""
        settings = {
            "PYTHONPATH": str(self.copy),
            "NUMBA_CACHE_DIR": str(cache / "kernels"),
            "XDG_CACHE_HOME": str(cache),
            "MPLCONFIGDIR": str(cache / "matplotlib"),
            # A mutant of the same length within a second of the last would be taken for it by its bytecode.
            "PYTHONDONTWRITEBYTECODE": "" if keep_bytecode else "1",
        }
        cache.mkdir(parents=True, exist_ok=True)
        process = subprocess.Popen(
            [sys.executable, *_PYTEST, *tests],
            cwd=self.copy,
            env=os.environ | settings,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            text, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return None, process.communicate()[0]
        if process.returncode not in (0, 1, 2):
            raise RuntimeError(f"pytest ended with {process.returncode}: {text[-2000:]}")
        return process.returncode, text


def _failure(text: str) -> str:
    """The first test that pytest's summary names."""
    for line in text.splitlines():
        if line.startswith(("FAILED ", "ERROR ")):
            return line.split(" ", 1)[1].split(" - ")[0]
    return ""
