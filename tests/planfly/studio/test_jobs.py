"""Works of the studio's processes: what pages are told of their progress and end, and trials after a failed flight."""

import re
from pathlib import Path
from typing import Any

import pytest

from flight.mission.items import Command, Frame, Mission, MissionItem
from planfly.flight_options import MissionOptions
from planfly.studio import jobs as jobs_module
from planfly.studio import messages
from planfly.studio.documents import open_document, straight_plan
from planfly.studio.jobs import FLIGHT_WORKER, LONG_WORKER, Jobs
from planfly.studio.session import Session, open_session
from planfly.studio.worker_process import Answer, Task
from planfly.studio.worker_tasks import fly, try_flown_suggestions, try_planned_suggestions
from planner.plan import Plan
from planner.search.plan_front import FrontPlan
from tests.planfly.studio.drafts import drawn_session, session_of, try_planned
from world.errors import MissionError


class Asked:
    """Takes the place of a process, and keeps what it was asked."""

    def __init__(self) -> None:
        self.works: list[Task] = []

    def submit(self, task: Task) -> None:
        self.works.append(task)

    def start(self) -> None:
        """Start nothing."""


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch) -> Jobs:
    monkeypatch.setattr(jobs_module, "_REPORT_INTERVAL_S", 0.0)
    made = Jobs(lambda name, answer: None)
    made._workers.update({FLIGHT_WORKER: Asked(), LONG_WORKER: Asked()})  # type: ignore[dict-item]
    return made


def asked(jobs: Jobs, pilot: str) -> list[Task]:
    return jobs._workers[pilot].works  # type: ignore[attr-defined, no-any-return]


def show_plan(session: Session, plan: Plan) -> None:
    session.plans = ([plan], None)
    session.replace_plan(messages.Choose(kind="choose", rev=session.rev, which=0))


