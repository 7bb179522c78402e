"""``planfly report``: write figures and report.html from a log, or the layout file for Foxglove."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.terminal.arguments import file_completer, with_completer
from planfly.terminal.command_parser import BAD_INPUT, FLYABLE, INCOMPLETE, NOT_FLYABLE, LineParser, verdict_code
from planfly.terminal.options import add_result_options
from planfly.terminal.output import warn_about_incomplete_log, write_json_if_requested
from world.errors import PlanflyError

if TYPE_CHECKING:
    from planfly import Verdict


def add_report_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly report``."""
    parser = command_line.add_command(
        "report",
        "write report.html, map.png and profile.png from a log, or write the layout for Foxglove",
        "planfly report flight.mcap --out report --pictures",
    )
    with_completer(
        parser.add_argument("log", metavar="LOG.mcap", nargs="?", help="a flight log"), file_completer("mcap")
    )
    parser.add_argument("--pictures", action="store_true", help="write every figure of the page as PNG")
    parser.add_argument("--svg", action="store_true", help="also write the same figures as SVG")
    parser.add_argument("--layout", metavar="FILE", help="write only the layout file for Foxglove")
    add_result_options(
        parser, "folder for the files (default: <log>-report next to the log; an existing one is replaced)"
    )


def report(args: argparse.Namespace) -> int:
    """Write the report or, with --layout, the layout for Foxglove.

    Returns the exit code of the verdict, or 3 for an incomplete log; with --layout 0, and 2 with neither a log nor
    --layout.
    """
    from logs.recording.reader import read_log
    from planfly.api import reporting

    if args.layout:
        if args.log is not None:
            message = f"{args.log}: --layout writes only the layout; name no log with it"
            raise PlanflyError(message, file=args.log, field="--layout", value=args.layout)
        layout = reporting.foxglove_layout(args.layout, overwrite=args.overwrite)
        print(f"layout    {layout}")
        write_json_if_requested(args, lambda: _json_answer([layout], verdict=None, code=FLYABLE))
        return FLYABLE
    if args.log is None:
        print("planfly report: expected a log, or --layout FILE (see planfly report --help)", file=sys.stderr)
        return BAD_INPUT
    source = Path(args.log)
    log = read_log(source)
    result = reporting.report(
        log,
        args.out or source.with_name(f"{source.stem}-report"),
        pictures=args.pictures,
        svg=args.svg,
        overwrite=args.overwrite or args.out is None,
        command=f"planfly report {args.log}",
    )
    for file in result.files:
        print(f"report    {file}")
    code = NOT_FLYABLE if result.verdict is None else verdict_code(result.verdict)
    if not log.complete:
        warn_about_incomplete_log(log)
        code = INCOMPLETE
    write_json_if_requested(args, lambda: _json_answer(result.files, result.verdict, code))
    return code


def _json_answer(files: Sequence[Path], verdict: "Verdict | None", code: int) -> object:
    """Return the answer of ``planfly report`` for --json."""
    from planfly.terminal.answers import ReportAnswer

    document = None if verdict is None else verdict.document()
    return ReportAnswer(exit_code=code, files=[str(file) for file in files], verdict=document)
