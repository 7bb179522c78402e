"""``planfly fly``: a plan or any mission file, flown and logged."""

import argparse
import shlex
from pathlib import Path

from planfly.crash_safe_log import flight_text
from planfly.open_mission import OpenedMission, open_mission, read_named_fences
from planfly.pipeline import JudgedFlight, autopilot_log, fly_and_judge
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.command_parser import coloured
from planfly.terminal.exit_codes import FLYABLE, NOT_FLYABLE
from planfly.terminal.options import autopilot_program, flight_limits, scenario_change
from planfly.terminal.output import progress
from planfly.terminal.results import default_folder, named_or_default, print_verdict, print_warnings, refuse_existing


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
            opened.setup, opened.airframe, target, advance, every=every, autopilot=program, limits=flight_limits(args)
        )
    print_verdict(flown.verdict, opened.setup.route.notes)
    print(f"log       {target}" if len(flown.track) else "log       none: nothing was flown")
    own = autopilot_log(target) if program is not None and len(flown.track) else None
    if own is not None:
        print(f"          {own} (the autopilot's own)")
    if len(flown.track):
        print(coloured(f"next      planfly report {shlex.quote(str(target))}", "hint"))
    code = FLYABLE if flown.verdict.flyable else NOT_FLYABLE
    give_answer(args, lambda: _answer(args, opened, flown, target, own, code))
    return code


def _answer(
    args: argparse.Namespace, opened: OpenedMission, flown: JudgedFlight, log: Path, own: Path | None, code: int
) -> object:
    from planfly.terminal.answers.answer_data import FlyAnswer, verdict_document

    return FlyAnswer(
        exit_code=code,
        mission=args.mission,
        seed=opened.setup.seed,
        log=str(log) if len(flown.track) else None,
        autopilot_log=None if own is None else str(own),
        warnings=list(opened.setup.mission.warnings),
        verdict=verdict_document(flown.verdict),
    )
