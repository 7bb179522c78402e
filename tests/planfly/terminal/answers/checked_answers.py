"""A command's answer, run as a person does, and held to its schema by an outside validator."""

import json
from typing import Any

import jsonschema
import pytest

from planfly.cli import main
from planfly.terminal.schemas import answer_schema


def validate(command: str, answer: object) -> None:
    """Raises ValidationError for an answer that its command's schema does not allow."""
    jsonschema.Draft202012Validator(answer_schema(command)).validate(answer)


def answered(capsys: pytest.CaptureFixture[str], code: int, *argv: str) -> dict[str, Any]:
    """The answer of a command: all that stands on standard output."""
    capsys.readouterr()
    assert main([*argv, "--json", "-"]) == code
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    validate(argv[0], answer)
    assert answer.get("exit_code", code) == code
    return answer
