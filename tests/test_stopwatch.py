"""The stopwatch counts a sleep and a busy loop in full, and no second that a process waits for a core."""

import subprocess
import sys
import threading
import time

import pytest

from tests.stopwatch import Stopwatch

BUSY = "import time\nend = time.process_time() + {}\nwhile time.process_time() < end:\n    pass"


def seconds_of(code: str) -> float:
    process = subprocess.Popen([sys.executable, "-S", "-c", code], start_new_session=True)
    with Stopwatch(process.pid) as watch:
        process.wait()
    return watch.seconds


@pytest.mark.parametrize("code", ["import time\ntime.sleep(0.5)", BUSY.format(0.5)])
def test_what_a_process_takes_counts_beside_others(code: str) -> None:
    """Beside four busy processes, with which half a second of a core takes one by the clock or more."""
    others = [subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"]) for _ in range(4)]
    try:
        assert 0.425 < seconds_of(code) < 0.75
    finally:
        for other in others:
            other.kill()
            other.wait()


def test_the_thread_that_enters_it_counts_and_no_other() -> None:
    over = threading.Event()
    other = threading.Thread(target=lambda: [None for _ in iter(over.is_set, True)])
    with Stopwatch() as watch:
        other.start()
        time.sleep(0.5)
        over.set()
        other.join()
    assert watch.seconds > 0.45
