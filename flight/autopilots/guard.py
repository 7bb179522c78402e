"""Guard a flight's program: end the program and remove its folder if planfly is killed.

The kernel kills a program whose parent is killed, but not that program's own children, such as the child of a wrapper
script, and it removes no folder. The guard is a small process that outlives planfly until both are done.
"""

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

# Source of the guard process. It reads commands until the line "done" or, if planfly was killed, the end of its input;
# then it kills the process group, first so that nothing is written any more, and removes the folder and the files.
_GUARD_SOURCE = """
import os, shutil, signal, sys, time
group, folder, files = 0, "", []
for line in sys.stdin:
    word, _, value = line.rstrip("\\n").partition(" ")
    if word == "done":
        sys.exit()
    if word == "group":
        group = int(value)
    elif word == "folder":
        folder = value
    else:
        files.append(value)
for _ in range(100):
    if group:
        try:
            os.killpg(group, signal.SIGKILL)
        except OSError:
            group = 0
    for file in files:
        try:
            os.remove(file)
        except OSError:
            pass
    if not folder or not os.path.lexists(folder):
        break
    shutil.rmtree(folder, ignore_errors=True)
    time.sleep(0.02)
"""


class Guard:
    """Context manager of a process that removes files and kills process groups if planfly is killed.

    At a normal exit the process removes nothing.

    >>> with Guard() as guard:
    ...     guard.register_folder(Path("/nowhere/planfly-autopilot-1"))
    """

    def __init__(self) -> None:
        read_end, write_end = os.pipe()
        with os.fdopen(read_end, "rb") as stdin:
            self._pipe = os.fdopen(write_end, "wb", buffering=0)
            # The guard has its own session: a signal to planfly's process group does not end it.
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _GUARD_SOURCE],
                stdin=stdin,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                cwd="/",
            )

    def register_folder(self, folder: Path) -> None:
        """Register a folder to be removed if planfly is killed.

        Its name must not contain a line break.
        """
        self._write_line(f"folder {folder}")

    def register_file(self, file: Path) -> None:
        """Register a file to be removed if planfly is killed.

        The file need not exist yet. Its name must not contain a line break.
        """
        self._write_line(f"file {file}")

    def register_group(self, group: int) -> None:
        """Register a process group to be killed if planfly is killed."""
        self._write_line(f"group {group}")

    def _write_line(self, line: str) -> None:
        """Send a line to the guard process; ignore it if the process has ended."""
        with contextlib.suppress(BrokenPipeError):
            self._pipe.write(f"{line}\n".encode())

    def __enter__(self) -> Self:
        """Return the guard itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the guard process, which then neither kills processes nor removes files."""
        self._write_line("done")
        self._pipe.close()
        self._process.wait()