@pytest.mark.parametrize(("ends", "airspeed"), [((None, None), 22.0), ((1, 2), 22.0), ((2, 4), 28.0)])
def test_a_path_is_planned_at_the_speed_of_the_mission(
    ends: tuple[int | None, int | None], airspeed: float, jobs: Jobs
) -> None:
    """Of a mission for an Aerosonde, which cruises at 25 m/s, in the scenario jacksboro-air."""
    items = [
        MissionItem(seq, 16, int(Frame.GLOBAL), (0.0,) * 4, 36.25 + 0.02 * seq, -84.2, 1200.0) for seq in (2, 3, 5)
    ]
    slow = MissionItem(1, 178, 2, (0.0, 22.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    fast = MissionItem(4, 178, 2, (0.0, 28.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    session = session_of(Mission(None, (slow, *items[:2], fast, items[2])), "jacksboro-air")
    first, last = ends
    jobs.plan(messages.Plan(kind="plan", seed=1, first=first, last=last), session)
    request = asked(jobs, LONG_WORKER)[0].payload
    assert request.uav.airspeed == airspeed
    # The path of the whole mission states this speed.
    plan = straight_plan(session.context.scenario, 1)
    show_plan(session, plan)
    assert [item.params[1] for item in session.mission.items if item.command == Command.DO_CHANGE_SPEED] == [22.0]
    assert session.judged.setup.route.leg_airspeeds.tolist() == [22.0]


def test_a_work_that_another_replaces_is_said_to_have_stopped(jobs: Jobs) -> None:
    session = drawn_session(8, 8)
    jobs.start_task("returns", session)
    jobs.start_task("campaign", session)
    first, second = asked(jobs, LONG_WORKER)
    assert jobs.handle_answer(LONG_WORKER, Answer(first.number, "progress", (1.0, 2.0, "")), session) == []
    assert jobs.handle_answer(LONG_WORKER, Answer(first.number, "cancelled"), session) == [
        {"kind": "stopped", "job": "returns"}
    ]
    assert jobs.handle_answer(LONG_WORKER, Answer(first.number, "cancelled"), session) == []
    # One that is asked for again goes on for the pages.
    jobs.start_task("campaign", session)
    assert jobs.handle_answer(LONG_WORKER, Answer(second.number, "cancelled"), session) == []


def test_progress_never_runs_backwards_and_is_told_to_new_pages(jobs: Jobs) -> None:
    session = drawn_session(8, 8)
    jobs.start_task("campaign", session)
    (work,) = asked(jobs, LONG_WORKER)
    shares = []
    for done, total in ((1.0, 4.0), (3.0, 4.0), (1.0, 9.0), (0.0, 0.0), (8.0, 9.0)):
        (message,) = jobs.handle_answer(LONG_WORKER, Answer(work.number, "progress", (done, total, "on")), session)
        shares.append(message["share"])
    assert shares == [0.25, 0.75, 0.75, 0.75, 0.889]
    assert [(one["job"], one["share"]) for one in jobs.progress_messages()] == [("campaign", 0.889)]
    jobs.start_task("campaign", session)
    assert jobs.progress_messages()[0]["share"] == 0.0
    assert jobs.progress_messages()[0]["number"] != work.number


def test_a_scenario_is_planned_first_and_not_judged_meanwhile(jobs: Jobs) -> None:
    session = Session.from_document(open_document("tight", MissionOptions()), MissionOptions())
    jobs.start_first_task(session)
    assert jobs.is_planning_first_path(session)
    (work,) = asked(jobs, LONG_WORKER)
    jobs.handle_answer(LONG_WORKER, Answer(work.number, "fault", "no"), session)
    assert not jobs.is_planning_first_path(session)


def test_a_line_to_which_an_undo_leads_back_is_flown(jobs: Jobs, tmp_path: Path) -> None:
    """Before and after a restart, whose edits are one step."""
    session = Session.from_document(open_document("tight", MissionOptions()), MissionOptions())
    show_plan(session, straight_plan(session.context.scenario, 1))
    session.autosave(tmp_path / "kept.json")
    restarted, restored = open_session("tight", MissionOptions(), tmp_path / "kept.json")
    assert restored
    for each in (session, restarted):
        each.step_history("undo")
        assert not each.is_changed
        jobs.fly(each)
        assert asked(jobs, FLIGHT_WORKER).pop().payload == (each.context, each.mission)


def answer_of(jobs: Jobs, session: Session, function: Any) -> dict[str, Any]:
    work = asked(jobs, FLIGHT_WORKER)[-1]
    value = function(work.payload, lambda done, total, remark: None)
    message, *_ = jobs.handle_answer(FLIGHT_WORKER, Answer(work.number, "done", value), session)
    return message


def test_what_failed_in_flight_is_offered_with_changes_that_were_flown(jobs: Jobs) -> None:
    session = drawn_session(8, 8)
    jobs.fly(session)
    # The suggestions by geometry are tried first, and the flight follows.
    planned = answer_of(jobs, session, try_planned_suggestions)
    assert session.mission_message()["findings"] == planned["findings"]
    before = answer_of(jobs, session, fly)
    # The flight's own list offers nothing that was not tried.
    assert before["verdict"]["failed"]
    assert [one["offers"] for one in before["findings"] if one["offers"]] == []
    assert asked(jobs, FLIGHT_WORKER)[-1].function.endswith("try_flown_suggestions")
    tried = answer_of(jobs, session, try_flown_suggestions)
    offered = [(one, which) for one in tried["findings"] for which, each in enumerate(one["offers"]) if each["apply"]]
    assert offered
    assert jobs.result_messages()[0]["findings"] == tried["findings"]
    finding, which = offered[0]
    apply = messages.Apply(kind="apply", rev=session.rev, finding=finding["number"], which=which, flown=True)
    old_items = session.mission.items
    session.edit(apply)
    moved = [new.seq for old, new in zip(old_items, session.mission.items, strict=True) if old != new]
    assert re.match(rf"apply a suggestion of the flight: (move|set the radius of) item {moved[0]}\b", session.undo_text)
    try_planned(session)
    jobs.fly(session)
    after = answer_of(jobs, session, fly)
    assert after["verdict"]["failed"] <= before["verdict"]["failed"]
    failing = [(one["rule"], one["where"]) for one in after["findings"] if one["ok"] is False]
    assert (finding["rule"], finding["where"]) not in failing
    # Of another revision nothing is applied.
    with pytest.raises(MissionError, match="no longer exists"):
        session.edit(apply.model_copy(update={"rev": session.rev}))


def test_trials_end_when_other_work_comes() -> None:
    session = drawn_session(8, 8)
    flown = fly((session.context, session.mission), lambda done, total, remark: None)

    class Ended(Exception):
        pass

    def other(done: float, total: float, remark: str) -> None:
        raise Ended

    with pytest.raises(Ended):
        try_flown_suggestions((session.context, flown["judged"]), other)


def test_paths_that_were_found_can_be_chosen_after_another_search_was_stopped(jobs: Jobs) -> None:
    session = Session.from_document(open_document("hard-07", MissionOptions()), MissionOptions())
    plan = straight_plan(session.context.scenario, 3)
    found = [FrontPlan(plan, 1.0, 0.0, 1.0, 1.0, 1.0)] * 2
    jobs.plan(messages.Plan(kind="plan", ways=2), session)
    (first,) = asked(jobs, LONG_WORKER)
    (shown,) = jobs.handle_answer(LONG_WORKER, Answer(first.number, "done", found), session)
    assert len(shown["ways"]) == 2
    jobs.plan(messages.Plan(kind="plan", ways=2), session)
    second = asked(jobs, LONG_WORKER)[-1]
    stopped = jobs.handle_answer(LONG_WORKER, Answer(second.number, "cancelled"), session)
    assert stopped == [{"kind": "stopped", "job": "plan"}]
    session.replace_plan(messages.Choose(kind="choose", rev=session.rev, which=1))
    assert session.mission_message()["undo"] == "plan with seed 3"


def test_paths_between_items_replace_the_items_of_their_own_search(jobs: Jobs) -> None:
    """Also if another search, of the whole mission, was begun and stopped since."""
    session = drawn_session(8, 8)
    plan = straight_plan(session.context.scenario, 3)
    jobs.plan(messages.Plan(kind="plan", first=0, last=2), session)
    jobs.handle_answer(
        LONG_WORKER,
        Answer(asked(jobs, LONG_WORKER)[-1].number, "done", [FrontPlan(plan, 1.0, 0.0, 1.0, 1.0, 1.0)]),
        session,
    )
    jobs.plan(messages.Plan(kind="plan"), session)
    jobs.handle_answer(LONG_WORKER, Answer(asked(jobs, LONG_WORKER)[-1].number, "cancelled"), session)
    assert session.plans == ([plan], (0, 2))
