"""Open, edit, judge, save and autosave the edited mission, which all pages share.

The session does not know connections or processes, which belong to `planfly.studio.server`.  Each change increases the
revision; an edit of an older revision is refused, so that no page edits a mission that it does not show.
"""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from flight.mission import edits
from flight.mission.items import LANDINGS, Mission
from planfly.flight_options import MissionOptions
from planfly.named_fences import read_named_fences
from planfly.studio.autosave import kept_beside, kept_text, read_kept
from planfly.studio.documents import Document, Saved, open_document, planned_mission, save_document
from planfly.studio.edit_context import EditContext
from planfly.studio.history import History
from planfly.studio.incremental_verdict import judge_windows
from planfly.studio.messages import Apply, Choose, Delete, Drag, Insert, Move, Raise, Settings
from planfly.studio.pilot import INTERNAL
from planfly.studio.settings import changed_parameters, changed_world, settings_json
from planfly.studio.view_model import Json, sheet_json, window_json, world_json
from planfly.workflow.apply_suggestion import apply_suggestion
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.suggestion_trials import SuggestionTrials
from planner.plan import Plan
from world.errors import MissionError, PlanflyError
from world.files import write_whole
from world.frames import to_geo

Edit = Move | Insert | Delete | Raise | Apply
# Document, context and history of edits.
_OpenedState = tuple[Document, EditContext, History]
# Maximum number of earlier documents that are kept for undo.
_MAX_LEFT_DOCUMENTS = 8


class StaleEdit(Exception):
    """Raised for an edit of an older revision of the mission."""


