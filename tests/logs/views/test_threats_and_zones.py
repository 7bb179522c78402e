"""Sphere cuts lie on the sphere."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure

from logs.views.failures import LabelPlacer
from logs.views.threats_and_zones import (
    draw_zone_cuts,
    draw_zone_shapes,
    name_zones,
    outline_anchor,
    sphere_cuts,
    zone_handles,
    zone_label,
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
    lower, upper = sphere_cuts(centre, radius, points)
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
    cut = kilometres, *sphere_cuts(np.array([1300.0, 0.0, 500.0]), 300.0, points)

    def anchor(low: float, high: float) -> tuple[float, float, tuple[int, int]] | None:
        return outline_anchor(*cut, np.full(3001, low), high)

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
    cut = kilometres, *sphere_cuts(np.array([1300.0, 0.0, 500.0]), 300.0, points)
    ground = np.where(np.abs(kilometres - 1.3) < 0.2, 250.0, 0.0)
    (_, amsl, side) = outline_anchor(*cut, ground, 700.0) or (0.0, 0.0, (0, 0))
    assert (amsl, side) == (pytest.approx(672.0, abs=6.0), (1, 0))
    assert outline_anchor(*cut, 0.0 * ground, 700.0) == (pytest.approx(1.3), pytest.approx(200.0), (0, -1))


# ----------------------------------------------------------------------
# Zones stand where the data puts them, on the map and on the profile.

SQUARE = make_polygon([[(1000.0, -500.0), (2000.0, -500.0), (2000.0, 500.0), (1000.0, 500.0)]])
KEEP_OUT, STAY_IN = Zone("town", "exclusion", SQUARE), Zone("fence", "inclusion", Cylinder(1500.0, 0.0, 1400.0))


@pytest.fixture
def axes() -> Any:
    axes = Figure(figsize=(8, 6), dpi=100).add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(0.0, 3000.0), ylim=(-1500.0, 1500.0))
    return axes


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
    assert zone_label(Zone("town", "exclusion", SQUARE, floor, ceiling)) == text


def test_shapes_are_drawn_where_they_are(axes: Any) -> None:
    handles = draw_zone_shapes(axes, (KEEP_OUT, STAY_IN))
    exclusions, inclusions = [item for item in axes.collections if isinstance(item, PatchCollection)]
    box = exclusions.get_paths()[0].get_extents()
    assert (box.x0, box.x1, box.y0, box.y1) == (1000.0, 2000.0, -500.0, 500.0)
    box = inclusions.get_paths()[0].get_extents()
    assert (box.x0, box.x1) == pytest.approx((100.0, 2900.0))
    assert exclusions.get_hatch()
    assert not inclusions.get_hatch()
    assert [handle.get_label() for handle in handles] == ["zone to keep out of", "edge of a zone to stay in"]


def test_nothing_is_drawn_without_zones(axes: Any) -> None:
    assert draw_zone_shapes(axes, ()) == zone_handles(()) == []
    assert len(axes.collections) == 0


def test_names_stand_in_exclusions_and_at_an_inclusions_edge(axes: Any) -> None:
    name_zones(axes, (KEEP_OUT, STAY_IN), LabelPlacer(axes))
    places = {text.get_text(): axes.transData.inverted().transform(text.get_window_extent()) for text in axes.texts}
    assert places["town"].mean(axis=0) == pytest.approx([1500.0, 0.0], abs=60.0)
    assert places["fence"][0, 1] >= 1300.0


def cuts(axes: Any, zone: Zone) -> tuple[list[np.ndarray], list[tuple[str, float, float]]]:
    """Filled areas over a straight way at 200 m, ground at 50 m, and names."""
    axes.set(xlim=(0.0, 3.0), ylim=(0.0, 400.0))
    distance = np.linspace(0.0, 3000.0, 301)
    points = np.column_stack([distance, np.zeros(301), np.full(301, 200.0)])
    names = draw_zone_cuts(axes, (zone,), distance, points, np.full(301, 50.0))
    return [path.vertices for item in axes.collections for path in item.get_paths()], names


def test_an_exclusion_takes_its_band_where_the_way_is_over_it(axes: Any) -> None:
    zone = Zone("town", "exclusion", SQUARE, ZoneLevel(100.0, "ground"), ZoneLevel(300.0, "amsl"))
    (area,), ((name, middle, amsl),) = cuts(axes, zone)
    assert (area[:, 0].min(), area[:, 0].max()) == pytest.approx((1.0, 2.0))
    assert (area[:, 1].min(), area[:, 1].max()) == pytest.approx((150.0, 300.0))
    assert name.startswith("town")
    assert (middle, amsl) == pytest.approx((1.5, 225.0))


def test_an_inclusion_takes_what_is_outside_it(axes: Any) -> None:
    zone = Zone("fence", "inclusion", SQUARE, None, ZoneLevel(300.0, "amsl"))
    areas, names = cuts(axes, zone)
    boxes = sorted((*np.round(area.min(axis=0), 6), *np.round(area.max(axis=0), 6)) for area in areas)
    assert boxes == [(0.0, 0.0, 0.99, 400.0), (1.0, 300.0, 2.0, 400.0), (2.01, 0.0, 3.0, 400.0)]
    assert names == []
