"""Options that several commands take, in the groups in which their help shows them."""

import argparse
import contextlib
import ipaddress
import math
import signal
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Protocol

from planfly.terminal.arguments import (
    MISSIONS,
    aircraft_words,
    completed,
    files,
    mission_or_scenario_words,
    positive,
    positive_count,
    scenario_words,
    seed,
    wind,
)
from planfly.terminal.command_parser import CommandParser, OptionTaker
from world.errors import FlightError
from world.files import whole_path

# Help is given without what a command needs to run.
if TYPE_CHECKING:
    from flight.live.link import Access
    from planfly.crash_safe_log import FlightLimits
    from world.scenario import Scenario

# ----------------------------------------------------------------------
# The option that has a real autopilot fly.


def autopilot_program(args: argparse.Namespace) -> Path | None:
    """The program that ``--autopilot`` names, None without it.  Raises FlightError for what cannot be run."""
    if args.autopilot is None:
        return None
    # Imported here: nobody else needs MAVLink.
    from flight.autopilots.arduplane_sitl.process import check_binary

    program = Path(args.autopilot)
    check_binary(program)
    return program


def result_options(parser: CommandParser, out: str = "", what: str = "DIR", *, json: bool = True) -> None:
    """Where results go, and how much is said.

    out: what --out names, "" for a command without it.  what: its placeholder.
    """
    group = parser.group("results")
    if out:
        group.add_argument("--out", metavar=what, help=out)
    group.add_argument("--overwrite", action="store_true", help="replace named targets that exist")
    if json:
        json_option(group, parser.prog.split()[-1])


def json_option(group: OptionTaker, command: str) -> None:
    """The answer as data, and silence."""
    group.add_argument(
        "--json",
        metavar="FILE",
        help="write the answer as JSON, too; - writes it to standard output and nothing else there "
        f"(planfly help {command} --schema describes it)",
    )
    group.add_argument(
        "--quiet", action="store_true", help="print neither progress nor result; the exit code tells, and errors do"
    )


def world_options(parser: CommandParser) -> None:
    """What a mission is judged in."""
    group = parser.group("where it flies")
    completed(
        group.add_argument(
            "--scenario", metavar="SCENARIO", help="judge within this scenario: a TOML file or an embedded name"
        ),
        scenario_words,
    )
    terrain_option(group)
    fence_option(group)


def terrain_option(group: OptionTaker) -> None:
    """The ground."""
    group.add_argument("--terrain", metavar="DEM", help="elevation file (.tif, .hgt, .npz) or embedded name: jacksboro")


def fence_option(group: OptionTaker) -> None:
    """Fences beside the mission's own."""
    found = group.add_argument(
        "--fence",
        metavar="FILE",
        action="append",
        default=[],
        help="keep to this fence, too: .fence, .waypoints, .txt or .plan, or zones in .geojson or .kml; repeatable",
    )
    completed(found, files("fence", "geojson", "kml", *MISSIONS))


def flown_by_options(parser: CommandParser) -> None:
    """What flies it, in which wind."""
    group = parser.group("what flies it, in which air")
    completed(
        group.add_argument(
            "--aircraft",
            metavar="AIRCRAFT",
            help="a name that planfly aircraft lists, or a folder (default: aerosonde)",
        ),
        aircraft_words,
    )
    group.add_argument(
        "--airspeed", metavar="M/S", type=positive,
        help="true airspeed until the mission sets one, m/s (default: the aircraft's cruise)",
    )  # fmt: skip
    group.add_argument(
        "--wind", metavar="SPEED,FROM", type=wind,
        help="steady wind: m/s and the degrees it blows from, 8,270 from the west (default: the scenario's, or none)",
    )  # fmt: skip
    turbulence_option(group)


def turbulence_option(group: OptionTaker) -> None:
    """The gusts."""
    group.add_argument(
        "--turbulence", choices=("none", "light", "moderate"), help="gusts (default: the scenario's, or none)"
    )


def pilot_options(parser: CommandParser) -> OptionTaker:
    """Who flies it."""
    group = parser.group("who steers")
    found = group.add_argument(
        "--params", metavar="FILE", help="ArduPlane flies, with these parameters: as a ground station writes them"
    )
    completed(found, files("param", "parm", "params"))
    group.add_argument(
        "--guidance",
        choices=("path", "l1", "vector-field"),
        help="planfly's guidance flies: its own law (path), L1 along the legs, or Beard and McLain's vector field "
        "(default: ArduPlane's law, with its default parameters)",
    )
    return group


def steering_options(parser: CommandParser) -> OptionTaker:
    """Who flies it, and how well it knows where it is."""
    group = pilot_options(parser)
    group.add_argument(
        "--nav",
        choices=("perfect", "rtk", "gnss"),
        help="how well it knows where it is: errors of 0, 0.05 or 1.5 m on each axis (default: gnss for ArduPlane, "
        "perfect for planfly's guidance)",
    )
    return group


