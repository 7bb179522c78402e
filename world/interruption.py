"""Handle interruption by signals: complete blocks, remove temporary files, and end child processes.

The application turns a signal into a call of `interrupt`; work that must complete is done within `delay_signals`.
"""

import contextlib
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

# Time between SIGTERM and SIGKILL for a child process, s.
CHILD_TIMEOUT_S = 0.5
# Warning option that the resource tracker of multiprocessing inherits: it frees the semaphores of a process that was
# ended by force, and would report that on the user's terminal.
_TRACKER_OPTION = "ignore:resource_tracker:UserWarning"


class Interrupted(KeyboardInterrupt):
    """Exception that a signal raises to end the work.

    number: number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class _State:
    """State of interruptions in this process.

    depth: number of open `delay_signals` blocks.
    pending_signal: signal that is delayed until these blocks end, 0 for no signal.
    temporary_paths: temporary files and folders of this process that exist and must be removed.
    """

    def __init__(self) -> None:
        self.depth = self.pending_signal = 0
        self.temporary_paths: set[Path] = set()


_state = _State()


def interrupt(number: int, _frame: FrameType | None = None) -> None:
    """Raise `Interrupted` for a signal, at once or at the end of a `delay_signals` block.

    >>> import signal
    >>> try:
    ...     interrupt(signal.SIGTERM)
    ... except Interrupted as interrupted:
    ...     print(interrupted.number)
    15
    """
    if _state.depth:
        _state.pending_signal = number
        return
    raise Interrupted(number)


class delay_signals:
    """Context manager that completes its block, and then raises `Interrupted` if a signal arrived.

    >>> import signal
    >>> try:
    ...     with delay_signals():
    ...         interrupt(signal.SIGTERM)
    ...         print("whole")
    ... except Interrupted:
    ...     print("and then interrupted")
    whole
    and then interrupted
    """

    def __enter__(self) -> None:
        """Delay signals."""
        _state.depth += 1

    def __exit__(self, *_: object) -> None:
        """Raise `Interrupted` at the end of the outermost block if a signal arrived during the block."""
        _state.depth -= 1
        if _state.pending_signal and not _state.depth:
            number, _state.pending_signal = _state.pending_signal, 0
            raise Interrupted(number)


@contextlib.contextmanager
def remove_at_end(path: Path) -> Iterator[None]:
    """Register a temporary file or folder, and remove it at the end of the block.

    `remove_temporary_paths` removes all registered paths. A folder stays registered if it cannot be removed at the end
    of the block because another process still writes into it.

    >>> with remove_at_end(Path("never-made")):
    ...     pass
    """
    _state.temporary_paths.add(path)
    try:
        yield
    finally:
        with delay_signals():
            if _remove_path(path):
                _state.temporary_paths.discard(path)


def remove_temporary_paths() -> bool:
    """Remove all registered temporary files and folders, in a process that must end at once.

    Returns True if all are removed.

    >>> remove_temporary_paths()
    True
    """
    removals = [_remove_path(path) for path in tuple(_state.temporary_paths)]
    return all(removals)


def _remove_path(path: Path) -> bool:
    """Remove a file or folder as far as possible; return True if it no longer exists."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
    return not os.path.lexists(path)


@contextlib.contextmanager
def children_ignore_sigint() -> Iterator[None]:
    """Start child processes within this block so that they ignore Ctrl-C (SIGINT).

    Ctrl-C also reaches child processes, but their parent has to end them. If a SIGINT arrives during the block, this
    process receives it at the end of the block. Use `delay_signals` around this block: another signal during the start
    of a child would leave the child waiting for its task.

    >>> from multiprocessing import Process
    >>> with children_ignore_sigint():
    ...     child = Process(target=print)
    """
    # Imported here, because few commands have children, and --help must answer at once.
    from multiprocessing import resource_tracker

    if not hasattr(signal, "pthread_sigmask"):
        # On Windows the children of a console always receive Ctrl-C.
        yield
        return
    if _TRACKER_OPTION not in sys.warnoptions:
        sys.warnoptions.append(_TRACKER_OPTION)
    # Start the resource tracker before the signal is blocked, because the tracker unblocks the signal when it starts.
    resource_tracker.ensure_running()
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


def end_with_parent(detects_parent_end: threading.Event | None = None) -> None:
    """Make this child process end at once on SIGTERM and when its parent ends.

    Its temporary files are removed.

    detects_parent_end: event that the process sets when it handles the end of its parent itself; it is then not ended.

    >>> import multiprocessing
    >>> child = multiprocessing.get_context("spawn").Process(target=end_with_parent)
    """
    # Imported here, because few processes are children, and --help must answer at once.
    import multiprocessing

    signal.signal(signal.SIGTERM, _end_process)
    parent = multiprocessing.parent_process()

    def end_after_parent() -> None:
        """End this process once its parent has ended."""
        if parent is not None:
            parent.join()
            if detects_parent_end is None or not detects_parent_end.is_set():
                _end_process(signal.SIGTERM)

    threading.Thread(target=end_after_parent, daemon=True).start()


def _end_process(number: int, _frame: FrameType | None = None) -> None:
    """End this process at once for a signal, after its temporary files are removed."""
    remove_temporary_paths()
    os._exit(128 + number)


def end_children(children: Sequence["BaseProcess"], patience: float = CHILD_TIMEOUT_S) -> None:
    """End processes: send SIGTERM to all, and SIGKILL after ``patience`` s to those that still run.

    >>> end_children([])
    """
    for child in children:
        child.terminate()
    deadline = time.monotonic() + patience
    for child in children:
        child.join(max(0.0, deadline - time.monotonic()))
    for child in children:
        if child.is_alive():
            child.kill()
            child.join()
