"""Save the mission, settings and plan of a session automatically, in case the server dies.

An autosave is restored only into its own document, which is identified by its first mission, or by the file that the
studio has written over it.
"""

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from flight.mission.items import MAX_BYTES, Home, Mission, MissionItem, item_problem
from planfly.studio.documents import Document, planned_mission
from planfly.studio.edit_context import EditContext
from planfly.studio.settings import ChangedParameters
from planfly.studio.view_model import Json
from planfly.studio.worker_process import INTERNAL
from planner.plan import Plan, parse_plan, plan_json
from world.errors import PlanflyError
from world.files import read_small_file, utf8_text
from world.scenario import Scenario, scenario_from_spec

_SCHEMA = "planfly.studio/1"
# Maximum size of an autosave with two missions, a plan and the settings, bytes.
_MAX_AUTOSAVE_BYTES = 4 * MAX_BYTES
# Tables of a scenario that the studio changes.
_SAVED_TABLES = ("wind", "flight", "limits", "area")


def autosave_text(
    context: EditContext, document: Document, mission: Mission, plan: Plan | None, *, is_in_file: bool
) -> str:
    """Encode the state of a session as the JSON text of its autosave file.

    context: editing context with the settings of the session.
    document: the opened document.
    mission: the edited mission.
    plan: the plan of the mission, or None if the mission was changed after planning.
    is_in_file: True if the file of the document contains the edited mission.
    """
    spec = context.scenario.to_json()
    # An area made around a mission is not saved; it is made again when the mission is restored.
    names = [table for table in _SAVED_TABLES if table in spec and (table != "area" or not context.scenario.external)]
    data = {
        "schema": _SCHEMA,
        "name": document.name,
        "mission": mission_data(mission),
        "first": mission_data(document.setup.mission),
        "file": _file_digest(document),
        "in_file": is_in_file,
        "settings": {table: spec[table] for table in names},
        "parameters": asdict(context.parameters),
        "planned": context.planned,
        "plan": None if plan is None else plan_json(plan),
    }
    return json.dumps(data)


def _file_digest(document: Document) -> str:
    """Return a digest of the file of a document as it was last read or written; "" without a file."""
    return hashlib.sha256(document.on_disk).hexdigest() if document.on_disk else ""


def read_autosave(file: Path, context: EditContext, document: Document) -> tuple[Mission, EditContext] | None:
    """Return the saved mission and its editing context, or None if nothing is to be restored.

    Nothing is restored without a file, from the autosave of another mission, and from an autosave that equals the
    opened document.
    Raises one of `INTERNAL` or PlanflyError for a file that cannot be read.
    """
    if not file.exists():
        return None
    data = json.loads(
        utf8_text(read_small_file(file, _MAX_AUTOSAVE_BYTES, "session", PlanflyError), file, PlanflyError)
    )
    first = document.setup.mission
    is_same_file = bool(document.on_disk) and data.get("file") == _file_digest(document)
    if data["schema"] != _SCHEMA or (data["first"] != mission_data(first) and not is_same_file):
        return None
    is_opened = data["mission"] == mission_data(first) or (is_same_file and data.get("in_file") is True)
    mission = first if is_opened else mission_from_data(data["mission"], first)
    try:
        restored = _restore_plan(_restore_settings(context, data), mission, data)
    except (*INTERNAL, PlanflyError):
        # If the settings cannot be restored, restore at least the edited mission.
        restored = mission, context
    return None if restored[0] is first and restored[1] is context else restored


def sibling_autosave_path(file: Path, first: Mission) -> Path:
    """Return the autosave path for a document opened later, named by a digest of its mission.

    file: autosave path of the first document, in the same folder.
    first: the mission that was opened.
    """
    digest = hashlib.sha256(json.dumps(mission_data(first)).encode()).hexdigest()[:8]
    return file.with_name(f"{file.stem}-{digest}{file.suffix}")


def _restore_settings(context: EditContext, data: Json) -> EditContext:
    """Return the editing context with the saved settings.

    Returns `context` itself if the settings do not differ.
    """
    scenario: Scenario = context.scenario
    spec, saved = json.loads(json.dumps(scenario.to_json())), data.get("settings", {})
    saved_parameters = data.get("parameters") or asdict(ChangedParameters())
    parameters = ChangedParameters(
        dict(saved_parameters["values"]), saved_parameters["file"], tuple(saved_parameters["unused"])
    )
    new_spec = spec | {table: value for table, value in saved.items() if table in _SAVED_TABLES}
    if new_spec == spec and parameters == context.parameters:
        new_context = context
    else:
        new_context = context.with_settings(
            scenario_from_spec(new_spec, scenario.name, ground=scenario.terrain, external=scenario.external), parameters
        )
    return new_context if new_context.planned or not data.get("planned") else replace(new_context, planned=True)


def _restore_plan(context: EditContext, mission: Mission, data: Json) -> tuple[Mission, EditContext]:
    """Return a mission and its editing context, with the saved plan if it is the plan of this mission."""
    if not data.get("plan"):
        return mission, context
    plan = parse_plan(data["plan"], "kept", ground=context.scenario.terrain)
    plan = replace(plan, scenario=context.scenario)
    mission_of_saved_plan = planned_mission(plan, context.airframe)
    # The autosave keeps all digits, so items that differ mean that the mission was changed after planning.
    return (
        (mission_of_saved_plan, context.with_plan(plan, mission_of_saved_plan))
        if mission_of_saved_plan.items == mission.items
        else (mission, context)
    )


def mission_data(mission: Mission) -> Json:
    """Convert a mission to plain data, from which `mission_from_data` makes the same mission.

    NaN becomes None.
    """

    def item_data(item: MissionItem) -> list[Any]:
        """Return the fields of an item, with None for NaN."""
        numbers = [*item.params, item.lat_deg, item.lon_deg, item.alt]
        return [item.seq, item.command, item.frame, *(None if v != v else v for v in numbers), item.autocontinue]

    home = mission.home
    return {
        "home": None if home is None else [home.lat_deg, home.lon_deg, None if home.alt != home.alt else home.alt],
        "items": [item_data(item) for item in mission.items],
    }


def mission_from_data(data: Json, first: Mission) -> Mission:
    """Make a mission from the data of `mission_data`.

    Fields that are not in the data are taken from `first`.

    Raises ValueError, LookupError or TypeError for other data.
    """

    def number(value: Any) -> float:
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
        for values in [[number(value) for value in numbers]]
    ]
    for item in items:
        if (problem := item_problem(item)) is not None:
            raise ValueError(f"item {item.seq}: {problem}")
    home = data["home"]
    return replace(first, items=tuple(items), home=None if home is None else Home(*(number(value) for value in home)))
