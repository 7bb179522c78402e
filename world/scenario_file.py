"""Scenario files read and checked, with errors of one line: file, key, value and what is allowed."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from world.errors import ScenarioError
from world.scenario_tables import ScenarioFile
from world.text_files import read_small_file, toml_table

Table = TypeVar("Table", bound=BaseModel)

# Twenty thousand threats are 3 MB.
MOST_BYTES = 16 * 2**20


def parse_scenario(text: str, source: str) -> ScenarioFile:
    """Check the text of a TOML scenario file; ``source`` names it in messages.

    Raises ScenarioError with one line: file, key, value and what is allowed.
    """
    try:
        data = toml_table(text)
    except ValueError as error:
        raise ScenarioError(f"{source}: not valid TOML: {_line(error)}") from error
    terrain = data.get("terrain")
    if isinstance(terrain, dict) and terrain.get("kind") == "none":
        raise ScenarioError(f'{source}: terrain.kind: "none": allowed are "dem", "peaks" and "flat"')
    return check_scenario(data, source)


def check_scenario(data: Any, source: str) -> ScenarioFile:
    """Check a scenario that is already a dictionary (from a plan or a log); ``source`` names it in messages.

    Raises ScenarioError as `parse_scenario` does.
    """
    if not isinstance(data, dict):
        raise ScenarioError(f"{source}: scenario: a table of keys is expected, got {type(data).__name__}")
    try:
        return ScenarioFile.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(f"{source}: {first_error(error, data)}") from error


def checked_table(make: Callable[[], Table], source: str) -> Table:
    """Make a table of values that come from no checked file; raises ScenarioError that begins with ``source``."""
    try:
        return make()
    except ValidationError as error:
        raise ScenarioError(f"{source}: {first_error(error)}") from error


def read_scenario_text(path: Path) -> str:
    """Read the text of a scenario file.  Raises ScenarioError if it is missing, too large or not UTF-8."""
    data = read_small_file(path, MOST_BYTES, "scenario", ScenarioError)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 (byte {error.start})") from error


def first_error(error: ValidationError, data: Any = None) -> str:
    """First of the faults that pydantic found, as ``key: value: what is allowed``.

    data: what was checked; needed where a field takes more than one type, to tell its keys from pydantic's branches.

    >>> from pydantic import ValidationError
    >>> from world.scenario_tables import WindTable
    >>> try:
    ...     WindTable(speed_mps=41.0)
    ... except ValidationError as error:
    ...     print(first_error(error))
    speed_mps: 41.0: allowed 0..40
    """
    found = error.errors(include_url=False)
    first = found[0]
    keys = [str(part) for part in (first["loc"] if data is None else _keys_found(first["loc"], data))]
    # Of a check of ours the message is that of the error that it raised.
    message = str(first["ctx"]["error"]) if first["type"] == "value_error" else first["msg"]
    value = first.get("input")
    shown = "" if isinstance(value, dict | list) else f": {_shown(value)}"
    if first["type"] == "extra_forbidden":
        message = "unknown key"
        shown = ""
    if first["type"] == "missing":
        shown = ""
        keys = [str(part) for part in first["loc"]]
    more = f" (and {len(found) - 1} more)" if len({item["loc"][:2] for item in found}) > 1 else ""
    named = ".".join(key if key.isprintable() else json.dumps(key) for key in keys)
    return f"{named or 'file'}{shown}: {message}{more}"


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
