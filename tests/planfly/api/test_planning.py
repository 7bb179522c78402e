"""A scenario by name, path or itself, and what keywords change in it."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planfly
from aircraft.catalog import aircraft_names, load_aircraft
from planfly.api.planning import stop_condition
from planfly.cli import main
from planfly.flight_options import FlightOptions, apply_options, load_scenario_with_options
from planfly.workflow.uav import load_uav
from planner.plan import plan_json, read_plan
from planner.search.plan_path import plan_path
from tests.planfly.conftest import FIELD
from tests.setups import small_scenario
from world.compile_events import COMPILE_TIMER
from world.errors import ScenarioError
from world.scenario import embedded_names, load_scenario, with_wind


def test_a_scenario_is_named_in_three_ways(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FIELD)
    named = load_scenario("tight")
    assert load_scenario_with_options(named, {}).to_json() == named.to_json()
    assert load_scenario_with_options("tight", {}).name == "tight"
    as_text, as_path = (
        load_scenario_with_options(str(tmp_path / "mine.toml"), {}),
        load_scenario_with_options(tmp_path / "mine.toml", {}),
    )
    assert as_text.to_json() == as_path.to_json()


def test_nothing_asked_changes_nothing() -> None:
    scenario = load_scenario("tight")
    assert apply_options(scenario, {}).to_json() == scenario.to_json()


def test_each_keyword_changes_its_own(tmp_path: Path) -> None:
    scenario = load_scenario("tight")
    (tmp_path / "my.parm").write_text("WP_RADIUS 50\n")
    windy = apply_options(scenario, FlightOptions(wind=(8.0, 270.0)))
    assert windy.wind.speed == 8.0
    assert np.degrees(windy.wind.from_course) == pytest.approx(270.0)
    assert apply_options(scenario, FlightOptions(turbulence="light")).wind.turbulence == "light"
    assert apply_options(scenario, FlightOptions(airspeed=28.0)).flight.airspeed_mps == 28.0
    assert apply_options(scenario, FlightOptions(guidance="l1")).flight.steering.guidance == "l1"
    assert apply_options(scenario, FlightOptions(nav="rtk")).flight.steering.nav == "rtk"
    for params in (tmp_path / "my.parm", str(tmp_path / "my.parm")):
        assert apply_options(scenario, FlightOptions(params=params)).flight.params == str(tmp_path / "my.parm")


def test_parameters_mean_arduplane_and_a_law_of_guidance_takes_its_place(tmp_path: Path) -> None:
    mine = tmp_path / "mine.parm"
    mine.write_text("WP_RADIUS 80\n", encoding="utf-8")
    scenario = small_scenario(wind={"speed_mps": 3.0, "from_deg": 200.0, "turbulence": "light"})
    by_arduplane = apply_options(scenario, FlightOptions(params=mine))
    assert by_arduplane.flight.steering == ("ardupilot", "path", "gnss")
    assert by_arduplane.flight.params == str(mine)
    again = apply_options(by_arduplane, FlightOptions(guidance="l1")).flight
    assert (again.params, again.steering) == (None, ("planfly", "l1", "perfect"))
    assert apply_options(scenario, FlightOptions(params=mine, nav="rtk")).flight.steering.nav == "rtk"
    # A program is an ArduPlane, whatever the scenario says.
    assert (
        apply_options(apply_options(scenario, {"guidance": "l1"}), {}, Path("arduplane")).flight.steering.autopilot
        == "ardupilot"
    )


def test_an_aircraft_is_a_name_or_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_scenario("tight")
    assert apply_options(scenario, FlightOptions(aircraft="c172x")).flight.aircraft == "c172x"
    monkeypatch.chdir(tmp_path)
    # A path is a folder even where it looks like a name.
    with pytest.raises(planfly.ArgumentError, match=str(tmp_path / "c172x")):
        apply_options(scenario, FlightOptions(aircraft=Path("c172x")))


def test_a_value_that_no_scenario_may_have_is_refused() -> None:
    with pytest.raises(ScenarioError, match="speed_mps: 50"):
        apply_options(load_scenario("tight"), FlightOptions(wind=(50.0, 0.0)))


# ----------------------------------------------------------------------
# `planfly.plan` and `planfly.scenarios`: the planner's own plans, by every way to name a scenario.


def test_it_is_the_planners_plan(path: planfly.Plan) -> None:
    scenario = load_scenario("paper-07")
    assert plan_json(path) == plan_json(plan_path(scenario, load_uav(scenario).limits, seed=1))


@pytest.mark.parametrize("kind", [str, Path])
def test_a_file_is_named_as_text_or_path_and_the_plan_is_written(kind: type, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FIELD)
    made = planfly.plan(kind(tmp_path / "mine.toml"), budget=400, out=kind(tmp_path / "plan.json"))
    assert (tmp_path / "plan.json").read_text() == plan_json(made)
    assert plan_json(read_plan(tmp_path / "plan.json")) == plan_json(made)


def test_options_change_the_scenario_that_is_planned_in() -> None:
    made = planfly.plan(small_scenario(), wind=(6, 90), turbulence="light", airspeed=28, seed=3, budget=300)
    scenario = made.scenario
    assert (scenario.wind.speed, np.degrees(scenario.wind.from_course)) == (6.0, 90.0)
    assert (scenario.wind.turbulence, scenario.flight.airspeed_mps, made.seed) == ("light", 28.0, 3)
    asked = with_wind(small_scenario(), 6.0, np.radians(90.0), "light")
    assert asked.wind == scenario.wind


def test_waypoints_of_ones_own_are_certified_as_they_stand(path: planfly.Plan, tmp_path: Path) -> None:
    again = planfly.plan(path.scenario, waypoints=path.waypoints.tolist(), out=tmp_path / "mine.json")
    assert again.certificate == path.certificate
    assert (again.violations, again.objectives) == (path.violations, path.objectives)
    assert (again.algorithm, again.evaluations, planfly.what_blocks(again)) == ("given", 0, ())
    assert plan_json(read_plan(tmp_path / "mine.json")) == plan_json(again)
    # 10 m in the ground, and nothing is moved out of it.
    low, terrain = np.array(path.waypoints), path.scenario.terrain
    assert terrain is not None
    low[3, 2] = terrain.height(low[3, 0], low[3, 1]) - 10.0
    mine = planfly.plan(path.scenario, waypoints=low)
    assert mine.waypoints.tolist() == low.tolist()
    assert not mine.feasible
    assert mine.certificate.clearance <= -10.0 - path.scenario.limits.min_clearance_m
    assert any("below ground at its lowest point" in line for line in planfly.what_blocks(mine))


def test_a_plan_of_given_waypoints_has_departure_and_landing_and_flies() -> None:
    """As every plan of this scenario, whose flights begin and end on the ground."""
    searched = planfly.plan("jacksboro", seed=1)
    given = planfly.plan("jacksboro", waypoints=searched.waypoints, seed=1)
    assert given.procedures is not None
    assert given.procedures.climb is not None
    assert given.procedures.descent is not None
    assert given.certificate == searched.certificate
    assert given.safe


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda points: points[:, :2], r"of shape \(\d+, 2\): expected an array \(w, 3\)"),
        (lambda points: points[:1], r"of shape \(1, 3\): expected an array \(w, 3\) of at least 2 rows"),
        (lambda points: "west", r"waypoints str: expected an array"),
        (lambda points: _with(points, 2, 1, np.nan), r"waypoints row 2: north nan: allowed -500000\.\.500000 m"),
        (lambda points: _with(points, 4, 2, np.inf), r"waypoints row 4: altitude inf: allowed"),
        (lambda points: _with(points, 0, 2, points[0, 2] + 2), r"row 0: 2 m from the scenario's start: expected \("),
        (lambda points: points[:-1], r"m from the scenario's destination: expected .*planfly\.make_scenario"),
    ],
)
def test_waypoints_that_are_no_path_of_the_scenario_are_refused_by_row(
    path: planfly.Plan, change: Any, said: str
) -> None:
    with pytest.raises(planfly.ArgumentError, match=said) as refused:
        planfly.plan(path.scenario, waypoints=change(np.array(path.waypoints)))
    assert "\n" not in str(refused.value)


def _with(points: Any, row: int, column: int, value: float) -> Any:
    points[row, column] = value
    return points


def test_all_margins_of_a_path_are_kept_exactly_if_it_is_safe(path: planfly.Plan) -> None:
    """Of 100 paths around a plan, from a metre to far off the map; a search can be told of all of them."""
    rng, waves = np.random.default_rng(5), np.sin(np.outer(np.linspace(0.0, np.pi, len(path.waypoints)), [1, 2, 3]))
    safe = 0
    for size in np.geomspace(1.0, 60_000.0, 100):
        moved = np.array(path.waypoints) + waves @ (rng.normal(0.0, 1.0, (3, 3)) * [size, size, 0.05 * size])
        plan = planfly.plan(
            path.scenario, waypoints=np.concatenate([path.waypoints[:1], moved[1:-1], path.waypoints[-1:]])
        )
        assert all(margin >= 0.0 for margin in plan.margins) is plan.safe, (plan.margins, planfly.what_blocks(plan))
        assert plan.margins[:8] == pytest.approx(plan.certificate.margins, nan_ok=True)
        safe += plan.safe
    assert 5 < safe < 80
    # The last path is off the terrain: no height above ground is known, and it is outside the map.
    assert np.isnan(plan.certificate.clearance)
    assert plan.certificate.bounds < -1000.0
    assert any("leaves the terrain data" in line for line in planfly.what_blocks(plan))


def test_given_waypoints_are_not_searched(path: planfly.Plan) -> None:
    with pytest.raises(
        planfly.ArgumentError,
        match="algorithm fda: cannot be combined with waypoints, because nothing is then searched",
    ):
        planfly.plan(path.scenario, waypoints=path.waypoints, algorithm="fda")


def test_compiling_takes_nothing_of_a_budget_in_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("planfly.api.planning.time.monotonic", lambda: now[0])
    should_stop = stop_condition(20.0, None)
    # 25 s later, of which 24 s were spent compiling, 1 s of the 20 s is over.
    now[0] += 25.0
    monkeypatch.setattr(COMPILE_TIMER, "seconds", COMPILE_TIMER.seconds + 24.0)
    assert should_stop() == ""
    now[0] += 18.9
    assert should_stop() == ""
    now[0] += 0.2
    assert should_stop() == "budget"


def test_a_number_given_as_text_is_refused_in_a_line() -> None:
    with pytest.raises(planfly.ArgumentError, match=r"^seconds '5': expected a number of seconds"):
        planfly.plan("tight", seconds="5")  # type: ignore[arg-type]


def test_a_budget_in_evaluations_and_one_in_seconds_end_it() -> None:
    # A generation of 250 paths is evaluated whole.
    assert planfly.plan("hard-60", algorithm="umda", budget=600).evaluations == 750
    assert planfly.plan("hard-60", algorithm="umda", budget=2000).evaluations == 2000
    assert planfly.plan("hard-60", algorithm="umda", seconds=0.001).ended == "budget"


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"algorithm": "ga"}, "planner.algorithm"),
        ({"wind": (50, 0)}, "speed_mps"),
        ({"turbulence": "severe"}, "turbulence"),
        ({"budget": 1}, "budget"),
        ({"nav": "dead reckoning"}, "nav"),
    ],
)
def test_bad_input_is_one_line_and_its_data(options: dict[str, object], field: str) -> None:
    with pytest.raises(planfly.PlanflyError) as caught:
        planfly.plan("tight", **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert field in caught.value.field


def test_a_file_is_named_as_its_format(path: planfly.Plan, tmp_path: Path) -> None:
    with pytest.raises(planfly.PlanflyError, match=r"p\.txt: expected a \.json file; planfly\.export writes other"):
        planfly.plan("tight", out=tmp_path / "p.txt")
    with pytest.raises(planfly.PlanflyError, match=r"x\.csv: expected a \.mcap file; planfly\.export writes other"):
        planfly.fly(path, log=tmp_path / "x.csv")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_written_for_bad_input(tmp_path: Path) -> None:
    with pytest.raises(planfly.ScenarioError):
        planfly.plan("tight", algorithm="ga", out=tmp_path / "plan.json")
    assert list(tmp_path.iterdir()) == []


def test_the_scenarios_are_those_embedded() -> None:
    found = planfly.scenarios()
    assert tuple(found) == tuple(embedded_names())
    assert found["tight"] == load_scenario("tight").spec.description


# ----------------------------------------------------------------------
# `planfly.aircraft`: those embedded, and one in a folder.


def test_without_a_name_all_embedded_ones_come() -> None:
    assert planfly.aircraft() == {name: load_aircraft(name) for name in aircraft_names()}


@pytest.mark.parametrize("kind", [str, Path])
def test_a_folder_is_named_as_text_or_path(kind: type, tmp_path: Path) -> None:
    shutil.copytree(load_aircraft("aerosonde").folder, tmp_path / "mine")
    (tmp_path / "mine" / "aerosonde.toml").rename(tmp_path / "mine" / "mine.toml")
    (tmp_path / "mine" / "aerosonde.xml").rename(tmp_path / "mine" / "mine.xml")
    found = planfly.aircraft(kind(tmp_path / "mine"))
    assert (found.name, found.mass, found.folder) == ("mine", load_aircraft("aerosonde").mass, tmp_path / "mine")


@pytest.mark.parametrize(
    ("name", "file"), [("cessna", "cessna"), (Path("nowhere"), str(Path("nowhere/nowhere.toml").resolve()))]
)
def test_a_name_that_is_none_is_bad_input(name: str | Path, file: str) -> None:
    with pytest.raises(planfly.FlightError) as caught:
        planfly.aircraft(name)
    assert caught.value.file == file


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"budget": 3}, "budget"),
        ({"seconds": 0.0}, "seconds"),
        ({"wind": (5.0, 361.0)}, "wind"),
    ],
)
def test_a_number_out_of_its_range_names_its_keyword(given: dict[str, Any], field: str, tmp_path: Path) -> None:
    with pytest.raises(planfly.ArgumentError, match="expected") as caught:
        planfly.plan("tight", out=tmp_path / "plan.json", **given)
    assert caught.value.field == field
    assert isinstance(caught.value, ValueError)
    assert not (tmp_path / "plan.json").exists()


def test_planning_again_keeps_what_is_flown_and_goes_round_a_new_threat(tmp_path: Path) -> None:
    """As the command plans again, byte for byte."""
    old = planfly.plan("hard-07", seed=1, out=tmp_path / "plan.json")
    east, north, _ = old.waypoints[6].tolist()
    threat = (east, north, 300.0, 0.0)
    new = planfly.replan("hard-07", tmp_path / "plan.json", 3, threats=[threat], seed=1, out=tmp_path / "new.json")
    assert (new.safe, new.flown_legs) == (True, 3)
    assert np.array_equal(new.waypoints[:4], old.waypoints[:4])
    line = ["plan", "hard-07", "--from", str(tmp_path / "plan.json"), "--at-leg", "3", "--seed", "1"]
    assert main([*line, f"--add-threat={east},{north},300,0", "--out", str(tmp_path / "theirs.json")]) == 0
    assert (tmp_path / "new.json").read_bytes() == (tmp_path / "theirs.json").read_bytes()
    with pytest.raises(planfly.MissionError, match="at_leg 99: the plan has legs"):
        planfly.replan("hard-07", old, 99)
    with pytest.raises(planfly.ScenarioError, match=r"threats: east 400000 m, .*: outside the terrain"):
        planfly.replan("hard-07", old, 1, threats=[(4e5, 0.0, 10.0, 0.0)])
    with pytest.raises(planfly.ArgumentError, match=r"threats of shape \(1, 3\): expected .*array \(n, 4\)"):
        planfly.replan("hard-07", old, 1, threats=[(0.0, 0.0, 100.0)])
    # The same threat, as columns with its name and its height.
    columns = {"name": ["S-1"], "east_m": [east], "north_m": [north], "kill_radius_m": [300.0], "height_m": [0.0]}
    named = planfly.replan("hard-07", old, 3, threats=columns, seed=1)
    assert named.waypoints.tolist() == new.waypoints.tolist()
    assert named.scenario.threats.names[-1] == "S-1"


def test_a_search_stops_where_it_is_told(tmp_path: Path) -> None:
    made = planfly.plan("tight", algorithm="umda-smooth", stop=lambda: True)
    assert made.ended == "interrupted"


def test_a_data_frame_of_waypoints_is_taken_by_the_names_of_its_columns() -> None:
    import pandas as pd

    scenario = small_scenario()
    points = np.stack([scenario.start, 0.5 * (scenario.start + scenario.destination), scenario.destination])
    expected = planfly.plan(scenario, waypoints=points).waypoints
    for names in (("east_m", "north_m", "amsl_m"), ("east", "north", "amsl"), ("east_m", "north_m", "up_amsl_m")):
        frame = pd.DataFrame(dict(zip(names, points.T, strict=True)) | {"speed": 25.0})
        turned = frame[["speed", *reversed(names)]]
        np.testing.assert_array_equal(planfly.plan(scenario, waypoints=turned).waypoints, expected)
    np.testing.assert_array_equal(planfly.plan(scenario, waypoints=pd.DataFrame(points)).waypoints, expected)
    with pytest.raises(planfly.ArgumentError, match=r"waypoints columns x, y, z: expected columns east_m, north_m and"):
        planfly.plan(scenario, waypoints=pd.DataFrame(points, columns=["x", "y", "z"]))


@pytest.mark.parametrize(
    ("length", "max_turn_deg", "is_safe", "is_said"),
    [
        (60.0, 50.0, True, True),
        (600.0, 50.0, True, False),
        (60.0, "aircraft", False, False),
    ],
)
def test_own_waypoints_that_only_a_number_permits_are_said(
    length: float, max_turn_deg: Any, is_safe: bool, is_said: bool
) -> None:
    """At 25 m/s and 30 degrees of bank two turns of 45 degrees need 2 x 25^2 / (9.81 tan 30) x tan 22.5 = 91 m."""
    scenario = small_scenario(
        terrain={"kind": "flat", "amsl_m": 0.0},
        threats=[],
        limits={"max_turn_deg": max_turn_deg, "min_clearance_m": 60.0},
        flight={"autopilot": "planfly", "aircraft": "aerosonde", "airspeed_mps": 25.0, "max_bank_deg": 30.0},
    )
    side = length / np.sqrt(2.0)
    path = [[0.0, 0.0, 150.0], [2000.0, 0.0, 150.0], [2000.0 + side, side, 150.0], [4000.0, side, 150.0]]
    plan = planfly.plan(scenario, waypoints=[*path, [6000.0, 0.0, 150.0]])
    assert plan.safe is is_safe, plan.certificate
    reasons = planfly.what_may_fail(plan)
    assert len(reasons) == is_said
    for reason in reasons:
        assert reason.startswith("flights are expected to fail: the limits of the scenario are looser")
        assert "leg 1: 60 m long, but its turns need 91 m" in reason
