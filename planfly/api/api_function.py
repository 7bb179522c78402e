"""Decorator for functions of the public API.

It checks their arguments, and compiles the kernels that they need.
"""

import functools
import inspect
from collections.abc import Callable
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
    """Return a decorator for a function of the API, which checks its arguments and compiles its kernels.

    All kernels are compiled, in two processes, as soon as the function calls a kernel that is not cached.
    The options of an ``Unpack[...]`` parameter are listed in its signature, with their defaults.

    kernel_units: units of `planfly.kernel_units` with the function's kernels, the unit that takes longest first.
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
        """Return the function with checks and compilation before each call.

        The options of the function are in its signature.
        """
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
        ranged_options = [name for name in RANGED_OPTIONS if name in defaults]

        @functools.wraps(function)
        def checked_function(*args: _Parameters.args, **keywords: _Parameters.kwargs) -> _Result:
            """Check the arguments, add the defaults of missing options, and call the function."""
            for name in keywords if defaults else ():
                if name not in signature.parameters:
                    hint = did_you_mean(name, signature.parameters)
                    raise TypeError(f"{function.__name__}() got an unexpected keyword argument {name!r}{hint}")
            checked_args, checked_keywords = check_types(signature, args, keywords)
            # Defaults need no check.
            if given := {name: checked_keywords[name] for name in ranged_options if name in checked_keywords}:
                check_arguments(**given)
            compile_kernels = functools.partial(compile_and_report, kernel_units)
            with notify_before_compiling(compile_kernels, once=True):
                return function(*checked_args, **{**defaults, **checked_keywords})

        checked_function.__signature__ = signature  # type: ignore[attr-defined]
        return checked_function

    return decorate
