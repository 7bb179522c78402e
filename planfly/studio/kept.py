"""What is kept of a session for a server that dies: the mission, how it is flown, and the plan that it is of.

It counts for the document that it is of alone, which is known by its first mission.
"""

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from flight.mission.items import Home, Mission, MissionItem
from planfly.studio.desk import Desk
from planfly.studio.documents import planned_mission
from planfly.studio.settings import SetParameters
from planfly.studio.sheet import Json
from planner.plan import Plan, parse_plan, plan_json
from world.errors import PlanflyError
from world.scenario import Scenario, from_spec

_SCHEMA = "planfly.studio/1"
# Of a scenario, what the studio changes.
_SET = ("wind", "flight", "limits", "area")


def kept_text(desk: Desk, first: Mission, mission: Mission, plan: Plan | None, name: str) -> str:
    """What is kept, as a file's text.

    first: the mission that was opened.  plan: that the mission is of, None where it was changed since.
    """
    spec = desk.scenario.to_json()
    # An area that was made around a mission is made anew.
    names = [one for one in _SET if one in spec and (one != "area" or not desk.scenario.external)]
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


def read_kept(file: Path, desk: Desk, first: Mission) -> tuple[Mission, Desk] | None:
    """The mission that was kept, and the desk that it was judged with; None where nothing was done to this document.

    Raises OSError, ValueError, LookupError, TypeError or PlanflyError for what cannot be read.
    """
    data = json.loads(file.read_text(encoding="utf-8"))
    if data["schema"] != _SCHEMA or data["first"] != mission_data(first):
        return None
    mission = first if data["mission"] == data["first"] else mission_from(data["mission"], first)
    try:
        found = _with_plan(_with_settings(desk, data), mission, data)
    except (ValueError, LookupError, TypeError, PlanflyError):
        # What was edited counts more than how it was flown.
        found = mission, desk
    return None if found[0] is first and found[1] is desk else found


def kept_beside(file: Path, first: Mission) -> Path:
    """Where another document is kept that was opened since the command began: beside what the command named."""
    digest = hashlib.sha256(json.dumps(mission_data(first)).encode()).hexdigest()[:8]
    return file.with_name(f"{file.stem}-{digest}{file.suffix}")


def _with_settings(desk: Desk, data: Json) -> Desk:
    """A desk with the settings that were kept; itself where they are its own."""
    before: Scenario = desk.scenario
    spec, found = json.loads(json.dumps(before.to_json())), data.get("settings", {})
    own = data.get("parameters") or asdict(SetParameters())
    parameters = SetParameters(dict(own["values"]), own["file"], tuple(own["unused"]))
    wanted = spec | {one: value for one, value in found.items() if one in _SET}
    if wanted == spec and parameters == desk.parameters:
        made = desk
    else:
        made = desk.flown_as(
            from_spec(wanted, before.name, ground=before.terrain, external=before.external), parameters
        )
    return made if made.planned or not data.get("planned") else replace(made, planned=True)


def _with_plan(desk: Desk, mission: Mission, data: Json) -> tuple[Mission, Desk]:
    """A mission and its desk, with the plan that it is of if that was kept."""
    if not data.get("plan"):
        return mission, desk
    plan = parse_plan(data["plan"], "kept", ground=desk.scenario.terrain)
    plan = replace(plan, scenario=desk.scenario)
    made = planned_mission(plan, desk.airframe)
    # Kept in whole digits: what differs is no plan's any more.
    return (made, desk.of_plan(plan, made)) if made.items == mission.items else (mission, desk)


def mission_data(mission: Mission) -> Json:
    """A mission as plain data, of which `mission_from` makes the same again; NaN is null."""

    def plain(item: MissionItem) -> list[Any]:
        numbers = [*item.params, item.lat_deg, item.lon_deg, item.alt]
        return [item.seq, item.command, item.frame, *(None if v != v else v for v in numbers), item.autocontinue]

    home = mission.home
    return {
        "home": None if home is None else [home.lat_deg, home.lon_deg, None if home.alt != home.alt else home.alt],
        "items": [plain(item) for item in mission.items],
    }


def mission_from(data: Json, first: Mission) -> Mission:
    """A mission of its data; what the items do not say is that of the first."""

    def number(value: Any) -> float:
        return float("nan") if value is None else float(value)

    items = [
        MissionItem(int(seq), int(command), int(frame), (p[0], p[1], p[2], p[3]), p[4], p[5], p[6], bool(go_on))
        for seq, command, frame, *numbers, go_on in data["items"]
        for p in [[number(value) for value in numbers]]
    ]
    home = data["home"]
    return replace(first, items=tuple(items), home=None if home is None else Home(*(number(one) for one in home)))
