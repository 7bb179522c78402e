"""Shapes seen from a line, against a library of geometry."""

import math

import numpy as np
import pytest
import shapely

from planner.airspace.zone_reach import line_between, reach_of
from tests.bench.airspace.scenarios import star
from world.airspace.zone_kernels import zone_records
from world.airspace.zones import Cylinder, Zone, make_polygon


def test_polygons_as_a_library_of_geometry_sees_them() -> None:
    rng = np.random.default_rng(7)
    met = 0
    for _ in range(400):
        ring = star(rng, rng.uniform(-600.0, 600.0, 2), float(rng.uniform(50.0, 700.0)), int(rng.integers(3, 12)))
        records = zone_records([Zone("it", "exclusion", make_polygon([[(x, y) for x, y in ring]]))])
        a, b = rng.uniform(-1500.0, 1500.0, (2, 2))
        reach = reach_of(records, 0, line_between(*a, *b), 5000.0)
        shape, line = shapely.Polygon(ring), shapely.LineString([a, b])
        assert reach.inside == shape.contains(shapely.Point(a))
        assert reach.distance == pytest.approx(shape.exterior.distance(line), abs=1e-6)
        met += reach.distance == 0.0
        course = (b - a) / np.linalg.norm(b - a)
        along, off = (np.array(ring) - a) @ course, (np.array(ring) - a) @ np.array([-course[1], course[0]])
        assert (reach.right, reach.left) == pytest.approx((off.min(), off.max()))
        assert (reach.first, reach.last) == pytest.approx((along.min(), along.max()))
    assert 40 < met < 360


@pytest.mark.parametrize(
    ("a", "b", "inside", "distance"),
    [
        ((-500.0, 130.0), (500.0, 130.0), False, 30.0),  # past it
        ((-500.0, 60.0), (500.0, 60.0), False, 0.0),  # across it
        ((-30.0, 40.0), (30.0, 40.0), True, 50.0),  # within it, its ends 50 m from the centre
        ((0.0, 0.0), (500.0, 0.0), True, 0.0),  # out of it
        ((200.0, 0.0), (500.0, 0.0), False, 100.0),  # away from it
    ],
)
def test_circles_by_plain_sums(a: tuple[float, float], b: tuple[float, float], inside: bool, distance: float) -> None:
    records = zone_records([Zone("it", "exclusion", Cylinder(0.0, 0.0, 100.0))])
    reach = reach_of(records, 0, line_between(*a, *b), 1000.0)
    assert (reach.inside, reach.distance) == (inside, pytest.approx(distance))


def test_a_distance_beyond_what_was_asked_for_is_not_told() -> None:
    square = make_polygon([[(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)]])
    records = zone_records([Zone("it", "exclusion", square)])
    line = line_between(-50.0, 30.0, 50.0, 30.0)
    assert reach_of(records, 0, line, 21.5).distance == 21.0
    assert math.isinf(reach_of(records, 0, line, 20.5).distance)
