"""The parsers of the commands that take flight logs."""

from planfly.terminal.argument_types import flight_time, port, positive, time_or_stations
from planfly.terminal.command_parser import CommandParser, LineParser
from planfly.terminal.completion import FIELD_LOGS, MISSIONS, completed, files
from planfly.terminal.field_parser import LOGS
from planfly.terminal.parser_options import (
    field_log_options,
    flown_by_options,
    own_link_options,
    pilot_options,
    result_options,
    world_options,
)


def add_log_commands(line: LineParser) -> None:
    """``check``, ``replay``, ``recover``, ``report`` and ``compare``."""
    check = line.command(
        "check",
        "judge a flight from its log (planfly's, or one of the field), or a mission file by its geometry alone",
        "planfly check flight.mcap --json verdict.json",
        "planfly check mission.waypoints --terrain jacksboro --json -",
    )
    completed(
        check.add_argument(
            "file", metavar="LOG|MISSION", help=f"a flight log (.mcap, or {LOGS}), or plan.json, .waypoints, .plan"
        ),
        files("mcap", *MISSIONS, *FIELD_LOGS),
    )
    field_log_options(check)
    world_options(check)
    flown_by_options(check)
    pilot_options(check)
    result_options(check)
    _add_replay(line)
    recover = line.command(
        "recover",
        "make an unfinished or damaged log whole again, as far as it can be read",
        "planfly recover flight.mcap --out whole.mcap",
    )
    _log(recover)
    result_options(recover, "the new log (default: <log>-recovered.mcap beside it)", "FILE")
    report = line.command(
        "report",
        "draw the figures and write report.html from a log alone, or write the layout for Foxglove",
        "planfly report flight.mcap --out report --svg",
    )
    completed(report.add_argument("log", metavar="LOG.mcap", nargs="?", help="a flight log"), files("mcap"))
    report.add_argument("--svg", action="store_true", help="write the figures as SVG, too")
    report.add_argument("--layout", metavar="FILE", help="write the layout file for Foxglove there, and nothing else")
    result_options(report, "where the files go (default: <log>-report beside the log, replaced)")
    compare = line.command(
        "compare",
        "lay two flights over each other: a table of differences, and pictures",
        "planfly compare calm.mcap windy.mcap --out both",
    )
    _log(compare, "first", "A.mcap")
    _log(compare, "second", "B.mcap", "another")
    compare.add_argument("--svg", action="store_true", help="write the pictures as SVG, too")
    result_options(compare, "write pictures and compare.html there (default: the table alone)")


def _log(parser: CommandParser, name: str = "log", metavar: str = "LOG.mcap", what: str = "a flight log") -> None:
    completed(parser.add_argument(name, metavar=metavar, help=what), files("mcap"))


def _add_replay(line: LineParser) -> None:
    replay = line.command(
        "replay",
        "replay a flight from its log alone: on a terminal as instruments, elsewhere as a timeline",
        "planfly replay flight.mcap --speed 20 --from 60",
        "planfly replay flight.mcap --to 127.0.0.1:14550",
    )
    _log(replay)
    part = replay.group("which part, how fast")
    part.add_argument("--from", dest="start", metavar="S", type=flight_time, help="from this time of the flight, s")
    part.add_argument(
        "--to",
        metavar="S|IP:PORT,...",
        type=time_or_stations,
        help="to this time of the flight, s; or play the log into the ground stations that listen there",
    )
    part.add_argument(
        "--speed",
        metavar="X",
        type=positive,
        help="at X times real time (default: 1 on a terminal and into Foxglove; a film of 20 s; else at once)",
    )
    part.add_argument("--at-once", action="store_true", help="the timeline at once, on a terminal too")
    other = replay.group("other ways to see it")
    other.add_argument(
        "--movie", metavar="FILE|DIR", help="draw it: FILE.gif, FILE.mp4 (needs ffmpeg), or DIR for PNG frames"
    )
    other.add_argument(
        "--foxglove",
        action="store_true",
        help="play it to Foxglove on this machine over WebSocket; needs the extra planfly[foxglove], and a viewer that"
        " speaks foxglove.sdk.v1 (Foxglove since 2025, Lichtblick after 1.21)",
    )
    other.add_argument("--port", metavar="N", type=port, default=8765, help="of --foxglove (default: 8765; 0: any)")
    other.add_argument(
        "--wait", metavar="S", type=positive,
        help="wait S seconds for a ground station (default: 10) or Foxglove (default: without end)",
    )  # fmt: skip
    own_link_options(replay, bind="127.0.0.1:0")
    result_options(replay)
