"""Recognise planfly's flight logs, judge their flights, and describe missing parts."""

from pathlib import Path

from logs.recording.reader import FlightLog
from logs.verdict.judge_flight import judge_flight
from logs.verdict.verdict import Verdict
from world.errors import PlanflyError

MCAP_MAGIC = b"\x89MCAP"
# Reason for the end of a flight whose log does not contain the end.
CUT_SHORT = "the log ends before the flight does"


def is_log(path: Path) -> bool:
    """Return True if a file is a flight log of planfly, by its first bytes or the suffix .mcap.

    A folder or a missing file is judged only by its suffix.
    Raises PlanflyError for a file that cannot be read.
    """
    if path.exists() and not path.is_file():
        return path.suffix.lower() == ".mcap"
    try:
        with path.open("rb") as file:
            head = file.read(len(MCAP_MAGIC))
    except OSError as error:
        raise PlanflyError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    return head == MCAP_MAGIC or path.suffix.lower() == ".mcap"


def judge_log(log: FlightLog) -> Verdict:
    """Judge a logged flight from its recorded track, and return the verdict."""
    return judge_flight(
        log.setup, log.track, log.ended or CUT_SHORT, log_complete=log.complete, reference=log.reference
    )


def loss_text(log: FlightLog) -> str:
    """Return a line on the missing part of an incomplete log, or "" for a complete log."""
    return "" if log.complete else f"{log.source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"
