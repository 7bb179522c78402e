"""Lock that lets only one process at a time save compiled kernels in a cache folder.

Numba numbers the files of a kernel's compiled forms in an index, which it reads, extends and writes back. If two
processes save forms of one kernel for different types at the same moment, both use the same number: the index entry of
one form then leads to the file of the other, and a process that loads it runs machine code for other types.
"""

import contextlib
import os
import threading
import time
from pathlib import Path
from typing import Any

from numba.core import event

from world.file_locks import try_lock

# Timeout of the lock, s: a save takes milliseconds, but a process may be suspended while it saves.
LOCK_TIMEOUT_S = 10.0
# Name of the lock file in the cache folder.
LOCK_NAME = "saving.lock"


class CacheWriteLock:
    """Lock of a cache folder, held from the end of a compilation until its kernel is saved.

    Numba reports when it has compiled a kernel and when it releases its compiler lock, and saves the kernel in between.
    It compiles in one thread at a time, and may compile one kernel within another: releases by inner compilations are
    ignored.
    """

    def __init__(self, folder: Path) -> None:
        self._lock = folder / LOCK_NAME
        self._thread_state = threading.local()

    def register(self) -> None:
        """Register listeners with numba, which take and release the lock until this process ends."""
        listen: Any = event.register
        listen("numba:compile", _BeginEndListener(lambda: None, self._acquire))
        listen("numba:compiler_lock", _BeginEndListener(lambda: self._track_depth(1), lambda: self._track_depth(-1)))

    def _track_depth(self, step: int) -> None:
        """Track how often this thread has taken numba's compiler lock.

        The file lock is released after the last release.

        step: 1 when the compiler lock is taken, -1 when it is released.
        """
        state = self._thread_state
        state.depth = getattr(state, "depth", 0) + step
        if step < 0 and state.depth < getattr(state, "lock_depth", 0):
            state.lock_depth = 0
            os.close(state.handle)

    def _acquire(self) -> None:
        """Acquire the file lock, unless this thread has it already.

        Continue without the lock if the folder does not support locks, or after `LOCK_TIMEOUT_S`.
        """
        state = self._thread_state
        if getattr(state, "lock_depth", 0):
            return
        with contextlib.suppress(OSError):
            state.handle = os.open(self._lock, os.O_RDWR | os.O_CREAT, 0o600)
            state.lock_depth = getattr(state, "depth", 0)
            deadline = time.monotonic() + LOCK_TIMEOUT_S
            while not try_lock(state.handle) and time.monotonic() < deadline:
                time.sleep(0.002)


class _BeginEndListener(event.Listener):
    """Listener that calls one function at the beginning and another at the end of an event."""

    def __init__(self, begin: Any, end: Any) -> None:
        self._begin, self._end = begin, end

    def on_start(self, event: Any) -> None:
        """Call the first function."""
        self._begin()

    def on_end(self, event: Any) -> None:
        """Call the second function."""
        self._end()
