"""The parsers of the commands that take logs of the field."""

import argparse
from collections.abc import Callable

from planfly.terminal.parser_options import field_log_options, flown_by_options, overwrite_option, world_options

CommandParser = Callable[[str, str, str], argparse.ArgumentParser]

LOGS = "LOG.BIN|.tlog|.ulg|.gpx|.igc|.kml|.kmz"


def add_field_commands(command: CommandParser) -> None:
    """``import`` and ``refly``."""
    importing = command(
        "import", "make a flight log of planfly's own of a log from the field, and judge the flight against its plan",
        "planfly import 00000042.BIN flight.mcap --terrain dem.tif --aircraft aerosonde",
    )  # fmt: skip
    importing.add_argument("log", metavar=LOGS, help="a log of ArduPilot, of a ground station, of PX4, or a track")
    importing.add_argument("target", metavar="FLIGHT.mcap", help="the flight log to write")
    field_log_options(importing)
    world_options(importing)
    flown_by_options(importing)
    overwrite_option(importing)
    refly = command(
        "refly", "fly the mission of an imported flight again in JSBSim, in the wind of its log: where the two differ",
        "planfly refly flight.mcap --out refly",
    )  # fmt: skip
    refly.add_argument("log", metavar="FLIGHT.mcap", help="a flight log that import wrote")
    refly.add_argument("--aircraft", metavar="A", help="the aircraft that flies it again (default: the log's)")
    refly.add_argument("--turbulence", choices=("none", "light", "moderate"), help="in place of the log's scenario's")
    refly.add_argument("--out", metavar="DIR", help="where the pictures go (default: <log>-refly beside it, replaced)")
    overwrite_option(refly)
