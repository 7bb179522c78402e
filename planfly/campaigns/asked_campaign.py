"""A campaign as the command line asks for it: its goal, spread, mission and folder."""

import argparse
from pathlib import Path

from planfly.campaigns.campaign_result import make_goal
from planfly.campaigns.flights.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.spread.spread_file import FlightSpread, default_spread, read_spread
from planfly.campaigns.statistics.decision import Goal
from planfly.pipeline import Advance
from planfly.terminal.progress import progress
from planfly.terminal.scenario_options import scenario_change
from planfly.terminal.targets import RESULTS
from world.errors import PlanflyError


def campaign_goal(args: argparse.Namespace) -> Goal:
    """The goal that the options state.  Raises PlanflyError."""
    try:
        return make_goal(args.flights, args.prove, args.at_least, args.confidence)
    except ValueError as error:
        name = str(error).partition(":")[0]
        raise PlanflyError(f"--{error}", field=f"--{name}", value=getattr(args, name, None)) from error


def campaign_spread(args: argparse.Namespace) -> FlightSpread:
    """The spread that the options name.  Raises SpreadError."""
    return default_spread() if args.spread is None else read_spread(Path(args.spread))


def open_base(args: argparse.Namespace, spread: FlightSpread, folder: Path | None) -> CampaignBase:
    """The mission of the options, planned if it is a scenario and the folder holds no plan of it."""
    change = scenario_change(args)

    def opened(advance: Advance | None = None) -> CampaignBase:
        return open_campaign(
            args.target,
            spread,
            planned=None if folder is None else folder / "plan.json",
            scenario_name=args.scenario,
            terrain=args.terrain,
            seed=args.seed,
            change=change,
            advance=advance,
        )

    is_file = Path(args.target).suffix.lower() in (".json", ".waypoints", ".plan")
    if is_file or (folder is not None and (folder / "plan.json").is_file()):
        return opened()
    with progress("planning") as advance:
        return opened(advance)


def default_campaign_folder(target: str, kind: str) -> Path:
    """Where a campaign goes that nobody named a folder for: ``runs/<name>-<kind>``."""
    return RESULTS / f"{Path(target).stem}-{kind}"


def command_line(args: argparse.Namespace) -> str:
    """The line that repeats it."""
    names = ("spread", "flights", "prove", "at_least", "seed", "scenario", "terrain")
    given = "".join(
        f" --{name.replace('_', '-')} {value}" for name in names if (value := getattr(args, name, None)) is not None
    )
    return f"planfly {args.command} {args.target}{given}"
