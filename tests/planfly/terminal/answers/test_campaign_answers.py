"""The schemas of campaigns are not empty; what campaigns write is held to them where campaigns are flown."""

import jsonschema
import pytest

from tests.planfly.terminal.answers.checked_answers import validate


@pytest.mark.parametrize("command", ["campaign", "winds"])
def test_an_empty_answer_is_none(command: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        validate(command, {})
