"""Who is told before kernels are compiled: nothing of that takes long while all of them are in the cache."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

BeforeCompiling = Callable[[], None]

_told: list[BeforeCompiling] = []


@contextmanager
def tell_before_compiling(told: BeforeCompiling) -> Iterator[None]:
    """Call this before each kernel that is compiled meanwhile, in any thread; the innermost alone is called.

    >>> with tell_before_compiling(lambda: print("compiling")):
    ...     kernel_is_compiled()
    compiling
    """
    _told.append(told)
    try:
        yield
    finally:
        _told.remove(told)


def kernel_is_compiled() -> None:
    """Say that a kernel is about to be compiled, because no cache has it."""
    if _told:
        _told[-1]()
