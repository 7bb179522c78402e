"""verdict.json and its schema are one: a key more or less in either is told."""

import json

import jsonschema
import pytest

from flight.ardupilot.parameters import default_parameters
from flight.simulation.autopilot_program import AutopilotProgram
from logs.recording.example_log import example_log
from logs.verdict.findings import Verdict, verdict_json
from logs.verdict.judge_flight import judge_flight
from logs.verdict.levels import DecidingParameter
from logs.verdict.places import Place
from planfly.terminal.answers.schemas import answer_text
from planfly.terminal.answers.verdict_document import verdict_document
from tests.planfly.terminal.answers.checked_answers import validate


def full_verdict() -> Verdict:
    """A verdict in which nothing is left out."""
    log = example_log()
    judged = judge_flight(log.setup, log.track, "completed")
    deciding = DecidingParameter("NAVL1_PERIOD", 17.0, 14.0, "s", "corridor", Place("leg", 1, to_item=2), None)
    program = AutopilotProgram("ArduPlane 4.7", "0" * 64, {"A": 1.0}, {}, ("B",))
    return Verdict(
        judged.findings, False, True, judged.lines, "flown", judged.levels, deciding,
        program=program, parameters=default_parameters(),
    )  # fmt: skip


def test_the_document_says_what_the_file_says() -> None:
    verdict = full_verdict()
    written = json.loads(verdict_json(verdict))
    assert json.loads(answer_text(verdict_document(verdict))) == written
    validate("check", written)


@pytest.mark.parametrize("key", ["schema", "findings", "levels", "flown_by"])
def test_a_key_that_lacks_or_is_too_many_is_refused(key: str) -> None:
    written = json.loads(verdict_json(full_verdict()))
    del written[key]
    with pytest.raises(jsonschema.ValidationError):
        validate("check", written)
    with pytest.raises(jsonschema.ValidationError):
        validate("check", json.loads(verdict_json(full_verdict())) | {"surprise": 1})
