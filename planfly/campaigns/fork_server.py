"""What the process imports that a campaign's processes are forked from, and how it ends.

Nothing else imports this module: `planfly.campaigns.worker_pool` names it to `multiprocessing`.
"""

import atexit
import contextlib
import os
import shutil
import socket
import sys
from importlib import import_module
from pathlib import Path

for _needed in ("planfly.campaigns.report", "planfly.pipeline", "scipy.stats"):
    import_module(_needed)


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
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


if "multiprocessing.forkserver" in " ".join(sys.orig_argv):
    # The processes that are forked from this one forget it.
    atexit.register(end, socket_folders())
