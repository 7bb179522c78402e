"""Numba kernels, compiled once per version of their sources, and the records that they work on.

Compiled code is kept in the user's cache folder; `world.kernel_cache` lists the sources of each version.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast

import numba
import numpy as np
from numba.core import event
from numba.extending import models, register_model, typeof_impl
from numpy.typing import NDArray
from platformdirs import user_cache_dir

from world.compile_events import COMPILE_TIMER, announce_compilation
from world.kernel_cache import usable_folder, versioned_folder
from world.kernel_files import use_checked_files
from world.kernel_saves import CacheWriteLock

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_Array = TypeVar("_Array", bound=NDArray[Any])
# A record with the named fields of `record_dtype`, which mypy cannot know.
Record: TypeAlias = Any
# An array of records.
Records: TypeAlias = NDArray[Any]
# Numba's settings, which have no types.  Numba reads the cache folder when a kernel is decorated.
_settings: Any = numba.config
# Cache folder of this version of the sources, within the folder that the user has set or the user's cache folder.
PREFERRED_FOLDER = versioned_folder(Path(_settings.CACHE_DIR or user_cache_dir("planfly")), Path(__file__).parents[1])
_usable_folder = usable_folder(PREFERRED_FOLDER)
_settings.CACHE_DIR = str(_usable_folder or PREFERRED_FOLDER)
# True if compiled kernels are kept only for this process, because `PREFERRED_FOLDER` cannot be written.
IS_TEMPORARY = _usable_folder not in (PREFERRED_FOLDER, None)


class _CompileListener(event.Listener):
    """Listener that reports and times the compilation of kernels that are not in numba's cache."""

    def on_start(self, event: Any) -> None:
        """Report a kernel before its compilation."""
        COMPILE_TIMER.begin()
        announce_compilation()

    def on_end(self, event: Any) -> None:
        """Stop the timer at the end of a compilation."""
        COMPILE_TIMER.end()


cast("Any", event).register("numba:compile", _CompileListener())
if _usable_folder is not None:
    CacheWriteLock(_usable_folder).register()


def cache_folder() -> Path:
    """Return the folder of compiled kernels: `PREFERRED_FOLDER`, or a temporary folder.

    The temporary folder is used if the preferred folder is not writable.

    >>> cache_folder().is_absolute() or bool(_settings.CACHE_DIR)
    True
    """
    return Path(_settings.CACHE_DIR)


def compiled(kernel: _Kernel) -> _Kernel:
    """Compile a function of numbers, arrays and records to machine code at its first call.

    The machine code is cached. A division by zero gives infinity or NaN, as in numpy, because a check would take a
    tenth of the time of the guidance.

    The function must be defined in a file, as `world.terrain.steepest_slopes` is:

    >>> from world.terrain import steepest_slopes
    >>> steepest_slopes(np.array([[0.0, 3.0], [0.0, 3.0]], dtype=np.float32), 1.0).round(3)
    array([[3.]], dtype=float32)
    """
    return cast("_Kernel", _make_dispatcher(kernel))


def compiled_inline(kernel: _Kernel) -> _Kernel:
    """Compile a function as `compiled` does, and let LLVM inline it into the kernels that call it.

    >>> from world.geometry import wrap
    >>> round(wrap(4.0), 6)
    -2.283185
    """
    return cast("_Kernel", _make_dispatcher(kernel, forceinline=True))


def inner(kernel: _Kernel) -> _Kernel:
    """Compile a function that only other kernels call, without a wrapper for Python.

    The wrapper would take a seventh of the compile time of a kernel. Tests may still call the function; a wrapper is
    then compiled and cached separately.

    >>> from world.airspace.zone_kernels import box_distance
    >>> callable(box_distance)
    True
    """
    return cast("_Kernel", _InnerKernel(kernel))


def inlined(kernel: _Kernel) -> _Kernel:
    """Compile a function as `inner` does, and let LLVM inline it into the kernels that call it.

    Without inlining, a call passes seven numbers for each array, and increments the array's reference count. Many
    kernels do less work than that: the planner's graded scores would take a quarter longer. Numba's own inlining
    (`inline="always"`) would not be faster, but numba would type and translate each copy again.
    """
    return cast("_Kernel", _InnerKernel(kernel, forceinline=True))


def _make_dispatcher(kernel: Any, **options: bool) -> Any:
    """Return numba's dispatcher of a function.

    It compiles the function at its first call and caches the machine code.

    options: further options of `numba.njit`.
    """
    njit: Any = numba.njit
    # The wrapper for C is only needed to pass a kernel to another one as a value, which no kernel here does.
    dispatcher = njit(cache=_usable_folder is not None, error_model="numpy", no_cfunc_wrapper=True, **options)(kernel)
    if _usable_folder is not None:
        use_checked_files(dispatcher)
    return dispatcher


