"""Output of a command: text, progress, and the answer as JSON.

Text goes to standard output, also after a closed pipe.
"""

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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TextIO

from planfly.runtime.stages import Advance, Receiver, send_progress_to
from planfly.terminal.command_parser import BAD_INPUT, CommandParser, colour_text, wants_colour
from planfly.terminal.control_characters import escape_controls, escape_json_controls
from planfly.workflow.output_paths import check_output_file
from world.errors import PlanflyError
from world.files import read_at_most, write_atomically

if TYPE_CHECKING:
    from logs.recording.reader import FlightLog
    from logs.verdict.junit import JunitSuite
    from logs.verdict.verdict import Verdict

# ----------------------------------------------------------------------
# Standard streams.  No text of a foreign file controls the terminal, and a closed pipe is tolerated:
# ``planfly check M | head -1`` still exits with the code of the verdict.


class _SafeStream(io.TextIOBase):
    """Text stream that escapes control characters and writes the text to an underlying stream.

    plain: the underlying stream, to which text that moves the cursor is written directly.
    """

    def __init__(self, stream: TextIO) -> None:
        self.plain = stream

    def writable(self) -> bool:
        """Return True, because the stream always accepts text."""
        return True

    def isatty(self) -> bool:
        """Return True if the underlying stream is a terminal."""
        return self.plain.isatty()

    def fileno(self) -> int:
        """Return the descriptor of the underlying stream."""
        return self.plain.fileno()

    def write(self, text: str, /) -> int:
        """Write the text with its control characters escaped."""
        self.plain.write(escape_controls(text, colours=wants_colour(self.plain)))
        return len(text)

    def flush(self) -> None:
        """Flush the buffered text."""
        self.plain.flush()


class _TolerantStream(_SafeStream):
    """Stream that discards all text after its reader has closed the pipe."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._is_reader_gone = False

    def write(self, text: str, /) -> int:
        """Write the text, or discard it if the reader has closed the pipe."""
        if not self._is_reader_gone:
            try:
                super().write(text)
            except BrokenPipeError:
                self._drop_output()
            except OSError as error:
                raise _with_stream_name(error) from error
        return len(text)

    def flush(self) -> None:
        """Flush the buffered text, or discard it if the reader has closed the pipe."""
        if not self._is_reader_gone:
            try:
                super().flush()
            except BrokenPipeError:
                self._drop_output()
            except OSError as error:
                # The interpreter would try to write the buffered text again when it ends.
                self._drop_output()
                raise _with_stream_name(error) from error

    def _drop_output(self) -> None:
        """Discard all further text.

        The descriptor is redirected to the null device, which receives the text that is still buffered.
        """
        self._is_reader_gone = True
        # When the interpreter ends, it flushes the buffered text, which then goes to the null device.
        with contextlib.suppress(OSError, ValueError), Path(os.devnull).open("w") as null_file:
            os.dup2(null_file.fileno(), self.fileno())


def _with_stream_name(error: OSError) -> OSError:
    """Return a copy of an error that names standard output as its file."""
    return OSError(error.errno, error.strerror, "standard output")


def open_standard_streams() -> None:
    """Open the standard streams that are closed, and let output and error stream accept any text.

    If a stream stayed closed, the next opened file would get its descriptor, and text printed by a library would go
    into that file.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # This takes the lowest free descriptor.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False), "utf-8")
    if sys.stderr is None:
        sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), "utf-8")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # Escape characters that the terminal lacks, and file names that are not valid text.
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    r"""Return a text as one line, with escapes for characters that move the cursor or reverse the text.

    >>> print(printable("a\nb \x1b[2J \u202e"))
    a b \x1b[2J \u202e
    """
    return escape_controls(" ".join(text.split()))


def plain_stream(stream: TextIO) -> TextIO:
    """Return the stream below a `_SafeStream`, for text that moves the cursor.

    Other streams are returned unchanged.
    """
    plain: TextIO = getattr(stream, "plain", stream)
    return plain


