"""Operating-system locks on open files, which are released when the process ends in any way."""

import contextlib
from importlib import import_module
from typing import Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# True if folders can be locked.  Windows cannot open folders, and locks bytes of files open for writing, also for
# readers.
LOCKS_FOLDERS = fcntl is not None


def try_lock(handle: int) -> bool:
    """Lock an open file until it is closed; return True, or False if it is already locked.

    handle: file descriptor; on Linux and macOS it may belong to a folder.

    Raises OSError if the file system does not support locks.

    >>> from tempfile import TemporaryFile
    >>> with TemporaryFile() as file:
    ...     try_lock(file.fileno())
    True
    """
    # Windows raises PermissionError where other systems raise BlockingIOError.
    with contextlib.suppress(BlockingIOError if LOCKS_FOLDERS else PermissionError):
        if LOCKS_FOLDERS:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            windows: Any = import_module("msvcrt")
            windows.locking(handle, windows.LK_NBLCK, 1)
        return True
    return False