class _InnerKernel:
    """Function that kernels call directly in its compiled form, and Python through a wrapper function."""

    def __init__(self, kernel: Callable[..., Any], **options: bool) -> None:
        functools.update_wrapper(self, kernel)
        self._options = options

    @functools.cached_property
    def dispatcher(self) -> Any:
        """Numba's dispatcher.

        It is made when a kernel that calls this one is compiled; a cached kernel already contains its machine code.
        """
        return _make_dispatcher(vars(self)["__wrapped__"], no_cpython_wrapper=True, **self._options)

    @functools.cached_property
    def _wrapper(self) -> Any:
        """Compiled function that Python can call, and that calls this kernel."""
        kernel = self
        return _make_dispatcher(lambda *arguments: kernel(*arguments))

    def __reduce__(self) -> str:
        """Pickle the kernel by its name, so that the cache distinguishes the wrappers of different kernels."""
        return str(vars(self)["__qualname__"])

    def __call__(self, *arguments: Any) -> Any:
        """Call the function from Python through its wrapper; a call without the wrapper would crash."""
        return self._wrapper(*arguments)


class _InnerType(numba.types.Dispatcher):  # type: ignore[misc]  # numba states no types
    """Numba's type of an inner function, which has one compiled form for all literal numbers of a type."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return numba's call type with literal numbers replaced by their types.

        Without this, numba would compile the function again for each number in a call.
        """
        plain_types = tuple(numba.types.unliteral(argument_type) for argument_type in args)
        return super().get_call_type(context, plain_types, {name: numba.types.unliteral(kws[name]) for name in kws})


register_model(_InnerType)(models.OpaqueModel)


@typeof_impl.register(_InnerKernel)
def _type_of_inner_kernel(kernel: _InnerKernel, _: Any) -> _InnerType:
    """Return the numba type of an inner kernel."""
    return _InnerType(kernel.dispatcher)


@inlined
def copy_into(target: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy numbers (n,) into an array or a slice of the same length; the length is not checked.

    Numba's ``out[:] = values`` checks the length. It would compile the error message, with Unicode handling, into each
    kernel.

    >>> out = np.zeros(2)
    >>> copy_into(out, np.array([3.0, 4.0]))
    >>> out
    array([3., 4.])
    """
    for k in range(values.size):
        target[k] = values[k]


@inner
def sort_few(values: NDArray[Any]) -> None:
    """Sort a few numbers (n,) in place by insertion.

    This compiles a second faster than numba's own sort.

    >>> some = np.array([3.0, 1.0, 2.0])
    >>> sort_few(some)
    >>> some
    array([1., 2., 3.])
    """
    for k in range(1, values.size):
        value, position = values[k], k
        while position > 0 and values[position - 1] > value:
            values[position] = values[position - 1]
            position -= 1
        values[position] = value


def read_only(array: _Array) -> _Array:
    """Return a read-only view of an array.

    Numba compiles a kernel separately for writable and for read-only arrays. With this function a kernel gets only
    read-only arrays, and is compiled once.

    >>> read_only(np.zeros(2)).flags.writeable
    False
    """
    view = array.view()
    view.setflags(write=False)
    return view


def record_dtype(*entries: str | tuple[Any, ...]) -> np.dtype[np.record]:
    """Make the dtype of a record whose fields can be read as attributes, in Python and in compiled code.

    entries: fields in order. Each is the name of a float64, or (name, type) or (name, type, shape) as in numpy.

    >>> POINT = record_dtype("east", "north", ("leg", np.int64), ("velocity", np.float64, (3,)))
    >>> points = np.zeros(2, POINT)
    >>> points[1].north = 4.0
    >>> points["north"]
    array([0., 4.])
    >>> points[1].leg += 1
    >>> points[1].tolist()[:3]
    (0.0, 4.0, 1)
    """
    fields = [(entry, np.float64) if isinstance(entry, str) else entry for entry in entries]
    dtype: Any = np.dtype((np.record, np.dtype(fields, align=True)))
    return cast("np.dtype[np.record]", dtype)


def field_names(dtype: np.dtype[np.record]) -> tuple[str, ...]:
    """Return the names of a record's fields, in order.

    >>> field_names(record_dtype("east", "north"))
    ('east', 'north')
    """
    return dtype.names or ()