@contextlib.contextmanager
def safe_streams() -> Iterator[None]:
    """Escape control characters in standard output and error, and tolerate a closed pipe."""
    tolerant = _TolerantStream(sys.stdout)
    with contextlib.redirect_stdout(tolerant), contextlib.redirect_stderr(_SafeStream(sys.stderr)):
        try:
            yield
        finally:
            tolerant.flush()


def print_warnings(warnings: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for warning in warnings:
        print(colour_text("warning:", "warning", sys.stderr) + f" {warning}", file=sys.stderr)


def warn_about_incomplete_log(log: "FlightLog") -> None:
    """Print a warning on standard error about the missing part of an incomplete log."""
    from planfly.flight_logs import loss_text

    print_warnings([loss_text(log)])


# ----------------------------------------------------------------------
# Durations of previous runs, by kind of stage: the estimate for a stage before it reports any progress.

# Maximum size of the file of durations, bytes. There are a few dozen kinds; planfly does not write a larger file.
_MAX_BYTES = 20_000


class _LastDuration(NamedTuple):
    """Duration of the last stage of its kind that was run on this machine.

    per_unit: seconds per unit of work, 0 if the number of units is unknown.
    total: seconds for the whole stage.
    """

    per_unit: float
    total: float


def _durations_file() -> Path:
    """Return the path of the file with the durations of earlier stages, in the user's cache folder."""
    # Imported here: the help does not need it.
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("planfly")) / "durations.json"


def _read_durations() -> dict[str, _LastDuration]:
    """Return the stored duration of the last stage of each kind, by kind; empty without a valid file."""
    durations = {}
    with contextlib.suppress(OSError, ValueError, RecursionError):
        stored_durations = json.loads(read_at_most(_durations_file(), _MAX_BYTES, "durations"))
        for kind, values in stored_durations.items() if isinstance(stored_durations, dict) else ():
            numbers = values if isinstance(values, list) and len(values) == 2 else [math.nan]
            if all(isinstance(value, int | float) and 0.0 <= value < math.inf for value in numbers):
                durations[str(kind)] = _LastDuration(*map(float, numbers))
    return durations


def _write_duration(kind: str, duration: _LastDuration) -> None:
    """Store the duration of the last stage of a kind; if the file cannot be written, do nothing."""
    text = json.dumps(_read_durations() | {kind: tuple(float(f"{value:.4g}") for value in duration)}, indent=1)
    with contextlib.suppress(OSError):
        _durations_file().parent.mkdir(parents=True, exist_ok=True)
        write_atomically(_durations_file(), text)


# ----------------------------------------------------------------------
# Progress: a bar on a terminal, plain lines elsewhere; on standard error, so that results can be piped.


def _print_line(line: str) -> None:
    """Print a progress line on standard error."""
    print(line, file=sys.stderr, flush=True)


# Without a terminal, delay from the first report of a stage to the first line with an estimate, s.
_FIRST_REPORT_DELAY_S = 2.0
# Ratio of the time of the next line to the time of the last line.
_REPORT_INTERVAL_RATIO = 4.0
# Maximum time between two lines, also of a stage that reports nothing, s.
_MAX_REPORT_INTERVAL_S = 60.0
# Interval at which a stage checks the clock, s; a stage that reports nothing is named after the first interval.
_REFRESH_INTERVAL_S = 1.0
# Counter of the stages begun in this process.  The duration of a stage that contains another stage is not stored,
# because the inner stage may not occur again.
_stage_numbers = itertools.count()


