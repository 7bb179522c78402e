"""``planfly campaign`` and ``planfly winds``.

They find the probability that a mission flies, and its strongest wind.
"""

import argparse
import json
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from planfly.terminal.arguments import complete_mission_or_scenario, file_completer, number_parser, with_completer
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, NOT_FLYABLE, CommandParser, LineParser
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_result_options,
    add_steering_options,
    add_world_options,
    given_options,
)
from planfly.terminal.output import write_error_if_requested, write_json_if_requested, write_suite_if_requested
from planfly.workflow.output_paths import RESULTS
from world.errors import PlanflyError
from world.interruption import Interrupted

# Exit code by the answer of a campaign.
_EXIT_CODES = {"reached": FLYABLE, "missed": NOT_FLYABLE, "undecided": INCOMPLETE, "no target": FLYABLE}
# Exit code by the answer of a search for winds.
_WINDS_EXIT_CODES = {
    "judged": FLYABLE,
    "not flyable": NOT_FLYABLE,
    "not judged in full": INCOMPLETE,
    "not judged": INCOMPLETE,
}


def add_campaign_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly campaign``."""
    parser = command_line.add_command(
        "campaign",
        "fly a mission many times in varied weather with varied aircraft, to estimate how likely it is to succeed",
        "planfly campaign jacksboro-air --prove 0.99",
        extra="campaigns",
    )
    parser.alias_keyword("index", "--refly")
    _add_shared_options(parser)
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument(
        "--prove",
        metavar="P",
        type=number_parser("prove"),
        help="fly until the flights show whether the probability of a flyable flight is at least P",
    )
    goal.add_argument(
        "--at-least",
        metavar="P",
        type=number_parser("at_least"),
        help="fly a fixed number of flights, and then decide whether the probability of a flyable flight is at least P",
    )
    parser.add_argument(
        "--flights",
        metavar="N",
        type=number_parser("flights"),
        help="number of flights (default: 300), or with --prove the maximum number (default: 5000). With --resume the "
        "default is the number of the resumed campaign",
    )
    parser.add_argument(
        "--confidence",
        metavar="C",
        type=number_parser("confidence"),
        help="confidence level of each bound of the probability (default: 0.95, or with --resume the previous value)",
    )
    parser.add_argument(
        "--refly",
        metavar="K",
        type=number_parser("index"),
        help="fly flight K of the campaign in --out again, and write its log",
    )


def add_winds_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly winds``."""
    parser = command_line.add_command(
        "winds",
        "for each wind direction, find the strongest wind in which a mission is flyable",
        "planfly winds jacksboro-air --prove 0.99 --directions 16",
        extra="campaigns",
    )
    _add_shared_options(parser)
    parser.add_argument(
        "--prove",
        metavar="P",
        type=number_parser("prove"),
        help="required probability that a flight is flyable (default: 0.99; with --resume, its earlier value)",
    )
    parser.add_argument(
        "--confidence",
        metavar="C",
        type=number_parser("confidence"),
        help="confidence level of each interval (default: 0.95)",
    )
    parser.add_argument(
        "--directions",
        metavar="N",
        type=number_parser("directions"),
        help="number of directions, 4 to 72 (default: 16)",
    )
    parser.add_argument(
        "--most",
        metavar="M/S",
        type=number_parser("most"),
        help="strongest wind to try, m/s (default: 20)",
    )
    parser.add_argument(
        "--flights",
        metavar="N",
        type=number_parser("flights"),
        help="maximum number of flights, all directions together, at least 150 (default: 5000)",
    )


def _add_shared_options(parser: CommandParser) -> None:
    """Add the arguments and options that `campaign` and `winds` share."""
    add_flights_options(parser)
    parser.add_argument(
        "--resume",
        action="store_true",
        help="continue the campaign in --out with the options of its earlier flights; an option that contradicts them "
        "is refused",
    )
    add_result_options(
        parser,
        "folder for the files (default: runs/<name>-<command>); an existing one is continued with --resume, and "
        "replaced only with --overwrite",
        junit=True,
    )


def add_flights_options(parser: CommandParser) -> None:
    """Add the target and the options that all commands with many flights have in common."""
    with_completer(
        parser.add_argument(
            "target",
            metavar="SCENARIO|PLAN|MISSION",
            help="name of a built-in scenario, or a TOML file, plan.json, .waypoints or .plan",
        ),
        complete_mission_or_scenario,
    )
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_steering_options(parser)
    with_completer(
        parser.add_argument(
            "--spread",
            metavar="FILE",
            help="TOML file that states how the flights vary, their dispersions (default: planfly's own dispersions)",
        ),
        file_completer("toml"),
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=number_parser("seed"),
        help="seed of the plan and of the random draws (default: the scenario's, or 1)",
    )
    parser.add_argument(
        "--workers",
        metavar="N",
        type=number_parser("workers"),
        help="number of processes on this machine (default: one per core)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a running dask cluster that simulates the flights: tls://HOST:PORT; requires planfly[cluster]",
    )


