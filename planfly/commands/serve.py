"""``planfly serve``: simulate a vehicle for ground stations.

Stations connect to upload missions, arm and follow it.
"""

import argparse

from planfly.terminal.arguments import MISSION_SUFFIXES, file_completer, number_parser, with_completer
from planfly.terminal.command_parser import FLYABLE, LineParser
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_steering_options,
    add_vehicle_link_options,
    add_world_options,
    print_and_flush,
    watch_stop_signals,
)

# Help text on the modes and commands of the vehicle.
_VEHICLE_HELP = """
It flies the modes AUTO, LOITER, GUIDED (to a position) and RTL, and changes between them in flight.
Before a flight, ground stations can list, read and set parameters by name: the parameters of the simulated autopilot,
and PFLY_FORCE.  With PFLY_FORCE 1 the vehicle arms and flies even a mission that is judged not flyable (default: 0)."""


def add_serve_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly serve``."""
    parser = command_line.add_command(
        "serve",
        "simulate a MAVLink vehicle: a ground station uploads a mission, arms and starts the vehicle, and monitors it",
        "planfly serve mission.waypoints --terrain jacksboro",
        extra="live",
        details=_VEHICLE_HELP,
    )
    with_completer(
        parser.add_argument("mission", metavar="MISSION", nargs="?", help="mission to load at start-up"),
        file_completer(*MISSION_SUFFIXES),
    )
    add_world_options(parser)
    add_aircraft_and_wind_options(parser)
    add_steering_options(parser)
    parser.add_argument(
        "--to",
        metavar="IP:PORT,...",
        default="127.0.0.1:14550",
        help="address at which ground stations listen (default: 127.0.0.1:14550)",
    )
    add_vehicle_link_options(parser, bind="127.0.0.1:14580")
    parser.add_argument(
        "--speed",
        metavar="X",
        type=number_parser("served_speed"),
        default=1.0,
        help="fly X times as fast as real time, 0.1 to 100 (default: 1)",
    )
    parser.add_argument(
        "--log", metavar="DIR", default="runs/serve", help="folder of the flight logs (default: runs/serve)"
    )


def serve(args: argparse.Namespace) -> int:
    """Serve the simulated vehicle until SIGINT or SIGTERM; return the exit code 0."""
    from planfly.api import serving

    with watch_stop_signals() as should_stop:
        serving.serve(**args.options | {"stop": should_stop, "on_message": print_and_flush})
    return FLYABLE