class _TimeLeft:
    """Estimate of the time left for a stage, extrapolated from the progress since its first report.

    Until the second report, the duration of the last stage of its kind is the estimate.  The time before the first
    report is ignored, because kernels may have been compiled in it.
    """

    def __init__(self, kind: str) -> None:
        self._kind, self._number = kind, next(_stage_numbers)
        self._start_time = time.monotonic()
        self._first_report: tuple[float, float] | None = None
        self._done, self._next_report_time = 0.0, _FIRST_REPORT_DELAY_S

    def estimate(self, done: float, total: float) -> str:
        """Record the work done, and return the time left as text.

        done, total: units of work; a total of 0 is unknown.

        The text is "" if the work is done, if the total is unknown, or if there was no progress since the first report.
        """
        if self._first_report is None:
            self._first_report = time.monotonic(), done
        self._done, units_done = done, done - self._first_report[1]
        if not (units_done > 0.0 and done < total):
            return ""
        return f"{_duration_text(self._measured_time() * (total - done) / units_done)} left"

    def initial_estimate(self, remaining_units: float) -> str:
        """Return the estimate before any progress is measured, from the last stage of this kind, as text.

        remaining_units: units of work still to be done, 0 if unknown.
        """
        last_duration = _read_durations().get(self._kind)
        if last_duration is not None and remaining_units > 0.0 and last_duration.per_unit > 0.0:
            return f"about {_duration_text(last_duration.per_unit * remaining_units)}, at the rate of the last run"
        if last_duration is not None:
            return f"the last run took {_duration_text(last_duration.total)}"
        return "no estimate yet" if remaining_units > 0.0 else "no estimate"

    def is_due(self) -> bool:
        """Return True if the next progress line is due, and schedule the line after that."""
        elapsed = self._measured_time()
        if elapsed < self._next_report_time:
            return False
        self._next_report_time = min(_REPORT_INTERVAL_RATIO * elapsed, elapsed + _MAX_REPORT_INTERVAL_S)
        return True

    def elapsed(self) -> float:
        """Return the seconds since the stage began."""
        return time.monotonic() - self._start_time

    def store_duration(self) -> None:
        """Store the duration of the stage for the next run.

        A stage that contained another stage, such as a compilation, is not stored.
        """
        if next(_stage_numbers) == self._number + 1:
            units = 0.0 if self._first_report is None else self._done - self._first_report[1]
            _write_duration(
                self._kind, _LastDuration(self._measured_time() / units if units > 0.0 else 0.0, self.elapsed())
            )

    def _measured_time(self) -> float:
        """Return the seconds since the first report, or 0 before it."""
        return 0.0 if self._first_report is None else time.monotonic() - self._first_report[0]


def _duration_text(seconds: float) -> str:
    """Return an estimated duration as text.

    >>> _duration_text(0.4), _duration_text(89.0), _duration_text(600.0), _duration_text(9000.0)
    ('1 s', '89 s', '10 min', '2.5 h')
    """
    if seconds < 120.0:
        return f"{max(1.0, seconds):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def progress(title: str, kind: str = "") -> Iterator[Advance]:
    """Show the progress of a stage during this block.

    Yields the function to which the stage reports its progress: units done, total and a remark.

    title: name of the stage in the display.
    kind: see `planfly.runtime.stages.stage`.  The time left is shown after the remark, unless the remark already states
    it.  Before progress is measured, the display shows how long the last stage of this kind took on this machine, or
    "no estimate".  A total of 0 means that the total is unknown.
    """
    time_left = _TimeLeft(kind or title)
    display = _Bar(title, time_left) if sys.stderr.isatty() else _Lines(title, time_left)
    stage_ended = threading.Event()

    def refresh() -> None:
        """Refresh the display every second until the stage ends."""
        # The reader of the stream may have gone; the work itself handles this error.
        with contextlib.suppress(OSError, ValueError):
            while not stage_ended.wait(_REFRESH_INTERVAL_S):
                display.refresh()

    with display:
        # If no thread can start, the display is not refreshed.
        with contextlib.suppress(RuntimeError):
            threading.Thread(target=refresh, name="progress", daemon=True).start()
        try:
            yield display.advance
        finally:
            stage_ended.set()
    time_left.store_duration()


def _join_nonempty(*parts: str) -> str:
    """Join the non-empty parts by commas."""
    return ", ".join(filter(None, parts))


