"""Numba kernels, compiled once per version of what they are made of, and the records that they work on.

Compiled code lies in the user's cache folder; `world.kernel_cache` says for which sources.
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

from world.compile_events import kernel_is_compiled
from world.kernel_cache import usable_folder, wanted_folder
from world.kernel_saves import SavingTurns

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_Array = TypeVar("_Array", bound=NDArray[Any])
# A record of named fields, as `record_dtype` makes: mypy cannot know which.
Record: TypeAlias = Any
# An array of them.
Records: TypeAlias = NDArray[Any]
# Numba fills its settings in when it is imported, and states no types for them.  The folder is read when a kernel is
# decorated; within one that the user has set, each version of the sources has its own.
_settings: Any = numba.config
WANTED = wanted_folder(Path(_settings.CACHE_DIR or user_cache_dir("planfly")), Path(__file__).parents[1])
_usable = usable_folder(WANTED)
_settings.CACHE_DIR = str(_usable or WANTED)
# Whether kernels are kept for this process alone.
TEMPORARY = _usable not in (WANTED, None)


class _Compiling(event.Listener):
    """Passes on that numba compiles, which it does only what its cache does not have."""

    def on_start(self, event: Any) -> None:
        """Before a kernel is compiled."""
        kernel_is_compiled()

    def on_end(self, event: Any) -> None:
        """After it."""


cast("Any", event).register("numba:compile", _Compiling())
if _usable is not None:
    SavingTurns(_usable).register()


def cache_folder() -> Path:
    """Where compiled kernels are kept: in `WANTED`, or in a temporary folder where that cannot be written.

    >>> cache_folder().is_absolute() or bool(_settings.CACHE_DIR)
    True
    """
    return Path(_settings.CACHE_DIR)


def compiled(kernel: _Kernel) -> _Kernel:
    """Compile a function of numbers, arrays and records to machine code on first use, and keep it.

    A division by zero gives infinity or NaN, as in numpy: looking for it costs a tenth of the guidance's time.

    A function has to stand in a file, as `world.terrain.steepest_slopes` does:

    >>> from world.terrain import steepest_slopes
    >>> steepest_slopes(np.array([[0.0, 3.0], [0.0, 3.0]], dtype=np.float32), 1.0).round(3)
    array([[3.]], dtype=float32)
    """
    return cast("_Kernel", _compiled(kernel))


def compiled_inline(kernel: _Kernel) -> _Kernel:
    """As `compiled`, and LLVM copies the function into the kernels that call it, as with `inlined`.

    >>> from world.geometry import wrap
    >>> round(wrap(4.0), 6)
    -2.283185
    """
    return cast("_Kernel", _compiled(kernel, forceinline=True))


def inner(kernel: _Kernel) -> _Kernel:
    """Compile a function that other kernels call, without the wrapper that Python would call it by.

    The wrapper is a seventh of what it takes to compile a kernel.  Tests may still call the function: a wrapper is then
    compiled, and kept apart.

    >>> from world.airspace.zone_kernels import box_distance
    >>> callable(box_distance)
    True
    """
    return cast("_Kernel", _InnerKernel(kernel))


def inlined(kernel: _Kernel) -> _Kernel:
    """As `inner`, and LLVM copies the function into the kernels that call it, in their inner loops.

    A call hands over seven numbers an array, and counts a reference to each: more than many a kernel's own work.  The
    planner's graded scores take a quarter longer with calls alone.  Copied by numba (`inline="always"`) it would run no
    faster, but each copy would be typed and translated again.
    """
    return cast("_Kernel", _InnerKernel(kernel, forceinline=True))


def _compiled(kernel: Any, **options: bool) -> Any:
    njit: Any = numba.njit
    # No kernel is handed to another as a value, which the wrapper for C is for.
    return njit(cache=_usable is not None, error_model="numpy", no_cfunc_wrapper=True, **options)(kernel)


class _InnerKernel:
    """A function that kernels call as it is compiled, and Python through a function around it."""

    def __init__(self, kernel: Callable[..., Any], **options: bool) -> None:
        functools.update_wrapper(self, kernel)
        self._options = options

    @functools.cached_property
    def dispatcher(self) -> Any:
        """Numba's, made when a kernel that calls it is compiled: kernels from the cache hold it already."""
        return _compiled(vars(self)["__wrapped__"], no_cpython_wrapper=True, **self._options)

    @functools.cached_property
    def _around(self) -> Any:
        kernel = self
        return _compiled(lambda *given: kernel(*given))

    def __reduce__(self) -> str:
        """By its name, which tells the functions around others apart in the cache."""
        return str(vars(self)["__qualname__"])

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python, which would end the process without a wrapper."""
        return self._around(*arguments)


class _InnerType(numba.types.Dispatcher):  # type: ignore[misc]  # numba states no types
    """Numba's type of a function that kernels call: one compiled form for a number, whatever literal stands there."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """As numba has it, which would compile a function anew for each literal number."""
        plain = tuple(numba.types.unliteral(given) for given in args)
        return super().get_call_type(context, plain, {name: numba.types.unliteral(kws[name]) for name in kws})


