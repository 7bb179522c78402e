"""Check the types of arguments that may be a text or a path, for functions of the API."""

import contextlib
import functools
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, ParamSpec, TypeVar, get_args, get_origin

from world.errors import ArgumentError

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def checks_types(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Decorate a function of the API without options: it raises the ArgumentError of `check_types`.

    `takes_options` of planfly does the same for a function with options.

    >>> @checks_types
    ... def read(log: str | Path) -> None: ...
    >>> read(7)
    Traceback (most recent call last):
    world.errors.ArgumentError: log int: expected text or a path
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def with_check(*args: _Parameters.args, **keywords: _Parameters.kwargs) -> _Result:
        check_types(signature, args, keywords)
        return function(*args, **keywords)

    return with_check


def check_types(signature: inspect.Signature, args: Sequence[Any], keywords: Mapping[str, Any]) -> None:
    """Raise ArgumentError for the first argument that may be a text or a path, and is of no type that is allowed.

    Other arguments are numbers, words or data, which the called functions check.
    signature: signature of the called function.  args, keywords: arguments of the call.
    """
    arguments: Mapping[str, Any] = {}
    # A call with unknown or too many arguments then raises a TypeError that names the function.
    with contextlib.suppress(TypeError):
        arguments = signature.bind_partial(*args, **keywords).arguments
    for name, argument in arguments.items():
        parameter = signature.parameters[name]
        classes, item_classes = _allowed_classes(parameter.annotation)
        for value in argument if parameter.kind is parameter.VAR_POSITIONAL else (argument,):
            if classes and not isinstance(value, classes) and not _is_sequence_of(value, item_classes):
                allowed = f"expected {_classes_text(classes, item_classes)}"
                raise ArgumentError.of_argument(name, value, allowed, shown=type(value).__name__)


def _is_sequence_of(value: Any, classes: tuple[type, ...]) -> bool:
    """Return True if a value is a sequence of instances of some classes; text and bytes are none."""
    is_sequence = isinstance(value, Sequence) and not isinstance(value, str | bytes)
    return bool(classes) and is_sequence and all(isinstance(item, classes) for item in value)


@functools.cache
def _allowed_classes(annotation: Any) -> tuple[tuple[type, ...], tuple[type, ...]]:
    """Return the classes of an annotation that allows a text or a path, and the classes in a sequence that it allows.

    Both are empty for other annotations.

    >>> _allowed_classes(str | None), _allowed_classes(float | None)
    (((<class 'str'>, <class 'NoneType'>), ()), ((), ()))
    >>> [one.__name__ for one in _allowed_classes(Path | str)[0]]
    ['str', 'Path', 'PathLike']
    """
    members = get_args(annotation) or (annotation,)
    sequences = [member for member in members if get_origin(member) is Sequence]
    classes = tuple(member for member in members if isinstance(member, type) and member not in sequences)
    # The cache does not distinguish `str | Path` from `Path | str`.
    classes = tuple(sorted(classes, key=lambda one: (one is NoneType, one is Path, one is str, one.__name__)))
    if get_origin(annotation) is Sequence or len(classes) + len(sequences) != len(members) or str not in classes:
        return (), ()
    item_classes = _allowed_classes(get_args(sequences[0])[0])[0] if sequences else ()
    return (*classes, *((os.PathLike,) if Path in classes else ())), item_classes


def _classes_text(classes: Sequence[type], item_classes: Sequence[type]) -> str:
    """Return the names of classes for a message, such as "a Plan, text or a path"."""
    words: dict[type, str] = {str: "text", Path: "a path"}
    names = [words.get(one, f"a {one.__name__}") for one in classes if one not in (NoneType, os.PathLike)]
    names += ["a list of these"] if item_classes else []
    return " or ".join([*([", ".join(names[:-1])] if names[1:] else []), names[-1]])
