"""Options that several commands take, in the groups in which their help shows them."""

from planfly.terminal.argument_types import positive, positive_count, wind
from planfly.terminal.command_parser import CommandParser, OptionTaker
from planfly.terminal.completion import MISSIONS, aircraft_words, completed, files, scenario_words


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


def field_log_options(parser: CommandParser) -> None:
    """What a person says of a log of the field."""
    group = parser.group("a log of the field")
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
