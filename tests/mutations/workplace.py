"""A copy of the sources in which mutants are tried, one after another; the sources themselves are never touched."""

import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

from tests.mutations.mutant import ROOT, Mutant
from tests.mutations.warm_process import Request, WarmProcess

_LEFT_OUT = shutil.ignore_patterns(".*", "runs", "build", "*.egg-info", "__pycache__", "*.mcap")


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
    """A folder with a copy of the repository, caches of its own, and a process that runs tests there.

    Compiled code is cached by the path of its file, so each workplace compiles once, in `warm`.  A trial works on a
    copy of that cache made of links: what it compiles goes with it.
    """

    def __init__(self, folder: Path, limit: float) -> None:
        self.copy, self._warm, self._cache = folder / "copy", folder / "warm", folder / "trial"
        self._limit = limit
        if not self.copy.exists():
            shutil.copytree(ROOT, self.copy, ignore=_LEFT_OUT)
        self._warm.mkdir(exist_ok=True)
        self._process = WarmProcess(
            self.copy,
            {
                "PYTHONPATH": str(self.copy),
                "NUMBA_CACHE_DIR": str(self._cache / "kernels-of-all-mutants"),
                "XDG_CACHE_HOME": str(self._cache),
                "MPLCONFIGDIR": str(self._cache / "matplotlib"),
            },
        )

    def close(self) -> None:
        """End its process; the folder stays."""
        self._process.close()

    def warm(self, tests: list[str]) -> str:
        """Run tests without a mutant, so that all is compiled; the failing test's line, "" where all pass."""
        self._link_cache()
        code, text = self._run(tests, 3600.0, bytecode=True)
        shutil.rmtree(self._warm)
        self._cache.rename(self._warm)
        return "" if code == 0 else _failure(text) or text[-2000:]

    def try_out(self, mutant: Mutant, stages: list[list[str]], kernels: list[str]) -> Trial:
        """Apply a mutant, run the tests that cover it until one fails, and put the source back.

        stages: tests that are run together.  kernels: files whose compiled code rests on what it changes.
        """
        target = self.copy / mutant.file
        # Numba knows a changed file by its bytes, and a remark at its end changes no line's number.
        changed = {file: file.read_bytes() + b"#\n" for file in (self.copy / name for name in kernels)}
        changed[target] = mutant.applied(target.read_bytes())
        kept = {file: (file.read_bytes(), file.stat()) for file in changed}
        self._link_cache()
        started = time.monotonic()
        try:
            for file, data in changed.items():
                file.write_bytes(data)
            for tests in stages:
                # A mutant of the same length within a second of the last would be taken for it by its bytecode.
                code, text = self._run(tests, self._limit, bytecode=False)
                if code != 0:
                    break
        finally:
            for file, (data, was) in kept.items():
                file.write_bytes(data)
                os.utime(file, ns=(was.st_atime_ns, was.st_mtime_ns))
        status = {None: "too long", 0: "alive"}.get(code, "killed")
        return Trial(mutant, status, _failure(text) if status == "killed" else "", time.monotonic() - started)

    def _link_cache(self) -> None:
        shutil.rmtree(self._cache, ignore_errors=True)
        shutil.copytree(self._warm, self._cache, copy_function=os.link)

    def _run(self, tests: list[str], limit: float, *, bytecode: bool) -> tuple[int | None, str]:
        """Exit code (None where the time ran out) and output of pytest."""
        output = self.copy.parent / "output.txt"
        code = self._process.run(Request(tests, str(output), limit, bytecode))
        text = output.read_text(encoding="utf-8", errors="replace")
        # A signal's number, negative, is a mutant that made compiled code write where it must not.
        if code is not None and code > 2:
            raise RuntimeError(f"pytest ended with {code}: {text[-2000:]}")
        return code, text


def _failure(text: str) -> str:
    """The first test that pytest's summary names."""
    for line in text.splitlines():
        if line.startswith(("FAILED ", "ERROR ")):
            return line.split(" ", 1)[1].split(" - ")[0]
    return ""