register_model(_InnerType)(models.OpaqueModel)


@typeof_impl.register(_InnerKernel)
def _type_of_inner_kernel(kernel: _InnerKernel, _: Any) -> _InnerType:
    return _InnerType(kernel.dispatcher)


@inlined
def copy_into(out: NDArray[Any], values: NDArray[Any]) -> None:  # pragma: no cover - compiled
    """Copy numbers (n,) into an array, or part of one, of the same length, which is not looked at.

    Numba's ``out[:] = values`` looks at it, and compiles the text of its message, Unicode and all, into each kernel.

    >>> out = np.zeros(2)
    >>> copy_into(out, np.array([3.0, 4.0]))
    >>> out
    array([3., 4.])
    """
    for k in range(values.size):
        out[k] = values[k]


@inner
def sort_few(values: NDArray[Any]) -> None:  # pragma: no cover - compiled
    """Sort numbers (n,) in place by insertion: a second of compiling less than numba's own sort, for a few numbers.

    >>> some = np.array([3.0, 1.0, 2.0])
    >>> sort_few(some)
    >>> some
    array([1., 2., 3.])
    """
    for k in range(1, values.size):
        value, at = values[k], k
        while at > 0 and values[at - 1] > value:
            values[at] = values[at - 1]
            at -= 1
        values[at] = value


def read_only(array: _Array) -> _Array:
    """The same numbers as an array that cannot be written.

    Numba compiles a kernel anew for arrays that can be written and for those that cannot: one that is called with both
    is called with this.

    >>> read_only(np.zeros(2)).flags.writeable
    False
    """
    view = array.view()
    view.setflags(write=False)
    return view


def record_dtype(*entries: str | tuple[Any, ...]) -> np.dtype[np.record]:
    """Type of a record whose fields are read and set as attributes, in Python and in compiled code.

    entries: in order: the name of a number (float64), or (name, type) or (name, type, shape) as numpy has them.

    >>> POINT = record_dtype("east", "north", ("leg", np.int64), ("velocity", np.float64, (3,)))
    >>> points = np.zeros(2, POINT)
    >>> points[1].north = 4.0
    >>> points["north"]
    array([0., 4.])
    >>> points[1].leg += 1
    >>> points[1].tolist()[:3]
    (0.0, 4.0, 1)
    """
    made = [(entry, np.float64) if isinstance(entry, str) else entry for entry in entries]
    dtype: Any = np.dtype((np.record, np.dtype(made, align=True)))
    return cast("np.dtype[np.record]", dtype)


def field_names(dtype: np.dtype[np.record]) -> tuple[str, ...]:
    """Names of a record's fields, in order.

    >>> field_names(record_dtype("east", "north"))
    ('east', 'north')
    """
    return dtype.names or ()
