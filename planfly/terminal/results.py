"""Print verdicts and warnings of commands."""

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from planfly.terminal.command_parser import coloured

if TYPE_CHECKING:
    from logs.recording.reader import FlightLog
    from logs.verdict.verdict import Verdict


def print_verdict(verdict: "Verdict", notes: Iterable[str]) -> None:
    """Print the summary of a verdict, its failed rules, and then each rule's finding closest to its limit."""
    # Imported here because --help does not need it.
    from planfly.terminal.verdict_lines import verdict_lines

    print("\n".join(verdict_lines(verdict, notes)))


def print_returns(line: str) -> None:
    """Print the line on returns to launch, unless it is empty."""
    if line:
        print(f"returns   {line} (more: planfly returns)")


def print_engine(engine: str) -> None:
    """Print the flight model that flew and the reason, unless nothing was flown."""
    if engine:
        print(f"model     {engine}")


def print_warnings(warnings: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for warning in warnings:
        print(coloured("warning:", "warning", sys.stderr) + f" {warning}", file=sys.stderr)


def warn_of_loss(log: "FlightLog") -> None:
    """Print a warning on standard error that names the part missing from an incomplete log."""
    from planfly.flight_logs import loss_text

    print_warnings([loss_text(log)])
