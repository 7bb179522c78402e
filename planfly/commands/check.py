"""``planfly check``: judge a flight by its log, or a mission by flying it."""

import argparse
from dataclasses import fields
from typing import TYPE_CHECKING

from planfly.arguments import CHOICES
from planfly.terminal.arguments import (
    IMPORTED_LOG_SUFFIXES,
    MISSION_SUFFIXES,
    file_completer,
    parse_autopilots,
    with_completer,
)
from planfly.terminal.command_parser import INCOMPLETE, CommandParser, LineParser, verdict_code
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_autopilot_options,
    add_imported_log_options,
    add_result_options,
    add_world_options,
    given_options,
)
from planfly.terminal.output import print_warnings, write_json_if_requested, write_junit_if_requested
from world.errors import ArgumentError

if TYPE_CHECKING:
    from planfly import Verdict
    from planfly.workflow.pipeline import ReturnSummary

# Suffixes of logs of other programs, as the help shows them.
LOGS = "LOG.BIN|.tlog|.ulg|.gpx|.igc|.kml|.kmz"
# Options that are not allowed with --for, because they belong to one autopilot or to a log.
_SINGLE_AUTOPILOT_OPTIONS = ("params", "guidance", "autopilot", "plan", "flight", "datum", "geometry")


def add_mission_or_log_argument(parser: CommandParser) -> None:
    """Add the argument for a mission, which is then flown, or for a flight log.

    The log is from planfly or another program.
    """
    with_completer(
        parser.add_argument(
            "what", metavar="MISSION|LOG", help=f"plan.json, .waypoints or .plan, or a flight log (.mcap, or {LOGS})"
        ),
        file_completer(*MISSION_SUFFIXES, "mcap", *IMPORTED_LOG_SUFFIXES),
    )


def add_check_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly check``."""
    parser = command_line.add_command(
        "check",
        "judge a flight from its log (planfly's or an autopilot's), or a mission by flying it, without writing files",
        "planfly check flight.mcap --json verdict.json",
        "planfly check mission.waypoints --terrain jacksboro --json -",
        "planfly check mission.waypoints --terrain jacksboro --geometry",
        "planfly check mission.waypoints --terrain jacksboro --for ardupilot,px4",
    )
    with_completer(
        parser.add_argument(
            "what", metavar="LOG|MISSION", help=f"a flight log (.mcap, or {LOGS}), or plan.json, .waypoints, .plan"
        ),
        file_completer("mcap", *MISSION_SUFFIXES, *IMPORTED_LOG_SUFFIXES),
    )
    add_imported_log_options(parser)
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    group = add_autopilot_options(parser)
    group.add_argument(
        "--for",
        dest="autopilots",
        metavar="AUTOPILOT,...",
        type=parse_autopilots,
        help="fly a mission with each of several simulated autopilots, and print a table with a column for each. "
        "Choose from: " + ", ".join(CHOICES["autopilot"]),
    )
    group.add_argument(
        "--geometry",
        action="store_true",
        help="judge a mission only by its geometry and the aircraft's envelope, without simulating the flight (fast)",
    )
    add_result_options(parser, junit=True)


def check(args: argparse.Namespace) -> int:
    """Judge a flight or a mission, and print the verdict.

    Returns the exit code of the verdict (of the worst verdict, for several autopilots), or 3 for an incomplete log.
    """
    from planfly.api import flying
    from planfly.terminal.verdict_lines import autopilot_lines, verdict_lines

    if args.autopilots is not None:
        # Fly the mission by each named autopilot; the worst verdict determines the exit code.
        from planfly.terminal.verdict_answers import VerdictsDocument

        for name in _SINGLE_AUTOPILOT_OPTIONS:
            if (value := getattr(args, name)) not in (None, False):
                allowed = "cannot be combined with --for, which flies with several autopilots"
                raise ArgumentError.of_argument(name, value, allowed)
        flights = flying.fly_by_each(**given_options(args, flying.fly_by_each, mission=args.what))
        verdicts = {name: flight.verdict for name, flight in flights.items()}
        worst_code = max(verdict_code(verdict) for verdict in verdicts.values())
        write_json_if_requested(
            args,
            lambda: VerdictsDocument(
                exit_code=worst_code,
                mission=args.what,
                verdicts={name: verdict.document() for name, verdict in verdicts.items()},
            ),
        )
        write_junit_if_requested(args, {f"{args.what} by {name}": verdict for name, verdict in verdicts.items()})
        print("\n".join(autopilot_lines(verdicts)))
        return worst_code
    result = flying.judge(**given_options(args, flying.judge))
    if not result.is_log:
        print_warnings(result.setup.scenario.notes)
    code, returns = INCOMPLETE if result.lossy else verdict_code(result.verdict), result.return_summary
    write_json_if_requested(args, lambda: _verdict_answer(result.verdict, returns, code))
    write_junit_if_requested(args, {args.what: result.verdict})
    print_warnings([result.loss] if result.loss else [])
    print(*verdict_lines(result.verdict, result.setup.notes, result.setup, returns), sep="\n")
    return code


def _verdict_answer(verdict: "Verdict", returns: "ReturnSummary", code: int) -> object:
    """Return the answer of ``planfly check`` for --json."""
    from planfly.terminal.verdict_answers import CheckAnswer, count_returns

    document = verdict.document()
    values = {field.name: getattr(document, field.name) for field in fields(document)}
    return CheckAnswer(exit_code=code, headline=verdict.headline, returns=count_returns(returns), **values)
