"""Whatever a person brings is opened in its own, a named or a made scenario."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from planfly.airframe import load_airframe
from planfly.open_mission import is_log, open_mission, open_plan
from planfly.pipeline import make_plan
from planner.plan import plan_json
from tests.planfly.conftest import FIELD
from tests.setups import small_scenario
from world.errors import MissionError, PlanflyError
from world.scenario_variants import with_flight

MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.01\t8.0\t120\t1
"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    (tmp_path / "m.waypoints").write_text(MISSION, encoding="ascii")
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    return tmp_path / "m.waypoints"


def test_a_log_is_known_by_its_first_bytes_or_its_name(tmp_path: Path) -> None:
    for name, data, log in (
        ("a.bin", b"\x89MCAP0\r\nrest", True),
        ("damaged.MCAP", b"xxxx", True),
        ("empty.mcap", b"", True),
        ("plan.json", b"{}", False),
    ):
        (tmp_path / name).write_bytes(data)
        assert is_log(tmp_path / name) is log, name
    with pytest.raises(PlanflyError, match="none: cannot be read"):
        is_log(tmp_path / "none")


def test_a_mission_without_a_scenario_gets_one_made_around_it(mission: Path) -> None:
    opened = open_mission(mission, None, None)
    assert (opened.name, opened.setup.seed) == ("m", 1)
    assert opened.setup.scenario.external
    assert opened.setup.scenario.terrain is None
    # 0.01 degrees of a meridian near 46 degrees north are 1111.5 m.
    assert np.linalg.norm(np.diff(opened.setup.route.waypoints[:, :2], axis=0)) == pytest.approx(1111.5, abs=0.5)


def test_a_mission_is_judged_in_the_scenario_that_is_named(mission: Path) -> None:
    slower = open_mission(
        mission, str(mission.parent / "field.toml"), None, seed=9, change=lambda s: with_flight(s, airspeed_mps=21.0)
    )
    assert (slower.setup.scenario.name, slower.setup.seed) == ("field", 9)
    assert slower.setup.scenario.wind.speed == 3.0
    assert slower.airframe.airspeed == 21.0
    assert (slower.setup.route.airspeed == 21.0).all()


def test_a_plan_is_opened_in_its_own_scenario_unless_another_is_named(mission: Path, tmp_path: Path) -> None:
    scenario = small_scenario()
    plan = make_plan(scenario, load_airframe(scenario), 3)
    file = tmp_path / "plan.json"
    file.write_text(plan_json(plan), encoding="utf-8")
    opened = open_plan(file)
    np.testing.assert_array_equal(opened.plan.waypoints, plan.waypoints)
    own = open_mission(file, None, None)
    assert (own.setup.scenario.name, own.setup.seed, own.name) == ("small", 3, "small")
    assert own.setup.plan is not None
    np.testing.assert_allclose(own.setup.route.waypoints, plan.waypoints, atol=0.02)
    other = open_mission(file, str(mission.parent / "field.toml"), None, seed=4)
    assert (other.setup.scenario.name, other.setup.seed, other.name) == ("field", 4, "plan")
    assert other.setup.plan is None
    assert dataclasses.replace(other.setup.mission, source="") == dataclasses.replace(opened.mission, source="")


def test_what_is_not_there_names_what_is_expected(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match=r"no such file; a plan\.json, \.waypoints or \.plan file is expected"):
        open_mission(tmp_path / "none.plan", None, None)


def test_a_mission_that_lies_beside_the_name_is_named(mission: Path) -> None:
    (mission.parent / "m.waypoints.bak").write_text("", encoding="ascii")
    with pytest.raises(MissionError, match=r"file is expected: did you mean 'm\.waypoints'\?$"):
        open_mission(mission.with_name("n.waypoints"), None, None)
    with pytest.raises(MissionError, match=r"file is expected$"):
        open_mission(mission.parent / "nowhere" / "m.waypoints", None, None)
