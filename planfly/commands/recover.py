"""``planfly recover``: write the readable part of an unfinished or damaged log as a new log."""

import argparse
from pathlib import Path

from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, LineParser
from planfly.terminal.options import add_log_argument, add_result_options
from planfly.terminal.output import warn_about_incomplete_log, write_json_if_requested
from world.wording import count_text


def add_recover_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly recover``."""
    parser = command_line.add_command(
        "recover",
        "write the readable part of an unfinished or damaged log as a new log",
        "planfly recover flight.mcap --out recovered.mcap",
    )
    add_log_argument(parser)
    add_result_options(parser, "the new log (default: <log>-recovered.mcap next to the log)", "FILE")


def recover(args: argparse.Namespace) -> int:
    """Write the readable part of a log as a new log, and return 3.

    For a complete log, write nothing and return 0.
    """
    from planfly.api import imported

    source = Path(args.log)
    target = Path(args.out) if args.out else source.with_name(f"{source.stem}-recovered.mcap")
    log = imported.recover(**args.options | {"out": target})
    if log is None:
        print(f"{source}: complete: there is nothing to recover, and nothing was written")
        write_json_if_requested(args, lambda: _json_answer(target=None, rows=None, end_time=None))
        return FLYABLE
    print(f"log       {target} ({count_text(len(log.track), 'row')}, to {log.end_time:.1f} s)")
    warn_about_incomplete_log(log)
    write_json_if_requested(args, lambda: _json_answer(target, len(log.track), log.end_time))
    return INCOMPLETE


def _json_answer(target: Path | None, rows: int | None, end_time: float | None) -> object:
    """Return the answer of ``planfly recover`` for --json."""
    from planfly.terminal.answers import RecoverAnswer

    code = FLYABLE if target is None else INCOMPLETE
    return RecoverAnswer(exit_code=code, log=None if target is None else str(target), rows=rows, end_s=end_time)
