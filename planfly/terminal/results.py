"""What commands print of results: verdicts, warnings, and errors in the words of the command line."""

import re
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from planfly.terminal.command_parser import CommandParser, coloured
from world.errors import PlanflyError

if TYPE_CHECKING:
    from logs.recording.reader import FlightLog
    from logs.verdict.findings import Verdict


def print_verdict(verdict: "Verdict", notes: Iterable[str]) -> None:
    """The verdict on the terminal: the summary, then what fails, then what is closest to each rule's limit."""
    # Imported here: --help prints none.
    from planfly.terminal.verdict_lines import verdict_lines

    print("\n".join(verdict_lines(verdict, notes)))


def print_warnings(warnings: Iterable[str]) -> None:
    """Warnings, on standard error."""
    for warning in warnings:
        print(coloured("warning:", "warning", sys.stderr) + f" {warning}", file=sys.stderr)


def warn_of_loss(log: "FlightLog") -> None:
    """What is missing in a log that is not complete, on standard error."""
    from planfly.open_mission import loss_text

    print_warnings([loss_text(log)])


# ----------------------------------------------------------------------
# Errors of the API name its keywords; on the command line they name the options that state them.

# In an error's text: `keyword`, and keyword=True.
_KEYWORD = re.compile(r"`(\w+)`|\b(\w+)=True\b")


def error_text(error: PlanflyError, parser: CommandParser) -> str:
    """An error's line with the options of a command's parser in place of the keywords that they state.

    >>> parser = CommandParser(prog="planfly replay")
    >>> _ = parser.add_argument("--from", dest="start")
    >>> _ = parser.add_argument("--overwrite", action="store_true")
    >>> error_text(PlanflyError.of_argument("start", 9.0, "the log ends at 4 s", file="a.mcap"), parser)
    'a.mcap: --from 9.0: the log ends at 4 s'
    >>> error_text(PlanflyError("a.gif: exists; overwrite=True replaces it", file="a.gif"), parser)
    'a.gif: exists; --overwrite replaces it'
    """
    options, text = parser.keywords(), str(error)
    begin = "" if error.file in options else f"{error.file}: " if error.file else ""
    head = error.file if error.file in options else error.argument
    if head in options and text.startswith(begin + head):
        text = begin + options[head] + text[len(begin + head) :]
    return _KEYWORD.sub(lambda found: options.get(found[1] or found[2], found[0]), text)
