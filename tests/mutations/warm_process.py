"""A process that has imported what is not ours, and runs pytest in forks of itself: half of a short run is imports.

``python -m tests.mutations.warm_process``: reads a `Request` a line, as JSON, and answers each with pytest's exit code,
or ``null`` where the time ran out.
"""

import importlib
import json
import os
import signal
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from subprocess import PIPE, Popen

# Nothing of ours: a fork imports that as the mutant has left it.  Hypothesis is left to pytest, which rewrites it.
_IMPORTED = (
    "numba",
    "scipy.linalg",
    "scipy.optimize",
    "scipy.interpolate",
    "matplotlib.pyplot",
    "jsbsim",
    "mcap.reader",
    "pydantic",
    "pymavlink.mavutil",
    "pyproj",
    "pytest",
    "rasterio",
)
_OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "--tb=line")


@dataclass(frozen=True, slots=True)
class Request:
    """A run of some tests.

    output: file for what pytest prints.
    limit: s after which it is ended.
    bytecode: whether it may be kept.
    """

    tests: list[str]
    output: str
    limit: float
    bytecode: bool


class WarmProcess:
    """One that runs tests in a folder, with these settings of its environment."""

    def __init__(self, folder: Path, settings: dict[str, str]) -> None:
        self._process = Popen(
            [sys.executable, "-m", "tests.mutations.warm_process"],
            cwd=folder,
            env=os.environ | settings,
            stdin=PIPE,
            stdout=PIPE,
            text=True,
        )

    def run(self, request: Request) -> int | None:
        """Pytest's exit code; None where the time ran out."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(asdict(request)) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the process that runs the tests ended with {self._process.wait()}")
        code: int | None = json.loads(answer)
        return code

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def serve() -> None:
    """Answer requests until there are no more."""
    for name in _IMPORTED:
        importlib.import_module(name)
    for line in sys.stdin:
        request = Request(**json.loads(line))
        child = os.fork()
        if not child:
            _run_tests(request)
        print(json.dumps(_ended(child, request.limit)), flush=True)


def _run_tests(request: Request) -> None:
    """Be the fork: run pytest and end with its exit code."""
    import pytest

    os.setsid()
    output = os.open(request.output, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(output, stream)
    sys.dont_write_bytecode = not request.bytecode
    code = 3  # pytest's own for an error inside it
    try:
        code = int(pytest.main([*_OPTIONS, *request.tests]))
    finally:
        sys.stdout.flush()
        os._exit(code)


def _ended(child: int, limit: float) -> int | None:
    """Wait for a fork; its exit code, negative for a signal's, None where it was ended."""
    until = time.monotonic() + limit
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


if __name__ == "__main__":
    serve()
