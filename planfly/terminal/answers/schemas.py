"""The answer of each command that has ``--json``, and its JSON schema."""

import json
from typing import Any

from pydantic import TypeAdapter

from planfly.terminal.answers import answer_data
from planfly.terminal.answers.aircraft_answer import AircraftAnswer
from planfly.terminal.answers.campaign_answers import CampaignDocument, WindsDocument
from planfly.terminal.answers.verdict_document import VerdictDocument

ANSWERS: dict[str, type[Any]] = {
    "run": answer_data.RunAnswer,
    "plan": answer_data.PlanAnswer,
    "export": answer_data.ExportAnswer,
    "fly": answer_data.FlyAnswer,
    "check": VerdictDocument,
    "replay": answer_data.ReplayAnswer,
    "recover": answer_data.RecoverAnswer,
    "report": answer_data.ReportAnswer,
    "compare": answer_data.CompareAnswer,
    "import": answer_data.ImportAnswer,
    "refly": answer_data.ReflyAnswer,
    "paper": answer_data.PaperAnswer,
    "campaign": CampaignDocument,
    "winds": WindsDocument,
    "aircraft": AircraftAnswer,
    "scenarios": answer_data.ScenariosAnswer,
}
_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def answer_schema(command: str) -> dict[str, Any]:
    """The JSON schema, draft 2020-12, of a command's answer.

    >>> sorted(answer_schema("scenarios")["properties"])
    ['exit_code', 'scenarios', 'schema']
    """
    made = TypeAdapter(ANSWERS[command]).json_schema(mode="serialization")
    return {"$schema": _DRAFT, **made, "title": f"planfly {command} --json"}


def schema_text(command: str) -> str:
    """The schema as the text of a file."""
    return json.dumps(answer_schema(command), indent=1) + "\n"


def answer_text(answer: object) -> str:
    """An answer as the text of a file; what is no number is null."""
    return TypeAdapter(type(answer)).dump_json(answer, indent=1).decode() + "\n"
