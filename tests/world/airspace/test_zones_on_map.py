"""Rings of degrees on a map: every corner in its place, and long edges as straight in degrees as they are drawn."""

from pathlib import Path

import numpy as np
import pytest

from tests.world.made.made_scenario import SMALL, made_spec, refused, with_fault
from tests.world.test_scenario_tables import SQUARE, zone
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneLevel
from world.airspace.zones_on_map import EDGE_BEND, first_violated_zone, ring_on_map
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_geo, to_map
from world.scenario import Scenario, load_scenario, scenario_from_spec

ORIGIN = GeoOrigin(46.0, 8.0)


def beside(points: list[tuple[float, float]], east: float, north: float) -> float:
    """Least distance from a place to the edges of a ring, by plain sums."""
    least = np.inf
    for (e0, n0), (e1, n1) in zip(points, [*points[1:], points[0]], strict=True):
        step, off = np.array([e1 - e0, n1 - n0]), np.array([east - e0, north - n0])
        share = np.clip(step @ off / max(float(step @ step), 1e-12), 0.0, 1.0)
        least = min(least, float(np.hypot(*(off - share * step))))
    return least


@pytest.mark.parametrize("size", [0.001, 0.05, 1.0])
def test_an_edge_along_a_parallel_stays_on_it(size: float) -> None:
    corners = [(46.3, 8.1), (46.3, 8.1 + size), (46.3 + size, 8.1)]
    ring = ring_on_map(ORIGIN, corners)
    for lat, lon in corners:
        east, north = to_map(ORIGIN, lat, lon)
        assert min(np.hypot(e - east, n - north) for e, n in ring) < 1e-6
    for share in np.linspace(0.0, 1.0, 97):
        east, north = to_map(ORIGIN, 46.3, 8.1 + share * size)
        assert beside(ring, float(east), float(north)) <= EDGE_BEND
    assert (len(ring) == 3) == (size < 0.01)


def test_a_ring_across_the_date_line_is_small() -> None:
    ring = np.array(ring_on_map(GeoOrigin(-17.0, 180.0), [(-17.0, 179.99), (-17.0, -179.99), (-17.01, -179.99)]))
    assert np.abs(ring).max() < 1_200.0


def test_a_ring_without_corners_has_none() -> None:
    assert ring_on_map(ORIGIN, []) == []


# ----------------------------------------------------------------------
# Zones of a scenario: placed on its map, refused by name, and the same from what was written down.


def loaded(tmp_path: Path, text: str) -> Scenario:
    file = tmp_path / "small.toml"
    file.write_text(SMALL + text, encoding="utf-8")
    return load_scenario(str(file))


def test_metres_stay_as_they_are(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, zone(SQUARE + "\nfloor_amsl_m = 300\nceiling_agl_m = 400"))
    corners = ((-500.0, 1000.0), (500.0, 1000.0), (500.0, 2000.0), (-500.0, 2000.0))
    floor, ceiling = ZoneLevel(300.0, "amsl"), ZoneLevel(400.0, "ground")
    assert scenario.zones == (Zone("town", "exclusion", Polygon((corners,)), floor, ceiling),)


def test_degrees_come_to_where_they_are(tmp_path: Path) -> None:
    origin = load_scenario("tight").origin  # that of every scenario that states none
    lat, lon = to_geo(origin, np.array([-500.0, 500.0, 0.0]), np.array([1000.0, 1000.0, 2000.0]))
    ring = [[round(float(a), 9), round(float(o), 9)] for a, o in zip(lat, lon, strict=True)]
    mast = f"lat_deg = {ring[2][0]}\nlon_deg = {ring[2][1]}\nradius_m = 80"
    scenario = loaded(tmp_path, zone(f"polygon_deg = {ring}") + zone(mast, name="mast"))
    town, tower = (one.shape for one in scenario.zones)
    assert isinstance(town, Polygon)
    np.testing.assert_allclose(town.rings[0], [(-500.0, 1000.0), (500.0, 1000.0), (0.0, 2000.0)], atol=1e-3)
    assert isinstance(tower, Cylinder)
    np.testing.assert_allclose((tower.east, tower.north, tower.radius), (0.0, 2000.0, 80.0), atol=1e-3)


def test_what_is_written_down_makes_the_same_zones(tmp_path: Path) -> None:
    ring = [[46.01, 8.0], [46.01, 8.01], [46.02, 8.0]]
    holes = "rings_m = [[[0, 0], [900, 0], [900, 900]], [[600, 100], [800, 100], [800, 300]]]"
    scenario = loaded(tmp_path, zone(f"polygon_deg = {ring}\nceiling_agl_m = 90") + zone(holes))
    again = scenario_from_spec(scenario.to_json(), "a log")
    assert again.zones == scenario.zones
    assert again.to_json() == scenario.to_json()


