"""Unions of inclusions, whose corners are counted by hand."""

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
