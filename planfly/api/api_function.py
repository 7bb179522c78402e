"""Decorate the functions of the public API: check their arguments, and compile the kernels that they need."""

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar, get_args, get_type_hints

from planfly.arguments import check_arguments
from planfly.flight_options import RANGED_OPTIONS, option_defaults
from planfly.runtime.first_start import compile_and_report
from world.argument_types import check_types
from world.compile_events import notify_before_compiling
from world.files import did_you_mean

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def api_function(*kernel_units: str) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """Return a decorator for a function of the API: its arguments are checked, and it runs inside `warm_up`.

    The options of an ``Unpack[...]`` parameter are listed in its signature, with their defaults.

    kernel_units: see `warm_up`.
    The function raises the ArgumentErrors of `world.argument_types.check_types` and `check_arguments`.

    >>> from typing import Unpack
    >>> from planfly.flight_options import MissionOptions
    >>> @api_function()
    ... def fly(mission: str, **options: Unpack[MissionOptions]) -> object:
    ...     return options["fence"], options["wind"]
    >>> fly("a.waypoints", wind=(8, 270))
    ((), (8, 270))
    >>> fly("a.waypoints", winds=(8, 270))
    Traceback (most recent call last):
    TypeError: fly() got an unexpected keyword argument 'winds': did you mean 'wind'?
    """

    def decorate(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        """Extend a function's signature by its options, and wrap the function."""
        signature, defaults = inspect.signature(function), dict[str, object]()
        *parameters, last = signature.parameters.values()
        if last.kind is last.VAR_KEYWORD:
            (options,) = get_args(last.annotation)
            defaults, annotations = option_defaults(options), get_type_hints(options)
            parameters += [
                inspect.Parameter(name, last.KEYWORD_ONLY, default=default, annotation=annotations[name])
                for name, default in defaults.items()
            ]
            signature = signature.replace(parameters=parameters)

        @functools.wraps(function)
        def checked_function(*args: _Parameters.args, **keywords: _Parameters.kwargs) -> _Result:
            """Check the arguments, add the defaults of missing options, and call the function inside `warm_up`."""
            for name in keywords if defaults else ():
                if name not in signature.parameters:
                    hint = did_you_mean(name, signature.parameters)
                    raise TypeError(f"{function.__name__}() got an unexpected keyword argument {name!r}{hint}")
            checked_args, checked_keywords = check_types(signature, args, keywords)
            all_keywords = {**defaults, **checked_keywords}
            check_arguments(**{name: all_keywords[name] for name in RANGED_OPTIONS if name in defaults})
            with warm_up(*kernel_units):
                return function(*checked_args, **all_keywords)

        checked_function.__signature__ = signature  # type: ignore[attr-defined]
        return checked_function

    return decorate


@contextmanager
def warm_up(*units: str) -> Iterator[None]:
    """Compile all kernels of the ``with`` block as soon as it calls a kernel that is not cached.

    The kernels are compiled in two processes before the code continues.
    units: units of `planfly.kernel_units` with these kernels, the unit that takes longest first.
    """
    has_compiled = False

    def compile_all() -> None:
        """Compile the units at the first call only."""
        nonlocal has_compiled
        if not has_compiled:
            has_compiled = True
            compile_and_report(units)

    with notify_before_compiling(compile_all):
        yield
