"""The commands by name.  A command's module is imported when the command is given, and no other's."""

import argparse
from collections.abc import Callable
from importlib import import_module

CommandFunction = Callable[[argparse.Namespace], int]

COMMAND_NAMES = (
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
    "campaign",
    "winds",
    "import",
    "refly",
    "scenarios",
    "help",
    "completion",
)
# Commands that share a module, or whose name is a keyword of Python: the module in this package, and the function.
_FUNCTIONS = {
    "import": ("imported_logs", "import_log"),
    "refly": ("imported_logs", "refly"),
    "help": ("shell", "show_help"),
    "completion": ("shell", "completion"),
    "scenarios": ("shell", "scenarios"),
}


def find_command(name: str) -> CommandFunction:
    """The function that carries a command out: parsed arguments to exit code.

    Its results go to standard output, its progress to standard error.  Raises KeyError for a name that is not
    one of `COMMAND_NAMES`.

    >>> find_command("scenarios").__module__
    'planfly.commands.shell'
    """
    if name not in COMMAND_NAMES:
        raise KeyError(name)
    module, function = _FUNCTIONS.get(name, (name, name))
    command: CommandFunction = getattr(import_module(f"planfly.commands.{module}"), function)
    return command
