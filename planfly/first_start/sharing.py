"""Units of kernels compiled by processes of their own, which leave them in the cache."""

import contextlib
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

# More would wait for each other: the longest unit is nearly half of all.
PROCESSES = 2
# Without the current folder, whose modules may have our names.
PROGRAM = ("-P", "-m", "planfly.kernel_units")
_OVER = ""


def compile_units(units: list[str], folder: Path, tell: Callable[[int], None]) -> None:
    """Have units compiled into a cache folder; return when all are done, or given up.

    units: longest first.  tell: called with how many of their kernels are ready.
    The processes end with this call, however it ends, and with this process.
    """
    waiting, said = deque(units), queue.SimpleQueue[str]()
    count = min(PROCESSES, len(units), os.cpu_count() or 1)
    helpers = [_start(folder) for _ in range(count)]
    leaders = [threading.Thread(target=_lead, args=(helper, waiting, said), daemon=True) for helper in helpers]
    try:
        for leader in leaders:
            leader.start()
        ready: set[str] = set()
        over = 0
        while over < count:
            line = said.get()
            over += line == _OVER
            word, _, name = line.partition(" ")
            if word == "ready" and name not in ready:
                ready.add(name)
                tell(len(ready))
    finally:
        for helper in helpers:
            helper.kill()
        for helper, leader in zip(helpers, leaders, strict=True):
            helper.wait()
            leader.join()


def _start(folder: Path) -> "subprocess.Popen[str]":
    home = str(Path(__file__).parents[2])
    path = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH", "")]))
    return subprocess.Popen(
        [sys.executable, *PROGRAM],
        env=os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        bufsize=1,
    )


def _lead(helper: "subprocess.Popen[str]", waiting: "deque[str]", said: "queue.SimpleQueue[str]") -> None:
    """Give a process one unit after another, and hand on what it says; nothing, at its end."""
    asked, answers = helper.stdin, helper.stdout
    # It may have died, or the other one was quicker.
    with contextlib.suppress(OSError, IndexError):
        while asked is not None and answers is not None:
            asked.write(f"{waiting.popleft()}\n")
            line = "ready"
            while line.startswith("ready"):
                line = answers.readline()
                said.put(line.strip() or "died")
            if not line:
                break
    for pipe in (asked, answers):
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()
    said.put(_OVER)
