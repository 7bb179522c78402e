"""Scenario files read and checked, with errors of one line: file, key, value and what is allowed."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from world.errors import ScenarioError
from world.files import did_you_mean, read_small_file, toml_table
from world.scenario_tables import ScenarioFile

Table = TypeVar("Table", bound=BaseModel)

# Twenty thousand threats are 3 MB.
MAX_BYTES = 16 * 2**20


def parse_scenario(text: str, source: str) -> ScenarioFile:
    """Check the text of a TOML scenario file; ``source`` names it in messages.  One that names no aircraft says so.

    Raises ScenarioError with one line: file, key, value and what is allowed.
    """
    try:
        data = toml_table(text)
    # Beside its own TOMLDecodeError: a number of thousands of digits, and brackets within brackets without end.
    except ValueError as error:
        raise ScenarioError(f"{source}: not valid TOML: {_line(error)}", file=source) from error
    terrain = data.get("terrain")
    if isinstance(terrain, dict) and terrain.get("kind") == "none":
        raise ScenarioError(
            f'{source}: terrain.kind: "none": allowed are "dem", "peaks" and "flat"', file=source, field="terrain.kind"
        )
    made = check_scenario(data, source)
    if "aircraft" in made.flight.model_fields_set:
        return made
    return made.model_copy(update={"flight": made.flight.model_copy(update={"aircraft_by_default": True})})


def check_scenario(data: Any, source: str) -> ScenarioFile:
    """Check a scenario that is already a dictionary (from a plan or a log); ``source`` names it in messages.

    Raises ScenarioError as `parse_scenario` does.
    """
    if not isinstance(data, dict):
        raise ScenarioError(
            f"{source}: scenario: a table of keys is expected, got {type(data).__name__}", file=source, field="scenario"
        )
    try:
        return ScenarioFile.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(**first_fault(error, data, ScenarioFile).at(source)) from error


def checked_table(make: Callable[[], Table], source: str) -> Table:
    """Make a table of values that come from no checked file; raises ScenarioError that begins with ``source``."""
    try:
        return make()
    except ValidationError as error:
        raise ScenarioError(**first_fault(error).at(source)) from error


def read_scenario_text(path: Path) -> str:
    """Read the text of a scenario file.  Raises ScenarioError if it is missing, too large or not UTF-8."""
    data = read_small_file(path, MAX_BYTES, "scenario", ScenarioError)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 (byte {error.start})", file=path) from error


class Fault(NamedTuple):
    """A value that a file may not have.

    field: its key.  value: as it is there; None where it is missing, or a table or a list.  allowed: what is expected.
    text: all of it, as a message has it.
    """

    field: str
    value: Any
    allowed: str
    text: str

    def at(self, source: str, part: str = "") -> dict[str, Any]:
        """What makes a `PlanflyError` of it: source: the file.  part: what of the file it is in."""
        begin = f"{source}: {part}" if part else source
        message = f"{begin}: {self.text}"
        return {"message": message, "file": source, "field": self.field, "value": self.value, "allowed": self.allowed}


def first_fault(error: ValidationError, data: Any = None, model: type[BaseModel] | None = None) -> Fault:
    """First of the faults that pydantic found; its text is ``key: value: what is allowed``.

    data: what was checked; needed where a field takes more than one type, to tell its keys from pydantic's branches.
    model: what it was checked as; needed to name the key that an unknown one may stand for.

    >>> from pydantic import ValidationError
    >>> from world.scenario_tables import WindTable
    >>> try:
    ...     WindTable(speed_mps=41.0)
    ... except ValidationError as error:
    ...     print(first_fault(error))
    Fault(field='speed_mps', value=41.0, allowed='allowed 0..40', text='speed_mps: 41.0: allowed 0..40')
    """
    found = error.errors(include_url=False)
    # A key that is mistaken is missing, too: the mistake tells more.
    mistaken = [item for item in found if item["type"] == "extra_forbidden" and _near(item["loc"], model)]
    first = (mistaken or found)[0]
    keys = [str(part) for part in (first["loc"] if data is None else _keys_found(first["loc"], data))]
    # Of a check of ours the message is that of the error that it raised.
    message = str(first["ctx"]["error"]) if first["type"] == "value_error" else first["msg"]
    if first["type"] == "model_type":
        message = "a table is expected"
    elif first["type"] == "too_short":
        message = f"at least {first['ctx']['min_length']} expected"
    value = first.get("input")
    if isinstance(value, dict | list):
        value = None
    shown = "" if isinstance(first.get("input"), dict | list) else f": {_shown(value)}"
    if first["type"] == "extra_forbidden":
        message = f"unknown key{_near(first['loc'], model)}"
        shown = ""
    if first["type"] == "missing":
        value, shown = None, ""
        keys = [str(part) for part in first["loc"]]
    more = f" (and {len(found) - 1} more)" if len({item["loc"][:2] for item in found}) > 1 else ""
    named = ".".join(key if key.isprintable() else json.dumps(key) for key in keys)
    # A check of the whole file names its key itself.
    begin = "" if not named and first["type"] == "value_error" else f"{named or 'file'}{shown}: "
    return Fault(named, value, message, f"{begin}{message}{more}")


def _near(parts: Sequence[str | int], model: type[BaseModel] | None) -> str:
    """Which key an unknown one may stand for, in words."""
    return "" if model is None else did_you_mean(str(parts[-1]), _keys_known(parts[:-1], model))


def _keys_known(parts: Sequence[str | int], model: type[BaseModel]) -> list[str]:
    """Keys that a model knows in the table at a place, or in any below its first key."""
    table = model.model_fields.get(str(parts[0])) if parts else None
    if table is None:
        return list(model.model_fields)
    tables = [table.annotation]
    keys: list[str] = []
    # Grows as it is walked: a table's fields may be tables, in lists and unions.
    for kind in tables:
        tables += [arg for arg in get_args(kind) if arg not in tables]
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            keys += kind.model_fields
            inner = (field.annotation for field in kind.model_fields.values())
            tables += [annotation for annotation in inner if annotation not in tables]
    return keys


def _keys_found(parts: tuple[str | int, ...], data: Any) -> list[str | int]:
    """The parts of a place that lead on in the data: of a union pydantic names the branch as well, which does not."""
    found = []
    for part in parts:
        inside = range(len(data)) if isinstance(data, list) else data if isinstance(data, dict) else ()
        if part in inside:
            found.append(part)
            data = data[part]
    return found


def _shown(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:57] + "..."


def _line(error: BaseException) -> str:
    return str(error).splitlines()[0]
