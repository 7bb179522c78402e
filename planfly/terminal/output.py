"""Output of a command: standard output, which survives a closed pipe, progress and the answer."""

import argparse
import contextlib
import io
import itertools
import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TextIO

from planfly.runtime.stages import Advance, Receiver, received_by
from planfly.terminal.command_parser import wants_colour
from planfly.terminal.control_characters import escaped_json, without_controls
from planfly.workflow.output_paths import check_output_file
from world.errors import PlanflyError
from world.files import read_at_most, write_whole

if TYPE_CHECKING:
    from logs.verdict.verdict import Verdict

# ----------------------------------------------------------------------
# Standard streams: no text of a foreign file controls the terminal, and a closed pipe is tolerated:
# ``planfly check M | head -1`` still exits with the code of the verdict.


class _SafeStream(io.TextIOBase):
    """Stream without control characters in its text.

    plain: the underlying stream, for text that moves the cursor.
    """

    def __init__(self, stream: TextIO) -> None:
        self.plain = stream

    def writable(self) -> bool:
        """Return True: the stream always takes text."""
        return True

    def isatty(self) -> bool:
        """Return True if the underlying stream is a terminal."""
        return self.plain.isatty()

    def fileno(self) -> int:
        """Return the descriptor of the underlying stream."""
        return self.plain.fileno()

    def write(self, text: str, /) -> int:
        """Pass the text on."""
        self.plain.write(without_controls(text, colours=wants_colour(self.plain)))
        return len(text)

    def flush(self) -> None:
        """Pass on what is buffered."""
        self.plain.flush()


class _TolerantStream(_SafeStream):
    """Stream that writes until its reader has gone, and drops the rest."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._gone = False

    def write(self, text: str, /) -> int:
        """Pass the text on, or drop it."""
        if not self._gone:
            try:
                super().write(text)
            except BrokenPipeError:
                self._leave()
            except OSError as error:
                raise _named(error) from error
        return len(text)

    def flush(self) -> None:
        """Pass on what is buffered, or drop it."""
        if not self._gone:
            try:
                super().flush()
            except BrokenPipeError:
                self._leave()
            except OSError as error:
                # The interpreter would try to write the buffered text again when it ends.
                self._leave()
                raise _named(error) from error

    def _leave(self) -> None:
        self._gone = True
        # When the interpreter ends, the buffered text must have somewhere to go.
        with contextlib.suppress(OSError, ValueError), Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), self.fileno())


def _named(error: OSError) -> OSError:
    return OSError(error.errno, error.strerror, "standard output")


def open_standard_streams() -> None:
    """Open the three standard streams that are closed, and let them take any text.

    If one were closed, the next file to be opened would get its number, and text that a library prints would go there.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # This takes the lowest free descriptor.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False), "utf-8")
    if sys.stderr is None:
        sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), "utf-8")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # For a terminal with a small character set, or a file name that is not valid text.
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    r"""Return a text as one line, with escapes for characters that move the cursor or reverse the text.

    >>> print(printable("a\nb \x1b[2J \u202e"))
    a b \x1b[2J \u202e
    """
    return without_controls(" ".join(text.split()))


def plain_stream(stream: TextIO) -> TextIO:
    """Return the stream for text that moves the cursor, below a stream without control characters."""
    plain: TextIO = getattr(stream, "plain", stream)
    return plain


@contextlib.contextmanager
def safe_streams() -> Iterator[None]:
    """Keep control characters from both standard streams, and tolerate that the reader of standard output closes it."""
    tolerant = _TolerantStream(sys.stdout)
    with contextlib.redirect_stdout(tolerant), contextlib.redirect_stderr(_SafeStream(sys.stderr)):
        try:
            yield
        finally:
            tolerant.flush()


# ----------------------------------------------------------------------
# Durations of previous runs, by kind of stage: the estimate for a stage before it reports any progress.

# Largest file of durations that is read, bytes.  There are a few dozen kinds; a larger file was not written by planfly.
_MAX_BYTES = 20_000


class _LastDuration(NamedTuple):
    """Duration of the previous stage of a kind.

    each: seconds per unit of work, 0 if its units are unknown.  whole: seconds for the whole stage.
    """

    each: float
    whole: float


def _times_file() -> Path:
    # Imported here: the help does not need it.
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("planfly")) / "durations.json"


