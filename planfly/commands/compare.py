"""``planfly compare``: two flights laid over each other, as a table and as pictures."""

import argparse
import math
from pathlib import Path

from logs.recording.reader import read_log
from logs.views.report.compare import Comparison, compare_logs, difference_lines
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS
from planfly.terminal.output import progress
from planfly.terminal.results import COMPARE_FILES, prepare_folder, refuse_folder, warn_of_loss


def compare(args: argparse.Namespace) -> int:
    """Print the differences, and draw them where a folder is named; 3 if either log is cut short."""
    first, second = Path(args.first), Path(args.second)
    logs = [read_log(first), read_log(second)]
    comparison = compare_logs(*logs, names=(first.name, second.name))
    files = _draw(comparison, Path(args.out), args) if args.out else []
    print("\n".join(difference_lines(comparison)))
    for file in files:
        print(f"compare   {file}")
    cut_short = [log for log in logs if not log.complete]
    for log in cut_short:
        warn_of_loss(log)
    code = LOSS if cut_short else FLYABLE
    give_answer(args, lambda: _answer(comparison, files, code))
    return code


def _answer(comparison: Comparison, files: list[Path], code: int) -> object:
    from planfly.terminal.answers.answer_data import CompareAnswer, QuantityPair

    def number(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return CompareAnswer(
        exit_code=code,
        names=list(comparison.names),
        flyable=[verdict.flyable for verdict in comparison.verdicts],
        quantities=[
            QuantityPair(name=one.name, unit=one.unit, first=number(one.first), second=number(one.second))
            for one in comparison.differences
        ],
        notes=list(comparison.notes),
        files=[str(file) for file in files],
    )


def _draw(comparison: Comparison, folder: Path, args: argparse.Namespace) -> list[Path]:
    # matplotlib loads for pictures alone.
    from logs.views.report.compare import write_comparison

    refuse_folder(folder, args.overwrite)
    prepare_folder(folder, COMPARE_FILES)
    with progress("drawing"):
        return write_comparison(folder, comparison, svg=args.svg)
