"""Save the mission, settings and plan of a session automatically, in case the server dies.

An autosave is restored only into its own document, which is identified by its first mission.
"""

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from flight.mission.items import MAX_BYTES, Home, Mission, MissionItem, item_problem
from planfly.studio.documents import planned_mission
from planfly.studio.edit_context import EditContext
from planfly.studio.pilot import INTERNAL
from planfly.studio.settings import SetParameters
from planfly.studio.view_model import Json
from planner.plan import Plan, parse_plan, plan_json
from world.errors import PlanflyError
from world.files import read_small_file, utf8_text
from world.scenario import Scenario, from_spec

_SCHEMA = "planfly.studio/1"
# Maximum size of an autosave with two missions, a plan and the settings, bytes.
_MAX_BYTES = 4 * MAX_BYTES
# Tables of a scenario that the studio changes.
_SAVED_TABLES = ("wind", "flight", "limits", "area")


def kept_text(desk: EditContext, first: Mission, mission: Mission, plan: Plan | None, name: str) -> str:
    """Return the text of the autosave file.

    first: the mission that was opened.
    plan: the plan of the mission, or None if the mission was changed after planning.
    """
    spec = desk.scenario.to_json()
    # Do not save an area that was made around a mission; it is made again when the mission is restored.
    names = [one for one in _SAVED_TABLES if one in spec and (one != "area" or not desk.scenario.external)]
    data = {
        "schema": _SCHEMA,
        "name": name,
        "mission": mission_data(mission),
        "first": mission_data(first),
        "settings": {one: spec[one] for one in names},
        "parameters": asdict(desk.parameters),
        "planned": desk.planned,
        "plan": None if plan is None else plan_json(plan),
    }
    return json.dumps(data)


def read_kept(file: Path, desk: EditContext, first: Mission) -> tuple[Mission, EditContext] | None:
    """Return the saved mission and its editing context, or None if there is no autosave of this document.

    Raises one of `INTERNAL` or PlanflyError for a file that cannot be read.
    """
    if not file.exists():
        return None
    data = json.loads(utf8_text(read_small_file(file, _MAX_BYTES, "session", PlanflyError), file, PlanflyError))
    if data["schema"] != _SCHEMA or data["first"] != mission_data(first):
        return None
    mission = first if data["mission"] == data["first"] else mission_from(data["mission"], first)
    try:
        found = _with_plan(_with_settings(desk, data), mission, data)
    except (*INTERNAL, PlanflyError):
        # If the settings cannot be restored, restore at least the edited mission.
        found = mission, desk
    return None if found[0] is first and found[1] is desk else found


def kept_beside(file: Path, first: Mission) -> Path:
    """Return the autosave path of a document opened after the first one, next to the first one's file."""
    digest = hashlib.sha256(json.dumps(mission_data(first)).encode()).hexdigest()[:8]
    return file.with_name(f"{file.stem}-{digest}{file.suffix}")


def _with_settings(desk: EditContext, data: Json) -> EditContext:
    """Return the editing context with the saved settings, or the same object if these do not differ."""
    before: Scenario = desk.scenario
    spec, found = json.loads(json.dumps(before.to_json())), data.get("settings", {})
    own = data.get("parameters") or asdict(SetParameters())
    parameters = SetParameters(dict(own["values"]), own["file"], tuple(own["unused"]))
    wanted = spec | {one: value for one, value in found.items() if one in _SAVED_TABLES}
    if wanted == spec and parameters == desk.parameters:
        made = desk
    else:
        made = desk.flown_as(
            from_spec(wanted, before.name, ground=before.terrain, external=before.external), parameters
        )
    return made if made.planned or not data.get("planned") else replace(made, planned=True)


def _with_plan(desk: EditContext, mission: Mission, data: Json) -> tuple[Mission, EditContext]:
    """Return a mission and its editing context, with the saved plan if there is one."""
    if not data.get("plan"):
        return mission, desk
    plan = parse_plan(data["plan"], "kept", ground=desk.scenario.terrain)
    plan = replace(plan, scenario=desk.scenario)
    made = planned_mission(plan, desk.airframe)
    # The autosave keeps all digits, so items that differ mean that the mission was changed after planning.
    return (made, desk.of_plan(plan, made)) if made.items == mission.items else (mission, desk)


def mission_data(mission: Mission) -> Json:
    """Convert a mission to plain data, from which `mission_from` makes the same mission; NaN becomes None."""

    def plain(item: MissionItem) -> list[Any]:
        numbers = [*item.params, item.lat_deg, item.lon_deg, item.alt]
        return [item.seq, item.command, item.frame, *(None if v != v else v for v in numbers), item.autocontinue]

    home = mission.home
    return {
        "home": None if home is None else [home.lat_deg, home.lon_deg, None if home.alt != home.alt else home.alt],
        "items": [plain(item) for item in mission.items],
    }


def mission_from(data: Json, first: Mission) -> Mission:
    """Make a mission from the data of `mission_data`; all other fields are taken from the first mission.

    Raises ValueError, LookupError or TypeError for other data.
    """

    def number(value: Any) -> float:
        return float("nan") if value is None else float(value)

    items = [
        MissionItem(int(seq), int(command), int(frame), (p[0], p[1], p[2], p[3]), p[4], p[5], p[6], bool(go_on))
        for seq, command, frame, *numbers, go_on in data["items"]
        for p in [[number(value) for value in numbers]]
    ]
    for item in items:
        if (problem := item_problem(item)) is not None:
            raise ValueError(f"item {item.seq}: {problem}")
    home = data["home"]
    return replace(first, items=tuple(items), home=None if home is None else Home(*(number(one) for one in home)))
