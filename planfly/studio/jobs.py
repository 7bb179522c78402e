"""Send flights, plans, returns and campaigns to the studio's two processes, and handle their results."""

import pickle
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from aircraft.catalog import aircraft_names
from planfly.arguments import CHOICES
from planfly.studio import messages
from planfly.studio.changes import Figures, changes
from planfly.studio.pilot import Answer, Pilot, Work
from planfly.studio.session import Session
from planfly.studio.view_model import Json, rounded
from planfly.studio.worker_tasks import PlanAsked
from planner.search.algorithms import ALGORITHMS
from planner.search.plan_front import FrontPlan
from world.errors import MissionError, PlanflyError

# Interval between two progress reports of a task, s.
_REPORT_INTERVAL_S = 0.12
# Name of the process that flies.
PILOT = "flight"
# Name of the process for long tasks.
LONG = "long"


@dataclass
class _ActiveWork:
    """Work in progress.

    rev: revision of the mission that it is done for.
    reported: time of the last progress report, s.
    share: largest share done that was reported, 0 to 1.
    """

    number: int
    name: str
    rev: int
    reported: float = 0.0
    share: float = 0.0

    @property
    def message(self) -> Json:
        """Message to the pages about the work; its number tells it from earlier work of the same name."""
        return {"kind": "working", "job": self.name, "number": self.number, "rev": self.rev, "share": self.share}


@dataclass
class Jobs:
    """Both processes, their tasks in progress, and the newest flight.

    on_answer: called with the name of the process and its answer, from its own thread.
    pack: see `Pilot`.
    """

    on_answer: Callable[[str, Answer], None]
    pack: Callable[[Work | None], bytes] = pickle.dumps
    _pilots: dict[str, Pilot] = field(default_factory=dict)
    _asked: dict[str, _ActiveWork] = field(default_factory=dict)
    # Names of works that were replaced by other work and have not ended yet, by their numbers.
    _replaced: dict[int, str] = field(default_factory=dict)
    _number: int = 0
    _flown: Json | None = None
    _figures: Figures | None = None
    _others: list[Json] = field(default_factory=list)
    _at_once: bool = False

    def start(self, session: Session) -> None:
        """Fly the opened mission, or plan a path if a scenario without a path was opened."""
        if session.document.to_plan and not session.is_changed:
            self._at_once = True
            self._send_work(
                LONG,
                "plan",
                "planfly.studio.worker_tasks.plan",
                self._plan_request(messages.Plan(kind="plan"), session),
                session.rev,
            )
            self._pilot(PILOT).start()
        else:
            self.fly(session)

    def close(self) -> None:
        """End both processes."""
        for pilot in self._pilots.values():
            pilot.close()

    def choices(self) -> Json:
        """Return the choices that a page offers."""
        return {
            "aircraft": aircraft_names(),
            "autopilots": list(CHOICES["autopilot"]),
            "turbulence": list(CHOICES["turbulence"]),
            "algorithms": {name: one.summary for name, one in ALGORITHMS.items()},
        }

    def shown(self) -> list[Json]:
        """Return the messages for a new page about results."""
        return [*([self._flown] if self._flown is not None else []), *self._others]

    def under_way(self) -> list[Json]:
        """Return the messages for a new page about tasks in progress."""
        return [one.message for one in self._asked.values()]

    def plans_first_path(self, session: Session) -> bool:
        """Return True while the path of an opened scenario is searched, and its mission is a placeholder."""
        return self._at_once and not session.is_changed

    def forget(self) -> None:
        """Cancel all tasks and drop all results, because another mission was opened."""
        self.stop()
        self._flown = self._figures = None
        self._others = []

    # ------------------------------------------------------------------
    # Requests.

    def fly(self, session: Session) -> None:
        """Fly the current mission; a flight in progress is cancelled."""
        if session.document.to_plan and not session.is_changed:
            return
        self._send_work(PILOT, "fly", "planfly.studio.worker_tasks.fly", (session.desk, session.mission), session.rev)

    def plan(self, message: messages.Plan, session: Session) -> None:
        """Plan one or several paths.  Raises PlanflyError for places between which no path can be planned."""
        asked = self._plan_request(message, session)
        self._at_once = False
        self._send_work(LONG, "plan", "planfly.studio.worker_tasks.plan", asked, session.rev)

    def ask(self, kind: str, session: Session) -> None:
        """Fly, or start a long task."""
        if kind == "fly":
            self.fly(session)
            return
        self._send_work(
            LONG, kind, f"planfly.studio.long_worker_tasks.{kind}", (session.desk, session.mission), session.rev
        )

    def stop(self) -> None:
        """Cancel all tasks in progress."""
        for name, pilot in self._pilots.items():
            if name in self._asked:
                pilot.cancel()

    def _plan_request(self, message: messages.Plan, session: Session) -> PlanAsked:
        scenario, frame = session.desk.scenario, session.desk.airframe
        if message.algorithm is not None and message.algorithm not in ALGORITHMS:
            raise PlanflyError.of_argument("algorithm", message.algorithm, f"allowed {', '.join(ALGORITHMS)}")
        if message.algorithm is not None and message.ways > 1:
            raise PlanflyError.of_argument("ways", message.ways, "expected 1 with an algorithm of your own")
        asked = PlanAsked(scenario, frame, message.seed, message.algorithm, ways=message.ways)
        if message.first is None or message.last is None:
            if scenario.external:
                raise MissionError(f"{session.document.name}: choose the two items to plan between", field="first")
            session.plans = ([], None)
            return asked
        ends = [session.place_of(k) for k in (message.first, message.last)]
        if message.first >= message.last:
            raise MissionError(
                f"{session.document.name}: the second item to plan between comes after the first", field="last"
            )
        session.plans = ([], (message.first, message.last))
        return replace(asked, ends=(ends[0], ends[1]))

    def _send_work(self, pilot: str, name: str, function: str, payload: Any, rev: int) -> None:
        self._number += 1
        before = self._asked.get(pilot)
        if before is not None and before.name != name:
            self._replaced[before.number] = before.name
        self._asked[pilot] = _ActiveWork(self._number, name, rev)
        self._pilot(pilot).ask(Work(self._number, function, payload))

    def _pilot(self, name: str) -> Pilot:
        if name not in self._pilots:
            self._pilots[name] = Pilot(
                f"planfly studio: {name}", lambda answer: self.on_answer(name, answer), pack=self.pack
            )
        return self._pilots[name]

    # ------------------------------------------------------------------
    # Answers.

    def answered(self, pilot: str, answer: Answer, session: Session) -> list[Json]:
        """Return the messages to the pages for an answer; of a task that was replaced by other work only its end."""
        asked = self._asked.get(pilot)
        if asked is None or asked.number != answer.number:
            ended = None if answer.kind == "progress" else self._replaced.pop(answer.number, None)
            return [] if ended is None else [self._stopped_message(ended)]
        if answer.kind == "progress":
            now = time.monotonic()
            if now - asked.reported < _REPORT_INTERVAL_S:
                return []
            asked.reported = now
            done, total, remark = answer.value
            # A search that begins another stage starts to count from zero.
            asked.share = max(asked.share, round(min(1.0, done / total), 3) if total > 0.0 else 0.0)
            return [asked.message | {"text": remark}]
        del self._asked[pilot]
        if answer.kind == "cancelled":
            return [self._stopped_message(asked.name)]
        if answer.kind == "fault":
            return [self._stopped_message(asked.name), {"kind": "fault", "text": str(answer.value)}]
        if asked.name == "plan" and asked.rev != session.rev:
            edited = "the mission was changed during the search for its path, so it stays as it is: plan again"
            return [self._stopped_message("plan"), {"kind": "fault", "text": edited}]
        return [self._result_message(asked, answer.value, session)]

    def _stopped_message(self, name: str) -> Json:
        """Return the message that a work has ended without a result."""
        if name == "plan":
            self._at_once = False
        return {"kind": "stopped", "job": name}

    def _result_message(self, asked: _ActiveWork, value: Any, session: Session) -> Json:
        if asked.name == "fly":
            before, self._figures = self._figures, value.pop("figures")
            judged = value.pop("judged")
            if judged and asked.rev == session.rev:
                self._send_work(
                    PILOT, "trials", "planfly.studio.worker_tasks.try_suggestions", (session.desk, judged), asked.rev
                )
            self._flown = {"kind": "flown", "rev": asked.rev, **value, "changes": changes(before, self._figures)}
            return self._flown
        if asked.name == "trials":
            session.flown_trials = asked.rev, value["missions"]
            self._flown = (self._flown or {}) | {"findings": value["findings"]}
            return {"kind": "tried", "rev": asked.rev, "findings": value["findings"]}
        if asked.name == "plan":
            session.plans = ([one.plan for one in value], session.plans[1])
            return {"kind": "ways", "rev": asked.rev, "ways": ways_json(value), "at_once": self._at_once}
        found = {"kind": asked.name, "rev": asked.rev, **value}
        self._others = [*(one for one in self._others if one["kind"] != asked.name), found]
        return found

    def take_initial_plan(self, session: Session) -> bool:
        """Return True once, when the path that the studio planned at its start has arrived."""
        come = self._at_once and bool(session.plans[0])
        if come:
            self._at_once = False
        return come


