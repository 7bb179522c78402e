"""Send tasks to the two worker processes, and handle their results.

Tasks are flights, searches for paths, RTL trials and campaigns.
"""

import pickle
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from planfly.arguments import CHOICES
from planfly.studio import messages
from planfly.studio.changes import FlightResults, describe_changes
from planfly.studio.session import Session, TriedChanges
from planfly.studio.view_model import Json, round_to_json
from planfly.studio.worker_process import Answer, Task, WorkerProcess
from planfly.studio.worker_tasks import PlanRequest
from planner.search.algorithms import ALGORITHMS
from planner.search.plan_front import FrontPlan
from world.errors import MissionError, PlanflyError

# Interval between two progress reports of a task, s.
_REPORT_INTERVAL_S = 0.12
# Levels of the verdicts whose suggestions are tried, by the names of the tasks.
_TRIAL_LEVELS = {"geometry_trials": "geometric", "trials": "flown"}
# Name of the process that flies.
FLIGHT_WORKER = "flight"
# Name of the process for long tasks.
LONG_WORKER = "long"


@dataclass
class _ActiveTask:
    """Newest task of a worker process, until it has ended.

    number: number of the task, unique in a session.
    name: kind of the task: "fly", "plan", a key of `_TRIAL_LEVELS`, or a long task.
    rev: revision of the mission for which the task is done.
    item_range: first and last item between which a path is planned; None for other tasks, and for the whole mission.
    report_time: time of the last progress report, s.
    fraction: largest reported progress of the task, 0 to 1.
    """

    number: int
    name: str
    rev: int
    item_range: tuple[int, int] | None = None
    report_time: float = 0.0
    fraction: float = 0.0

    @property
    def message(self) -> Json:
        """Message to the pages about the progress of the task.

        The number distinguishes the task from earlier tasks of the same name.
        """
        return {"kind": "working", "job": self.name, "number": self.number, "rev": self.rev, "share": self.fraction}


