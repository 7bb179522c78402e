"""What several processes of one test run need is made by the first of them, and read by the others."""

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from tempfile import gettempdir
from typing import TypeVar

T = TypeVar("T")


def made_once(name: str, make: Callable[[], T]) -> T:
    """What ``make`` returns, made once in a run of several processes; it has to be picklable.

    name: of its file, unlike any other's.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    if run is None:
        return make()
    file = Path(gettempdir()) / f"planfly-tests-{run}-{name}.pickle"
    with file.open("a+b") as opened:
        fcntl.flock(opened, fcntl.LOCK_EX)
        opened.seek(0)
        if data := opened.read():
            found: T = pickle.loads(data)
            return found
        made = make()
        opened.write(pickle.dumps(made))
    return made


def remove_made(run: str) -> None:
    """Remove what a run has made."""
    for file in Path(gettempdir()).glob(f"planfly-tests-{run}-*.pickle"):
        file.unlink(missing_ok=True)
