"""A signal interrupts once, and where that does not end the process a thread does."""

import os
import shutil
import signal
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import pytest

from planfly.terminal.signal_watch import end_process
from tests.soak import at_most, only_in_soak, some
from tests.stopwatch import Stopwatch
from world.interruption import remove_at_end

# What a command may do when the signal comes; a file of its own that it has not finished.
PROGRAM = """
import hashlib, sys, time
from pathlib import Path
from planfly.terminal.signal_watch import end_process, end_on_signals
from world.interruption import Interrupted, remove_at_end
mine = Path(sys.argv[1])
with end_on_signals(grace=0.5) as heard:
    with remove_at_end(mine):
        mine.write_text("half")
        print("begun", flush=True)
        {body}
"""
BODIES = {
    # The handler is never run: no bytecode is, though the interpreter's lock is free.
    "in C": ("hashlib.pbkdf2_hmac('sha256', b'word', b'salt', 100_000_000)", 0.5),
    "swallowed": ("while True:\n            try: time.sleep(30)\n            except KeyboardInterrupt: pass", 0.5),
    "in Python": ("time.sleep(30)", 0.0),
}

# The first Python that runs after the signal is Numba's, which makes the kernel's named tuples.
SPINNING = """
from typing import NamedTuple
import numba
class Inner(NamedTuple):
    number: float
class Outer(NamedTuple):
    number: float
    inner: Inner
@numba.njit
def spin(count):
    x = 0.5
    for _ in range(count):
        x = 3.9 * x * (1.0 - x)
    return Outer(x, Inner(x))
spin(1)
"""


@pytest.mark.parametrize(("number", "body"), some(product((signal.SIGINT, signal.SIGTERM), BODIES), 2))
def test_a_process_ends_whatever_it_does(body: str, number: signal.Signals, tmp_path: Path) -> None:
    text, least = BODIES[body]
    mine = tmp_path / "mine"
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(body=text), str(mine)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"begun\n"
    time.sleep(0.2)
    begun = time.monotonic()
    with Stopwatch(process.pid) as watch:
        process.send_signal(number)
        _, said = process.communicate(timeout=120.0)
    assert time.monotonic() - begun >= least
    if body == "in Python":
        assert b"Interrupted" in said
    else:
        assert process.returncode == 128 + number
        assert said == b"planfly: interrupted\n"
    assert watch.seconds < at_most(2.0)
    assert not mine.exists()


def test_a_kernel_is_not_interrupted_where_numba_makes_its_results(tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    body = "while True: spin(40_000_000)"
    process = subprocess.Popen(
        [sys.executable, "-c", SPINNING + PROGRAM.format(body=body), str(mine)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120.0)
    # In order; by the thread where a kernel took longer than the grace.
    assert process.returncode in (-signal.SIGINT, 128 + signal.SIGINT), said
    assert "Interrupted" in said or said == "planfly: interrupted\n"
    assert not mine.exists()


TIDIES_UP = """
import os, sys, time
from planfly.terminal.signal_watch import end_on_signals
from world.interruption import Interrupted
os.sched_setaffinity(0, {int(sys.argv[1])})
with end_on_signals(grace=0.5):
    try:
        print("begun", flush=True)
        time.sleep(30)
    except Interrupted:
        end = time.thread_time() + 0.3
        while time.thread_time() < end:
            pass
        print("saved", flush=True)
"""
BUSY = "import os, sys, time\nos.sched_setaffinity(0, {int(sys.argv[1])})\nwhile True: pass"


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not say who waits")
def test_time_that_a_command_waits_for_a_processor_is_no_grace() -> None:
    """Two others take its processor: it needs 0.9 s for 0.3 s of work, and has 0.5 s."""
    where = str(min(os.sched_getaffinity(0)))
    others = [subprocess.Popen([sys.executable, "-c", BUSY, where]) for _ in range(2)]
    try:
        process = subprocess.Popen(
            [sys.executable, "-c", TIDIES_UP, where], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(0.2)
        process.send_signal(signal.SIGTERM)
        out, said = process.communicate(timeout=120.0)
    finally:
        for other in others:
            other.kill()
            other.wait()
    assert (out, said) == ("saved\n", "")


@only_in_soak
def test_it_ends_in_time_where_no_pipe_can_be_told_not_to_block(tmp_path: Path) -> None:
    """As on Windows before Python 3.12."""
    text, least = BODIES["in C"]
    program = "import os\ndel os.set_blocking\n" + PROGRAM.format(body=text)
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "mine")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"begun\n"
    time.sleep(0.2)
    begun = time.monotonic()
    with Stopwatch(process.pid) as watch:
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=120.0)
    assert (process.returncode, said) == (128 + signal.SIGTERM, b"planfly: interrupted\n")
    assert time.monotonic() - begun >= least
    assert watch.seconds < at_most(2.0)


@pytest.mark.parametrize(("tries", "left"), [(1, False), (3, False), (1000, True)])
def test_what_a_killed_child_makes_yet_is_removed_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tries: int, left: bool
) -> None:
    """A folder that is there after so many tries, as a file is made in it meanwhile; not tried for long."""
    folder, asked, killed = tmp_path / "made", list[int](), list[int]()
    folder.mkdir()
    really = shutil.rmtree

    def rmtree(path: Path, **how: bool) -> None:
        asked.append(1)
        if len(asked) > tries:
            really(path, **how)

    class Child:
        pid = 0

        def kill(self) -> None:
            killed.append(1)

    def ended(code: int) -> None:
        raise SystemExit(code)

    monkeypatch.setattr("multiprocessing.active_children", lambda: [Child()])
    monkeypatch.setattr(os, "_exit", ended)
    with remove_at_end(folder):
        with Stopwatch() as watch, monkeypatch.context() as patch:
            patch.setattr(shutil, "rmtree", rmtree)
            with pytest.raises(SystemExit):
                end_process(3)
        assert folder.exists() is left
        # Its children again, too: another may have been started.
        assert len(killed) == len(asked)
        assert watch.seconds < (0.8 if left else 0.3)


def test_a_killed_childs_temporary_folder_goes_with_it(tmp_path: Path) -> None:
    program = """
import multiprocessing, time
from planfly.terminal.signal_watch import end_process
from world.files import temporary_folder
def work():
    with temporary_folder("planfly-model-") as folder:
        (folder / "model.xml").write_text("half")
        ready.release()
        time.sleep(60)
if __name__ == "__main__":
    context = multiprocessing.get_context("fork")
    ready = context.Semaphore(0)
    context.Process(target=work).start()
    ready.acquire()
    end_process(5)
"""
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    assert subprocess.run([sys.executable, "-c", program], env=environment, check=False).returncode == 5
    assert list(tmp_path.iterdir()) == []
