"""Compile kernels at the first start after an install, in two processes, before the work begins."""

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
# Units of kernels are compiled by separate processes, which store them in the cache.

# Number of processes; more would wait for each other, because the longest unit takes nearly half of the total time.
PROCESSES = 2
# Arguments of Python; -P leaves out the current folder, whose modules may have the names of ours.
PROGRAM = ("-P", "-m", "planfly.kernel_units")
# Line that marks the end of the output of a process.
_END_OF_OUTPUT = ""


def compile_units(units: list[str], folder: Path, on_ready: Callable[[int], None]) -> None:
    """Compile units into a cache folder; return when all are compiled or given up.

    units: longest first.  on_ready: called with the number of kernels that are ready.
    The processes end with this call, also if it raises, and with this process.
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
            over += line == _END_OF_OUTPUT
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
    """Give a process one unit after another, and pass its lines on; an empty line marks its end."""
    requests, answers = helper.stdin, helper.stdout
    # The process may have died, or the other process may have taken the last unit.
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
    lines.put(_END_OF_OUTPUT)


# ----------------------------------------------------------------------
# Warm-up: when the first kernel has to be compiled, all kernels that the work needs are compiled in parallel.

_Taken = ParamSpec("_Taken")
_Given = TypeVar("_Given")

# Title of the stage; a command may show it more than once, because each group is compiled at its first use.
TITLE = "compiling numeric kernels"
# End of the message on compiled kernels.
KEPT = ", which later runs load"
# Hint at the variable that names another cache folder.
_CACHE_DIR_HINT = f"{VARIABLE}=FOLDER names one that can"
# Units that this process has compiled or tried to compile.
_shared: set[str] = set()


@contextmanager
def warm_up(*units: str) -> Iterator[None]:
    """Compile all kernels of units when the work inside first needs one that is not cached.

    units: units of `planfly.kernel_units` that the work will call, longest first.  They are compiled in two processes
    before the work continues; if the cache cannot be written, each kernel is compiled when it is called.
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
    """Return a decorator that runs a function of the public API under `warm_up`."""

    def decorate(verb: Callable[_Taken, _Given]) -> Callable[_Taken, _Given]:
        @functools.wraps(verb)
        def warmed(*args: _Taken.args, **kwargs: _Taken.kwargs) -> _Given:
            with warm_up(*units):
                return verb(*args, **kwargs)

        return warmed

    return decorate


def _report_and_compile(units: list[str]) -> None:
    # Imported here: code that compiles kernels has already imported it.
    from world.kernels import TEMPORARY, WANTED, cache_folder

    folder = cache_folder()
    if not can_write(folder):
        say(f"compiling the numeric kernels: {folder} cannot be written, and keeps none of them; {_CACHE_DIR_HINT}")
        return
    if TEMPORARY:
        say(f"compiling the numeric kernels for this command only: {WANTED} cannot be written; {_CACHE_DIR_HINT}")
    title = TITLE if TEMPORARY else TITLE + KEPT
    if not (units and sys.executable and is_received()):
        say(f"{title} ...")
    if not units or not sys.executable:
        return
    total = len(kernels_of(tuple(units)))
    with stage(title, TITLE) as advance:
        advance(0, total, f"0 of {total}")
        compile_units(units, folder, lambda done: advance(done, total, f"{done} of {total}"))
