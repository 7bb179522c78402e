"""Add options that several commands share.

The dest of an option is the matching keyword of the API, so that no table of names is needed.
"""

import argparse
import contextlib
import inspect
import signal
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from planfly.arguments import CHOICES
from planfly.terminal.arguments import (
    MISSION_SUFFIXES,
    complete_aircraft,
    complete_scenario,
    file_completer,
    number_parser,
    parse_wind,
    with_completer,
)
from planfly.terminal.command_parser import CommandParser, OptionGroup
from world.airspace.zone_suffixes import SUFFIXES as ZONES
from world.elevation_formats import EMBEDDED, SUFFIXES


def given_options(args: argparse.Namespace, function: Callable[..., object], /, **overrides: Any) -> dict[str, Any]:
    """Return the given options that are keywords of one function.

    It is for a command that calls several functions of the API.

    A command that calls one function passes `args.options`, see `planfly.terminal.command_parser.LineParser`.

    overrides: keywords that override the options; None keeps the default of the function.

    >>> given_options(argparse.Namespace(seed=3, width=80, out=None), lambda *, seed, out: seed, seed=4)
    {'seed': 4}
    """
    keywords = inspect.signature(function).parameters
    options = {name: value for name, value in vars(args).items() if name in keywords} | overrides
    return {name: value for name, value in options.items() if value is not None}


# ----------------------------------------------------------------------
# Options for output files, and for the amount of printed text.


def add_result_options(
    parser: CommandParser, out: str = "", placeholder: str = "DIR", *, json: bool = True, junit: bool = False
) -> None:
    """Add the options for output files and for how much text is printed.

    out: help text of --out, or "" for a command without this option.
    placeholder: placeholder for the value of --out.
    json: True adds --json and --quiet.
    junit: True adds --junit, for a command whose answer is a verdict.
    """
    group = parser.add_group("results")
    if out:
        group.add_argument("--out", metavar=placeholder, help=out)
    group.add_argument("--overwrite", action="store_true", help="replace output files that exist")
    if json:
        add_json_and_quiet_options(group, parser.prog.split()[-1])
    if junit:
        group.add_argument(
            "--junit", metavar="FILE", help="also write the verdict as JUnit XML, for continuous integration"
        )


def add_json_and_quiet_options(group: OptionGroup, command: str) -> None:
    """Add the options --json and --quiet.  command: name of the command, for the help text."""
    group.add_argument(
        "--json",
        metavar="FILE",
        help="also write the result as JSON to FILE. If FILE is -, the result goes to standard output and all other "
        f"output to standard error. 'planfly help {command} --schema' prints the JSON schema",
    )
    group.add_argument(
        "--quiet", action="store_true", help="print neither progress nor results; errors and the exit code remain"
    )


# ----------------------------------------------------------------------
# Options for the world of a flight, its aircraft and its autopilot.


def add_world_options(parser: CommandParser) -> OptionGroup:
    """Add the options for the world in which a mission is judged, and return their group."""
    group = parser.add_group("where it flies")
    with_completer(
        group.add_argument(
            "--scenario",
            metavar="SCENARIO",
            help="judge against this scenario: a TOML file, or the name of a built-in scenario",
        ),
        complete_scenario,
    )
    add_terrain_option(group)
    add_fence_option(group)
    return group


def add_terrain_option(group: OptionGroup) -> None:
    """Add the option for the terrain."""
    suffixes, names = ", ".join(SUFFIXES), ", ".join(EMBEDDED)
    help_text = (
        f"elevation file ({suffixes}), a folder or .vrt of such tiles, or the name of a built-in terrain: {names}"
    )
    group.add_argument("--terrain", metavar="DEM", help=help_text)


def add_fence_option(group: OptionGroup) -> None:
    """Add the option for fences in addition to the fences of the mission."""
    option = group.add_argument(
        "--fence",
        metavar="FILE",
        action="append",
        default=[],
        help="also respect a fence (.fence, .waypoints, .txt, .plan) or airspace zones (.geojson, .json including "
        "ED-269 and ED-318, .kml, .openair, .gpkg), or use rally points (.rally, .waypoints); repeatable",
    )
    with_completer(option, file_completer("fence", *(suffix[1:] for suffix in ZONES), *MISSION_SUFFIXES))


