"""Verdicts and warnings that commands print."""

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from planfly.terminal.command_parser import coloured

if TYPE_CHECKING:
    from logs.recording.reader import FlightLog
    from logs.verdict.verdict import Verdict


def print_verdict(verdict: "Verdict", notes: Iterable[str]) -> None:
    """The verdict on the terminal: the summary, then what fails, then what is closest to each rule's limit."""
    # Imported here: --help prints none.
    from planfly.terminal.verdict_lines import verdict_lines

    print("\n".join(verdict_lines(verdict, notes)))


def print_returns(line: str) -> None:
    """Print the line on returns to launch, unless it is empty."""
    if line:
        print(f"returns   {line} (more: planfly returns)")


def print_warnings(warnings: Iterable[str]) -> None:
    """Warnings, on standard error."""
    for warning in warnings:
        print(coloured("warning:", "warning", sys.stderr) + f" {warning}", file=sys.stderr)


def warn_of_loss(log: "FlightLog") -> None:
    """Print what an incomplete log lacks, on standard error."""
    from planfly.flight_logs import loss_text

    print_warnings([loss_text(log)])
