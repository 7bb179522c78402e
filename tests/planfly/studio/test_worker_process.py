"""The process that works for the studio: the newest work alone, cancelled, and started again where it died."""

import os
import pickle
import queue
import signal
import time
from typing import Any

import pytest

from planfly.studio.worker_process import Answer, Task, WorkerProcess

WORKS = "tests.planfly.studio.light_works"
COUNT = f"{WORKS}.count"
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals")


class Heard:
    """A pilot and what it answers."""

    def __init__(self, **more: Any) -> None:
        self.answers: queue.SimpleQueue[Answer] = queue.SimpleQueue()
        self.pilot = WorkerProcess("test", self.answers.put, **more)

    def next(self, *kinds: str) -> Answer:
        deadline = time.monotonic() + 60.0
        while True:
            answer = self.answers.get(timeout=deadline - time.monotonic())
            if answer.kind in kinds:
                return answer


def test_the_newest_work_is_done_and_the_others_are_cancelled() -> None:
    heard = Heard()
    try:
        heard.pilot.submit(Task(1, COUNT, 10_000))
        assert heard.next("progress").number == 1
        for number in range(2, 9):
            heard.pilot.submit(Task(number, COUNT, 10_000))
        heard.pilot.submit(Task(9, COUNT, 3))
        done = heard.next("done")
        assert (done.number, done.value) == (9, 3)
        heard.pilot.submit(Task(10, COUNT, 10_000))
        heard.next("progress")
        asked = time.monotonic()
        heard.pilot.cancel()
        assert heard.next("cancelled").number == 10
        assert time.monotonic() - asked < 1.0
        heard.pilot.submit(Task(11, f"{WORKS}.length", None))
        assert "an error in planfly: TypeError: " in heard.next("fault").value
        pid = heard.pilot.pid
        assert pid is not None
        heard.pilot.submit(Task(12, COUNT, 10_000))
        heard.next("progress")
        os.kill(pid, signal.SIGKILL)
        lost = heard.next("fault")
        assert (lost.number, "has ended" in lost.value) == (12, True)
        heard.pilot.submit(Task(13, COUNT, 2))
        assert heard.next("done").number == 13
    finally:
        heard.pilot.close()


def test_a_process_that_cannot_be_started_is_reported_and_started_later(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = Heard()

    def refuse(_process: Any) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    try:
        with monkeypatch.context() as patched:
            patched.setattr("multiprocessing.process.BaseProcess.start", refuse)
            heard.pilot.start()
            for number in (1, 2):
                heard.pilot.submit(Task(number, COUNT, 3))
                fault = heard.next("fault")
                assert fault.number == number
                assert fault.value == (
                    "the worker process cannot be started: Resource temporarily unavailable; try again"
                )
        heard.pilot.submit(Task(3, COUNT, 3))
        assert heard.next("done").number == 3
    finally:
        heard.pilot.close()


def test_a_process_that_reads_nothing_holds_up_nobody() -> None:
    heard = Heard(cancel_timeout=1.0)
    try:
        heard.pilot.submit(Task(1, f"{WORKS}.sleep", 600.0))
        assert heard.next("progress").number == 1
        # More than a pipe holds, and the one that takes its place.
        for number in (2, 3):
            begun = time.monotonic()
            heard.pilot.submit(Task(number, f"{WORKS}.length", b"x" * 2**24))
            assert time.monotonic() - begun < 0.5
        pid = heard.pilot.pid
        ended = {answer.number: answer for answer in (heard.next("cancelled", "done") for _ in range(3))}
        assert {number: one.kind for number, one in ended.items()} == {1: "cancelled", 2: "cancelled", 3: "done"}
        assert ended[3].value == 2**24
        assert heard.pilot.pid != pid
        # One alone, which is being sent when the process is ended.
        heard.pilot.submit(Task(4, f"{WORKS}.sleep", 600.0))
        assert heard.next("progress").number == 4
        heard.pilot.submit(Task(5, f"{WORKS}.length", b"x" * 2**24))
        ended = {answer.number: answer for answer in (heard.next("cancelled", "done") for _ in range(2))}
        assert {number: one.kind for number, one in ended.items()} == {4: "cancelled", 5: "done"}
        heard.pilot.submit(Task(6, f"{WORKS}.sleep", 600.0))
        assert heard.next("progress").number in (5, 6)
        heard.pilot.cancel()
        assert heard.next("cancelled").number == 6
    finally:
        heard.pilot.close()


def test_a_work_is_pickled_by_whom_it_is_given_to() -> None:
    """Who judges the mission meanwhile fills its caches: a dictionary that grows while it is pickled is an error."""
    packed: list[int] = []

    def pack(work: Task | None) -> bytes:
        packed.append(0 if work is None else work.number)
        if len(packed) == 2:
            raise RuntimeError("dictionary changed size during iteration")
        return pickle.dumps(work)

    heard = Heard(pack=pack)
    try:
        heard.pilot.submit(Task(1, COUNT, 3))
        assert heard.next("done").value == 3
        assert packed == [1]
        # One that cannot be pickled is a fault, and not the end of all that come after it.
        heard.pilot.submit(Task(2, COUNT, 3))
        fault = heard.next("fault")
        assert (fault.number, "changed size" in fault.value) == (2, True)
        heard.pilot.submit(Task(3, COUNT, 4))
        assert heard.next("done").value == 4
    finally:
        heard.pilot.close()