def add_time_option(group: OptionGroup) -> None:
    """Add the option for the time of the flight."""
    group.add_argument(
        "--at",
        metavar="TIME",
        help=(
            "time of the flight in ISO 8601 format, START or START/END, such as 2026-05-01T10:00+02:00. Zones that "
            "are inactive at this time are ignored. A forecast is read from START on (default: all zones are active)"
        ),
    )


def add_aircraft_and_wind_options(parser: CommandParser) -> None:
    """Add the options for the aircraft and the wind."""
    group = parser.add_group("aircraft and weather")
    with_completer(
        group.add_argument(
            "--aircraft",
            metavar="AIRCRAFT",
            help="an aircraft listed by 'planfly aircraft', or the folder of one (default: aerosonde)",
        ),
        complete_aircraft,
    )
    group.add_argument(
        "--airspeed",
        metavar="M/S",
        type=number_parser("airspeed"),
        help="airspeed in m/s until the mission sets another: equivalent airspeed with ArduPlane and PX4, true "
        "airspeed with planfly's guidance (default: the aircraft's cruise speed)",
    )
    group.add_argument(
        "--wind",
        metavar="SPEED,FROM",
        type=parse_wind,
        help="steady wind: its speed in m/s, and the direction it blows from in degrees; 8,270 is 8 m/s from the west "
        "(default: the scenario's, or none)",
    )
    add_turbulence_option(group)
    add_forecast_option(group)
    add_time_option(group)


def add_forecast_option(group: OptionGroup) -> None:
    """Add the option for the forecast of the wind."""
    option = group.add_argument(
        "--forecast",
        metavar="FILE",
        help="weather forecast (NetCDF, GRIB, or JSON from Open-Meteo) that gives the wind by time, height and place; "
        "--at gives the time of take-off (NetCDF requires planfly[forecast], GRIB planfly[grib])",
    )
    with_completer(option, file_completer("nc", "nc4", "grib", "grib2", "grb2", "json"))


def add_turbulence_option(group: OptionGroup) -> None:
    """Add the option for the turbulence."""
    group.add_argument(
        "--turbulence",
        choices=CHOICES["turbulence"],
        help="turbulence level of MIL-F-8785C, by the standard deviation of the vertical gusts: light 0.77 m/s, "
        "moderate 1.54 m/s (default: the scenario's, or none)",
    )


def add_autopilot_options(parser: CommandParser) -> OptionGroup:
    """Add the options for the autopilot, and return their group."""
    group = parser.add_group("autopilot")
    option = group.add_argument(
        "--params",
        metavar="FILE",
        help=(
            "parameter file of the simulated autopilot, as saved by a ground station; it also "
            "selects the autopilot if --autopilot is missing"
        ),
    )
    with_completer(option, file_completer("param", "parm", "params"))
    group.add_argument(
        "--autopilot",
        choices=CHOICES["autopilot"],
        help=(
            "simulated autopilot: ardupilot (ArduPlane, the default), px4 (PX4 for fixed wing) or planfly (planfly's "
            "own guidance). A name without a release number stands for the release that saved the parameter file; "
            "without a parameter file, for the newest release"
        ),
    )
    group.add_argument(
        "--guidance",
        choices=CHOICES["guidance"],
        help="fly with planfly's own guidance instead of an autopilot: path follows the legs and the arcs at "
        "waypoints, l1 follows the legs with L1 guidance, vector-field follows both with "
        "Beard and McLain's vector field",
    )
    return group


def add_steering_options(parser: CommandParser) -> OptionGroup:
    """Add the options for the autopilot and its position errors, and return their group."""
    group = add_autopilot_options(parser)
    group.add_argument(
        "--nav",
        choices=CHOICES["nav"],
        help="position error of the navigation on each axis: perfect 0 m, rtk 0.05 m, gnss 1.5 m (default: gnss "
        "for autopilots, perfect for planfly's guidance)",
    )
    return group


def add_sitl_option(group: OptionGroup, help_text: str) -> None:
    """Add the option --sitl for the path of an autopilot's program.  help_text: help of the option."""
    group.add_argument("--sitl", metavar="PATH", help=help_text)


