"""Read and check scenario files, with one-line errors: file, key, value and what is allowed."""

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from world.errors import ScenarioError
from world.files import did_you_mean, read_small_file, toml_table
from world.scenario_tables import ScenarioFile
from world.wording import count_text

Table = TypeVar("Table", bound=BaseModel)

# Maximum size of a file, bytes; twenty thousand threats are 3 MB.
MAX_BYTES = 16 * 2**20


def parse_scenario(text: str, source: str) -> ScenarioFile:
    """Parse and check the text of a TOML scenario file.

    source: name of the file in messages.

    Sets `aircraft_by_default` if the text names no aircraft. Raises ScenarioError with one line: file, key, value and
    what is allowed.
    """
    try:
        data = toml_table(text)
    # ValueError includes TOMLDecodeError, numbers of thousands of digits, and deeply nested brackets.
    except ValueError as error:
        first_line = str(error).splitlines()[0]
        raise ScenarioError(f"{source}: not valid TOML: {first_line}", file=source) from error
    terrain = data.get("terrain")
    if isinstance(terrain, dict) and terrain.get("kind") == "none":
        raise ScenarioError(
            f'{source}: terrain.kind: "none": allowed are "dem", "peaks" and "flat"', file=source, field="terrain.kind"
        )
    wind = data.get("wind")
    if isinstance(wind, dict) and "forecast" in wind:
        for name in ("speed_mps", "from_deg", "gradient"):
            if name in wind:
                raise ScenarioError.at(
                    source, f"wind.{name}", wind[name], "not allowed with wind.forecast, which states the wind"
                )
    spec = check_scenario(data, source)
    if "aircraft" in spec.flight.model_fields_set:
        return spec
    return spec.model_copy(update={"flight": spec.flight.model_copy(update={"aircraft_by_default": True})})


def check_scenario(data: Any, source: str) -> ScenarioFile:
    """Check the scenario data of a plan or a log, and convert them to the model of a scenario file.

    source: name of the plan or log in messages.

    Raises ScenarioError, in one line, for data that is not a dictionary, or with an invalid value.
    """
    if not isinstance(data, dict):
        raise ScenarioError(
            f"{source}: scenario: expected an object, got {type(data).__name__}", file=source, field="scenario"
        )
    try:
        return ScenarioFile.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(**first_fault(error, data, ScenarioFile).at(source)) from None


def checked_table(make_table: Callable[[], Table], source: str) -> Table:
    """Return the table that a function makes; raise a pydantic error in it as a ScenarioError.

    source: name of the file in messages.
    """
    try:
        return make_table()
    except ValidationError as error:
        raise ScenarioError(**first_fault(error).at(source)) from None


def read_scenario_text(path: Path) -> str:
    """Read the text of a scenario file. Raises ScenarioError if it is missing, too large or not UTF-8."""
    data = read_small_file(path, MAX_BYTES, "scenario", ScenarioError)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 (byte {error.start})", file=path) from error


class Fault(NamedTuple):
    """Invalid value in a file.

    field: key of the value.
    value: the value; None if it is missing, a table or a list.
    allowed: the expected values.
    text: the fault as it appears in a message.
    """

    field: str
    value: Any
    allowed: str
    text: str

    def at(self, source: str, part: str = "") -> dict[str, Any]:
        """Return the arguments of a `PlanflyError` about this fault.

        source: name of the file.
        part: part of the file that has the fault; "" for the whole file.
        """
        location = f"{source}: {part}" if part else source
        message = f"{location}: {self.text}"
        return {"message": message, "file": source, "field": self.field, "value": self.value, "allowed": self.allowed}


