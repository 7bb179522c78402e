"""Nothing comes out while a library talks, by either way, and everything does afterwards."""

import contextlib
import os
import sys
import threading
from pathlib import Path

import pytest

from world.silent_output import silence

OPEN_FILES = Path("/proc/self/fd")


def test_neither_python_nor_a_library_is_heard(capfd: pytest.CaptureFixture[str]) -> None:
    print("before")
    with silence():
        print("python talks")
        os.write(1, b"a library talks\n")
    print("after")
    os.write(1, b"and the library\n")
    sys.stdout.flush()
    out = capfd.readouterr().out
    assert "talks" not in out
    assert [line in out for line in ("before", "after", "and the library")] == [True] * 3


@pytest.mark.parametrize("nested", [False, True])
def test_other_threads_are_heard(capfd: pytest.CaptureFixture[str], nested: bool) -> None:
    """They print to standard output of descriptor 1, as in a program; one print ends after the output is given back."""
    with open(1, "w", closefd=False) as stdout, contextlib.redirect_stdout(stdout):
        with silence(), silence() if nested else contextlib.nullcontext():
            thread = threading.Thread(target=print, args=("another thread",))
            thread.start()
            thread.join()
            print("this thread")
            old, late = sys.stdout, threading.Thread(target=lambda: old.write("too late\n"))
            os.write(1, b"a library\n")
        late.start()
        late.join()
    assert capfd.readouterr().out == "another thread\ntoo late\n"


def test_errors_are_still_heard(capfd: pytest.CaptureFixture[str]) -> None:
    with silence():
        os.write(2, b"wrong\n")
    assert capfd.readouterr().err == "wrong\n"


def test_a_failure_inside_gives_the_output_back(capfd: pytest.CaptureFixture[str]) -> None:
    stdout = sys.stdout
    with pytest.raises(ValueError, match="broken"), silence():
        raise ValueError("broken")
    os.write(1, b"heard\n")
    assert sys.stdout is stdout
    assert capfd.readouterr().out == "heard\n"


@pytest.mark.skipif(not OPEN_FILES.is_dir(), reason="only Linux lists a process's open files there")
def test_no_files_stay_open() -> None:
    before = len(list(OPEN_FILES.iterdir()))
    for _ in range(5):
        with silence():
            pass
    assert len(list(OPEN_FILES.iterdir())) == before
