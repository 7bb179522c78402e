"""``planfly recover``: an unfinished or damaged log made whole, as far as it can be read."""

import argparse
from pathlib import Path

from logs.recording.reader import FlightLog
from logs.recording.recover import recover_log
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS
from planfly.terminal.results import refuse_existing, warn_of_loss
from world.errors import PlanflyError
from world.files import write_whole


def recover(args: argparse.Namespace) -> int:
    """Write what can be read as a new log; nothing is written for a log that is whole."""
    source = Path(args.log)
    target = Path(args.out) if args.out else source.with_name(f"{source.stem}-recovered.mcap")
    if args.out is None and target.exists() and not args.overwrite:
        raise PlanflyError(f"{target}: exists; --overwrite replaces it, --out names another", file=target)
    refuse_existing(target, args.overwrite)
    recovered = recover_log(source)
    if recovered is None:
        print(f"{source}: complete: there is nothing to recover, and nothing was written")
        give_answer(args, lambda: _answer(None, None))
        return FLYABLE
    write_whole(target, recovered.data)
    log = recovered.log
    print(f"log       {target} ({len(log.track)} rows, to {log.end_time:.1f} s)")
    warn_of_loss(log)
    give_answer(args, lambda: _answer(target, log))
    return LOSS


def _answer(target: Path | None, log: FlightLog | None) -> object:
    from planfly.terminal.answers.answer_data import RecoverAnswer

    if target is None or log is None:
        return RecoverAnswer(exit_code=FLYABLE, log=None, rows=None, end_s=None)
    return RecoverAnswer(exit_code=LOSS, log=str(target), rows=len(log.track), end_s=log.end_time)
