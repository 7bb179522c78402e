"""``planfly returns``: judge the return to launch from every place on a flight."""

import argparse
import math
from typing import TYPE_CHECKING

from planfly.commands.check import add_mission_or_log_argument
from planfly.terminal.arguments import (
    number_parser,
)
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, NOT_FLYABLE, LineParser, colour_text
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_imported_log_options,
    add_result_options,
    add_sitl_option,
    add_steering_options,
    add_world_options,
)
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import ReturnsResult

# Maximum number of ranges of seconds that are listed.
_MAX_LISTED_RANGES = 20


def add_returns_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly returns``."""
    parser = command_line.add_command(
        "returns",
        "simulate a return to launch from points all along the route, state where each return ends and if it is safe,"
        " and find what the aircraft can reach without its engine",
        "planfly returns mission.waypoints --terrain jacksboro --wind 5,250",
        "planfly returns flight.mcap --every 5 --out pictures",
        "planfly returns flight.mcap --sitl ./arduplane --points 5",
    )
    add_mission_or_log_argument(parser)
    group = parser.add_group("the returns")
    group.add_argument(
        "--every",
        metavar="S",
        type=number_parser("every"),
        default=1.0,
        help="time between the starts of two simulated returns along the flight, s (default: 1)",
    )
    group.add_argument(
        "--suggest",
        action="store_true",
        help="look for changes that make all returns safe: the lowest sufficient RTL_ALTITUDE (PX4: RTL_RETURN_ALT), a "
        "climb before the turn, or the fewest rally points",
    )
    add_sitl_option(
        group,
        "also fly the worst returns with ArduPlane itself, and compare them with the simulated returns. PATH is its"
        " executable, built for software in the loop (requires planfly[live])",
    )
    group.add_argument(
        "--points",
        metavar="N",
        type=number_parser("points"),
        help="with --sitl: number of the worst returns to fly, chosen far apart (default: 3)",
    )
    add_imported_log_options(parser)
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_steering_options(parser).add_argument(
        "--seed", metavar="N", type=number_parser("seed"), help="seed of the turbulence (default: the plan's, or 1)"
    )
    add_result_options(
        parser,
        "folder for pictures: the route coloured by the outcome of returns, the worst returns in profile,"
        " the lowest height from which a return is safe, and the glide's footprint (default: none)",
    )


def returns(args: argparse.Namespace) -> int:
    """Judge returns to launch from points along a whole flight, print the outcomes, return the exit code.

    The exit code is 0 if all returns are safe, 4 if one is unsafe, and 3 if none is unsafe but some are undecided.
    """
    from logs.verdict.conditions import flown_condition_lines, judging_conditions
    from planfly.api import returning

    result = returning.returns(**args.options)
    code = FLYABLE if result.safe else INCOMPLETE if result.undecided else NOT_FLYABLE
    print(
        f"returns   {colour_text(result.headline, 'good' if result.safe else 'warning' if result.undecided else 'bad')}"
    )
    for text in flown_condition_lines(judging_conditions(result.setup)):
        print(f"  {text}")
    for text in result.cause_lines:
        print(f"  {text}")
    for text in result.range_lines[:_MAX_LISTED_RANGES]:
        print(f"  {text}")
    if len(result.range_lines) > _MAX_LISTED_RANGES:
        print(f"  and {len(result.range_lines) - _MAX_LISTED_RANGES} more ranges; --json FILE lists them all")
    for text in result.program_lines:
        print(f"  {text}")
    print(f"  {result.no_return_line}")
    for text in result.suggestion_lines:
        print(colour_text("  would help: ", "hint") + text)
    if args.suggest and not result.safe and not result.suggested:
        print(f"  no {result.returns.trials_text} or set of rally points was found that would help")
    print(f"engine out: {result.glide_headline}")
    for text in result.glide_lines[:_MAX_LISTED_RANGES]:
        print(f"  {text}")
    if len(result.glide_lines) > _MAX_LISTED_RANGES:
        print(f"  and {len(result.glide_lines) - _MAX_LISTED_RANGES} more ranges; --json FILE lists them all")
    for text in result.notes:
        print(f"  note    {text}")
    for path in result.files:
        print(f"  written {path}")
    write_json_if_requested(args, lambda: _json_answer(str(args.what), result, code))
    return code


def _json_answer(source: str, result: "ReturnsResult", code: int) -> object:
    """Return the answer of ``planfly returns`` for --json."""
    from logs.verdict.conditions import judging_conditions
    from planfly.terminal.returns_answers import (
        CauseEntry,
        ReturnsAnswer,
        glides_entry,
        program_returns_entry,
        return_range_entry,
        suggestion_entry,
    )

    judged_returns, no_return = result.returns, result.returns.point_of_no_return
    return ReturnsAnswer(
        exit_code=code,
        what=source,
        headline=result.headline,
        safe=result.safe,
        conditions=judging_conditions(result.setup),
        every_s=judged_returns.interval,
        least_clearance_m=judged_returns.limit,
        causes=[
            CauseEntry(name=cause.name, does=cause.action, parameter=cause.parameter, value=cause.value)
            for cause in judged_returns.causes
        ],
        rtl_autoland=judged_returns.autoland,
        not_judged=list(judged_returns.unjudged_parts),
        ranges=[return_range_entry(result, return_range) for return_range in judged_returns.ranges],
        by_program=program_returns_entry(result),
        left_out=judged_returns.omitted_count,
        starts_too_low=judged_returns.too_low_start_count,
        no_return=no_return.kind,
        no_return_s=None if math.isnan(no_return.time) else round(no_return.time, 2),
        engine_out=glides_entry(result),
        suggestions=[suggestion_entry(result, suggested) for suggested in result.suggested],
        files=[str(path) for path in result.files],
        notes=list(result.notes),
    )
