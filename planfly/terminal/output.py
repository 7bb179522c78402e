"""Standard output that outlives its reader, and progress on standard error."""

import contextlib
import io
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from planfly.pipeline import Advance


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

_silent: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silent_progress() -> Iterator[None]:
    """Report nothing meanwhile."""
    token = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(token)


def _say_nothing(_done: float, _whole: float, _remark: str = "") -> None:
    pass


def say(line: str) -> None:
    """A line about the work, where progress is reported."""
    if not _silent.get():
        print(line, file=sys.stderr, flush=True)


@contextmanager
def progress(title: str) -> Iterator["Advance"]:
    """Report a stage of work; the caller reports how much of how much is done, and a remark."""
    if _silent.get():
        yield _say_nothing
        return
    if not sys.stderr.isatty():
        yield from _lines(title)
        return
    from tqdm import tqdm

    with tqdm(total=100, desc=title, bar_format="{desc:<22} {bar:30} {percentage:3.0f} %{postfix}", leave=True) as bar:

        def advance(done: float, whole: float, remark: str = "") -> None:
            share = 100.0 * done / whole if whole > 0 else 100.0
            bar.update(max(0.0, min(100.0, share) - bar.n))
            if remark:
                bar.set_postfix_str(remark)

        yield advance
        bar.update(100 - bar.n)


def _lines(title: str) -> Iterator["Advance"]:
    """A line when work begins and one when it is done; none for input that is refused before it begins."""
    started = time.monotonic()
    last: str | None = None

    def remember(_done: float, _whole: float, remark: str = "") -> None:
        nonlocal last
        if last is None:
            print(f"{title} ...", file=sys.stderr, flush=True)
        last = remark

    yield remember
    end = f": {last}" if last else ""
    print(f"{title}: done in {time.monotonic() - started:.1f} s{end}", file=sys.stderr, flush=True)
