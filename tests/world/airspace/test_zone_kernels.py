"""Distances to zones against shapely, which knows none of our formulas, and against plain sums on a square."""

import math

import numpy as np
import pytest
import shapely

from world.airspace.zone_kernels import (
    ZoneRecords,
    box_distance,
    edge_distance,
    height_outside_band,
    inside_fraction,
    segment_distance,
    zone_records,
)
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon

SQUARE = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)]
HOLE = [(40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0)]


def star(rng: np.random.Generator, corners: int) -> list[tuple[float, float]]:
    """Corners about a middle at growing bearings: a ring that does not cross itself."""
    bearing = (np.arange(corners) + rng.uniform(0.0, 0.8, corners)) * 2.0 * math.pi / corners
    radius = rng.uniform(200.0, 1000.0, corners)
    return [(float(r * math.sin(b)), float(r * math.cos(b))) for b, r in zip(bearing, radius, strict=True)]


def region(zone: Zone) -> shapely.Polygon:
    assert not isinstance(zone.shape, Cylinder)
    outline, *holes = zone.shape.rings
    return shapely.Polygon(outline, holes)


def polygons() -> tuple[list[Zone], ZoneRecords]:
    rng = np.random.default_rng(5)
    shapes = [make_polygon([star(rng, corners)]) for corners in (3, 4, 7, 50)]
    zones = [Zone("z", "exclusion", shape) for shape in (*shapes, make_polygon([SQUARE, HOLE]))]
    return zones, zone_records(zones)


def test_the_distance_to_an_outline_is_shapelys() -> None:
    zones, records = polygons()
    rng = np.random.default_rng(6)
    for z, zone in enumerate(zones):
        shape = region(zone)
        for east, north in rng.uniform(-1200.0, 1200.0, (100, 2)):
            place = shapely.Point(east, north)
            away = shape.boundary.distance(place)
            assert edge_distance(records, z, east, north) == pytest.approx(
                -away if shape.contains(place) else away, abs=1e-9
            )


def test_the_distance_of_a_segment_and_its_share_inside_are_shapelys() -> None:
    zones, records = polygons()
    rng = np.random.default_rng(7)
    met = 0
    for z, zone in enumerate(zones):
        shape = region(zone)
        for ax, ay, bx, by in rng.uniform(-1200.0, 1200.0, (150, 4)):
            line = shapely.LineString([(ax, ay), (bx, by)])
            away, share = segment_distance(records, z, ax, ay, bx, by)
            assert away == pytest.approx(line.distance(shape), abs=1e-9)
            at = edge_distance(records, z, ax + share * (bx - ax), ay + share * (by - ay))
            assert at == pytest.approx(away, abs=1e-6) if away > 0.0 else at <= 1e-6
            inside = line.intersection(shape).length / line.length
            assert inside_fraction(records, z, ax, ay, bx, by, 0.0, 1.0) == pytest.approx(inside, abs=1e-9)
            met += 0.0 < inside < 1.0
    assert met > 150


def test_a_part_of_a_segment_counts_by_itself() -> None:
    records = zone_records([Zone("z", "exclusion", make_polygon([SQUARE, HOLE]))])
    # From 50 m west of the square to 50 m east of it: inside from a quarter to 0.45, and from 0.55 to 0.75.
    way = (-50.0, 50.0, 150.0, 50.0)
    for (first, last), wanted in {(0.0, 1.0): 0.4, (0.3, 0.5): 0.15, (0.46, 0.54): 0.0, (0.6, 0.7): 0.1}.items():
        assert inside_fraction(records, 0, *way, first, last) == pytest.approx(wanted, abs=1e-12)
    # A way that ends on the outline, and one through a corner.
    assert inside_fraction(records, 0, -50.0, 50.0, 0.0, 50.0, 0.0, 1.0) == pytest.approx(0.0, abs=1e-12)
    assert inside_fraction(records, 0, -20.0, -20.0, 30.0, 30.0, 0.0, 1.0) == pytest.approx(0.6, abs=1e-12)


def test_a_cylinder_by_plain_sums() -> None:
    records = zone_records([Zone("z", "exclusion", Cylinder(10.0, 20.0, 50.0))])
    assert edge_distance(records, 0, 10.0, 90.0) == pytest.approx(20.0)
    assert edge_distance(records, 0, 10.0, 60.0) == pytest.approx(-10.0)
    # 30 m beside the centre a chord is 80 m long.
    assert inside_fraction(records, 0, -90.0, 50.0, 110.0, 50.0, 0.0, 1.0) == pytest.approx(0.4)
    assert inside_fraction(records, 0, -90.0, 71.0, 110.0, 71.0, 0.0, 1.0) == 0.0
    assert segment_distance(records, 0, -90.0, 75.0, 110.0, 75.0) == pytest.approx((5.0, 0.5))
    assert segment_distance(records, 0, -90.0, 65.0, 110.0, 65.0)[0] == 0.0
    # On the spot, inside and outside.
    assert inside_fraction(records, 0, 10.0, 69.9, 10.0, 69.9, 0.0, 1.0) == 1.0
    assert inside_fraction(records, 0, 10.0, 70.1, 10.0, 70.1, 0.0, 1.0) == 0.0
    assert segment_distance(records, 0, 10.0, 71.0, 10.0, 71.0)[0] == pytest.approx(1.0)


def test_a_band_of_heights() -> None:
    shape = Cylinder(0.0, 0.0, 50.0)
    bands = (
        (ZoneLevel(200.0, "amsl"), ZoneLevel(300.0, "amsl")),
        (ZoneLevel(30.0, "ground"), ZoneLevel(120.0, "ground")),
        (None, ZoneLevel(120.0, "ground")),
        (ZoneLevel(200.0, "amsl"), None),
        (None, None),
    )
    zones = zone_records([Zone("z", "inclusion", shape, floor, ceiling) for floor, ceiling in bands]).zones
    assert [height_outside_band(zones[0], up, 500.0) for up in (190.0, 260.0, 310.0)] == [10.0, -40.0, 10.0]
    assert [height_outside_band(zones[1], up, 500.0) for up in (520.0, 590.0, 621.0)] == [10.0, -30.0, 1.0]
    assert height_outside_band(zones[2], 0.0, 500.0) == -620.0
    assert [height_outside_band(zones[3], up, math.nan) for up in (190.0, 9000.0)] == [10.0, -8800.0]
    assert height_outside_band(zones[4], 0.0, math.nan) == -math.inf
    for z in (1, 2):
        assert math.isnan(height_outside_band(zones[z], 520.0, math.nan))


def test_boxes() -> None:
    records = zone_records([Zone("z", "exclusion", Cylinder(0.0, 0.0, 50.0))])
    assert box_distance(records, 0, 80.0, 90.0, -90.0, -90.0) == 50.0
    assert box_distance(records, 0, 40.0, 90.0, 0.0, 10.0) == 0.0
