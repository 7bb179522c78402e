"""``planfly import`` and ``planfly refly``: import another program's log, and fly its mission again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import planfly
from planfly.commands.check import LOGS
from planfly.terminal.arguments import IMPORTED_LOGS, complete_aircraft, files, with_completer
from planfly.terminal.command_parser import LineParser
from planfly.terminal.exit_codes import FLYABLE, LOSS, verdict_code
from planfly.terminal.options import (
    aircraft_and_wind_options,
    call,
    imported_log_options,
    result_options,
    turbulence_option,
    world_options,
)
from planfly.terminal.output import give_answer, give_junit
from planfly.terminal.results import print_verdict, warn_of_loss

if TYPE_CHECKING:
    from planfly import ImportedFlight, Reflown


def import_log_options(line: LineParser) -> None:
    """Add the parser of ``planfly import``."""
    parser = line.command(
        "import",
        "convert an autopilot's log into a flight log, and judge the flight against its plan",
        "planfly import 00000042.BIN flight.mcap --terrain dem.tif --aircraft aerosonde",
    )
    with_completer(
        parser.add_argument(
            "log",
            metavar=LOGS,
            help="a log of ArduPilot, of a ground station (.tlog; extra planfly[live]), of PX4 (.ulg; extra"
            " planfly[px4-logs]), or a track",
        ),
        files(*IMPORTED_LOGS),
    )
    parser.add_argument("target", metavar="FLIGHT.mcap", help="the flight log to write")
    imported_log_options(parser)
    world_options(parser)
    aircraft_and_wind_options(parser)
    result_options(parser, junit=True)


def import_log(args: argparse.Namespace) -> int:
    """Import a log; return the exit code of the verdict, or 3 if part of the log could not be read."""
    flight = call(planfly.import_log, args)
    print_verdict(flight.verdict, flight.setup.route.notes)
    print(f"log       {Path(args.target)} ({len(flight.track)} rows)")
    code = LOSS if flight.lossy else verdict_code(flight.verdict)
    give_answer(args, lambda: _import_answer(Path(args.target), flight, code))
    give_junit(args, {args.log: flight.verdict})
    return code


def _import_answer(target: Path, flight: "ImportedFlight", code: int) -> object:
    from planfly.terminal.answers import ImportAnswer

    verdict = flight.verdict.document()
    return ImportAnswer(exit_code=code, log=str(target), rows=len(flight.track), verdict=verdict)


def refly_options(line: LineParser) -> None:
    """Add the parser of ``planfly refly``."""
    parser = line.command(
        "refly",
        "fly the mission of an imported flight again in JSBSim, in the wind of its log, and compare both flights",
        "planfly refly flight.mcap --out refly",
    )
    with_completer(
        parser.add_argument("log", metavar="FLIGHT.mcap", help="a flight log written by 'planfly import'"),
        files("mcap"),
    )
    with_completer(
        parser.add_argument(
            "--aircraft", metavar="AIRCRAFT", help="aircraft that flies it again (default: the aircraft of the log)"
        ),
        complete_aircraft,
    )
    turbulence_option(parser)
    result_options(
        parser, "folder for the pictures (default: <log>-refly next to the log; an existing one is replaced)"
    )


def refly(args: argparse.Namespace) -> int:
    """Fly the mission again, and compare and draw both flights; return 3 for an incomplete log."""
    source = Path(args.log)
    log = planfly.read_log(source)
    folder = args.out or source.with_name(f"{source.stem}-refly")
    reflown = call(planfly.refly, args, log=log, out=folder, overwrite=args.overwrite or args.out is None)
    print("\n".join(reflown.lines))
    for file in reflown.files:
        print(f"refly     {file}")
    if not log.complete:
        warn_of_loss(log)
    code = FLYABLE if log.complete else LOSS
    give_answer(args, lambda: _refly_answer(reflown, code))
    return code


def _refly_answer(reflown: "Reflown", code: int) -> object:
    from planfly.terminal.answers import ReflyAnswer

    return ReflyAnswer(exit_code=code, lines=list(reflown.lines), files=[str(file) for file in reflown.files])