def flight_options(parser: CommandParser) -> None:
    """What decides a flight beside its mission: what flies it, who steers, and where it ends that would go on."""
    flown_by_options(parser)
    program_option(steering_options(parser))
    limit_options(parser)


def program_option(group: OptionTaker) -> None:
    """Which real autopilot flies it."""
    group.add_argument(
        "--autopilot",
        metavar="PATH",
        help="a real ArduPlane flies in our physics: its program, as built for software in the loop",
    )


def limit_options(parser: CommandParser) -> None:
    """Where a flight ends that would go on."""
    group = parser.group("how long")
    group.add_argument(
        "--max-hours",
        metavar="H",
        type=positive,
        default=6.0,
        help="simulated hours that are flown at most (default: 6)",
    )
    group.add_argument(
        "--max-log", metavar="MB", type=positive, default=256.0,
        help="the flight ends when its log has so many MB (default: 256; it grows by some 20 an hour)",
    )  # fmt: skip


def own_link_options(parser: CommandParser, *, bind: str) -> None:
    """Where and with whom a vehicle speaks MAVLink."""
    group = parser.group("the link")
    group.add_argument("--bind", metavar="IP:PORT", default=bind, help=f"where the vehicle listens (default: {bind})")
    group.add_argument("--allow", metavar="IP,IP", help="stations beyond this machine that may talk to the vehicle")
    group.add_argument(
        "--sign-key", metavar="FILE", help="MAVLink signing key: 64 hex digits or a passphrase; mode 600"
    )


def imported_log_options(parser: CommandParser) -> None:
    """What a person says of an imported log."""
    group = parser.group("an imported log")
    found = group.add_argument(
        "--plan", metavar="MISSION", help="what was to be flown, in place of the log's own mission"
    )
    completed(found, files(*MISSIONS))
    group.add_argument(
        "--flight", metavar="N", type=positive_count, help="which of the log's flights (default: the longest in AUTO)"
    )
    group.add_argument(
        "--datum", choices=("amsl", "ellipsoid"), help="what the log's heights are above, where it does not say"
    )


# ----------------------------------------------------------------------
# The options of commands that talk to ground stations, and how they are ended.


class Stopped:
    """Whether a signal has asked the command to end."""

    def __init__(self) -> None:
        self._asked = False

    def __call__(self) -> bool:
        """Say whether to stop."""
        return self._asked

    def ask(self, _number: int, _frame: FrameType | None) -> None:
        """Handle the signal."""
        self._asked = True


