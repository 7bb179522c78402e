"""Plans in a forecast hold in the local wind of each leg, or say where they do not."""

import math
from pathlib import Path

import numpy as np
import pytest

import planfly
from logs.verdict.judge_geometry import judge_geometry
from planfly.api.planning import stop_condition
from planfly.cli import main
from planfly.planning import pareto_plans
from planfly.planning.local_wind import limits_at_ground_speed, max_ground_speed_ratio
from planfly.planning.pareto_plans import make_pareto_plans
from planfly.workflow.open_flight import open_flight
from planfly.workflow.uav import load_uav
from planner.plan import Plan
from tests.planner.search.test_search_in_forecast import LATITUDES, LEVELS, SCENARIO, scenario_in
from tests.world.made.forecast_files import ISSUED, LONGITUDES, wind_dataset, write_netcdf
from world.arrays import Floats
from world.errors import ForecastError
from world.scenario import load_scenario

AIRSPEED_MPS = 25.0
# m/s at 50, 200, 400 and 900 m AMSL: calm at the start, as in `h_time`, a tailwind above.
SHEAR_BY_HEIGHT = np.array([-6.0, -1.0, 5.0, 12.0])[:, np.newaxis, np.newaxis]
# 12 m/s to the east in the south, and to the west in the north.
SHEAR_BY_LATITUDE = np.clip((46.0 - LATITUDES) * 111.2 / 2.0 * 12.0, -12.0, 12.0)[:, np.newaxis]


def fast_scenario_in(folder: Path, eastward: Floats) -> Path:
    """Write a scenario whose plan takes the least time, and its forecast with an eastward wind, m/s."""
    file = scenario_in(folder, eastward)
    file.write_text(SCENARIO.format(at=ISSUED).replace('"energy"', '"time"'), encoding="utf-8")
    return file


def failed_rules(plan: Plan) -> set[str]:
    """Return the rules of slopes and turns by which the geometric verdict on a plan fails."""
    findings = judge_geometry(open_flight(plan, {})).findings
    assert {finding.rule for finding in findings} >= {"slope", "turn"}
    return {finding.rule for finding in findings if finding.ok is False} & {"slope", "turn"}


@pytest.mark.parametrize("eastward", [SHEAR_BY_HEIGHT, SHEAR_BY_LATITUDE])
def test_a_safe_plan_passes_its_own_verdict_in_the_wind_of_each_leg(eastward: Floats, tmp_path: Path) -> None:
    plan = planfly.plan(fast_scenario_in(tmp_path, eastward), seed=1)
    assert plan.safe
    assert failed_rules(plan) == set()


def test_every_plan_of_a_front_passes_too(tmp_path: Path) -> None:
    front = planfly.plan_front(fast_scenario_in(tmp_path, SHEAR_BY_HEIGHT), 3, seed=1, seconds=3.0)
    assert front.plans
    assert [failed_rules(one.plan) for one in front.plans] == [set()] * len(front.plans)


def test_a_path_of_ones_own_that_does_not_hold_names_the_leg_and_the_wind(tmp_path: Path) -> None:
    # The aircraft climbs 12.9 degrees in calm air, as at the start; with 18 m/s of tailwind, as east of 1.6 km,
    # atan(25.5 sin / (25.5 cos + 18)) is 7.6 degrees.
    longitudes = np.linspace(7.8, 8.2, 41)
    eastward = np.clip((longitudes - 8.0) / 0.02, 0.0, 1.0) * 18.0
    file = scenario_in(tmp_path, np.zeros((1, 1)))
    write_netcdf(
        tmp_path / "winds.nc",
        wind_dataset(eastward, 0.0, kind="altitude", levels=LEVELS, latitudes=LATITUDES, longitudes=longitudes),
    )
    rise = 1000.0 * math.tan(math.radians(8.2))
    steep = np.array([[-6000.0, 0.0, 250.0], [2e3, 0.0, 300.0], [3e3, 0.0, 300.0 + rise], [6000.0, 0.0, 250.0]])
    plan = planfly.plan(file, waypoints=steep)
    (problem,) = plan.certificate.problems
    assert problem.startswith(
        "in the local wind of the forecast: leg 1 climbs at 8.2° for 1000 m; the aircraft's limit is 7.6° at "
    )
    assert problem.endswith(", with 18 m/s tailwind")
    assert not plan.safe


