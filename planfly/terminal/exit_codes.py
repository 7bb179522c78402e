"""What an exit code means."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planfly import Verdict

EXIT_CODES = """\
exit codes: 0 flyable
            1 internal or system error
            2 incorrect usage or invalid input, nothing written
            3 finished with a reported loss (a damaged log), undecided, or not judged whole
            4 not flyable, or no feasible plan
            130 and 143 ended by SIGINT (Ctrl-C) and SIGTERM, within a second"""

FLYABLE, FAULT, BAD_INPUT, LOSS, NOT_FLYABLE = 0, 1, 2, 3, 4
# By Ctrl-C, as a shell counts what a signal ended: 128 and the signal's number.
INTERRUPTED = 130


def verdict_code(verdict: "Verdict") -> int:
    """The exit code of a verdict: flyable, not flyable, or not judged whole."""
    if verdict.undecided:
        return LOSS
    return FLYABLE if verdict.flyable else NOT_FLYABLE
