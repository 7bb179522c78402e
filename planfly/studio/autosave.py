"""Save the mission, settings and plan of a session automatically, in case the server dies.

An autosave is restored only into its own document, which is identified by its mission as opened, or by the mission file
that the studio has written.  Options of the command line take precedence over the saved settings.
"""

import hashlib
import json
import math
from dataclasses import asdict, replace
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

from flight.mission.items import MAX_BYTES, Home, Mission, MissionItem, item_problem
from planfly.flight_options import MissionOptions
from planfly.studio.documents import Document, planned_mission
from planfly.studio.edit_context import EditContext
from planfly.studio.history import History, ParameterChange, Step
from planfly.studio.settings import ChangedParameters
from planfly.studio.view_model import Json
from planfly.studio.worker_process import INTERNAL
from planner.plan import Plan, parse_plan, plan_json
from world.errors import PlanflyError
from world.files import read_small_file, utf8_text
from world.scenario import Scenario, scenario_from_spec
from world.scenario_tables import names_folder

_SCHEMA = "planfly.studio/1"
# Maximum size of an autosave with two missions, a plan and the settings, bytes.
_MAX_AUTOSAVE_BYTES = 16 * MAX_BYTES
# Maximum number of undone edits that are saved.
_MAX_UNDONE_STEPS = 8
# Maximum number of edits in effect that are saved.
_MAX_SAVED_STEPS = 100
# Maximum number of items in the missions of these edits; the newest edit is always saved.
_MAX_SAVED_ITEMS = 10_000
# Tables of a scenario that the studio changes.
_SAVED_TABLES = ("wind", "flight", "limits", "area")
_AUTOPILOT_KEYS = ("autopilot", "autopilot_from", "params", "arduplane_version", "px4_version", "guidance")
# Entries of a scenario that an option of the command line sets: their table and keys.
_OPTION_ENTRIES = {
    "wind": ("wind", ("speed_mps", "from_deg")),
    "turbulence": ("wind", ("turbulence",)),
    "aircraft": ("flight", ("aircraft", "aircraft_by_default")),
    "airspeed": ("flight", ("airspeed_mps",)),
    "params": ("flight", _AUTOPILOT_KEYS),
    "autopilot": ("flight", _AUTOPILOT_KEYS),
    "guidance": ("flight", _AUTOPILOT_KEYS),
    "nav": ("flight", ("nav",)),
}
# Entries that belong to an aircraft, and are not kept for another aircraft.
_AIRCRAFT_KEYS = ("airspeed_mps", "battery_wh")


class Restored(NamedTuple):
    """State of a session that was restored from an autosave.

    mission: the edited mission, which is the opened mission itself if it was not edited.
    context: editing context with the saved settings.
    steps: edits in effect; the last one results in the edited mission.
    undone_steps: undone edits after the edited mission, for redo.
    replaced: saved settings that are not restored, each with the reason or the value that replaces it.
    by_options: True if options of the command line replaced saved settings, so that the autosave is written again.
    unused_edits: number of unsaved edits that are not restored, because the mission file has changed.
    """

    mission: Mission
    context: EditContext
    steps: list[Step]
    undone_steps: list[Step]
    replaced: tuple[str, ...] = ()
    by_options: bool = False
    unused_edits: int = 0


def autosave_text(
    context: EditContext, document: Document, history: History, plan: Plan | None, *, is_in_file: bool
) -> str:
    """Return the JSON text of a session's autosave file.

    Of the edits in effect the newest are saved, see `_steps_to_save`; of the undone edits, the first
    `_MAX_UNDONE_STEPS`.

    context: editing context with the settings of the session.
    document: the opened document.
    history: the edited mission, and the edits that were undone.
    plan: the plan of the mission, or None if the mission was changed after planning.
    is_in_file: True if the file of the document contains the edited mission.
    """
    data = {
        "schema": _SCHEMA,
        "name": document.name,
        "mission": mission_data(history.mission),
        "steps": [_step_data(step) for step in _steps_to_save(document, history)],
        "undone": [_step_data(step) for step in history.steps[history.position :][:_MAX_UNDONE_STEPS]],
        "first": mission_data(document.setup.mission),
        "file": _file_digest(document),
        "in_file": is_in_file,
        **settings_data(context),
        "planned": context.planned,
        "plan": None if plan is None else plan_json(plan),
    }
    return json.dumps(data)


