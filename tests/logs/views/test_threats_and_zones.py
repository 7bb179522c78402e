"""Sphere cuts lie on the sphere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.views.charts import Label, Layer
from logs.views.threats_and_zones import (
    PathPlane,
    cut_sphere,
    outline_label_position,
    zone_bands,
    zone_labels,
    zone_shapes,
    zone_text,
)
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon


@given(
    st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), min_size=1, max_size=20),
    st.floats(1.0, 5e3),
    st.floats(-100.0, 900.0),
)
def test_cuts_lie_on_the_sphere(points_below: list[tuple[float, float]], radius: float, up: float) -> None:
    centre = np.array([120.0, -40.0, up])
    points = np.array([[east, north, 0.0] for east, north in points_below])
    lower, upper = cut_sphere(centre, radius, points)
    for (east, north), low, high in zip(points_below, lower, upper, strict=True):
        beside = np.hypot(east - 120.0, north + 40.0)
        assert np.isnan(low) == np.isnan(high) == (beside**2 > radius**2) or beside == pytest.approx(radius)
        if not np.isnan(high):
            assert np.hypot(beside, high - up) == pytest.approx(radius, rel=1e-9)
            assert low + high == pytest.approx(2 * up, abs=1e-6)


def test_a_name_touches_the_top_the_foot_or_the_left_edge_that_is_in_the_picture() -> None:
    """A sphere of 300 m at 500 m, cut through its middle from 1 km to 1.6 km."""
    kilometres = np.linspace(0.0, 3.0, 3001)
    points = np.column_stack([1000.0 * kilometres, np.zeros(3001), np.zeros(3001)])
    cut = kilometres, *cut_sphere(np.array([1300.0, 0.0, 500.0]), 300.0, points)

    def anchor(low: float, high: float) -> tuple[float, float, tuple[int, int]] | None:
        return outline_label_position(*cut, np.full(3001, low), high)

    assert anchor(0.0, 1000.0) == (pytest.approx(1.3), pytest.approx(800.0), (0, 1))
    assert anchor(0.0, 700.0) == (pytest.approx(1.3), pytest.approx(200.0), (0, -1))
    # 4 % below the upper rim, on the left flank: of the upper half at 596 m, of the lower one at 396 m.
    for low, high, up in ((300.0, 600.0, 588.0), (300.0, 400.0, 396.0)):
        (east, amsl, side) = anchor(low, high) or (0.0, 0.0, (0, 0))
        assert (amsl, side) == (pytest.approx(up, abs=6.0), (1, 0))
        assert np.hypot(1000.0 * east - 1300.0, amsl - 500.0) == pytest.approx(300.0)
        assert east < 1.3
    assert anchor(900.0, 1000.0) is None
    assert anchor(450.0, 460.0) is not None


def test_no_name_stands_under_the_ground() -> None:
    """The sphere reaches out of the picture above, and its foot, at 200 m, is under a hill of 250 m."""
    kilometres = np.linspace(0.0, 3.0, 3001)
    points = np.column_stack([1000.0 * kilometres, np.zeros(3001), np.zeros(3001)])
    cut = kilometres, *cut_sphere(np.array([1300.0, 0.0, 500.0]), 300.0, points)
    ground = np.where(np.abs(kilometres - 1.3) < 0.2, 250.0, 0.0)
    (_, amsl, side) = outline_label_position(*cut, ground, 700.0) or (0.0, 0.0, (0, 0))
    assert (amsl, side) == (pytest.approx(672.0, abs=6.0), (1, 0))
    assert outline_label_position(*cut, 0.0 * ground, 700.0) == (pytest.approx(1.3), pytest.approx(200.0), (0, -1))


# ----------------------------------------------------------------------
# Zones stand where the data puts them, on the map and on the profile.

SQUARE = make_polygon([[(1000.0, -500.0), (2000.0, -500.0), (2000.0, 500.0), (1000.0, 500.0)]])
KEEP_OUT, STAY_IN = Zone("town", "exclusion", SQUARE), Zone("fence", "inclusion", Cylinder(1500.0, 0.0, 1400.0))


@pytest.mark.parametrize(
    ("floor", "ceiling", "text"),
    [
        (None, None, "town"),
        (None, ZoneLevel(120.0, "ground"), "town, below 120 m above ground"),
        (ZoneLevel(600.0, "amsl"), None, "town, above 600 m AMSL"),
        (ZoneLevel(100.0, "amsl"), ZoneLevel(600.0, "amsl"), "town, 100 to 600 m AMSL"),
        (ZoneLevel(50.0, "ground"), ZoneLevel(600.0, "amsl"), "town, 50 m above ground to 600 m AMSL"),
    ],
)
def test_labels_say_the_heights(floor: ZoneLevel | None, ceiling: ZoneLevel | None, text: str) -> None:
    assert zone_text(Zone("town", "exclusion", SQUARE, floor, ceiling)) == text


def test_shapes_are_drawn_where_they_are() -> None:
    exclusion, inclusion = zone_shapes((KEEP_OUT, STAY_IN))
    assert (exclusion.kind, exclusion.legend) == ("area", "zone to keep out of")
    assert (exclusion.x.min(), exclusion.x.max(), exclusion.y.min(), exclusion.y.max()) == (
        1000.0,
        2000.0,
        -500.0,
        500.0,
    )
    assert (inclusion.kind, inclusion.legend) == ("line", "edge of a zone to stay in")
    assert (inclusion.x.min(), inclusion.x.max()) == pytest.approx((100.0, 2900.0))
    assert zone_shapes(()) == zone_labels(()) == ()


def test_names_stand_in_exclusions_and_at_an_inclusions_edge() -> None:
    town, fence = zone_labels((KEEP_OUT, STAY_IN))
    assert (town.x, town.y, town.prefer) == (pytest.approx(1500.0), pytest.approx(0.0), (0, 0))
    assert (fence.y, fence.prefer) == (pytest.approx(1400.0), (0, 1))


def bands(zone: Zone) -> tuple[list[Layer], list[Label]]:
    """What is forbidden over a straight way at 200 m, ground at 50 m, and names."""
    kilometres = np.linspace(0.0, 3.0, 301)
    points = np.column_stack([1000.0 * kilometres, np.zeros(301), np.full(301, 200.0)])
    return zone_bands((zone,), PathPlane(kilometres, points, np.full(301, 50.0), 0.0, 400.0))


def box(layer: Layer) -> tuple[float, float, float, float]:
    where = np.isfinite(layer.y)
    assert layer.lower_edge is not None
    return layer.x[where].min(), layer.lower_edge[where].min(), layer.x[where].max(), layer.y[where].max()


def test_an_exclusion_takes_its_band_where_the_way_is_over_it() -> None:
    (band,), (name,) = bands(Zone("town", "exclusion", SQUARE, ZoneLevel(100.0, "ground"), ZoneLevel(300.0, "amsl")))
    assert box(band) == pytest.approx((1.0, 150.0, 2.0, 300.0))
    assert name.text.startswith("town")
    assert (name.x, name.y) == pytest.approx((1.5, 225.0))


def test_an_inclusion_takes_what_is_outside_it() -> None:
    """Before 1 km and after 2 km the straight way is outside the square: one band in two parts."""
    areas, names = bands(Zone("fence", "inclusion", SQUARE, None, ZoneLevel(300.0, "amsl")))
    above, outside = areas
    assert box(above) == pytest.approx((1.0, 300.0, 2.0, 400.0))
    assert outside.x[np.isnan(outside.y)][[0, -1]] == pytest.approx([1.0, 2.0])
    assert box(outside) == pytest.approx((0.0, 0.0, 3.0, 400.0))
    assert names == []
