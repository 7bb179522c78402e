"""What other flights had to say of a recorded one, as the text of an attachment of its log, and back.

A log's verdict is worked out anew from its rows; the flights beside it are not in it, and their answers are kept.
"""

import json
from dataclasses import asdict
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from logs.verdict.findings import RULES
from logs.verdict.levels import AirframeAnswer, DecidingParameter, FlownBeside
from logs.verdict.places import Place, PlaceKind
from world.errors import LogError
from world.scenario_file import first_fault

BESIDE_SCHEMA = "planfly.beside/1"

_Number = Annotated[float, Field(allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class _Place(_Table):
    kind: PlaceKind
    index: int | None
    item: int | None
    name: str
    to_item: int | None = None

    def place(self) -> Place:
        return Place(self.kind, self.index, self.item, self.name, self.to_item)


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


class _Beside(_Table):
    file_schema: Annotated[str, Field(alias="schema", pattern=f"^{BESIDE_SCHEMA}$")] = BESIDE_SCHEMA
    airframe: _Airframe | None
    deciding: _Deciding | None


def beside_json(beside: FlownBeside) -> str:
    """Write the answers as text.

    >>> beside = FlownBeside(AirframeAnswer(True, "flyable"))
    >>> parse_beside(beside_json(beside), "a.mcap") == beside
    True
    """
    return json.dumps({"schema": BESIDE_SCHEMA, **asdict(beside)}, indent=1, allow_nan=False) + "\n"


def parse_beside(text: str | bytes, source: str) -> FlownBeside:
    """Read the answers of a text.  Raises LogError, in one line, for what does not fit; source names it.

    >>> parse_beside('{"schema": "planfly.beside/1", "airframe": null, "deciding": null}', "a.mcap")
    FlownBeside(airframe=None, deciding=None)
    """
    try:
        file = _Beside.model_validate_json(text)
    except ValidationError as error:
        raise LogError(**first_fault(error).at(source)) from error
    airframe, deciding = file.airframe, file.deciding
    rules = [rule for rule, _ in airframe.failed] if airframe is not None else []
    unknown = [rule for rule in (*rules, *([deciding.rule] if deciding else [])) if rule not in RULES]
    if unknown:
        raise LogError(f"{source}: {unknown[0]!r} is no rule", file=source, field="rule", value=unknown[0])
    return FlownBeside(
        None if airframe is None else airframe.answer(),
        None if deciding is None else deciding.parameter(),
    )
