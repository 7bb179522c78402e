"""``planfly link``: judge the radio link between a ground station and an aircraft along a flight."""

import argparse
from typing import TYPE_CHECKING

from planfly.arguments import CHOICES
from planfly.commands.check import add_mission_or_log_argument
from planfly.terminal.arguments import number_parser, parse_position
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, NOT_FLYABLE, LineParser, colour_text
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_imported_log_options,
    add_result_options,
    add_steering_options,
    add_world_options,
)
from planfly.terminal.output import write_json_if_requested

if TYPE_CHECKING:
    from planfly import LinkResult


def add_link_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly link``."""
    parser = command_line.add_command(
        "link",
        "compute the radio link to the ground station along a flight: margin, line of sight, outages behind the"
        " terrain, and what the autopilot does when the link is lost",
        "planfly link mission.waypoints --terrain jacksboro --frequency 915 --power 27 --sensitivity -105",
        "planfly link flight.mcap --scenario mine.toml --out pictures",
    )
    add_mission_or_log_argument(parser)
    group = parser.add_group("the link (each replaces an entry of the scenario's [link])")
    for name, unit, text in (
        ("frequency", "MHZ", "frequency, MHz"),
        ("power", "DBM", "output power of the transmitter, dBm"),
        ("sensitivity", "DBM", "lowest received power at which the receiver works, dBm"),
        ("antenna", "M", "height of the station's antenna above ground, m (default: 3)"),
        ("station_gain", "DBI", "gain of the station's antenna, dBi (default: 0)"),
        ("aircraft_gain", "DBI", "gain of the aircraft's antenna, dBi (default: 0)"),
        ("cable_loss", "DB", "losses of cables and connectors at both ends, dB (default: 0)"),
        ("fade_margin", "DB", "required margin of the received power above the sensitivity, dB (default: 10)"),
        ("max_outage", "S", "longest accepted time with less than the fade margin, s (default: 0)"),
    ):
        group.add_argument(f"--{name.replace('_', '-')}", metavar=unit, type=number_parser(name), help=text)
    group.add_argument(
        "--station",
        metavar="LAT,LON",
        type=parse_position,
        help="position of the station's antenna, degrees (default: the mission's home)",
    )
    group.add_argument(
        "--use",
        choices=CHOICES["use"],
        help="kind of link: telemetry (to the ground station) or control (from the remote control). It decides how the"
        " autopilot reacts when the link is lost (default: telemetry)",
    )
    add_imported_log_options(parser)
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_steering_options(parser).add_argument(
        "--seed", metavar="N", type=number_parser("seed"), help="seed of the turbulence (default: the plan's, or 1)"
    )
    add_result_options(
        parser,
        "folder for the files: pictures of the link margin over time and on a map, and the coverage as a GeoTIFF"
        " (default: no files)",
    )


def link(args: argparse.Namespace) -> int:
    """Judge the radio link; return the exit code.

    The exit code is 0 if the link is never lost for longer than accepted, 4 if it is, and 3 if this is not known.
    """
    from logs.verdict.conditions import flown_condition_lines, judging_conditions
    from planfly.api import linking

    result = linking.link(**args.options)
    ok = result.finding.ok
    code = INCOMPLETE if ok is None else FLYABLE if ok else NOT_FLYABLE
    print(f"link      {colour_text(result.finding.reason, 'warning' if ok is None else 'good' if ok else 'bad')}")
    for text in (*flown_condition_lines(judging_conditions(result.setup)), *result.outage_lines, *result.return_lines):
        print(f"  {text}")
    for path in result.files:
        print(f"  written {path}")
    write_json_if_requested(args, lambda: _json_answer(str(args.what), result, code))
    return code


def _json_answer(source: str, result: "LinkResult", code: int) -> object:
    """Return the answer of ``planfly link`` for --json."""
    from logs.verdict.conditions import judging_conditions
    from logs.verdict.returns.returns_text import returns_headline
    from planfly.terminal.link_answers import LinkAnswer, OutageEntry

    outages = () if result.along is None else result.along.outages
    entries = [
        OutageEntry(
            first_s=round(outage.start, 2),
            last_s=round(outage.end, 2),
            margin_db=round(worst_point.margin, 2),
            lat_deg=round(worst_point.lat_deg, 7),
            lon_deg=round(worst_point.lon_deg, 7),
        )
        for outage, worst_point in zip(outages, result.worst_points, strict=True)
    ]
    return LinkAnswer(
        exit_code=code,
        what=source,
        headline=result.finding.reason,
        ok=result.finding.ok,
        conditions=judging_conditions(result.setup),
        facts={fact.what: fact.value for fact in result.finding.facts},
        where=result.where,
        outages=entries,
        returns=None if result.returns is None else returns_headline(result.returns),
        files=[str(path) for path in result.files],
    )
