"""Zones as data: what is a shape and what is none, and which way its rings run."""

import math

import pytest

from world.airspace.zones import Cylinder, Polygon, Zone, ZoneLevel, is_hole, make_cylinder, make_polygon

SQUARE = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)]
HOLE = [(40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0)]
ISLAND = [(48.0, 48.0), (52.0, 48.0), (52.0, 52.0), (48.0, 52.0)]


def twice_area(polygon: Polygon) -> float:
    """Twice the sum of the rings' areas, anticlockwise positive (the shoelace formula)."""
    return sum(
        e0 * n1 - e1 * n0
        for ring in polygon.rings
        for (e0, n0), (e1, n1) in zip(ring, (*ring[1:], ring[0]), strict=True)
    )


@pytest.mark.parametrize("turned", [False, True])
def test_outlines_run_anticlockwise_and_holes_clockwise(turned: bool) -> None:
    rings = [ring[::-1] if turned else ring for ring in (HOLE, SQUARE, ISLAND)]
    polygon = make_polygon(rings)
    assert [is_hole(ring) for ring in polygon.rings] == [True, False, False]
    assert twice_area(polygon) == 2.0 * (100.0**2 - 20.0**2 + 4.0**2)


def test_a_ring_may_be_closed_or_open_and_repeat_a_corner() -> None:
    closed = make_polygon([[*SQUARE[:2], SQUARE[1], *SQUARE[2:], SQUARE[0]]])
    assert closed == make_polygon([SQUARE])
    assert len(closed.rings[0]) == 4


def test_parts_that_touch_at_a_corner_are_allowed() -> None:
    other = [(100.0, 100.0), (150.0, 100.0), (150.0, 150.0)]
    assert twice_area(make_polygon([SQUARE, other])) == 2.0 * 100.0**2 + 50.0**2


FAULTS = {
    "no ring": ([], "no corners"),
    "two corners": ([SQUARE[:2]], "2 corners: at least three"),
    "three of which two are one": ([[(0.0, 0.0), (0.0, 0.0), (9.0, 9.0)]], "2 corners: at least three"),
    "a bow tie": (
        [[(0.0, 0.0), (100.0, 100.0), (100.0, 0.0), (0.0, 100.0)]],
        r"crosses or touches itself \(Self-intersection at east 50.0 m, north 50.0 m\)",
    ),
    "a line": ([[(0.0, 0.0), (100.0, 0.0), (50.0, 0.0)]], "crosses or touches itself|encloses only"),
    "a sliver": ([[(0.0, 0.0), (100.0, 0.0), (100.0, 0.0199)]], "encloses only 0.995 m2"),
    "not a number": ([[(0.0, 0.0), (100.0, math.nan), (50.0, 9.0)]], "not a number"),
    "rings that cross": ([SQUARE, [(50.0, 50.0), (150.0, 50.0), (150.0, 60.0)]], "cross each other"),
    "a ring twice": ([SQUARE, SQUARE], "cross each other"),
    "an edge shared": ([SQUARE, [(100.0, 0.0), (200.0, 0.0), (100.0, 100.0)]], "share an edge"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_polygon(case: str) -> None:
    rings, wanted = FAULTS[case]
    with pytest.raises(ValueError, match=wanted):
        make_polygon(rings)


def test_a_square_metre_is_enough() -> None:
    assert make_polygon([[(0.0, 0.0), (100.0, 0.0), (100.0, 0.0201)]]).rings


@pytest.mark.parametrize(
    ("place", "wanted"),
    [((0.0, 0.0, -5.0), "must be above 0"), ((0.0, 0.0, math.nan), "above 0"), ((math.nan, 0.0, 9.0), "not a number")],
)
def test_what_is_no_cylinder(place: tuple[float, float, float], wanted: str) -> None:
    with pytest.raises(ValueError, match=wanted):
        make_cylinder(*place)


def test_a_zone_knows_whether_it_needs_the_ground() -> None:
    sea, ground = ZoneLevel(500.0, "amsl"), ZoneLevel(120.0, "ground")
    shape = Cylinder(0.0, 0.0, 50.0)
    assert not Zone("a", "inclusion", shape, sea, sea).has_level_above_ground
    assert Zone("a", "inclusion", shape, sea, ground).has_level_above_ground
    assert Zone("a", "inclusion", shape, ground).has_level_above_ground
