"""``planfly refly``: the mission of a flight of the field, flown again in JSBSim: where model and flight differ."""

import argparse
from dataclasses import replace
from pathlib import Path

from logs.recording.reader import FlightLog, read_log
from logs.recording.recorder import Recorder
from logs.report.refly_lines import left_lines, refly_lines
from logs.verdict.field.model_comparison import Reflight
from logs.verdict.judge_flight import judge_flight
from planfly.field.model_flight import fly_again
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS
from planfly.terminal.progress import progress
from planfly.terminal.stored_logs import warn_of_loss
from planfly.terminal.targets import REFLOWN, REFLY_FILES, prepare_folder, refuse_folder
from world.atomic_files import write_whole
from world.errors import LogError


def refly(args: argparse.Namespace) -> int:
    """Fly, compare and draw; 3 for a log that is cut short."""
    source = Path(args.log)
    log = read_log(source)
    if log.setup.source is None:
        message = f"{source}: flown by planfly itself: refly takes a log that `planfly import` wrote"
        raise LogError(message, file=source)
    folder = Path(args.out) if args.out else source.with_name(f"{source.stem}-refly")
    if args.out:
        refuse_folder(folder, args.overwrite)
    with progress("flying again") as advance:
        agains = fly_again(log.setup, log.track, args.aircraft, args.turbulence, advance, REFLOWN)
    prepare_folder(folder, REFLY_FILES)
    lines: list[str] = []
    for number, again in enumerate(agains, 1):
        lines += [*([] if number == 1 else [""]), *refly_lines(again)]
    lines += left_lines(agains, log.setup.source.stretches, REFLOWN)
    print("\n".join(lines))
    files: list[Path] = []
    with progress("drawing"):
        for number, again in enumerate(agains, 1):
            ending = "" if number == 1 else f"-{number}"
            files += [*_draw(folder, again, ending), _record(folder, again, log, ending)]
    for file in files:
        print(f"refly     {file}")
    if not log.complete:
        warn_of_loss(log)
    code = FLYABLE if log.complete else LOSS
    give_answer(args, lambda: _answer(lines, files, code))
    return code


def _answer(lines: list[str], files: list[Path], code: int) -> object:
    from planfly.terminal.answers.answer_data import ReflyAnswer

    return ReflyAnswer(exit_code=code, lines=lines, files=[str(file) for file in files])


def _draw(folder: Path, again: Reflight, ending: str) -> list[Path]:
    # matplotlib loads for pictures alone.
    from logs.figures.refly import refly_pictures

    files = []
    for name, data in refly_pictures(again).items():
        path = (folder / name).with_stem(f"{Path(name).stem}{ending}")
        write_whole(path, data)
        files.append(path)
    return files


def _record(folder: Path, again: Reflight, log: FlightLog, ending: str) -> Path:
    """The simulated flight as a log of its own, for `compare` and `replay`."""
    path = folder / f"simulated{ending}.mcap"
    verdict = judge_flight(again.setup, again.simulated, again.ended)
    with Recorder(path, replace(again.setup, seed=log.setup.seed)) as recorder:
        recorder.write(again.simulated)
        recorder.finish(again.ended, verdict)
    return path
