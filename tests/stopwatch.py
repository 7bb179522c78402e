"""Seconds that processes take of themselves: by the clock, without those for which they waited for a core.

A machine with much to do gives its cores to others meanwhile; a sleep, a wait for a file or a busy loop count in full.
Linux says of each thread how long it was ready to run and did not (its ``schedstat`` in /proc, the second number, ns);
where nothing says so, these are seconds by the clock.
"""

import os
import threading
import time
from pathlib import Path

_LOOK = 0.02


class Stopwatch:
    """Of the thread that enters it and, if there is one, of every process of a session; runs while it is entered."""

    def __init__(self, session: int | None = None) -> None:
        self.seconds = 0.0
        self._session = session
        self._own = Path(f"/proc/{os.getpid()}/task/{threading.get_native_id()}/schedstat")
        self._over = threading.Event()
        self._waited = 0.0

    def __enter__(self) -> "Stopwatch":
        self._before = self._waits()
        self._began = time.monotonic()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        took = time.monotonic() - self._began
        self._over.set()
        self._thread.join()
        self.seconds = took - self._waited

    def _watch(self) -> None:
        # A thread's waits end with it, so they are looked at often; of those that wait at once the longest counts.
        while not self._over.wait(_LOOK):
            self._look()
        self._look()

    def _look(self) -> None:
        now = self._waits()
        more = {thread: waited - self._before.get(thread, 0.0) for thread, waited in now.items()}
        # While a process goes on, nobody is kept by a wait of the thread that waits for it.
        others = [waited for thread, waited in more.items() if thread != self._own.parent.name]
        self._waited += max(others or more.values(), default=0.0)
        self._before = now

    def _waits(self) -> dict[str, float]:
        """Seconds for which each thread has waited for a core, by its number."""
        found = {}
        session = [] if self._session is None else processes_of(self._session)
        # Not of the thread that looks: it waits for a core of itself.
        for task in (self._own, *(one for k in session for one in _threads(k))):
            try:
                found[task.parent.name] = int(task.read_text(encoding="ascii").split()[1]) * 1e-9
            except (OSError, IndexError):
                continue
        return found


def _threads(process: int) -> list[Path]:
    """What Linux says of each thread of a process; of none where it has ended."""
    try:
        return list(Path(f"/proc/{process}/task").glob("*/schedstat"))
    except OSError:
        return []


def processes_of(session: int) -> list[int]:
    """Numbers of a session's processes that have not ended; a zombie only waits for its parent to take note."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text(encoding="ascii", errors="replace").rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(entry.name))
    return found