def settings_data(context: EditContext) -> Json:
    """Return plain data of an editing context.

    They are the name of the scenario, its settings, and the changed parameters.
    """
    spec = context.scenario.to_json()
    # An area made around a mission is not saved; it is made again when the mission is restored.
    names = [table for table in _SAVED_TABLES if table in spec and (table != "area" or not context.scenario.external)]
    data = {
        "scenario": _scenario_name(context),
        "settings": {table: spec[table] for table in names},
        "parameters": asdict(context.parameters),
    }
    return dict(json.loads(json.dumps(data)))


def _step_data(step: Step) -> list[Any]:
    """Convert an edit to plain data, which `_step_from_data` converts back."""
    return [mission_data(step.mission), step.text, [list(change) for change in step.parameters]]


def _step_from_data(data: list[Any], opened_mission: Mission) -> Step:
    """Return the edit of data from `_step_data`; older versions of planfly wrote no parameters.

    opened_mission: mission from which the fields that are not in the data are taken.
    """
    mission, text, *parameters = data
    changes = (ParameterChange(*change) for change in (parameters[0] if parameters else ()))
    return Step(mission_from_data(mission, opened_mission), str(text), tuple(changes))


def _steps_to_save(document: Document, history: History) -> list[Step]:
    """Return the newest edits in effect that an autosave contains.

    Edits before the last saving of the document's file are left out, because the file contains their result.
    """
    steps = history.steps[: history.position]
    saved_steps = [k for k, step in enumerate(history.steps) if step.mission is history.saved]
    if document.path is not None and saved_steps:
        steps = steps[saved_steps[-1] + 1 :] or steps[-1:]
    item_counts = accumulate(len(step.mission.items) for step in reversed(steps))
    count = sum(total <= _MAX_SAVED_ITEMS for total in item_counts)
    return steps[-max(1, min(count, _MAX_SAVED_STEPS)) :]


def _file_digest(document: Document) -> str:
    """Return a digest of the file of a document as it was last read or written; "" without a file."""
    return hashlib.sha256(document.on_disk).hexdigest() if document.on_disk else ""


def _scenario_name(context: EditContext) -> str:
    """Return the name of the scenario that the user named; "" for a scenario made around the mission."""
    return "" if context.scenario.external else context.scenario.name


def read_autosave(
    file: Path, context: EditContext, document: Document, options: MissionOptions, settings: Json | None = None
) -> Restored | None:
    """Return the state of a session from its autosave.

    Return None if there is no file, or if it has another schema.

    If the opened mission is not the mission in which the edits were made, only the settings are restored.  If the
    settings cannot be restored, only the mission is restored.

    context: editing context of the opened document, before the saved settings.
    options: options of the command line, which replace saved settings.
    settings: settings of the session, which replace all saved settings of the same scenario; None for a new session.
    Raises one of `INTERNAL` or PlanflyError for a file that cannot be read.
    """
    if not file.exists():
        return None
    data = json.loads(
        utf8_text(read_small_file(file, _MAX_AUTOSAVE_BYTES, "session", PlanflyError), file, PlanflyError)
    )
    opened_mission = document.setup.mission
    is_same_file = bool(document.on_disk) and data.get("file") == _file_digest(document)
    if data["schema"] != _SCHEMA:
        return None
    unused_edits = 0
    if data["first"] != mission_data(opened_mission) and not is_same_file:
        is_unsaved = data["mission"] != data["first"] and data.get("in_file") is not True
        unused_edits = max(1, len(data.get("steps", []))) if is_unsaved else 0
        data |= {"mission": mission_data(opened_mission), "steps": [], "undone": [], "plan": None}
    if settings is not None and settings["scenario"] == data.get("scenario"):
        # The certificate of a plan applies only to the settings for which it was made.
        has_same_settings = all(data.get(key) == value for key, value in settings.items())
        data |= settings | ({} if has_same_settings else {"plan": None})
    is_opened = data["mission"] == mission_data(opened_mission) or (is_same_file and data.get("in_file") is True)
    mission = opened_mission if is_opened else mission_from_data(data["mission"], opened_mission)
    steps, undone_steps = (
        [_step_from_data(step, opened_mission) for step in data.get(name, [])] for name in ("steps", "undone")
    )
    try:
        new_context, replaced = restore_settings(context, data, options)
        restored_mission, restored_context = mission, new_context
        if data.get("plan") and not replaced:
            new_scenario = new_context.scenario
            plan = replace(parse_plan(data["plan"], "kept", ground=new_scenario.terrain), scenario=new_scenario)
            plan_mission = planned_mission(plan, new_context.planning_uav(mission))
            # The autosave contains all digits, so different items mean that the mission was changed after planning.
            if plan_mission.items == mission.items:
                restored_mission, restored_context = plan_mission, new_context.with_plan(plan, plan_mission)
        by_options = bool(replaced) and data.get("scenario") == _scenario_name(context)
        return Restored(restored_mission, restored_context, steps, undone_steps, replaced, by_options, unused_edits)
    except (*INTERNAL, PlanflyError) as error:
        # If the settings cannot be restored, restore at least the edited mission.
        reason = f"none of them can be restored: {error}"
        return Restored(mission, context, steps, undone_steps, (reason,), unused_edits=unused_edits)


