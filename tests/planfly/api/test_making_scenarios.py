"""A scenario made in Python: its threats from arrays and data frames, other values, and what is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planfly
from tests.world.made.elevation_files import MIDDLE, made_tile, write_geotiff
from world.scenario import embedded_names, load_scenario, with_flight

ROWS = [
    {"name": "a", "east_m": 900.0, "north_m": 90.0, "kill_radius_m": 60.0, "kill_scale_m": 20.0},
    {"name": "b", "east_m": 1500.0, "north_m": -90.0, "detection_radius_m": 300.0},
]
COLUMNS = {
    "name": ["a", "b"],
    "east_m": np.array([900.0, 1500.0]),
    "north_m": np.array([90.0, -90.0]),
    "kill_radius_m": np.array([60.0, 0.0]),
    "kill_scale_m": np.array([20.0, 0.0]),
    "detection_radius_m": np.array([0.0, 300.0]),
}


def frame() -> Any:
    import pandas as pd

    return pd.DataFrame(COLUMNS)


@pytest.mark.parametrize("made", [lambda: ROWS, lambda: COLUMNS, frame], ids=["rows", "columns", "data frame"])
def test_threats_come_from_rows_columns_and_data_frames(made: Any) -> None:
    threats = planfly.make_scenario("tight", threats=made()).threats
    assert list(threats.names) == ["a", "b"]
    assert threats.position[:, :2].tolist() == [[900.0, 90.0], [1500.0, -90.0]]
    assert threats.kill_radius.tolist() == [60.0, 0.0]
    assert threats.detection_radius.tolist() == [0.0, 300.0]
    # A stated scale, and a third of the detection radius.
    assert (threats.kill_scale[0], threats.detection_scale[1]) == (20.0, 100.0)


def test_threats_come_from_an_array_of_places_and_radii() -> None:
    threats = planfly.make_scenario("tight", threats=np.array([[900, 90, 60, 0], [1500, -90, 0, 300]])).threats
    assert threats.kill_radius.tolist() == [60.0, 0.0]
    assert threats.kill_scale[0] == 15.0
    assert len(planfly.make_scenario("tight", threats=[]).threats) == 0


def test_other_tables_are_changed_key_by_key_and_positions_as_a_whole() -> None:
    base = load_scenario("tight")
    made = planfly.make_scenario(
        base,
        name="mine",
        wind={"speed_mps": 4.0, "from_deg": 90.0},
        start={"east_m": 10.0, "north_m": 5.0, "amsl_m": 75.0},
    )
    assert (made.name, made.wind.speed, made.start.tolist()) == ("mine", 4.0, [10.0, 5.0, 75.0])
    assert made.limits == base.limits
    assert made.threats.names == base.threats.names
    assert planfly.make_scenario(base).to_json() == base.to_json()
    assert planfly.make_scenario(base, limits={"min_clearance_m": 40.0}).limits.max_turn_deg == base.limits.max_turn_deg


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"threats": [[1.0, 2.0]]}, r"threats of shape \(1, 2\): expected a data frame"),
        ({"threats": np.zeros((4, 3))}, r"threats of shape \(4, 3\): expected a data frame .*array \(n, 4\)"),
        ({"threats": (0.0, 0.0, 100.0, 200.0)}, r"threats of shape \(4,\): expected a data frame"),
        ({"threats": [[9.0, np.nan, 60.0, 0.0]]}, "threats row 0: north_m nan: expected a number"),
        ({"threats": [("a", 0, 100, 0)]}, "threats list: expected a data frame"),
        ({"threats": 7}, "threats int: expected a data frame"),
        (
            {"threats": {"east_m": [1.0, 2.0], "north_m": [1.0]}},
            r"threats east_m of shape \(2,\), north_m of shape \(1,\): expected columns \(n,\) of equal length",
        ),
        (
            {"threats": {"lat_deg": [46.0, np.nan], "lon_deg": [8.0, 8.0], "kill_radius_m": [60.0, 60.0]}},
            "threats row 1: lat_deg nan: expected a number",
        ),
        (
            {"threats": [[900.0, 90.0, 60.0, 0.0], [900.0, 90.0, np.nan, 300.0]]},
            "^threats row 1: kill_radius_m nan: expected a number: 0 for .*, None for a missing value$",
        ),
        ({"threats": {**COLUMNS, "detection_radius_m": np.array([np.nan, 300.0])}}, "row 0: detection_radius_m nan: "),
        ({"threats": {**COLUMNS, "kill_scale_m": np.array([20.0, np.nan])}}, "row 1: kill_scale_m nan: "),
        ({"threats": [ROWS[0], {**ROWS[1], "kill_radius_m": np.float32(np.nan)}]}, "row 1: kill_radius_m nan: "),
        (
            {"threats": [{**ROWS[0], "kill_radius_m": np.zeros((3, 3))}]},
            "threats row 0: kill_radius_m ndarray: expected",
        ),
        ({"threats": np.array([[900.0, 90.0, 60j, 0.0]])}, "threats ndarray: expected a data frame"),
        (
            {"terrain": {"kind": "dem", "path": np.zeros((3, 3))}},
            "terrain.path array of shape",
        ),
        ({"terrain": np.zeros((3, 3))}, "terrain array of shape"),
        ({"terrain": {"kind": np.zeros((3, 3))}}, "terrain.kind: "),
        ({"area": {"east_m": np.array([-300.0, np.nan])}}, "area.east_m.1: nan: "),
        ({"threats": [{"kill_radius_m": 60.0}]}, r"threats\.0: position: missing; give east_m and north_m, or lat_deg"),
        ({"threats": [{"east_m": 900.0, "north_m": 90.0}]}, "a threat has a missile, a radar, or both"),
        ({"threats": [{**ROWS[0], "colour": "red"}]}, "colour"),
        ({"wind": {"speed_mps": 400.0}}, "wind.speed_mps: 400"),
        ({"winds": {"speed_mps": 4.0}}, "winds"),
        ({"terrain": "field.tif"}, 'terrain: "field.tif": expected a table'),
        ({"terrain": None}, "terrain: "),
        ({"wind": [4.0, 270.0]}, "wind: "),
        ({"name": 7}, "name: 7"),
        ({"wind": {"speed": 4.0}}, "wind.speed: unknown key: did you mean 'speed_mps'"),
        (
            {"threats": [[900.0, 90.0, 60.0, 0.0], [9.0, 9.0, -60.0, 0.0]]},
            r"threats.1.kill_radius_m: -60.0: [^(]*$",
        ),
        ({"planner": {"algorithm": "umda2"}}, "planner.algorithm: 'umda2': unknown; .*did you mean 'umda'"),
    ],
)
def test_values_that_no_scenario_may_have_are_refused_in_a_line(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(planfly.PlanflyError, match=said) as refused:
        planfly.make_scenario("tight", **changes)
    assert "\n" not in str(refused.value)


def test_a_plan_keeps_clear_of_threats_that_were_given() -> None:
    free = planfly.plan("tight", seed=1)
    middle = free.waypoints[len(free.waypoints) // 2]
    scenario = planfly.make_scenario("tight", threats=[[middle[0], middle[1], 45.0, 0.0]])
    path = planfly.plan(scenario, seed=1)
    assert path.objectives.kill_exposure == 0.0
    assert path.safe
    assert path.certificate.kill_distance > 0.0


def test_another_autopilot_replaces_release_guidance_law_and_default_accuracy_of_the_base() -> None:
    for base in ("tight", planfly.make_scenario("tight", flight={"autopilot": "ardupilot"})):
        made = planfly.make_scenario(base, flight={"autopilot": "px4"}).flight
        assert (made.steering.autopilot, made.arduplane_version, made.steering.nav) == ("px4", None, "gnss")
    px4 = planfly.make_scenario("tight", flight={"autopilot": "px4", "px4_version": "1.16", "nav": "perfect"})
    # Its own release stays if the autopilot does, and a stated accuracy always.
    assert planfly.make_scenario(px4, flight={"autopilot": "px4", "airspeed_mps": 24.0}).flight.px4_version == "1.16"
    own = planfly.make_scenario(px4, flight={"guidance": "l1"}).flight
    assert (own.steering.autopilot, own.steering.guidance, own.px4_version) == ("planfly", "l1", None)
    exact = with_flight(load_scenario("tight"), guidance="l1")
    assert exact.flight.steering.nav == "perfect"
    other = planfly.make_scenario(exact, flight={"autopilot": "px4"}).flight.steering
    assert (other.autopilot, other.nav) == ("px4", "gnss")
    assert planfly.make_scenario(px4, flight={"autopilot": "ardupilot"}).flight.steering.nav == "perfect"
    with pytest.raises(planfly.PlanflyError, match=r'arduplane_version: only a key of autopilot = "ardupilot"'):
        planfly.make_scenario("tight", flight={"autopilot": "px4", "arduplane_version": "4.6"})


@pytest.mark.parametrize("values", [{"foo": 1}, {"name": "mine"}, {}])
def test_a_scenario_from_nothing_is_refused_with_the_function_that_makes_one(values: dict[str, Any]) -> None:
    with pytest.raises(planfly.PlanflyError, match=r"^Scenario: .*planfly\.make_scenario makes") as error:
        planfly.Scenario(**values)
    assert "\n" not in str(error.value)


def test_a_field_of_a_wrong_type_is_refused() -> None:
    scenario = planfly.make_scenario("tight")
    for values, said in (
        ({"start": "west"}, r"^Scenario: start: <U4 of shape \(\): expected an array \(3,\) of numbers: "),
        ({"start": [0.0, np.nan, 75.0]}, r"start: \[0.0, nan, 75.0\]: expected"),
        ({"start": [0j, 0j, 75j]}, r"start: \[0j, 0j, 75j\]: expected"),
        ({"bounds": np.zeros((3, 3))}, r"bounds: float64 of shape \(3, 3\): expected an array \(2, 2\) of numbers: "),
        ({"terrain": np.zeros((3, 3))}, "^Scenario: terrain: ndarray: expected a Terrain: planfly.make_scenario makes"),
        ({"threats": np.zeros((3, 4))}, "^Scenario: threats: ndarray: expected a Threats: "),
    ):
        with pytest.raises(planfly.PlanflyError, match=said) as refused:
            replace(scenario, **values)
        assert "\n" not in str(refused.value)
    assert replace(scenario, terrain=None).terrain is None


def test_values_that_a_mask_hides_are_missing_and_arrays_are_lists() -> None:
    hidden = np.ma.masked_array([[900.0, 90.0, 60.0, 300.0]], mask=[[0, 0, 1, 0]])
    scenario = planfly.make_scenario("tight", threats=hidden, area={"east_m": np.array([-300.0, 2900.0])})
    assert scenario.threats.kill_radius.tolist() == [0.0]
    assert scenario.threats.detection_radius.tolist() == [300.0]
    assert scenario.bounds[0].tolist() == [-300.0, 2900.0]


def test_a_threats_column_of_text_is_named_with_its_value() -> None:
    columns = {"east_m": [900.0], "north_m": [90.0], "kill_radius_m": ["900"]}
    with pytest.raises(planfly.PlanflyError, match=r"column kill_radius_m 900: expected numbers, not text"):
        planfly.make_scenario("tight", threats=columns)


def test_a_threat_of_an_array_has_its_number_as_its_name() -> None:
    # Its start is 0 m from the first and 2,600 m from the second.
    scenario = planfly.make_scenario("tight", threats=[[2600.0, 900.0, 60.0, 0.0], [0.0, 0.0, 90.0, 0.0]])
    assert scenario.threats.names == ("threat 1", "threat 2")
    with pytest.raises(planfly.PlanflyError, match="inside the kill radius of threat 2"):
        planfly.plan(scenario)


def test_a_radius_that_is_perhaps_in_km_is_noted(caplog: pytest.LogCaptureFixture) -> None:
    scenario = planfly.make_scenario("tight", threats=[[900.0, 90.0, 0.9, 2.0], [900.0, 90.0, 10.0, 0.0]])
    note = "the kill radius of threat 1 is 0.9 m (and 1 more threat): radii are in metres, not kilometres"
    assert scenario.notes == (note,)
    assert caplog.messages == [f"tight: {note}"]
    assert load_scenario("tight").notes == ()


def test_a_notebook_shows_a_scenario_as_a_line_or_a_table() -> None:
    scenario = planfly.make_scenario("tight", name="a<b")
    # From 0 to 2,600 m east, with the 28 posts of its file.
    assert repr(scenario) == "<Scenario a<b: 2.6 km, 28 threats, 0 zones>"
    table = scenario._repr_html_()
    assert "a&lt;b" in table
    assert "<td>destination</td><td>east 2600 m, north 0 m, 75 m AMSL</td>" in table


def test_the_table_of_a_notebook_names_what_decides_a_flight() -> None:
    """Of `tight`, flown by planfly's guidance, which knows its place, in a corridor of 15 m."""
    rows = (
        ("aircraft", "aerosonde"),
        ("airspeed", "25 m/s"),
        ("autopilot", "planfly, path"),
        ("navigation", "perfect"),
        ("corridor", "15 m to each side"),
    )
    table = planfly.make_scenario("tight", flight={"airspeed_mps": 25.0}, limits={"corridor_m": 15.0})._repr_html_()
    for name, text in rows:
        assert f"<td>{name}</td><td>{text}</td>" in table
    table = load_scenario("jacksboro")._repr_html_()
    rows = (
        ("autopilot", "ardupilot"),
        ("navigation", "gnss"),
        ("corridor", "as wide as the autopilot needs"),
    )
    for name, text in rows:
        assert f"<td>{name}</td><td>{text}</td>" in table


