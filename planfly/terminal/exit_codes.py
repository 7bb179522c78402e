"""Define the exit codes and their meaning."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planfly import Verdict

# Help text on the exit codes.
EXIT_CODES = """\
exit codes: 0 flyable, or flown as planned
            1 internal or system error
            2 incorrect usage or invalid input, nothing written
            3 finished, but part of a log is unreadable, a campaign is undecided, or a flight is not judged in full
            4 not flyable, not flown as planned, or no feasible plan
            130 stopped by SIGINT (Ctrl-C), 143 by SIGTERM, within a second"""

FLYABLE = 0
FAULT = 1
BAD_INPUT = 2
INCOMPLETE = 3
NOT_FLYABLE = 4
# Interrupted by Ctrl-C.  By the convention of shells, this is 128 plus the number of the signal.
INTERRUPTED = 130


def verdict_code(verdict: "Verdict") -> int:
    """Return the exit code for a verdict that is flyable, not flyable, or not judged in full."""
    if verdict.undecided:
        return INCOMPLETE
    return FLYABLE if verdict.flyable else NOT_FLYABLE
