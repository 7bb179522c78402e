"""Clearance is also shown less the terrain's stated error, where one is stated."""

from pathlib import Path

import pytest

from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.judge_flight import judge_flight, judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import fly_path, make_setup
from world.errors import ScenarioError
from world.scenario_file import parse_scenario

LEVEL = [[0, 0, 300], [0, 3000, 300]]
STATED = {"kind": "flat", "amsl_m": 230.0, "vertical_error_m": 16.0}


def test_both_levels_show_it_and_it_decides_nothing() -> None:
    setup = make_setup(LEVEL, terrain=STATED, limits={"min_clearance_m": 60.0})
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        item = of(verdict, "clearance", "leg 0")
        assert item.ok is True
        assert "54.0 m less the terrain's stated error of 16 m, less than the 60 m required" in item.reason
        assert "Terrain's stated error: 16 m; the least clearance is 70.0 m, 54.0 m less that error" in verdict.summary
    high = make_setup(LEVEL, terrain=STATED, limits={"min_clearance_m": 50.0})
    assert "than the 50 m required" not in of(judge_geometry(high), "clearance").reason


def test_nothing_is_said_where_none_is_stated() -> None:
    setup = make_setup(LEVEL, terrain={"kind": "flat", "amsl_m": 230.0})
    verdict = judge_geometry(setup)
    assert "stated error" not in verdict.summary + of(verdict, "clearance").reason


def test_a_log_carries_it(tmp_path: Path) -> None:
    setup = make_setup(LEVEL, terrain=STATED)
    track = fly_path(setup)
    with Recorder(tmp_path / "flight.mcap", setup) as recorder:
        recorder.write(track)
        recorder.finish("completed", judge_flight(setup, track, "completed"))
    again = read_log(tmp_path / "flight.mcap").setup.scenario
    assert again.terrain is not None
    assert again.terrain.vertical_error == 16.0


@pytest.mark.parametrize(("value", "said"), [("-1", "allowed 0..1000"), ('"16"', "number"), ("nan", "allowed 0..1000")])
def test_a_bad_value_is_refused(value: str, said: str) -> None:
    text = f'name = "x"\n[terrain]\nkind = "flat"\namsl_m = 0\nvertical_error_m = {value}\n'
    with pytest.raises(ScenarioError, match=r"terrain\.vertical_error_m") as caught:
        parse_scenario(text, "x.toml")
    assert said in str(caught.value)
