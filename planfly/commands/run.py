"""``planfly run``: plan, fly, judge and report into one folder, once or in rounds."""

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from planfly.terminal.arguments import number_parser
from planfly.terminal.command_parser import NOT_FLYABLE, LineParser, verdict_code
from planfly.terminal.dispersed_flights import check_flights_option, fly_dispersed
from planfly.terminal.options import (
    add_flight_options,
    add_flights_option,
    add_log_rate_option,
    add_result_options,
    add_scenario_argument,
    add_terrain_option,
    given_options,
)
from planfly.terminal.output import write_json_if_requested, write_junit_if_requested

if TYPE_CHECKING:
    from planfly import Round, RunResult
    from planfly.terminal.answers import DispersedFlights


def add_run_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly run``."""
    parser = command_line.add_command(
        "run",
        "plan, export, fly, log, judge and report",
        "planfly run jacksboro --seed 3 --out my-run",
        "planfly run tight --wind 8,270 --turbulence light --refine 3",
    )
    add_scenario_argument(
        parser, nargs="?", default="jacksboro", help="TOML file, or name of a built-in scenario (default: jacksboro)"
    )
    planning = parser.add_group("planning")
    planning.add_argument(
        "--seed",
        metavar="N",
        type=number_parser("seed"),
        help="seed of planner and turbulence (default: the scenario's, or 1)",
    )
    planning.add_argument(
        "--refine",
        metavar="N",
        type=number_parser("refine"),
        default=0,
        help="if the plan is not flyable, tighten the limits and plan again, up to N times (default: 0)",
    )
    add_flights_option(planning)
    add_terrain_option(planning)
    add_flight_options(parser)
    add_log_rate_option(parser.add_group("the log"))
    add_result_options(
        parser, "folder for the files (default: runs/<name>-seed<N>; an existing one is replaced)", junit=True
    )


def run(args: argparse.Namespace) -> int:
    """Plan, export, fly, record, judge and report, with up to N more rounds for ``--refine N``.

    Returns the exit code of the verdict, or 4 if too few of the flights of ``--flights N`` are flyable.
    """
    from planfly.api import running
    from planner.plan import read_plan

    check_flights_option(args, "sitl")
    result = running.run(**given_options(args, running.run, on_round=_print_round))
    if args.refine:
        print("rounds")
        for one in result.rounds:
            changes = "; ".join(one.changes) or "as given"
            print(f"  {one.number}  {one.folder}/  {changes}: {one.verdict.headline}")
        print(f"  {result.ended}")
    dispersed = None
    if args.flights and result.rounds[-1].flown:
        # The plan of the last round, in the scenario without the limits that were tightened for it.
        first, last = (read_plan(result.rounds[number].folder / "plan.json") for number in (0, -1))
        dispersed = fly_dispersed(args, replace(last, scenario=first.scenario))
    code = verdict_code(result.verdict) if dispersed is None or dispersed.holds else NOT_FLYABLE
    write_json_if_requested(args, lambda: _json_answer(result, bool(args.refine), code, dispersed))
    write_junit_if_requested(args, {result.scenario: result.verdict})
    return code


def _json_answer(result: "RunResult", has_rounds: bool, code: int, dispersed: "DispersedFlights | None") -> object:
    """Return the answer of ``planfly run`` for --json."""
    from planfly.terminal.answers import RoundAnswer, RunAnswer

    rounds = [
        RoundAnswer(
            round=finished_round.number, changes=list(finished_round.changes), summary=finished_round.verdict.headline
        )
        for finished_round in result.rounds
    ]
    return RunAnswer(
        exit_code=code,
        scenario=result.scenario,
        headline=result.verdict.headline,
        seed=result.seed,
        folder=str(result.folder),
        files=[file.name for file in result.files],
        rounds=rounds if has_rounds else [],
        verdict=result.verdict.document(),
        dispersed=dispersed,
    )


def _print_round(finished_round: "Round") -> None:
    """Print the verdict on a round, and its files.

    Also print the line on returns to launch, and the flight model.
    """
    from planfly.terminal.verdict_lines import verdict_lines

    print(*verdict_lines(finished_round.verdict, finished_round.notes, returns=finished_round.return_summary), sep="\n")
    if finished_round.engine:
        print(f"model     {finished_round.engine}")
    files = "plan.json, mission.waypoints, mission.plan, verdict.json; nothing was flown"
    if finished_round.flown:
        flight = "flight.mcap" if finished_round.has_log else "no flight"
        files = f"report.html, map.png, profile.png, {flight}, verdict.json, plan.json, missions"
    print(f"results   {finished_round.folder}/ ({files})")
