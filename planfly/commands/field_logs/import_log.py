"""``planfly import``: a log of the field as a flight log of planfly's own, with its verdict."""

import argparse
import tempfile
from pathlib import Path

from logs.recording.recorder import Recorder
from planfly.commands.field_logs.field_options import field_options
from planfly.field.field_flights import ImportedFlight, import_flight
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.results import print_verdict
from planfly.terminal.scenario_options import scenario_change
from planfly.terminal.targets import refuse_existing

# Rows that are recorded at once.
_PIECE = 4096


def import_log(args: argparse.Namespace) -> int:
    """Import a log; the exit code is the verdict's, or 3 for a log of which some could not be read."""
    source, target = Path(args.log), Path(args.target)
    refuse_existing(target, args.overwrite, source)
    flight = import_flight(source, field_options(args), scenario_change(args))
    _write(target, flight)
    print_verdict(flight.verdict, flight.setup.route.notes)
    print(f"log       {target} ({len(flight.track)} rows)")
    code = LOSS if flight.lossy else FLYABLE if flight.verdict.flyable else NOT_FLYABLE
    give_answer(args, lambda: _answer(target, flight, code))
    return code


def _answer(target: Path, flight: ImportedFlight, code: int) -> object:
    from planfly.terminal.answers.answer_data import ImportAnswer
    from planfly.terminal.answers.verdict_document import verdict_document

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
