"""One process at a time saves compiled kernels in a cache folder.

Numba numbers the files of a kernel's compiled forms by an index, which it reads, extends and writes back.  Two
processes that save forms of one kernel for different types at the same moment give both the same number: from then on
the index of one form leads to the other, and whoever loads it calls machine code that takes its numbers for others.
"""

import contextlib
import os
import threading
import time
from pathlib import Path
from typing import Any

from numba.core import event

from world.file_locks import lock_now

# How long a save waits for others, s: one takes milliseconds, and a process may be stopped while it saves.
PATIENCE = 10.0
LOCK = "saving.lock"


class SavingTurns:
    """Keeps the lock of a cache folder from the end of a compilation until its kernel is saved.

    Numba says when it has compiled a kernel, and when it lets go of the compiler, between which it saves.  It compiles
    in one thread at a time, and a kernel within another: what another lets go of meanwhile does not count.
    """

    def __init__(self, folder: Path) -> None:
        self._lock = folder / LOCK
        self._of_thread = threading.local()

    def register(self) -> None:
        """Listen to numba from now on, as long as this process lives."""
        listen: Any = event.register
        listen("numba:compile", _Around(lambda: None, self._take))
        listen("numba:compiler_lock", _Around(lambda: self._count(1), lambda: self._count(-1)))

    def _count(self, step: int) -> None:
        """Count how often this thread has asked for the compiler, and end its turn where it lets go of it."""
        here = self._of_thread
        here.depth = getattr(here, "depth", 0) + step
        if step < 0 and here.depth < getattr(here, "taken_at", 0):
            here.taken_at = 0
            os.close(here.handle)

    def _take(self) -> None:
        """Wait for this process's turn; go on without it where the folder has no locks, or after `PATIENCE`."""
        here = self._of_thread
        if getattr(here, "taken_at", 0):
            return
        with contextlib.suppress(OSError):
            here.handle = os.open(self._lock, os.O_RDWR | os.O_CREAT, 0o600)
            here.taken_at = getattr(here, "depth", 0)
            until = time.monotonic() + PATIENCE
            while not lock_now(here.handle) and time.monotonic() < until:
                time.sleep(0.002)


class _Around(event.Listener):
    """Calls one function at the beginning and another at the end of what it listens to."""

    def __init__(self, begin: Any, end: Any) -> None:
        self._begin, self._end = begin, end

    def on_start(self, event: Any) -> None:
        self._begin()

    def on_end(self, event: Any) -> None:
        self._end()