def _last_durations() -> dict[str, _LastDuration]:
    """Return the last duration by kind of stage; empty if the file is missing or invalid."""
    found = {}
    with contextlib.suppress(OSError, ValueError, RecursionError):
        read = json.loads(read_at_most(_times_file(), _MAX_BYTES, "durations"))
        for kind, taken in read.items() if isinstance(read, dict) else ():
            numbers = taken if isinstance(taken, list) and len(taken) == 2 else [math.nan]
            if all(isinstance(one, int | float) and 0.0 <= one < math.inf for one in numbers):
                found[str(kind)] = _LastDuration(*map(float, numbers))
    return found


def _keep_time(kind: str, taken: _LastDuration) -> None:
    """Store the duration of a stage of a kind; a file that cannot be written is ignored silently."""
    text = json.dumps(_last_durations() | {kind: tuple(float(f"{one:.4g}") for one in taken)}, indent=1)
    with contextlib.suppress(OSError):
        _times_file().parent.mkdir(parents=True, exist_ok=True)
        write_whole(_times_file(), text)


# ----------------------------------------------------------------------
# Progress: a bar on a terminal, plain lines elsewhere; on standard error, so that results can be piped.


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


# Without a terminal, delay from the first report of a stage to the first line with an estimate, s.
_FIRST_REPORT_DELAY_S = 2.0
# Ratio of the time of the next line to the time of the last line.
_REPORT_INTERVAL_RATIO = 4.0
# Longest time between two lines, also of a stage that reports nothing, s.
_MAX_REPORT_INTERVAL_S = 60.0
# Interval at which a stage checks the clock, s; a stage that reports nothing is named after the first interval.
_LOOKS_EVERY = 1.0
# Counter of the stages begun in this process.  The duration of a stage that contains another one is not stored: the
# inner stage may not occur again.
_stage_numbers = itertools.count()


class _TimeLeft:
    """Time left for a stage, extrapolated from its first report; known from its second report on.

    Until then, the duration of the previous stage of its kind is given.
    The time before the first report is left out: kernels may have been compiled in it.
    """

    def __init__(self, kind: str) -> None:
        self._kind, self._number = kind, next(_stage_numbers)
        self._started = time.monotonic()
        self._first: tuple[float, float] | None = None
        self._done, self._due = 0.0, _FIRST_REPORT_DELAY_S

    def estimate(self, done: float, total: float) -> str:
        """Return the time left in words; "" if no progress since the first report, all done, or total unknown."""
        if self._first is None:
            self._first = time.monotonic(), done
        self._done, more = done, done - self._first[1]
        if not (more > 0.0 and done < total):
            return ""
        return f"{_duration(self._passed() * (total - done) / more)} left"

    def at_first(self, to_do: float) -> str:
        """Return an estimate in words before any progress is measured.  to_do: units of work, 0 if unknown."""
        last = _last_durations().get(self._kind)
        if last is not None and to_do > 0.0 and last.each > 0.0:
            return f"about {_duration(last.each * to_do)}, at the pace of the last time here"
        if last is not None:
            return f"the last one here took {_duration(last.whole)}"
        return "no estimate yet" if to_do > 0.0 else "no estimate"

    def is_due(self) -> bool:
        """Return True if the next progress line is due, and schedule the one after it."""
        passed = self._passed()
        if passed < self._due:
            return False
        self._due = min(_REPORT_INTERVAL_RATIO * passed, passed + _MAX_REPORT_INTERVAL_S)
        return True

    def elapsed(self) -> float:
        """Return the seconds since the stage began."""
        return time.monotonic() - self._started

    def keep(self) -> None:
        """Store the duration for the next run, unless the stage contained another one, such as a compilation."""
        if next(_stage_numbers) == self._number + 1:
            units = 0.0 if self._first is None else self._done - self._first[1]
            _keep_time(self._kind, _LastDuration(self._passed() / units if units > 0.0 else 0.0, self.elapsed()))

    def _passed(self) -> float:
        return 0.0 if self._first is None else time.monotonic() - self._first[0]


