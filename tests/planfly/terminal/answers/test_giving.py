"""Every command with --json has a schema that is one, with its command's name in it."""

import json

import jsonschema
import pytest

from planfly.cli import build_parser
from planfly.terminal.schemas import answer_objects, answer_schema, commands_with_json, schema_text


def test_every_command_with_json_has_a_schema_and_no_other() -> None:
    asked = {name for name, parser in build_parser().commands.items() if "--json" in parser.long_options()}
    assert asked == set(commands_with_json())


@pytest.mark.parametrize("command", commands_with_json())
def test_each_is_a_schema_that_asks_for_its_name(command: str) -> None:
    schema = answer_schema(command)
    jsonschema.Draft202012Validator.check_schema(schema)
    for one in answer_objects(schema):
        assert "schema" in one["required"]
        assert one["additionalProperties"] is False
        assert "planfly" in one["properties"]["schema"]["const"]
    assert json.loads(schema_text(command)) == schema


def test_no_two_answers_have_one_name() -> None:
    objects = [one for command in commands_with_json() for one in answer_objects(answer_schema(command))]
    names = [one["properties"]["schema"]["const"] for one in objects]
    assert len(set(names)) == len(names)


def test_fields_are_described() -> None:
    limit = answer_schema("check")["$defs"]["FindingDocument"]["properties"]["limit_source"]
    assert limit["description"].startswith("Source of the limit: scenario, aircraft")
