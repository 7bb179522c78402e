"""End a command on SIGINT or SIGTERM, in an orderly manner if it reacts in time, otherwise by force."""

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
from world.interruption import Interrupted, interrupt, remove_temporary_paths

# Signals that end a command.
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Time from a signal until the process is ended by force, s, not counting the time that it waited for a processor.
GRACE_S = 0.7
# Maximum time from a signal until the process is ended by force, including the time waited for a processor, s.
_MAX_GRACE_S = 10.0
# Time for which the removal of files is retried, s.
_REMOVAL_TIMEOUT_S = 0.5
# Delay before a signal that could not be handled is raised again, and between two tries to remove files, s.
_RETRY_INTERVAL_S = 0.02
# Packages during whose code an exception must not be raised.
_COMPILER_PACKAGES = ("numba", "llvmlite")


@contextlib.contextmanager
def end_on_signals(grace: float = GRACE_S) -> Iterator[list[int]]:
    """During this block, raise `Interrupted` for SIGINT and SIGTERM.

    The process is ended by force if it does not end.

    grace: time after a signal at which the process is ended by force, s.

    Python's signal handlers may run late: compiled code and compilers delay them, and waits for other processes can be
    long.  Therefore a thread kills the children of this process, removes its unfinished files, and ends it with exit
    code 128 plus the number of the signal.  The thread keeps watching after this block until the process has ended.
    Use this block as the outermost block of a program.

    Yields a list to which the number of a signal is added when it arrives.
    """
    # A function that reads signal numbers, and a handle to which Python writes them without blocking.
    read_number: Callable[[int], bytes]
    if hasattr(os, "set_blocking"):
        read_handle, write_handle = os.pipe()
        os.set_blocking(write_handle, False)
        read_number = functools.partial(os.read, read_handle)
    else:
        # On Windows before Python 3.12 pipes always block, but sockets need not block.
        import socket

        receiver, sender = socket.socketpair()
        sender.setblocking(False)
        read_number, write_handle = receiver.recv, sender.detach()
    received: list[int] = []
    is_ending = False

    def handle_signal(number: int, frame: FrameType | None = None) -> None:
        """Raise `Interrupted` for the first signal, later if compiled code is running."""
        # The first signal interrupts the work; the code that then ends the work must not be interrupted.
        nonlocal is_ending
        if is_ending:
            return
        if _called_by_compiled_code(frame):
            threading.Timer(_RETRY_INTERVAL_S, signal.raise_signal, (number,)).start()
            return
        is_ending = True
        received.append(number)
        interrupt(number)

    def raise_signal_again(unraisable: "sys.UnraisableHookArgs") -> None:
        """Raise a signal again, a little later, if a callback of a library dropped its exception."""
        nonlocal is_ending
        if isinstance(unraisable.exc_value, Interrupted):
            is_ending = False
            threading.Timer(_RETRY_INTERVAL_S, signal.raise_signal, (unraisable.exc_value.number,)).start()
        else:
            sys.__unraisablehook__(unraisable)

    watcher = threading.Thread(
        target=_end_process_after_signal, args=(read_number, received, grace), name="signals", daemon=True
    )
    watcher.start()
    # Python's C code writes the number of the signal to the pipe at once, whatever the main thread is doing.
    signal.set_wakeup_fd(write_handle, warn_on_full_buffer=False)
    for number in ENDING_SIGNALS:
        signal.signal(number, handle_signal)
    sys.unraisablehook = raise_signal_again
    try:
        yield received
    finally:
        # From now on, a signal would only interrupt the end of the program.
        is_ending = True


def _called_by_compiled_code(frame: FrameType | None) -> bool:
    """Return True if Numba is in the call stack.

    Numba may be compiling, reading a cached kernel, or converting the results of a kernel.  If an exception interrupts
    it there, compiled code continues with a null pointer, and the process crashes.  A result that is a named tuple is
    made by a module named after its class.
    """
    while frame is not None:
        module = str(frame.f_globals.get("__name__"))
        if module.partition(".")[0] in _COMPILER_PACKAGES or module.startswith("namedtuple_"):
            return True
        frame = frame.f_back
    return False


def _end_process_after_signal(read_number: Callable[[int], bytes], received: list[int], grace: float) -> None:
    """Wait for the first signal, give the command time to end by itself, and end the process.

    read_number: function that reads signal numbers as bytes.
    received: list to which the number of the signal is appended.
    grace: time to end, s; time in which the main thread waits for a processor is not included.
    """
    while (number := read_number(1)[0]) not in ENDING_SIGNALS:
        pass
    # Append the number here, too, because a command may have its own signal handlers.
    received.append(number)
    start_time, start_wait_time = time.monotonic(), _processor_wait_time()
    while (elapsed := time.monotonic() - start_time) < _MAX_GRACE_S:
        wait_time = _processor_wait_time() - start_wait_time
        if elapsed - wait_time >= grace:
            break
        time.sleep(_RETRY_INTERVAL_S)
    with contextlib.suppress(OSError):
        os.write(2, b"planfly: interrupted\n")
    _kill_children_and_exit(128 + number)


def _processor_wait_time() -> float:
    """Return the total time that the main thread has waited for a processor, s; 0 if not on Linux."""
    try:
        return int(Path("/proc/self/schedstat").read_text(encoding="ascii").split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        return 0.0


def end_process(code: int) -> NoReturn:
    """Flush the output, end this process and its children with an exit code, and remove unfinished files."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    _kill_children_and_exit(code)


def _kill_children_and_exit(code: int) -> NoReturn:
    """Kill the children of this process, remove their unfinished files and its own, and exit at once."""
    # Do not import multiprocessing: if it is not yet imported, there are no children, and an import could block.
    multiprocessing = sys.modules.get("multiprocessing")
    deadline = time.monotonic() + _REMOVAL_TIMEOUT_S
    killed_ids = set[int]()
    while True:
        for child in multiprocessing.active_children() if multiprocessing is not None else ():
            child.kill()
            killed_ids.add(child.pid)
        # A killed child may still complete a file that it was writing, so removing its folder may fail at first.
        if all([remove_temporary_paths(), *map(remove_temporary_folders, killed_ids)]) or time.monotonic() > deadline:
            os._exit(code)
        time.sleep(_RETRY_INTERVAL_S)