def _states_time_left(remark: str) -> bool:
    """Return True if a remark already states the time left, as remarks on resumed or growing work do."""
    return " left" in remark


class _Bar:
    """Progress bar of a stage on a terminal.

    It shows the estimate from the previous run until this run is measured.
    """

    def __init__(self, title: str, time_left: _TimeLeft) -> None:
        from tqdm import tqdm

        self._time_left, self._lock = time_left, threading.Lock()
        self._remark, self._is_measured = "", False
        self._initial_estimate = time_left.initial_estimate(0.0)
        bar_format = "{desc:<22} {bar:30} {percentage:3.0f} %{postfix}"
        file = plain_stream(sys.stderr)
        self._bar = tqdm(total=100, desc=printable(title), bar_format=bar_format, leave=True, file=file)

    def __enter__(self) -> None:
        self.refresh()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        with self._lock:
            if error is None:
                self._bar.set_postfix_str(printable(self._remark), refresh=False)
                self._bar.update(100 - self._bar.n)
            self._bar.close()

    def advance(self, done: float, total: float, remark: str = "") -> None:
        """Show the progress of the work."""
        with self._lock:
            percent = 100.0 * done / total if total > 0 else 0.0
            self._bar.update(max(0.0, min(100.0, percent) - self._bar.n))
            estimate = self._time_left.estimate(done, total)
            self._remark = remark
            if estimate or _states_time_left(remark) or 0.0 < total <= done:
                self._is_measured = True
            if not self._is_measured:
                self._initial_estimate = self._time_left.initial_estimate(max(0.0, total - done))
                estimate = self._initial_estimate
            text = _join_nonempty(remark, "" if _states_time_left(remark) else estimate)
            self._bar.set_postfix_str(printable(text))

    def refresh(self) -> None:
        """Show the elapsed time as long as no progress is measured."""
        with self._lock:
            if not self._is_measured and not self._bar.disable:
                text = _join_nonempty(self._remark, self._initial_estimate, f"{self._time_left.elapsed():.0f} s so far")
                self._bar.set_postfix_str(printable(text))


class _Lines:
    """Progress lines of a stage if standard error is no terminal.

    They are printed at the start, at intervals, and at the end.

    A stage that fails within the first second, as for refused input, prints no line.
    """

    def __init__(self, title: str, time_left: _TimeLeft) -> None:
        self._title, self._time_left, self._lock = title, time_left, threading.Lock()
        self._remark, self._last_print_time = "", 0.0
        self._has_started = self._knows_total = self._is_over = False

    def __enter__(self) -> None:
        pass

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        with self._lock:
            self._is_over = True
            if error is None:
                remark_text = f": {self._remark}" if self._remark else ""
                _print_line(f"{self._title}: done in {self._time_left.elapsed():.1f} s{remark_text}")

    def advance(self, done: float, total: float, remark: str = "") -> None:
        """Print the progress of the work if a line is due."""
        with self._lock:
            self._remark = remark
            estimate = self._time_left.estimate(done, total)
            knew_total, self._knows_total = self._knows_total, self._knows_total or total > 0.0
            initial_remark = remark
            if not knew_total and not _states_time_left(remark):
                initial_estimate = self._time_left.initial_estimate(max(0.0, total - done))
                initial_remark = _join_nonempty(remark if total > 0.0 else "", initial_estimate)
            if not self._has_started:
                self._print_first_line(initial_remark)
            elif total > 0.0 and not knew_total:
                # The first line was printed before the total was known.
                self._print_and_note_time(f"{self._title}: {initial_remark}")
            elif estimate and self._time_left.is_due():
                self._print_and_note_time(
                    f"{self._title}: {_join_nonempty(remark, '' if _states_time_left(remark) else estimate)}"
                )

    def refresh(self) -> None:
        """Print the first line if nothing is reported yet, or the elapsed time after a minute without a line."""
        with self._lock:
            if self._is_over:
                return
            if not self._has_started:
                self._print_first_line(self._time_left.initial_estimate(0.0))
            elif self._time_left.elapsed() - self._last_print_time >= _MAX_REPORT_INTERVAL_S:
                self._print_and_note_time(
                    f"{self._title}: {_join_nonempty(self._remark, f'{self._time_left.elapsed():.0f} s so far')}"
                )

    def _print_first_line(self, estimate: str) -> None:
        """Print the line that announces a stage, with an estimate of its duration."""
        self._has_started = True
        self._print_and_note_time(f"{self._title} ... ({estimate})")

    def _print_and_note_time(self, line: str) -> None:
        """Print a line, and record the time at which it was printed."""
        self._last_print_time = self._time_left.elapsed()
        _print_line(line)


