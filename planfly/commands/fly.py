"""``planfly fly``: fly a plan or a mission file, and log the flight."""

import argparse
import shlex
from typing import TYPE_CHECKING

import planfly
from planfly.terminal.arguments import MISSIONS, files, number, with_completer
from planfly.terminal.command_parser import LineParser, coloured
from planfly.terminal.exit_codes import verdict_code
from planfly.terminal.options import call, flight_options, log_rate_option, result_options, world_options
from planfly.terminal.output import give_answer, give_junit
from planfly.terminal.results import print_engine, print_returns, print_verdict, print_warnings
from planfly.workflow.output_paths import FLY_LOG

if TYPE_CHECKING:
    from planfly import FlownMission


def fly_options(line: LineParser) -> None:
    """Add the parser of ``planfly fly``."""
    parser = line.command(
        "fly",
        "fly a plan or any mission file, write the log, and judge the flight",
        "planfly fly mission.waypoints --terrain jacksboro --wind 8,270 --turbulence light",
    )
    with_completer(
        parser.add_argument("mission", metavar="MISSION", help="plan.json, .waypoints or .plan"), files(*MISSIONS)
    )
    world_options(parser)
    flight_options(parser)
    log = parser.group("the log")
    log.add_argument(
        "--seed", metavar="N", type=number("seed"), help="seed of the turbulence (default: the plan's, or 1)"
    )
    log.add_argument(
        "--log",
        metavar="FILE",
        help="file for the flight log (default: runs/<mission>-fly-seed<N>/flight.mcap, overwritten)",
    )
    log_rate_option(log)
    result_options(parser, junit=True)


def fly(args: argparse.Namespace) -> int:
    """Fly a mission, write its log, and return the exit code of the verdict."""
    is_log_named = args.log is not None
    log = args.log if is_log_named else FLY_LOG
    flown = call(planfly.fly, args, log=log, overwrite=args.overwrite or not is_log_named)
    print_warnings([*flown.mission.warnings, *flown.setup.scenario.notes])
    print_verdict(flown.verdict, flown.setup.notes)
    print_returns(flown.returns_line)
    if flown.log is None:
        print("log       none: nothing was flown")
    else:
        print_engine(flown.engine)
        print(f"log       {flown.log}")
        if flown.autopilot_log is not None:
            print(f"          {flown.autopilot_log} (the autopilot's own)")
        print(coloured(f"next      planfly report {shlex.quote(str(flown.log))}", "hint"))
    code = verdict_code(flown.verdict)
    give_answer(args, lambda: _json_answer(args.mission, flown, code))
    give_junit(args, {args.mission: flown.verdict})
    return code


def _json_answer(mission: str, flown: "FlownMission", code: int) -> object:
    from planfly.terminal.answers import FlyAnswer

    return FlyAnswer(
        exit_code=code,
        mission=mission,
        seed=flown.setup.seed,
        log=None if flown.log is None else str(flown.log),
        autopilot_log=None if flown.autopilot_log is None else str(flown.autopilot_log),
        warnings=[*flown.mission.warnings, *flown.setup.scenario.notes],
        verdict=flown.verdict.document(),
    )
