"""Interruption: where a signal may end the work, what must be done whole, and what ends or is removed with it.

The application turns a signal into a call of `interrupt`; what may not be cut in half stands in `uninterrupted`.
"""

import contextlib
import os
import shutil
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

# How long a process that is asked to end may take before it is killed, s.
CHILD_PATIENCE = 0.5


class Interrupted(KeyboardInterrupt):
    """A signal has asked the work to end.  number: the signal's."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class _State:
    """What an interruption has to know.

    depth: how many `uninterrupted` blocks are open.  waiting: the signal that waits for their end, 0 for none.
    unfinished: temporary files and folders of this process that are there now.
    """

    def __init__(self) -> None:
        self.depth = self.waiting = 0
        self.unfinished: set[Path] = set()


_state = _State()


def interrupt(number: int, _frame: FrameType | None = None) -> None:
    """Raise `Interrupted` for a signal, at once or at the end of what is `uninterrupted`: a signal handler.

    >>> import signal
    >>> try:
    ...     interrupt(signal.SIGTERM)
    ... except Interrupted as interrupted:
    ...     print(interrupted.number)
    15
    """
    if _state.depth:
        _state.waiting = number
        return
    raise Interrupted(number)


class uninterrupted:
    """What stands inside is done whole; a signal that comes meanwhile is raised at its end.

    >>> import signal
    >>> try:
    ...     with uninterrupted():
    ...         interrupt(signal.SIGTERM)
    ...         print("whole")
    ... except Interrupted:
    ...     print("and then interrupted")
    whole
    and then interrupted
    """

    def __enter__(self) -> None:
        """Hold signals back."""
        _state.depth += 1

    def __exit__(self, *_: object) -> None:
        """Let the signal in that came meanwhile."""
        _state.depth -= 1
        if _state.waiting and not _state.depth:
            number, _state.waiting = _state.waiting, 0
            raise Interrupted(number)


@contextlib.contextmanager
def unfinished(path: Path) -> Iterator[None]:
    """Note a temporary file or folder while it is there; it is removed at the end, and by `remove_unfinished`.

    One that cannot be removed at the end, as another process still writes in it, is noted until it is gone.

    >>> with unfinished(Path("never-made")):
    ...     pass
    """
    _state.unfinished.add(path)
    try:
        yield
    finally:
        with uninterrupted():
            if _remove(path):
                _state.unfinished.discard(path)


def remove_unfinished() -> bool:
    """Remove the temporary files and folders that are there now: for a process that has to end at once.

    Whether none is left.

    >>> remove_unfinished()
    True
    """
    gone = [_remove(path) for path in tuple(_state.unfinished)]
    return all(gone)


def _remove(path: Path) -> bool:
    """Remove a file or folder as far as it can be: whether it is gone."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
    return not os.path.lexists(path)


@contextlib.contextmanager
def children_ignore_sigint() -> Iterator[None]:
    """Processes that are started inside never hear Ctrl-C, which reaches all of a terminal's: their parent ends them.

    A signal that comes meanwhile is not lost: this process hears it at the end.  A start that another signal cuts short
    leaves a child that waits for its task and ends with a traceback: `uninterrupted` goes beside it.

    >>> from multiprocessing import Process
    >>> with children_ignore_sigint():
    ...     child = Process(target=print)
    """
    # Imported here: few commands have children, and --help answers at once.
    from multiprocessing import resource_tracker

    if not hasattr(signal, "pthread_sigmask"):
        # Windows: a console's children hear it, whatever their parent does.
        yield
        return
    # It unblocks the signal again where it is started later.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent(in_service: threading.Event | None = None) -> None:
    """Have SIGTERM, and the end of its parent, end this process at once; its unfinished files are removed.

    For a child process.  in_service: once it is set, the process notices its parent's end by itself.

    >>> import multiprocessing
    >>> child = multiprocessing.get_context("spawn").Process(target=end_with_parent)
    """
    # Imported here: few processes are children, and --help answers at once.
    import multiprocessing

    signal.signal(signal.SIGTERM, _end)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            if in_service is None or not in_service.is_set():
                _end(signal.SIGTERM)

    threading.Thread(target=follow, daemon=True).start()


def _end(number: int, _frame: FrameType | None = None) -> None:
    remove_unfinished()
    os._exit(128 + number)


def end_children(children: Sequence["BaseProcess"], patience: float = CHILD_PATIENCE) -> None:
    """End processes: SIGTERM to all, and SIGKILL after ``patience`` s to those that have not ended.

    >>> end_children([])
    """
    for child in children:
        child.terminate()
    until = time.monotonic() + patience
    for child in children:
        child.join(max(0.0, until - time.monotonic()))
    for child in children:
        if child.is_alive():
            child.kill()
            child.join()