@dataclass
class Jobs:
    """Both worker processes, their tasks in progress, and the results of the newest flight.

    on_answer: function that is called with the name of a worker process and its answer, in the thread that reads from
        the process.
    pack: see `WorkerProcess`.
    """

    on_answer: Callable[[str, Answer], None]
    pack: Callable[[Task | None], bytes] = pickle.dumps
    _workers: dict[str, WorkerProcess] = field(default_factory=dict)
    _active: dict[str, _ActiveTask] = field(default_factory=dict)
    # Names, keyed by number, of tasks that were replaced by other tasks and have not ended yet.
    _replaced: dict[int, str] = field(default_factory=dict)
    _number: int = 0
    _flight_message: Json | None = None
    _last_results: FlightResults | None = None
    _other_messages: list[Json] = field(default_factory=list)
    _is_first_path_pending: bool = False

    def start_first_task(self, session: Session) -> None:
        """Start a flight of the opened mission.

        If a scenario was opened and not edited, start a search for a path.
        """
        if session.document.to_plan and not session.is_edited:
            self._is_first_path_pending = True
            self._submit_task(
                LONG_WORKER,
                "plan",
                "planfly.studio.worker_tasks.plan",
                self._plan_request(messages.Plan(kind="plan"), session),
                session.rev,
            )
            self._worker(FLIGHT_WORKER).start()
        else:
            self.fly(session)

    def close(self) -> None:
        """End the worker processes."""
        for worker in self._workers.values():
            worker.close()

    def choices(self) -> Json:
        """Return the page data of autopilots, turbulence levels and algorithms to choose from."""
        return {
            "autopilots": list(CHOICES["autopilot"]),
            "turbulence": list(CHOICES["turbulence"]),
            "algorithms": {name: algorithm.summary for name, algorithm in ALGORITHMS.items()},
        }

    def result_messages(self) -> list[Json]:
        """Return the messages that show the newest results on a page that has just connected."""
        return [*([self._flight_message] if self._flight_message is not None else []), *self._other_messages]

    def progress_messages(self) -> list[Json]:
        """Return the messages that show tasks in progress on a page that has just connected."""
        return [task.message for task in self._active.values()]

    def is_planning_first_path(self, session: Session) -> bool:
        """Return True while a path is planned for an opened scenario.

        Until then the mission of the scenario is a placeholder.
        """
        return self._is_first_path_pending and not session.is_edited

    def discard_results(self) -> None:
        """Cancel all tasks and discard all results, because another mission was opened."""
        self.stop()
        self._flight_message = self._last_results = None
        self._other_messages = []

    # ------------------------------------------------------------------
    # Requests.

    def fly(self, session: Session) -> None:
        """Start a flight of the current mission, which replaces a flight in progress.

        If the geometric verdict has suggestions that were not tried, they are tried first, and the flight follows.
        Nothing is started while the first path of a scenario is planned.
        """
        if self.is_planning_first_path(session):
            return
        tried = session.tried.get("geometric")
        is_tried = tried is not None and tried.rev == session.rev
        has_suggestions = any(finding.suggestions for finding in session.judged.verdict.failed)
        name, function = ("fly", "fly")
        if has_suggestions and not is_tried:
            name, function = ("geometry_trials", "try_planned_suggestions")
        payload = session.context, session.mission
        self._submit_task(FLIGHT_WORKER, name, f"planfly.studio.worker_tasks.{function}", payload, session.rev)

    def plan(self, message: messages.Plan, session: Session) -> None:
        """Start a search for one or several paths, as a page requests.

        Raises PlanflyError for an unknown algorithm, and for items between which no path can be planned.
        """
        request = self._plan_request(message, session)
        self._is_first_path_pending = False
        self._submit_task(LONG_WORKER, "plan", "planfly.studio.worker_tasks.plan", request, session.rev)
        if message.first is not None and message.last is not None:
            self._active[LONG_WORKER].item_range = (message.first, message.last)

    def start_task(self, kind: str, session: Session) -> None:
        """Start a flight of the current mission, or a long task.

        kind: "fly", or the name of a long task, such as "returns" or "campaign".
        """
        if kind == "fly":
            self.fly(session)
            return
        self._submit_task(
            LONG_WORKER,
            kind,
            f"planfly.studio.long_worker_tasks.run_{kind}_task",
            (session.context, session.mission),
            session.rev,
        )

    def stop(self) -> None:
        """Cancel all tasks in progress."""
        for name, worker in self._workers.items():
            if name in self._active:
                worker.cancel()

    def _plan_request(self, message: messages.Plan, session: Session) -> PlanRequest:
        """Return the request for a search for paths, as a page requests it.

        Raises PlanflyError for an unknown algorithm, and for items between which no path can be planned.
        """
        scenario = session.context.scenario
        if message.algorithm is not None and message.algorithm not in ALGORITHMS:
            raise PlanflyError.of_argument("algorithm", message.algorithm, f"allowed {', '.join(ALGORITHMS)}")
        if message.algorithm is not None and message.ways > 1:
            raise PlanflyError.of_argument("ways", message.ways, "expected 1 if an algorithm is named")
        if message.first is not None:
            session.item_position(message.first)
        uav = session.context.planning_uav(session.mission, message.first)
        request = PlanRequest(scenario, uav, message.seed, message.algorithm, ways=message.ways)
        if message.first is None or message.last is None:
            if scenario.external:
                raise MissionError(f"{session.document.name}: choose the two items to plan between", field="first")
            return request
        ends = [session.item_position(index) for index in (message.first, message.last)]
        if message.first >= message.last:
            raise MissionError(
                f"{session.document.name}: the second item to plan between must come after the first in the mission",
                field="last",
            )
        return replace(request, ends=(ends[0], ends[1]))

    def _submit_task(self, worker: str, name: str, function: str, payload: Any, rev: int) -> None:
        """Send a task to a worker; a task in progress there is cancelled.

        worker: `FLIGHT_WORKER` or `LONG_WORKER`.
        name: kind of the task, as in `_ActiveTask`.
        function: full name of the function that the worker calls with `payload`.
        rev: revision of the mission for which the task is done.
        """
        self._number += 1
        previous_task = self._active.get(worker)
        if previous_task is not None and previous_task.name != name:
            self._replaced[previous_task.number] = previous_task.name
        self._active[worker] = _ActiveTask(self._number, name, rev)
        self._worker(worker).submit(Task(self._number, function, payload))

    def _worker(self, name: str) -> WorkerProcess:
        """Return the worker with a name; create it at the first call."""
        if name not in self._workers:
            self._workers[name] = WorkerProcess(
                f"planfly studio: {name}", lambda answer: self.on_answer(name, answer), pack=self.pack
            )
        return self._workers[name]

    # ------------------------------------------------------------------
    # Answers.

    def handle_answer(self, worker: str, answer: Answer, session: Session) -> list[Json]:
        """Handle a worker's answer, and return the messages for the pages.

        A result is stored, and a follow-up task is started.

        For a task that another task has replaced, this is only the message that the task has stopped.  Progress gives
        at most one message in `_REPORT_INTERVAL_S`.
        """
        task = self._active.get(worker)
        if task is None or task.number != answer.number:
            replaced_name = None if answer.kind == "progress" else self._replaced.pop(answer.number, None)
            return [] if replaced_name is None else [self._stopped_message(replaced_name)]
        if answer.kind == "progress":
            now = time.monotonic()
            if now - task.report_time < _REPORT_INTERVAL_S:
                return []
            task.report_time = now
            done, total, remark = answer.value
            # A search that begins another stage counts from zero again.
            task.fraction = max(task.fraction, round(min(1.0, done / total), 3) if total > 0.0 else 0.0)
            return [task.message | {"text": remark}]
        del self._active[worker]
        if answer.kind == "cancelled":
            return [self._stopped_message(task.name)]
        if answer.kind == "fault":
            return [self._stopped_message(task.name), {"kind": "fault", "text": str(answer.value)}]
        if task.name == "plan" and task.rev != session.rev:
            reason = "the mission was changed while its path was planned, so the path is not used: plan again"
            return [self._stopped_message("plan"), {"kind": "fault", "text": reason}]
        result = self._result_message(task, answer.value, session)
        # Send the message of a follow-up task, which may not report progress for a while.
        return [result, *(following.message for following in [self._active.get(worker)] if following is not None)]

    def _stopped_message(self, name: str) -> Json:
        """Return the message that a task has ended without a result.

        The end of a search also ends the first search.

        name: kind of the task, as in `_ActiveTask`.
        """
        if name == "plan":
            self._is_first_path_pending = False
        return {"kind": "stopped", "job": name}

    def _result_message(self, task: _ActiveTask, value: Any, session: Session) -> Json:
        """Store the result of a task, and return the message that shows the result on the pages.

        If a flight of the current mission failed, trials of its suggestions are started.  After trials of geometric
        suggestions, the flight is started.
        """
        if task.name == "fly":
            previous_results, self._last_results = self._last_results, value.pop("figures")
            judged_mission = value.pop("judged")
            if judged_mission and task.rev == session.rev:
                self._submit_task(
                    FLIGHT_WORKER,
                    "trials",
                    "planfly.studio.worker_tasks.try_flown_suggestions",
                    (session.context, judged_mission),
                    task.rev,
                )
            self._flight_message = {
                "kind": "flown",
                "rev": task.rev,
                **value,
                "changes": describe_changes(previous_results, self._last_results),
            }
            return self._flight_message
        if task.name in _TRIAL_LEVELS:
            level, findings = _TRIAL_LEVELS[task.name], value["findings"]
            session.tried[level] = TriedChanges(task.rev, findings, value["changes"])
            if level == "flown":
                self._flight_message = (self._flight_message or {}) | {"findings": findings}
            elif task.rev == session.rev:
                self.fly(session)
            return {"kind": "tried", "rev": task.rev, "job": task.name, "findings": findings}
        if task.name == "plan":
            # The paths of an earlier search can be chosen until a new search has finished.
            session.plans = ([front_plan.plan for front_plan in value], task.item_range)
            return {"kind": "ways", "rev": task.rev, "ways": paths_json(value), "at_once": self._is_first_path_pending}
        message = {"kind": task.name, "rev": task.rev, **value}
        self._other_messages = [*(message for message in self._other_messages if message["kind"] != task.name), message]
        return message

    def take_initial_plan(self, session: Session) -> bool:
        """Return True, once, when the first path of the opened scenario has arrived.

        This path can become the mission.
        """
        has_path = self._is_first_path_pending and bool(session.plans[0])
        if has_path:
            self._is_first_path_pending = False
        return has_path


