"""Run tasks in a worker process of the studio; a newer task cancels the task in progress.

A task is a function and an argument that can be pickled. It reports progress regularly, and is cancelled at a report.
The process is spawned, never forked, because the server has threads. A process that dies is started again.
"""

import contextlib
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

# Maximum time for a cancelled task or its process to end, s; kernels may have to be compiled in this time.
CANCEL_TIMEOUT_S = 60.0
# Function that reports progress: it is called with the amount done, the total amount and a remark.
Advance = Callable[[float, float, str], None]


@dataclass(frozen=True, slots=True)
class Task:
    """Task for a worker process.

    number: increasing number, which the answers repeat.
    function: dotted name of a function that takes a payload and a progress callback, and raises `Cancelled`.
    """

    number: int
    function: str
    payload: Any


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to a task.

    number: number of the task.
    kind: "progress" with (done, total, remark), "done" with the result of the function, "cancelled" with None, or
        "fault" with a line for the user.
    value: the value that belongs to the kind.
    """

    number: int
    kind: str
    value: Any = None


# Internal errors of planfly, which the studio reports in a line without changing the mission.
INTERNAL = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError, RuntimeError, OSError)


def internal_text(error: Exception) -> str:
    """Describe an internal error of planfly in one line."""
    return f"this failed because of an error in planfly: {type(error).__name__}: {error}"


class Cancelled(Exception):
    """Raised within a task that is replaced by a newer task."""


class WorkerProcess:
    """Handle with which the server submits tasks to a worker process.

    Its methods may be called from any thread.  A thread of its own sends the newest task, so that a process that does
    not read its pipe blocks no caller.
    """

    def __init__(
        self,
        name: str,
        on_answer: Callable[[Answer], None],
        cancel_timeout: float = CANCEL_TIMEOUT_S,
        pack: Callable[[Task | None], bytes] = pickle.dumps,
    ) -> None:
        """Prepare a worker; nothing is started before `submit`.

        name: name of the process.
        on_answer: function that is called with each answer, in a thread of the worker.
        cancel_timeout: time within which a cancelled task must end, s.
        pack: function that pickles a task, called in the sending thread; objects that another thread may change must be
            pickled in that other thread.
        """
        self._name, self._on_answer, self._cancel_timeout, self._pack = name, on_answer, cancel_timeout, pack
        self._condition = threading.Condition(threading.RLock())
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        # Newest task, True if it was sent, and the numbers of the tasks that were sent but not answered.
        self._newest_task: Task | None = None
        self._is_newest_sent, self._is_closed = True, False
        self._unanswered: list[int] = []
        self._sender: threading.Thread | None = None
        self._timer: threading.Timer | None = None

    @property
    def pid(self) -> int | None:
        """Process ID, or None without a process."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the process in advance; a failure is reported only with the first task."""
        with self._condition, contextlib.suppress(OSError):
            self._ensure_process()

    def submit(self, task: Task) -> None:
        """Submit a task, and cancel any task in progress."""
        self._set_newest_task(task)

    def cancel(self) -> None:
        """Cancel the task in progress, and a task that was not sent yet."""
        self._set_newest_task(None)

    def _set_newest_task(self, task: Task | None) -> None:
        """Replace the newest task, which cancels a task in progress; None only cancels.

        If the cancelled task does not end in time, its process is killed.  A task that was not sent is answered as
        cancelled.
        """
        with self._condition:
            dropped_task = self._newest_task if not self._is_newest_sent else None
            self._newest_task, self._is_newest_sent = task, False
            if self._unanswered and self._timer is None:
                self._timer = threading.Timer(
                    self._cancel_timeout, self._kill_if_stuck, (self._pipe, self._unanswered[0])
                )
                self._timer.daemon = True
                self._timer.start()
            if self._sender is None:
                self._sender = threading.Thread(target=self._send_tasks, name=f"{self._name}: sends", daemon=True)
                self._sender.start()
            self._condition.notify_all()
        if dropped_task is not None:
            self._on_answer(Answer(dropped_task.number, "cancelled"))

    def close(self) -> None:
        """End the process and the thread that sends tasks."""
        with self._condition:
            self._is_closed = True
            self._cancel_timer()
            process, pipe = self._process, self._pipe
            self._process = self._pipe = None
            self._condition.notify_all()
        if process is not None:
            process.terminate()
            process.join(5.0)
        if pipe is not None:
            pipe.close()

    def _send_tasks(self) -> None:
        """Send each newest task to the process, until the worker is closed.

        A newest task of None is sent, too: it cancels the task in progress.  A task starts a process if none is alive.
        A task that cannot be sent is answered with the failure.
        """
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._is_closed or not self._is_newest_sent)
                if self._is_closed:
                    return
                task, self._is_newest_sent = self._newest_task, True
                self._unanswered += [] if task is None else [task.number]
            try:
                with self._condition:
                    pipe = self._pipe if task is None or self._is_closed else self._ensure_process()
                data = b"" if pipe is None else self._pack(task)
            except OSError as error:
                # Too many open files, or too many processes.
                self._fail_unsent(task, f"the worker process cannot be started: {error.strerror}; try again")
                continue
            except (CancelledError, *INTERNAL) as error:
                self._fail_unsent(task, internal_text(error))
                continue
            if pipe is None:
                continue
            try:
                pipe.send_bytes(data)
            except (OSError, TypeError, ValueError):
                # The process has ended, so a new process does the task.
                with self._condition:
                    if self._pipe is pipe:
                        self._pipe = self._process = None
                    if task is not None and self._newest_task is task:
                        self._is_newest_sent = False
                        self._unanswered = [number for number in self._unanswered if number != task.number]

    def _fail_unsent(self, task: Task | None, reason: str) -> None:
        """Answer a task that could not be sent to the process with a fault.

        Do nothing if the worker is closed.

        task: the task; None, which only cancels, has no answer.
        reason: line for the user.
        """
        with self._condition:
            if task is None or self._is_closed:
                return
            self._unanswered = [number for number in self._unanswered if number != task.number]
            self._newest_task = None if self._newest_task is task else self._newest_task
        self._on_answer(Answer(task.number, "fault", reason))

    def _kill_if_stuck(self, pipe: Connection, number: int) -> None:
        """Kill a process that still works on a cancelled task; a new process will get the newest task.

        Does nothing if the task has ended in the meantime.

        pipe: pipe to the process.
        number: number of the cancelled task.
        """
        with self._condition:
            self._timer = None
            if self._is_closed or self._pipe is not pipe or number not in self._unanswered:
                return
            process, self._process, self._pipe = self._process, None, None
            dropped_numbers = self._drop_unanswered()
            self._is_newest_sent = self._newest_task is None
            self._condition.notify_all()
        if process is not None:
            process.kill()
        for dropped_number in dropped_numbers:
            self._on_answer(Answer(dropped_number, "cancelled"))

    def _drop_unanswered(self) -> list[int]:
        """Clear the list of the unanswered tasks of a lost process.

        Return their numbers, except the newest task's.
        """
        dropped_numbers = [
            number for number in self._unanswered if self._newest_task is None or number != self._newest_task.number
        ]
        self._unanswered = []
        return dropped_numbers

    def _cancel_timer(self) -> None:
        """Cancel the timer that would kill a stuck process."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None

    def _ensure_process(self) -> Connection:
        """Return the pipe to the worker process; start the process if it is not running.

        Raises OSError if the process cannot be started.
        """
        if self._pipe is not None and self._process is not None and self._process.is_alive():
            return self._pipe
        context = multiprocessing.get_context("spawn")
        server_end, worker_end = context.Pipe()
        # Not a daemon: a campaign starts child processes.
        process = context.Process(target=run_worker, args=(worker_end,), name=self._name)
        try:
            process.start()
        except OSError:
            server_end.close()
            raise
        finally:
            worker_end.close()
        self._process, self._pipe = process, server_end
        threading.Thread(target=self._forward_answers, args=(server_end,), name=self._name, daemon=True).start()
        return server_end

    def _forward_answers(self, pipe: Connection) -> None:
        """Forward answers of the process until the pipe closes, and then answer the unanswered tasks.

        The newest task is answered with a fault, older tasks as cancelled.
        """
        while True:
            try:
                answer = pipe.recv()
            except (EOFError, OSError, TypeError):
                # A pipe that is closed during a wait loses its handle, which raises TypeError.
                break
            if answer.kind == "progress":
                self._on_answer(answer)
                continue
            # The task has ended; the timer is stopped if it waited for this task.
            with self._condition:
                if self._newest_task is not None and answer.number == self._newest_task.number:
                    self._newest_task = None
                if self._pipe is pipe and answer.number in self._unanswered:
                    oldest_number = self._unanswered[0]
                    self._unanswered.remove(answer.number)
                    if answer.number == oldest_number:
                        self._cancel_timer()
            self._on_answer(answer)
        reason = "the worker process has ended; try again"
        with self._condition:
            if self._is_closed or self._pipe is not pipe:
                return
            self._pipe = self._process = None
            answers = [Answer(number, "cancelled") for number in self._drop_unanswered()]
            if self._newest_task is not None and self._is_newest_sent:
                answers.append(Answer(self._newest_task.number, "fault", reason))
                self._newest_task = None
        for answer in answers:
            self._on_answer(answer)


# ----------------------------------------------------------------------
# Within the process.


def run_worker(pipe: Connection) -> None:
    """Run tasks from a pipe, always the newest, until the pipe closes; the main loop of a worker process.

    Tasks that a newer task replaces before they start are answered as cancelled.
    """
    import signal

    # An interrupt at the terminal is handled by the server.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pending_task: Task | None = None
    while True:
        try:
            task: Task | None = pending_task if pending_task is not None else pipe.recv()
            # Only the newest task in the pipe is run; None only cancels.
            while pipe.poll():
                newer_task = pipe.recv()
                if task is not None:
                    pipe.send(Answer(task.number, "cancelled"))
                task = newer_task
            pending_task = None if task is None else _run_task(pipe, task)
        except (EOFError, OSError):
            return


def _run_task(pipe: Connection, task: Task) -> Task | None:
    """Run a task and send its answer; return the task that has replaced it, or None."""
    newer_tasks: list[Task | None] = []

    def advance(done: float, total: float, remark: str) -> None:
        """Send the progress of the task; raise Cancelled if a newer task has arrived."""
        if pipe.poll():
            newer_tasks.append(pipe.recv())
            raise Cancelled
        pipe.send(Answer(task.number, "progress", (float(done), float(total), remark)))

    module, _, function = task.function.rpartition(".")
    try:
        value = getattr(import_module(module), function)(task.payload, advance)
        answer = Answer(task.number, "done", value)
    except Cancelled:
        answer = Answer(task.number, "cancelled")
    except PlanflyError as error:
        answer = Answer(task.number, "fault", str(error))
    except INTERNAL as error:
        answer = Answer(task.number, "fault", internal_text(error))
    pipe.send(answer)
    return newer_tasks[-1] if newer_tasks else None