def test_an_elevation_file_of_ones_own_replaces_the_terrain_as_a_whole(tmp_path: Path) -> None:
    """A digest or an origin of another file, and keys of another kind, are not carried over."""
    tile = write_geotiff(tmp_path / "own.tif", np.full_like(made_tile(), 120.0))
    ends: dict[str, Any] = {"start": {"east_m": -400, "north_m": 0, "height_m": 150}}
    ends["destination"] = {"east_m": 400, "north_m": 0, "height_m": 150}
    area = {"east_m": [-900, 900], "north_m": [-900, 900], "ceiling_amsl_m": 900}
    for base, terrain in (
        ("jacksboro-air", {"kind": "dem", "path": str(tile)}),
        ("jacksboro-air", {"path": str(tile)}),
        ("paper-07", {"kind": "dem", "path": str(tile)}),
        ("tight", {"kind": "dem", "path": str(tile)}),
    ):
        made = planfly.make_scenario(base, terrain=terrain, area=area, threats=[], **ends)
        assert made.terrain is not None
        assert made.terrain.height(0.0, 0.0) == pytest.approx(120.0, abs=0.1)
        assert (made.origin.lat_deg, made.origin.lon_deg) == pytest.approx((MIDDLE.lat_deg, MIDDLE.lon_deg), abs=1e-6)
    # Of the same kind, the other keys stay; a stated origin is kept.
    assert planfly.make_scenario("tight", terrain={"amsl_m": 5.0}).to_json()["terrain"] == {
        "kind": "flat",
        "amsl_m": 5.0,
    }
    changes = {"terrain": {"kind": "dem", "path": str(tile)}, "origin": {"lat_deg": 46.061, "lon_deg": 8.05}}
    assert planfly.make_scenario("tight", area=area, threats=[], **changes, **ends).origin.lat_deg == 46.061


