"""SIGINT and SIGTERM end a command in time: in order where it comes to it, at once where it does not."""

import contextlib
import functools
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import NoReturn

from world.files import remove_temporary_folders
from world.interruption import Interrupted, interrupt, remove_unfinished

ENDING = (signal.SIGINT, signal.SIGTERM)
# Time from a signal to the end of the process where its command has not ended by itself, s; time that it waited for a
# processor does not count, up to so much in all.
GRACE = 0.7
_AT_LONGEST = 10.0
# For which files are tried to be removed, s.
_REMOVING = 0.5
# Time from a signal that could not be heard to its next, and between two tries to remove files, s.
_AGAIN = 0.02
_COMPILERS = ("numba", "llvmlite")


@contextlib.contextmanager
def ended_by_signals(grace: float = GRACE) -> Iterator[list[int]]:
    """Raise `Interrupted` for SIGINT and SIGTERM, and end the process where that has not ended it ``grace`` s later.

    Compiled code and compilers can keep Python's signal handlers waiting, and a wait for others can be long: a thread
    then kills this process's children, removes its unfinished files and ends it with exit code 128 and the signal's
    number.  It watches on beyond this block, until the process has ended: for a program's outermost block.

    Gives the list that holds the signal's number once one has come.
    """
    read, write = _signal_pipe()
    heard: list[int] = []
    ended = False

    def hear(number: int, frame: FrameType | None = None) -> None:
        # The first interrupts; whatever ends the work then is not to be interrupted.
        nonlocal ended
        if ended:
            return
        if _called_by_compiled_code(frame):
            threading.Timer(_AGAIN, signal.raise_signal, (number,)).start()
            return
        ended = True
        heard.append(number)
        interrupt(number)

    def hear_again(lost: "sys.UnraisableHookArgs") -> None:
        # Raised where nobody could take it, in a library's callback: tried again, a little later.
        nonlocal ended
        if isinstance(lost.exc_value, Interrupted):
            ended = False
            threading.Timer(_AGAIN, signal.raise_signal, (lost.exc_value.number,)).start()
        else:
            sys.__unraisablehook__(lost)

    watcher = threading.Thread(target=_watch, args=(read, heard, grace), name="signals", daemon=True)
    watcher.start()
    # Python's C code writes the signal's number there at once, whatever the main thread does.
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    for number in ENDING:
        signal.signal(number, hear)
    sys.unraisablehook = hear_again
    try:
        yield heard
    finally:
        # What a signal would interrupt from here on is the end itself.
        ended = True


def _called_by_compiled_code(frame: FrameType | None) -> bool:
    """Return True if Numba runs here: it compiles, reads a kernel from its cache, or boxes a kernel's results.

    Compiled code goes on with a null pointer where an exception ends that, and the process dies.  A result that is a
    named tuple is made by a module named after its class.
    """
    while frame is not None:
        module = str(frame.f_globals.get("__name__"))
        if module.partition(".")[0] in _COMPILERS or module.startswith("namedtuple_"):
            return True
        frame = frame.f_back
    return False


def _signal_pipe() -> tuple[Callable[[int], bytes], int]:
    """Return what reads the numbers of signals, and the handle that Python writes them to, which never blocks."""
    if hasattr(os, "set_blocking"):
        read, write = os.pipe()
        os.set_blocking(write, False)
        return functools.partial(os.read, read), write
    # Windows before Python 3.12: pipes always block there, sockets need not.
    import socket

    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    return receiver.recv, sender.detach()


def _watch(read: Callable[[int], bytes], heard: list[int], grace: float) -> None:
    """Wait for the first signal, give the command its time, and end the process."""
    while (number := read(1)[0]) not in ENDING:
        pass
    # Here too: a command may have handlers of its own.
    heard.append(number)
    begun, waited = time.monotonic(), _waited_for_processor()
    while (passed := time.monotonic() - begun) < _AT_LONGEST and passed - _waited_for_processor() + waited < grace:
        time.sleep(_AGAIN)
    with contextlib.suppress(OSError):
        os.write(2, b"planfly: interrupted\n")
    _leave(128 + number)


def _waited_for_processor() -> float:
    """Return the total time that the main thread has waited for a processor, s; 0 on systems other than Linux."""
    try:
        return int(Path("/proc/self/schedstat").read_text(encoding="ascii").split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        return 0.0


def end_process(code: int) -> NoReturn:
    """End this process with an exit code, its children with it, and leave no unfinished file; what it said is kept."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    _leave(code)


def _leave(code: int) -> NoReturn:
    # Not imported here: there are no children where nobody has, and an import could wait for one under way.
    multiprocessing = sys.modules.get("multiprocessing")
    until = time.monotonic() + _REMOVING
    killed = set[int]()
    while True:
        for child in multiprocessing.active_children() if multiprocessing is not None else ():
            child.kill()
            killed.add(child.pid)
        # A killed child that was in the middle of making a file makes it yet, and its folder stays at first.
        if all([remove_unfinished(), *map(remove_temporary_folders, killed)]) or time.monotonic() > until:
            os._exit(code)
        time.sleep(_AGAIN)
