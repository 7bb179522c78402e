"""Options that several commands take."""

import argparse

from planfly.terminal.argument_types import positive, positive_count, wind


def overwrite_option(parser: argparse.ArgumentParser) -> None:
    """Whether results may replace files."""
    parser.add_argument("--overwrite", action="store_true", help="replace named targets that exist")


def world_options(parser: argparse.ArgumentParser) -> None:
    """What a mission is judged in."""
    parser.add_argument("--scenario", metavar="S", help="judge within this scenario: a TOML file or an embedded name")
    parser.add_argument("--terrain", metavar="DEM", help="elevation file (.tif, .hgt, .npz) or embedded name")
    fence_option(parser)


def fence_option(parser: argparse.ArgumentParser) -> None:
    """Fences beside the mission's own."""
    parser.add_argument(
        "--fence",
        metavar="FILE",
        action="append",
        default=[],
        help="keep to this fence, too: .fence, .waypoints, .txt or .plan, or zones in .geojson or .kml; repeatable",
    )


def flown_by_options(parser: argparse.ArgumentParser) -> None:
    """What flies it, in which wind."""
    parser.add_argument("--aircraft", metavar="A", help="the aircraft, in place of the scenario's (default: aerosonde)")
    parser.add_argument(
        "--airspeed", metavar="M/S", type=positive, help="until the mission sets one (default: the aircraft's cruise)"
    )
    parser.add_argument("--wind", metavar="SPEED,FROM", type=wind, help="steady wind, m/s and degrees it blows from")
    parser.add_argument("--turbulence", choices=("none", "light", "moderate"), help="in place of the scenario's")


def pilot_options(parser: argparse.ArgumentParser) -> None:
    """Who flies it."""
    parser.add_argument(
        "--params", metavar="FILE", help="ArduPlane flies, with these parameters: as a ground station writes them"
    )
    parser.add_argument(
        "--guidance",
        choices=("path", "l1", "vector-field"),
        help="planfly's guidance flies: its own law (path), L1 along the legs, or Beard and McLain's vector field",
    )


def steering_options(parser: argparse.ArgumentParser) -> None:
    """Who flies it, and how well it knows where it is."""
    pilot_options(parser)
    parser.add_argument(
        "--nav",
        choices=("perfect", "rtk", "gnss"),
        help="how well it knows where it is: errors of 0, 0.05 or 1.5 m on each axis (default: gnss for ArduPlane, "
        "perfect for planfly's guidance)",
    )


def program_option(parser: argparse.ArgumentParser) -> None:
    """Which real autopilot flies it."""
    parser.add_argument(
        "--autopilot",
        metavar="PATH",
        help="a real ArduPlane flies in our physics: its program, as built for software in the loop",
    )


def limit_options(parser: argparse.ArgumentParser) -> None:
    """Where a flight ends that would go on."""
    parser.add_argument(
        "--max-hours",
        metavar="H",
        type=positive,
        default=6.0,
        help="simulated hours that are flown at most (default: 6)",
    )
    parser.add_argument(
        "--max-log", metavar="MB", type=positive, default=256.0,
        help="the flight ends when its log has so many MB (default: 256; it grows by some 20 an hour)",
    )  # fmt: skip


def own_link_options(parser: argparse.ArgumentParser, *, bind: str) -> None:
    """Where and with whom a vehicle speaks MAVLink."""
    parser.add_argument("--bind", metavar="IP:PORT", default=bind, help=f"where the vehicle listens (default: {bind})")
    parser.add_argument("--allow", metavar="IP,IP", help="stations beyond this machine that may talk to the vehicle")
    parser.add_argument(
        "--sign-key", metavar="FILE", help="MAVLink signing key: 64 hex digits or a passphrase; mode 600"
    )


def field_log_options(parser: argparse.ArgumentParser) -> None:
    """What a person says of a log of the field."""
    parser.add_argument("--plan", metavar="MISSION", help="what was to be flown, in place of the log's own mission")
    parser.add_argument(
        "--flight", metavar="N", type=positive_count, help="which of the log's flights (default: the longest in AUTO)"
    )
    parser.add_argument(
        "--datum", choices=("amsl", "ellipsoid"), help="what the log's heights are above, where it does not say"
    )
