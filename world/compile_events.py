"""Call functions before a kernel is compiled, and measure the time that compiling takes.

A kernel is compiled only if it is not in the cache.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

BeforeCompiling = Callable[[], None]

_callbacks: list[BeforeCompiling] = []


@contextmanager
def notify_before_compiling(callback: BeforeCompiling, *, once: bool = False) -> Iterator[None]:
    """Call a function before each kernel that any thread compiles within this block.

    If blocks are nested, only the innermost function is called.

    once: True to call the function only before the first kernel.

    >>> with notify_before_compiling(lambda: print("compiling")):
    ...     announce_compilation()
    compiling
    """
    has_notified = False

    def notify() -> None:
        """Call the function, or do nothing if it is called only once."""
        nonlocal has_notified
        if not (once and has_notified):
            has_notified = True
            callback()

    _callbacks.append(notify)
    try:
        yield
    finally:
        _callbacks.remove(notify)


class CompileTimer:
    """Timer for the compilation of kernels in this process.

    seconds: total time of the ended compilations, s; simultaneous compilations are timed once.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self._running_count = 0
        self._start = 0.0

    def begin(self) -> None:
        """Record the start of a compilation; compilations may be nested."""
        if not self._running_count:
            self._start = time.monotonic()
        self._running_count += 1

    def end(self) -> None:
        """Record the end of a compilation."""
        self._running_count -= 1
        if not self._running_count:
            self.seconds += time.monotonic() - self._start


# Timer of all compilations of this process.
COMPILE_TIMER = CompileTimer()


def announce_compilation() -> None:
    """Call the innermost callback of `notify_before_compiling`, if any, before a kernel is compiled."""
    if _callbacks:
        _callbacks[-1]()
