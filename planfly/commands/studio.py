"""``planfly studio``: serve a local page on which a mission is dragged, judged and flown."""

import argparse

from planfly.terminal.arguments import (
    IMPORTED_LOG_SUFFIXES,
    MISSION_SUFFIXES,
    file_completer,
    number_parser,
    with_completer,
)
from planfly.terminal.command_parser import FLYABLE, LineParser
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_autopilot_options,
    add_world_options,
    print_and_flush,
    watch_stop_signals,
)

# Help text on mouse and keyboard.
_CONTROLS_HELP = """
Drag waypoints on the map, and their heights on the profile below it.  A diamond on a leg inserts a waypoint.  During a
drag only the geometry is judged; after the drag the simulated autopilot flies the mission.  Keys: the arrows move a
waypoint by 10 m (with Shift 100 m), Page Up and Page Down change its height by 5 m, and Delete deletes it.  Ctrl+Z and
Ctrl+Shift+Z undo and redo, and Escape cancels a drag.
The page can be reached only from this machine, at the printed address."""


def add_studio_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly studio``."""
    parser = command_line.add_command(
        "studio",
        "open a page on which you drag a mission while it is judged, fly it, and save it",
        "planfly studio jacksboro",
        "planfly studio mission.waypoints --terrain jacksboro --no-browser",
        extra="studio",
        details=_CONTROLS_HELP,
    )
    with_completer(
        parser.add_argument(
            "what",
            metavar="SCENARIO|MISSION|PLAN",
            nargs="?",
            help=(
                "a scenario (name or .toml), for which a path is planned; a plan.json, .waypoints or "
                ".plan; or a log, whose mission is opened (default: jacksboro)"
            ),
        ),
        file_completer("toml", "mcap", *MISSION_SUFFIXES, *IMPORTED_LOG_SUFFIXES),
    )
    parser.add_argument(
        "--port",
        metavar="PORT",
        type=number_parser("port"),
        help="port of the studio (default: 8790, or any free port)",
    )
    parser.add_argument(
        "--no-browser",
        dest="browser",
        action="store_const",
        const=False,
        help="print the address without opening a browser",
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=number_parser("seed"),
        help="seed of planner and turbulence (default: the scenario's, or 1)",
    )
    parser.add_argument(
        "--keep",
        metavar="DIR",
        help="folder in which the session is saved, and from which the next start restores it (default: runs/studio)",
    )
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_autopilot_options(parser)


def studio(args: argparse.Namespace) -> int:
    """Serve the studio's page until SIGINT or SIGTERM; return the exit code 0."""
    from planfly.studio.open_studio import open_studio

    with watch_stop_signals() as should_stop:
        open_studio(**args.options | {"stop": should_stop, "on_message": print_and_flush})
    return FLYABLE
