"""``planfly campaign``: how likely a mission is to fly, over the weather and the spread of the real aircraft."""

import argparse
import sys
from pathlib import Path

from logs.verdict.wording import place_text
from planfly.campaigns.asked_campaign import (
    campaign_goal,
    campaign_spread,
    command_line,
    default_campaign_folder,
    open_base,
)
from planfly.campaigns.engine.cluster import Workers
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.report.campaign_files import CAMPAIGN_FILES, clear_campaign, fly_row_again
from planfly.campaigns.report.finish_campaign import finish_campaign
from planfly.campaigns.report.summary import campaign_lines
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.storage.store import DATABASE
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, INTERRUPTED, LOSS, NOT_FLYABLE
from planfly.terminal.progress import progress
from planner.plan import plan_json
from world.atomic_files import write_whole
from world.errors import PlanflyError

_EXITS = {"reached": FLYABLE, "missed": NOT_FLYABLE, "undecided": LOSS, "none asked": FLYABLE}


def campaign(args: argparse.Namespace) -> int:
    """Fly a campaign, go on with one, or fly one of its flights again."""
    goal = campaign_goal(args)
    folder = Path(args.out) if args.out else default_campaign_folder(args.target, "campaign")
    again = args.resume or args.refly is not None
    if again and not (folder / DATABASE).is_file():
        raise PlanflyError(f"{folder / DATABASE}: no campaign there to go on with", file=folder / DATABASE)
    if not again:
        refuse_campaign(folder, args.overwrite)
    base = open_base(args, campaign_spread(args), folder if again else None)
    if not again:
        clear_campaign(folder)
    if base.plan is not None and not (folder / "plan.json").exists():
        keep_plan(base, folder)
    if args.refly is not None:
        if args.json:
            raise PlanflyError("--json: goes with a campaign, not with --refly", field="--json", value=args.json)
        return _refly(base, goal, folder, args.refly)
    return _fly(args, base, goal, folder)


def _fly(args: argparse.Namespace, base: CampaignBase, goal: Goal, folder: Path) -> int:
    with open_store(base, goal, folder, resume=args.resume) as store:
        try:
            with progress("flying") as advance:
                estimate = fly_campaign(base, goal, Workers(args.workers, args.scheduler), store, advance)
        except KeyboardInterrupt:
            known = store.tally().flown
            print(f"planfly: interrupted; {known} flights are kept in {folder}, --resume goes on", file=sys.stderr)
            return INTERRUPTED
    with progress("reporting") as advance:
        summary = finish_campaign(base, goal, estimate, folder, command_line(args), advance)
    print("\n".join(campaign_lines(summary)))
    print(f"results   {folder}/ (report.html, summary.json, {DATABASE}, worst/)")
    give_answer(args, lambda: (folder / "summary.json").read_text(encoding="utf-8"))
    return _EXITS[estimate.answer]


def _refly(base: CampaignBase, goal: Goal, folder: Path, index: int) -> int:
    with open_store(base, goal, folder, resume=True) as store:
        row = store.flight(index)
        if row is None:
            allowed = f"no such flight; it has {store.tally().flown}, from 0"
            raise PlanflyError.of_option("--refly", index, allowed, file=store.path)
    target = folder / "flights" / f"flight-{index:06d}.mcap"
    target.parent.mkdir(exist_ok=True)
    again = fly_row_again(base, row, target)
    print(f"flight {index}: {again.outcome}, ended: {again.ended}, as in the table")
    for rule, place in again.failed:
        print(f"  failed  {rule} at {place_text(place)}")
    print(f"log       {target}")
    return FLYABLE if again.outcome == "flyable" else NOT_FLYABLE


def keep_plan(base: CampaignBase, folder: Path) -> None:
    """Keep the plan with the campaign, for those that go on with it."""
    if base.plan is not None:
        write_whole(folder / "plan.json", plan_json(base.plan))


def refuse_campaign(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that is a file, or that holds a campaign or anything else.  Raises PlanflyError."""
    if folder.exists() and not folder.is_dir():
        raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        holds = any((folder / name).exists() for name in CAMPAIGN_FILES)
        what = "holds a campaign; --resume goes on with it, " if holds else "exists and is not empty; "
        raise PlanflyError(f"{folder}: {what}--overwrite replaces it", file=folder)
