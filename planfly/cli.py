"""Run a command of the command line, print an error in one line, and return the exit code.

Heavy imports are left to the commands.
"""

import errno
import os
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from planfly._version import __version__
from planfly.commands.registry import COMMANDS, COMMANDS_BY_NAME
from planfly.runtime.process_setup import prepare_process, with_large_stack
from planfly.terminal.arguments import COMPLETION_VARIABLE, complete_for_shell
from planfly.terminal.command_parser import CommandParser, LineParser, UsageExit, colour_text, error_text
from planfly.terminal.exit_codes import BAD_INPUT, FAULT, INTERRUPTED
from planfly.terminal.output import (
    open_standard_streams,
    printable,
    redirect_output,
    safe_streams,
    write_error_if_requested,
    write_usage_error_if_requested,
)
from planfly.terminal.signal_watch import end_on_signals, end_process
from world.errors import CrashError, PlanflyError
from world.interruption import Interrupted

# First steps, at the end of the help.
_FIRST_STEPS = """\
first steps:
  planfly run jacksboro                        plan, fly, judge and report the demo
  planfly fly mission.waypoints --terrain DEM  fly a mission of your own over your elevation file
  planfly help fly                             everything about one command"""

# Errors of the machine: too many open files in the process or the system, not enough memory, and disk errors.
_MACHINE_ERRORS = (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EIO)


# Errors that end a command with one line: bad input, errors of the machine, and interruptions.
_REPORTED_ERRORS = (PlanflyError, OSError, MemoryError, KeyboardInterrupt)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, and return its exit code.

    argv: arguments without the program's name; None for the arguments of the process.  With None this function does not
    return: the process ends with the exit code of the command, or after SIGINT or SIGTERM.

    Bad input, errors of the machine and interruptions are reported in one line.  Errors are also written to the files
    of --json and --junit, so that files of an earlier run are not mistaken for this run's.
    """
    if argv is None:
        _run_as_process(lambda: main(sys.argv[1:]))
    command_parser = None
    try:
        with safe_streams():
            parser = build_parser()
            try:
                args = parser.parse_args(argv)
            except UsageExit as usage:
                write_usage_error_if_requested(argv, usage.line, parser.commands)
                raise
            command_parser = parser.commands[args.command]
            with redirect_output(args):
                try:
                    return COMMANDS_BY_NAME[args.command].run(args)
                except _REPORTED_ERRORS as error:
                    write_error_if_requested(args, *_exit_code_and_text(error, command_parser))
                    raise
                except Exception as error:
                    # An error of planfly itself; Python prints its traceback and ends with exit code 1.
                    write_error_if_requested(args, FAULT, f"internal error: {type(error).__name__}: {error}")
                    raise
    except _REPORTED_ERRORS as error:
        return _report_error(*_exit_code_and_text(error, command_parser))


def _run_as_process(run: Callable[[], int]) -> NoReturn:
    """Set up this process, run a command, and end the process with the command's exit code, or after a signal."""
    prepare_process()
    open_standard_streams()
    if COMPLETION_VARIABLE in os.environ:
        complete_for_shell(build_parser())
    with end_on_signals() as received_signals:
        try:
            code = with_large_stack(run)
        except Exception:
            if not received_signals:
                raise
            # An interrupted compiler may fail with any error.
            code = _report_error(128 + received_signals[0], "interrupted")
    # End the process directly, because the shutdown of an interpreter with compiled code takes up to a second.
    end_process(code)


def build_parser() -> LineParser:
    """Return the parser for the whole command line."""
    parser = LineParser(
        __version__,
        "Will this plan really fly?  Plans a fixed-wing path over terrain and threats,\n"
        "flies it (or any mission file) in JSBSim, and gives a verdict with numbers.",
        _FIRST_STEPS,
    )
    for command in COMMANDS:
        parser.start_section(command.section)
        command.add_parser(parser)
    return parser


def _exit_code_and_text(error: BaseException, parser: CommandParser | None = None) -> tuple[int, str]:
    """Return the exit code and the line of one of `_REPORTED_ERRORS`.

    parser: parser of the command, whose options replace keywords in the text of a PlanflyError.
    """
    if isinstance(error, PlanflyError):
        # Errors of the machine are, for example, too many open files or a disk error.
        cause = error.__cause__
        is_machine_error = isinstance(cause, OSError) and cause.errno in _MACHINE_ERRORS
        code = FAULT if isinstance(error, CrashError) or is_machine_error else BAD_INPUT
        return code, str(error) if parser is None else error_text(error, parser)
    if isinstance(error, OSError):
        return FAULT, f"{error.filename or 'file'}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        text = str(error)
        return FAULT, f"not enough memory: {text}" if text and "bad_alloc" not in text else "not enough memory"
    return 128 + error.number if isinstance(error, Interrupted) else INTERRUPTED, "interrupted"


def _report_error(code: int, message: object) -> int:
    """Print an error in one line on standard error, and return the exit code."""
    print(colour_text(f"planfly: {printable(str(message))}", "bad", sys.stderr), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
