"""Print the lines next to a verdict, and warnings."""

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from planfly.terminal.command_parser import colour_text

if TYPE_CHECKING:
    from logs.recording.reader import FlightLog


def print_engine(engine: str) -> None:
    """Print which flight model flew and why, unless nothing was flown."""
    if engine:
        print(f"model     {engine}")


def print_warnings(warnings: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for warning in warnings:
        print(colour_text("warning:", "warning", sys.stderr) + f" {warning}", file=sys.stderr)


def warn_about_incomplete_log(log: "FlightLog") -> None:
    """Print a warning on standard error about the missing part of an incomplete log."""
    from planfly.flight_logs import loss_text

    print_warnings([loss_text(log)])
