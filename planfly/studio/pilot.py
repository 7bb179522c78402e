"""A process of its own that works for the studio: what is asked last is done, what it takes the place of is cancelled.

A work is a function with an argument that can be pickled; it is asked every so often whether it may go
on.  The process is spawned, never forked, because the server has threads.  One that dies is started again.
"""

import multiprocessing
import pickle
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from world.errors import PlanflyError

# s in which a work ends that is cancelled, or its process is ended: kernels may have to be compiled meanwhile.
PATIENCE = 60.0
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
    """The process, as the server sees it.  Its methods are called from any thread, and none of them waits for it.

    What it is asked is sent from a thread, the newest alone: a process that reads nothing holds up nobody.
    """

    def __init__(
        self,
        name: str,
        on_answer: Callable[[Answer], None],
        patience: float = PATIENCE,
        pack: Callable[[Work | None], bytes] = pickle.dumps,
    ) -> None:
        """Nothing is started before `ask`.

        on_answer: called from a thread of its own.  patience: s in which a work ends that is cancelled.  pack: pickles
        a work, called from the sending thread; what another thread may change meanwhile has to be pickled by that one.
        """
        self._name, self._on_answer, self._patience, self._pack = name, on_answer, patience, pack
        self._changed = threading.Condition(threading.RLock())
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        # What is wanted, and whether that was sent; numbers of works that were sent and are not answered.
        self._asked: Work | None = None
        self._sent, self._closed = True, False
        self._open: list[int] = []
        self._sender: threading.Thread | None = None
        self._watch: threading.Timer | None = None

    @property
    def pid(self) -> int | None:
        """The process's number, None where there is none."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Have the process there before it is needed."""
        with self._changed:
            self._ready()

    def ask(self, work: Work) -> None:
        """Do a work; whatever is under way is cancelled."""
        self._want(work)

    def cancel(self) -> None:
        """End what is under way."""
        self._want(None)

    def _want(self, work: Work | None) -> None:
        with self._changed:
            dropped = self._asked if not self._sent else None
            self._asked, self._sent = work, False
            if self._open and self._watch is None:
                self._watch = threading.Timer(self._patience, self._end, (self._pipe, self._open[0]))
                self._watch.daemon = True
                self._watch.start()
            if self._sender is None:
                self._sender = threading.Thread(target=self._send, name=f"{self._name}: sends", daemon=True)
                self._sender.start()
            self._changed.notify_all()
        if dropped is not None:
            self._on_answer(Answer(dropped.number, "cancelled"))

    def close(self) -> None:
        """End the process."""
        with self._changed:
            self._closed = True
            self._unwatch()
            process, pipe = self._process, self._pipe
            self._process = self._pipe = None
            self._changed.notify_all()
        if process is not None:
            process.terminate()
            process.join(5.0)
        if pipe is not None:
            pipe.close()

    def _send(self) -> None:
        """Send what is wanted, until it is closed."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or not self._sent)
                if self._closed:
                    return
                work, self._sent = self._asked, True
                pipe = self._pipe if work is None else self._ready()
                self._open += [] if work is None else [work.number]
            if pipe is None:
                continue
            try:
                data = self._pack(work)
            except (CancelledError, *INTERNAL) as error:
                with self._changed:
                    if self._closed:
                        return
                    if work is not None:
                        self._open = [one for one in self._open if one != work.number]
                        self._asked = None if self._asked is work else self._asked
                if work is not None:
                    self._on_answer(Answer(work.number, "fault", internal_text(error)))
                continue
            try:
                pipe.send_bytes(data)
            except (OSError, TypeError, ValueError):
                # The process has ended: another one does it.
                with self._changed:
                    if self._pipe is pipe:
                        self._pipe = self._process = None
                    if work is not None and self._asked is work:
                        self._sent = False
                        self._open = [one for one in self._open if one != work.number]

    def _end(self, pipe: Connection, number: int) -> None:
        """End a process that is still at a work that was cancelled; what is wanted now is done by another one."""
        with self._changed:
            self._watch = None
            if self._closed or self._pipe is not pipe or number not in self._open:
                return
            process, self._process, self._pipe = self._process, None, None
            left = self._left()
            self._sent = self._asked is None
            self._changed.notify_all()
        if process is not None:
            process.kill()
        for one in left:
            self._on_answer(Answer(one, "cancelled"))

    def _left(self) -> list[int]:
        """Works that a process was at which is gone, and nobody wants any more."""
        left = [one for one in self._open if self._asked is None or one != self._asked.number]
        self._open = []
        return left

    def _unwatch(self) -> None:
        if self._watch is not None:
            self._watch.cancel()
        self._watch = None

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

    def _listen(self, pipe: Connection) -> None:
        """Hand on what comes; a process that is gone before it has answered is a fault of its work."""
        while True:
            try:
                answer = pipe.recv()
            except (EOFError, OSError, TypeError):
                # A pipe that is closed while it is waited on loses its handle: a TypeError.
                break
            if answer.kind != "progress":
                self._note(pipe, answer)
            self._on_answer(answer)
        fault = "the process that worked on this has ended: ask again"
        with self._changed:
            if self._closed or self._pipe is not pipe:
                return
            self._pipe = self._process = None
            left = [Answer(one, "cancelled") for one in self._left()]
            if self._asked is not None and self._sent:
                left.append(Answer(self._asked.number, "fault", fault))
                self._asked = None
        for answer in left:
            self._on_answer(answer)

    def _note(self, pipe: Connection, answer: Answer) -> None:
        """A work has ended."""
        with self._changed:
            if self._asked is not None and answer.number == self._asked.number:
                self._asked = None
            if self._pipe is pipe and answer.number in self._open:
                first = self._open[0]
                self._open.remove(answer.number)
                if answer.number == first:
                    self._unwatch()


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
            work = _newest(pipe, waiting if waiting is not None else pipe.recv())
            waiting = None if work is None else _do(pipe, work)
        except (EOFError, OSError):
            return


def _newest(pipe: Connection, work: Work | None) -> Work | None:
    """The newest of a work and of those that have come after it; the others are answered as cancelled."""
    while pipe.poll():
        newer = pipe.recv()
        if work is not None:
            pipe.send(Answer(work.number, "cancelled"))
        work = newer
    return work


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
