"""Print verdicts and warnings of commands."""

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from planfly.terminal.command_parser import colour_text

if TYPE_CHECKING:
    from flight.simulation.setup import FlightSetup
    from logs.recording.reader import FlightLog
    from logs.verdict.verdict import Verdict
    from planfly.rtl.return_summary import ReturnSummary


def print_verdict(
    verdict: "Verdict",
    notes: Iterable[str],
    setup: "FlightSetup | None" = None,
    returns: "ReturnSummary | None" = None,
) -> None:
    """Print a verdict: summary, failed rules, and the finding closest to its limit for each rule.

    setup: setup of the judged flight, used to look for suggestions on its planned route; None without a flight.
    returns: returns from a few points of the flight.  Unsafe returns of a flyable mission follow the first line.
    """
    # Imported here because --help does not need them.
    from planfly.terminal.verdict_lines import verdict_lines
    from planfly.workflow.suggestion_trials import has_geometric_suggestion

    lines = verdict_lines(verdict, notes, lambda: setup is not None and has_geometric_suggestion(setup))
    if returns is not None and returns.line:
        is_warning = verdict.flyable and returns.has_failures
        text = f"returns   {returns.line}{'; no return is required' if is_warning else ''}; more: planfly returns"
        lines.insert(1 if is_warning else len(lines), colour_text(text, "warning") if is_warning else text)
    print("\n".join(lines))


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
