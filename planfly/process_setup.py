"""How a process that belongs to planfly alone is set up: what collects garbage, threads of linear algebra, stack."""

import gc
import os
from collections.abc import Callable
from types import FunctionType
from typing import TypeVar

_Given = TypeVar("_Given")
# Values that all frames within `with_large_stack` may hold together: numba recurses some 500 frames deep.
_STACK_VALUES = 2**17


def prepare_process() -> None:
    """Before NumPy is imported: collect garbage seldom, and leave linear algebra one thread.

    A quarter of a start went into looking for garbage among what is imported, and a tenth into threads that wait by
    spinning: no matrix here is large enough for a second one.
    """
    gc.set_threshold(200_000, 50, 50)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def with_large_stack(work: Callable[[], _Given]) -> _Given:
    """Run work whose frames lie in one large piece of memory, and return what it returns.

    CPython keeps frames in pieces of 16 KB and returns the last one as soon as it is empty.  Numba's recursion crosses
    the edge between two so often that a sixth of its time went into pages that the kernel took back and gave again.  A
    frame that asks for many values gets a piece of their size, and those within share it.

    >>> with_large_stack(lambda: 7)
    7
    """
    roomy = _run.__code__.replace(co_stacksize=_STACK_VALUES)
    given: _Given = FunctionType(roomy, globals())(work)
    return given


def _run(work: Callable[[], _Given]) -> _Given:
    return work()