def _duration(seconds: float) -> str:
    """Return an estimated duration in words.

    >>> _duration(0.4), _duration(89.0), _duration(600.0), _duration(9000.0)
    ('1 s', '89 s', '10 min', '2.5 h')
    """
    if seconds < 120.0:
        return f"{max(1.0, seconds):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def progress(title: str, kind: str = "") -> Iterator[Advance]:
    """Show the progress of a stage; the work reports the units done, the total and a remark.

    kind: see `planfly.runtime.stages.stage`.
    The time left follows the remark, unless the remark states it.  At first, the duration of the previous stage of its
    kind on this machine is shown, or "no estimate".  A total of 0 means that the total is unknown.
    """
    left = _TimeLeft(kind or title)
    shown = _Bar(title, left) if sys.stderr.isatty() else _Lines(title, left)
    with shown, _looked_at(shown):
        yield shown.advance
    left.keep()


@contextmanager
def _looked_at(shown: "_Bar | _Lines") -> Iterator[None]:
    """Update the elapsed time of a stage at intervals from a thread, or not at all if no thread can start."""
    over = threading.Event()

    def look() -> None:
        # The reader of the stream may be gone: the work itself handles that error.
        with contextlib.suppress(OSError, ValueError):
            while not over.wait(_LOOKS_EVERY):
                shown.look()

    watcher = threading.Thread(target=look, name="progress", daemon=True)
    with contextlib.suppress(RuntimeError):
        watcher.start()
    try:
        yield
    finally:
        over.set()


def _joined(*parts: str) -> str:
    return ", ".join(filter(None, parts))


def _states_time_left(remark: str) -> bool:
    """Return True if a remark states the time left itself: for resumed work, or work that may still grow."""
    return " left" in remark


class _Bar:
    """Progress bar of a stage on a terminal.

    It shows the estimate from the previous run until this run is measured.
    """

    def __init__(self, title: str, left: _TimeLeft) -> None:
        from tqdm import tqdm

        self._left, self._lock = left, threading.Lock()
        self._remark, self._measured = "", False
        self._at_first = left.at_first(0.0)
        form = "{desc:<22} {bar:30} {percentage:3.0f} %{postfix}"
        file = plain_stream(sys.stderr)
        self._bar = tqdm(total=100, desc=printable(title), bar_format=form, leave=True, file=file)

    def __enter__(self) -> None:
        self.look()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        with self._lock:
            if error is None:
                self._bar.set_postfix_str(printable(self._remark), refresh=False)
                self._bar.update(100 - self._bar.n)
            self._bar.close()

    def advance(self, done: float, total: float, remark: str = "") -> None:
        """Take the progress of the work."""
        with self._lock:
            share = 100.0 * done / total if total > 0 else 0.0
            self._bar.update(max(0.0, min(100.0, share) - self._bar.n))
            estimate = self._left.estimate(done, total)
            self._remark = remark
            if estimate or _states_time_left(remark) or 0.0 < total <= done:
                self._measured = True
            if not self._measured:
                self._at_first = self._left.at_first(max(0.0, total - done))
                estimate = self._at_first
            text = _joined(remark, "" if _states_time_left(remark) else estimate)
            self._bar.set_postfix_str(printable(text))

    def look(self) -> None:
        """Show the elapsed time until progress is measured."""
        with self._lock:
            if not self._measured and not self._bar.disable:
                text = _joined(self._remark, self._at_first, f"{self._left.elapsed():.0f} s so far")
                self._bar.set_postfix_str(printable(text))


