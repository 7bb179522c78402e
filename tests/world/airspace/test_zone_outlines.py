"""Outlines of zones and their walls, by plain sums."""

import numpy as np
import pytest

from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon
from world.airspace.zones_on_map import level_altitudes, zone_parts, zone_rings, zone_walls
from world.terrain import make_gridded_terrain

SQUARE = [(0.0, 0.0), (900.0, 0.0), (900.0, 900.0), (0.0, 900.0)]
HOLE = [(300.0, 300.0), (600.0, 300.0), (600.0, 600.0), (300.0, 600.0)]
ISLAND = [(400.0, 400.0), (500.0, 400.0), (500.0, 500.0), (400.0, 500.0)]
APART = [(2000.0, 0.0), (2500.0, 0.0), (2500.0, 500.0)]


def test_rings_are_closed_and_on_the_outline() -> None:
    (ring,) = zone_rings(Zone("it", "exclusion", Cylinder(50.0, -20.0, 300.0)))
    np.testing.assert_array_equal(ring[0], ring[-1])
    assert np.hypot(ring[:, 0] - 50.0, ring[:, 1] + 20.0) == pytest.approx(300.0)
    rings = zone_rings(Zone("it", "exclusion", make_polygon([SQUARE, HOLE])))
    assert [len(ring) for ring in rings] == [5, 5]
    assert {tuple(corner) for corner in rings[0].tolist()} == set(SQUARE)


def test_a_hole_goes_with_the_smallest_outline_about_it() -> None:
    parts = zone_parts(Zone("it", "exclusion", make_polygon([APART, HOLE, ISLAND, SQUARE])))
    spans = [[float(np.ptp(ring[:, 0])) for ring in part] for part in parts]
    assert sorted(spans) == [[100.0], [500.0], [900.0, 300.0]]


def test_levels_over_the_ground() -> None:
    ground = np.array([10.0, 40.0])
    assert level_altitudes(None, ground, 7.0).tolist() == [7.0, 7.0]
    assert level_altitudes(ZoneLevel(120.0, "amsl"), ground, 7.0).tolist() == [120.0, 120.0]
    assert level_altitudes(ZoneLevel(120.0, "ground"), ground, 7.0).tolist() == [130.0, 160.0]


def test_walls_stand_on_the_ground_and_end_at_the_ceiling() -> None:
    places = np.linspace(-2000.0, 2000.0, 41)
    slope = make_gridded_terrain(
        np.broadcast_to(0.1 * places, (41, 41)).copy(), places, places, source="", sha256="", datum=""
    )
    levels = ZoneLevel(-50.0, "amsl"), ZoneLevel(80.0, "ground")
    zone = Zone("it", "exclusion", make_polygon([SQUARE]), *levels)
    (wall,) = zone_walls(zone, slope, 0.0, 500.0)
    assert wall[:, 0, 2] == pytest.approx(0.1 * wall[:, 0, 0], abs=1e-3)  # a floor below the ground is on it
    assert wall[:, 1, 2] == pytest.approx(0.1 * wall[:, 0, 0] + 80.0, abs=1e-3)
    open_top = Zone("it", "exclusion", make_polygon([SQUARE]), ZoneLevel(200.0, "amsl"))
    (wall,) = zone_walls(open_top, slope, 0.0, 500.0)
    assert (wall[:, 0, 2].tolist(), wall[:, 1, 2].tolist()) == ([200.0] * 5, [500.0] * 5)
    (wall,) = zone_walls(Zone("it", "exclusion", make_polygon([SQUARE])), None, 3.0, 500.0)
    assert wall[:, 0, 2].tolist() == [3.0] * 5
