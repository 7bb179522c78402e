"""Scenarios made around external missions: their area, terrain and origin, and the routes in them."""

from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest

from flight.mission.items import Mission
from flight.mission.itinerary import make_itinerary
from flight.mission.placing import implied_scenario, mission_origin
from flight.mission.route import Route, make_route
from flight.mission_files.formats import read_mission
from tests.mission_lines import mission, wp
from world.errors import MissionError, TerrainError
from world.frames import GeoOrigin
from world.geometry import leg_runs, leg_slopes, turning_angles
from world.raster import open_raster
from world.scenario import scenario_from_spec

SAMPLES = Path(__file__).parents[1] / "missions"


# Counted by hand in the files: legs, and the items that the route goes through (-1: over home).  A loiter is several
# corners of one item: as many eighths of a turn as it takes to leave towards the next place.
LEGS = {
    "by_hand.waypoints": (3, [1, 2, 3, 5]),
    "endless.waypoints": (7, [1, 2, 3, 4, 1, 2, 3, 4]),
    "mavproxy.txt": (21, [1, 2, 3, 5, 6]),
    "mavproxy_terrain.txt": (3, [1, 2, 3, 4]),
    "mission_planner.waypoints": (10, [1, 3, 4, 5, 6, 7, 4, 5, 6, 7, 10]),
    "mission_planner_land.waypoints": (5, [1, 2, 3, 6, 7]),
    "qgc.waypoints": (14, [3, 5, 7, 9, 10, 11]),
    "qgc_amsl.plan": (4, [1, 3, 4, 5, 6]),
    "qgc_takeoff.plan": (7, [-1, 1, 3, 4, 6, 8, 10, 11]),
}


def _legs(route: Route) -> int:
    """Legs with all that stands for a way back counted as one."""
    return route.legs if route.rtl_start is None else route.rtl_start + 1


# Those that need ground to count heights from.
ON_TERRAIN = {"endless.waypoints", "mavproxy_terrain.txt"}


@pytest.mark.parametrize("name", sorted(LEGS))
def test_samples_fly_over_the_tile(name: str) -> None:
    """Each sample's legs, and that an Aerosonde can fly them: what the flight tests build on."""
    legs, items = LEGS[name]
    read = read_mission(SAMPLES / name)
    scenario = implied_scenario(read, "jacksboro").scenario
    flown = make_route(read, scenario.origin, scenario.terrain, 25.0, False)
    assert _legs(flown) == legs
    assert [item for item, _ in groupby(flown.items.tolist())] == items
    # A way back is drawn as it is flown: its turns begin at the last place of the mission, and it comes down.
    last = None if flown.rtl_start is None else flown.rtl_start + 1
    there, circling = flown.positions[:last], flown.arc_radii[:last] > 0.0
    assert leg_runs(there)[~(circling[1:] | circling[:-1])].min() >= 600.0
    assert np.degrees(turning_angles(flown.positions)).max() < 105.0
    assert np.degrees(np.abs(leg_slopes(there))).max() < 2.5
    assert scenario.terrain is not None
    assert min(scenario.terrain.clearance(a, b)[0] for a, b in pairwise(there)) > 100.0
    assert scenario.external
    assert len(scenario.threats.names) == 0


@pytest.mark.parametrize("name", sorted(set(LEGS) - ON_TERRAIN))
def test_samples_have_a_scenario_without_terrain(name: str) -> None:
    read = read_mission(SAMPLES / name)
    scenario = implied_scenario(read, None).scenario
    assert scenario.terrain is None
    assert _legs(make_route(read, scenario.origin, None, 25.0, False)) == LEGS[name][0]
    again = scenario_from_spec(scenario.to_json(), "log", external=True)
    assert again.to_json() == scenario.to_json()
    assert again.origin == scenario.origin
    assert np.array_equal(again.bounds, scenario.bounds)


def test_heights_over_terrain_need_terrain() -> None:
    with pytest.raises(MissionError, match=r"item 1: height above terrain.*requires terrain"):
        implied_scenario(read_mission(SAMPLES / "mavproxy_terrain.txt"), None)


def test_a_log_gives_the_same_scenario() -> None:
    """A log keeps the scenario's JSON and the terrain, and makes the same scenario of them."""
    scenario = implied_scenario(read_mission(SAMPLES / "qgc.waypoints"), "jacksboro").scenario
    again = scenario_from_spec(scenario.to_json(), "log", ground=scenario.terrain, external=True)
    assert again.to_json() == scenario.to_json()
    assert again.origin == scenario.origin
    assert again.ceiling == scenario.ceiling
    for name in ("bounds", "start", "destination"):
        assert np.array_equal(getattr(again, name), getattr(scenario, name))


