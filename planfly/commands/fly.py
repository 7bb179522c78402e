"""``planfly fly``: a plan or any mission file, flown and logged."""

import argparse
from pathlib import Path

from planfly.flight_limits import flight_text
from planfly.named_fences import read_named_fences
from planfly.open_mission import open_mission
from planfly.pipeline import autopilot_log, fly_and_judge
from planfly.terminal.autopilot_option import autopilot_program
from planfly.terminal.exit_codes import FLYABLE, NOT_FLYABLE
from planfly.terminal.progress import progress
from planfly.terminal.results import print_verdict, print_warnings
from planfly.terminal.scenario_options import flight_limits, scenario_change
from planfly.terminal.targets import default_folder, named_or_default, refuse_existing


def fly(args: argparse.Namespace) -> int:
    """Fly a mission into a log; the exit code is the verdict's."""
    source = Path(args.mission)
    program = autopilot_program(args)
    opened = open_mission(
        source,
        args.scenario,
        args.terrain,
        seed=args.seed,
        change=scenario_change(args),
        fences=read_named_fences(args.fence),
    )
    default = default_folder(opened.name, opened.setup.seed) / "flight.mcap"
    target = named_or_default(args.log, default, args.overwrite, source)
    if program is not None and args.log:
        refuse_existing(autopilot_log(target), args.overwrite, source)
    print_warnings(opened.setup.mission.warnings)
    target.parent.mkdir(parents=True, exist_ok=True)
    with progress(f"flying {flight_text(opened.setup)}") as advance:
        every = 60 // args.log_hz
        flown = fly_and_judge(
            opened.setup, opened.airframe, target, advance, every=every, autopilot=program, most=flight_limits(args)
        )
    print_verdict(flown.verdict, opened.setup.route.notes)
    print(f"log       {target}" if len(flown.track) else "log       none: nothing was flown")
    if program is not None and len(flown.track):
        print(f"          {autopilot_log(target)} (the autopilot's own)")
    return FLYABLE if flown.verdict.flyable else NOT_FLYABLE
