"""Kill −9 of the processes that lead campaigns, and of their workers, while they fly."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, cast

import psutil


def start_client(kind: str, folder: Path, flights: int, **more: str) -> "subprocess.Popen[str]":
    """`tests.planfly.campaigns.slow_client`, in a session of its own."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path.cwd()), *sys.path])} | more
    command = [sys.executable, "-m", "tests.planfly.campaigns.slow_client", kind, str(folder), str(flights)]
    return subprocess.Popen(command, env=environment, start_new_session=True, text=True, stdout=subprocess.PIPE)


def kill_while_it_flies(kind: str, folder: Path, flights: int, after: int, delay: float) -> set[int]:
    """Kill a client some seconds after it has written so many flights; those that it said it wrote."""
    with start_client(kind, folder, flights) as client:
        said = cast("IO[str]", client.stdout)
        written = {int(said.readline()) for _ in range(after)}
        time.sleep(delay)
        assert client.poll() is None, "it was over before it was killed"
        client.kill()
        return written | {int(line) for line in said}


def finish_client(kind: str, folder: Path, flights: int) -> set[int]:
    """Let a client go on to its end; the flights that it wrote."""
    with start_client(kind, folder, flights) as client:
        told, _ = client.communicate()
    assert client.returncode == 0
    return {int(line) for line in told.splitlines()}


def spawned_processes() -> list[int]:
    """The numbers of this process's workers that live."""
    found = []
    for one in psutil.Process().children(recursive=True):
        # Those that were killed a moment ago have no command line any more.
        with contextlib.suppress(psutil.NoSuchProcess):
            if "spawn_main" in " ".join(one.cmdline()):
                found.append(one.pid)
    return found


@contextlib.contextmanager
def workers_killed(
    kills: int, begun: threading.Event, seed: int = 5, pause: tuple[float, float] = (0.3, 1.2)
) -> Iterator[list[int]]:
    """Kill workers of this process, one after another, from when flights come in on; the list of those killed.

    pause: before each, s, at least and at most; what is flown has to last for all of them.
    """
    moments, over, killed = random.Random(seed), threading.Event(), list[int]()

    def kill() -> None:
        begun.wait()
        while len(killed) < kills and not over.wait(moments.uniform(*pause)):
            workers = spawned_processes()
            if workers:
                killed.append(moments.choice(workers))
                os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        yield killed
    finally:
        begun.set()
        over.set()
        killer.join()