def first_fault(
    error: ValidationError, data: Any = None, model: type[BaseModel] | None = None, container: str = "a table"
) -> Fault:
    """Convert an error of pydantic to its first fault, with the text ``key: value: allowed values``.

    data: data that was checked. It is needed if a field allows several types, because pydantic's location then contains
        names that are not keys of the data.
    model: model of the data, needed to suggest a known key for an unknown key.
    container: name of keys with values in the file's format: "a table" in TOML, or `JSON_OBJECT`.

    >>> from pydantic import ValidationError
    >>> from world.scenario_tables import WindTable
    >>> try:
    ...     WindTable(speed_mps=41.0)
    ... except ValidationError as error:
    ...     print(first_fault(error))
    Fault(field='speed_mps', value=41.0, allowed='allowed 0..40', text='speed_mps: 41.0: allowed 0..40')
    """
    errors = error.errors(include_url=False)
    # A misspelt key is reported as missing, too; the misspelling is the more useful message.
    misspelt_keys = [
        error_entry
        for error_entry in errors
        if error_entry["type"] == "extra_forbidden" and _spelling_suggestion(error_entry["loc"], model)
    ]
    first_error = (misspelt_keys or errors)[0]
    location = list(first_error["loc"])
    if data is not None:
        # Only the parts that are keys or indices of the data, without names of types.
        location.clear()
        for part in first_error["loc"]:
            known_keys = range(len(data)) if isinstance(data, list) else data if isinstance(data, dict) else ()
            if part in known_keys:
                location.append(part)
                data = data[part]
    keys = [str(part) for part in location]
    message = expected_values(first_error, container)
    value = first_error.get("input")
    if isinstance(value, dict | list):
        value, value_text = None, ""
    elif isinstance(value, float) and not math.isfinite(value):
        value_text = f": {value}"
    else:
        text = json.dumps(value, default=str)
        value_text = f": {text if len(text) <= 60 else text[:57] + '...'}"
    if first_error["type"] == "extra_forbidden":
        message = f"unknown key{_spelling_suggestion(first_error['loc'], model)}"
        value_text = ""
    if first_error["type"] == "missing":
        value, value_text = None, ""
        keys = [str(part) for part in first_error["loc"]]
    # The errors after the first: their number, or the missing keys if all are missing keys.  Nothing is said if all
    # concern one value, for which pydantic reports an error for each allowed type.
    remainder = ""
    if len({error_entry["loc"][:2] for error_entry in errors}) > 1 or errors[0]["loc"] in _ENDS:
        others = [".".join(map(str, error_entry["loc"])) for error_entry in errors[1:]]
        if any(error_entry["type"] != "missing" for error_entry in errors):
            remainder = f" (and {count_text(len(others), 'more error')})" if others else ""
        else:
            remainder = f" (also missing: {', '.join(others)})" if others else ""
            if any(error_entry["loc"] in _ENDS for error_entry in errors):
                remainder += "; tables [start] and [destination] need east_m and north_m, or lat_deg and lon_deg, and "
                remainder += "amsl_m or height_m"
    field = ".".join(key if key.isprintable() else json.dumps(key) for key in keys)
    # A check of the whole file names its key itself.
    prefix = "" if not field and first_error["type"] == "value_error" else f"{field or 'file'}{value_text}: "
    return Fault(field, value, message, f"{prefix}{message}{remainder}")


# Name of keys with values in a JSON file.
JSON_OBJECT = "an object"
# Expected values by the type of pydantic's error; placeholders are the container and keys of the error's context.
_EXPECTED_VALUES = {
    "missing": "missing",
    "model_type": "expected {container}",
    "model_attributes_type": "expected {container}",
    "dict_type": "expected {container}",
    "list_type": "expected a list",
    "tuple_type": "expected a list",
    "string_type": "expected text",
    "string_too_short": "expected at least {min_length} characters",
    "string_too_long": "expected at most {max_length} characters",
    "float_type": "expected a number",
    "float_parsing": "expected a number",
    "finite_number": "expected a finite number",
    "int_type": "expected a whole number",
    "int_parsing": "expected a whole number",
    "int_from_float": "expected a whole number",
    "bool_type": "expected true or false",
    "bool_parsing": "expected true or false",
    "literal_error": "expected {expected}",
    "enum": "expected {expected}",
    "greater_than": "expected more than {gt}",
    "greater_than_equal": "expected at least {ge}",
    "less_than": "expected less than {lt}",
    "less_than_equal": "expected at most {le}",
    "too_short": "expected at least {min_length} values",
    "too_long": "expected at most {max_length} values",
    # A check of planfly raises its own error with its own message.
    "value_error": "{error}",
}


def expected_values(error_entry: Mapping[str, Any], container: str) -> str:
    """Return the expected values of a field as text.

    For an unknown kind of error, return pydantic's message.

    error_entry: entry of the list of a pydantic error.

    container: name of keys with values, as in `first_fault`.
    """
    template = _EXPECTED_VALUES.get(error_entry["type"])
    if template is None:
        return str(error_entry["msg"])
    context = error_entry.get("ctx", {})
    if "expected" in context:
        context = {"expected": context["expected"].replace("'", '"')}
    return re.sub(r"\b1 (value|character)s$", r"1 \1", template.format(container=container, **context))


# Tables of the ends of a flight, which a scenario for a mission needs, too.
_ENDS = (("start",), ("destination",))


def _spelling_suggestion(parts: Sequence[str | int], model: type[BaseModel] | None) -> str:
    """Return a suggestion for an unknown key, as the end of a message; "" if no known key is similar.

    parts: keys that lead to the unknown key, and the key itself.
    model: model of the data; None for no suggestion.
    """
    if model is None:
        return ""
    tables = [model]
    for part in parts[:-1]:
        # The list grows during the loop, as an annotation may be a list, a union, or both.
        annotations = [table.model_fields[str(part)].annotation for table in tables if str(part) in table.model_fields]
        for annotation in annotations:
            annotations += get_args(annotation)
        # An index or the name of a variant leads to no other table.
        tables = [kind for kind in annotations if isinstance(kind, type) and issubclass(kind, BaseModel)] or tables
    return did_you_mean(str(parts[-1]), [key for table in tables for key in table.model_fields])
