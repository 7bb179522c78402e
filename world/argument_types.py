"""Check the types of arguments of API functions, and convert their numbers to plain Python numbers."""

import functools
import inspect
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import is_dataclass
from numbers import Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin

from world.errors import ArgumentError

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def checks_types(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Decorate an API function so that wrong argument types raise an ArgumentError.

    The error is that of `check_types`.

    The function has no options; for a function with options use `planfly.api.api_function.api_function`.

    >>> @checks_types
    ... def read(log: str | Path) -> None: ...
    >>> read(7)
    Traceback (most recent call last):
    world.errors.ArgumentError: log int: expected text or a path
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def with_check(*args: _Parameters.args, **keywords: _Parameters.kwargs) -> _Result:
        """Call the function with checked arguments."""
        checked_args, checked_keywords = check_types(signature, args, keywords)
        return function(*checked_args, **checked_keywords)

    return with_check


def check_types(
    signature: inspect.Signature, args: tuple[Any, ...], keywords: dict[str, Any]
) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Check the types of a call's arguments, and return the arguments with plain Python numbers.

    Numbers of numpy, and whole numbers such as 2.0 where integers are expected, are converted. Raises ArgumentError for
    the first argument of a wrong type. Only arguments that may be a text, path, list, function or data class are
    checked; the called function itself checks its numbers.

    signature: signature of the called function.
    args, keywords: arguments of the call.

    >>> def plan(scenario: str, *, seed: int | None = None) -> None: ...
    >>> check_types(inspect.signature(plan), ("tight",), {"seed": 2.0})
    (('tight',), {'seed': 2})
    """
    try:
        bound = signature.bind_partial(*args, **keywords)
    except TypeError:
        # With unknown or too many arguments the call raises a TypeError that names the function.
        return args, keywords
    for name, argument in bound.arguments.items():
        parameter = signature.parameters[name]
        for value in argument if parameter.kind is parameter.VAR_POSITIONAL else (argument,):
            if (expected := _expected_type(value, parameter.annotation)) is not None:
                raise ArgumentError.of_argument(name, value, f"expected {expected}", shown=type(value).__name__)
        if isinstance(argument, Real) and not isinstance(argument, int):
            # A number that is not whole is unchanged if only integers are allowed.
            members = get_args(parameter.annotation) or (parameter.annotation,)
            takes_integers = int in members or all(isinstance(member, int) for member in members)
            if float in members:
                bound.arguments[name] = float(argument)
            elif takes_integers and float(argument).is_integer():
                bound.arguments[name] = int(float(argument))
    return bound.args, bound.kwargs


def _expected_type(value: Any, annotation: Any) -> str | None:
    """Return None if a value fits an annotation, otherwise a text that names the allowed types.

    Also returns None for an annotation that is not checked here, such as float.
    """
    classes, item_classes = _allowed_classes(annotation)
    if classes:
        is_sequence = bool(item_classes) and isinstance(value, Sequence) and not isinstance(value, str | bytes)
        if isinstance(value, classes) or (is_sequence and all(isinstance(item, item_classes) for item in value)):
            return None
        # Such as "a Plan, text or a path", with the remedy for a scenario where only a plan is allowed.
        words: dict[type, str] = {str: "text", Path: "a path"}
        names = [words.get(cls, f"a {cls.__name__}") for cls in classes if cls not in (NoneType, os.PathLike)]
        names += ["a list of these"] if item_classes else []
        text = " or ".join([*([", ".join(names[:-1])] if names[1:] else []), names[-1]])
        if type(value).__name__ == "Scenario" and "Plan" in {allowed.__name__ for allowed in classes}:
            text += "; planfly.plan makes a plan of a scenario, and planfly.plan_then_fly flies it"
        return text
    if isinstance(annotation, type) and is_dataclass(annotation):
        return None if isinstance(value, annotation) else f"a {annotation.__name__}"
    members = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    kinds = {get_origin(member) for member in members if member is not NoneType}
    if value is None and NoneType in members:
        return None
    if kinds == {Callable}:
        return None if callable(value) else "a function"
    # The functions themselves check positions and boxes, which are sequences of numbers.
    if kinds == {Sequence} and float not in get_args(members[0]):
        return None if isinstance(value, Iterable) and not isinstance(value, str | bytes) else "a list"
    return None


@functools.cache
def _allowed_classes(annotation: Any) -> tuple[tuple[type, ...], tuple[type, ...]]:
    """Return two tuples: the classes that an annotation allows, and the classes in an allowed sequence.

    Both are empty for an annotation that allows neither a text nor a path.

    >>> _allowed_classes(str | None), _allowed_classes(float | None)
    (((<class 'str'>, <class 'NoneType'>), ()), ((), ()))
    >>> [allowed.__name__ for allowed in _allowed_classes(Path | str)[0]]
    ['str', 'Path', 'PathLike']
    """
    members = get_args(annotation) or (annotation,)
    sequences = [member for member in members if get_origin(member) is Sequence]
    classes = tuple(member for member in members if isinstance(member, type) and member not in sequences)
    # The cache does not distinguish `str | Path` from `Path | str`.
    classes = tuple(sorted(classes, key=lambda cls: (cls is NoneType, cls is Path, cls is str, cls.__name__)))
    if get_origin(annotation) is Sequence or len(classes) + len(sequences) != len(members) or str not in classes:
        return (), ()
    item_classes = _allowed_classes(get_args(sequences[0])[0])[0] if sequences else ()
    return (*classes, *((os.PathLike,) if Path in classes else ())), item_classes