def test_the_area_contains_home_and_rally_points_to_which_a_return_flies() -> None:
    def box(*more: str, home: str = "36.5 -84.2 100") -> list[list[float]]:
        read = mission(wp(0, 0), wp(0, 900), *more, home=home)
        return implied_scenario(read, None).scenario.bounds.round(-1).tolist()  # type: ignore[no-any-return]  # numpy

    near, far = wp(4000, 900, command=5100), wp(-9000, 900, command=5100)
    assert box() == box("0 20 0 0 0 0 0 0 0") == [[-2000.0, 2000.0], [-2000.0, 2900.0]]
    assert box(far, near) == [[-11000.0, 6000.0], [-2000.0, 2900.0]]
    # A rally point of another airfield, 110 km away, is not among them, nor is a default home.
    assert box(wp(0, 110_000, command=5100)) == box(home="47.4 8.5 488") == box()
    # Home is the map's origin: the mission is 11.1 km north of it, 0.1 degrees of 110.96 km each.
    (west, east), (south, north) = box(home="36.4 -84.2 100")
    assert (west, east, south) == (-2000.0, 2000.0, -2000.0)
    assert north == pytest.approx(11_096.0 + 2900.0, abs=20.0)


def test_a_mission_off_the_tile_is_refused() -> None:
    # 4 km north of 36.5 degrees, where a degree is 110.96 km; the tile ends at 36.446 degrees.
    words = r"flies to latitude 36\.5000\.\.36\.5360, longitude -84\.2000\.\.-84\.2000; the terrain covers latitude 36"
    with pytest.raises(TerrainError, match=words):
        implied_scenario(mission(wp(0, 0), wp(0, 4000), home="40 -84 0"), "jacksboro")
    # In a file whose latitudes and longitudes are swapped, and in one that no swap brings to the terrain.
    with pytest.raises(TerrainError, match=r"With latitude and longitude swapped, the mission would lie in this"):
        implied_scenario(mission("0 16 0 0 0 0 -84.2 36.3 900", "0 16 0 0 0 0 -84.21 36.31 900"), "jacksboro")
    with pytest.raises(TerrainError, match=r"longitude -84\.\d+\.\.-84\.\d+$"):
        implied_scenario(mission("0 16 0 0 0 0 36.3 -74.2 900", "0 16 0 0 0 0 36.31 -74.21 900"), "jacksboro")
    # On the other side of the world, where the file's coordinate system may have no pixels.
    with pytest.raises(TerrainError, match="no data at any position"):
        implied_scenario(mission("0 16 0 0 0 0 -36.3 95.7 900", "0 16 0 0 0 0 -36.31 95.7 900"), "jacksboro")


def test_the_ground_is_known_up_to_the_last_pixel_and_unknown_beyond() -> None:
    """Also close to the corner of the file, where no upright box of the map fits into it."""
    raster = open_raster("jacksboro")
    west, north = (float(values[0]) for values in raster.to_lon_lat(np.zeros(1), np.zeros(1)))
    # 1 m and 3 m inside the outer pixel centres; a degree of longitude is 89.6 km here.
    inside = f"0 16 0 0 0 0 {north - 1.0 / 110_960.0} {west + 3.0 / 89_600.0} 900"
    for_all = implied_scenario(mission(inside, "0 16 0 0 0 0 36.4 -84.3 900"), "jacksboro").scenario
    assert for_all.terrain is not None
    assert np.isfinite(for_all.terrain.height(for_all.start[0], for_all.start[1]))
    leaving = implied_scenario(mission("0 16 0 0 0 0 36.4 -84.3 900", "0 16 0 0 0 0 36.47 -84.3 900"), "jacksboro")
    end = leaving.scenario.destination
    assert leaving.scenario.terrain is not None
    assert np.isnan(leaving.scenario.terrain.height(end[0], end[1]))
    assert end[2] == 900.0


def test_a_mission_through_a_hill_has_a_scenario() -> None:
    """A mission through a hill is not bad input: it has a scenario, and its verdict says no."""
    lines = [f"0 16 0 0 0 0 {lat} -84.2 20" for lat in (36.24, 36.27)]
    read = mission(*lines, home="36.21 -84.2 300")
    scenario = implied_scenario(read, "jacksboro").scenario
    assert scenario.terrain is not None
    assert scenario.destination[2] > 100.0
    assert make_route(read, scenario.origin, scenario.terrain, 25.0, False).positions[:, 2].tolist() == [20.0, 20.0]


def origin_of(read: Mission) -> GeoOrigin:
    return mission_origin(read, make_itinerary(read).stops)


def test_the_origin_is_home_if_home_is_near() -> None:
    assert origin_of(mission(wp(0, 500), wp(0, 900))) == GeoOrigin(36.5, -84.2)
    # A ground station's default home on the other side of the world is nobody's home.
    away = origin_of(mission(wp(0, 500), wp(0, 900), home="47.4 8.5 488"))
    assert away.lat_deg == pytest.approx(36.5045, abs=1e-4)
