"""``planfly winds``: from each direction the largest wind in which a mission flies."""

import argparse
from pathlib import Path

from planfly.campaigns.campaign_result import winds_line
from planfly.campaigns.command_line import (
    campaign_dispersions,
    default_campaign_folder,
    open_base,
    repeated_options,
    tell_interrupted,
)
from planfly.campaigns.find_winds import ASKED, WindsGoal, asked_flights, find_winds, open_winds_store
from planfly.campaigns.report import wind_lines, write_winds
from planfly.campaigns.tables import WINDS_DATABASE
from planfly.campaigns.worker_pool import Workers
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE
from planfly.terminal.output import progress


def winds(args: argparse.Namespace) -> int:
    """Find the boundary of each direction, or go on with that, and draw the chart."""
    folder = Path(args.out) if args.out else default_campaign_folder(args.target, "winds")
    flights = asked_flights(args.flights, folder, resume=args.resume)
    goal = WindsGoal(args.prove, args.confidence, args.directions, args.most, flights)
    base = open_base(args, campaign_dispersions(args).without(ASKED), folder, WINDS_DATABASE, again=args.resume)
    with open_winds_store(base, goal, folder, resume=args.resume) as store:
        try:
            with progress("flying") as advance:
                found = find_winds(base, goal, Workers(args.workers, args.scheduler), store, advance)
        except KeyboardInterrupt as stop:
            return tell_interrupted(stop, folder, store.tally().flown)
    write_winds(folder, base, found, winds_line(args.target, goal, repeated_options(args)))
    print("\n".join(wind_lines(found)))
    print(f"results   {folder}/ (winds.html, winds.png, winds.json, {WINDS_DATABASE})")
    give_answer(args, lambda: (folder / "winds.json").read_text(encoding="utf-8"))
    return FLYABLE
