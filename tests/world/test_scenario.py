"""Scenarios made of their files: the ends inside the area, defaults taken from the tile, and variants."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.world.made.made_scenario import THREAT, made_spec, refused, same_scenario, with_fault
from world.errors import ScenarioError, TerrainError
from world.frames import GeoOrigin, to_geo
from world.scenario import (
    Scenario,
    embedded_names,
    embedded_scenarios,
    load_scenario,
    scenario_from_spec,
    with_amsl_endpoints,
    with_flight,
    with_planner,
    with_terrain,
    with_threats,
    with_wind,
    with_zones,
)
from world.scenario_tables import ZoneTable

# What is replaced in the small file or appended to it, and what the line must say.
CASES: dict[str, tuple[str, str, str]] = {
    "ceiling under the start": (
        "[start]",
        "ceiling_amsl_m = 350\n[start]",
        "start: 400 m AMSL: above the ceiling, ",
    ),
    "floor above the start": (
        "[start]",
        "floor_amsl_m = 450\n[start]",
        "start: 400 m AMSL: below the floor, 450 m AMSL",
    ),
    "start outside the map": ("east_m = -4000", "east_m = -5001", "start: east -5001 m: 1 m outside the area"),
    "destination outside": ("east_m = 4000", "east_m = 6000", "destination: east 6000 m: 1000 m outside the area"),
    "start under terrain": (
        "amsl_m = 400",
        "amsl_m = 150",
        "start: 150 m AMSL: not above the terrain, which is at 200 m",
    ),
    "start on terrain": ("amsl_m = 400", "height_m = 0", "start: 200 m AMSL: not above the terrain"),
    "a threat off the terrain": (
        "",
        THREAT.replace("900", "90000"),
        "threats[0]: east 0 m, north 90000 m (latitude 46.80965, longitude 8.00000): no terrain",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_one_fault_one_line(case: str, tmp_path: Path) -> None:
    old, new, wanted = CASES[case]
    assert wanted in refused(tmp_path, with_fault(old, new))


# ----------------------------------------------------------------------
# Scenarios: positions, terrain, defaults taken from the tile, and the way through JSON and back.


def test_positions_and_heights() -> None:
    scenario = scenario_from_spec(made_spec(), "made")

    def hill(east: float, north: float) -> float:
        return 500.0 * math.exp(-(east**2 + north**2) / (2 * 600.0**2))

    assert scenario.origin == GeoOrigin(46.0, 8.0)  # where nothing else is stated
    assert scenario.start == pytest.approx([-2500.0, 100.0, hill(2500, 100) + 120.0], abs=0.3)
    lat, lon = to_geo(scenario.origin, *scenario.destination[:2])
    assert (float(lat), float(lon)) == pytest.approx((46.005, 8.02), abs=1e-9)
    assert scenario.start_course == pytest.approx(math.pi / 2)
    assert scenario.destination_course is None
    assert scenario.threats.names == ("threat 1", "b", "threat 3")
    assert scenario.threats.position[:, 2] == pytest.approx([hill(200, 0), 509.0, 77.0], abs=0.5)
    assert scenario.threats.kill_radius.tolist() == [400.0, 0.0, 1.0]
    assert scenario.threats.detection_radius.tolist() == [0.0, 1.0, 0.0]
    assert scenario.wind.reference_amsl == scenario.start[2]
    assert scenario.ceiling == pytest.approx(1500.0, abs=1.0)  # 1000 m above the highest ground
    with pytest.raises(ValueError, match="read-only"):
        scenario.start[0] = 0.0


@pytest.mark.parametrize("name", ["jacksboro", "made"])
def test_to_json_and_back_is_the_same_scenario(name: str) -> None:
    scenario = load_scenario(name) if name == "jacksboro" else scenario_from_spec(made_spec(), "made")
    text = json.dumps(scenario.to_json(), allow_nan=False)
    again = scenario_from_spec(json.loads(text), "again")
    assert same_scenario(scenario, again)
    assert json.dumps(again.to_json()) == text
    # With the ground at hand, as from a log, no file is opened.
    data = json.loads(text)
    if name == "jacksboro":
        data["terrain"]["path"] = "/nowhere/at/all.npz"
    assert np.array_equal(scenario_from_spec(data, "log", ground=scenario.terrain).start, scenario.start)


def test_embedded_scenarios() -> None:
    names = embedded_names()
    assert names[0] == "jacksboro"
    assert names[1:] == sorted(names[1:])
    assert list(embedded_scenarios()) == names
    for name in names:
        scenario = load_scenario(name)
        assert scenario.terrain is not None
        assert embedded_scenarios()[name].description
        height = scenario.terrain.height(scenario.threats.position[:, 0], scenario.threats.position[:, 1])
        assert not np.isnan(height).any()


def test_jacksboro_is_what_it_promises() -> None:
    scenario = load_scenario("jacksboro")
    assert scenario.terrain is not None
    start, end = scenario.start, scenario.destination
    assert math.dist(start[:2], end[:2]) >= 12_000.0
    assert len(scenario.threats) >= 12
    assert scenario.terrain.clearance(start, end)[0] < 0.0
    along = start + np.linspace(0.0, 1.0, 5000)[:, None] * (end - start)
    away = np.linalg.norm(along[:, None] - scenario.threats.position, axis=2)
    assert (away <= scenario.threats.kill_radius).any()


def _tile(folder: Path) -> Path:
    rows, cols = 240, 300
    heights = 400.0 + np.add.outer(np.arange(rows), np.arange(cols)).astype(np.float32)
    edges = {"xmin": 9.0, "xmax": 9.0 + cols / 3600, "ymin": 47.0 - rows / 3600, "ymax": 47.0}
    np.savez(folder / "tile.npz", elevation=heights, **edges)
    return folder / "tile.npz"


def _dem(folder: Path, **changes: Any) -> dict[str, Any]:
    _tile(folder)
    ends = {
        "start": {"east_m": -1500, "north_m": 0, "height_m": 100},
        "destination": {"east_m": 1500, "north_m": 0, "height_m": 100},
    }
    return made_spec(terrain={"kind": "dem", "path": "tile.npz"}, threats=[], **ends) | changes


def test_origin_and_area_come_from_the_tile(tmp_path: Path) -> None:
    spec = _dem(tmp_path)
    del spec["area"]
    scenario = scenario_from_spec(spec, "x", base=tmp_path)
    assert scenario.origin.lat_deg == pytest.approx(47.0 - 120 / 3600, abs=1e-9)
    assert scenario.origin.lon_deg == pytest.approx(9.0 + 150 / 3600, abs=1e-9)
    assert np.ptp(scenario.bounds, axis=1) == pytest.approx([299 * 21.1, 239 * 30.9], rel=0.03)
    assert scenario.terrain is not None
    # South and east are higher by one metre a pixel.
    assert float(scenario.terrain.height(500.0, 0.0)) > float(scenario.terrain.height(-500.0, 0.0)) + 40.0
    assert float(scenario.terrain.height(0.0, -500.0)) > float(scenario.terrain.height(0.0, 500.0)) + 25.0
    # What came from the tile is written down.
    data = scenario.to_json()
    assert data["origin"] == {"lat_deg": scenario.origin.lat_deg, "lon_deg": scenario.origin.lon_deg}
    assert data["terrain"]["path"] == str(tmp_path / "tile.npz")
    assert same_scenario(scenario_from_spec(data, "again"), scenario)


def test_a_tile_that_changed_is_noticed(tmp_path: Path) -> None:
    data = scenario_from_spec(_dem(tmp_path), "x", base=tmp_path).to_json()
    np.savez(tmp_path / "tile.npz", elevation=np.ones((240, 300)), xmin=9, xmax=9.1, ymin=46.9, ymax=47)
    with pytest.raises(ScenarioError, match="the file has changed: its SHA-256 differs"):
        scenario_from_spec(data, "plan.json")


def test_relative_paths_count_from_the_scenario_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "scenarios"
    folder.mkdir()
    _tile(folder)
    text = """
    name = "relative"
    terrain = {kind = "dem", path = "tile.npz"}
    start = {east_m = -1000, north_m = 0, height_m = 50}
    destination = {east_m = 1000, north_m = 0, height_m = 50}
    """
    (folder / "s.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert load_scenario("scenarios/s.toml").terrain is not None
    # An option's path counts from where the user is.
    with pytest.raises(TerrainError, match=r"terrain: .*tile\.npz"):
        load_scenario("scenarios/s.toml", terrain="tile.npz")
    assert load_scenario("scenarios/s.toml", terrain="scenarios/tile.npz").terrain is not None
    with pytest.raises(ScenarioError, match=r"terrain: path"):
        load_scenario("scenarios/s.toml", terrain="")


def test_another_terrain_does_not_move_the_map(tmp_path: Path) -> None:
    spec = _dem(tmp_path)
    before = scenario_from_spec(spec, "x", base=tmp_path)
    rows, cols = 400, 500  # a larger tile, whose middle is elsewhere
    edges = {"xmin": 8.98, "xmax": 8.98 + cols / 3600, "ymin": 47.02 - rows / 3600, "ymax": 47.02}
    np.savez(tmp_path / "other.npz", elevation=np.full((rows, cols), 300.0), **edges)
    after = scenario_from_spec(spec, "x", base=tmp_path, terrain=str(tmp_path / "other.npz"))
    assert after.origin == before.origin
    assert after.start[:2].tolist() == before.start[:2].tolist()
    assert after.start[2] == pytest.approx(400.0)


def test_tiles_that_no_map_can_hold(tmp_path: Path) -> None:
    ends = {
        "start": {"east_m": 0, "north_m": 0, "amsl_m": 900},
        "destination": {"east_m": 100, "north_m": 0, "amsl_m": 900},
    }
    for name, edges, match in (
        ("pole", (0.0, 1.0, 89.0, 89.9), r"origin: lat_deg: 89\.45: allowed -89\.\.89"),
        ("huge", (0.0, 20.0, 40.0, 50.0), r"area: east_m\.\d: .*: allowed -500000\.\.500000"),
    ):
        keys = dict(zip(("xmin", "xmax", "ymin", "ymax"), edges, strict=True))
        np.savez(tmp_path / f"{name}.npz", elevation=np.ones((100, 100)), **keys)
        spec = {"name": name, "terrain": {"kind": "dem", "path": f"{name}.npz"}, **ends}
        with pytest.raises((ScenarioError, TerrainError), match=match):
            scenario_from_spec(spec, "x", base=tmp_path)


# ----------------------------------------------------------------------
# A changed scenario is one that a file may have, and goes through JSON and back.


@pytest.fixture
def scenario() -> Scenario:
    return scenario_from_spec(made_spec(), "made")


def test_another_wind_is_one_that_a_file_may_have(scenario: Scenario) -> None:
    windy = with_wind(scenario, 11.0, math.radians(30.0), "moderate")
    assert (windy.wind.speed, windy.wind.turbulence, windy.wind.gradient) == (11.0, "moderate", 0.01)
    assert windy.wind.from_course == pytest.approx(math.radians(30.0))
    assert same_scenario(scenario_from_spec(windy.to_json(), "again"), windy)
    assert same_scenario(with_wind(scenario, None, None, None), scenario)
    assert with_wind(scenario, None, None, "none").wind.speed == 6.0
    # What a file may not say, an option may not either: the log could not be read back.
    for speed, course, turbulence, match in (
        (99.0, 0.0, None, "wind: speed_mps: 99.0: allowed 0..40"),
        (math.nan, 0.0, None, "wind: speed_mps: nan: allowed 0..40"),
        (5.0, 99.0, None, "wind: from_deg: .*: allowed -360..360"),
        (None, None, "severe", 'wind: turbulence: "severe"'),
    ):
        with pytest.raises(ScenarioError, match=match):
            with_wind(scenario, speed, course, turbulence)


def test_other_entries_of_flight_and_planner(scenario: Scenario) -> None:
    fast = with_flight(scenario, airspeed_mps=30.0, guidance=None)
    assert fast.flight == scenario.flight.model_copy(update={"airspeed_mps": 30.0})
    assert same_scenario(scenario_from_spec(fast.to_json(), "again"), fast)
    seeded = with_planner(scenario, "--seed", seed=9)
    assert seeded.planner == scenario.planner.model_copy(update={"seed": 9})
    assert same_scenario(scenario_from_spec(seeded.to_json(), "again"), seeded)
    with pytest.raises(ScenarioError, match=r"made: flight: airspeed_mps: 2\.0: allowed 3\.\.150"):
        with_flight(scenario, airspeed_mps=2.0)
    with pytest.raises(ScenarioError, match=r"--seed: seed: -1: allowed 0\.\."):
        with_planner(scenario, "--seed", seed=-1)


def test_more_threats_stand_on_the_ground_with_the_scales_of_the_others(scenario: Scenario) -> None:
    missile = {"east_m": 500.0, "north_m": -300.0, "kill_radius_m": 250.0}
    radar = {"east_m": 0.0, "north_m": 600.0, "detection_radius_m": 900.0}
    more = with_threats(scenario, [missile, radar], "--threat")
    assert more.threats.names[-2:] == ("pop-up 1", "pop-up 2")
    assert more.terrain is not None
    for place in more.threats.position[-2:]:
        assert place[2] == pytest.approx(float(more.terrain.height(place[0], place[1])))
    # The medians of 100 / 400 and 2 / 1, and of 2 / 1.
    assert more.threats.kill_scale[-2:].tolist() == pytest.approx([250.0 * 1.125, 0.0])
    assert more.threats.detection_scale[-2:].tolist() == pytest.approx([0.0, 1800.0])
    assert same_scenario(scenario_from_spec(more.to_json(), "again"), more)
    with pytest.raises(ScenarioError, match=r"--threat: kill_radius_m: -5\.0: allowed above 0"):
        with_threats(scenario, [missile | {"kill_radius_m": -5.0}], "--threat")
    with pytest.raises(ScenarioError, match=r"^--threat: east 400000 m, north -300 m: outside the terrain data"):
        with_threats(scenario, [missile | {"east_m": 400_000.0}], "--threat")
    # A name, a scale and a height of its own are kept.
    tall = missile | {"name": "S-1", "kill_scale_m": 10.0, "height_m": 30.0}
    threats = with_threats(scenario, [tall], "--threat").threats
    assert (threats.names[-1], float(threats.kill_scale[-1])) == ("S-1", 10.0)
    assert threats.position[-1, 2] == pytest.approx(more.threats.position[-2, 2] + 30.0)


def test_ends_keep_their_heights_above_the_sea_whatever_is_below() -> None:
    before = load_scenario("jacksboro")
    ends = with_amsl_endpoints(before.to_json(), before.start, before.destination)
    assert [ends[key]["amsl_m"] for key in ("start", "destination")] == [before.start[2], before.destination[2]]
    assert not any("height_m" in ends[key] for key in ("start", "destination"))
    after = with_terrain(before, "jacksboro")
    assert np.array_equal(after.start, before.start)
    assert np.array_equal(after.destination, before.destination)
    assert np.array_equal(after.bounds, before.bounds)


@pytest.mark.parametrize(("radius", "held"), [(995.0, False), (1005.0, True)])
def test_more_zones_hold_no_end_but_of_a_scenario_made_around_a_mission(
    scenario: Scenario, radius: float, held: bool
) -> None:
    """A cylinder 1 km beside the start, as wide as nearly that, or a little more."""
    east, north = float(scenario.start[0]), float(scenario.start[1]) + 1000.0
    tables = [ZoneTable(name="mill", kind="exclusion", east_m=east, north_m=north, radius_m=radius)]
    external = replace(scenario, external=True)
    made = with_zones(external, tables, "mills.geojson")
    assert [zone.name for zone in made.zones] == ["mill"]
    again = scenario_from_spec(made.to_json(), "a log", ground=made.terrain, external=True)
    assert again.zones == made.zones
    if held:
        with pytest.raises(ScenarioError, match=r"mills\.geojson: zones: mill: start lies inside"):
            with_zones(scenario, tables, "mills.geojson")
    else:
        assert with_zones(scenario, tables, "mills.geojson").zones == made.zones


def test_zones_are_counted_with_those_that_are_there(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("world.scenario.MAX_ZONES", 2)
    tables = [ZoneTable(name="mill", kind="exclusion", east_m=9000.0, north_m=9000.0, radius_m=5.0)]
    two = with_zones(with_zones(scenario, tables, "a"), tables, "b")
    assert len(two.zones) == 2
    with pytest.raises(ScenarioError, match="c: 1 zone cannot be added: a scenario has at most 2 zones"):
        with_zones(two, tables, "c")
