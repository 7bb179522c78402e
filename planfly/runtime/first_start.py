"""The first start after an install: kernels are compiled in two processes before the work begins, and counted."""

import contextlib
import functools
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

from planfly.kernel_units.unit_kernels import kernels_of
from planfly.runtime.stages import is_received, say, stage
from world.compile_events import tell_before_compiling
from world.kernel_cache import VARIABLE, can_write

# ----------------------------------------------------------------------
# Units of kernels compiled by processes of their own, which leave them in the cache.

# More would wait for each other: the longest unit is nearly half of all.
PROCESSES = 2
# Without the current folder, whose modules may have our names.
PROGRAM = ("-P", "-m", "planfly.kernel_units")
_OVER = ""


def compile_units(units: list[str], folder: Path, on_ready: Callable[[int], None]) -> None:
    """Have units compiled into a cache folder; return when all are done, or given up.

    units: longest first.  on_ready: called with how many of their kernels are ready.
    The processes end with this call, however it ends, and with this process.
    """
    waiting, lines = deque(units), queue.SimpleQueue[str]()
    count = min(PROCESSES, len(units), os.cpu_count() or 1)
    helpers = [_start(folder) for _ in range(count)]
    leaders = [threading.Thread(target=_lead, args=(helper, waiting, lines), daemon=True) for helper in helpers]
    try:
        for leader in leaders:
            leader.start()
        ready: set[str] = set()
        over = 0
        while over < count:
            line = lines.get()
            over += line == _OVER
            word, _, name = line.partition(" ")
            if word == "ready" and name not in ready:
                ready.add(name)
                on_ready(len(ready))
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


def _lead(helper: "subprocess.Popen[str]", waiting: "deque[str]", lines: "queue.SimpleQueue[str]") -> None:
    """Give a process one unit after another, and pass its lines on; an empty one at its end."""
    requests, answers = helper.stdin, helper.stdout
    # It may have died, or the other one was quicker.
    with contextlib.suppress(OSError, IndexError):
        while requests is not None and answers is not None:
            requests.write(f"{waiting.popleft()}\n")
            line = "ready"
            while line.startswith("ready"):
                line = answers.readline()
                lines.put(line.strip() or "died")
            if not line:
                break
    for pipe in (requests, answers):
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()
    lines.put(_OVER)


# ----------------------------------------------------------------------
# Warm-up: when the first kernel has to be compiled, all that the work needs are compiled side by side.

_Taken = ParamSpec("_Taken")
_Given = TypeVar("_Given")

# Each group is compiled at its first use: a command may do so more than once.
TITLE = "compiling numeric kernels"
KEPT = ", which later runs load"
_WAY_OUT = f"{VARIABLE}=FOLDER names one that can"
# Units that this process has had compiled, or tried to.
_shared: set[str] = set()


@contextmanager
def warm_up(*units: str) -> Iterator[None]:
    """Compile the kernels of units when the work inside first needs one that is not in the cache, and report it once.

    units: of `planfly.kernel_units`, longest first: what the work will call.  They are compiled in two processes before
    the work goes on; where the cache cannot be written they are compiled as they are called.
    """
    reported = False

    def compile_first() -> None:
        nonlocal reported
        if not reported:
            reported = True
            _report_and_compile([unit for unit in units if unit not in _shared])
            _shared.update(units)

    with tell_before_compiling(compile_first):
        yield


def with_warm_up(*units: str) -> Callable[[Callable[_Taken, _Given]], Callable[_Taken, _Given]]:
    """Run a function of the public API under `warm_up`."""

    def decorate(verb: Callable[_Taken, _Given]) -> Callable[_Taken, _Given]:
        @functools.wraps(verb)
        def warmed(*args: _Taken.args, **kwargs: _Taken.kwargs) -> _Given:
            with warm_up(*units):
                return verb(*args, **kwargs)

        return warmed

    return decorate


def _report_and_compile(units: list[str]) -> None:
    # Whoever compiles has imported it.
    from world.kernels import TEMPORARY, WANTED, cache_folder

    folder = cache_folder()
    if not can_write(folder):
        say(f"compiling the numeric kernels: {folder} cannot be written, and keeps none of them; {_WAY_OUT}")
        return
    if TEMPORARY:
        say(f"compiling the numeric kernels for this command alone: {WANTED} cannot be written; {_WAY_OUT}")
    title = TITLE if TEMPORARY else TITLE + KEPT
    if not (units and sys.executable and is_received()):
        say(f"{title} ...")
    if not units or not sys.executable:
        return
    total = len(kernels_of(tuple(units)))
    with stage(title, TITLE) as advance:
        advance(0, total, f"0 of {total}")
        compile_units(units, folder, lambda done: advance(done, total, f"{done} of {total}"))
