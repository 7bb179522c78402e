"""Standard output that outlives its reader: ``planfly check M | head -1`` still ends with the verdict's exit code."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO


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
