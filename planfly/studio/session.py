"""The mission under edit as all pages see it: opened, changed, judged, saved, and kept beside for a server that dies.

No part of it knows of connections or processes: `planfly.studio.server` does.  Every change has a revision, which only
grows; an edit of an older one is refused, so that two pages never change what the other does not show.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from flight.mission.items import LANDINGS, Mission
from planfly.flight_options import MissionOptions
from planfly.named_fences import read_named_fences
from planfly.studio import edits
from planfly.studio.applied import apply_suggestion
from planfly.studio.desk import Desk, Judged
from planfly.studio.documents import Document, Saved, open_document, planned_mission, save_document
from planfly.studio.history import History
from planfly.studio.kept import kept_beside, kept_text, read_kept
from planfly.studio.messages import Apply, Choose, Delete, Drag, Insert, Move, Raise, Settings
from planfly.studio.settings import changed_parameters, changed_world, settings_json
from planfly.studio.sheet import Json, sheet_json, window_json, world_json
from planfly.studio.windows import judge_windows
from planner.plan import Plan
from world.errors import MissionError, PlanflyError
from world.files import write_whole
from world.frames import to_geo

Edit = Move | Insert | Delete | Raise | Apply
# A document with what it is judged with and what was done to it; so many are kept to go back to.
_Place = tuple[Document, Desk, History]
_MOST_LEFT = 8


class StaleEdit(Exception):
    """An edit of a sheet that another edit has changed since."""


@dataclass(slots=True)
class Session:
    """One mission under edit.

    document: as opened.  desk: what it is judged with.  history: what was done to it.
    rev: grows with every change.  judged: the mission as it is.
    plans: paths that were planned and may be chosen, with the items that they would replace.
    world_rev: grows with every change of the world.  document_rev: with every other document.
    named: the file that the command named, the only one that is written over.  written: the mission as saved last.
    left: documents that another was opened in place of, as they were left; undone: those whose opening was undone.
    """

    document: Document
    options: MissionOptions
    desk: Desk
    history: History
    judged: Judged
    rev: int = 1
    world_rev: int = 1
    plans: tuple[list[Plan], tuple[int, int] | None] = field(default_factory=lambda: ([], None))
    kept_rev: int = 0
    named: Path | None = None
    written: Mission | None = None
    document_rev: int = 1
    left: list[_Place] = field(default_factory=list)
    undone: list[_Place] = field(default_factory=list)

    @classmethod
    def of(cls, document: Document, options: MissionOptions) -> "Session":
        """A session that begins with what was opened."""
        desk = Desk.of(document.setup, options.get("terrain"), read_named_fences(options.get("fence") or ()))
        judged = desk.judge(document.setup.mission)
        history = History(document.setup.mission)
        named = None if document.path is None else document.path.resolve()
        return cls(document, options, desk, history, judged, named=named)

    def open(self, document: Document) -> None:
        """Begin anew with another document; an undo before its first edit brings back what was there."""
        named = document.path is not None and document.path.resolve() == self.named
        made = Session.of(document if named else replace(document, path=None), self.options)
        self.left, self.undone = [*self.left, self._place()][-_MOST_LEFT:], []
        self._go_to((made.document, made.desk, made.history))

    def _place(self) -> _Place:
        return self.document, self.desk, self.history

    def _go_to(self, place: _Place) -> None:
        """Show another document as it was left; nothing is changed where it cannot be judged."""
        _, desk, history = place
        judged = desk.judge(history.mission)
        self.document, self.desk, self.history = place
        self.judged, self.plans = judged, ([], None)
        self.rev, self.world_rev = self.rev + 1, self.world_rev + 1
        self.document_rev += 1

    def _note(self, mission: Mission, text: str) -> None:
        self.history.add(mission, text)
        self.undone = []

    @property
    def undo_text(self) -> str:
        """What would be undone, an opening before the first edit; "" for nothing."""
        return self.history.undo_text or (f"open {self.document.name}" if self.left else "")

    @property
    def redo_text(self) -> str:
        """What would be done again; "" for nothing."""
        return self.history.redo_text or (f"open {self.undone[-1][0].name}" if self.undone else "")

    @property
    def mission(self) -> Mission:
        """The mission as it is."""
        return self.history.mission

    @property
    def is_changed(self) -> bool:
        """Whether it differs from what was opened."""
        return self.mission is not self.history.first

    @property
    def is_unsaved(self) -> bool:
        """Whether it differs from what was opened and from what was saved last."""
        return self.is_changed and self.mission is not self.written

    # ------------------------------------------------------------------
    # Edits.

    def edit(self, message: Edit) -> None:
        """Make an edit.  Raises StaleEdit, and MissionError for what no mission may be; nothing is changed then."""
        if message.rev != self.rev:
            raise StaleEdit
        mission, text = self._edited(message)
        self._show(mission)
        self._note(mission, text)

    def step(self, kind: str) -> None:
        """Undo, redo, or revert to what was opened; nothing happens where there is nothing to."""
        if kind == "revert":
            if self.is_changed:
                self._show(self.history.first)
                self._note(self.history.first, "revert to the file")
            return
        if kind == "undo" and not self.history.undo_text and self.left:
            place = self._place()
            self._go_to(self.left[-1])
            self.left, self.undone = self.left[:-1], [*self.undone, place]
            return
        if kind == "redo" and not self.history.redo_text and self.undone:
            place = self._place()
            self._go_to(self.undone[-1])
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
        """What a drag would come to, which changes nothing: windows, or the whole where that is asked for."""
        if message.rev != self.rev:
            raise StaleEdit
        mission = self._placed(message.k, message.east, message.north, message.up)
        if not message.whole:
            return window_json(mission, *judge_windows(self.desk, mission, message.k, self.judged.setup))
        judged = self.desk.judge(mission)
        return {"sheet": sheet_json(self.desk, judged)}

    def replace_plan(self, message: Choose) -> None:
        """Take one of the planned paths: all of the mission, or the items between two.  Raises StaleEdit."""
        if message.rev != self.rev:
            raise StaleEdit
        plans, between = self.plans
        if not 0 <= message.which < len(plans):
            raise PlanflyError("that path is not there any more: plan again", field="which")
        plan = plans[message.which]
        if between is None:
            self._show_plan(plan)
            return
        mission = self._joined(plan, *between)
        self._show(mission)
        self._note(mission, "plan a part")

    def _show(self, mission: Mission, desk: Desk | None = None) -> None:
        """Judge a mission as the one that is shown, in its world; nothing is changed where that fails.

        desk: with which it is judged, None for the one there is.  Paths that were planned before are gone.
        """
        desk = (self.desk if desk is None else desk).around(mission)
        judged = desk.judge(mission)
        if desk is not self.desk:
            self.world_rev += 1
        self.desk, self.judged = desk, judged
        self.plans = ([], None)
        self.rev += 1

    def _show_plan(self, plan: Plan) -> None:
        """A new plan takes the place of all; its certificate counts until it is edited."""
        mission = planned_mission(plan, self.desk.airframe)
        self._show(mission, self.desk.of_plan(plan, mission))
        self._note(mission, f"plan with seed {plan.seed}")

    def _edited(self, message: Edit) -> tuple[Mission, str]:
        match message:
            case Move():
                item = edits.checked_place(self.mission, message.k)
                mission = self._placed(message.k, message.east, message.north, message.up)
                return mission, f"move item {item.seq}"
            case Insert():
                return self._inserted(message)
            case Delete():
                return self._deleted(message.ks)
            case Raise():
                chosen = self._raisable(message.ks)
                mission = edits.raised(self.mission, chosen, message.by)
                which = "all items" if message.ks is None else f"{len(chosen)} item{'s' if len(chosen) != 1 else ''}"
                return mission, f"{'raise' if message.by >= 0.0 else 'lower'} {which} by {abs(message.by):g} m"
            case Apply():
                return self._applied(message)

    def _raisable(self, ks: list[int] | None) -> tuple[int, ...]:
        """The items that are raised together: of those asked for, or all, what does not land; a landing alone is."""
        asked = edits.places(self.mission) if ks is None else tuple(ks)
        flying = tuple(k for k in asked if edits.checked_place(self.mission, k).command not in LANDINGS)
        return flying or asked

    def _placed(self, k: int, east: float | None, north: float | None, up: float | None) -> Mission:
        mission = self.mission
        edits.checked_place(mission, k)
        if east is not None and north is not None:
            mission = edits.moved(mission, k, *self.desk.geographic(east, north))
        if up is not None:
            now = float(self.desk.points(mission)[edits.places(mission).index(k), 2])
            mission = edits.at_height(mission, k, up, now if np.isfinite(now) else up)
        return mission if mission is self.mission else self.desk.retuned(mission, k)

    def _inserted(self, message: Insert) -> tuple[Mission, str]:
        """A waypoint behind another, at the height halfway to the next in the frame of the one before."""
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

    def _deleted(self, ks: list[int]) -> tuple[Mission, str]:
        mission = self.mission
        for k in sorted(set(ks), reverse=True):
            mission = edits.deleted(mission, k)
            own = edits.places(mission)
            near = min(own, key=lambda one: abs(one - k))
            mission = self.desk.retuned(mission, near)
        return mission, f"delete {len(set(ks))} item{'s' if len(set(ks)) != 1 else ''}"

    def _applied(self, message: Apply) -> tuple[Mission, str]:
        findings = self.judged.verdict.findings
        if not message.finding < len(findings):
            raise MissionError(f"{self.document.name}: that finding is not there any more", field="finding")
        item = findings[message.finding]
        mission = apply_suggestion(self.desk, self.judged, item, message.which)
        return mission, f"apply a suggestion of {item.rule}"

    def _joined(self, plan: Plan, first: int, last: int) -> Mission:
        """The mission with a planned path's waypoints in place of the items between two."""
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
        """East, north and height above mean sea level of an item, m.  Raises MissionError for one that is no place."""
        edits.checked_place(self.mission, k)
        east, north, up = self.desk.points(self.mission)[edits.places(self.mission).index(k)].tolist()
        return east, north, up

    # ------------------------------------------------------------------
    # The world.

    def change_settings(self, asked: Settings) -> None:
        """Fly the mission otherwise.  Raises PlanflyError for a value that no scenario may have."""
        scenario = changed_world(self.desk.scenario, asked)
        desk = self.desk.flown_as(scenario, changed_parameters(self.desk.parameters, scenario, asked))
        mission = self.mission
        judged = desk.judge(mission)
        self.desk, self.judged, self.plans = desk, judged, ([], None)
        self.rev, self.world_rev = self.rev + 1, self.world_rev + 1

    def settings_json(self) -> Json:
        """The settings as they are."""
        return settings_json(self.desk.scenario, self.desk.airframe, self.desk.parameters)

    # ------------------------------------------------------------------
    # What the page draws, and files.

    def sheet(self) -> Json:
        """All of the mission as it is."""
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
        """The world about it."""
        return {
            "kind": "world",
            "world": self.world_rev,
            **world_json(self.desk, self.judged.setup),
            "settings": self.settings_json(),
        }

    def save(self, form: str) -> Saved:
        """The mission as a file.  Raises PlanflyError."""
        saved = save_document(self.document, self.desk, self.judged, form)
        if form != "kml":
            self.written = self.mission
        return saved

    def save_over(self) -> Saved:
        """Write the mission over the file that the command named.  Raises PlanflyError where there is none."""
        path = self.document.path
        if path is None or not self.document.kind:
            raise PlanflyError("no mission file was named: save it as a new one", field="over")
        if path.exists() and path.read_bytes() != self.document.on_disk:
            changed = f"{path.name} was changed by something else since it was opened: save under another name"
            raise PlanflyError(changed, file=path)
        saved = self.save(self.document.kind)
        write_whole(path, saved.data)
        self.document = replace(self.document, on_disk=saved.data)
        return saved

    # ------------------------------------------------------------------
    # Kept beside, for a server that dies.

    @property
    def has_news(self) -> bool:
        """Whether anything is to be kept: the mission, or how it is flown, differs from what was opened."""
        return self.is_changed or self.desk.scenario is not self.document.setup.scenario

    def kept_file(self, file: Path) -> Path:
        """Where this document is kept: what was opened since the command began, beside what it named."""
        return kept_beside(file, self.history.first) if self.left else file

    def keep(self, file: Path) -> None:
        """Write what was done, if anything was since it was written last."""
        if self.kept_rev == self.rev:
            return
        file = self.kept_file(file)
        file.parent.mkdir(parents=True, exist_ok=True)
        plan = self.judged.setup.plan
        write_whole(file, kept_text(self.desk, self.history.first, self.mission, plan, self.document.name))
        self.kept_rev = self.rev

    def restore(self, file: Path) -> bool:
        """Take what was kept of the same document, its mission as an edit; whether there was anything.

        What was kept of another document, or cannot be read, is left.
        """
        try:
            found = read_kept(file, self.desk, self.history.first)
            if found is None:
                return False
            self._show(*found)
        except (OSError, ValueError, LookupError, TypeError, PlanflyError):
            return False
        if found[0] is not self.history.first:
            self._note(found[0], "what was done before the studio ended")
        return True


def open_session(target: str, options: MissionOptions, kept: Path | None = None) -> tuple[Session, bool]:
    """Open what a command names; also return True if earlier edits were taken up.  Raises PlanflyError."""
    session = Session.of(open_document(target, options), options)
    return session, kept is not None and session.restore(kept)