def set_autosave_aside(file: Path) -> Path:
    """Rename an autosave file so that it is kept; return its new path, which has a digest in its name."""
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:8]
    return file.replace(file.with_name(f"{file.stem}-earlier-{digest}{file.suffix}"))


def sibling_autosave_path(file: Path, opened_mission: Mission) -> Path:
    """Return the autosave path for a document opened later, named by a digest of its mission.

    file: autosave path of the first document, in the same folder.
    opened_mission: the mission as it was opened.
    """
    digest = hashlib.sha256(json.dumps(mission_data(opened_mission)).encode()).hexdigest()[:8]
    return file.with_name(f"{file.stem}-{digest}{file.suffix}")


def restore_settings(
    context: EditContext, data: Json, options: MissionOptions, *, file_autopilot: bool = False
) -> tuple[EditContext, tuple[str, ...]]:
    """Return the editing context with the saved settings.

    Also return texts on saved settings that were not restored.

    The context is `context` itself if the settings do not differ, or belong to another scenario.

    data: saved settings, as from `settings_data`.
    options: options of the command line, which replace saved settings.
    file_autopilot: True if the autopilot of the opened file replaces the saved autopilot.
    """
    scenario: Scenario = context.scenario
    scenario_name = data.get("scenario", _scenario_name(context))
    if scenario_name != _scenario_name(context):
        return context, (f"all of them, which belong to {scenario_name or 'the mission without a scenario'}",)
    spec, saved = json.loads(json.dumps(scenario.to_json())), data.get("settings", {})
    new_spec = spec | {table: dict(value) for table, value in saved.items() if table in _SAVED_TABLES}
    replaced: list[str] = []
    for option, (table, keys) in _OPTION_ENTRIES.items():
        if options.get(option) is not None:
            aircraft = new_spec.setdefault(table, {}).get("aircraft"), spec.get(table, {}).get("aircraft")
            if option == "aircraft" and not _is_same_value(*aircraft):
                keys = (*keys, *_AIRCRAFT_KEYS)
            replaced += _replace_entries(new_spec, spec, table, keys)
    flight = spec.get("flight", {})
    is_other_autopilot = flight.get("autopilot") != new_spec.get("flight", {}).get("autopilot")
    if file_autopilot and "autopilot_from" in flight and is_other_autopilot:
        replaced += _replace_entries(new_spec, spec, "flight", _AUTOPILOT_KEYS)
    saved_parameters = data.get("parameters") or asdict(ChangedParameters())
    parameters = ChangedParameters(
        dict(saved_parameters["values"]),
        saved_parameters["file"],
        tuple(saved_parameters["unused"]),
        tuple(saved_parameters.get("typed", ())),
    )
    # As in the studio, a parameter file replaces all parameters, and another autopilot has other parameters.
    has_other_autopilot = any(text.startswith("autopilot ") for text in replaced)
    if parameters.values and (options.get("params") is not None or has_other_autopilot):
        replaced += [f"parameter {name} {value:g}" for name, value in parameters.values.items()]
        parameters = ChangedParameters()
    if new_spec == spec and parameters == context.parameters:
        new_context = context
    else:
        new_context = context.with_settings(
            scenario_from_spec(new_spec, scenario.name, ground=scenario.terrain, external=scenario.external), parameters
        )
    is_planned = new_context.planned or not data.get("planned")
    return new_context if is_planned else replace(new_context, planned=True), tuple(replaced)