# ----------------------------------------------------------------------
# A scenario made in Python, in a file and in other functions.


@pytest.mark.parametrize("name", embedded_names())
def test_a_written_scenario_is_read_as_the_same(name: str, tmp_path: Path) -> None:
    zone = {
        "name": 'a "b"\\c',
        "kind": "exclusion",
        "east_m": 1e3,
        "north_m": 0.1,
        "radius_m": 5.0,
        "floor_amsl_m": 9e3,
    }
    for scenario in (load_scenario(name), planfly.make_scenario(name, name=f"Täl {name}", zones=[zone])):
        scenario.to_toml(tmp_path / "mine.toml")
        again = load_scenario(str(tmp_path / "mine.toml"))
        assert again.to_json() == scenario.to_json()
        assert (again.start.tolist(), again.bounds.tolist()) == (scenario.start.tolist(), scenario.bounds.tolist())


def test_a_scenario_of_a_mission_is_not_written(tmp_path: Path) -> None:
    planfly.export(planfly.plan("tight", seed=1), tmp_path / "m.waypoints")
    scenario = planfly.judge(tmp_path / "m.waypoints", geometry=True).setup.scenario
    with pytest.raises(planfly.ScenarioError, match=r"made around a mission.*planfly\.make_scenario"):
        scenario.to_toml(tmp_path / "mine.toml")
    assert not (tmp_path / "mine.toml").exists()


