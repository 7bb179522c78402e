"""``planfly report``: figures and report.html from a log alone, or the layout file for Foxglove."""

import argparse
import sys
from pathlib import Path

from logs.recording.foxglove_scene import layout_text
from logs.recording.reader import read_log
from logs.verdict.findings import Verdict
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import BAD_INPUT, FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.output import progress
from planfly.terminal.results import (
    LOG_FIGURES,
    judge_log,
    prepare_folder,
    refuse_existing,
    refuse_folder,
    warn_of_loss,
    write_pictures,
)
from world.errors import PlanflyError
from world.files import write_whole


def report(args: argparse.Namespace) -> int:
    """Draw and write; the exit code is the verdict's, or 3 for a log that is cut short."""
    if args.layout:
        return _write_layout(Path(args.layout), args)
    if args.log is None:
        print("planfly report: a log, or --layout FILE, is expected (see planfly report --help)", file=sys.stderr)
        return BAD_INPUT
    source = Path(args.log)
    log = read_log(source)
    folder = Path(args.out) if args.out else source.with_name(f"{source.stem}-report")
    verdict = judge_log(log)
    if args.out:
        refuse_folder(folder, args.overwrite)
    prepare_folder(folder, LOG_FIGURES)
    with progress("drawing"):
        files = write_pictures(
            folder, log.setup, log.track, verdict, log.ended, f"planfly report {args.log}", log.versions, log.events,
            svg=args.svg,
        )  # fmt: skip
    for file in files:
        print(f"report    {file}")
    code = FLYABLE if verdict.flyable else NOT_FLYABLE
    if not log.complete:
        warn_of_loss(log)
        code = LOSS
    give_answer(args, lambda: _answer(files, verdict, code))
    return code


def _answer(files: list[Path], verdict: Verdict | None, code: int) -> object:
    from planfly.terminal.answers.answer_data import ReportAnswer, verdict_document

    document = None if verdict is None else verdict_document(verdict)
    return ReportAnswer(exit_code=code, files=[str(file) for file in files], verdict=document)


def _write_layout(target: Path, args: argparse.Namespace) -> int:
    if args.log is not None:
        message = f"{args.log}: --layout writes the layout alone; name no log with it"
        raise PlanflyError(message, file=args.log, field="--layout", value=str(target))
    refuse_existing(target, args.overwrite)
    write_whole(target, layout_text())
    print(f"layout    {target}")
    give_answer(args, lambda: _answer([target], None, FLYABLE))
    return FLYABLE
