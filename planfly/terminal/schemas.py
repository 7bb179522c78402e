"""Make JSON schemas of the answers of commands, from the classes of the answers."""

import json
from importlib import import_module
from typing import Any

# Class of the answer of each command with --json: in `planfly.terminal.answers`, or "MODULE.CLASS" in this package.
_ANSWERS = {
    "run": "RunAnswer",
    "plan": "plan_answers.PlanDocument",
    "export": "ExportAnswer",
    "fly": "verdict_answers.FlyAnswer",
    "check": "verdict_answers.CheckDocument",
    "returns": "returns_answers.ReturnsAnswer",
    "link": "link_answers.LinkAnswer",
    "survey": "survey_answers.SurveyAnswer",
    "report": "ReportAnswer",
    "compare": "CompareDocument",
    "replay": "ReplayAnswer",
    "recover": "RecoverAnswer",
    "import": "ImportAnswer",
    "refly": "ReflyAnswer",
    "predict": "PredictAnswer",
    "campaign": "CampaignDocument",
    "winds": "WindsDocument",
    "battery": "battery_answers.BatteryAnswer",
    "window": "window_answers.WindowAnswer",
    "ground-risk": "ground_risk_answers.GroundRiskAnswer",
    "paper": "PaperAnswer",
    "aircraft": "AircraftAnswer",
    "scenarios": "ScenariosAnswer",
    "new": "NewAnswer",
    "terrain": "TerrainAnswer",
}
# Identifier of JSON Schema, draft 2020-12.
_JSON_SCHEMA_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def commands_with_json() -> list[str]:
    """Return the names of the commands with the option ``--json``."""
    return list(_ANSWERS)


def answer_schema(name: str) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a command's answer.

    Raises KeyError for a command without an answer.

    >>> sorted(answer_schema("scenarios")["properties"])
    ['exit_code', 'scenarios', 'schema']
    """
    # Imported here: only this function needs schemas.
    from pydantic import TypeAdapter

    module, _, answer = _ANSWERS[name].rpartition(".")
    answers = import_module(f"planfly.terminal.{module or 'answers'}")
    schema = TypeAdapter(getattr(answers, answer)).json_schema(mode="serialization")
    return {"$schema": _JSON_SCHEMA_DRAFT, **schema, "title": f"planfly {name} --json"}


def answer_objects(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the schema of each kind of object that an answer may be, from the schema of the answer.

    There are several kinds if the command's options choose between them.

    >>> [one["properties"]["schema"]["const"] for one in answer_objects(answer_schema("check"))]
    ['planfly.verdict/3', 'planfly.verdicts/1']
    """
    refs = [option["$ref"].rpartition("/")[2] for option in schema.get("anyOf", ())]
    return [schema["$defs"][ref] for ref in refs] or [schema]


def schema_text(name: str) -> str:
    """Return the JSON schema of a command's answer as the text of a file."""
    return json.dumps(answer_schema(name), indent=1) + "\n"
