"""Extras: optional features of planfly and the modules that they need.

The help, the documentation and `pyproject.toml` are tested against this list.  A feature calls `require_extra`, or is
decorated with `requires_extra`, before it begins, so that a missing extra is reported in one line.
"""

import functools
from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple, ParamSpec, TypeVar

from world.errors import MissingExtraError

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Extra(NamedTuple):
    """Extra of planfly.

    name: name for pip.
    needs: beginning of the message about a missing extra, such as "campaigns need".
    purpose: features that the extra adds, for the documentation.
    modules: one module of each package that the extra installs.
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
            "`planfly serve`, `replay --to IP:PORT`, ArduPlane itself (`--sitl PATH`), `.tlog` files",
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
            "data-logs",
            "logs as columns need",
            "flight logs as CSV, MAT, Parquet and HDF5 files",
            ("h5py", "pandas", "pyarrow", "scipy"),
        ),
        Extra(
            "forecast",
            "a forecast as NetCDF needs",
            "`--forecast FILE.nc` and `planfly window`",
            ("h5netcdf", "pandas", "scipy", "xarray"),
        ),
        Extra(
            "grib",
            "a forecast as GRIB needs",
            "`--forecast FILE.grib2`",
            ("cfgrib", "eccodes", "pandas", "scipy", "xarray"),
        ),
        Extra(
            "identification",
            "identifying an aircraft needs",
            "`planfly aircraft --identify LOG`",
            ("scipy",),
        ),
    )
}


def require_extra(name: str, needs: str = "") -> None:
    """Raise MissingExtraError, in one line, if a module of an optional extra is not installed.

    name: name of the extra.
    needs: beginning of the line, which names the feature, such as ".parquet needs"; "" for the text of the extra.

    >>> require_extra("campaigns")
    >>> print(missing_extra(EXTRAS["tables"], "pandas", ".parquet needs"))
    .parquet needs the extra 'tables': pip install 'planfly[tables]'
    """
    extra = EXTRAS[name]
    for module in extra.modules:
        try:
            is_installed = find_spec(module) is not None
        except (ImportError, ValueError):
            is_installed = False
        if not is_installed:
            raise missing_extra(extra, module, needs)


def missing_extra(extra: Extra, module: str, needs: str = "") -> MissingExtraError:
    """Make the error about a missing module, with the command that installs its extra.

    needs: as for `require_extra`.
    """
    command = f"pip install 'planfly[{extra.name}]'"
    line = f"{needs or extra.needs} the extra '{extra.name}': {command}"
    error = MissingExtraError(line, field="extra", value=extra.name, allowed=command)
    error.name = module
    return error


def requires_extra(name: str, needs: str = "") -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Return a decorator that makes a function call `require_extra` first.

    The arguments are those of `require_extra`.
    """

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        """Return the function with the check before each call."""

        @functools.wraps(function)
        def call_checked(*args: Arguments.args, **keywords: Arguments.kwargs) -> Result:
            """Check that the extra is installed, and call the function."""
            require_extra(name, needs)
            return function(*args, **keywords)

        return call_checked

    return decorate
