"""Suppress the output that a library prints on standard output, in one thread at a time."""

import contextlib
import io
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

# Maximum size of a library's output that is read, bytes.
_MAX_PRINTED_BYTES = 2**20
# Held while standard output is suppressed: two threads would each keep the other's replacement.
_SILENCE_LOCK = threading.RLock()


@contextmanager
def silence() -> Iterator[Callable[[], str]]:
    """Suppress standard output in this block, for libraries that print unasked, such as JSBSim and pyulog.

    A library's C++ code writes to file descriptor 1, its Python code to ``sys.stdout``. Yields a function that returns
    the suppressed output of both. Both belong to the whole process, so only one thread at a time suppresses them. Text
    that other threads print with Python meanwhile is not suppressed.
    """
    with _SILENCE_LOCK:
        sys.stdout.flush()
        saved_descriptor = os.dup(1)
        try:
            with (
                tempfile.TemporaryFile() as cpp_file,
                _stream_to(saved_descriptor, sys.stdout) as other_threads,
                contextlib.redirect_stdout(_ThreadOutput(other_threads, sys.stdout)) as python_output,
            ):
                os.dup2(cpp_file.fileno(), 1)

                def text() -> str:
                    """Return the output of this thread, and of libraries in C++, since the start of the block."""
                    cpp_output = os.pread(cpp_file.fileno(), _MAX_PRINTED_BYTES, 0).decode(errors="replace")
                    return cpp_output + python_output.getvalue()

                yield text
        finally:
            os.dup2(saved_descriptor, 1)
            os.close(saved_descriptor)


class _ThreadOutput(io.StringIO):
    """Stream that keeps the text of the thread that created it, and passes on the text of other threads.

    other_threads: stream that receives the text of other threads.
    stdout: standard output, which receives this text once `other_threads` is closed.
    """

    def __init__(self, other_threads: TextIO, stdout: TextIO) -> None:
        super().__init__()
        self._thread, self._others, self._stdout = threading.get_ident(), other_threads, stdout

    def write(self, text: str) -> int:
        """Keep the text of this thread, and pass on the text of any other thread."""
        if threading.get_ident() == self._thread:
            return super().write(text)
        try:
            count = self._others.write(text)
            self._others.flush()
        except ValueError:
            # The print began while the output was suppressed, and ends afterwards.
            return self._stdout.write(text)
        return count


@contextmanager
def _stream_to(saved_descriptor: int, stdout: TextIO) -> Iterator[TextIO]:
    """Yield a stream that writes to standard output without file descriptor 1.

    saved_descriptor: another descriptor for the file to which descriptor 1 belonged.
    stdout: standard output, which is yielded if it does not write to descriptor 1, as in a notebook.
    """
    try:
        writes_to_descriptor = stdout.fileno() == 1
    except (AttributeError, OSError, ValueError):
        writes_to_descriptor = False
    if not writes_to_descriptor:
        yield stdout
        return
    encoding, errors = stdout.encoding, stdout.errors
    with open(saved_descriptor, "w", encoding=encoding, errors=errors, closefd=False) as stream:
        yield stream
