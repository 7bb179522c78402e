"""The command line: arguments in, one line for an error, an exit code out.  Heavy imports wait for the command."""

import argparse
import os
import sys
from collections.abc import Sequence

from planfly.terminal.arguments import ASKS_COMPLETION, answer_shell
from planfly.terminal.command_parser import coloured
from planfly.terminal.exit_codes import BAD_INPUT, FAULT, INTERRUPTED
from planfly.terminal.output import open_standard_streams, printable, tolerate_closed_output
from planfly.terminal.parser import build_parser
from planfly.terminal.signal_watch import end_process, ended_by_signals
from world.interruption import Interrupted


def main(argv: Sequence[str] | None = None) -> int:
    """Carry one command out, and return its exit code.

    argv: without the program's name; None takes the process's, which SIGINT and SIGTERM then end in time.
    """
    if argv is not None:
        return _outcome(argv)
    open_standard_streams()
    if ASKS_COMPLETION in os.environ:
        answer_shell(build_parser())
    with ended_by_signals() as heard:
        try:
            code = _outcome(argv)
        except Exception:
            if not heard:
                raise
            # A compiler that is interrupted fails in ways of its own.
            code = _fail(128 + heard[0], "interrupted")
    if heard:
        # Taking an interpreter with compiled code down takes a second.
        end_process(code)
    return code


def _outcome(argv: Sequence[str] | None) -> int:
    try:
        return _command(build_parser().parse_args(argv))
    except OSError as error:
        return _fail(FAULT, f"{error.filename or 'file'}: {error.strerror or error}")
    except Interrupted as interrupted:
        return _fail(128 + interrupted.number, "interrupted")
    except KeyboardInterrupt:
        return _fail(INTERRUPTED, "interrupted")


def _command(args: argparse.Namespace) -> int:
    # Imported here: pydantic and numba take longer than --help may.
    from planfly.commands.registry import find_command
    from planfly.first_start import warm_up
    from planfly.kernel_units.unit_kernels import COMMAND_UNITS
    from planfly.terminal.answers.giving import asked_output
    from world.errors import PlanflyError

    try:
        kernels = warm_up(*COMMAND_UNITS.get(args.command, ()))
        with tolerate_closed_output(), asked_output(args), kernels:
            return find_command(args.command)(args)
    except PlanflyError as error:
        return _fail(BAD_INPUT, error)


def _fail(code: int, message: object) -> int:
    print(coloured(f"planfly: {printable(str(message))}", "bad", sys.stderr), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