def _ignore_progress(*_: object) -> None:
    """Ignore progress and lines, for a command with --quiet."""


# Receiver that shows progress on standard error.
ON_STANDARD_ERROR = Receiver(progress, _print_line)
# Receiver that shows nothing.
SILENT = Receiver(lambda *_: contextlib.nullcontext(_ignore_progress), _ignore_progress)


# ----------------------------------------------------------------------
# Output of the lines and the answer of a command: ``--json FILE``, ``--json -`` and ``--quiet``.


def answer_text(answer: object) -> str:
    """Return the answer of a command as JSON text; NaN and infinity become null."""
    # Imported here: only answers need schemas.
    from pydantic import TypeAdapter

    return TypeAdapter(type(answer)).dump_json(answer, indent=1).decode() + "\n"


# File name that stands for standard output.
STANDARD_OUTPUT = "-"
# Standard output of the running command while its printed lines are redirected.
_output: ContextVar[TextIO | None] = ContextVar("output", default=None)


@contextlib.contextmanager
def redirect_output(args: argparse.Namespace) -> Iterator[None]:
    """During this block, discard printed lines with --quiet.

    With ``--json -``, print them on standard error.

    Progress is not shown with --quiet.  Raises PlanflyError if the file of the JSON answer or of the JUnit report
    exists and must not be overwritten, or if another argument names the same file.  A resumed command replaces the
    files that it wrote before it was interrupted.
    """
    may_replace = getattr(args, "overwrite", False) or getattr(args, "resume", False)
    answer_target, quiet = getattr(args, "json", None), getattr(args, "quiet", False)
    for name in ("json", "junit"):
        target = getattr(args, name, None)
        if target not in (None, STANDARD_OUTPUT):
            _check_named_once(name, Path(target), args)
            check_output_file(Path(target), may_replace)
    token = _output.set(sys.stdout)
    try:
        with contextlib.ExitStack() as contexts:
            contexts.enter_context(send_progress_to(SILENT if quiet else ON_STANDARD_ERROR))
            if quiet:
                null_file = contexts.enter_context(Path(os.devnull).open("w", encoding="utf-8"))
                contexts.enter_context(contextlib.redirect_stdout(null_file))
            elif answer_target == STANDARD_OUTPUT:
                contexts.enter_context(contextlib.redirect_stdout(sys.stderr))
            yield
    finally:
        _output.reset(token)


def write_json_if_requested(args: argparse.Namespace, make_answer: Callable[[], object | str]) -> None:
    """Write the answer of a command as JSON if requested.

    make_answer: returns an instance of a class of `planfly.terminal.answers`, or JSON text; called only if requested.
    """
    target = getattr(args, "json", None)
    if target is None:
        return
    content = make_answer()
    text = content if isinstance(content, str) else answer_text(content)
    if target == STANDARD_OUTPUT:
        print(escape_json_controls(text), end="", file=_output.get() or sys.stdout)
    else:
        write_atomically(Path(target), text)


def write_junit_if_requested(args: argparse.Namespace, verdicts: Mapping[str, "Verdict"]) -> None:
    """Write verdicts as JUnit XML if requested.

    verdicts: verdict of each judged mission or flight, keyed by name.
    """
    if args.junit is not None:
        from logs.verdict.junit import suites_text

        write_atomically(Path(args.junit), suites_text(verdict.junit_suite(name) for name, verdict in verdicts.items()))


