"""Paths to choose from: several of one search, what each is the best in, and the one that is taken."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from planfly.flight_options import MissionOptions
from planfly.studio import messages
from planfly.studio.documents import open_document
from planfly.studio.jobs import LONG_WORKER, Jobs
from planfly.studio.session import Session
from planfly.studio.worker_process import Answer, Task
from planfly.studio.worker_tasks import PlanRequest, plan
from world.compile_events import COMPILE_TIMER
from world.errors import PlanflyError


@pytest.mark.usefixtures("short_fronts")
def test_other_ways_are_of_one_search_and_none_is_better_than_another(monkeypatch: pytest.MonkeyPatch) -> None:
    # Kernels may have to be compiled first.
    monkeypatch.setattr("planfly.studio.worker_tasks.MAX_SEARCH_SECONDS_FOR_SEVERAL", 600.0)
    asked: list[Task] = []
    monkeypatch.setattr("planfly.studio.jobs.WorkerProcess.submit", lambda self, work: asked.append(work))
    session, jobs = (
        Session.from_document(open_document("hard-07", MissionOptions()), MissionOptions()),
        Jobs(lambda name, answer: None),
    )
    with pytest.raises(PlanflyError, match="algorithm"):
        jobs.plan(messages.Plan(kind="plan", ways=3, algorithm="umda"), session)
    jobs.plan(messages.Plan(kind="plan", seed=1, ways=3), session)
    shares: list[float] = []
    found = plan(asked[-1].payload, lambda done, total, remark: shares.append(done / max(1.0, total)))
    assert shares
    (shown,) = jobs.handle_answer(LONG_WORKER, Answer(asked[-1].number, "done", found), session)
    ways = shown["ways"]
    assert 2 <= len(ways) <= 3
    assert all(one["state"] == "safe" for one in ways)
    values = np.array([[one.length, one.exposure, -one.clearance, one.energy] for one in found])
    for k, row in enumerate(values):
        others = np.delete(values, k, axis=0)
        assert not ((others <= row).all(axis=1) & (others < row).any(axis=1)).any()
    assert [one["length"] for one in ways] == sorted(one["length"] for one in ways)
    assert "shortest" in ways[0]["best"]
    session.replace_plan(messages.Choose(kind="choose", rev=session.rev, which=1))
    assert session.judged.setup.plan is found[1].plan
    assert session.mission_message()["undo"] == "plan with seed 1"


@pytest.mark.parametrize(
    ("waited", "compiled", "computed", "reason"),
    [(900.0, 0.0, 0.0, ""), (0.0, 90.0, 90.0, ""), (0.0, 0.0, 26.0, "budget")],
)
def test_a_search_is_limited_by_its_own_computing_time(
    waited: float, compiled: float, computed: float, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """25 s: neither time on the clock of a busy machine counts, nor the compilation of kernels at the first start."""
    asked = []

    def make_plan(*args: Any, stop: Callable[[], str], **kwargs: Any) -> Any:
        clock, process = time.monotonic(), time.process_time()
        monkeypatch.setattr(time, "monotonic", lambda: clock + waited)
        monkeypatch.setattr(time, "process_time", lambda: process + computed)
        monkeypatch.setattr(COMPILE_TIMER, "seconds", COMPILE_TIMER.seconds + compiled)
        asked.append(stop())
        raise InterruptedError

    monkeypatch.setattr("planfly.studio.worker_tasks.make_plan", make_plan)
    session = Session.from_document(open_document("hard-07", MissionOptions()), MissionOptions())
    with pytest.raises(InterruptedError):
        plan(PlanRequest(session.context.scenario, session.context.uav, 1), lambda *_: None)
    assert asked == [reason]
