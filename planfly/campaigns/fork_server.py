"""What the process imports that a campaign's processes are forked from, and how it ends.

Nothing else imports this module: `planfly.campaigns.worker_pool` names it to `multiprocessing`.
"""

import atexit
import contextlib
import os
import shutil
import signal
import socket
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from planfly.process_setup import PARENT, prepare_child
from world.interruption import remove_unfinished

# s between two looks at whether the parent is there.
_LOOK = 0.1


class _NotCompiledYet(Exception):
    """A kernel is in no cache."""


def load_kernels() -> None:
    """Load the compiled kernels of a default plan and flight, as far as they are in the cache."""
    # Imported here: it takes long, and by then the parent is looked to.
    from planfly.kernel_units.ready_kernels import UNITS
    from planfly.kernel_units.unit_kernels import BOTH
    from world.compile_events import tell_before_compiling

    def refuse() -> None:
        raise _NotCompiledYet

    # Who plans or flies first compiles them, and says so.
    with contextlib.suppress(_NotCompiledYet), tell_before_compiling(refuse):
        for unit in BOTH:
            UNITS[unit]()


def socket_folders() -> list[Path]:
    """The folders that `multiprocessing` made for the Unix sockets which this process holds open."""
    found = []
    for number in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError), socket.socket(fileno=os.dup(int(number.name))) as opened:
            name = opened.getsockname()
            if opened.family == socket.AF_UNIX and Path(name).parent.name.startswith("pymp-"):
                found.append(Path(name).parent)
    return found


def end(folders: list[Path]) -> None:
    """End at once, instead of taking apart all that was imported, and remove what a killed campaign leaves."""
    remove_unfinished()
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


@contextlib.contextmanager
def ending_with(parent: int) -> Iterator[None]:
    """End this process within a moment of its parent's end, which it would notice only after all imports."""

    def look(*_: object) -> None:
        if os.getppid() != parent:
            end(socket_folders())

    signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, _LOOK, _LOOK)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)


if "multiprocessing.forkserver" in " ".join(sys.orig_argv):
    with ending_with(int(os.environ.get(PARENT, os.getppid()))):
        prepare_child()
        for needed in (
            "planfly.campaigns.report",
            "planfly.campaigns.campaign_worker",
            "planfly.pipeline",
            "scipy.stats",
        ):
            import_module(needed)
        load_kernels()
    # The flight above has looked it up; each process that is forked has a TMPDIR of its own.
    tempfile.tempdir = None
    # The processes that are forked from this one forget it.
    atexit.register(end, socket_folders())
