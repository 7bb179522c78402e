"""The 3-D scene's data: the ground's own heights, the whole flight within bounds, and a text that HTML may hold."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest

from flight.mission.itinerary import NO_ITEM
from flight.mission.route import route_points
from logs.views.failures import Failures
from logs.views.scene import (
    MAX_GROUND,
    MISSING,
    SceneView,
    exaggeration,
    ground_grid,
    scene_bounds,
    scene_data,
    script_json,
    select_drawn_rows,
)
from tests.logs.made_flight import make_setup, make_track

SETUP = make_setup()
NOTHING = Failures({}, {})


def test_bounds_hold_area_route_and_what_of_the_flight_is_known() -> None:
    np.testing.assert_array_equal(scene_bounds(SETUP, None), [[-1500.0, 1500.0], [-1500.0, 1500.0]])
    track = make_track()
    position = track.position.copy()
    position[7] = [2000.0, -1700.0, 500.0]
    position[8] = [np.nan, 9000.0, 500.0]
    bounds = scene_bounds(SETUP, replace(track, position=position))
    np.testing.assert_array_equal(bounds, [[-1500.0, 2000.0], [-1700.0, 1500.0]])


def test_the_grid_has_the_terrains_heights_and_no_more_points_than_asked() -> None:
    terrain = SETUP.scenario.terrain
    assert terrain is not None
    grid = ground_grid(terrain, scene_bounds(SETUP, None), 40)
    assert grid is not None
    assert grid.heights.shape == (grid.north.size, grid.east.size)
    assert max(grid.heights.shape) <= 40
    assert (grid.east[0], grid.east[-1], grid.north[0], grid.north[-1]) == (-1500.0, 1500.0, -1500.0, 1500.0)
    # made_flight's hill: 333.3 m at (100, 200), 700 m wide.
    k, j = np.unravel_index(np.nanargmax(grid.heights), grid.heights.shape)
    away = np.hypot(grid.east[j] - 100.0, grid.north[k] - 200.0)
    assert away < 60.0
    assert grid.heights[k, j] == pytest.approx(333.3 * np.exp(-(away**2) / (2.0 * 700.0**2)), abs=1.0)
    assert ground_grid(None, scene_bounds(SETUP, None), 40) is None


@pytest.mark.parametrize(("top", "stretch"), [(270.0, 1.0), (180.0, 1.5), (135.0, 2.0), (60.0, 3.0), (10.0, 3.0)])
def test_heights_are_stretched_to_about_a_tenth_of_the_ground(top: float, stretch: float) -> None:
    """0.09 of 3000 m is 270 m: a route that rises so far stands as it is; one of 60 m is stretched most."""
    way = SETUP.route.positions.copy()
    way[:, 2] = [0.0, 0.0, 0.0, top]
    setup = replace(SETUP, route=SETUP.route.with_fields(position=way))
    assert exaggeration(setup, np.array([[0.0, 3000.0], [0.0, 1000.0]]), None) == stretch


def test_a_level_route_over_a_small_area_is_not_torn_apart() -> None:
    """It counts as 50 m of relief: 90 m of 1000 m are 1.8 times that."""
    way = SETUP.route.positions * np.array([1.0, 1.0, 0.0])
    setup = replace(SETUP, route=SETUP.route.with_fields(position=way))
    assert exaggeration(setup, np.array([[0.0, 1000.0], [0.0, 1000.0]]), None) == 1.5


def test_the_track_is_thinned_to_both_its_ends() -> None:
    track = make_track()
    position = track.position.copy()
    position[100:110] = np.nan
    rows = position[select_drawn_rows(replace(track, position=position), 50)]
    assert len(rows) == 50
    assert np.isfinite(rows).all()
    np.testing.assert_array_equal(rows[[0, -1]], track.position[[0, -1]])
    assert select_drawn_rows(replace(track, position=np.full_like(position, np.nan)), 50).shape == (0,)


def test_the_text_holds_the_scene_and_ends_no_script() -> None:
    evil = "</script><b>&"
    setup = replace(SETUP, scenario=replace(SETUP.scenario, name=evil))
    text = script_json(scene_data(SceneView(setup, make_track(), Failures({1: ("slope",)}, {2: ("turn",)}))))
    assert not set("<>&") & set(text)
    scene = json.loads(text)
    assert scene["name"] == evil
    assert scene["failing"] == {"legs": [1], "waypoints": [2]}
    assert scene["plan"][0] == [-900.0, -900.0, 420.0]
    assert [threat["kill"] for threat in scene["threats"]] == [400.0, 0.0]
    ground = scene["ground"]
    steps = np.frombuffer(base64.b64decode(ground["heights"]), "<u2").reshape(ground["rows"], ground["columns"])
    assert max(steps.shape) <= MAX_GROUND
    assert steps.size < 65_536
    heights = ground["low"] + steps * (ground["high"] - ground["low"]) / (MISSING - 1)
    terrain = SETUP.scenario.terrain
    assert terrain is not None
    east, north = (np.linspace(-1500.0, 1500.0, count) for count in (ground["columns"], ground["rows"]))
    known = steps != MISSING
    np.testing.assert_allclose(heights[known], terrain.height(east[None, :], north[:, None])[known], atol=0.01)


def test_a_loiter_has_one_number_in_the_scene() -> None:
    """Its corners are one stop: the numbers are those of the map and of a ground station's list."""
    route = SETUP.route
    way, items = route.positions[[0, 1, 1, 2, 3]], [NO_ITEM, 2, 2, 3, 4]
    looped = replace(route, points=route_points(way, 25.0, item=items, arc_radius=[0.0, 80.0, 80.0, 0.0, 0.0]))
    data = scene_data(SceneView(replace(SETUP, route=looped), None, NOTHING))
    assert data["numbers"] == [[0, 0], [1, 1], [3, 2], [4, 3]]


def test_a_scene_without_terrain_has_no_ground() -> None:
    bare = replace(SETUP, scenario=replace(SETUP.scenario, terrain=None, external=True))
    assert scene_data(SceneView(bare, None, NOTHING))["ground"] is None


def test_zones_stand_in_the_scene_where_there_are_any() -> None:
    assert "zones" not in scene_data(SceneView(SETUP, None, NOTHING))
    zone = {"name": "</script>", "kind": "exclusion", "east_m": 0, "north_m": 0, "radius_m": 200, "ceiling_amsl_m": 900}
    setup = make_setup(zones=[zone], terrain={"kind": "flat", "amsl_m": 40})
    text = script_json(scene_data(SceneView(setup, None, NOTHING)))
    assert "<" not in text
    (found,) = json.loads(text)["zones"]
    ring = np.array(found["rings"][0])
    assert (found["keep_out"], ring.shape[1:]) == (True, (2, 3))
    assert np.hypot(ring[:, :, 0], ring[:, :, 1]) == pytest.approx(200.0, abs=0.1)
    assert (set(ring[:, 0, 2]), set(ring[:, 1, 2])) == ({40.0}, {900.0})
