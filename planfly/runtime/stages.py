"""Report the progress of long work: the API reports stages, and its caller shows them.

Without a receiver nothing is shown. Only the compilation of kernels, up to a minute after an install, is then logged
as a warning of the logger ``planfly``, which Python writes to standard error unless logging is configured otherwise.
"""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from world.argument_types import checks_types

# Function that takes the progress of a stage: done, total, a remark.
Advance = Callable[[float, float, str], None]


class Receiver(NamedTuple):
    """Receiver of progress.

    stage: function of title and kind that returns the context of a stage, which yields the function for its progress.
    report_line: function that takes a line that belongs to no stage.
    """

    stage: Callable[[str, str], AbstractContextManager[Advance]]
    report_line: Callable[[str], None]


# Receiver of the progress of the running work.
_receiver: ContextVar[Receiver | None] = ContextVar("receiver", default=None)


@contextmanager
def send_progress_to(receiver: Receiver) -> Iterator[None]:
    """Send the progress of the code in the ``with`` block to a receiver."""
    token = _receiver.set(receiver)
    try:
        yield
    finally:
        _receiver.reset(token)


def stage(title: str, kind: str = "") -> AbstractContextManager[Advance]:
    """Return the context of a stage of work.

    The context yields a function to report the units done, the total and a remark.

    kind: common name of stages with the same pace, if the title is more specific ("planning" for any scenario).

    >>> with stage("flying") as advance:
    ...     advance(1.0, 2.0, "half")
    """
    receiver = _receiver.get()
    return contextlib.nullcontext(_ignore_progress) if receiver is None else receiver.stage(title, kind or title)


def report_line(line: str) -> None:
    """Send a line of progress text to the current receiver, or log it as a warning if there is none."""
    receiver = _receiver.get()
    if receiver is not None:
        receiver.report_line(line)
        return
    # Imported here: the command line has a receiver, and answers --help at once.
    import logging

    logging.getLogger("planfly").warning(line)


def report_replaced(*files: Path) -> None:
    """Report those of the files that exist, and that the caller is about to replace."""
    for file in files:
        if file.exists():
            report_line(f"{file} exists and is replaced")


def has_receiver() -> bool:
    """Return True if the progress of stages has a receiver.

    >>> has_receiver()
    False
    """
    return _receiver.get() is not None


def _ignore_progress(_done: float, _total: float, _remark: str) -> None:
    """Ignore the progress of a stage that has no receiver."""
    pass


@checks_types
def progress(callback: Callable[[str, float, float, str], None]) -> AbstractContextManager[None]:
    """Report the progress of the calls inside a ``with`` block.

    callback: called with the title of a stage ("planning jacksboro"), the amount done, the total, and a remark; with
    0, 0 and "" for a line that belongs to no stage.

    >>> with progress(lambda title, done, total, remark: print(title, done, total, remark)):
    ...     with stage("flying") as advance:
    ...         advance(1.0, 2.0, "half")
    flying 1.0 2.0 half
    """

    @contextmanager
    def start_stage(title: str, _kind: str) -> Iterator[Advance]:
        """Yield a function that passes the progress of a stage to the callback."""
        yield lambda done, total, remark: callback(title, done, total, remark)

    return send_progress_to(Receiver(start_stage, lambda line: callback(line, 0.0, 0.0, "")))
