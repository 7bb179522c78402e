"""A scenario by name, path or itself, and what keywords change in it."""

from pathlib import Path

import numpy as np
import pytest

from planfly.api.changed_scenario import changed_scenario, opened_scenario
from tests.planfly.conftest import FIELD
from world.errors import ScenarioError
from world.scenario import load_scenario


def test_a_scenario_is_named_in_three_ways(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FIELD)
    named = load_scenario("tight")
    assert opened_scenario(named) is named
    assert opened_scenario("tight").name == "tight"
    as_text, as_path = opened_scenario(str(tmp_path / "mine.toml")), opened_scenario(tmp_path / "mine.toml")
    assert as_text.to_json() == as_path.to_json()


def test_nothing_asked_changes_nothing() -> None:
    scenario = load_scenario("tight")
    assert changed_scenario(scenario).to_json() == scenario.to_json()


def test_each_keyword_changes_its_own(tmp_path: Path) -> None:
    scenario = load_scenario("tight")
    (tmp_path / "my.parm").write_text("WP_RADIUS 50\n")
    windy = changed_scenario(scenario, wind=(8.0, 270.0))
    assert windy.wind.speed == 8.0
    assert np.degrees(windy.wind.from_course) == pytest.approx(270.0)
    assert changed_scenario(scenario, turbulence="light").wind.turbulence == "light"
    assert changed_scenario(scenario, airspeed=28.0).flight.airspeed_mps == 28.0
    assert changed_scenario(scenario, guidance="l1").flight.steering.guidance == "l1"
    assert changed_scenario(scenario, nav="rtk").flight.steering.nav == "rtk"
    for params in (tmp_path / "my.parm", str(tmp_path / "my.parm")):
        assert changed_scenario(scenario, params=params).flight.params == str(tmp_path / "my.parm")


def test_an_aircraft_is_a_name_or_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_scenario("tight")
    assert changed_scenario(scenario, aircraft="c172x").flight.aircraft == "c172x"
    monkeypatch.chdir(tmp_path)
    # A path is a folder even where it looks like a name.
    assert changed_scenario(scenario, aircraft=Path("c172x")).flight.aircraft == str(tmp_path / "c172x")


def test_a_value_that_no_scenario_may_have_is_refused() -> None:
    with pytest.raises(ScenarioError, match="speed_mps: 50"):
        changed_scenario(load_scenario("tight"), wind=(50.0, 0.0))
