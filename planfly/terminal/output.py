"""What a command prints: standard output that outlives its reader, progress on standard error, and the answer."""

import argparse
import contextlib
import io
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from planfly.stages import Advance, Receiver, received_by
from planfly.targets import refuse_existing
from world.errors import PlanflyError
from world.files import write_whole

if TYPE_CHECKING:
    from logs.verdict.findings import Verdict

# ----------------------------------------------------------------------
# Standard output that outlives its reader: ``planfly check M | head -1`` still ends with the verdict's exit code.


class _TolerantStream(io.TextIOBase):
    """Writes to a stream until its reader has gone, and drops the rest."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._gone = False

    def writable(self) -> bool:
        """Take text, always."""
        return True

    def isatty(self) -> bool:
        """Whether the stream behind is a terminal."""
        return self._stream.isatty()

    def write(self, text: str, /) -> int:
        """Pass the text on, or drop it."""
        if not self._gone:
            try:
                self._stream.write(text)
            except BrokenPipeError:
                self._leave()
            except OSError as error:
                raise _named(error) from error
        return len(text)

    def flush(self) -> None:
        """Pass on what is buffered, or drop it."""
        if not self._gone:
            try:
                self._stream.flush()
            except BrokenPipeError:
                self._leave()
            except OSError as error:
                # What it still holds would be tried again when the interpreter ends.
                self._leave()
                raise _named(error) from error

    def _leave(self) -> None:
        self._gone = True
        # What the stream still holds must have somewhere to go when the interpreter ends.
        with contextlib.suppress(OSError, ValueError), Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), self._stream.fileno())


def _named(error: OSError) -> OSError:
    return OSError(error.errno, error.strerror, "standard output")


def open_standard_streams() -> None:
    """Have the process begin with its three streams open, and able to take any text.

    Where one is closed, the next file that is opened would get its number, and what a library prints would go there.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest number that is free.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False), "utf-8")
    if sys.stderr is None:
        sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), "utf-8")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal of few letters, or a file name that is no text.
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    r"""One line without what would move a terminal's cursor or turn its text around: escapes take its place.

    >>> print(printable("a\nb \x1b[2J \u202e"))
    a b \x1b[2J \u202e
    """
    line = " ".join(text.split())
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in line)


@contextlib.contextmanager
def tolerate_closed_output() -> Iterator[None]:
    """Let standard output be closed by whoever reads it."""
    tolerant = _TolerantStream(sys.stdout)
    with contextlib.redirect_stdout(tolerant):
        try:
            yield
        finally:
            tolerant.flush()


# ----------------------------------------------------------------------
# Progress: a bar on a terminal, plain lines elsewhere; on standard error, so that results can be piped.


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


# s.  Where no terminal is, an estimate is told this long after the first report, and again when four times as long has
# passed, at least once a minute.
_FIRST_TOLD, _TOLD_AGAIN, _TOLD_EVERY = 2.0, 4.0, 60.0


class _TimeLeft:
    """How long a stage of work will still take, if it goes on as it went since its first report.

    What comes before that is not the work: kernels may have been compiled.
    """

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None
        self._due = _FIRST_TOLD

    def estimate(self, done: float, total: float) -> str:
        """In words; "" where nothing has been done since the first report, or all, or where the total is not known."""
        if self._first is None:
            self._first = time.monotonic(), done
        more = done - self._first[1]
        if not (more > 0.0 and done < total):
            return ""
        return f"{_duration(self._passed() * (total - done) / more)} left"

    def is_due(self) -> bool:
        """Whether it is time to tell again; asked by what then tells."""
        passed = self._passed()
        if passed < self._due:
            return False
        self._due = min(_TOLD_AGAIN * passed, passed + _TOLD_EVERY)
        return True

    def _passed(self) -> float:
        return 0.0 if self._first is None else time.monotonic() - self._first[0]


def _duration(seconds: float) -> str:
    """A duration that is an estimate.

    >>> _duration(0.4), _duration(89.0), _duration(600.0), _duration(9000.0)
    ('1 s', '89 s', '10 min', '2.5 h')
    """
    if seconds < 120.0:
        return f"{max(1.0, seconds):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def progress(title: str) -> Iterator[Advance]:
    """Show a stage of work; the work reports how much of how much is done, and a remark.

    Beside the remark stands how long it will still take, where the remark does not say.  A total of 0 is one that
    nobody knows.
    """
    if not sys.stderr.isatty():
        yield from _lines(title)
        return
    from tqdm import tqdm

    left = _TimeLeft()
    with tqdm(total=100, desc=title, bar_format="{desc:<22} {bar:30} {percentage:3.0f} %{postfix}", leave=True) as bar:

        def advance(done: float, total: float, remark: str = "") -> None:
            share = 100.0 * done / total if total > 0 else 0.0
            bar.update(max(0.0, min(100.0, share) - bar.n))
            bar.set_postfix_str(_with_estimate(remark, left.estimate(done, total)))

        yield advance
        bar.update(100 - bar.n)


