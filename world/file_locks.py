"""The system's locks on open files, which it lets go of when a process ends, however that is."""

import contextlib
from importlib import import_module
from typing import Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# Windows locks bytes of files that are open to be written, for readers too, and opens no folder.
LOCKS_FOLDERS = fcntl is not None


def lock_now(handle: int) -> bool:
    """Lock an open file, or on Linux and macOS a folder, until it is closed; False where another process has done so.

    Raises OSError where the file system has no locks.

    >>> from tempfile import TemporaryFile
    >>> with TemporaryFile() as file:
    ...     lock_now(file.fileno())
    True
    """
    # Windows says by PermissionError what others say by BlockingIOError.
    with contextlib.suppress(BlockingIOError if LOCKS_FOLDERS else PermissionError):
        if LOCKS_FOLDERS:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            windows: Any = import_module("msvcrt")
            windows.locking(handle, windows.LK_NBLCK, 1)
        return True
    return False