class _Lines:
    """Progress lines of a stage without a terminal: one at the start, some at intervals, one at the end.

    Input that is refused within the first second gets no line.
    """

    def __init__(self, title: str, left: _TimeLeft) -> None:
        self._title, self._left, self._lock = title, left, threading.Lock()
        self._remark, self._told = "", 0.0
        self._begun = self._counted = self._over = False

    def __enter__(self) -> None:
        pass

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        with self._lock:
            self._over = True
            if error is None:
                end = f": {self._remark}" if self._remark else ""
                _say(f"{self._title}: done in {self._left.elapsed():.1f} s{end}")

    def advance(self, done: float, total: float, remark: str = "") -> None:
        """Take the progress of the work."""
        with self._lock:
            self._remark = remark
            estimate = self._left.estimate(done, total)
            counted, self._counted = self._counted, self._counted or total > 0.0
            at_first = (
                "" if counted else remark if _states_time_left(remark) else self._left.at_first(max(0.0, total - done))
            )
            if not self._begun:
                self._begin(at_first if _states_time_left(remark) else _joined(remark if total > 0.0 else "", at_first))
            elif total > 0.0 and not counted:
                # The first line was printed before the total was known.
                self._tell(f"{self._title}: {_joined('' if _states_time_left(remark) else remark, at_first)}")
            elif estimate and self._left.is_due():
                self._tell(f"{self._title}: {_joined(remark, '' if _states_time_left(remark) else estimate)}")

    def look(self) -> None:
        """Name a stage that reports nothing, and print its elapsed time at intervals."""
        with self._lock:
            if self._over:
                return
            if not self._begun:
                self._begin(self._left.at_first(0.0))
            elif self._left.elapsed() - self._told >= _MAX_REPORT_INTERVAL_S:
                self._tell(f"{self._title}: {_joined(self._remark, f'{self._left.elapsed():.0f} s so far')}")

    def _begin(self, estimate: str) -> None:
        self._begun = True
        self._tell(f"{self._title} ... ({estimate})")

    def _tell(self, line: str) -> None:
        self._told = self._left.elapsed()
        _say(line)


def _ignore(*_: object) -> None:
    pass


# Receiver that shows progress on standard error.
ON_STANDARD_ERROR = Receiver(progress, _say)
# Receiver that shows nothing.
SILENT = Receiver(lambda *_: contextlib.nullcontext(_ignore), _ignore)


# ----------------------------------------------------------------------
# Destination of the lines and the answer of a command: ``--json FILE``, ``--json -`` and ``--quiet``.


def answer_text(answer: object) -> str:
    """Return an answer as JSON text; NaN and infinity are null."""
    # Imported here: only answers need schemas.
    from pydantic import TypeAdapter

    return TypeAdapter(type(answer)).dump_json(answer, indent=1).decode() + "\n"


# File name that stands for standard output.
STANDARD_OUTPUT = "-"
# Standard output of the running command while its printed lines are redirected.
_output: ContextVar[TextIO | None] = ContextVar("output", default=None)


@contextlib.contextmanager
def asked_output(args: argparse.Namespace) -> Iterator[None]:
    """Redirect printed lines: to nowhere with --quiet, to standard error if stdout gets the answer.

    Raises PlanflyError if the file for the answer exists, or is one that the command reads.
    """
    answer, quiet = getattr(args, "json", None), getattr(args, "quiet", False)
    for target in (answer, getattr(args, "junit", None)):
        if target not in (None, STANDARD_OUTPUT):
            _refuse_inputs(Path(target), args)
            check_output_file(Path(target), getattr(args, "overwrite", False))
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
    """Write the answer of a command if one was requested; it is computed only then.

    answer: returns an instance of a class of `planfly.terminal.answers`, or its text.
    """
    target = getattr(args, "json", None)
    if target is None:
        return
    made = answer()
    text = made if isinstance(made, str) else answer_text(made)
    if target == STANDARD_OUTPUT:
        print(escaped_json(text), end="", file=_output.get() or sys.stdout)
    else:
        write_whole(Path(target), text)


def give_junit(args: argparse.Namespace, verdicts: Mapping[str, "Verdict"]) -> None:
    """Write verdicts as JUnit XML if requested.  verdicts: by the name of the judged mission or flight."""
    if args.junit is not None:
        from logs.verdict.junit import junit_text

        write_whole(Path(args.junit), junit_text({name: verdict.present() for name, verdict in verdicts.items()}))


def give_junit_error(args: argparse.Namespace, message: str) -> None:
    """Write an error as JUnit XML if requested.  message: the line that the command ends with."""
    target = getattr(args, "junit", None)
    if target is not None:
        from logs.verdict.junit import junit_error_text

        judged = next(getattr(args, name) for name in ("what", "mission", "scenario", "log") if hasattr(args, name))
        write_whole(Path(target), junit_error_text(str(judged), message))


def _refuse_inputs(target: Path, args: argparse.Namespace) -> None:
    """Refuse to write the answer to a file that another argument of the command line names."""
    named = [
        value for key, value in vars(args).items() if isinstance(value, str) and key not in ("json", "junit", "command")
    ]
    for name in named:
        with contextlib.suppress(OSError):
            if target.exists() and target.samefile(name):
                raise PlanflyError(f"{target}: is the input itself; name another file to write", file=target)
