"""Scenarios: positions, terrain, defaults taken from the tile, and the way through JSON and back."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.world.made.made_scenario import made_spec, same_scenario
from world.errors import ScenarioError, TerrainError
from world.frames import GeoOrigin, to_geo
from world.scenario import embedded_names, embedded_scenarios, from_spec, load_scenario


def test_positions_and_heights() -> None:
    scenario = from_spec(made_spec(), "made")

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
    scenario = load_scenario(name) if name == "jacksboro" else from_spec(made_spec(), "made")
    text = json.dumps(scenario.to_json(), allow_nan=False)
    again = from_spec(json.loads(text), "again")
    assert same_scenario(scenario, again)
    assert json.dumps(again.to_json()) == text
    # With the ground at hand, as from a log, no file is opened.
    data = json.loads(text)
    if name == "jacksboro":
        data["terrain"]["path"] = "/nowhere/at/all.npz"
    assert np.array_equal(from_spec(data, "log", ground=scenario.terrain).start, scenario.start)


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
    scenario = from_spec(spec, "x", base=tmp_path)
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
    assert same_scenario(from_spec(data, "again"), scenario)


def test_a_tile_that_changed_is_noticed(tmp_path: Path) -> None:
    data = from_spec(_dem(tmp_path), "x", base=tmp_path).to_json()
    np.savez(tmp_path / "tile.npz", elevation=np.ones((240, 300)), xmin=9, xmax=9.1, ymin=46.9, ymax=47)
    with pytest.raises(ScenarioError, match="the file has changed since"):
        from_spec(data, "plan.json")


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
    with pytest.raises(TerrainError, match=r"--terrain: .*tile\.npz"):
        load_scenario("scenarios/s.toml", terrain="tile.npz")
    assert load_scenario("scenarios/s.toml", terrain="scenarios/tile.npz").terrain is not None
    with pytest.raises(ScenarioError, match=r"--terrain: path"):
        load_scenario("scenarios/s.toml", terrain="")


def test_another_terrain_does_not_move_the_map(tmp_path: Path) -> None:
    spec = _dem(tmp_path)
    before = from_spec(spec, "x", base=tmp_path)
    rows, cols = 400, 500  # a larger tile, whose middle is elsewhere
    edges = {"xmin": 8.98, "xmax": 8.98 + cols / 3600, "ymin": 47.02 - rows / 3600, "ymax": 47.02}
    np.savez(tmp_path / "other.npz", elevation=np.full((rows, cols), 300.0), **edges)
    after = from_spec(spec, "x", base=tmp_path, terrain=str(tmp_path / "other.npz"))
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
            from_spec(spec, "x", base=tmp_path)
