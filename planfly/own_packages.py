"""Detect modules of other projects that hide planfly's top-level packages."""

import contextlib
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("aircraft", "flight", "logs", "planner", "world")
# Exit code of the command line for bad usage.
_BAD_USAGE_CODE = 2


class HiddenPackage(NamedTuple):
    """Package of planfly that another module hides.

    hiding_file: file of the other module.
    package_file: file of the package.
    """

    hiding_file: str
    package_file: str


def find_hidden_package(home: Path) -> HiddenPackage | None:
    """Find a module that Python would import in place of a package of planfly, without importing it.

    Return None if no module hides a package.

    home: the folder that contains planfly and its packages.

    >>> find_hidden_package(Path(__file__).parents[1]) is None
    True
    >>> find_hidden_package(Path("/elsewhere")).package_file
    '/elsewhere/aircraft/__init__.py'
    """
    for name in PACKAGES:
        if name in sys.modules:
            file = getattr(sys.modules[name], "__file__", None)
        else:
            spec = find_spec(name)
            file = None if spec is None else spec.origin
        package_file = home / name / "__init__.py"
        if file is None or file == str(package_file):
            continue
        # Another path may name the same file.
        with contextlib.suppress(OSError):
            if package_file.samefile(file):
                continue
        return HiddenPackage(file, str(package_file))
    return None


def check_hidden_packages() -> None:
    """Raise ImportError, with a one-line message, if a file hides a package of planfly.

    The command line prints this line and ends with exit code 2.

    >>> check_hidden_packages()
    """
    hidden = find_hidden_package(Path(__file__).parents[1])
    if hidden is None:
        return
    message = (
        f"{hidden.hiding_file}: hides {hidden.package_file}, a package of planfly: rename it, or remove its folder from"
        " Python's path (python -P leaves out the current folder)"
    )
    # While Python looks for the module, argv[0] is "-m"; an embedded interpreter may have no arguments.
    program = next(iter(getattr(sys, "argv", ())), "")
    if Path(program).stem == "planfly" or (program == "-m" and "planfly" in sys.orig_argv):
        sys.stderr.write(f"planfly: {message}\n")
        raise SystemExit(_BAD_USAGE_CODE)
    raise ImportError(message, name="planfly", path=hidden.hiding_file)
