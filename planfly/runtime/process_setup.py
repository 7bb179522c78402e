"""Set up planfly's own processes: garbage collection, threads of linear algebra, stack, address space."""

import gc
import os
import sys
from collections.abc import Callable, Iterable
from types import FunctionType
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

_Result = TypeVar("_Result")
# Total number of values in all frames within `with_large_stack`; Numba recurses some 500 frames deep.
_STACK_VALUES = 2**17
# Number of new objects after which garbage is collected.  The imports of a command leave some 300,000, and nothing to
# collect; a flight allocates few more.
_MIN_OBJECTS_TO_COLLECT = 1_000_000
# Exit code of a worker process that would call the function that started it.
_REPEATED_CALL_EXIT_CODE = 78
# Environment variable of a process set up by `prepare_process`, inherited by its child processes.
_OWN_PROCESS_VARIABLE = "PLANFLY_OWN_PROCESS"


def prepare_process() -> None:
    """Make garbage collection rare in this process and its children.

    Linear algebra is limited to one thread.

    Call this function before NumPy is imported.

    Garbage collection during imports took a quarter of the start-up time, and spinning threads a tenth; no matrix in
    planfly is large enough for a second thread.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ[_OWN_PROCESS_VARIABLE] = "1"
    prepare_child()


def prepare_child() -> None:
    """Make garbage collection rare in a process that planfly started, such as the worker of a campaign.

    Garbage collection in the processes of a short campaign took a sixth of its time. If the address space is limited,
    import only modules that fit (`world.address_space`).
    """
    if _OWN_PROCESS_VARIABLE in os.environ:
        gc.set_threshold(_MIN_OBJECTS_TO_COLLECT, 50, 50)
        guard_imports()


def end_repeated_call() -> None:
    """End this process silently if it is a worker that is still importing the script of its parent.

    Call this function first in functions that start processes.  If the script has no ``if __name__ == "__main__":``,
    the import calls the same function again.  The parent process then reports this (`check_script_guard`).
    """
    from multiprocessing import current_process

    # `multiprocessing` sets this attribute while a spawned process imports the script.
    if getattr(current_process(), "_inheriting", False):
        raise SystemExit(_REPEATED_CALL_EXIT_CODE)


def check_script_guard(workers: "Iterable[BaseProcess]") -> None:
    """Raise PlanflyError if `end_repeated_call` has ended one of these processes."""
    if not any(worker.exitcode == _REPEATED_CALL_EXIT_CODE for worker in workers):
        return
    # Imported here: `import planfly` loads nothing else.
    from world.errors import PlanflyError

    script = getattr(sys.modules.get("__main__"), "__file__", None) or "the script"
    reason = (
        'the line `if __name__ == "__main__":` is missing above the calls of planfly, because worker processes import'
        " the script"
    )
    raise PlanflyError(f"{script}: {reason}", file=script) from None


def guard_imports() -> None:
    """Make imports fail early for modules that do not fit into this process's address space.

    This is only done if the address space is limited.
    """
    limit = address_space_limit()
    if limit is None:
        return
    # Imported here: few processes are limited, and `import planfly` in a script loads nothing else.
    from world.address_space import AddressSpaceGuard

    if not any(isinstance(finder, AddressSpaceGuard) for finder in sys.meta_path):
        sys.meta_path.insert(0, AddressSpaceGuard(limit))


def address_space_limit() -> int | None:
    """Return the number of bytes that this process may map, or None without a limit, as on Windows.

    >>> address_space_limit() is None or address_space_limit() > 0
    True
    """
    try:
        import resource
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def with_large_stack(function: Callable[[], _Result]) -> _Result:
    """Call a function with the frames of all inner calls in one large piece of memory.

    Return the function's result.

    CPython keeps frames in pieces of 16 KB and frees the last piece as soon as it is empty. Numba's recursion crosses
    the boundary between two pieces so often that a sixth of its time was spent on memory pages that the operating
    system took back and provided again. A frame with many values gets a piece of their size, and inner frames share
    this piece.

    >>> with_large_stack(lambda: 7)
    7
    """
    large_frame_code = _call.__code__.replace(co_stacksize=_STACK_VALUES)
    return FunctionType(large_frame_code, globals())(function)


def _call(function: Callable[[], _Result]) -> _Result:
    """Call a function; `with_large_stack` gives a copy of this code a large frame."""
    return function()
