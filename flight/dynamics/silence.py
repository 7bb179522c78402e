"""Keeps a talkative library quiet."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silence() -> Iterator[None]:
    """Send standard output nowhere: JSBSim prints its banner whatever its debug level, by either way out.

    Its C++ side writes to file descriptor 1, its Python side to ``sys.stdout``.
    """
    sys.stdout.flush()
    saved = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(saved, 1)
        os.close(nowhere)
        os.close(saved)