@contextlib.contextmanager
def stop_signals() -> Iterator[Stopped]:
    """Turn SIGINT and SIGTERM into a question, so that logs are closed in order."""
    stopped = Stopped()
    kept = {number: signal.signal(number, stopped.ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


def link_access(args: argparse.Namespace) -> "Access":
    """Who may talk to us, from the command line.  Raises FlightError or PlanflyError."""
    from flight.live.link import Access, check_access, read_key

    allowed = frozenset(_ip("--allow", part.strip()) for part in (args.allow or "").split(",") if part.strip())
    key = read_key(Path(args.sign_key)) if args.sign_key else None
    access = Access(
        _address("--bind", args.bind), tuple(_address("--to", text) for text in args.to.split(",")), allowed, key
    )
    check_access(access)
    return access


def _address(option: str, text: str) -> tuple[str, int]:
    host, colon, port = text.strip().rpartition(":")
    if not colon and port.isdigit():
        raise FlightError.of_option(option, text, f"IP:PORT is expected, such as 127.0.0.1:{port}")
    if not port.isdigit() or not 0 <= int(port) <= 65535:
        raise FlightError.of_option(option, text, "IP:PORT is expected, with a port 0..65535")
    return _ip(option, host.strip("[]")), int(port)


def _ip(option: str, text: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError as error:
        raise FlightError.of_option(option, text, "an IP address is expected") from error


# ----------------------------------------------------------------------
# Options that make another scenario of the one given: aircraft, airspeed, who flies, and the wind.


def flight_entries(args: argparse.Namespace) -> dict[str, str | float | None]:
    """Entries of a scenario's [flight] that the options state; None for those that were not given."""
    params = getattr(args, "params", None)
    return {
        "aircraft": getattr(args, "aircraft", None),
        "airspeed_mps": getattr(args, "airspeed", None),
        "autopilot": _program_name(args),
        "guidance": getattr(args, "guidance", None),
        "nav": getattr(args, "nav", None),
        # Whatever folder the scenario is in.
        "params": None if params is None else whole_path(Path(params)),
    }


def _program_name(args: argparse.Namespace) -> str | None:
    """The autopilot that the program of ``--autopilot`` is, as [flight] names it; None without the option."""
    if getattr(args, "autopilot", None) is None:
        return None
    from flight.autopilots.catalog import program_autopilot

    return program_autopilot(Path(args.autopilot)).name


def flight_limits(args: argparse.Namespace) -> "FlightLimits":
    """How long a flight may take, and how large its log may grow."""
    from planfly.crash_safe_log import FlightLimits

    return FlightLimits(args.max_hours, args.max_log)


def scenario_change(args: argparse.Namespace) -> "Callable[[Scenario], Scenario]":
    """What the options given change in a scenario; options that a command does not have change nothing."""
    return partial(_changed, args)


def _changed(args: argparse.Namespace, scenario: "Scenario") -> "Scenario":
    from world.scenario import with_flight, with_wind

    speed, from_deg = getattr(args, "wind", None) or (None, None)
    from_course = None if from_deg is None else math.radians(from_deg)
    flown = with_flight(scenario, **flight_entries(args))
    return with_wind(flown, speed, from_course, getattr(args, "turbulence", None))


# ----------------------------------------------------------------------
# Options of campaigns: how many flights, with what spread, on which workers, and where they go.


class _Command(Protocol):
    def __call__(self, name: str, summary: str, *examples: str) -> CommandParser: ...


def add_campaigns(command: _Command) -> None:
    """The parsers of ``campaign`` and ``winds``."""
    campaign = command(
        "campaign",
        "fly a mission many times in its weather and with the spread of real aircraft: how likely is it to fly",
        "planfly campaign jacksboro --prove 0.99",
    )
    _shared(campaign)
    goal = campaign.add_mutually_exclusive_group()
    goal.add_argument("--prove", metavar="P", type=_share, help="fly until P is reached or missed")
    goal.add_argument("--at-least", metavar="P", type=_share, help="answer after all flights whether P is reached")
    campaign.add_argument("--flights", metavar="N", type=_flights, help="how many (300), at most with --prove (5000)")
    campaign.add_argument(
        "--confidence", metavar="C", type=_share, help="of each bound (default: 0.95; with --resume what it was)"
    )
    campaign.add_argument(
        "--refly", metavar="K", type=_index, help="fly flight K of the campaign in --out again, into a log"
    )
    winds = command(
        "winds",
        "find the largest wind from each direction in which a mission flies",
        "planfly winds jacksboro --prove 0.99 --directions 16",
    )
    _shared(winds)
    winds.add_argument("--prove", metavar="P", type=_share, default=0.99, help="probability to fly (default: 0.99)")
    winds.add_argument("--confidence", metavar="C", type=_share, default=0.95, help="of each interval (default: 0.95)")
    winds.add_argument("--directions", metavar="N", type=_directions, default=16, help="4 to 72 (default: 16)")
    winds.add_argument("--most", metavar="M/S", type=_wind, default=20.0, help="wind to look up to (default: 20)")
    winds.add_argument("--flights", metavar="N", type=_flights, help="at most, of all directions (default: 5000)")


def _shared(parser: CommandParser) -> None:
    completed(
        parser.add_argument(
            "target", metavar="SCENARIO|PLAN|MISSION", help="embedded name, TOML file, plan.json, .waypoints or .plan"
        ),
        mission_or_scenario_words,
    )
    world_options(parser)
    flown_by_options(parser)
    steering_options(parser)
    completed(
        parser.add_argument("--spread", metavar="FILE", help="what varies, as TOML (default: planfly's own)"),
        files("toml"),
    )
    parser.add_argument("--seed", metavar="N", type=seed, help="of plan and draws (default: the scenario's, or 1)")
    parser.add_argument("--workers", metavar="N", type=positive_count, help="processes here (default: one a core)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="fly on a running dask cluster: tls://HOST:PORT")
    parser.add_argument("--resume", action="store_true", help="go on with what is in --out")
    result_options(parser, "where the files go (default: runs/<name>-<command>, kept)")


def _share(text: str) -> float:
    """Probability."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.5 <= value < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r}: a number from 0.5 to below 1 is expected")
    return value


def _flights(text: str) -> int:
    """How many flights."""
    if not (text.isascii() and text.isdigit() and len(text) < 9 and 1 <= int(text) <= 10_000_000):
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number from 1 to 10,000,000 is expected")
    return int(text)


def _index(text: str) -> int:
    """Index of a flight."""
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise argparse.ArgumentTypeError(f"{text!r}: a flight's index is expected, from 0")
    return int(text)


def _directions(text: str) -> int:
    """How many directions."""
    if not (text.isascii() and text.isdigit() and 4 <= int(text) <= 72):
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number from 4 to 72 is expected")
    return int(text)


def _wind(text: str) -> float:
    """Speed of a wind, m/s."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 1.0 <= value <= 40.0:
        raise argparse.ArgumentTypeError(f"{text!r}: m/s from 1 to 40 is expected")
    return value
