"""The command line: arguments in, one line for an error, an exit code out.  Heavy imports wait for the command."""

import argparse
import sys
from collections.abc import Sequence

from planfly.terminal.exit_codes import BAD_INPUT, FAULT, INTERRUPTED
from planfly.terminal.parser import build_parser


def main(argv: Sequence[str] | None = None) -> int:
    """Carry one command out, and return its exit code.

    argv: without the program's name; None takes the process's.
    """
    args = build_parser().parse_args(argv)
    try:
        return _command(args)
    except OSError as error:
        return _fail(FAULT, f"{error.filename or 'file'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return _fail(INTERRUPTED, "interrupted")


def _command(args: argparse.Namespace) -> int:
    # Imported here: pydantic and numba take longer than --help may.
    from planfly.commands.registry import find_command
    from planfly.terminal.output import tolerate_closed_output
    from world.errors import PlanflyError

    try:
        with tolerate_closed_output():
            return find_command(args.command)(args)
    except PlanflyError as error:
        return _fail(BAD_INPUT, error)


def _fail(code: int, message: object) -> int:
    print(f"planfly: {' '.join(str(message).split())}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
