"""The first start after an install: what compiles is said, shared between processes, and counted."""

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
from planfly.terminal.output import progress, say
from world.compile_events import tell_before_compiling

# ----------------------------------------------------------------------
# Units of kernels compiled by processes of their own, which leave them in the cache.

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
    home = str(Path(__file__).parents[1])
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


# ----------------------------------------------------------------------
# Before the first kernel is compiled it is said, and the kernels that the work needs are compiled side by side.

_Taken = ParamSpec("_Taken")
_Given = TypeVar("_Given")

TITLE = "compiling the numeric kernels, once"
# Units that this process has had compiled, or tried to.
_shared: set[str] = set()


@contextmanager
def warm_up(*units: str) -> Iterator[None]:
    """Say once what is compiled meanwhile, before it begins; where all is in the cache this costs nothing.

    units: of `planfly.kernel_units`, longest first: what the work will call.  They are compiled in two processes, and
    counted, before the work goes on; where the cache cannot be written they are compiled as they are called.
    """
    said = False

    def tell() -> None:
        nonlocal said
        if not said:
            said = True
            _say_and_share([unit for unit in units if unit not in _shared])
            _shared.update(units)

    with tell_before_compiling(tell):
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


def _say_and_share(units: list[str]) -> None:
    # Whoever compiles has imported it.
    from world.kernels import cache_folder

    folder = cache_folder()
    if not _can_write(folder):
        say(f"compiling the numeric kernels: {folder} cannot be written, and keeps none of them")
        return
    if not units or not sys.executable:
        say(f"{TITLE} ...")
        return
    whole = len(kernels_of(tuple(units)))
    with progress(TITLE) as advance:
        advance(0, whole, f"0 of {whole}")
        compile_units(units, folder, lambda done: advance(done, whole, f"{done} of {whole}"))


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
