"""Options of campaigns: how many flights, with what spread, on which workers, and where they go."""

import argparse
from typing import Protocol

from planfly.terminal.argument_types import positive_count, seed
from planfly.terminal.command_parser import CommandParser
from planfly.terminal.completion import completed, files, mission_or_scenario_words
from planfly.terminal.parser_options import flown_by_options, result_options, steering_options, world_options


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
