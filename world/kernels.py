"""Numba kernels, compiled once per version of the sources.

Numba's own cache looks at the file a kernel stands in, not at the kernels and constants that it takes from other
files: after an edit or an upgrade of those it would go on running old code.  Here the cache lies in the user's
cache folder under a hash of all sources that kernels are made of, so that any change compiles anew.
"""

import hashlib
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from platformdirs import user_cache_dir

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_Result = TypeVar("_Result")
_ROOMS = ("aircraft", "world", "planner", "flight", "logs")


def _sources_hash() -> str:
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for room in _ROOMS:
        for file in sorted((root / room).rglob("*.py")):
            digest.update(str(file.relative_to(root)).encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


# Numba fills its settings in when it is imported, and states no types for them.  The folder is read when a kernel is
# decorated; one that the user has set stays.
_settings: Any = numba.config
if not _settings.CACHE_DIR:
    _settings.CACHE_DIR = str(Path(user_cache_dir("planfly")) / f"kernels-{_sources_hash()}")


def _load_array_functions() -> None:
    """Load numba's array functions without asking, as they do when loaded, whether SciPy's linear algebra is there.

    Numba needs them before it reads the first kernel from its cache.  That question costs a new process 0.15 s and has
    one answer: SciPy is a dependency.  Kernels that do call linear algebra ask again.
    """
    linalg: Any = importlib.import_module("numba.np.linalg")
    ask = getattr(linalg, "ensure_blas", None)
    if ask is None:  # another numba, which loads them in its own way
        return
    linalg.ensure_blas = lambda: None
    try:
        arraymath: Any = importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = ask
    arraymath.ensure_blas = ask


_load_array_functions()


def compiled(kernel: _Kernel) -> _Kernel:
    """Compile a function of numbers and arrays to machine code on first use, and keep it.

    A division by zero gives infinity or NaN, as in numpy: looking for it costs a tenth of the guidance's time.
    """
    return cast("_Kernel", numba.njit(cache=True, error_model="numpy")(kernel))


def inlined(kernel: _Kernel) -> _Kernel:
    """Do the same with a small function that is to be copied into those that call it in their inner loops.

    A call hands over seven numbers an array: more than many a kernel's own work.  It may make what `compiled_views`
    may.
    """
    njit: Any = numba.njit  # its types leave this option out
    return cast("_Kernel", njit(cache=True, error_model="numpy", forceinline=True, _nrt=False)(kernel))


def compiled_views(kernel: _Kernel) -> _Kernel:
    """Do the same with a function that makes no arrays but views of its arguments, and returns none.

    It does not count references to them, which takes longer than a hundred sums.
    """
    njit: Any = numba.njit  # its types leave this option out
    return cast("_Kernel", njit(cache=True, error_model="numpy", _nrt=False)(kernel))


def entry(kernel: Callable[..., _Result], *arguments: object) -> Callable[..., _Result]:
    """Give a kernel's machine code for arguments of these types, without the dispatcher that looks at every call's.

    It takes arguments of just these types, and checks none: for a loop that always passes the same arrays.
    """
    dispatcher: Any = kernel
    typeof: Any = numba.typeof
    signature = tuple(typeof(argument) for argument in arguments)
    dispatcher.compile(signature)
    return cast("Callable[..., _Result]", dispatcher.overloads[signature].entry_point)