def _replace_entries(saved_spec: Json, opened_spec: Json, table: str, keys: tuple[str, ...]) -> list[str]:
    """Replace entries in a table of a saved scenario, in place, by the entries of the opened scenario.

    Returns a text with both values for each entry that was different.

    table: name of the table, such as "flight".
    keys: keys of the entries in this table.
    """
    replaced, saved, opened = [], saved_spec.setdefault(table, {}), opened_spec.get(table, {})
    for key in keys:
        old_value, new_value = saved.pop(key, None), opened.get(key)
        if new_value is not None:
            saved[key] = new_value
        if not _is_same_value(old_value, new_value) and key not in ("aircraft_by_default", "autopilot_from"):
            name = {"speed_mps": "wind", "from_deg": "wind from", "airspeed_mps": "airspeed"}.get(key)
            replaced.append(f"{name or key.replace('_', ' ')} {_value_text(old_value)} \u2192 {_value_text(new_value)}")
    return replaced


def _is_same_value(first: object, second: object) -> bool:
    """Return True if two entries of a scenario are equal, or name the same folder."""
    if isinstance(first, str) and isinstance(second, str) and names_folder(first) and names_folder(second):
        return Path(first).resolve() == Path(second).resolve()
    return first == second


def _value_text(value: object) -> str:
    """Return a number or a text of a scenario as text.

    A path is reduced to its name, and None becomes "none".
    """
    return "none" if value is None else Path(value).name if isinstance(value, str) else f"{value:g}"


def mission_data(mission: Mission) -> Json:
    """Convert a mission to plain data, which `mission_from_data` converts back.

    NaN becomes None.
    """

    def none_if_nan(number: float) -> float | None:
        """Return None for NaN, and any other number unchanged."""
        return None if math.isnan(number) else number

    def item_data(item: MissionItem) -> list[Any]:
        """Return the fields of an item, with None for NaN."""
        numbers = map(none_if_nan, (*item.params, item.lat_deg, item.lon_deg, item.alt))
        return [item.seq, item.command, item.frame, *numbers, item.autocontinue]

    home = mission.home
    return {
        "home": None if home is None else [home.lat_deg, home.lon_deg, none_if_nan(home.alt)],
        "items": [item_data(item) for item in mission.items],
    }


def mission_from_data(data: Json, opened_mission: Mission) -> Mission:
    """Make a mission from the data of `mission_data`.

    opened_mission: mission from which the fields that are not in the data are taken.

    Raises ValueError, LookupError or TypeError for other data.
    """

    def to_number(value: Any) -> float:
        """Return a stored number; None becomes NaN."""
        return float("nan") if value is None else float(value)

    items = [
        MissionItem(
            int(seq),
            int(command),
            int(frame),
            (values[0], values[1], values[2], values[3]),
            values[4],
            values[5],
            values[6],
            bool(autocontinue),
        )
        for seq, command, frame, *numbers, autocontinue in data["items"]
        for values in [[to_number(value) for value in numbers]]
    ]
    for item in items:
        if (problem := item_problem(item)) is not None:
            raise ValueError(f"item {item.seq}: {problem}")
    home = data["home"]
    return replace(
        opened_mission, items=tuple(items), home=None if home is None else Home(*(to_number(value) for value in home))
    )