@dataclass(slots=True)
class Session:
    """One edited mission.

    document: the document as opened.
    desk: editing context of the document.
    history: edits of the mission.
    rev: revision, which increases with every change.
    judged: the current mission with its verdict.
    plans: planned paths to choose from, with the items that they would replace.
    flown_trials: missions with suggestions that passed a trial flight, by numbers of finding and suggestion, and the
    revision that was flown.
    world_rev: revision of the world, which increases with every change of it.
    document_rev: number that increases with every opened document.
    named: file named on the command line, the only file that is overwritten.
    written: the mission as last saved.
    left: earlier documents, as they were left.
    undone: documents whose opening was undone.
    """

    document: Document
    options: MissionOptions
    desk: EditContext
    history: History
    judged: JudgedMission
    rev: int = 1
    world_rev: int = 1
    plans: tuple[list[Plan], tuple[int, int] | None] = field(default_factory=lambda: ([], None))
    flown_trials: tuple[int, dict[tuple[int, int], Mission]] = field(default_factory=lambda: (0, {}))
    kept_rev: int = 0
    # Autosave files that cannot be read.
    unreadable: list[Path] = field(default_factory=list)
    named: Path | None = None
    written: Mission | None = None
    document_rev: int = 1
    left: list[_OpenedState] = field(default_factory=list)
    undone: list[_OpenedState] = field(default_factory=list)

    @classmethod
    def of(cls, document: Document, options: MissionOptions) -> "Session":
        """Return a session that starts with an opened document."""
        desk = EditContext.of(document.setup, options.get("terrain"), read_named_fences(options.get("fence") or ()))
        judged = desk.judge(document.setup.mission)
        history = History(document.setup.mission)
        named = None if document.path is None else document.path.resolve()
        return cls(document, options, desk, history, judged, named=named)

    def open(self, document: Document) -> None:
        """Open another document; an undo before its first edit restores the previous document."""
        named = document.path is not None and document.path.resolve() == self.named
        made = Session.of(document if named else replace(document, path=None), self.options)
        self.left, self.undone = [*self.left, self._state()][-_MAX_LEFT_DOCUMENTS:], []
        self._restore_state((made.document, made.desk, made.history))

    def _state(self) -> _OpenedState:
        return self.document, self.desk, self.history

    def _restore_state(self, place: _OpenedState) -> None:
        """Restore a document as it was left; if it cannot be judged, nothing is changed."""
        _, desk, history = place
        judged = desk.judge(history.mission)
        self.document, self.desk, self.history = place
        self.judged, self.plans = judged, ([], None)
        self.rev, self.world_rev = self.rev + 1, self.world_rev + 1
        self.document_rev += 1

    def _add_to_history(self, mission: Mission, text: str) -> None:
        self.history.add(mission, text)
        self.undone = []

    @property
    def undo_text(self) -> str:
        """Text of the next undo, which may be the opening of a document; "" if there is nothing to undo."""
        return self.history.undo_text or (f"open {self.document.name}" if self.left else "")

    @property
    def redo_text(self) -> str:
        """Text of the next redo; "" if there is nothing to redo."""
        return self.history.redo_text or (f"open {self.undone[-1][0].name}" if self.undone else "")

    @property
    def mission(self) -> Mission:
        """Current mission."""
        return self.history.mission

    @property
    def is_changed(self) -> bool:
        """True if the mission differs from the opened mission."""
        return self.mission is not self.history.first

    @property
    def is_unsaved(self) -> bool:
        """True if the mission differs from the opened mission and from the mission saved last."""
        return self.is_changed and self.mission is not self.written

    # ------------------------------------------------------------------
    # Edits.

    def edit(self, message: Edit) -> None:
        """Apply an edit.  Raises StaleEdit, or MissionError for an invalid mission; then nothing is changed."""
        if message.rev != self.rev:
            raise StaleEdit
        mission, text = self._edited_mission(message)
        self._show(mission)
        self._add_to_history(mission, text)

    def step(self, kind: str) -> None:
        """Undo, redo, or revert to the opened mission, if there is anything to undo, redo or revert."""
        if kind == "revert":
            if self.is_changed:
                self._show(self.history.first)
                self._add_to_history(self.history.first, "revert to the file")
            return
        if kind == "undo" and not self.history.undo_text and self.left:
            place = self._state()
            self._restore_state(self.left[-1])
            self.left, self.undone = self.left[:-1], [*self.undone, place]
            return
        if kind == "redo" and not self.history.redo_text and self.undone:
            place = self._state()
            self._restore_state(self.undone[-1])
            self.left, self.undone = [*self.left, place], self.undone[:-1]
            return
        before = self.history.at
        done = self.history.undo() if kind == "undo" else self.history.redo()
        try:
            if done:
                self._show(self.mission)
        except Exception:
            self.history.at = before
            raise

    def preview(self, message: Drag) -> Json:
        """Judge windows around a dragged item, or the whole mission on request, without changing the mission."""
        if message.rev != self.rev:
            raise StaleEdit
        mission = self._moved_mission(message.k, message.east, message.north, message.up)
        if not message.whole:
            return window_json(mission, *judge_windows(self.desk, mission, message.k, self.judged.setup))
        judged = self.desk.judge(mission)
        return {"sheet": sheet_json(self.desk, judged)}

    def replace_plan(self, message: Choose) -> None:
        """Replace the whole mission, or the items between two items, by a planned path.  Raises StaleEdit."""
        if message.rev != self.rev:
            raise StaleEdit
        plans, between = self.plans
        if not 0 <= message.which < len(plans):
            raise PlanflyError("that path no longer exists: plan again", field="which")
        plan = plans[message.which]
        if between is None:
            self._show_plan(plan)
            return
        mission = self._with_part_replaced(plan, *between)
        self._show(mission)
        self._add_to_history(mission, "plan a part")

    def _show(self, mission: Mission, desk: EditContext | None = None) -> None:
        """Judge a mission, make it the current one, and drop earlier planned paths; change nothing if it is invalid.

        desk: the editing context to judge the mission with, None for the current one.
        """
        desk = (self.desk if desk is None else desk).around(mission)
        judged = desk.judge(mission)
        if desk is not self.desk:
            self.world_rev += 1
        self.desk, self.judged = desk, judged
        self.plans = ([], None)
        self.rev += 1

    def _show_plan(self, plan: Plan) -> None:
        """Replace the mission by a new plan, whose certificate applies until the mission is edited."""
        mission = planned_mission(plan, self.desk.airframe)
        self._show(mission, self.desk.of_plan(plan, mission))
        self._add_to_history(mission, f"plan with seed {plan.seed}")

    def _edited_mission(self, message: Edit) -> tuple[Mission, str]:
        match message:
            case Move():
                item = edits.checked_place(self.mission, message.k)
                mission = self._moved_mission(message.k, message.east, message.north, message.up)
                return mission, f"move item {item.seq}"
            case Insert():
                return self._with_inserted(message)
            case Delete():
                return self._with_deleted(message.ks)
            case Raise():
                chosen = self._items_to_raise(message.ks)
                mission = edits.raised(self.mission, chosen, message.by)
                which = "all items" if message.ks is None else f"{len(chosen)} item{'s' if len(chosen) != 1 else ''}"
                return mission, f"{'raise' if message.by >= 0.0 else 'lower'} {which} by {abs(message.by):g} m"
            case Apply():
                return self._with_suggestion(message)

    def _items_to_raise(self, ks: list[int] | None) -> tuple[int, ...]:
        """Return the given items, or all, without landings unless there are only landings."""
        asked = edits.places(self.mission) if ks is None else tuple(ks)
        flying = tuple(k for k in asked if edits.checked_place(self.mission, k).command not in LANDINGS)
        return flying or asked

    def _moved_mission(self, k: int, east: float | None, north: float | None, up: float | None) -> Mission:
        mission = self.mission
        edits.checked_place(mission, k)
        if east is not None and north is not None:
            mission = edits.moved(mission, k, *self.desk.geographic(east, north))
        if up is not None:
            now = float(self.desk.points(mission)[edits.places(mission).index(k), 2])
            mission = edits.at_height(mission, k, up, now if np.isfinite(now) else up)
        return mission if mission is self.mission else self.desk.retuned(mission, k)

    def _with_inserted(self, message: Insert) -> tuple[Mission, str]:
        """Return the mission with a waypoint inserted, and the text of the edit.

        Its altitude is the mean of the altitudes before and after it if both have the same frame.
        """
        mission, own = self.mission, edits.places(self.mission)
        before = edits.checked_place(mission, message.after)
        height, at = None, own.index(message.after)
        if at + 1 < len(own):
            after = mission.items[own[at + 1]]
            alike = after.frame == before.frame and after.command not in LANDINGS
            height = 0.5 * (before.alt + after.alt) if alike else None
            height = height if height is not None and np.isfinite(height) else None
        made = edits.inserted(mission, message.after, *self.desk.geographic(message.east, message.north), height)
        return self.desk.retuned(made, edits.next_index(mission, message.after)), f"insert an item after {before.seq}"

    def _with_deleted(self, ks: list[int]) -> tuple[Mission, str]:
        mission = self.mission
        for k in sorted(set(ks), reverse=True):
            mission = edits.deleted(mission, k)
            own = edits.places(mission)
            near = min(own, key=lambda one: abs(one - k))
            mission = self.desk.retuned(mission, near)
        return mission, f"delete {len(set(ks))} item{'s' if len(set(ks)) != 1 else ''}"

    def _with_suggestion(self, message: Apply) -> tuple[Mission, str]:
        if message.flown:
            return self._with_flown_suggestion(message)
        findings = self.judged.verdict.findings
        if not message.finding < len(findings):
            raise MissionError(f"{self.document.name}: that finding no longer exists", field="finding")
        item = findings[message.finding]
        if not message.which < len(item.suggestions):
            raise MissionError(f"{self.document.name}: that suggestion no longer exists", field="suggestion")
        passed = SuggestionTrials(self.desk, self.judged).try_suggestion(item, message.which)
        if passed is None:
            # A suggestion that moves no item has a reason of its own.
            apply_suggestion(self.desk, self.judged, item, item.suggestions[message.which])
            raise MissionError(
                f"{self.document.name}: this suggestion would not remove its finding, or would add findings",
                field="suggestion",
            )
        mission = replace(passed.setup.mission, autopilot=self.mission.autopilot)
        return mission, f"apply a suggestion of {item.rule}"

    def _with_flown_suggestion(self, message: Apply) -> tuple[Mission, str]:
        """Return the mission with a suggestion of the flight, as its trial was flown."""
        rev, missions = self.flown_trials
        found = missions.get((message.finding, message.which)) if rev == self.rev else None
        if found is None:
            raise MissionError(f"{self.document.name}: that suggestion no longer exists", field="suggestion")
        return replace(found, autopilot=self.mission.autopilot), "apply a suggestion of the flight"

    def _with_part_replaced(self, plan: Plan, first: int, last: int) -> Mission:
        """Return the mission with the items between two items replaced by the waypoints of a planned path."""
        mission = self.mission
        for k in [k for k in edits.places(mission) if first < k < last][::-1]:
            mission = edits.deleted(mission, k)
        lat, lon = to_geo(self.desk.scenario.origin, plan.waypoints[1:-1, 0], plan.waypoints[1:-1, 1])
        at = first
        for one_lat, one_lon, up in zip(lat.tolist(), lon.tolist(), plan.waypoints[1:-1, 2].tolist(), strict=True):
            before, at = at, edits.next_index(mission, at)
            mission = edits.inserted(mission, before, one_lat, one_lon)
            now = float(self.desk.points(mission)[edits.places(mission).index(at), 2])
            mission = edits.at_height(mission, at, up, now)
        own = edits.places(mission)
        for k in own[own.index(first) : own.index(at) + 2]:
            mission = self.desk.retuned(mission, k)
        return mission

    def place_of(self, k: int) -> tuple[float, float, float]:
        """Return east, north and altitude AMSL of an item, m.  Raises MissionError if the item is not a place."""
        edits.checked_place(self.mission, k)
        east, north, up = self.desk.points(self.mission)[edits.places(self.mission).index(k)].tolist()
        return east, north, up

    # ------------------------------------------------------------------
    # The world.

    def change_settings(self, asked: Settings) -> None:
        """Change the settings of the flight.  Raises PlanflyError for a value that is not allowed in a scenario."""
        scenario = changed_world(self.desk.scenario, asked)
        desk = self.desk.flown_as(scenario, changed_parameters(self.desk.parameters, scenario, asked))
        mission = self.mission
        judged = desk.judge(mission)
        self.desk, self.judged, self.plans = desk, judged, ([], None)
        self.rev, self.world_rev = self.rev + 1, self.world_rev + 1

    def settings_json(self) -> Json:
        """Return the current settings as page data."""
        return settings_json(self.desk.scenario, self.desk.airframe, self.desk.parameters)

    # ------------------------------------------------------------------
    # Page data, and files.

    def sheet(self) -> Json:
        """Return the current mission with its verdict as page data."""
        return {
            "kind": "sheet",
            "rev": self.rev,
            "name": self.document.name,
            "document": self.document_rev,
            "changed": self.is_changed,
            "unsaved": self.is_unsaved,
            "undo": self.undo_text,
            "redo": self.redo_text,
            "over": self.document.kind if self.document.path is not None else "",
            "planned": self.judged.setup.plan is not None,
            "notes": [*self.mission.warnings, *self.judged.setup.notes],
            **sheet_json(self.desk, self.judged),
        }

    def world_shown(self) -> Json:
        """Return the world as page data."""
        return {
            "kind": "world",
            "world": self.world_rev,
            **world_json(self.desk, self.judged.setup),
            "settings": self.settings_json(),
        }

    def save(self, form: str) -> Saved:
        """Return the mission as a file.  Raises PlanflyError if the format cannot store it."""
        saved = save_document(self.document, self.desk, self.judged, form)
        if form != "kml":
            self.written = self.mission
        return saved

    def save_over(self) -> Saved:
        """Overwrite the file that the command named.  Raises PlanflyError if there is none."""
        path = self.document.path
        if path is None or not self.document.kind:
            raise PlanflyError("no mission file was named: save it as a new one", field="over")
        if path.exists() and path.read_bytes() != self.document.on_disk:
            changed = f"{path.name} was changed by another program since it was opened: save it under another name"
            raise PlanflyError(changed, file=path)
        saved = self.save(self.document.kind)
        write_whole(path, saved.data)
        self.document = replace(self.document, on_disk=saved.data)
        return saved

    # ------------------------------------------------------------------
    # Autosave, in case the server dies.

    @property
    def has_news(self) -> bool:
        """True if the mission or its settings differ from those opened, and should be autosaved."""
        return self.is_changed or self.desk.scenario is not self.document.setup.scenario

    def kept_file(self, file: Path) -> Path:
        """Return the autosave path, which is `file` for the first document, and a sibling for later documents."""
        return kept_beside(file, self.history.first) if self.left else file

    def keep(self, file: Path) -> None:
        """Write the autosave file if anything has changed since the last autosave."""
        if self.kept_rev == self.rev:
            return
        file = self.kept_file(file)
        if file in self.unreadable:
            return
        file.parent.mkdir(parents=True, exist_ok=True)
        plan = self.judged.setup.plan
        write_whole(file, kept_text(self.desk, self.history.first, self.mission, plan, self.document.name))
        self.kept_rev = self.rev

    def restore(self, file: Path) -> bool:
        """Restore the autosave of this document, with its mission as an edit; return True if there was one.

        An autosave of another document is ignored.  An autosave that cannot be read is added to `unreadable`, and is
        neither restored nor overwritten.
        """
        before = self.desk, self.judged, self.plans
        try:
            found = read_kept(file, self.desk, self.history.first)
            if found is None:
                return False
            self._show(*found)
            json.dumps(self.sheet(), allow_nan=False)
        except (*INTERNAL, PlanflyError):
            self.desk, self.judged, self.plans = before
            self.unreadable.append(file)
            return False
        if found[0] is not self.history.first:
            self._add_to_history(found[0], "what was done before the studio ended")
        return True


def open_session(target: str, options: MissionOptions, kept: Path | None = None) -> tuple[Session, bool]:
    """Open a target of the command, and also return True if earlier edits were restored.  Raises PlanflyError."""
    session = Session.of(open_document(target, options), options)
    return session, kept is not None and session.restore(kept)
