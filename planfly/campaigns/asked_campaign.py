"""A campaign as the command line asks for it: its goal, spread, mission and folder."""

import argparse
import signal
import sys
from pathlib import Path

from planfly.campaigns.campaign_result import make_goal
from planfly.campaigns.flights.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.report.campaign_files import CAMPAIGN_FILES, clear_campaign
from planfly.campaigns.spread.spread_file import FlightSpread, default_spread, read_spread
from planfly.campaigns.statistics.decision import Goal
from planfly.pipeline import Advance
from planfly.terminal.progress import progress
from planfly.terminal.scenario_options import scenario_change
from planfly.terminal.targets import RESULTS
from planner.plan import plan_json
from world.atomic_files import write_whole
from world.errors import PlanflyError
from world.interruption import Interrupted


def campaign_goal(args: argparse.Namespace) -> Goal:
    """The goal that the options state.  Raises PlanflyError."""
    try:
        return make_goal(args.flights, args.prove, args.at_least, args.confidence)
    except ValueError as error:
        name = str(error).partition(":")[0]
        # Python's names are the options' with "_" for "-".
        option, text = (said.replace("at_least", "at-least") for said in (name, str(error)))
        raise PlanflyError(f"--{text}", field=f"--{option}", value=getattr(args, name, None)) from error


def campaign_spread(args: argparse.Namespace) -> FlightSpread:
    """The spread that the options name.  Raises SpreadError."""
    return default_spread() if args.spread is None else read_spread(Path(args.spread))


def open_base(args: argparse.Namespace, spread: FlightSpread, folder: Path, table: str, *, again: bool) -> CampaignBase:
    """The mission of the options, and its folder ready for it: cleared, or with what is to be gone on with.

    table: name of the file of flights.  A scenario's plan is kept in the folder, for those that go on.
    Raises PlanflyError; a folder that was not ready is as it was then.
    """
    if again and not (folder / table).is_file():
        raise PlanflyError(f"{folder / table}: no campaign there to go on with", file=folder / table)
    if not again:
        _refuse_campaign(folder, table, args.overwrite)
    base = _opened(args, spread, folder if again else None)
    if not again:
        clear_campaign(folder)
    if base.plan is not None and not (folder / "plan.json").exists():
        write_whole(folder / "plan.json", plan_json(base.plan))
    return base


def _refuse_campaign(folder: Path, table: str, overwrite: bool) -> None:
    """Refuse a folder that is a file, or that holds a campaign or anything else.  Raises PlanflyError."""
    if folder.exists() and not folder.is_dir():
        raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
    if overwrite or not folder.is_dir() or not any(folder.iterdir()):
        return
    if (folder / table).exists():
        raise PlanflyError(
            f"{folder}: holds a campaign; --resume goes on with it, --overwrite replaces it", file=folder
        )
    if any((folder / name).exists() for name in CAMPAIGN_FILES):
        raise PlanflyError(f"{folder}: holds another campaign; --overwrite replaces it", file=folder)
    raise PlanflyError(f"{folder}: exists and is not empty; --overwrite replaces its results", file=folder)


def tell_interrupted(stop: KeyboardInterrupt, folder: Path, flights: int) -> int:
    """Say what is kept of a campaign that was interrupted, and how to go on; its exit code."""
    print(f"planfly: interrupted; {flights} flights are kept in {folder}, --resume goes on", file=sys.stderr)
    return 128 + (stop.number if isinstance(stop, Interrupted) else signal.SIGINT)


def _opened(args: argparse.Namespace, spread: FlightSpread, folder: Path | None) -> CampaignBase:
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
