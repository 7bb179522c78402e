"""Set up planfly's own processes: garbage collection, threads of linear algebra, stack, address space."""

import gc
import os
import sys
from collections.abc import Callable
from types import FunctionType
from typing import TypeVar

_Given = TypeVar("_Given")
# Values that all frames within `with_large_stack` may hold together: numba recurses some 500 frames deep.
_STACK_VALUES = 2**17
# In the environment of a process that `prepare_process` set up, and so of those that it starts.
_MARK = "PLANFLY_OWN_PROCESS"


def prepare_process() -> None:
    """Before NumPy is imported: collect garbage seldom, and leave linear algebra one thread.

    A quarter of a start went into looking for garbage among what is imported, and a tenth into threads that wait by
    spinning: no matrix here is large enough for a second one.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ[_MARK] = "1"
    prepare_child()


def prepare_child() -> None:
    """Collect garbage seldom in a process that one of planfly's own started, such as a campaign's worker.

    A sixth of what a short campaign takes went into looking for garbage in its processes.  Where address space is
    limited, import nothing that does not fit (`world.address_space`).
    """
    if _MARK in os.environ:
        gc.set_threshold(200_000, 50, 50)
        watch_address_space()


def watch_address_space() -> None:
    """Import only modules that fit if the address space of this process is limited."""
    limit = limit_of_address_space()
    if limit is None:
        return
    # Imported here: few processes are limited, and `import planfly` in a script loads nothing else.
    from world.address_space import RoomFinder

    if not any(isinstance(finder, RoomFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, RoomFinder(limit))


def limit_of_address_space() -> int | None:
    """Return bytes that this process may map; None without a limit, as on Windows.

    >>> limit_of_address_space() is None or limit_of_address_space() > 0
    True
    """
    try:
        import resource
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def with_large_stack(work: Callable[[], _Given]) -> _Given:
    """Run work whose frames lie in one large piece of memory, and return what it returns.

    CPython keeps frames in pieces of 16 KB and returns the last one as soon as it is empty.  Numba's recursion crosses
    the edge between two so often that a sixth of its time went into pages that the kernel took back and gave again.  A
    frame that asks for many values gets a piece of their size, and those within share it.

    >>> with_large_stack(lambda: 7)
    7
    """
    roomy = _run.__code__.replace(co_stacksize=_STACK_VALUES)
    return FunctionType(roomy, globals())(work)


def _run(work: Callable[[], _Given]) -> _Given:
    return work()
