"""``planfly import`` and ``planfly refly``: import another program's log, and fly its mission again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.commands.check import LOGS
from planfly.terminal.arguments import IMPORTED_LOG_SUFFIXES, complete_aircraft, file_completer, with_completer
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, LineParser, verdict_code
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_imported_log_options,
    add_result_options,
    add_turbulence_option,
    add_world_options,
    given_options,
)
from planfly.terminal.output import warn_about_incomplete_log, write_json_if_requested, write_junit_if_requested
from world.errors import PlanflyError
from world.wording import count_text

if TYPE_CHECKING:
    from planfly import ImportedFlight, Reflown


def add_import_log_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly import``."""
    parser = command_line.add_command(
        "import",
        "convert an autopilot's log into a flight log, and judge the flight against its plan",
        "planfly import 00000042.BIN flight.mcap --terrain dem.tif --aircraft aerosonde",
        "planfly import flight.columns.toml --columns-from flight.csv",
    )
    with_completer(
        parser.add_argument(
            "log",
            metavar=LOGS,
            help="a log of ArduPilot (.BIN), of a ground station (.tlog; requires planfly[live]) or of PX4 (.ulg;"
            " requires planfly[px4-logs]), a track (.gpx, .igc, .kml, .kmz), or a table of columns (requires"
            " planfly[data-logs])",
        ),
        file_completer(*IMPORTED_LOG_SUFFIXES),
    )
    parser.add_argument("target", metavar="FLIGHT.mcap", nargs="?", help="the flight log to write")
    with_completer(
        parser.add_argument(
            "--columns-from",
            dest="files",
            metavar="FILE",
            nargs="+",
            help="guess the columns of these CSV, MAT, Parquet or HDF5 files from their names and values, and write"
            " them to LOG as a table of columns for you to check; requires planfly[data-logs]",
        ),
        file_completer("csv", "mat", "parquet", "h5", "hdf5"),
    )
    add_imported_log_options(parser)
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_result_options(parser, junit=True)


def import_log(args: argparse.Namespace) -> int:
    """Import a log; return the exit code of the verdict, or 3 if part of the log could not be read."""
    from planfly.api import imported
    from planfly.terminal.verdict_lines import verdict_lines

    if args.files is not None:
        # Write a table of columns guessed from data files, and print the number of guesses to check.
        for name, value in (("FLIGHT.mcap", args.target), ("--json", args.json), ("--junit", args.junit)):
            if value is not None:
                message = f"--columns-from cannot be combined with {name}, because it writes a table and no flight log"
                raise PlanflyError(message, field=name)
        guesses = imported.guess_columns(args.files, args.log, overwrite=args.overwrite)
        print(f"table     {args.log}: {guesses.guesses} {'guess' if guesses.guesses == 1 else 'guesses'} to check")
        for line in guesses.missing:
            print(f"  {line}")
        print(
            f"next      check the table, then `planfly import {args.log} FLIGHT.mcap`, or"
            f" `planfly aircraft --identify {args.log} ...`"
        )
        return FLYABLE
    if args.target is None:
        raise PlanflyError("import needs FLIGHT.mcap, the flight log to write", field="FLIGHT.mcap")
    flight = imported.import_log(**given_options(args, imported.import_log))
    print(*verdict_lines(flight.verdict, flight.setup.route.notes), sep="\n")
    print(f"log       {Path(args.target)} ({count_text(len(flight.track), 'row')})")
    code = INCOMPLETE if flight.lossy else verdict_code(flight.verdict)
    write_json_if_requested(args, lambda: _import_answer(Path(args.target), flight, code))
    write_junit_if_requested(args, {args.log: flight.verdict})
    return code


def _import_answer(target: Path, flight: "ImportedFlight", code: int) -> object:
    """Return the answer of ``planfly import`` for --json."""
    from planfly.terminal.answers import ImportAnswer

    return ImportAnswer(
        exit_code=code,
        log=str(target),
        headline=flight.verdict.headline,
        rows=len(flight.track),
        verdict=flight.verdict.document(),
    )


def add_refly_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly refly``."""
    parser = command_line.add_command(
        "refly",
        "fly the mission of an imported flight again in JSBSim, in the wind of its log, and compare both flights",
        "planfly refly flight.mcap --out refly",
    )
    with_completer(
        parser.add_argument("log", metavar="FLIGHT.mcap", help="a flight log written by 'planfly import'"),
        file_completer("mcap"),
    )
    with_completer(
        parser.add_argument(
            "--aircraft",
            metavar="AIRCRAFT",
            help="aircraft that flies the mission again (default: the aircraft of the log)",
        ),
        complete_aircraft,
    )
    add_turbulence_option(parser)
    add_result_options(
        parser, "folder for the pictures (default: <log>-refly next to the log; an existing one is replaced)"
    )


def refly(args: argparse.Namespace) -> int:
    """Fly the mission again, and compare and draw both flights.

    Returns the exit code: 3 for an incomplete log, otherwise 0.
    """
    from logs.recording.reader import read_log
    from planfly.api import imported

    source = Path(args.log)
    log = read_log(source)
    folder = args.out or source.with_name(f"{source.stem}-refly")
    overwrite = args.overwrite or args.out is None
    result = imported.refly(**args.options | {"log": log, "out": folder, "overwrite": overwrite})
    print("\n".join(result.lines))
    for file in result.files:
        print(f"refly     {file}")
    if not log.complete:
        warn_about_incomplete_log(log)
    code = FLYABLE if log.complete else INCOMPLETE
    write_json_if_requested(args, lambda: _refly_answer(result, code))
    return code


def _refly_answer(result: "Reflown", code: int) -> object:
    """Return the answer of ``planfly refly`` for --json."""
    from planfly.terminal.answers import ReflyAnswer

    return ReflyAnswer(exit_code=code, lines=list(result.lines), files=[str(file) for file in result.files])
