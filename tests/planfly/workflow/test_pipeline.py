"""The chain of stages: what is flown is recorded and judged, and a plan that is not feasible is not flown."""

import json
from pathlib import Path

import numpy as np
import pytest

from logs.recording.reader import read_log
from logs.verdict.verdict import verdict_json
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import FlightTask, fly_and_judge, plan_then_fly
from planfly.workflow.uav import load_uav
from tests.setups import small_scenario, waypoint_mission

POINTS = np.array([[0.0, 0.0, 300.0], [900.0, 0.0, 300.0], [1500.0, 300.0, 320.0]])


def test_a_thinned_log_holds_the_rows_that_were_judged(tmp_path: Path) -> None:
    scenario = small_scenario(terrain={"kind": "flat", "amsl_m": 0}, threats=[])
    uav = load_uav(scenario)
    mission = waypoint_mission(POINTS, np.array([25.0, 22.0]), scenario.origin)
    setup = make_setup(scenario, uav, mission, 7)
    assert (setup.seed, setup.aircraft, setup.battery) == (7, "aerosonde", uav.battery)
    assert setup.route.leg_airspeeds.tolist() == [25.0, 22.0]
    np.testing.assert_allclose(setup.route.positions, POINTS, atol=0.02)
    reports: list[tuple[float, float, str]] = []
    whole = fly_and_judge(setup, FlightTask(advance=lambda *report: reports.append(report)))
    thin = fly_and_judge(setup, FlightTask(tmp_path / "f.mcap", every=3))
    log = read_log(tmp_path / "f.mcap")
    assert log.complete
    assert log.ended == whole.ended == "completed"
    assert [event.text for event in log.events] == [f"flight model: {thin.engine}", "flight ended: completed"]
    assert thin.engine.startswith("compiled model")
    assert len(log.track) == len(thin.track) < len(whole.track) / 2
    assert log.track.position.tobytes() == thin.track.position.tobytes()
    kept = np.isin(whole.track.time, thin.track.time)
    assert thin.track.position.tobytes() == whole.track.position[kept].tobytes()
    assert thin.track.time[-1] == whole.track.time[-1]
    assert thin.verdict.flyable
    assert log.recorded_verdict == json.loads(verdict_json(thin.verdict))
    done, length, remark = reports[-1]
    # 900 m and the root of 600^2 + 300^2.
    assert length == pytest.approx(900.0 + 670.8, rel=0.03)
    assert done == pytest.approx(length, rel=0.02)
    assert remark.endswith(" of 1.6 km") or remark.endswith(" of 1.5 km")


def test_plan_then_fly_goes_from_start_to_destination(tmp_path: Path) -> None:
    scenario = small_scenario()
    result = plan_then_fly(scenario, seed=2, log=tmp_path / "f.mcap")
    assert result.plan.feasible
    assert result.plan.seed == 2
    np.testing.assert_allclose(result.plan.waypoints[[0, -1]], [scenario.start, scenario.destination])
    assert result.track is not None
    away = np.linalg.norm(result.track.position[[0, -1]] - [scenario.start, scenario.destination], axis=1)
    assert (away < 30.0).all()
    log = read_log(tmp_path / "f.mcap")
    assert log.track.position.tobytes() == result.track.position.tobytes()
    assert log.setup.seed == 2


def test_a_plan_that_is_not_feasible_is_judged_without_a_flight(tmp_path: Path) -> None:
    """A ridge from edge to edge, higher than the ceiling, stands between start and destination."""
    ridge = [{"east_m": 3000, "north_m": north, "height_m": 900, "sigma_m": 300} for north in range(-3000, 3001, 250)]
    scenario = small_scenario(
        terrain={"kind": "peaks", "peak": ridge}, planner={"waypoints": 6, "population": 20, "generations": 2}
    )
    result = plan_then_fly(scenario, log=tmp_path / "f.mcap")
    assert result.track is None
    assert not result.plan.feasible
    assert (result.verdict.flyable, result.verdict.complete) == (False, False)
    assert list(tmp_path.iterdir()) == []
