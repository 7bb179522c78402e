"""The stopwatch counts a sleep and a busy loop in full, and no second that a process waits for a core."""

import os
import subprocess
import sys
import threading
import time

import pytest

from tests.soak import only_in_soak
from tests.stopwatch import Stopwatch

# All on one core, whichever this process may use.
ON_ONE_CORE = f"import os\nos.sched_setaffinity(0, {{{max(os.sched_getaffinity(0))}}})\n"
BUSY = "import time\nend = time.process_time() + {}\nwhile time.process_time() < end:\n    pass"


def seconds_of(code: str) -> float:
    process = subprocess.Popen([sys.executable, "-S", "-c", ON_ONE_CORE + code], start_new_session=True)
    with Stopwatch(process.pid) as watch:
        process.wait()
    return watch.seconds


@only_in_soak
@pytest.mark.parametrize("code", ["import time\ntime.sleep(0.3)", BUSY.format(0.3)])
def test_what_a_process_takes_counts_beside_others(code: str) -> None:
    """Beside a busy process on its core, with which 0.3 s of it take 0.6 s by the clock or more."""
    with subprocess.Popen([sys.executable, "-S", "-c", ON_ONE_CORE + "while True: pass"]) as other:
        try:
            assert 0.255 < seconds_of(code) < 0.55
        finally:
            other.kill()


def test_a_process_sleeps_in_full_while_the_thread_that_waits_for_it_has_no_core() -> None:
    usual, core = os.sched_getaffinity(0), {max(os.sched_getaffinity(0))}
    os.sched_setaffinity(0, core)
    try:
        with subprocess.Popen([sys.executable, "-S", "-c", ON_ONE_CORE + "while True: pass"]) as other:
            process = subprocess.Popen(["sleep", "1.2"], start_new_session=True)
            with Stopwatch(process.pid) as watch:
                while process.poll() is None:
                    pass
            other.kill()
    finally:
        os.sched_setaffinity(0, usual)
    # Its wait for a core before it begins is left out, too: tenths of a second on a loaded machine.
    assert watch.seconds > 0.8


def test_the_thread_that_enters_it_counts_and_no_other() -> None:
    over = threading.Event()
    other = threading.Thread(target=lambda: [None for _ in iter(over.is_set, True)])
    with Stopwatch() as watch:
        other.start()
        time.sleep(0.25)
        over.set()
        other.join()
    assert watch.seconds > 0.22
