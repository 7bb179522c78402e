"""``planfly battery``: find the smallest battery for a mission and its returns to launch."""

import argparse
from typing import TYPE_CHECKING

from planfly.commands.campaigns import add_flights_options
from planfly.terminal.arguments import number_parser
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, NOT_FLYABLE, LineParser, colour_text
from planfly.terminal.options import add_result_options
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import BatteryResult
    from planfly.terminal.battery_answers import BatteryAnswer


def add_battery_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly battery``."""
    parser = command_line.add_command(
        "battery",
        "find the smallest battery with which a mission and all its returns keep the reserve, by flying it many times",
        "planfly battery mission.waypoints --terrain jacksboro --specific-energy 180",
        extra="campaigns",
    )
    add_flights_options(parser)
    group = parser.add_group("the battery")
    for name, unit, text in (
        ("probability", "P", "probability with which the reserve is kept (default: 0.95)"),
        ("reserve", "F", "fraction of the battery that must be left (default: 0.2)"),
        (
            "specific_energy",
            "WH/KG",
            "energy per battery mass, so that a larger battery makes the aircraft heavier (default: the"
            " aircraft's mass stays the same)",
        ),
        ("every", "S", "time between the starts of two simulated returns along the flight, s (default: 10)"),
        ("confidence", "C", "confidence level of the interval for the battery's capacity (default: 0.95)"),
    ):
        group.add_argument(f"--{name.replace('_', '-')}", metavar=unit, type=number_parser(name), help=text)
    group.add_argument(
        "--flights",
        metavar="N",
        type=number_parser("sample_flights"),
        help="number of flights, 20 to 100,000 (default: 100)",
    )
    add_result_options(parser, "folder for the page (report.html) and the chart (battery.png) (default: no files)")


def battery(args: argparse.Namespace) -> int:
    """Find the smallest battery; return the exit code.

    The exit code is 0 if the aircraft's battery is enough, 4 if it is too small, and 3 if this is not known.
    """
    from logs.verdict.conditions import flown_condition_lines
    from planfly.api import campaigns
    from planfly.campaigns.battery_text import answer_line, battery_lines

    result = campaigns.battery(**args.options)
    ok = result.is_enough
    code = INCOMPLETE if ok is None else FLYABLE if ok else NOT_FLYABLE
    print(f"battery   {colour_text(answer_line(result), 'warning' if ok is None else 'good' if ok else 'bad')}")
    for text in (*flown_condition_lines(result.base.conditions()), *battery_lines(result)):
        print(f"  {text}")
    for path in result.files:
        print(f"  written {path}")
    write_json_if_requested(args, lambda: _json_answer(str(args.target), result, code))
    return code


def _json_answer(target: str, result: "BatteryResult", code: int) -> "BatteryAnswer":
    """Return the answer of ``planfly battery`` for --json."""
    from planfly.campaigns.battery_text import answer_line
    from planfly.terminal.battery_answers import BatteryAnswer, DecisionEntry, finite_or_none

    goal = result.goal
    return BatteryAnswer(
        exit_code=code,
        what=target,
        headline=answer_line(result),
        is_enough=result.is_enough,
        capacity_wh=finite_or_none(result.capacity),
        lowest_wh=finite_or_none(result.interval.low),
        highest_wh=finite_or_none(result.interval.high),
        own_capacity_wh=None if result.is_guessed else result.own_capacity,
        mass_kg=result.mass * result.mass_factor,
        probability=goal.probability,
        confidence=goal.confidence,
        reserve=goal.reserve,
        specific_energy_wh_kg=goal.specific_energy,
        flights=len(result.rows),
        completed=len(result.completed),
        kept_by_own_battery=result.kept,
        decisions=[
            DecisionEntry(
                flights=decision.flights,
                returns_from_leg=None if decision.leg < 0 else decision.leg,
                start_s=finite_or_none(decision.time),
            )
            for decision in result.decisions
        ],
        leg_energies_wh=[round(float(energy), 3) for energy in result.leg_energies],
        conditions=result.base.conditions(),
        files=[str(file) for file in result.files],
    )
