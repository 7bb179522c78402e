"""A flight log as commands meet it: judged as it stands, with a warning where it is cut short."""

from logs.recording.reader import FlightLog
from logs.verdict.findings import Verdict
from logs.verdict.judge_flight import judge_flight
from planfly.terminal.results import print_warnings

# How a flight ended whose log does not hold its end.
CUT_SHORT = "the log ends before the flight does"


def judge_log(log: FlightLog) -> Verdict:
    """The verdict on a log's flight, of the rows it holds."""
    return judge_flight(log.setup, log.track, log.ended or CUT_SHORT, whole=log.complete, beside=log.beside)


def warn_of_loss(log: FlightLog) -> None:
    """What is missing in a log that is not complete, on standard error."""
    print_warnings([f"{log.source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