@pytest.fixture(scope="module")
def windy() -> planfly.Scenario:
    return planfly.make_scenario("paper-07", name="windy", wind={"speed_mps": 3.0, "from_deg": 250.0})


def test_a_mission_is_flown_and_judged_in_a_scenario_made_in_python(windy: planfly.Scenario, tmp_path: Path) -> None:
    path = planfly.plan("paper-07", seed=1)
    mission = tmp_path / "m.waypoints"
    planfly.export(path, mission)
    for what in (path, mission):
        assert planfly.judge(what, geometry=True, scenario=windy).setup.scenario.name == "windy"
    assert planfly.fly(mission, scenario=windy).setup.scenario.wind.speed == 3.0
    assert planfly.check(mission, geometry=True, scenario=windy).conditions.wind_mps == 3.0
    assert planfly.export(path, tmp_path / "n.plan", scenario=windy).files
    assert planfly.returns(path, scenario=windy, every=200.0).setup.scenario.name == "windy"
    link = {"frequency": 868.0, "power": 27.0, "sensitivity": -110.0}
    assert planfly.link(path, scenario=windy, **link).setup.scenario.name == "windy"


def test_a_campaign_flies_in_a_scenario_made_in_python(windy: planfly.Scenario, tmp_path: Path) -> None:
    """Its workers are processes of their own; the command on its page names the scenario as a file."""
    done = planfly.campaign(windy, flights=2, workers=2, seed=1, out=tmp_path / "a")
    assert done.summary.estimate.tally.flown == 2
    file = tmp_path / "a" / "scenario.toml"
    assert load_scenario(str(file)).to_json() == windy.to_json()
    assert f"planfly campaign {file} " in (tmp_path / "a" / "report.html").read_text(encoding="utf-8")
    # As by the command, which finds the plan in the folder.
    again = planfly.campaign(file, flights=3, workers=1, seed=1, out=tmp_path / "a", resume=True)
    assert again.summary.estimate.tally.flown == 3
    mission = planfly.plan("paper-07", seed=1, out=tmp_path / "p.json") and tmp_path / "p.json"
    named = planfly.campaign(mission, scenario=windy, flights=1, workers=1, out=tmp_path / "b")
    assert named.summary.estimate.tally.flown == 1
    assert f"--scenario {tmp_path / 'b' / 'scenario.toml'}" in (tmp_path / "b" / "report.html").read_text(
        encoding="utf-8"
    )


def test_an_array_as_terrain_is_refused_with_the_way_to_a_file() -> None:
    way = (
        r"array of shape \(9, 9\): expected {\"kind\": \"dem\", \"path\": FILE}; .*rows from north to south.*np.savez\("
    )
    with pytest.raises(planfly.ArgumentError, match=f"^terrain {way}"):
        planfly.make_scenario("tight", terrain=np.zeros((9, 9)))
    with pytest.raises(planfly.ArgumentError, match=f"^terrain.path {way}"):
        planfly.make_scenario("tight", terrain={"kind": "dem", "path": np.zeros((9, 9))})
