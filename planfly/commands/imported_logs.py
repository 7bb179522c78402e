"""``planfly import`` and ``planfly refly``: a flight of another program's log, and its mission flown in JSBSim."""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

from logs.recording.reader import FlightLog, read_log
from logs.recording.recorder import Recorder
from logs.verdict.imported.model_comparison import Reflight
from logs.verdict.judge_flight import judge_flight
from logs.views.report.text import left_lines, refly_lines
from planfly.imported_flights import ImportedFlight, ImportOptions, fly_again, import_flight
from planfly.open_mission import read_named_fences
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.options import scenario_change
from planfly.terminal.output import progress
from planfly.terminal.results import (
    REFLOWN,
    REFLY_FILES,
    prepare_folder,
    print_verdict,
    refuse_existing,
    refuse_folder,
    warn_of_loss,
)
from world.errors import LogError, ScenarioError
from world.files import write_whole

# ----------------------------------------------------------------------
# What options say of an imported log.


def import_options(args: argparse.Namespace) -> ImportOptions:
    """Plan, world and aircraft of the options.

    Raises ScenarioError for one that a flown log cannot take, and as `read_named_fences` does.
    """
    source = args.log if hasattr(args, "target") else args.file
    for name in ("params", "guidance", "airspeed"):
        if (value := getattr(args, name, None)) is not None:
            allowed = "an imported flight is judged by the autopilot and the speeds of its log"
            raise ScenarioError.at(source, f"--{name}", value, allowed, shown="")
    return ImportOptions(
        plan=Path(args.plan) if args.plan else None,
        scenario=args.scenario,
        terrain=args.terrain,
        aircraft=args.aircraft,
        datum=args.datum,
        number=args.flight,
        wind_given=args.wind is not None,
        fences=read_named_fences(args.fence),
    )


# ----------------------------------------------------------------------
# ``planfly import``: an imported log as a flight log of planfly's own, with its verdict.

# Rows that are recorded at once.
_PIECE = 4096


def import_log(args: argparse.Namespace) -> int:
    """Import a log; the exit code is the verdict's, or 3 for a log of which some could not be read."""
    source, target = Path(args.log), Path(args.target)
    refuse_existing(target, args.overwrite, source)
    flight = import_flight(source, import_options(args), scenario_change(args))
    _write(target, flight)
    print_verdict(flight.verdict, flight.setup.route.notes)
    print(f"log       {target} ({len(flight.track)} rows)")
    code = LOSS if flight.lossy else FLYABLE if flight.verdict.flyable else NOT_FLYABLE
    give_answer(args, lambda: _import_answer(target, flight, code))
    return code


def _import_answer(target: Path, flight: ImportedFlight, code: int) -> object:
    from planfly.terminal.answers.answer_data import ImportAnswer, verdict_document

    verdict = verdict_document(flight.verdict)
    return ImportAnswer(exit_code=code, log=str(target), rows=len(flight.track), verdict=verdict)


def _write(target: Path, flight: ImportedFlight) -> None:
    """The log, whole or not at all."""
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as folder:
        path = Path(folder) / target.name
        with Recorder(path, flight.setup) as recorder:
            # Events first, so that each stands in the log where it happened.
            for event in flight.events:
                recorder.event(event.time, event.text, event.level)
            # A piece at a time: a recorder takes many times the bytes of a row for it.
            for start in range(0, len(flight.track), _PIECE):
                recorder.write(flight.track.rows(start, start + _PIECE))
            recorder.finish(flight.ended, flight.verdict)
        path.replace(target)


# ----------------------------------------------------------------------
# ``planfly refly``: the mission of an imported flight, flown again in JSBSim: where model and flight differ.


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
    give_answer(args, lambda: _refly_answer(lines, files, code))
    return code


def _refly_answer(lines: list[str], files: list[Path], code: int) -> object:
    from planfly.terminal.answers.answer_data import ReflyAnswer

    return ReflyAnswer(exit_code=code, lines=lines, files=[str(file) for file in files])


def _draw(folder: Path, again: Reflight, ending: str) -> list[Path]:
    # matplotlib loads for pictures alone.
    from logs.views.compare import refly_charts
    from logs.views.drawing import draw_chart, png_bytes

    files = []
    for name, chart in refly_charts(again).items():
        path = (folder / name).with_stem(f"{Path(name).stem}{ending}")
        write_whole(path, png_bytes(draw_chart(chart)))
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
