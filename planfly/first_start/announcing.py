"""Before the first kernel is compiled it is said, and the kernels that the work needs are compiled side by side."""

import functools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

from planfly.first_start.sharing import compile_units
from planfly.kernel_units.unit_kernels import kernels_of
from planfly.terminal.progress import progress, say
from world.compilation.announcement import tell_before_compiling

_Taken = ParamSpec("_Taken")
_Given = TypeVar("_Given")

TITLE = "compiling the numeric kernels, once"
# Units that this process has had compiled, or tried to.
_shared: set[str] = set()


@contextmanager
def announced_kernels(*units: str) -> Iterator[None]:
    """Say once what is compiled meanwhile, before it begins; where all is in the cache this costs nothing.

    units: of `planfly.kernel_units`, longest first: what the work will call.  They are compiled in two processes, and
    counted, before the work goes on; where the cache cannot be written they are compiled as they are called.
    """
    said = False

    def tell() -> None:
        nonlocal said
        if not said:
            said = True
            _say_and_share([unit for unit in units if unit not in _shared])
            _shared.update(units)

    with tell_before_compiling(tell):
        yield


def announcing(*units: str) -> Callable[[Callable[_Taken, _Given]], Callable[_Taken, _Given]]:
    """Run a function of the public API under `announced_kernels`."""

    def decorate(verb: Callable[_Taken, _Given]) -> Callable[_Taken, _Given]:
        @functools.wraps(verb)
        def announced(*args: _Taken.args, **kwargs: _Taken.kwargs) -> _Given:
            with announced_kernels(*units):
                return verb(*args, **kwargs)

        return announced

    return decorate


def _say_and_share(units: list[str]) -> None:
    # Whoever compiles has imported it.
    from world.kernels import cache_folder

    folder = cache_folder()
    if not _can_write(folder):
        say(f"compiling the numeric kernels: {folder} cannot be written, and keeps none of them")
        return
    if not units or not sys.executable:
        say(f"{TITLE} ...")
        return
    whole = len(kernels_of(tuple(units)))
    with progress(TITLE) as advance:
        advance(0, whole, f"0 of {whole}")
        compile_units(units, folder, lambda done: advance(done, whole, f"{done} of {whole}"))


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
