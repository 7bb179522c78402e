"""``planfly completion``: the script by which a shell completes."""

import argparse

from planfly.terminal.completion import shell_script
from planfly.terminal.exit_codes import FLYABLE


def completion(args: argparse.Namespace) -> int:
    """Print the script of a shell."""
    print(shell_script(args.shell))
    return FLYABLE