def write_suite_if_requested(args: argparse.Namespace, make_suite: Callable[[], "JunitSuite"]) -> None:
    """Write a suite as JUnit XML if requested.  make_suite: returns the suite; called only if requested."""
    if args.junit is not None:
        from logs.verdict.junit import suites_text

        write_atomically(Path(args.junit), suites_text([make_suite()]))


# Schema of the answer of a command that ended with an error.
ERROR_SCHEMA = "planfly.error/1"


def write_error_if_requested(args: argparse.Namespace, code: int, message: str) -> None:
    """Write an error to the files of --json and --junit, replacing those of an earlier run.

    message: line that the command prints at its end.
    """
    # An option of another command may have the name of an argument, such as --scenario.
    names = ("what", "mission", "log", "scenario", "target")
    source = next((value for name in names if (value := getattr(args, name, None)) is not None), args.command)
    json_target, junit_target = getattr(args, "json", None), getattr(args, "junit", None)
    if json_target is not None:
        text = json.dumps({"schema": ERROR_SCHEMA, "exit_code": code, "error": message}, indent=1) + "\n"
        if json_target == STANDARD_OUTPUT:
            print(escape_json_controls(text), end="", file=_output.get() or sys.stdout)
        else:
            _replace_or_remove(Path(json_target), text)
    if junit_target is not None:
        from logs.verdict.junit import junit_error_text

        _replace_or_remove(Path(junit_target), junit_error_text(str(source), message))


def write_usage_error_if_requested(
    arguments: Sequence[str], message: str, commands: Mapping[str, CommandParser]
) -> None:
    """Write an error in the command line itself to the files of its --json and --junit.

    arguments: the command line, which could not be parsed.
    commands: parsers of the commands by name.

    A file is not written if it exists and --overwrite is missing, or if another argument may name this file.
    """
    command = next((argument for argument in arguments if argument in commands), None)
    if command is None:
        return
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--overwrite", action="store_true")
    for option in {"--json", "--junit"} & set(commands[command].long_options()):
        parser.add_argument(option)
    try:
        args, unknown_arguments = parser.parse_known_args(arguments)
    except (argparse.ArgumentError, SystemExit):
        return
    args.command = command
    args.what = next(
        (argument for argument in unknown_arguments if argument != command and not argument.startswith("-")), None
    )
    for number, argument in enumerate(unknown_arguments):
        setattr(args, f"argument_{number}", argument.partition("=")[2] if argument.startswith("--") else argument)
    with contextlib.suppress(PlanflyError), redirect_output(args):
        write_error_if_requested(args, BAD_INPUT, message)


def _replace_or_remove(file: Path, text: str) -> None:
    """Write a file; if that fails, remove the file of an earlier run, which would be outdated."""
    try:
        write_atomically(file, text)
    except (OSError, PlanflyError):
        with contextlib.suppress(OSError):
            if file.is_file():
                file.unlink()


def _check_named_once(name: str, target: Path, args: argparse.Namespace) -> None:
    """Raise PlanflyError if another argument of the command line also names the target file.

    name: name of the argument that sets the target.
    """
    for key, value in vars(args).items():
        if key in (name, "command"):
            continue
        for other_name in value if isinstance(value, list) else [value]:
            if not isinstance(other_name, str) or other_name == STANDARD_OUTPUT:
                continue
            other_path = Path(other_name)
            is_same_file = False
            # The files need not exist, and other texts need not be paths.
            with contextlib.suppress(OSError, ValueError, RuntimeError):
                is_same_file = target.resolve() == other_path.resolve() or (
                    target.exists() and target.samefile(other_path)
                )
            if is_same_file:
                reason = f"is already named by another argument; name another file for --{name}"
                raise PlanflyError(f"{target}: {reason}", file=target, field=f"--{name}")
