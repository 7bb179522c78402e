"""Output of a command: standard output that survives a closed pipe, progress on standard error, and the answer."""

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
from planfly.workflow.output_paths import refuse_existing
from world.errors import PlanflyError
from world.files import read_at_most, write_whole

if TYPE_CHECKING:
    from logs.verdict.verdict import Verdict

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
        """Return True if the stream behind is a terminal."""
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
    r"""Return one line without what would move a terminal's cursor or turn its text around: escapes take its place.

    >>> print(printable("a\nb \x1b[2J \u202e"))
    a b \x1b[2J \u202e
    """
    line = " ".join(text.split())
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in line)


@contextlib.contextmanager
def tolerate_closed_output() -> Iterator[None]:
    """Let the reader of standard output close it."""
    tolerant = _TolerantStream(sys.stdout)
    with contextlib.redirect_stdout(tolerant):
        try:
            yield
        finally:
            tolerant.flush()


# ----------------------------------------------------------------------
# What stages took the last time, by their kind: what there is to say of one before anything of it is measured.

# Kinds are a few dozen; what is longer is none of ours.
_MAX_BYTES = 20_000


class _LastTime(NamedTuple):
    """Duration of a stage of a kind.

    each: s for each unit that it counts, 0 where it counts none.  whole: s of all of it.
    """

    each: float
    whole: float


def _times_file() -> Path:
    # Imported here: who asks for help has no need of it.
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("planfly")) / "durations.json"


def _last_times() -> dict[str, _LastTime]:
    """By kind of stage; none where the file is not there, or no such file."""
    found = {}
    with contextlib.suppress(OSError, ValueError, RecursionError):
        read = json.loads(read_at_most(_times_file(), _MAX_BYTES, "durations"))
        for kind, taken in read.items() if isinstance(read, dict) else ():
            numbers = taken if isinstance(taken, list) and len(taken) == 2 else [math.nan]
            if all(isinstance(one, int | float) and 0.0 <= one < math.inf for one in numbers):
                found[str(kind)] = _LastTime(*map(float, numbers))
    return found


def _keep_time(kind: str, taken: _LastTime) -> None:
    """Remember what a stage of a kind took; nothing is said where that cannot be written."""
    text = json.dumps(_last_times() | {kind: tuple(float(f"{one:.4g}") for one in taken)}, indent=1)
    with contextlib.suppress(OSError):
        _times_file().parent.mkdir(parents=True, exist_ok=True)
        write_whole(_times_file(), text)


# ----------------------------------------------------------------------
# Progress: a bar on a terminal, plain lines elsewhere; on standard error, so that results can be piped.


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


# s.  Where no terminal is, an estimate is told this long after the first report, and again when four times as long has
# passed, at least once a minute; and a stage that reports nothing is named after the first second, and once a minute.
_FIRST_REPORT = 2.0
_REPORT_AGAIN = 4.0
_REPORT_EVERY = 60.0
_LOOKS_EVERY = 1.0
# Stages that have begun in this process: one within another makes the outer one's time none that comes again.
_begun = itertools.count()


class _TimeLeft:
    """Time left for a stage, extrapolated from its first report on; known from its second report on.

    Until then there is what such a stage took the last time.
    What comes before the first report is not the work: kernels may have been compiled.
    """

    def __init__(self, kind: str) -> None:
        self._kind, self._number = kind, next(_begun)
        self._started = time.monotonic()
        self._first: tuple[float, float] | None = None
        self._done, self._due = 0.0, _FIRST_REPORT

    def estimate(self, done: float, total: float) -> str:
        """In words; "" where nothing has been done since the first report, or all, or where the total is not known."""
        if self._first is None:
            self._first = time.monotonic(), done
        self._done, more = done, done - self._first[1]
        if not (more > 0.0 and done < total):
            return ""
        return f"{_duration(self._passed() * (total - done) / more)} left"

    def at_first(self, to_do: float) -> str:
        """In words, before anything is measured.  to_do: units that are to be done, 0 if unknown."""
        last = _last_times().get(self._kind)
        if last is not None and to_do > 0.0 and last.each > 0.0:
            return f"about {_duration(last.each * to_do)}, at the pace of the last time here"
        if last is not None:
            return f"the last one here took {_duration(last.whole)}"
        return "no estimate yet" if to_do > 0.0 else "no estimate"

    def is_due(self) -> bool:
        """Return True if it is time to tell again; asked by what then tells."""
        passed = self._passed()
        if passed < self._due:
            return False
        self._due = min(_REPORT_AGAIN * passed, passed + _REPORT_EVERY)
        return True

    def elapsed(self) -> float:
        """Return seconds since it began."""
        return time.monotonic() - self._started

    def keep(self) -> None:
        """Remember what all of it took for the next time, unless it had another stage within, such as a compilation."""
        if next(_begun) == self._number + 1:
            units = 0.0 if self._first is None else self._done - self._first[1]
            _keep_time(self._kind, _LastTime(self._passed() / units if units > 0.0 else 0.0, self.elapsed()))

    def _passed(self) -> float:
        return 0.0 if self._first is None else time.monotonic() - self._first[0]


