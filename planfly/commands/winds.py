"""``planfly winds``: from each direction the largest wind in which a mission flies."""

import argparse
import sys
from pathlib import Path

from planfly.campaigns.asked_campaign import campaign_spread, command_line, default_campaign_folder, open_base
from planfly.campaigns.engine.cluster import Workers
from planfly.campaigns.find_winds import ASKED, WindsGoal, find_winds
from planfly.campaigns.report.wind_files import wind_lines, write_winds
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, INTERRUPTED
from planfly.terminal.progress import progress
from planfly.terminal.targets import refuse_folder

USUAL_MOST = 5000


def winds(args: argparse.Namespace) -> int:
    """Find the boundary of each direction, and draw the chart."""
    goal = WindsGoal(args.prove, args.confidence, args.directions, args.most, args.flights or USUAL_MOST)
    folder = Path(args.out) if args.out else default_campaign_folder(args.target, "winds")
    refuse_folder(folder, args.overwrite)
    base = open_base(args, campaign_spread(args).without(ASKED), None)
    try:
        with progress("flying") as advance:
            found = find_winds(base, goal, Workers(args.workers, args.scheduler), advance)
    except KeyboardInterrupt:
        print("planfly: interrupted; nothing was written", file=sys.stderr)
        return INTERRUPTED
    folder.mkdir(parents=True, exist_ok=True)
    write_winds(folder, base, found, command_line(args))
    print("\n".join(wind_lines(found)))
    print(f"results   {folder}/ (winds.html, winds.png, winds.json)")
    give_answer(args, lambda: (folder / "winds.json").read_text(encoding="utf-8"))
    return FLYABLE
