"""A campaign as the command line asks for it: its goal, dispersions, mission and folder."""

import argparse
import signal
import sys
from pathlib import Path

from planfly.campaigns.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.campaign_result import OPTIONS, make_goal
from planfly.campaigns.dispersions import Dispersions, default_dispersions, read_dispersions
from planfly.campaigns.fly_campaign import resumed_goal
from planfly.campaigns.report import OutputDirectory
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.worker_pool import in_own_process
from planfly.open_mission import read_named_fences
from planfly.pipeline import Advance
from planfly.terminal.options import scenario_change
from planfly.terminal.output import progress
from planfly.terminal.results import RESULTS
from world.errors import PlanflyError
from world.interruption import Interrupted


def campaign_goal(args: argparse.Namespace, folder: Path) -> Goal:
    """The goal that the options state, or, without any, that of the campaign which is gone on with.

    Raises PlanflyError.
    """
    again = args.resume or args.refly is not None
    if again and (args.flights, args.prove, args.at_least) == (None, None, None):
        return resumed_goal(None, folder, args.confidence)
    goal = _stated_goal(args)
    return resumed_goal(goal, folder, args.confidence) if again else goal


def _stated_goal(args: argparse.Namespace) -> Goal:
    try:
        return make_goal(args.flights, args.prove, args.at_least, args.confidence)
    except ValueError as error:
        name = str(error).partition(":")[0]
        # Python's names are the options' with "_" for "-".
        option, text = (said.replace("at_least", "at-least") for said in (name, str(error)))
        raise PlanflyError(f"--{text}", field=f"--{option}", value=getattr(args, name, None)) from error


def campaign_dispersions(args: argparse.Namespace) -> Dispersions:
    """The dispersions that the options name.  Raises SpreadError."""
    return default_dispersions() if args.spread is None else read_dispersions(Path(args.spread))


def open_base(
    args: argparse.Namespace, dispersions: Dispersions, folder: Path, table: str, *, again: bool
) -> CampaignBase:
    """The mission of the options, and its folder ready for it: cleared, or with what is to be gone on with.

    table: name of the file of flights.  A scenario's plan is kept in the folder, for those that go on.
    Raises PlanflyError; a folder that was not ready is as it was then.
    """
    asked = OutputDirectory(folder, table, again, args.overwrite, ("--resume", "--overwrite"))
    return asked.open(lambda planned: _opened(args, dispersions, planned))


def tell_interrupted(stop: KeyboardInterrupt, folder: Path, flights: int) -> int:
    """Say what is kept of a campaign that was interrupted, and how to go on; its exit code."""
    print(f"planfly: interrupted; {flights} flights are kept in {folder}, --resume goes on", file=sys.stderr)
    return 128 + (stop.number if isinstance(stop, Interrupted) else signal.SIGINT)


def _opened(args: argparse.Namespace, dispersions: Dispersions, planned: Path | None) -> CampaignBase:
    """The mission of the options, planned if it is a scenario and there is no plan of it."""
    change, fences = scenario_change(args), read_named_fences(args.fence)

    def opened(advance: Advance | None = None) -> CampaignBase:
        return in_own_process(
            open_campaign,
            args.target,
            dispersions,
            planned=planned,
            scenario_name=args.scenario,
            terrain=args.terrain,
            seed=args.seed,
            change=change,
            fences=fences,
            advance=advance,
        )

    is_file = Path(args.target).suffix.lower() in (".json", ".waypoints", ".plan")
    if is_file or (planned is not None and planned.is_file()):
        return opened()
    with progress("planning") as advance:
        return opened(advance)


def default_campaign_folder(target: str, kind: str) -> Path:
    """Where a campaign goes that nobody named a folder for: ``runs/<name>-<kind>``."""
    return RESULTS / f"{Path(target).stem}-{kind}"


def repeated_options(args: argparse.Namespace) -> dict[str, object]:
    """The options that decide what is flown, by name, as they were given."""
    return {name: getattr(args, name) for name in OPTIONS}