def _duration(seconds: float) -> str:
    """Return a duration that is an estimate.

    >>> _duration(0.4), _duration(89.0), _duration(600.0), _duration(9000.0)
    ('1 s', '89 s', '10 min', '2.5 h')
    """
    if seconds < 120.0:
        return f"{max(1.0, seconds):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def progress(title: str, kind: str = "") -> Iterator[Advance]:
    """Show a stage of work; the work reports how much of how much is done, and a remark.

    kind: see `planfly.runtime.stages.stage`.
    Beside the remark stands how long it will still take, where the remark does not say; at first, what such a stage
    took the last time on this machine, or that there is no estimate.  A total of 0 is unknown.
    """
    left = _TimeLeft(kind or title)
    shown = _Bar(title, left) if sys.stderr.isatty() else _Lines(title, left)
    with shown, _looked_at(shown):
        yield shown.advance
    left.keep()


@contextmanager
def _looked_at(shown: "_Bar | _Lines") -> Iterator[None]:
    """Have a stage look at the clock now and then, whatever its work is at; without a thread where there is no room."""
    over = threading.Event()

    def look() -> None:
        # Whoever read it may be gone: the work itself meets that.
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


def _says_left(remark: str) -> bool:
    """Return True if a remark has an estimate of its own: of work that is resumed, or that may turn out to be more."""
    return " left" in remark


class _Bar:
    """A stage on a terminal.  Its estimate of the last time stands until there is one of this time."""

    def __init__(self, title: str, left: _TimeLeft) -> None:
        from tqdm import tqdm

        self._left, self._lock = left, threading.Lock()
        self._remark, self._measured = "", False
        self._at_first = left.at_first(0.0)
        form = "{desc:<22} {bar:30} {percentage:3.0f} %{postfix}"
        self._bar = tqdm(total=100, desc=title, bar_format=form, leave=True)

    def __enter__(self) -> None:
        self.look()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        with self._lock:
            if error is None:
                self._bar.set_postfix_str(self._remark, refresh=False)
                self._bar.update(100 - self._bar.n)
            self._bar.close()

    def advance(self, done: float, total: float, remark: str = "") -> None:
        """Take how far it is."""
        with self._lock:
            share = 100.0 * done / total if total > 0 else 0.0
            self._bar.update(max(0.0, min(100.0, share) - self._bar.n))
            estimate = self._left.estimate(done, total)
            self._remark = remark
            if estimate or _says_left(remark) or 0.0 < total <= done:
                self._measured = True
            if not self._measured:
                self._at_first = self._left.at_first(max(0.0, total - done))
                estimate = self._at_first
            self._bar.set_postfix_str(_joined(remark, "" if _says_left(remark) else estimate))

    def look(self) -> None:
        """Show how long it has taken so far, as long as nothing is measured."""
        with self._lock:
            if not self._measured and not self._bar.disable:
                self._bar.set_postfix_str(_joined(self._remark, self._at_first, f"{self._left.elapsed():.0f} s so far"))


class _Lines:
    """A stage where no terminal is: a line when work begins, one now and then, and one when it is done.

    None for input that is refused before, within the first second.
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
        """Take how far it is."""
        with self._lock:
            self._remark = remark
            estimate = self._left.estimate(done, total)
            counted, self._counted = self._counted, self._counted or total > 0.0
            at_first = "" if counted else remark if _says_left(remark) else self._left.at_first(max(0.0, total - done))
            if not self._begun:
                self._begin(at_first if _says_left(remark) else _joined(remark if total > 0.0 else "", at_first))
            elif total > 0.0 and not counted:
                # It had been named before it knew how much there is.
                self._tell(f"{self._title}: {_joined('' if _says_left(remark) else remark, at_first)}")
            elif estimate and self._left.is_due():
                self._tell(f"{self._title}: {_joined(remark, '' if _says_left(remark) else estimate)}")

    def look(self) -> None:
        """Name a stage that reports nothing, and say now and then how long it has taken so far."""
        with self._lock:
            if self._over:
                return
            if not self._begun:
                self._begin(self._left.at_first(0.0))
            elif self._left.elapsed() - self._told >= _REPORT_EVERY:
                self._tell(f"{self._title}: {_joined(self._remark, f'{self._left.elapsed():.0f} s so far')}")

    def _begin(self, estimate: str) -> None:
        self._begun = True
        self._tell(f"{self._title} ... ({estimate})")

    def _tell(self, line: str) -> None:
        self._told = self._left.elapsed()
        _say(line)


def _ignore(*_: object) -> None:
    pass


ON_STANDARD_ERROR = Receiver(progress, _say)
SILENT = Receiver(lambda *_: contextlib.nullcontext(_ignore), _ignore)


# ----------------------------------------------------------------------
# Where a command's lines and its answer go: ``--json FILE``, ``--json -`` and ``--quiet``.


def answer_text(answer: object) -> str:
    """Return an answer as the text of a file; what is no number is null."""
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

        write_whole(Path(args.junit), junit_text({name: verdict.present() for name, verdict in verdicts.items()}))


def _refuse_inputs(target: Path, args: argparse.Namespace) -> None:
    """Refuse to answer into a file that the command line names otherwise, too."""
    named = [
        value for key, value in vars(args).items() if isinstance(value, str) and key not in ("json", "junit", "command")
    ]
    for name in named:
        with contextlib.suppress(OSError):
            if target.exists() and target.samefile(name):
                raise PlanflyError(f"{target}: is the input itself; name another file to write", file=target)
