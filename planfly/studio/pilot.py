"""A process of its own that works for the studio: what is asked last is done, what it takes the place of is cancelled.

A work is a function with an argument that can be pickled; it is asked every so often whether it may go
on.  The process is spawned, never forked, because the server has threads.  One that dies is started again.
"""

import multiprocessing
import threading
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from world.errors import PlanflyError

# Takes done, total and a remark.
Advance = Callable[[float, float, str], None]


@dataclass(frozen=True, slots=True)
class Work:
    """What is to be done.

    number: it only grows, and the answers carry it.
    function: its dotted name; it takes a payload and what takes its progress, and raises `Cancelled`.
    """

    number: int
    function: str
    payload: Any


@dataclass(frozen=True, slots=True)
class Answer:
    """What comes back of a work.

    kind: "progress" with (done, total, remark), "done" with what the function returned, "cancelled" with nothing,
    "fault" with a line for people.
    """

    number: int
    kind: str
    value: Any = None


# Faults of planfly's own: the studio says them in a line and goes on with the mission as it was.
INTERNAL = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError, RuntimeError, OSError)


def internal_text(error: Exception) -> str:
    """A fault of planfly's own in a line."""
    return f"this did not work, by a fault of planfly's own: {type(error).__name__}: {error}"


class Cancelled(Exception):
    """Raised within a work that something newer has taken the place of."""


class Pilot:
    """The process, as the server sees it.  Its methods are called from any thread."""

    def __init__(self, name: str, on_answer: Callable[[Answer], None]) -> None:
        """Nothing is started before `ask`.  on_answer: called from a thread of its own."""
        self._name, self._on_answer = name, on_answer
        self._lock = threading.Lock()
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self._asked: Work | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        """The process's number, None where there is none."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Have the process there before it is needed."""
        with self._lock:
            self._ready()

    def ask(self, work: Work) -> None:
        """Do a work; whatever is under way is cancelled."""
        with self._lock:
            self._asked = work
            try:
                self._ready().send(work)
            except OSError:
                self._lost()
                self._ready().send(work)

    def cancel(self) -> None:
        """End what is under way."""
        with self._lock:
            self._asked = None
            if self._pipe is not None:
                try:
                    self._pipe.send(None)
                except OSError:
                    self._lost()

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._closed = True
            process, pipe = self._process, self._pipe
            self._process = self._pipe = None
        if pipe is not None:
            pipe.close()
        if process is not None:
            process.terminate()
            process.join(5.0)

    def _ready(self) -> Connection:
        """The pipe to a running process."""
        if self._pipe is not None and self._process is not None and self._process.is_alive():
            return self._pipe
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        # Not a daemon's: a campaign starts processes of its own.
        process = context.Process(target=work_on, args=(theirs,), name=self._name)
        process.start()
        theirs.close()
        self._process, self._pipe = process, ours
        threading.Thread(target=self._listen, args=(ours,), name=self._name, daemon=True).start()
        return ours

    def _lost(self) -> None:
        if self._pipe is not None:
            self._pipe.close()
        self._pipe = self._process = None

    def _listen(self, pipe: Connection) -> None:
        """Hand on what comes; a process that is gone before it has answered is a fault of its work."""
        while True:
            try:
                answer = pipe.recv()
            except (EOFError, OSError, TypeError):
                # A pipe that is closed while it is waited on loses its handle: a TypeError.
                break
            with self._lock:
                if self._asked is not None and answer.number == self._asked.number and answer.kind != "progress":
                    self._asked = None
            self._on_answer(answer)
        with self._lock:
            lost = self._asked if self._pipe is pipe and not self._closed else None
            if self._pipe is pipe:
                self._lost()
                self._asked = None
        if lost is not None:
            self._on_answer(Answer(lost.number, "fault", "the process that worked on this has ended: ask again"))


# ----------------------------------------------------------------------
# Within the process.


def work_on(pipe: Connection) -> None:
    """Do what comes, the newest alone, until the pipe closes."""
    import signal

    # An interrupt at the terminal is the server's to handle.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    waiting: Work | None = None
    while True:
        try:
            work = waiting if waiting is not None else pipe.recv()
            while pipe.poll():
                work = pipe.recv()
            waiting = None if work is None else _do(pipe, work)
        except (EOFError, OSError):
            return


def _do(pipe: Connection, work: Work) -> Work | None:
    """Do one work and answer; returns the one that has taken its place, None where none has."""
    newer: list[Work | None] = []

    def advance(done: float, total: float, remark: str) -> None:
        if pipe.poll():
            newer.append(pipe.recv())
            raise Cancelled
        pipe.send(Answer(work.number, "progress", (float(done), float(total), remark)))

    module, _, function = work.function.rpartition(".")
    try:
        value = getattr(import_module(module), function)(work.payload, advance)
        answer = Answer(work.number, "done", value)
    except Cancelled:
        answer = Answer(work.number, "cancelled")
    except PlanflyError as error:
        answer = Answer(work.number, "fault", str(error))
    except INTERNAL as error:
        answer = Answer(work.number, "fault", internal_text(error))
    pipe.send(answer)
    return newer[-1] if newer else None