def add_flight_options(parser: CommandParser) -> None:
    """Add the options for a flight's aircraft, weather, autopilot and limits."""
    add_aircraft_and_wind_options(parser)
    group = add_steering_options(parser)
    add_sitl_option(
        group,
        "fly with ArduPlane or PX4 itself instead of the simulated autopilot. PATH is its executable, built for "
        "software in the loop (requires planfly[live])",
    )
    group.add_argument(
        "--engine",
        choices=CHOICES["engine"],
        help=(
            "flight model: auto (default) uses the compiled model if its results are bit-identical to JSBSim's, "
            "jsbsim always uses JSBSim"
        ),
    )
    group.add_argument(
        "--levels",
        action="store_true",
        help="also fly the mission with planfly's own guidance, and compare the two flights (default: only if the "
        "flight fails, to find the cause)",
    )
    limits = parser.add_group("limits of the flight")
    limits.add_argument(
        "--max-hours",
        metavar="H",
        type=number_parser("max_hours"),
        help="stop after this many simulated hours (default: 6)",
    )
    limits.add_argument(
        "--max-log",
        metavar="MB",
        type=number_parser("max_log"),
        help="stop when the log reaches this size, MB (default: 256; it grows by about 20 MB per hour)",
    )


def add_flights_option(group: OptionGroup) -> None:
    """Add the option --flights, for dispersed flights of the finished plan."""
    group.add_argument(
        "--flights",
        metavar="N",
        type=number_parser("flights"),
        help="after planning, fly the plan N times with the default dispersions of 'planfly campaign'. The output "
        "states the share of flyable flights, and changes that would raise this share. The exit code is 4 if the "
        "whole confidence interval of the share is below 0.95. 40 flights take about 20 s",
    )


def add_log_rate_option(group: OptionGroup) -> None:
    """Add the option for the rows per second in the log."""
    group.add_argument(
        "--log-hz",
        metavar="HZ",
        type=int,
        choices=CHOICES["log_hz"],
        help="rows per second in the log: 60 (default), 30, 20 or 10; the verdict is computed from these rows",
    )


def add_imported_log_options(parser: CommandParser) -> None:
    """Add the options for data that another program's log may lack.

    The options state the log's mission, flight number and altitude datum.
    """
    group = parser.add_group("an autopilot's log")
    option = group.add_argument("--plan", metavar="MISSION", help="planned mission (default: the mission in the log)")
    with_completer(option, file_completer(*MISSION_SUFFIXES))
    group.add_argument(
        "--flight",
        metavar="N",
        type=number_parser("flight"),
        help="number of the flight in the log (default: the longest flight in AUTO mode)",
    )
    group.add_argument(
        "--datum",
        choices=CHOICES["datum"],
        help="datum of the altitudes in the log, if the log does not state it: mean sea level (amsl) or the WGS 84 "
        "ellipsoid",
    )


def add_log_argument(
    parser: CommandParser, name: str = "log", metavar: str = "LOG.mcap", help_text: str = "a flight log"
) -> None:
    """Add the argument for a flight log to read."""
    with_completer(parser.add_argument(name, metavar=metavar, help=help_text), file_completer("mcap"))


def add_scenario_argument(parser: CommandParser, **settings: object) -> None:
    """Add the argument for a scenario to plan in."""
    with_completer(
        parser.add_argument("scenario", metavar="SCENARIO", **settings),  # type: ignore[arg-type]
        complete_scenario,
    )


# ----------------------------------------------------------------------
# Options for the links of commands that talk to ground stations, and the end of these commands.


def add_vehicle_link_options(parser: CommandParser, *, bind: str) -> None:
    """Add the options for the MAVLink connection of a simulated vehicle.  bind: default of --bind."""
    group = parser.add_group("the link")
    group.add_argument(
        "--bind", metavar="IP:PORT", default=bind, help=f"address at which the vehicle listens (default: {bind})"
    )
    group.add_argument(
        "--allow", metavar="IP,IP", help="IP addresses of other machines whose ground stations may talk to the vehicle"
    )
    group.add_argument(
        "--sign-key",
        metavar="FILE",
        help="file with the MAVLink signing key: 64 hexadecimal digits or a passphrase. Only the file's owner may"
        " have access to it (mode 600)",
    )


@contextlib.contextmanager
def watch_stop_signals() -> Iterator[Callable[[], bool]]:
    """Catch SIGINT and SIGTERM while the block runs.

    Yields a function that returns True once one of the two signals has arrived.
    """
    should_stop = False

    def request_stop(_number: int, _frame: FrameType | None) -> None:
        """Record that a signal to stop has arrived."""
        nonlocal should_stop
        should_stop = True

    previous_handlers = {number: signal.signal(number, request_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: should_stop
    finally:
        for number, handler in previous_handlers.items():
            signal.signal(number, handler)


def print_and_flush(text: str) -> None:
    """Print a line of a long-running command, and flush the stream."""
    print(text, flush=True)
