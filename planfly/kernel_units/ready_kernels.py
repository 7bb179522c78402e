"""A unit done, and told meanwhile which of its kernels are ready."""

from collections.abc import Callable
from importlib import import_module

from planfly.kernel_units.unit_kernels import UNIT_KERNELS
from planfly.kernel_units.units import UNITS
from world.compilation.announcement import tell_before_compiling


def do_unit(unit: str, tell: Callable[[str], None]) -> None:
    """Do a unit of work; tell ``ready KERNEL`` for each of its kernels, as soon as the next is being compiled.

    Raises KeyError for a name that is no unit's.
    """
    waiting = list(UNIT_KERNELS[unit])

    def tell_ready() -> None:
        for name in [one for one in waiting if is_ready(one)]:
            waiting.remove(name)
            tell(f"ready {name}")

    with tell_before_compiling(tell_ready):
        UNITS[unit]()
    tell_ready()


def is_ready(kernel: str) -> bool:
    """Whether a kernel, "module.name", has been compiled, or loaded from the cache, in this process.

    >>> is_ready("world.terrain.steepest_slopes") in (True, False)
    True
    """
    module, _, name = kernel.rpartition(".")
    # As numba documents its dispatchers: the argument types that they are compiled for.
    return bool(getattr(import_module(module), name).signatures)
