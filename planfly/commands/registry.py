"""The commands by name.  A command's module is imported when the command is given, and no other's."""

import argparse
from collections.abc import Callable
from importlib import import_module

Command = Callable[[argparse.Namespace], int]

COMMANDS = (
    "run",
    "plan",
    "export",
    "fly",
    "check",
    "aircraft",
    "serve",
    "replay",
    "recover",
    "report",
    "compare",
    "paper",
    "scenarios",
)


def find_command(name: str) -> Command:
    """The function that carries a command out: parsed arguments to exit code.

    Its results go to standard output, its progress to standard error.  Raises KeyError for a name not of `COMMANDS`.

    >>> find_command("scenarios").__module__
    'planfly.commands.scenarios'
    """
    if name not in COMMANDS:
        raise KeyError(name)
    command: Command = getattr(import_module(f"planfly.commands.{name}"), name)
    return command
