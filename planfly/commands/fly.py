"""``planfly fly``: fly a plan or a mission file, and log the flight."""

import argparse
import shlex
from typing import TYPE_CHECKING

from planfly.terminal.arguments import MISSION_SUFFIXES, file_completer, number_parser, with_completer
from planfly.terminal.command_parser import LineParser, colour_text, verdict_code
from planfly.terminal.options import (
    add_flight_options,
    add_log_rate_option,
    add_result_options,
    add_world_options,
)
from planfly.terminal.output import print_warnings, write_json_if_requested, write_junit_if_requested
from planfly.workflow.output_paths import FLY_LOG

if TYPE_CHECKING:
    from planfly import FlownMission


def add_fly_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly fly``."""
    parser = command_line.add_command(
        "fly",
        "fly a plan or any mission file, write the log, and judge the flight",
        "planfly fly mission.waypoints --terrain jacksboro --wind 8,270 --turbulence light",
    )
    with_completer(
        parser.add_argument("mission", metavar="MISSION", help="plan.json, .waypoints or .plan"),
        file_completer(*MISSION_SUFFIXES),
    )
    add_world_options(parser)
    add_flight_options(parser)
    log_group = parser.add_group("the log")
    log_group.add_argument(
        "--seed", metavar="N", type=number_parser("seed"), help="seed of the turbulence (default: the plan's, or 1)"
    )
    log_group.add_argument(
        "--log",
        metavar="FILE",
        help="file for the flight log (default: runs/<mission>-fly-seed<N>/flight.mcap; an existing one is replaced)",
    )
    add_log_rate_option(log_group)
    add_result_options(parser, junit=True)


def fly(args: argparse.Namespace) -> int:
    """Fly a mission, write its log, and print the verdict; return the exit code of the verdict."""
    from planfly.api import flying
    from planfly.terminal.verdict_lines import verdict_lines

    is_log_named = args.log is not None
    log = args.log if is_log_named else FLY_LOG
    flight = flying.fly(**args.options | {"log": log, "overwrite": args.overwrite or not is_log_named})
    print_warnings(flight.setup.scenario.notes)
    print(*verdict_lines(flight.verdict, flight.setup.notes, flight.setup, flight.return_summary), sep="\n")
    if flight.log is None:
        print("log       none: nothing was flown")
    else:
        print(f"model     {flight.engine}")
        print(f"log       {flight.log}")
        if flight.autopilot_log is not None:
            print(f"          {flight.autopilot_log} (the autopilot's own)")
        print(colour_text(f"next      planfly report {shlex.quote(str(flight.log))}", "hint"))
    code = verdict_code(flight.verdict)
    write_json_if_requested(args, lambda: _json_answer(args.mission, flight, code))
    write_junit_if_requested(args, {args.mission: flight.verdict})
    return code


def _json_answer(mission: str, flight: "FlownMission", code: int) -> object:
    """Return the answer of ``planfly fly`` for --json."""
    from planfly.terminal.verdict_answers import FlyAnswer, count_returns

    return FlyAnswer(
        exit_code=code,
        mission=mission,
        headline=flight.verdict.headline,
        seed=flight.setup.seed,
        log=None if flight.log is None else str(flight.log),
        autopilot_log=None if flight.autopilot_log is None else str(flight.autopilot_log),
        warnings=[*flight.mission.warnings, *flight.setup.scenario.notes],
        verdict=flight.verdict.document(),
        returns=count_returns(flight.return_summary),
    )
