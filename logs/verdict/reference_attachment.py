"""Write and read the answers of reference flights as an attachment of a flight's log.

The verdict on a log is computed again from the log's rows.  Reference flights are not in those rows, so their answers
are stored.
"""

import json
from dataclasses import asdict, dataclass
from functools import cache
from typing import Final, Literal

from pydantic import TypeAdapter, ValidationError

from logs.verdict.places import AirframeAnswer, DecidingParameter, ReferenceFlights, TriedSuggestions
from logs.verdict.rule_words import RULE_WORDS
from world.errors import LogError
from world.json_schema import DocumentConfig
from world.scenario_file import JSON_OBJECT, first_fault

# Name of the schema in stored logs.
REFERENCE_SCHEMA: Final = "planfly.beside/1"


@dataclass(frozen=True, slots=True)
class _ReferenceFile(DocumentConfig):
    """Content of the attachment in JSON."""

    airframe: AirframeAnswer | None
    deciding: DecidingParameter | None
    tried: tuple[TriedSuggestions, ...] | None = None
    schema: Literal["planfly.beside/1"] = REFERENCE_SCHEMA


@cache
def _attachment_adapter() -> TypeAdapter[_ReferenceFile]:
    """Return the adapter that parses and validates the attachment; it is built at its first use."""
    return TypeAdapter(_ReferenceFile)


def reference_flights_json(reference: ReferenceFlights) -> str:
    """Return the answers of reference flights as the JSON text of the attachment.

    >>> reference = ReferenceFlights(AirframeAnswer(True, "flyable"))
    >>> parse_reference_flights(reference_flights_json(reference), "a.mcap") == reference
    True
    """
    return json.dumps({"schema": REFERENCE_SCHEMA, **asdict(reference)}, indent=1, allow_nan=False) + "\n"


def parse_reference_flights(text: str | bytes, source: str) -> ReferenceFlights:
    """Read the answers of reference flights from the JSON text of the attachment.

    source: name of the log for messages.

    Raises LogError for an invalid text and for an unknown rule.

    >>> parse_reference_flights('{"schema": "planfly.beside/1", "airframe": null, "deciding": null}', "a.mcap")
    ReferenceFlights(airframe=None, deciding=None, tried=None)
    """
    try:
        file = _attachment_adapter().validate_json(text)
    except ValidationError as error:
        raise LogError(**first_fault(error, container=JSON_OBJECT).at(source)) from error
    rules = [rule for rule, _ in file.airframe.failed] if file.airframe is not None else []
    rules += [answer.rule for answer in (file.deciding, *(file.tried or ())) if answer is not None]
    unknown_rules = [rule for rule in rules if rule not in RULE_WORDS]
    if unknown_rules:
        raise LogError(
            f"{source}: {unknown_rules[0]!r} is not a rule", file=source, field="rule", value=unknown_rules[0]
        )
    return ReferenceFlights(file.airframe, file.deciding, file.tried)
