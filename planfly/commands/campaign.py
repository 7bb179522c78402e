"""``planfly campaign``: how likely a mission is to fly, over the weather and the spread of the real aircraft."""

import argparse
from pathlib import Path

from logs.verdict.wording import place_text
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.campaign_result import campaign_line
from planfly.campaigns.command_line import (
    campaign_dispersions,
    campaign_goal,
    default_campaign_folder,
    open_base,
    repeated_options,
    tell_interrupted,
)
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.report import finish_campaign, fly_row_again
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.summary import campaign_lines
from planfly.campaigns.tables import DATABASE
from planfly.campaigns.worker_pool import Workers
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.output import progress
from world.errors import PlanflyError

_EXITS = {"reached": FLYABLE, "missed": NOT_FLYABLE, "undecided": LOSS, "none asked": FLYABLE}


def campaign(args: argparse.Namespace) -> int:
    """Fly a campaign, go on with one, or fly one of its flights again."""
    folder = Path(args.out) if args.out else default_campaign_folder(args.target, "campaign")
    goal = campaign_goal(args, folder)
    again = args.resume or args.refly is not None
    base = open_base(args, campaign_dispersions(args), folder, DATABASE, again=again)
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
        except KeyboardInterrupt as stop:
            return tell_interrupted(stop, folder, store.tally().flown)
    with progress("reporting") as advance:
        line = campaign_line(args.target, goal, repeated_options(args))
        summary = finish_campaign(base, goal, estimate, folder, line, advance)
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
