"""``planfly export``: write a plan, a mission or a log in the formats that the suffixes of files name."""

import argparse

from planfly.arguments import CHOICES
from planfly.terminal.arguments import (
    MISSION_SUFFIXES,
    complete_aircraft,
    complete_scenario,
    file_completer,
    with_completer,
)
from planfly.terminal.command_parser import FLYABLE, INCOMPLETE, LineParser
from planfly.terminal.options import add_fence_option, add_result_options, add_time_option
from planfly.terminal.output import print_warnings, write_json_if_requested

# Kinds of content of exported files by their suffixes; other files contain missions.
_CONTENT_KINDS = {
    **dict.fromkeys((".kml", ".gpx"), "map"),
    ".parm": "settings",
    **dict.fromkeys((".csv", ".parquet", ".tlog", ".ulg"), "flight"),
}


def add_export_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly export``."""
    parser = command_line.add_command(
        "export",
        "convert a plan, mission or log to the formats given by the suffixes of the files",
        "planfly export plan.json mission.waypoints mission.fence mission.plan plan.kml",
    )
    with_completer(
        parser.add_argument(
            "source",
            metavar="PLAN.json|MISSION|LOG.mcap",
            help="a plan that planfly made, a mission file, or a flight log",
        ),
        file_completer("mcap", *MISSION_SUFFIXES),
    )
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="files to write: .waypoints, .plan, .fence, .rally, .kml, .gpx or .parm (parameters for take-off, "
        "landing and returns). A flight log can also be written as .csv, .parquet (requires planfly[tables]), .tlog"
        " (MAVLink; requires planfly[live]) or .ulg (PX4)",
    )
    with_completer(
        parser.add_argument(
            "--scenario",
            metavar="SCENARIO",
            help="scenario of the mission: a TOML file, or the name of a built-in scenario",
        ),
        complete_scenario,
    )
    group = parser.add_group("autopilot of a .plan or .parm (default: the source's)")
    group.add_argument(
        "--autopilot",
        choices=CHOICES["autopilot"],
        help="autopilot for which the .plan (its firmwareType) or .parm is written",
    )
    option = group.add_argument(
        "--params", metavar="FILE", help="parameter file of the autopilot, whose values a .parm contains"
    )
    with_completer(option, file_completer("param", "parm", "params"))
    aircraft_option = group.add_argument(
        "--aircraft",
        metavar="AIRCRAFT",
        help="aircraft of the mission: its cruise speed is written to a .plan, and its parameters to a .parm"
        " (default: aerosonde)",
    )
    with_completer(aircraft_option, complete_aircraft)
    add_fence_option(parser)
    add_time_option(parser)
    add_result_options(parser)


def export(args: argparse.Namespace) -> int:
    """Write the source in the format of each target file.

    Return the exit code: 3 for an incomplete log, else 0.
    """
    from planfly.api import exporting

    names = ("fence", "at", "scenario", "autopilot", "params", "aircraft", "overwrite")
    options = {name: getattr(args, name) for name in names}
    result = exporting.export(args.source, *args.files, **options)
    print_warnings(result.notes)
    for file, content in zip(result.files, result.contents, strict=True):
        kind = _CONTENT_KINDS.get(file.suffix.lower(), "mission")
        print(f"{kind:<9} {file} ({content})")
    code = INCOMPLETE if result.loss else FLYABLE

    def json_answer() -> object:
        """Return the answer of ``planfly export`` for --json."""
        from planfly.terminal.answers import ExportAnswer, ExportedFile

        pairs = zip(result.files, result.contents, strict=True)
        exported = [ExportedFile(file=str(file), content=content) for file, content in pairs]
        notes = [note for note in result.notes if note != result.loss]
        return ExportAnswer(exit_code=code, files=exported, warnings=notes)

    write_json_if_requested(args, json_answer)
    return code
