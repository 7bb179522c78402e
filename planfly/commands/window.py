"""``planfly window``: find the times of take-off at which a mission is flyable in a weather forecast."""

import argparse
from typing import TYPE_CHECKING

from planfly.commands.campaigns import add_flights_options
from planfly.terminal.arguments import number_parser
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, NOT_FLYABLE, LineParser, colour_text
from planfly.terminal.options import add_result_options
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import WindowResult
    from planfly.terminal.window_answers import WindowAnswer


def add_window_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly window``."""
    parser = command_line.add_command(
        "window",
        "find the times of take-off at which a mission is flyable in a weather forecast, by flying it many times",
        "planfly window mission.waypoints --terrain jacksboro --forecast tomorrow.nc --at 2026-12-01T09:00+01:00",
        extra="campaigns",
    )
    add_flights_options(parser)
    group = parser.add_group("the take-off times")
    for option, keyword, text in (
        ("--from", "earliest", "first time of take-off (default: the time of --at)"),
        ("--to", "latest", "last time of take-off (default: 24 hours later, or the end of the forecast)"),
    ):
        group.add_argument(option, dest=keyword, metavar="TIME", help=text)
        parser.alias_keyword(keyword, option)
    group.add_argument("--every", metavar="STEP", help="time between two take-offs, such as 30min or 1h (default: 1h)")
    group.add_argument(
        "--probability",
        metavar="P",
        type=number_parser("probability"),
        help="required probability that a flight with this take-off time is flyable (default: 0.9)",
    )
    group.add_argument(
        "--flights",
        metavar="N",
        type=number_parser("window_flights"),
        help="number of flights for each take-off time, 10 to 10,000 (default: 40)",
    )
    add_result_options(parser, "folder for the page (report.html) and the chart (window.png) (default: no files)")


def window(args: argparse.Namespace) -> int:
    """Find the times of take-off at which a mission is flyable; return the exit code.

    The exit code is 0 if the requested departure is open (or any departure if none is requested), 4 if not, and 3 if it
    is not judged in full.
    """
    from logs.verdict.conditions import flown_condition_lines
    from planfly.api import finding_windows
    from planfly.campaigns.window_text import answer_line, unjudged_lines, window_lines

    result = finding_windows.window(**args.options)
    go = result.is_go
    code = INCOMPLETE if go is None else FLYABLE if go else NOT_FLYABLE
    print(f"window    {colour_text(answer_line(result), 'warning' if go is None else 'good' if go else 'bad')}")
    for text in (*unjudged_lines(result), *flown_condition_lines(result.base.conditions()), *window_lines(result)):
        print(f"  {text}")
    for path in result.files:
        print(f"  written {path}")
    write_json_if_requested(args, lambda: _json_answer(str(args.target), result, code))
    return code


def _json_answer(target: str, result: "WindowResult", code: int) -> "WindowAnswer":
    """Return the answer of ``planfly window`` for --json."""
    from planfly.campaigns.failure_counts import failures_document
    from planfly.campaigns.window_text import answer_line, unjudged_lines
    from planfly.terminal.battery_answers import finite_or_none
    from planfly.terminal.window_answers import DepartureEntry, WindowAnswer, WindowEntry

    return WindowAnswer(
        exit_code=code,
        what=target,
        headline=answer_line(result),
        is_go=result.is_go,
        asked=None if result.goal.asked is None else result.goal.asked.isoformat(),
        probability=result.goal.probability,
        flights=result.goal.flights,
        not_judged="".join(unjudged_lines(result)),
        windows=[WindowEntry(first=first.isoformat(), last=last.isoformat()) for first, last in result.windows],
        departures=[
            DepartureEntry(
                time=departure.time.isoformat(),
                is_open=result.is_open(departure),
                not_judged=departure.not_judged,
                flights=len(departure.rows),
                flyable=departure.flyable,
                lowest=departure.interval.low if departure.rows else None,
                highest=departure.interval.high if departure.rows else None,
                wind_mps=finite_or_none(departure.wind[0]),
                wind_from_deg=finite_or_none(departure.wind[1]),
                energy_left_wh=finite_or_none(departure.energy_left),
                undecided=departure.undecided,
                rules=list(departure.rules),
                by_rule=failures_document(departure.failures),
            )
            for departure in result.departures
        ],
        conditions=result.base.conditions(),
        files=[str(file) for file in result.files],
    )