def paths_json(plans: Sequence[FrontPlan]) -> list[Json]:
    """Return page data of the planned paths to choose from.

    Each path names the quantities, such as "shortest", in which it is the best of the paths.
    """
    quantities = {
        "shortest": [plan.length for plan in plans],
        "least seen by radars": [plan.exposure for plan in plans],
        "highest above ground": [-plan.clearance for plan in plans],
        "quickest": [plan.time for plan in plans],
        "least energy": [plan.energy for plan in plans],
    }
    # Quantities that are equal for all paths, or unknown, do not help to choose.
    differing_quantities = {name: values for name, values in quantities.items() if max(values) > min(values)}
    paths_data = []
    for index, front_plan in enumerate(plans):
        plan = front_plan.plan
        # m, s, m, s and Wh.
        length, exposure, clearance, seconds, energy = round_to_json(
            [front_plan.length, front_plan.exposure, front_plan.clearance, front_plan.time, front_plan.energy / 3600.0]
        )
        paths_data.append(
            {
                "seed": plan.seed,
                "algorithm": plan.algorithm,
                "state": plan.state,
                "length": length,
                "exposure": exposure,
                "clearance": clearance,
                "seconds": seconds,
                "energy": energy,
                "problems": list(plan.certificate.problems[:2]),
                "points": round_to_json(plan.waypoints),
                "best": [name for name, values in differing_quantities.items() if values[index] == min(values)],
            }
        )
    return paths_data
