"""What flights beside a recorded one gave: written, read back, and refused where it does not fit."""

import json
from pathlib import Path
from typing import Any

import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.beside_file import beside_json, parse_beside
from logs.verdict.levels import AirframeAnswer, DecidingParameter, FlownBeside
from logs.verdict.places import Place
from world.errors import LogError

FAILED = (("clearance", Place("leg", 4)), ("threat", Place("missile", 0, name="Alfa")))
DECIDING = DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", Place("leg", 4), -8.25)
BESIDE = [
    FlownBeside(),
    FlownBeside(AirframeAnswer(True, "flyable")),
    FlownBeside(AirframeAnswer(False, "not flyable: …", FAILED)),
    FlownBeside(AirframeAnswer(True, "flyable"), DECIDING),
]


@pytest.mark.parametrize("beside", BESIDE)
def test_it_reads_back(beside: FlownBeside) -> None:
    assert parse_beside(beside_json(beside), "a.mcap") == beside


@pytest.mark.parametrize("beside", [None, *BESIDE])
def test_a_log_carries_it(tmp_path: Path, setup: FlightSetup, track: Track, beside: FlownBeside | None) -> None:
    path = tmp_path / "flight.mcap"
    with Recorder(path, setup) as recorder:
        recorder.write(track)
        recorder.finish("completed", beside=beside)
    log = read_log(path)
    assert (log.beside, log.complete) == (beside, True)


def changed(**fields: Any) -> bytes:
    return json.dumps(json.loads(beside_json(BESIDE[3])) | fields).encode()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "a.mcap: "),
        (b"{}", "a.mcap: airframe"),
        (changed(schema="planfly.beside/9"), "a.mcap: schema"),
        (changed(more=1), "a.mcap: more"),
        (changed(airframe={"flyable": True, "headline": "", "failed": [["juggling", {}]]}), "a.mcap: airframe"),
        (changed(airframe=7), "a.mcap: airframe"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_line(data: bytes, said: str) -> None:
    with pytest.raises(LogError) as refused:
        parse_beside(data, "a.mcap")
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)


def test_a_rule_that_there_is_not_is_refused() -> None:
    place = {"kind": "leg", "index": 1, "item": None, "name": ""}
    airframe = {"flyable": False, "headline": "", "failed": [["juggling", place]]}
    with pytest.raises(LogError, match="'juggling' is no rule"):
        parse_beside(changed(airframe=airframe), "a.mcap")
