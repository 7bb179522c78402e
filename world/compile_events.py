"""Callbacks that run before a kernel is compiled, which takes time and happens only for kernels not in the cache."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

BeforeCompiling = Callable[[], None]

_callbacks: list[BeforeCompiling] = []


@contextmanager
def notify_before_compiling(callback: BeforeCompiling) -> Iterator[None]:
    """Call a function before each kernel that is compiled within the block, in any thread.

    Of nested callbacks only the innermost is called.

    >>> with notify_before_compiling(lambda: print("compiling")):
    ...     announce_compilation()
    compiling
    """
    _callbacks.append(callback)
    try:
        yield
    finally:
        _callbacks.remove(callback)


def announce_compilation() -> None:
    """Call the innermost callback, because a kernel that is not in the cache is about to be compiled."""
    if _callbacks:
        _callbacks[-1]()
