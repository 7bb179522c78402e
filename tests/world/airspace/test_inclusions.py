"""Unions of inclusions, whose corners are counted by hand."""

from functools import reduce

import pytest
import shapely

from world.airspace.inclusions import unite_inclusions
from world.airspace.zones import Cylinder, Polygon, Zone, make_polygon


def test_a_union_of_inclusions_holds_what_any_of_them_holds() -> None:
    """Two squares of 1,000 m that share a strip of 200 m, a third apart, and an exclusion that stays."""
    squares = [
        Zone(f"square {k}", "inclusion", make_polygon([[(x, 0.0), (x + 1e3, 0.0), (x + 1e3, 1e3), (x, 1e3)]]))
        for k, x in enumerate((0.0, 800.0, 5000.0))
    ]
    mast = Zone("mast", "exclusion", Cylinder(500.0, 500.0, 50.0))
    union, kept = unite_inclusions([*squares, mast])
    assert isinstance(union.shape, Polygon)
    assert kept is mast
    assert sorted(len(ring) for ring in union.shape.rings) == [4, 8]
    east = [corner[0] for ring in union.shape.rings for corner in ring]
    assert (min(east), max(east)) == (0.0, 6000.0)
    assert unite_inclusions([squares[0], mast]) == (squares[0], mast)


def test_a_union_keeps_the_parts_and_the_holes_of_an_inclusion() -> None:
    """Two parts of 1,000 m, the first with a hole of 400 m, and a third square that covers half of the hole."""

    def square(east: float, north: float, side: float) -> list[tuple[float, float]]:
        return [(east, north), (east + side, north), (east + side, north + side), (east, north + side)]

    parts = make_polygon([square(0.0, 0.0, 1e3), square(300.0, 300.0, 400.0), square(3e3, 0.0, 1e3)])
    (union,) = unite_inclusions(
        [Zone("two parts", "inclusion", parts), Zone("half", "inclusion", make_polygon([square(500.0, 0.0, 1e3)]))]
    )
    assert isinstance(union.shape, Polygon)
    area = reduce(shapely.symmetric_difference, map(shapely.Polygon, union.shape.rings))
    # The first part and the third square cover 1,500 m by 1,000 m, but for the uncovered half of the hole.
    assert area.area == pytest.approx(1500.0 * 1000.0 - 200.0 * 400.0 + 1e6)
    for east, north, is_inside in ((400.0, 500.0, False), (600.0, 500.0, True), (3500.0, 500.0, True)):
        assert area.contains(shapely.Point(east, north)) is is_inside
