"""Terrain is read from the log alone, bit for bit."""

import dataclasses
from pathlib import Path

import pytest

from flight.simulation.track import Track
from logs.recording.reader import read_log
from tests.logs.log_copies import same
from tests.logs.made_flight import make_setup, record
from world import scenario as scenario_module
from world.scenario import load_scenario


def test_a_dem_comes_from_the_log_and_not_from_its_file(
    tmp_path: Path, track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario("jacksboro")
    assert scenario.terrain is not None
    setup = dataclasses.replace(make_setup(with_plan=False), scenario=scenario)
    path = record(tmp_path / "a.mcap", setup, track)

    def refuse(*_: object) -> None:
        raise AssertionError("the elevation file was opened")

    monkeypatch.setattr(scenario_module, "open_raster", refuse)
    same(read_log(path).setup.scenario, scenario)