@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_slopes_are_inverse_to_the_ground_speed_and_radii_to_its_square(ratio: float, tmp_path: Path) -> None:
    limits = load_uav(load_scenario(scenario_in(tmp_path, np.zeros((1, 1))))).limits
    tight = limits_at_ground_speed(limits, ratio)
    for slope, tight_slope in zip(limits.slopes(0.0, 300.0), tight.slopes(0.0, 300.0), strict=True):
        # tan of the slope over the ground is the climb rate over the ground speed.
        speed = AIRSPEED_MPS * math.cos(slope), AIRSPEED_MPS * math.cos(tight_slope)
        assert speed[1] * math.tan(tight_slope) == pytest.approx(speed[0] * math.tan(slope) / ratio, rel=2e-3)
    radii = [one.turn_radius(0.0, 1.0, 300.0) for one in (limits, tight)]
    assert radii[1] == pytest.approx(ratio**2 * radii[0])


def test_the_largest_ratio_of_ground_speeds_on_the_map(tmp_path: Path) -> None:
    # 10 m/s from the west east of 8.05 E, and calm west of 8 E, where the mission begins.
    eastward = np.clip((LONGITUDES - 8.0) / 0.05, 0.0, 1.0) * 10.0
    scenario = load_scenario(scenario_in(tmp_path, eastward))
    ratio = max_ground_speed_ratio(scenario, AIRSPEED_MPS, 400.0)
    assert ratio == pytest.approx((AIRSPEED_MPS + 10.0) / AIRSPEED_MPS, rel=1e-3)


# ----------------------------------------------------------------------
# A flight that the forecast does not cover.


def scenario_in_short_forecast(folder: Path, minutes: float) -> Path:
    """Write a scenario of 12 km, 8 minutes at 25 m/s, and a forecast of so many minutes."""
    hours = (0.0, minutes / 60.0)
    dataset = wind_dataset(3.0, 0.0, kind="altitude", levels=LEVELS, latitudes=LATITUDES, hours=hours)
    write_netcdf(folder / "winds.nc", dataset)
    file = folder / "short.toml"
    file.write_text(SCENARIO.format(at=ISSUED), encoding="utf-8")
    return file


@pytest.mark.parametrize(("minutes", "code"), [(5.0, 2), (60.0, 0)])
@pytest.mark.parametrize("front", [False, True])
def test_a_plan_that_outlasts_its_forecast_is_refused(
    minutes: float, code: int, front: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = scenario_in_short_forecast(tmp_path, minutes), tmp_path / "out"
    options = ["--front", "2", "--budget", "3s"] if front else []
    target = out if front else tmp_path / "plan.json"
    assert main(["plan", str(file), "--out", str(target), *options]) == code
    assert any(tmp_path.rglob("plan*.json")) == (code == 0)
    error = capsys.readouterr().err
    assert ("the flight takes 8.0 min, but the forecast ends at 2026-05-01 06:05 UTC" in error) == (code == 2)


def test_an_alternative_beyond_the_forecast_is_left_out_of_a_front(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario(scenario_in_short_forecast(tmp_path, 60.0))

    def refuse(*_: object, **__: object) -> Plan:
        raise ForecastError("winds.nc: time: too long")

    monkeypatch.setattr(pareto_plans, "finish_plan", refuse)
    front = make_pareto_plans(scenario, load_uav(scenario), 1, 3, stop=stop_condition(1.0, None))
    assert [one.plan for one in front.plans] == [front.default.plan]
