"""The parsers of the commands that take logs of the field."""

from planfly.terminal.command_parser import LineParser
from planfly.terminal.completion import FIELD_LOGS, aircraft_words, completed, files
from planfly.terminal.parser_options import (
    field_log_options,
    flown_by_options,
    result_options,
    turbulence_option,
    world_options,
)

LOGS = "LOG.BIN|.tlog|.ulg|.gpx|.igc|.kml|.kmz"


def add_field_commands(line: LineParser) -> None:
    """``import`` and ``refly``."""
    importing = line.command(
        "import",
        "make a flight log of planfly's own of a log from the field, and judge the flight against its plan",
        "planfly import 00000042.BIN flight.mcap --terrain dem.tif --aircraft aerosonde",
    )
    completed(
        importing.add_argument("log", metavar=LOGS, help="a log of ArduPilot, of a ground station, of PX4, or a track"),
        files(*FIELD_LOGS),
    )
    importing.add_argument("target", metavar="FLIGHT.mcap", help="the flight log to write")
    field_log_options(importing)
    world_options(importing)
    flown_by_options(importing)
    result_options(importing)
    refly = line.command(
        "refly",
        "fly the mission of an imported flight again in JSBSim, in the wind of its log: where the two differ",
        "planfly refly flight.mcap --out refly",
    )
    completed(refly.add_argument("log", metavar="FLIGHT.mcap", help="a flight log that import wrote"), files("mcap"))
    completed(
        refly.add_argument(
            "--aircraft", metavar="AIRCRAFT", help="the aircraft that flies it again (default: the log's)"
        ),
        aircraft_words,
    )
    turbulence_option(refly)
    result_options(refly, "where the pictures go (default: <log>-refly beside it, replaced)")