def campaign(args: argparse.Namespace) -> int:
    """Fly a campaign, resume one, or fly one of its flights again; return the exit code.

    The code follows from the answer on the target (`_EXIT_CODES`). Without a target, it is INCOMPLETE if a flight is
    undecided.
    """
    from logs.verdict.rule_words import rule_word
    from logs.verdict.wording import place_text
    from planfly.api import campaigns

    folder = _result_folder(args, "campaign")
    if args.refly is not None:
        # Fly one flight of a campaign again, with a log.
        for option, target in (("--json", args.json), ("--junit", args.junit)):
            if target:
                message = f"{option}: cannot be combined with --refly, which flies a single flight"
                raise PlanflyError(message, field=option, value=target)
        flight = campaigns.campaign_flight(
            **given_options(args, campaigns.campaign_flight, index=args.refly, out=folder)
        )
        row = flight.row
        print(f"flight {args.refly}: {row.outcome}, ended: {row.ended} (as in the campaign's table)")
        if row.undecided_text:
            print(f"  Not judged: {row.undecided_text}")
        for rule, place in row.failures:
            print(f"  failed  {rule_word(rule)} at {place_text(place)}")
        print(f"log       {flight.log}")
        return {"flyable": FLYABLE, "undecided": INCOMPLETE}.get(row.outcome, NOT_FLYABLE)
    with _report_stored_flights(args, folder, "campaign.sqlite") as interruption_code:
        result = campaigns.campaign(**given_options(args, campaigns.campaign, out=folder))
    if interruption_code():
        return interruption_code()
    from planfly.campaigns.summary import campaign_lines, campaign_suite

    print("\n".join(campaign_lines(result.summary)))
    print(f"results   {folder}/ (report.html, summary.json, campaign.sqlite, worst/)")
    is_open = result.answer == "no target" and result.summary.estimate.tally.undecided > 0
    code = INCOMPLETE if is_open else _EXIT_CODES[result.answer]
    write_json_if_requested(args, lambda: _with_exit_code(folder / "summary.json", code))
    write_suite_if_requested(args, lambda: campaign_suite(args.target, result.summary))
    return code


def winds(args: argparse.Namespace) -> int:
    """Find the strongest wind from each direction in which a mission is flyable; return the exit code.

    The code follows from the answer of the search: see `_WINDS_EXIT_CODES`.
    """
    from planfly.api import campaigns

    folder = _result_folder(args, "winds")
    with _report_stored_flights(args, folder, "winds.sqlite") as interruption_code:
        result = campaigns.winds(**args.options | {"out": folder})
    if interruption_code():
        return interruption_code()
    from planfly.campaigns.report import wind_lines, winds_suite

    print("\n".join(wind_lines(result)))
    print(f"results   {folder}/ (winds.html, winds.png, winds.json, winds.sqlite)")
    code = _WINDS_EXIT_CODES[result.answer]
    write_json_if_requested(args, lambda: _with_exit_code(folder / "winds.json", code))
    write_suite_if_requested(args, lambda: winds_suite(args.target, result))
    return code


def _with_exit_code(file: Path, code: int) -> str:
    """Return the JSON text of a results file, with the exit code inserted after the schema."""
    document = json.loads(file.read_text(encoding="utf-8"))
    return json.dumps({"schema": document["schema"], "exit_code": code, **document}, indent=1) + "\n"


def _result_folder(args: argparse.Namespace, kind: str) -> Path:
    """Return the folder of the results: the folder in --out, or ``runs/<name>-<kind>``.

    kind: "campaign" or "winds".
    """
    return Path(args.out) if args.out else RESULTS / f"{Path(args.target).stem}-{kind}"


@contextmanager
def _report_stored_flights(args: argparse.Namespace, folder: Path, table: str) -> Iterator[Callable[[], int]]:
    """If this block is interrupted, print the number of flights that are stored so far.

    table: name of the table of flights in the folder.

    Yields a function that returns the exit code of the interruption, or 0 without an interruption.
    An interruption before the table exists is raised again.
    """
    code = 0
    try:
        yield lambda: code
    except KeyboardInterrupt as interruption:
        from planfly.campaigns.tables import count_flights
        from world.wording import count_text

        if not (folder / table).is_file():
            raise
        flights = count_flights(folder / table)
        message = f"interrupted; {count_text(flights, 'flight')} kept in {folder}: continue with --resume"
        code = 128 + (interruption.number if isinstance(interruption, Interrupted) else signal.SIGINT)
        print(f"planfly: {message}", file=sys.stderr)
        write_error_if_requested(args, code, message)
