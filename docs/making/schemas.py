"""Tables of the ``--json`` output of commands, generated from their JSON schemas."""

import json
from typing import Any

from planfly.terminal.schemas import answer_objects, commands_with_json, schema_text


def schema_tables(command: str) -> str:
    """Return the fields of a command's answer and of its nested objects: name, type, meaning."""
    schema = json.loads(schema_text(command))
    parts = [_table(answer_objects(schema)[0])]
    for name, one in schema.get("$defs", {}).items():
        parts.append(f"**{name}**: {one.get('description', '')}\n\n{_table(one)}")
    return "\n\n".join(parts)


def _table(schema: dict[str, Any]) -> str:
    rows = [
        f"| `{name}` | {_type(one)} | {' '.join(one.get('description', '').split()).replace('|', '/')} |"
        for name, one in schema.get("properties", {}).items()
    ]
    return "| field | type | meaning |\n|---|---|---|\n" + "\n".join(rows)


def _type(one: dict[str, Any]) -> str:
    if "$ref" in one:
        return one["$ref"].rpartition("/")[2]
    if "const" in one:
        return f"`{one['const']}`"
    if "enum" in one:
        return " or ".join(f"`{value}`" for value in one["enum"])
    for key in ("anyOf", "oneOf"):
        if key in one:
            return " or ".join(_type(other) for other in one[key])
    if "additionalProperties" in one and "properties" not in one:
        return f"object of {_type(one['additionalProperties'])}"
    if one.get("type") == "array":
        return f"list of {_type(one.get('items', {}))}"
    return str(one.get("type", "any"))


def answer_table() -> str:
    """Return one row per command: the name of its schema, and its top-level fields."""
    rows = []
    for command in commands_with_json():
        schema = json.loads(schema_text(command))
        for one in answer_objects(schema):
            fields = one.get("properties", {})
            name = fields.get("schema", {}).get("const", "")
            rows.append(f"| `{command}` | `{name}` | {', '.join(f'`{key}`' for key in fields if key != 'schema')} |")
    return "| command | schema | fields |\n|---|---|---|\n" + "\n".join(rows)