def test_a_scenario_without_zones_writes_none() -> None:
    assert "zones" not in load_scenario("tight").to_json()


# The start of the small scenario is at east -4000, north 0, 400 m AMSL and 200 m above its level ground.
AT_START = "polygon_m = [[-4500, -500], [-3500, -500], [-3500, 500], [-4500, 500]]"
ENDS = {
    "start inside": (zone(AT_START), "zones: town: start lies inside this exclusion zone"),
    "start inside by a metre": (zone(f"{AT_START}\nceiling_amsl_m = 401"), "zones: town: start lies inside"),
    "start inside above ground": (zone(f"{AT_START}\nfloor_agl_m = 199"), "zones: town: start lies inside"),
    "destination outside": (
        zone(AT_START, kind="inclusion"),
        "zones: town: destination lies outside this inclusion zone",
    ),
    "destination above": (
        zone("east_m = 0\nnorth_m = 0\nradius_m = 9000\nceiling_amsl_m = 399.9", kind="inclusion"),
        "zones: town: start lies outside this inclusion zone",
    ),
}


@pytest.mark.parametrize("case", ENDS)
def test_ends_on_the_wrong_side_are_refused(case: str, tmp_path: Path) -> None:
    text, wanted = ENDS[case]
    assert wanted in refused(tmp_path, with_fault("", text))


def test_ends_above_and_below_a_band_are_not_in_it(tmp_path: Path) -> None:
    below, above = zone(f"{AT_START}\nceiling_amsl_m = 399"), zone(f"{AT_START}\nfloor_agl_m = 201", name="high")
    held = zone("east_m = 0\nnorth_m = 0\nradius_m = 4001\nceiling_amsl_m = 400.1", name="all", kind="inclusion")
    assert [one.name for one in loaded(tmp_path, below + above + held).zones] == ["town", "high", "all"]


SHAPES = {
    "a bow tie": ("polygon_m = [[0, 900], [100, 1000], [100, 900], [0, 1000]]", "crosses or touches itself"),
    "two corners": ("polygon_m = [[0, 900], [100, 1000]]", "2 corners: at least three different ones are needed"),
    "no corner": ("polygon_m = []", "0 corners: at least three different ones are needed"),
    "no ring": ("rings_deg = []", "no corners: at least three are needed"),
    "a sliver": ("polygon_deg = [[46, 8], [46, 8.0001], [46.000000001, 8.0001]]", "encloses only"),
}


@pytest.mark.parametrize("case", SHAPES)
def test_what_is_no_shape_is_refused_by_its_name(case: str, tmp_path: Path) -> None:
    text, wanted = SHAPES[case]
    message = refused(tmp_path, with_fault("", zone(SQUARE) + zone(text, name="lake")))
    assert message.startswith("zones[1] (lake): ")
    assert wanted in message


def test_levels_above_ground_need_a_ground() -> None:
    spec = made_spec(zones=[{"name": "z", "kind": "exclusion", "east_m": 0.0, "north_m": 0.0, "radius_m": 9.0}])
    spec |= {"terrain": {"kind": "none"}, "start": spec["destination"], "threats": []}
    scenario_from_spec(spec, "a log", external=True)
    spec["zones"][0]["ceiling_agl_m"] = 50.0
    with pytest.raises(ScenarioError, match=r"zones\[0\] \(z\): ceiling_agl_m: requires terrain"):
        scenario_from_spec(spec, "a log", external=True)


def test_which_zone_a_place_violates() -> None:
    mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 200.0), ZoneLevel(100.0, "amsl"), ZoneLevel(300.0, "amsl"))
    field = Zone("field", "inclusion", Cylinder(0.0, 0.0, 500.0), None, ZoneLevel(400.0, "amsl"))
    cases = {
        (0.0, 0.0, 200.0): mast,
        (0.0, 199.9, 101.0): mast,
        (0.0, 200.1, 101.0): None,
        (0.0, 0.0, 99.0): None,
        (0.0, 0.0, 301.0): None,
        (0.0, 0.0, 401.0): field,
        (0.0, 501.0, 200.0): field,
    }
    for place, wanted in cases.items():
        assert first_violated_zone([mast, field], np.array(place), None) is wanted
    # Over unknown ground a place counts as within a band above ground: an exclusion's, and an inclusion's.
    for kind, wanted in (("exclusion", True), ("inclusion", False)):
        low = Zone("low", kind, Cylinder(0.0, 0.0, 50.0), None, ZoneLevel(9.0, "ground"))
        assert (first_violated_zone([low], np.zeros(3), None) is low) == wanted