def ways_json(ways: Sequence[FrontPlan]) -> list[Json]:
    """Return page data of the planned paths to choose from, with the quantities in which each path is the best."""
    figures = {
        "shortest": [one.length for one in ways],
        "least seen by radars": [one.exposure for one in ways],
        "highest above ground": [-one.clearance for one in ways],
        "quickest": [one.time for one in ways],
        "least energy": [one.energy for one in ways],
    }
    # Quantities that are equal for all paths, or unknown, do not help to choose.
    differing = {name: values for name, values in figures.items() if max(values) > min(values)}
    return [
        _path_json(one) | {"best": [name for name, values in differing.items() if values[k] == min(values)]}
        for k, one in enumerate(ways)
    ]


def _path_json(one: FrontPlan) -> Json:
    """Return length (m), radar exposure (s), minimum height (m), time (s) and energy (Wh) of a path."""
    plan, (length, exposure, clearance, seconds, energy) = (
        one.plan,
        rounded([one.length, one.exposure, one.clearance, one.time, one.energy / 3600.0]),
    )
    return {
        "seed": plan.seed,
        "algorithm": plan.algorithm,
        "state": plan.state,
        "length": length,
        "exposure": exposure,
        "clearance": clearance,
        "seconds": seconds,
        "energy": energy,
        "problems": list(plan.certificate.problems[:2]),
        "points": rounded(plan.waypoints),
    }
