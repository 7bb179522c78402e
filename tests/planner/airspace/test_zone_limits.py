"""The airspace of a problem: what is kept below a greatest height, and the ground seen from below."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import shapely

from benchmarks.airspace.scenarios import star
from planner.airspace.zone_limits import (
    ZoneMargins,
    add_margins,
    first_exclusion_near,
    is_limited,
    make_airspace,
    segment_between,
    view_shape,
)
from world.airspace.zone_kernels import zone_records
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon
from world.scenario import Scenario

MARGINS = ZoneMargins(10.0, 5.0, 0.75)
FLAT = {"kind": "flat", "amsl_m": 20}
ZONE = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 900, "radius_m": 200}


def test_nothing_is_limited_without_zones_and_greatest_height(small: Callable[..., Scenario]) -> None:
    assert not is_limited(make_airspace(small(), MARGINS, 5.0))
    assert is_limited(make_airspace(small(zones=[ZONE]), MARGINS, 5.0))
    assert is_limited(make_airspace(small(limits={"max_height_m": 400}), MARGINS, 5.0))


@pytest.mark.parametrize(("most", "kept"), [(140.0, 5.0), (134.0, 0.75 * 3.99)])
def test_an_end_near_the_greatest_height_leaves_a_share_of_what_it_keeps(
    small: Callable[..., Scenario], most: float, kept: float
) -> None:
    """The ends are 130 m above ground."""
    space = make_airspace(small(terrain=FLAT, limits={"max_height_m": most}), MARGINS, 5.0)
    assert (space.max_height, space.buffer) == (most, 5.0)
    assert (space.start_buffer, space.destination_buffer) == pytest.approx((kept, kept))


def test_depths_are_the_heights_with_the_other_sign_where_they_are_asked_for(small: Callable[..., Scenario]) -> None:
    scenario = small(limits={"max_height_m": 400})
    assert scenario.terrain is not None
    np.testing.assert_array_equal(make_airspace(scenario, MARGINS, 5.0).depths, -scenario.terrain.heights)
    above = small(zones=[ZONE | {"floor_agl_m": 100}])
    assert make_airspace(above, MARGINS, 5.0).depths.shape == scenario.terrain.heights.shape
    assert math.isinf(make_airspace(small(zones=[ZONE]), MARGINS, 5.0).max_height)
    assert make_airspace(small(zones=[ZONE]), MARGINS, 5.0).depths.size == 4


# ----------------------------------------------------------------------
# The order of zones, those near a place, and margins that give way to fixed ends.

FAR = np.zeros((0, 3))


def cylinders(*east_radius: tuple[float, float]) -> list[Zone]:
    return [Zone(f"zone {k}", "exclusion", Cylinder(east, 0.0, radius)) for k, (east, radius) in enumerate(east_radius)]


def test_inclusions_come_first_and_exclusions_from_west_to_east() -> None:
    zones = cylinders((500.0, 10.0), (-500.0, 10.0))
    zones.append(Zone("fence", "inclusion", Cylinder(0.0, 0.0, 5000.0)))
    zones_with_margins = add_margins(zones, FAR, None, ZoneMargins(10.0, 5.0, 1.0))
    assert zones_with_margins.required["number"].tolist() == [2, 1, 0]
    assert zones_with_margins.inclusions == 1


def test_no_exclusion_near_a_place_comes_before_the_first_near_it() -> None:
    """Also behind a wide one that hides, by its western edge, how far east it reaches."""
    rng = np.random.default_rng(5)
    zones = cylinders((0.0, 900.0), *zip(rng.uniform(-3000.0, 3000.0, 60), rng.uniform(5.0, 200.0, 60), strict=True))
    zones_with_margins = add_margins(zones, FAR, None, ZoneMargins(10.0, 5.0, 1.0))
    for west in rng.uniform(-3500.0, 3500.0, 50):
        first = first_exclusion_near(zones_with_margins, west)
        assert (zones_with_margins.records.zones["east"][:first] < west).all()
        assert first == len(zones) or zones_with_margins.records.zones["east"][first] >= west


@pytest.mark.parametrize(("east", "beside"), [(211.0, 10.0), (206.0, 3.0), (199.0, 0.0)])
def test_an_end_beside_an_exclusion_leaves_half_of_what_it_keeps(east: float, beside: float) -> None:
    ends = np.array([[east, 0.0, 50.0]])
    required = add_margins(cylinders((0.0, 200.0)), ends, None, ZoneMargins(10.0, 5.0, 0.5)).required
    assert (float(required["horizontal"][0]), float(required["vertical"][0])) == pytest.approx((beside, 5.0), abs=1e-9)


def test_an_end_below_a_floor_leaves_half_of_what_it_keeps_in_height() -> None:
    zone = Zone("city", "exclusion", Cylinder(0.0, 0.0, 200.0), floor=ZoneLevel(54.0, "amsl"))
    required = add_margins([zone], np.array([[0.0, 0.0, 50.0]]), None, ZoneMargins(10.0, 5.0, 0.5)).required
    assert (float(required["horizontal"][0]), float(required["vertical"][0])) == (10.0, 2.0)


def test_an_end_near_the_edge_of_an_inclusion_leaves_half_of_what_it_keeps_there() -> None:
    square = make_polygon([[(0.0, 0.0), (900.0, 0.0), (900.0, 900.0), (0.0, 900.0)]])
    zone = Zone("fence", "inclusion", square, ceiling=ZoneLevel(52.0, "amsl"))
    required = add_margins([zone], np.array([[894.0, 450.0, 50.0]]), None, ZoneMargins(10.0, 5.0, 0.5)).required
    assert (float(required["horizontal"][0]), float(required["vertical"][0])) == pytest.approx((3.0, 1.0))


# ----------------------------------------------------------------------
# Shapes seen from a line, against a library of geometry.


def test_polygons_as_a_library_of_geometry_sees_them() -> None:
    rng = np.random.default_rng(7)
    met = 0
    for _ in range(400):
        ring = star(rng, rng.uniform(-600.0, 600.0, 2), float(rng.uniform(50.0, 700.0)), int(rng.integers(3, 12)))
        records = zone_records([Zone("it", "exclusion", make_polygon([[(x, y) for x, y in ring]]))])
        a, b = rng.uniform(-1500.0, 1500.0, (2, 2))
        reach = view_shape(records, 0, segment_between(*a, *b), 5000.0)
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
    reach = view_shape(records, 0, segment_between(*a, *b), 1000.0)
    assert (reach.inside, reach.distance) == (inside, pytest.approx(distance))


def test_a_distance_beyond_what_was_asked_for_is_not_told() -> None:
    square = make_polygon([[(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)]])
    records = zone_records([Zone("it", "exclusion", square)])
    line = segment_between(-50.0, 30.0, 50.0, 30.0)
    assert view_shape(records, 0, line, 21.5).distance == 21.0
    assert math.isinf(view_shape(records, 0, line, 20.5).distance)