def _with_estimate(remark: str, estimate: str) -> str:
    return ", ".join(filter(None, [remark, "" if _says_left(remark) else estimate]))


def _says_left(remark: str) -> bool:
    """Whether a remark has an estimate of its own: of work that is resumed, or that may turn out to be more."""
    return " left" in remark


def _lines(title: str) -> Iterator[Advance]:
    """A line when work begins, one now and then, and one when it is done; none for input that is refused before."""
    left, last, begun = _TimeLeft(), "", False
    started = time.monotonic()

    def remember(done: float, total: float, remark: str = "") -> None:
        nonlocal last, begun
        estimate = left.estimate(done, total)
        if not begun:
            _say(f"{title} ...")
        elif estimate and left.is_due():
            _say(f"{title}: {_with_estimate(remark, estimate)}")
        last, begun = remark, True

    yield remember
    end = f": {last}" if last else ""
    _say(f"{title}: done in {time.monotonic() - started:.1f} s{end}")


def _ignore(*_: object) -> None:
    pass


ON_STANDARD_ERROR = Receiver(progress, _say)
SILENT = Receiver(lambda _title: contextlib.nullcontext(_ignore), _ignore)


# ----------------------------------------------------------------------
# Where a command's lines and its answer go: ``--json FILE``, ``--json -`` and ``--quiet``.


def answer_text(answer: object) -> str:
    """An answer as the text of a file; what is no number is null."""
    # Imported here: nobody else needs schemas.
    from pydantic import TypeAdapter

    return TypeAdapter(type(answer)).dump_json(answer, indent=1).decode() + "\n"


STANDARD_OUTPUT = "-"
# The standard output of the command under way, while what it prints goes elsewhere.
_output: ContextVar[TextIO | None] = ContextVar("output", default=None)


@contextlib.contextmanager
def asked_output(args: argparse.Namespace) -> Iterator[None]:
    """Print a command's lines where its options ask: nowhere, or beside standard output where the answer goes there.

    Raises PlanflyError for a file to answer into that exists, or that the command reads.
    """
    answer, quiet = getattr(args, "json", None), getattr(args, "quiet", False)
    for target in (answer, getattr(args, "junit", None)):
        if target not in (None, STANDARD_OUTPUT):
            _refuse_inputs(Path(target), args)
            refuse_existing(Path(target), getattr(args, "overwrite", False))
    token = _output.set(sys.stdout)
    try:
        with contextlib.ExitStack() as opened:
            opened.enter_context(received_by(SILENT if quiet else ON_STANDARD_ERROR))
            if quiet:
                nowhere = opened.enter_context(Path(os.devnull).open("w", encoding="utf-8"))
                opened.enter_context(contextlib.redirect_stdout(nowhere))
            elif answer == STANDARD_OUTPUT:
                opened.enter_context(contextlib.redirect_stdout(sys.stderr))
            yield
    finally:
        _output.reset(token)


def give_answer(args: argparse.Namespace, answer: Callable[[], object | str]) -> None:
    """Write what a command answers, where it was asked for; it is made only then.

    answer: gives an instance of a class of `planfly.terminal.answers`, or its text.
    """
    target = getattr(args, "json", None)
    if target is None:
        return
    made = answer()
    text = made if isinstance(made, str) else answer_text(made)
    if target == STANDARD_OUTPUT:
        print(text, end="", file=_output.get() or sys.stdout)
    else:
        write_whole(Path(target), text)


def give_junit(args: argparse.Namespace, verdicts: Mapping[str, "Verdict"]) -> None:
    """Write verdicts as JUnit XML, where that was asked for.  verdicts: by the name of what was judged."""
    if args.junit is not None:
        from logs.verdict.junit import junit_text

        write_whole(Path(args.junit), junit_text(verdicts))


def _refuse_inputs(target: Path, args: argparse.Namespace) -> None:
    """Refuse to answer into a file that the command line names otherwise, too."""
    named = [
        value for key, value in vars(args).items() if isinstance(value, str) and key not in ("json", "junit", "command")
    ]
    for name in named:
        with contextlib.suppress(OSError):
            if target.exists() and target.samefile(name):
                raise PlanflyError(f"{target}: is the input itself; name another file to write", file=target)
