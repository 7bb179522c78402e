"""Write and read the answers of reference flights as text, an attachment of a recorded flight's log.

A log's verdict is computed again from its rows.  Reference flights are not in those rows, so their answers are stored.
"""

import json
from dataclasses import asdict
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from logs.verdict.places import AirframeAnswer, DecidingParameter, Place, PlaceKind, ReferenceFlights
from logs.verdict.rule_words import RULE_WORDS
from world.errors import LogError
from world.scenario_file import first_fault

# The name that logs have stored since the attachment was called "beside".
REFERENCE_SCHEMA = "planfly.beside/1"

_Number = Annotated[float, Field(allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class _Place(_Table):
    kind: PlaceKind
    index: int | None
    item: int | None
    name: str
    to_item: int | None = None
    number: int | None = None

    def place(self) -> Place:
        return Place(self.kind, self.index, self.item, self.name, self.to_item, self.number)


class _Airframe(_Table):
    flyable: bool
    headline: str
    failed: list[tuple[str, _Place]]

    def answer(self) -> AirframeAnswer:
        failed = tuple((rule, place.place()) for rule, place in self.failed)
        return AirframeAnswer(self.flyable, self.headline, failed)


class _Deciding(_Table):
    name: str
    current: _Number
    passing: _Number
    unit: str
    rule: str
    place: _Place
    off: _Number | None

    def parameter(self) -> DecidingParameter:
        place = self.place.place()
        return DecidingParameter(self.name, self.current, self.passing, self.unit, self.rule, place, self.off)


class _ReferenceFlights(_Table):
    file_schema: Annotated[str, Field(alias="schema", pattern=f"^{REFERENCE_SCHEMA}$")] = REFERENCE_SCHEMA
    airframe: _Airframe | None
    deciding: _Deciding | None


def reference_flights_json(reference: ReferenceFlights) -> str:
    """Write the answers as text.

    >>> reference = ReferenceFlights(AirframeAnswer(True, "flyable"))
    >>> parse_reference_flights(reference_flights_json(reference), "a.mcap") == reference
    True
    """
    return json.dumps({"schema": REFERENCE_SCHEMA, **asdict(reference)}, indent=1, allow_nan=False) + "\n"


def parse_reference_flights(text: str | bytes, source: str) -> ReferenceFlights:
    """Read the answers from a text.  Raises LogError, in one line, for an invalid text; source names it.

    >>> parse_reference_flights('{"schema": "planfly.beside/1", "airframe": null, "deciding": null}', "a.mcap")
    ReferenceFlights(airframe=None, deciding=None)
    """
    try:
        file = _ReferenceFlights.model_validate_json(text)
    except ValidationError as error:
        raise LogError(**first_fault(error).at(source)) from error
    airframe, deciding = file.airframe, file.deciding
    rules = [rule for rule, _ in airframe.failed] if airframe is not None else []
    unknown = [rule for rule in (*rules, *([deciding.rule] if deciding else [])) if rule not in RULE_WORDS]
    if unknown:
        raise LogError(f"{source}: {unknown[0]!r} is no rule", file=source, field="rule", value=unknown[0])
    return ReferenceFlights(
        None if airframe is None else airframe.answer(),
        None if deciding is None else deciding.parameter(),
    )
