"""When a kernel's compiled code still holds: as long as all that it was compiled of is the same.

Numba looks at the time stamp of the file that a kernel stands in.  It misses what the kernel takes from other files,
and compiles anew after an edit that changes no kernel.  Here a kernel's stamp is made of the kernel and of all kernels
that it calls, directly or not: their bytecode, and the values of the constants that are compiled into them, wherever
these were defined.  Comments, docstrings and all other files may change.
"""

import functools
import hashlib
import inspect
from enum import Enum
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numpy as np
from numba.core.caching import IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

# They decide what numba makes of a kernel.
_MAKERS = ("by_reference.py", "kernels.py")


def keep_by_contents(kernel: Any) -> None:
    """Have numba's cache of a compiled function go by what the function is made of, not by its file's time.

    kernel: a dispatcher with a cache.
    """
    cache = kernel._cache
    cache._cache_file = _Index(cache._cache_path, cache._impl.filename_base, kernel)


class _Index(IndexDataCacheFile):
    """The index of a kernel's compiled versions, with a stamp that is made when it is first asked for.

    A kernel is decorated before what it calls and takes from its module need be there.
    """

    def __init__(self, path: str, name: str, kernel: Any) -> None:
        super().__init__(cache_path=path, filename_base=name, source_stamp=None)
        self._kernel = kernel

    @property
    def _source_stamp(self) -> str:
        return stamp(self._kernel)

    @_source_stamp.setter
    def _source_stamp(self, _: None) -> None:
        """Numba's own stamp is not kept."""


def stamp(kernel: Any) -> str:
    """A hash of a compiled function, of all that it calls and of the constants in them.

    >>> from world.geometry import wrap
    >>> stamp(wrap) == stamp(wrap)
    True
    """
    digest = hashlib.sha256(_makers())
    for name, contents in sorted((name, _digest(function)) for name, function in _reached(kernel).items()):
        digest.update(f"{name} ".encode() + contents)
    return digest.hexdigest()


@functools.cache
def _makers() -> bytes:
    files = [Path(__file__).with_name(name).read_bytes() for name in _MAKERS]
    return hashlib.sha256(b"".join([llvmlite.__version__.encode(), *files])).digest()


def _reached(kernel: Any) -> dict[str, Any]:
    """All functions that are compiled with one, and itself, by where they stand."""
    found: dict[str, Any] = {}
    waiting = [kernel]
    while waiting:
        function = waiting.pop()
        name = f"{function.__module__}.{function.__qualname__}"
        if name not in found:
            found[name] = function
            waiting += _called(function)
    return found


@functools.cache
def _called(function: Any) -> tuple[Any, ...]:
    return tuple(value for value in _taken(function).values() if _is_function(value))


def _is_function(value: Any) -> bool:
    return isinstance(value, Dispatcher | FunctionType)


@functools.cache
def _digest(function: Any) -> bytes:
    plain = getattr(function, "py_func", function)
    options = getattr(function, "targetoptions", {})
    parts = [repr(sorted(options.items())), *_code_parts(plain.__code__, plain.__doc__), repr(plain.__defaults__)]
    parts += [f"{name}={_frozen(value)}" for name, value in sorted(_taken(function).items())]
    return hashlib.sha256("\n".join(parts).encode()).digest()


def _taken(function: Any) -> dict[str, Any]:
    """What a function takes from its module and from those around it, by name."""
    plain = getattr(function, "py_func", function)
    taken = dict(inspect.getclosurevars(plain).nonlocals)
    for code in _codes(plain.__code__):
        for name in code.co_names:
            if name in plain.__globals__:
                taken[name] = plain.__globals__[name]
    # A constant of another module, as `geometry.GRAVITY`.
    for module in [value for value in taken.values() if isinstance(value, ModuleType) and not _is_library(value)]:
        for code in _codes(plain.__code__):
            members = {name: getattr(module, name) for name in code.co_names if hasattr(module, name)}
            taken |= {f"{module.__name__}.{name}": value for name, value in members.items()}
    return taken


def _is_library(module: ModuleType) -> bool:
    return module.__name__.partition(".")[0] in ("math", "numpy", "numba")


def _codes(code: CodeType) -> list[CodeType]:
    inner = [one for constant in code.co_consts if isinstance(constant, CodeType) for one in _codes(constant)]
    return [code, *inner]


def _code_parts(code: CodeType, doc: str | None) -> list[str]:
    """What is compiled of a function's code: all but where its lines stand, and its docstring."""
    constants = [one for one in code.co_consts if not isinstance(one, CodeType)]
    if doc is not None and constants and isinstance(constants[0], str):
        constants = constants[1:]
    own = [code.co_code.hex(), repr(constants), repr(code.co_names), repr(code.co_varnames)]
    return own + [part for one in _codes(code)[1:] for part in _code_parts(one, None)]


def _frozen(value: Any) -> str:
    """A constant's text, the same in every process."""
    if _is_function(value):
        return f"function {value.__module__}.{value.__qualname__}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype!r} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, type) and issubclass(value, Enum):
        return repr([(member.name, member.value) for member in value])
    if isinstance(value, type) and hasattr(value, "_fields"):
        return f"{value.__module__}.{value.__qualname__} {value._fields}"
    if isinstance(value, type | ModuleType) or callable(value):
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', getattr(value, '__name__', ''))}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_frozen, value))})"
    if isinstance(value, np.dtype | np.generic | int | float | complex | str | bytes | None):
        return repr(value)
    raise TypeError(f"a kernel takes {value!r}, which has no text that says all of it")
