"""Open, edit, judge, save and autosave the edited mission, which all pages share.

The session does not know connections or processes, which belong to `planfly.studio.server`. Each change increases the
revision; an edit of an older revision is refused, so that no page edits a mission that it does not show.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flight.mission import edits
from flight.mission.items import LANDINGS, Mission
from logs.verdict.places import Suggestion
from logs.verdict.rule_words import rule_word
from logs.verdict.wording import count_text, moves_text, suggestion_text, without_trial
from planfly.flight_options import MissionOptions, read_named_fences
from planfly.studio.autosave import (
    autosave_text,
    read_autosave,
    restore_settings,
    set_autosave_aside,
    settings_data,
    sibling_autosave_path,
)
from planfly.studio.documents import KINDS, Document, SavedFile, open_document, planned_mission, save_document
from planfly.studio.edit_context import EditContext
from planfly.studio.history import History, ParameterChange
from planfly.studio.incremental_verdict import judge_windows
from planfly.studio.messages import Apply, Choose, Delete, Drag, Insert, Move, Raise, Settings
from planfly.studio.settings import (
    apply_parameter_settings,
    apply_scenario_settings,
    autopilot_parameters,
    error_in_page_words,
    own_aircraft,
    settings_json,
)
from planfly.studio.view_model import Json, mission_json, windows_json, world_json
from planfly.studio.worker_process import INTERNAL
from planfly.workflow.apply_suggestion import item_moves
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.suggestion_trials import suggested_parameters
from planner.plan import Plan
from world.errors import MissionError, PlanflyError
from world.files import write_atomically
from world.frames import to_geo
from world.scenario import with_flight

Edit = Move | Insert | Delete | Raise | Apply
# Document, context and history of edits.
_OpenedState = tuple[Document, EditContext, History]
# Maximum number of earlier documents that are kept for undo.
_MAX_EARLIER_DOCUMENTS = 8


class StaleEdit(Exception):
    """Raised for an edit of an older revision of the mission."""


class TriedChanges(NamedTuple):
    """Suggestions of a verdict that passed their trials.

    rev: revision of the judged mission.
    findings: findings with these suggestions, as page data.
    changes: mission with the suggestion applied, and the suggestion, by (number of finding, number of suggestion).
    """

    rev: int
    findings: list[Json]
    changes: dict[tuple[int, int], tuple[Mission, Suggestion]]


@dataclass(slots=True)
class Session:
    """One edited mission.

    document: the document as opened.
    context: editing context of the document.
    history: edits of the mission.
    rev: revision, which increases with every change.
    judged: the current mission with its verdict.
    plans: planned paths to choose from, and the first and last item between which they replace items, or None.
    tried: suggestions that passed their trials, by the level of the verdict, "geometric" or "flown".
    world_rev: revision of the world, which increases with every change of the world.
    autosaved_rev: revision of the last autosave.
    unreadable: autosave files that cannot be read.
    document_rev: number that increases with every opened document.
    named_file: file named on the command line, the only file that may be overwritten.
    earlier_states: states of the documents opened earlier.
    undone_states: states of the documents whose opening was undone.
    replaced_settings: autosaved settings of this document that were not restored, each as text.
    must_autosave: True if options of the command replaced autosaved settings, so that the autosave is written again.
    unused_text: text on autosaved edits that were set aside because the mission file has changed; "" without any.
    aircraft_folders: folders of the user's own aircraft that the session has flown, by name.
    named_parameters: [flight] entries of each autopilot that was flown with a parameter file, by its name; they apply
    again when this autopilot is chosen again.
    """

    document: Document
    options: MissionOptions
    context: EditContext
    history: History
    judged: JudgedMission
    rev: int = 1
    world_rev: int = 1
    plans: tuple[list[Plan], tuple[int, int] | None] = field(default_factory=lambda: ([], None))
    tried: dict[str, TriedChanges] = field(default_factory=dict)
    autosaved_rev: int = 0
    unreadable: list[Path] = field(default_factory=list)
    named_file: Path | None = None
    document_rev: int = 1
    earlier_states: list[_OpenedState] = field(default_factory=list)
    undone_states: list[_OpenedState] = field(default_factory=list)
    replaced_settings: tuple[str, ...] = ()
    must_autosave: bool = False
    unused_text: str = ""
    aircraft_folders: dict[str, str] = field(default_factory=dict)
    named_parameters: dict[str, dict[str, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.aircraft_folders |= own_aircraft(self.context.scenario)

    @classmethod
    def from_document(cls, document: Document, options: MissionOptions) -> "Session":
        """Return a new session with an opened document.

        options: options of the command.
        """
        context = EditContext.from_setup(
            document.setup, options.get("terrain"), read_named_fences(options.get("fence") or ())
        )
        judged_mission = context.judge(document.setup.mission)
        history = History(document.setup.mission)
        named_path = None if document.path is None else document.path.resolve()
        return cls(document, options, context, history, judged_mission, named_file=named_path)

    def open(self, document: Document, first_autosave_file: Path | None = None) -> None:
        """Open another document; an undo before its first edit restores the previous document.

        A mission file is judged with the settings of the session.  A plan or a log has its own settings.

        first_autosave_file: autosave path of the session's first document, from which the document's own path follows;
            None to restore no autosaved edits.
        """
        is_named_file = document.path is not None and document.path.resolve() == self.named_file
        new_session = Session.from_document(document if is_named_file else replace(document, path=None), self.options)
        context, settings = new_session.context, None
        replaced_settings: tuple[str, ...] = ()
        if document.kind in ("waypoints", "plan"):
            previous_settings = settings_data(self.context)
            context, replaced_settings = restore_settings(
                context, previous_settings, MissionOptions(), file_autopilot=True
            )
            settings = settings_data(context)
            settings = settings if settings["scenario"] == previous_settings["scenario"] else None
        current_state = self._opened_state()
        self._restore_state((new_session.document, context, new_session.history))
        self.earlier_states, self.undone_states = [*self.earlier_states, current_state][-_MAX_EARLIER_DOCUMENTS:], []
        self.aircraft_folders |= new_session.aircraft_folders
        self.replaced_settings, self.must_autosave, self.unused_text = replaced_settings, False, ""
        if first_autosave_file is not None:
            self.restore(self.autosave_path(first_autosave_file), settings)

    def _opened_state(self) -> _OpenedState:
        """Return the document with its context and history, to restore it later."""
        return self.document, self.context, self.history

    def _restore_state(self, opened_state: _OpenedState) -> None:
        """Make a document current, with its context and history.

        If the mission cannot be judged, an error is raised and nothing is changed.
        """
        _, context, history = opened_state
        judged_mission = context.judge(history.mission)
        self.document, self.context, self.history = opened_state
        self.judged, self.plans = judged_mission, ([], None)
        self.rev, self.world_rev = self.rev + 1, self.world_rev + 1
        self.document_rev += 1

    def _add_to_history(self, mission: Mission, text: str, parameters: tuple[ParameterChange, ...] = ()) -> None:
        """Record an edit, and discard documents whose opening was undone.

        mission: the mission that the edit made.
        text: description of the edit.
        parameters: autopilot parameters that the edit changed.
        """
        self.history.add(mission, text, parameters)
        self.undone_states = []

    @property
    def undo_text(self) -> str:
        """Description of the edit or of the opening that the next undo undoes; "" if there is nothing to undo."""
        return self.history.undo_text or (f"open {self.document.name}" if self.earlier_states else "")

    @property
    def redo_text(self) -> str:
        """Description of the edit or of the opening that the next redo restores.

        It is "" if there is nothing to redo.
        """
        return self.history.redo_text or (f"open {self.undone_states[-1][0].name}" if self.undone_states else "")

    @property
    def mission(self) -> Mission:
        """Current mission."""
        return self.history.mission

    @property
    def is_changed(self) -> bool:
        """True if the mission differs from the opened mission."""
        return self.mission is not self.history.first

    @property
    def is_edited(self) -> bool:
        """True if the mission was ever edited, even if all edits were undone."""
        return self.is_changed or bool(self.history.steps)

    @property
    def file_kind(self) -> str:
        """Format of the file that saving the mission may overwrite; "" without one."""
        return self.document.kind if self.document.path is not None else ""

    @property
    def is_unsaved(self) -> bool:
        """True if the mission differs from the mission in the file."""
        return self.mission != self.history.saved

    # ------------------------------------------------------------------
    # Edits.

    def edit(self, message: Edit) -> None:
        """Apply an edit to the mission, judge the mission, and record the edit for undo.

        Raises StaleEdit for an edit of an older revision, and MissionError if the edited mission would be invalid; in
        both cases nothing is changed.
        """
        if message.rev != self.rev:
            raise StaleEdit
        context, mission, values = self.context, self.mission, {}
        match message:
            case Move():
                item = edits.movable_item(mission, message.k)
                mission = self._move_item(message.k, message.east, message.north, message.up)
                text = f"move item {item.seq}"
            case Insert():
                # The altitude is the mean of the previous and next item's altitudes if both have the same frame, and
                # otherwise the previous item's altitude.
                place_indices = edits.movable_indices(mission)
                previous_item = edits.movable_item(mission, message.after)
                altitude, position = None, place_indices.index(message.after)
                if position + 1 < len(place_indices):
                    next_item = mission.items[place_indices[position + 1]]
                    has_same_frame = next_item.frame == previous_item.frame and next_item.command not in LANDINGS
                    mean_altitude = 0.5 * (previous_item.alt + next_item.alt)
                    altitude = mean_altitude if has_same_frame and np.isfinite(mean_altitude) else None
                lat, lon = context.to_geographic(message.east, message.north)
                new_mission = edits.insert_waypoint(mission, message.after, lat, lon, altitude)
                mission = context.with_updated_radii(new_mission, edits.insertion_index(mission, message.after))
                text = f"insert an item after {previous_item.seq}"
            case Delete():
                deleted_indices = set(message.ks)
                for index in sorted(deleted_indices, reverse=True):
                    mission = edits.delete_item(mission, index)
                    place_indices = edits.movable_indices(mission)
                    nearest_index = min(place_indices, key=lambda place_index: abs(place_index - index))
                    mission = context.with_updated_radii(mission, nearest_index)
                text = f"delete {count_text(len(deleted_indices), 'item')}"
            case Raise():
                # Landings are raised only if all of the items are landings.
                requested = edits.movable_indices(mission) if message.ks is None else tuple(message.ks)
                airborne = tuple(
                    index for index in requested if edits.movable_item(mission, index).command not in LANDINGS
                )
                indices = airborne or requested
                mission = edits.raise_items(mission, indices, message.by)
                items_text = "all items" if message.ks is None else count_text(len(indices), "item")
                text = f"{'raise' if message.by >= 0.0 else 'lower'} {items_text} by {abs(message.by):g} m"
            case Apply():
                # The suggestion must have passed a trial on this revision.
                tried = self.tried.get("flown" if message.flown else "geometric")
                changes = tried.changes if tried and tried.rev == self.rev else {}
                change = changes.get((message.finding, message.which))
                if change is None:
                    raise MissionError(f"{self.document.name}: that suggestion no longer exists", field="suggestion")
                changed_mission, suggestion = change
                values = suggested_parameters(suggestion)
                moves = item_moves(context, mission, changed_mission)
                findings = self.judged.verdict.findings
                source = "the flight" if message.flown else rule_word(findings[message.finding].rule)
                is_move_only = moves and not values
                edit_text = f"move {moves_text(moves)}" if is_move_only else suggestion_text(without_trial(suggestion))
                text = f"apply a suggestion of {source}: {edit_text}"
                mission = replace(changed_mission, autopilot=mission.autopilot)
        old_values = context.parameters.values
        self._set_mission(mission, self._context_with_parameters(values))
        parameter_changes = (ParameterChange(name, old_values.get(name), value) for name, value in values.items())
        self._add_to_history(mission, text, tuple(parameter_changes))

    def _context_with_parameters(self, values: Mapping[str, float | None]) -> EditContext:
        """Return the editing context with other parameter values.

        Names that the autopilot does not have are ignored.

        values: value by name; None resets a parameter that was set in the studio.
        """
        parameters = self.context.uav.autopilot.parameters
        known_names = () if parameters is None else {parameter.name for parameter in parameters.values}
        known_values = {name: value for name, value in values.items() if name in known_names}
        if not known_values:
            return self.context
        return self.context.with_settings(self.context.scenario, self.context.parameters.with_values(known_values))

    def step_history(self, kind: str) -> None:
        """Undo, redo, or revert to the mission in the file.

        Do nothing if there is nothing to undo, redo or revert.

        kind: "undo", "redo" or "revert".

        Raises PlanflyError if the file to revert to has changed and cannot be read.
        """
        if kind == "revert":
            # The mission of a file that another program has changed becomes the saved mission.
            path = self.document.path
            if path and self.file_kind and not (path.exists() and path.read_bytes() == self.document.on_disk):
                changed_document = open_document(str(path), self.options)
                self.history.saved = changed_document.setup.mission
                self.document = replace(self.document, on_disk=changed_document.on_disk)
            if self.is_unsaved:
                self._set_mission(self.history.saved)
                self._add_to_history(self.history.saved, "revert to the file")
            return
        if kind == "undo" and not self.history.undo_text and self.earlier_states:
            current_state = self._opened_state()
            self._restore_state(self.earlier_states[-1])
            self.earlier_states, self.undone_states = self.earlier_states[:-1], [*self.undone_states, current_state]
            return
        if kind == "redo" and not self.history.redo_text and self.undone_states:
            current_state = self._opened_state()
            self._restore_state(self.undone_states[-1])
            self.earlier_states, self.undone_states = [*self.earlier_states, current_state], self.undone_states[:-1]
            return
        previous_position = self.history.position
        has_moved = self.history.undo() if kind == "undo" else self.history.redo()
        try:
            if has_moved:
                changes = self.history.steps[min(previous_position, self.history.position)].parameters
                values = {change.name: change.old if kind == "undo" else change.new for change in changes}
                self._set_mission(self.mission, self._context_with_parameters(values))
        except Exception:
            self.history.position = previous_position
            raise

    def judge_drag(self, message: Drag) -> Json:
        """Judge the mission with an item dragged to another position, without changing the mission.

        Returns page data of the route near the item, or of the whole mission on request.  Raises StaleEdit if the
        message refers to an outdated mission.
        """
        if message.rev != self.rev:
            raise StaleEdit
        mission = self._move_item(message.k, message.east, message.north, message.up)
        if not message.whole:
            return windows_json(mission, *judge_windows(self.context, mission, message.k, self.judged.setup))
        judged_mission = self.context.judge(mission)
        return {"sheet": mission_json(self.context, judged_mission)}

    def replace_plan(self, message: Choose) -> None:
        """Replace the mission, or its items between two items, by a planned path.

        Raises StaleEdit if the message refers to an outdated mission, and PlanflyError if the path no longer exists.
        """
        if message.rev != self.rev:
            raise StaleEdit
        plans, item_range = self.plans
        if not 0 <= message.which < len(plans):
            raise PlanflyError("that path no longer exists: plan again", field="which")
        plan = plans[message.which]
        if item_range is None:
            # The certificate of the plan applies until the next edit.
            mission = planned_mission(plan, self.context.planning_uav(self.mission))
            self._set_mission(mission, self.context.with_plan(plan, mission))
            self._add_to_history(mission, f"plan with seed {plan.seed}")
            return
        first, last = item_range
        mission = self.mission
        for index in [index for index in edits.movable_indices(mission) if first < index < last][::-1]:
            mission = edits.delete_item(mission, index)
        new_waypoints = plan.waypoints[1:-1]
        lats, lons = to_geo(self.context.scenario.origin, new_waypoints[:, 0], new_waypoints[:, 1])
        inserted_index = first
        for lat, lon, altitude in zip(lats.tolist(), lons.tolist(), new_waypoints[:, 2].tolist(), strict=True):
            previous_index, inserted_index = inserted_index, edits.insertion_index(mission, inserted_index)
            mission = edits.insert_waypoint(mission, previous_index, lat, lon)
            position = edits.movable_indices(mission).index(inserted_index)
            current_altitude = float(self.context.item_positions(mission)[position, 2])
            mission = edits.set_altitude(mission, inserted_index, altitude, current_altitude)
        place_indices = edits.movable_indices(mission)
        for index in place_indices[place_indices.index(first) : place_indices.index(inserted_index) + 2]:
            mission = self.context.with_updated_radii(mission, index)
        self._set_mission(mission)
        self._add_to_history(mission, "plan a part")

    def _set_mission(self, mission: Mission, context: EditContext | None = None) -> None:
        """Judge a mission, make it the current mission, and discard planned paths.

        The revision is increased, and the revision of the world, too, if the editing context changes.  An invalid
        mission raises PlanflyError, and changes nothing.

        context: the editing context to judge the mission with; None for the current context.
        """
        context = (self.context if context is None else context).with_area_around_mission(mission)
        judged_mission = context.judge(mission)
        if context is not self.context:
            self.world_rev += 1
        self.context, self.judged = context, judged_mission
        self.plans = ([], None)
        self.rev += 1

    def _move_item(self, index: int, east: float | None, north: float | None, altitude: float | None) -> Mission:
        """Return the mission with an item moved on the map, to another altitude, or both.

        index: index of the item.
        east, north: new map position, m; the item stays there if one of them is None.
        altitude: new altitude, m AMSL; None keeps the altitude.
        """
        mission = self.mission
        edits.movable_item(mission, index)
        if east is not None and north is not None:
            mission = edits.move_item(mission, index, *self.context.to_geographic(east, north))
        if altitude is not None:
            current_altitude = float(
                self.context.item_positions(mission)[edits.movable_indices(mission).index(index), 2]
            )
            mission = edits.set_altitude(
                mission, index, altitude, current_altitude if np.isfinite(current_altitude) else altitude
            )
        return mission if mission is self.mission else self.context.with_updated_radii(mission, index)

    def item_position(self, index: int) -> tuple[float, float, float]:
        """Return east, north and altitude AMSL of the item with an index, m.

        Raises MissionError if the item has no position.
        """
        edits.movable_item(self.mission, index)
        east, north, altitude = self.context.item_positions(self.mission)[
            edits.movable_indices(self.mission).index(index)
        ].tolist()
        return east, north, altitude

    # ------------------------------------------------------------------
    # The world.

    def change_settings(self, settings: Settings) -> None:
        """Change the settings, and judge the mission with them.

        Raises PlanflyError, which names settings by their labels on the page, for a value that is not allowed.
        """
        try:
            scenario = apply_scenario_settings(self.context.scenario, settings, self.aircraft_folders)
            if settings.autopilot is not None and settings.autopilot != self.context.uav.autopilot.name:
                self.named_parameters |= autopilot_parameters(self.context.scenario, self.context.uav)
                scenario = with_flight(scenario, **self.named_parameters.get(settings.autopilot, {}))
            parameters = apply_parameter_settings(self.context.parameters, scenario, settings)
            context = self.context.with_settings(scenario, parameters)
            judged_mission = context.judge(self.mission)
        except PlanflyError as error:
            raise error_in_page_words(error, settings, self.context.scenario.name) from error
        self.context, self.judged, self.plans = context, judged_mission, ([], None)
        self.rev, self.world_rev = self.rev + 1, self.world_rev + 1

    def settings_json(self) -> Json:
        """Return the current settings as page data."""
        return settings_json(self.context.scenario, self.context.uav, self.context.parameters, self.aircraft_folders)

    # ------------------------------------------------------------------
    # Page data, and files.

    def mission_message(self) -> Json:
        """Return the message to the pages with the current mission and its geometric verdict.

        It also has the texts of undo and redo, the notes, and the suggestions that passed their trials, if any.
        """
        tried = self.tried.get("geometric")
        return {
            "kind": "sheet",
            "rev": self.rev,
            "name": self.document.name,
            "document": self.document_rev,
            "unsaved": self.is_unsaved,
            "undo": self.undo_text,
            "redo": self.redo_text,
            "over": self.file_kind,
            "planned": self.judged.setup.plan is not None,
            "notes": [
                *filter(None, [self.unused_text, self.replaced_text]),
                *self.mission.warnings,
                *self.judged.setup.notes,
            ],
            **mission_json(self.context, self.judged),
            **({"findings": tried.findings} if tried is not None and tried.rev == self.rev else {}),
        }

    @property
    def replaced_text(self) -> str:
        """Text on the autosaved settings that were not restored; "" if all were restored."""
        if not self.replaced_settings:
            return ""
        outcome_text = "replaced by options of the command" if self.must_autosave else "not used"
        return f"autosaved settings {outcome_text}: {'; '.join(self.replaced_settings)}"

    def world_message(self) -> Json:
        """Return the message to the pages with the map, threats, zones and settings."""
        return {
            "kind": "world",
            "world": self.world_rev,
            **world_json(self.context, self.judged.setup),
            "settings": self.settings_json(),
        }

    def save(self, form: str) -> SavedFile:
        """Return the mission as a file to download.

        If there is no file to overwrite, the mission is then considered saved, unless the download is only a map or a
        parameter file.

        form: format, a key of `SAVED_SUFFIXES`.
        Raises PlanflyError if the format cannot store the mission.
        """
        saved_file = save_document(self.document, self.context, self.judged, form)
        if form in KINDS and form != "kml" and not self.file_kind:
            self.history.saved = self.mission
        return saved_file

    def overwrite_file(self) -> SavedFile:
        """Overwrite the mission file that the studio was started with; return the new file.

        Raises PlanflyError if the studio was started without a mission file, if another program has changed it, or if
        its format cannot store the mission.
        """
        path = self.document.path
        if path is None or not self.file_kind:
            raise PlanflyError("the studio was started without a mission file: save as a new file", field="over")
        if path.exists() and path.read_bytes() != self.document.on_disk:
            message = f"{path.name} was changed by another program since it was opened: save it under another name"
            raise PlanflyError(message, file=path)
        saved_file = self.save(self.file_kind)
        write_atomically(path, saved_file.data)
        self.history.saved = self.mission
        self.document = replace(self.document, on_disk=saved_file.data)
        # The next autosave knows the new file.
        self.autosaved_rev = 0
        return saved_file

    # ------------------------------------------------------------------
    # Autosave, in case the server dies.

    @property
    def needs_autosave(self) -> bool:
        """True if the session has something to save.

        That is an edit, other settings than the opened document, or an autosave to be replaced.
        """
        has_notes = self.must_autosave or bool(self.unused_text)
        return self.is_edited or has_notes or self.context.scenario is not self.document.setup.scenario

    def autosave_path(self, file: Path) -> Path:
        """Return the autosave path of the current document.

        file: autosave path of the first document; other documents get another file in its folder.
        """
        is_first = self.document.path is not None or not self.earlier_states
        return file if is_first else sibling_autosave_path(file, self.history.first)

    def autosave(self, first_autosave_file: Path) -> None:
        """Write the autosave file of the current document if anything has changed since the last autosave.

        first_autosave_file: autosave path of the first document.  A file that could not be read is not overwritten.
        """
        if self.autosaved_rev == self.rev:
            return
        file = self.autosave_path(first_autosave_file)
        if file in self.unreadable:
            return
        file.parent.mkdir(parents=True, exist_ok=True)
        plan = self.judged.setup.plan
        is_in_file = bool(self.file_kind) and not self.is_unsaved
        text = autosave_text(self.context, self.document, self.history, plan, is_in_file=is_in_file)
        write_atomically(file, text)
        self.autosaved_rev = self.rev

    def restore(self, file: Path, settings: Json | None = None) -> bool:
        """Restore the autosaved edits and settings of this document; return True if they changed anything.

        If the mission file has changed since the autosave, only the settings are restored, and an autosave with unsaved
        edits is set aside. An autosave that cannot be read is added to `unreadable`, and is neither restored nor
        overwritten.

        settings: current settings, which replace the autosaved ones and the command's options; None for a new session.
        """
        previous_state = self.context, self.judged, self.plans
        try:
            options = self.options if settings is None else MissionOptions()
            autosave = read_autosave(file, self.context, self.document, options, settings)
            if autosave is None:
                return False
            mission, context, steps, undone_steps, replaced_settings, self.must_autosave, unused_edits = autosave
            is_edited = mission is not self.history.first
            if is_edited or context is not self.context:
                self._set_mission(mission, context)
                json.dumps(self.mission_message(), allow_nan=False)
        except (*INTERNAL, PlanflyError):
            self.context, self.judged, self.plans = previous_state
            self.must_autosave = False
            self.unreadable.append(file)
            return False
        self.aircraft_folders |= own_aircraft(self.context.scenario)
        self.replaced_settings = replaced_settings or self.replaced_settings
        if unused_edits:
            try:
                kept_file = set_autosave_aside(file)
            except OSError:
                self.unreadable.append(file)
                kept_file = file
            subject = "mission" if self.document.path is None else "mission file"
            verb = "was" if unused_edits == 1 else "were"
            edits_text = f"{count_text(unused_edits, 'earlier edit')} {verb} set aside in {kept_file}"
            self.unused_text = f"the {subject} has changed since its last edit in the studio; {edits_text}"
            return False
        if is_edited or any(step.parameters for step in steps):
            self.history.steps = steps[:-1]
            self.history.position = len(self.history.steps)
            # An autosave of an older version has no steps.
            text = steps[-1].text if steps else "the edits of the previous session"
            self._add_to_history(mission, text, steps[-1].parameters if steps else ())
        self.history.steps += undone_steps
        return is_edited or context is not previous_state[0]


def open_session(target: str, options: MissionOptions, autosave_file: Path | None = None) -> tuple[Session, bool]:
    """Open the target of the command; return the session, and True if an autosave changed it.

    target: name of a scenario, or path of a file.
    options: options of the command.
    autosave_file: autosave path of the document; None to restore nothing.
    Raises PlanflyError if the target cannot be opened.
    """
    session = Session.from_document(open_document(target, options), options)
    return session, autosave_file is not None and session.restore(autosave_file)
