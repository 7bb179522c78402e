"""Extras: what planfly does only where more is installed than its base, and which modules that takes.

One list, which the help, the documentation and `pyproject.toml` are tested against.  A feature calls `need_extra`, or
is decorated with `needs_extra`, before it begins, so that an extra which is missing is said in one line.
"""

import functools
from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple, ParamSpec, TypeVar

from world.errors import MissingExtraError

Given = ParamSpec("Given")
Made = TypeVar("Made")


class Extra(NamedTuple):
    """An extra.

    name: as pip takes it.
    needs: who needs it, as a sentence begins.
    purpose: what it adds, for the documentation.
    modules: that are imported, one of each package that it installs.
    """

    name: str
    needs: str
    purpose: str
    modules: tuple[str, ...]


EXTRAS = {
    extra.name: extra
    for extra in (
        Extra(
            "campaigns",
            "campaigns need",
            "`planfly campaign` and `planfly winds`",
            ("scipy",),
        ),
        Extra("cluster", "a cluster needs", "`--scheduler` of `campaign` and `winds`", ("dask", "distributed")),
        Extra(
            "live",
            "MAVLink needs",
            "`planfly serve`, `replay --to IP:PORT`, ArduPlane itself (`--autopilot PATH`), `.tlog` files",
            ("pymavlink",),
        ),
        Extra("studio", "the studio needs", "`planfly studio`", ("starlette", "uvicorn", "websockets")),
        Extra("foxglove", "Foxglove needs", "`replay --foxglove`", ("cryptography", "foxglove")),
        Extra("films", "an .mp4 needs", "`replay --movie FILE.mp4` where ffmpeg is not installed", ("imageio_ffmpeg",)),
        Extra(
            "tables",
            "tables need",
            "data frames (`to_pandas`), Parquet (`export FILE.parquet`, `to_parquet`)",
            ("pandas", "pyarrow"),
        ),
        Extra("px4-logs", "logs of PX4 need", "reading `.ulg` files", ("pyulog",)),
        Extra(
            "identification",
            "identifying an aircraft needs",
            "`planfly aircraft --identify LOG`",
            ("scipy",),
        ),
    )
}


def need_extra(name: str, needs: str = "") -> None:
    """Raise MissingExtraError, in one line, where a module of an extra is not installed.

    needs: who needs it, as the line begins; the extra's own words unless stated.

    >>> need_extra("campaigns")
    >>> print(missing_extra(EXTRAS["tables"], "pandas", ".parquet needs"))
    .parquet needs the extra 'tables': pip install 'planfly[tables]'
    """
    extra = EXTRAS[name]
    for module in extra.modules:
        if not _is_there(module):
            raise missing_extra(extra, module, needs)


def _is_there(module: str) -> bool:
    """Whether a module can be imported; it is not."""
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def missing_extra(extra: Extra, module: str, needs: str = "") -> MissingExtraError:
    """The error of a module that is not there."""
    command = f"pip install 'planfly[{extra.name}]'"
    line = f"{needs or extra.needs} the extra '{extra.name}': {command}"
    error = MissingExtraError(line, field="extra", value=extra.name, allowed=command)
    error.name = module
    return error


def needs_extra(name: str, needs: str = "") -> Callable[[Callable[Given, Made]], Callable[Given, Made]]:
    """Have a function call `need_extra` before it does anything else."""

    def decorated(function: Callable[Given, Made]) -> Callable[Given, Made]:
        @functools.wraps(function)
        def checked(*args: Given.args, **keywords: Given.kwargs) -> Made:
            need_extra(name, needs)
            return function(*args, **keywords)

        return checked

    return decorated
